"""Wrote the lakes of format 1; kept to show how they came to be, and run by no test.

python -m tests.golden.lakes.write FOLDER    (in a checkout of the commit that README.md names)
"""

from __future__ import annotations

import json
import sys
import tempfile
from pathlib import Path
from typing import Any

from click.testing import CliRunner
from pipelines.cli import cli

from scenarionet_data import Lake, convert
from scenarionet_data.store import metadata_files
from tests.fixtures import argoverse2, lyft, made, nuplan, nuplan_drive, nuscenes, waymo
from tests.fixtures.golden_lakes import describe


def run(*words: str, code: int = 0) -> None:
    """One command of ``scenarionet``."""
    result = CliRunner().invoke(cli, list(map(str, words)))
    assert result.exit_code == code, (words, result.exit_code, result.output, result.exception)


def write_generated(root: Path) -> None:
    """Generated scenarios: databases of every operation, columns, runs, a compacted partition."""
    short = ("-O", "max_steps=60", "-O", "num_blocks=1", "-O", "density=0.8", "--workers", "1", "--quiet")
    run("convert", "pg", "0:3", root, "--split", "train", *short)
    run("filter", root, "--where", "num_objects > 0", "--to", "begun")
    run("convert", "pg", "3:5", root, "--split", "val", *short)
    run("filter", root, "--where", "ego_distance >= 0", "--to", "all")
    run("tag", root, "fast", "--where", "ego_max_speed > 5")
    run("tag", root, "following", "--event", "following:max_headway=5")
    run("tag", root, "seconds", "--sql", "SELECT scenario_id, 0.1 * count(*) AS s FROM ego_states GROUP BY scenario_id")
    lake = Lake(root)
    ids = lake.sql("SELECT scenario_id FROM metadata ORDER BY 1")["scenario_id"].to_list()
    lake.tag("score", {scenario_id: float(number) for number, scenario_id in enumerate(ids)})
    lake.refresh().tag("embedding", {scenario_id: [number, 0.5] for number, scenario_id in enumerate(ids[:3])})
    lake.refresh().tag("note", {ids[0]: "first", ids[2]: "third"})
    run("filter", root, "--where", "score < 3 AND fast", "--to", "scored")
    score = {scenario_id: 10.0 - number for number, scenario_id in enumerate(ids[:4])}
    Lake(root).tag("score", score, source="second opinion", replace=True)
    run("filter", root, "--where", "score > 7 OR seconds > 1", "--to", "scored", "--replace")
    run("split", root, "all", "--fractions", "train=0.6", "test=0.4", "--stratify", "split", "--seed", "3")
    run("split", root, "all", "--levels", "2", "--prefix", "by_difficulty")
    run("sample", root, "all", "-n", "2", "--seed", "1", "--to", "two")
    run("sample", root, "all", "-n", "3", "--weights", "num_objects", "--to", "drawn")
    run("merge", root, "two", "drawn", "--to", "merged")
    run("intersect", root, "two", "drawn", "--to", "common", "--allow-empty")
    run("subtract", root, "all", "two", "--to", "rest")
    run("copy", root, "two", "copied")
    run("filter", root, "--from", "all", "--where", "num_objects > 100000", "--to", "none", "--allow-empty")
    run("sim", root, "two", "--policy", "replay", "--to", "replayed", "--workers", "1", "--quiet")
    run("sim", root, "two", "--policy", "idm", "--traffic", "idm", "--to", "driven", "--workers", "1", "--quiet",
        "--metrics-only")  # fmt: skip
    Lake(root).filter("true", name="one", ids=[Lake(root).database("two").scenario_ids[0]])
    run("record", root, "one", "--agents", "ego", "--to", "observed", "--workers", "1", "--quiet")
    run("compact", root, "--profile", "analytics", "--where", "split=train", "--workers", "1", "--quiet")


