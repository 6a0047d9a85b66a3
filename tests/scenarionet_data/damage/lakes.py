"""Lakes to damage: those of the first format, without seals, and one as they are written now."""

from __future__ import annotations

import shutil
from dataclasses import dataclass
from pathlib import Path

from click.testing import CliRunner

from scenarionet_data import Lake
from scenarionet_pipelines.cli import cli
from tests.fixtures.lakes import write_lake
from tests.fixtures.scenarios import make_scenario

GOLDEN = Path(__file__).parents[2] / "golden" / "lakes" / "format-1"
OLDER = ("generated", "recorded", "packed")
_OF_ALL = ("all", "whole", "few")
"""Names of the databases with every scenario."""


@dataclass(frozen=True)
class Content:
    """What the names in command lines on a lake are.

    Attributes:
        database: A database.
        leaf: A database with one query behind it that no other database was made from; None in packs.
        scenario: A scenario, which ``run`` has if there is one.
        snapshot: Number of the newest snapshot.
        run: A simulation run with rollouts; None if the lake has none.
        column: A user column; None if the lake has none.
        is_pack: Whether it is a pack.
        is_sealed: Whether every byte of its files is verified.
    """

    database: str
    leaf: str | None
    scenario: str
    snapshot: int
    run: str | None
    column: str | None
    is_pack: bool
    is_sealed: bool

    @classmethod
    def of(cls, root: Path) -> Content:
        """Content of an undamaged lake."""
        lake = Lake(root)
        database = next(name for name in _OF_ALL if name in lake.databases)
        driven = lake.sql("SELECT run, scenario_id FROM rollouts ORDER BY ALL LIMIT 1").rows()
        is_pack = (root / "SHA256SUMS").exists()
        parents = {parent.partition("@")[0] for name in lake.databases for parent in lake.record(name).lineage.parents}
        return cls(
            database=database,
            leaf=None if is_pack else min(set(lake.databases) - parents),
            scenario=driven[0][1] if driven else lake.database(database).scenario_ids[0],
            snapshot=lake.snapshot.number,
            run=driven[0][0] if driven else None,
            column=min(lake.user_columns, default=None),
            is_pack=is_pack,
            is_sealed=lake.files.are_verified(lake.snapshot.metadata),
        )


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
    run("filter", str(root), "--where", "num_objects > 0", "--name", "all")
    Lake(root).tag("score", {"pg/v2/0": 1.0, "pg/v2/1": 2.5})
    run("sim", str(root), "all", "--policy", "replay", "--name", "replayed", "--workers", "1", "--quiet")
    return root


def run(*words: str) -> None:
    """Run one command of ``scenarionet``."""
    result = CliRunner().invoke(cli, list(words))
    if result.exit_code:
        raise RuntimeError(f"{words}: {result.output} {result.exception!r}")
