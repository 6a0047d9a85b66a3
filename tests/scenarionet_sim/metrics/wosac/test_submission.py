"""Files that are not submissions are refused in words."""

from __future__ import annotations

import tarfile
from pathlib import Path

import numpy as np
import pytest

from scenarionet_data.errors import CorruptSource, SourceNotFound
from scenarionet_sim.metrics.wosac import ScenarioRollouts, read_submission, write_submission
from scenarionet_sim.metrics.wosac.submission import count_scenarios


def make_rollouts(name: str = "abc", with_size: bool = False) -> ScenarioRollouts:
    rng = np.random.default_rng(0)
    position = rng.normal(size=(2, 3, 5, 3)).astype(np.float32)
    size = rng.uniform(1, 5, position.shape).astype(np.float32) if with_size else None
    return ScenarioRollouts(name, np.array([-1, 7, 300]), position, position[..., 0], size)


@pytest.mark.parametrize("with_size", [False, True])
def test_folders_and_archives(tmp_path: Path, with_size: bool):
    folder = tmp_path / "shards"
    folder.mkdir()
    for name in ("a", "b"):
        write_submission(folder / f"{name}.binproto", [make_rollouts(name, with_size)])
    with tarfile.open(tmp_path / "all.tar.gz", "w:gz") as archive:
        archive.add(folder, "shards")
    for source in (folder, tmp_path / "all.tar.gz"):
        assert count_scenarios(source) == 2
        found = list(read_submission(source))
        assert sorted(each.scenario_id for each in found) == ["a", "b"]
        for each in found:
            expected = make_rollouts(each.scenario_id, with_size)
            assert (each.object_ids == expected.object_ids).all()
            assert (each.position == expected.position).all()
            assert each.size is None if expected.size is None else (each.size == expected.size).all()


def test_nothing_there(tmp_path: Path):
    with pytest.raises(SourceNotFound, match="no such file"):
        list(read_submission(tmp_path / "none.binproto"))
    with pytest.raises(SourceNotFound, match="empty"):
        list(read_submission(tmp_path))


def test_damaged_files(tmp_path: Path):
    path = tmp_path / "one.binproto"
    write_submission(path, [make_rollouts()])
    whole = path.read_bytes()
    rng = np.random.default_rng(1)
    for _ in range(300):
        changed = bytearray(whole)
        changed[rng.integers(len(whole))] ^= 1 << rng.integers(8)
        path.write_bytes(changed[: rng.integers(1, len(whole) + 1)] if rng.random() < 0.3 else changed)
        try:
            list(read_submission(path))
        except CorruptSource as error:
            assert str(path) in str(error)


def test_objects_that_differ_between_rollouts(tmp_path: Path):
    path = tmp_path / "one.binproto"
    first = make_rollouts()
    write_submission(path, [ScenarioRollouts("abc", np.array([7, 7, 9]), first.position, first.heading)])
    with pytest.raises(CorruptSource, match="the same objects in each rollout, each once"):
        list(read_submission(path))