def write_recorded(root: Path, raw: Path) -> None:
    """The raw formats of datasets, invented: maps that scenarios share, lights, heights or none, quarantine."""
    quiet = ("--workers", "1", "--quiet")
    waymo.write_tfrecord(
        raw / "waymo" / "training" / "training.tfrecord-00000-of-01000",
        [waymo.scenario_bytes(seed, num_vehicles=4, num_others=3, num_rows=2, spacing=2.0) for seed in (1, 2)],
    )
    run("convert", "waymo", raw / "waymo" / "training", root, *quiet)
    argoverse2.write_forecasting(raw / "argoverse2" / "train", num_scenarios=1, num_tracks=6, num_timesteps=40)
    run("convert", "argoverse2", raw / "argoverse2" / "train", root, *quiet)
    run("filter", root, "--where", "num_objects > 1", "--to", "own_maps")
    lyft.write_dataset(raw / "lyft" / "sample", num_scenes=2, num_frames=30)
    run("convert", "lyft", raw / "lyft" / "sample", root, "--split", "train", *quiet)
    nuplan.write_raw(raw / "nuplan", [nuplan_drive.invented(seconds=6.0, num_tracks=8)], scene_seconds=3.0)
    run("convert", "nuplan", raw / "nuplan", root, "--split", "mini", *quiet)
    nuscenes.write_invented(raw / "nuscenes", num_scenes=2, num_keyframes=10)
    run("convert", "nuscenes", raw / "nuscenes", root, "--split", "mini", *quiet)
    made.write_raw(raw / "made", {"a": [1, "2 invalid"], "b": [3, "4 bug"]})
    made.run(raw / "made", root)
    run("filter", root, "--where", "dataset = 'made'", "--to", "before")
    # Other options for what is there: the members of `before` are in an older snapshot alone.
    convert(made.NAME, str(raw / "made"), root, options=made.MadeOptions(num_objects=3), replace=True)
    run("filter", root, "--where", "map_crop IS NOT NULL", "--to", "shared_maps")
    run("filter", root, "--where", "true", "--to", "whole")
    run("split", root, "whole", "--each", "dataset")
    run("tag", root, "lit", "--where", "num_lights > 0")
    run("sample", root, "whole", "--fraction", "0.5", "--stratify", "dataset", "--to", "half")
    # Few shards of a partition are merged already, as many are otherwise.
    metadata_files.MAX_METADATA_FILES, before = 1, metadata_files.MAX_METADATA_FILES
    made.write_raw(raw / "many", {"d": [11], "e": [12]})
    made.run(raw / "many", root, split="val")
    metadata_files.MAX_METADATA_FILES = before
    run("filter", root, "--from", "shared_maps", "--where", "dataset = 'lyft' OR dataset = 'made'", "--to", "few")
    run("pack", root, "few", root.parent / "packed", "--quiet")


def asked_of(root: Path) -> dict[str, Any]:
    """Numbers of snapshots, and names with versions of columns and databases, by the names of their files."""
    versions = {
        kind: sorted(f"{path.parent.name}@{path.stem}" for path in (root / kind).glob("*/*.parquet"))
        for kind in ("layers", "databases")
    }
    numbers = sorted(int(path.stem) for path in (root / "snapshots").glob("*.json"))
    return {"snapshots": numbers, **versions}


def main(folder: Path) -> None:
    with tempfile.TemporaryDirectory() as raw:
        write_generated(folder / "generated" / "lake")
        write_recorded(folder / "recorded" / "lake", Path(raw))
        (folder / "packed").mkdir()
        (folder / "recorded" / "packed").rename(folder / "packed" / "lake")
    for name in ("generated", "recorded", "packed"):
        asked = asked_of(folder / name / "lake")
        expected = {"asked": asked, "said": describe(folder / name / "lake", **asked)}
        (folder / name / "expected.json").write_text(json.dumps(expected, indent=1, default=str) + "\n")


if __name__ == "__main__":
    main(Path(sys.argv[1]).absolute())
