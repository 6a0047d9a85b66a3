"""Command lines of every verb that reads a lake, for trials on damaged ones."""

from __future__ import annotations

import re
import shlex
import traceback
from collections.abc import Iterable, Sequence
from dataclasses import asdict
from pathlib import Path

from click.testing import CliRunner, Result

from scenarionet_pipelines.cli import cli
from tests.scenarionet_data.damage.lakes import Content

LINES = (
    "list {lake}",
    "show {lake} {scenario}",
    "show {lake} {scenario} --picture {out}/picture.png",
    "sql {lake} 'SELECT count(*), sum(num_objects) FROM metadata'",
    "sql {lake} 'SELECT {column} FROM metadata'",
    "sql {lake} 'SELECT * FROM tracks' -o {out}/tracks.parquet",
    "sql {lake} 'SELECT avg(speed) FROM states'",
    "sql {lake} 'SELECT count(*) FROM lights' --csv",
    "sql {lake} 'SELECT * FROM maps' -o {out}/maps.parquet",
    "sql {lake} 'SELECT * FROM results'",
    "sql {lake} 'SELECT * FROM quarantine'",
    "sql {lake} 'SELECT * FROM shards' --json",
    "sql {lake} summary",
    "mine {lake} following",
    "mine {lake} closest_approach --database {database}",
    "db stats {lake} {database}",
    "tables files {lake} tracks",
    "render {lake} {scenario} -o {out}/drawn.png",
    "render {lake} {scenario} -o {out}/driven.png --run {run}",
    "report {lake} -o {out}/report.html --no-check",
    "filter {lake} --where 'num_objects > 0' --name some",
    "filter {lake} --event closest_approach --name near --allow-empty",
    "split {lake} {database} --fractions a=0.5 b=0.5 --allow-empty",
    "sample {lake} {database} -n 1 --name one_only",
    "db tag {lake}",
    "db tag {lake} many --where 'num_objects > 1'",
    "db tag {lake} near --event closest_approach",
    "db tag {lake} --drop {column} --force",
    "merge {lake} {database} {database}@1 --name merged_again",
    "db intersect {lake} {database} {database}@1 --name shared",
    "db subtract {lake} {database} {database}@1 --name left --allow-empty",
    "db diff {lake} {database}@1 {database}",
    "db diff {lake} @{snapshot} @{snapshot}",
    "db overlap {lake} {database}@1 {database}",
    "db lineage {lake} {database}",
    "db rebuild {lake} {leaf}",
    "db rebase {lake} {leaf} --keep-members",
    "db copy {lake} {database} copied_again",
    "db rename {lake} {leaf} renamed",
    "db drop {lake} {database} --force",
    "db checkout {lake} {database}@1",
    "sim {lake} {database} --policy replay --name again --workers 1 --quiet",
    "runs record {lake} {database} --agents ego --name seen --workers 1 --quiet",
    "export {lake} {database} {out}/pickles --quiet",
    "pack {lake} {database} {out}/pack --quiet",
    "pack --verify {pack} --quiet",
    "maintain check {lake} --quiet",
    "maintain check {lake} {database} --only content_is_present --quiet",
    "maintain fsck {lake} --quiet",
    "maintain fsck {lake} --deep --quiet",
    "maintain fsck {lake} --upgrade --quiet",
    "maintain fsck {lake} --deep --repair --quiet",
    "maintain compact {lake} --profile analytics --workers 1 --quiet",
    "maintain vacuum {lake} --keep-last 1 --yes --quiet",
    "maintain doctor {lake}",
    "convert pg 900000:900001 {lake} --dry-run --quiet",
)  # fmt: skip

_LISTS = ("maintain", "pack --verify", "db rebuild", "sim", "runs record")
"""Verbs that go on, list what they find and end with exit code 1."""

_RAW_MESSAGE = re.compile(
    r"Invalid Input Error|IO Error|INTERNAL Error|FATAL Error|Serialization Error|Out of Memory Error|Invalid Error|"
    r"TProtocolException|Conversion Error|Binder Error|Catalog Error|ArrowInvalid|Couldn't deserialize|object has no|"
    r"\[Errno|codec can't|not subscriptable"
)
"""Parts of messages of DuckDB, Arrow and Python."""

_REMEDY = re.compile(r"scenarionet \w+|restore|run .* again|open the lake again|--\w+")


def possible(lines: Iterable[str], content: Content) -> list[str]:
    """Command lines that a lake has everything for."""
    known = {name for name, value in asdict(content).items() if value is not None} | {"lake", "out"}
    known |= {"pack"} if content.is_pack else set()
    return [line for line in lines if set(re.findall(r"\{(\w+)\}", line)) <= known]


def run(line: str, root: Path, out: Path, content: Content) -> Result:
    """Run a command line on a lake."""
    return CliRunner().invoke(cli, shlex.split(line.format(lake=root, pack=root, out=out, **asdict(content))))


def judged(line: str, result: Result, named: Sequence[str]) -> str:
    """What the end of a command on a damaged lake is: same, error, or what is wrong with it.

    Args:
        line: The command line.
        result: Its end.
        named: What an error has to name: the damaged files, or what they are of.
    """
    if result.exception is not None and not isinstance(result.exception, SystemExit):
        lines = traceback.format_exception(result.exception)
        return f"traceback: {line}: {lines[-1].strip()} {''.join(lines[-3:-1]).strip()}"
    if result.exit_code == 0:
        return "same"
    said = result.stderr.strip().splitlines()
    message = said[-1] if said else ""
    if "Traceback" in result.output or "Usage:" in result.stderr:
        return f"traceback: {line}: {message}"
    if line.startswith(_LISTS) and not message.startswith("error:"):
        return "error" if _names(result.output, named) else f"unnamed: {line}: {result.output[-500:]}"
    if not message.startswith("error:") or len([text for text in said if text.startswith("error:")]) != 1:
        return f"bare: {line}: exit {result.exit_code}, {result.output[-300:]}"
    if _RAW_MESSAGE.search(message):
        return f"bare: {line}: {message}"
    if not _names(message, named):
        return f"unnamed: {line}: {message}"
    return "error" if _REMEDY.search(message) else f"no remedy: {line}: {message}"


def _names(message: str, named: Sequence[str]) -> bool:
    """Whether a message names a damaged file, or the database, run, user column or partition that it is of."""
    for name in named:
        parts = name.split("/")
        of = parts[1] if parts[0] in ("databases", "layers", "results") else "/".join(parts[:-1])
        if parts[-1] in message or (of and of in message):
            return True
    return False
