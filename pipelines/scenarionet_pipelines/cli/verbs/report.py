"""``scenarionet report``: write an HTML report about a lake."""

from __future__ import annotations

from scenarionet_data.errors import BadParameter
from scenarionet_pipelines.cli import output
from scenarionet_pipelines.cli.parameters import output_path
from scenarionet_pipelines.cli.verb import OPTIONAL_DATABASES, REPLACE, SNAPSHOT, LakeVerb, Progressing, option


class ReportVerb(LakeVerb, Progressing):
    """Write an HTML report about a lake, or about several of its databases side by side.

    The report shows the content, a comparison of the databases, distributions, violations of quality rules, and
    pictures of typical, extreme and random scenarios. It is a single file that needs no network. Requires the extra
    `plots`.
    """

    examples = (
        "scenarionet report lake -o report.html",
        "scenarionet report lake busy_train busy_val -o splits.html --replace",
        "scenarionet report lake -o quick.html --no-check",
    )
    databases: tuple[str, ...] = OPTIONAL_DATABASES
    file: str = option("The .html file to write.", "-o", "--output", metavar="FILE")
    is_checked: bool = option("Check the quality rules.", "--check/--no-check", default=True)
    snapshot: int | None = SNAPSHOT
    replace: bool = REPLACE

    def run(self) -> None:
        from scenarionet_pipelines.report import gather, write

        path = output_path(self.file, "a report", replace=self.replace)
        if path.suffix not in (".html", ".htm"):
            raise BadParameter(f"{self.file}: the file name of a report has to end in .html")
        with self.progress(f"report {path.name}", "percent") as progress:
            contents = gather(self.open(), self.databases, is_checked=self.is_checked, on_progress=progress.update)
            write(contents, path)
        num_bytes, count = path.stat().st_size, sum(section.statistics.count for section in contents.sections)
        names = [section.name for section in contents.sections]
        self.say(
            {"file": self.file, "bytes": num_bytes, "databases": names, "scenarios": count},
            f"{self.file}: {output.count(count, 'scenario')}, {output.size(num_bytes)}",
        )
