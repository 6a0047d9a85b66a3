"""Lakes to damage: those of the first format, without seals, and one as they are written now."""

from __future__ import annotations

import shutil
from pathlib import Path

from click.testing import CliRunner

from scenarionet_data import Lake
from scenarionet_pipelines.cli import cli
from tests.fixtures.lakes import write_lake
from tests.fixtures.scenarios import make_scenario

GOLDEN = Path(__file__).parents[2] / "golden" / "lakes" / "format-1"
OLDER = ("generated", "recorded", "packed")


def copy_older(folder: Path) -> list[Path]:
    """Copy the lakes of the first format."""
    return [Path(shutil.copytree(GOLDEN / name / "lake", folder / name)) for name in OLDER]


def write_small(root: Path) -> Path:
    """A lake of a few scenarios with a database and a user column."""
    write_lake(root, [make_scenario(seed, num_objects=2) for seed in range(3)])
    lake = Lake(root)
    lake.filter("num_objects > 0", name="all")
    lake.tag("score", {"made/v1/s000001": 1.0, "made/v1/s000002": 2.5})
    return root


def write_newer(root: Path) -> Path:
    """A lake with files of every kind: shared maps excepted, which are in the older lakes."""
    short = ["-O", "max_steps=60", "-O", "num_blocks=1", "-O", "density=0.8", "--workers", "1", "--quiet"]
    run("convert", "pg", "0:3", str(root), *short)
    run("filter", str(root), "--where", "num_objects > 0", "--to", "all")
    Lake(root).tag("score", {"pg/v1/0": 1.0, "pg/v1/1": 2.5})
    run("sim", str(root), "all", "--policy", "replay", "--to", "replayed", "--workers", "1", "--quiet")
    return root


def run(*words: str) -> None:
    """Run one command of ``scenarionet``."""
    result = CliRunner().invoke(cli, list(words))
    if result.exit_code:
        raise RuntimeError(f"{words}: {result.output} {result.exception!r}")
