"""``scenarionet report``: write an HTML report about a lake."""

from __future__ import annotations

import click

from scenarionet_data.errors import BadParameter
from scenarionet_data.storage.files.places import local_path
from scenarionet_pipelines.cli import output
from scenarionet_pipelines.cli.group import verb
from scenarionet_pipelines.cli.parameters import (
    json_option,
    lake_argument,
    quiet_option,
    replace_option,
    snapshot_option,
)
from scenarionet_pipelines.cli.progress import ProgressDisplay


@verb(
    "report",
    "scenarionet report lake -o report.html",
    "scenarionet report lake busy_train busy_val -o splits.html --replace",
    "scenarionet report lake -o quick.html --no-check",
)
@lake_argument
@click.argument("databases", metavar="[DATABASE]...", nargs=-1)
@click.option("-o", "--output", "file", required=True, metavar="FILE", help="The .html file to write.")
@click.option("--check/--no-check", "is_checked", default=True, help="Check the quality rules.")
@snapshot_option
@replace_option
@json_option
@quiet_option
def command(
    lake: str,
    databases: tuple[str, ...],
    file: str,
    is_checked: bool,
    snapshot: int | None,
    replace: bool,
    as_json: bool,
    quiet: bool,
) -> None:
    """Write an HTML report about a lake, or about several of its databases side by side.

    The report shows the content, a comparison of the databases, distributions, violations of quality rules, and
    pictures of typical, extreme and random scenarios. It is a single file that needs no network. Requires the extra
    `plots`.
    """
    from scenarionet_data import Lake
    from scenarionet_pipelines.report import gather, write

    path = local_path(file, "a report")
    if path.suffix not in (".html", ".htm"):
        raise BadParameter(f"{file}: the file name of a report has to end in .html")
    if path.exists() and not replace:
        raise BadParameter(f"{file} exists; choose another name, or --replace")
    with ProgressDisplay(f"report {path.name}", "percent", is_quiet=quiet) as progress:
        opened = Lake(lake, snapshot)
        contents = gather(opened, databases, is_checked=is_checked, on_progress=progress.update)
        write(contents, path)
    num_bytes, count = path.stat().st_size, sum(section.statistics.count for section in contents.sections)
    if as_json:
        names = [section.name for section in contents.sections]
        output.print_json({"file": file, "bytes": num_bytes, "databases": names, "scenarios": count})
    else:
        click.echo(f"{file}: {output.count(count, 'scenario')}, {output.size(num_bytes)}")
