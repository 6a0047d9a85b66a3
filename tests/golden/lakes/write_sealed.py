"""Wrote the lakes of formats 2 and 3; kept to show how they came to be, and run by no test.

python -m tests.golden.lakes.write_sealed FOLDER    (in a checkout of the commit that README.md names)
"""

from __future__ import annotations

import json
import sys
from pathlib import Path

from click.testing import CliRunner

from scenarionet_data import Lake
from scenarionet_pipelines.cli import cli
from tests.fixtures.golden_lakes import describe


def run(*words: str) -> None:
    """One command of ``scenarionet``."""
    result = CliRunner().invoke(cli, list(map(str, words)))
    if result.exit_code:
        raise RuntimeError(f"{words}: {result.output} {result.exception!r}")


def write(root: Path) -> None:
    """Generated scenarios in two partitions, versions of databases and columns, and two runs."""
    short = ("-O", "max_steps=60", "-O", "num_blocks=1", "-O", "density=0.8", "--workers", "1", "--quiet")
    run("convert", "pg", "0:3", root, "--split", "train", *short)
    run("filter", root, "--where", "num_objects > 0", "--name", "all")
    run("convert", "pg", "3:5", root, "--split", "val", *short)
    lake = Lake(root)
    ids = sorted(lake.sql("SELECT scenario_id FROM metadata")["scenario_id"].to_list())
    lake.tag("score", {scenario_id: float(number) for number, scenario_id in enumerate(ids)})
    lake.tag("score", {scenario_id: 10.0 - number for number, scenario_id in enumerate(ids)}, replace=True)
    lake = Lake(root)
    lake.filter("score > 7", name="scored")
    lake.filter("true", name="scored", replace=True)
    lake.filter("true", name="gone")
    lake.drop("gone")
    lake.filter("num_objects > 1", name="gone")
    run("sim", root, "all", "--policy", "replay", "--name", "replayed", "--workers", "1", "--quiet")
    run("sim", root, "all", "--policy", "idm", "--name", "driven", "--workers", "1", "--quiet", "--metrics-only")


def main(folder: Path) -> None:
    """Write the lake and what it says."""
    root = folder / "lake"
    write(root)
    asked = {
        kind: sorted(f"{path.parent.name}@{path.stem}" for path in (root / kind).glob("*/*.parquet"))
        for kind in ("layers", "databases")
    } | {"snapshots": sorted(int(path.stem) for path in (root / "snapshots").glob("*.json"))}
    expected = {"asked": asked, "said": describe(root, **asked)}
    (folder / "expected.json").write_text(json.dumps(expected, indent=1, default=str) + "\n")


if __name__ == "__main__":
    main(Path(sys.argv[1]).absolute())
