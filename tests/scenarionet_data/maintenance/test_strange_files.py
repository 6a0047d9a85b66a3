"""fsck of what is no file: pipes and links; and of checkpoints of training runs."""

from __future__ import annotations

import os
import re

import numpy as np
import pytest

from scenarionet_data.errors import LakeError
from scenarionet_data.maintenance.fsck import fsck
from scenarionet_data.storage import checkpoints, evaluation_runs
from scenarionet_data.storage.checkpoints import Checkpoint
from tests.fixtures.lakes import write_lake
from tests.fixtures.scenarios import make_scenario

FOLDER = "results/run/checkpoints"


@pytest.fixture
def lake(tmp_path):
    lake = write_lake(tmp_path / "lake", [make_scenario(0)])
    evaluation_runs.claim(lake.files, "run", ("training",), {"learner": "ppo"})
    for number in (1, 2):
        checkpoints.save(lake.files, "run", Checkpoint(number, {"steps": number}, {"w": np.arange(50.0)}))
    return lake


def problems(lake):
    found = fsck(lake.root, is_deep=True).problems
    return {problem.file: problem.reason for problem in reversed(found)}  # the first reason of each


def test_whole_checkpoints_are_no_problem(lake):
    assert problems(lake) == {}


@pytest.mark.parametrize("damage", ["bit", "cut", "empty", "exchanged", "header"])
def test_damaged_checkpoints_are_found(lake, damage):
    path, other = (lake.root / FOLDER / f"checkpoint-00000{number}.safetensors" for number in (1, 2))
    data = path.read_bytes()
    changed = {
        "bit": data[:-9] + bytes([data[-9] ^ 1]) + data[-8:],
        "cut": data[:-1],
        "empty": b"",
        "exchanged": other.read_bytes(),
        "header": b"\xff" * 8 + data[8:],
    }
    path.write_bytes(changed[damage])
    (problem,) = fsck(lake.root, is_deep=True).problems
    assert problem.file == f"{FOLDER}/{path.name}"
    assert re.search(r"a damaged checkpoint, it(s bytes differ| is cut off)", problem.reason)
    assert problem.remedy == "remove it: training goes on from the checkpoint before it"


def test_stray_file_and_folder_among_checkpoints(lake):
    (lake.root / FOLDER / "notes.json").write_text("{}")
    (lake.root / FOLDER / "more").mkdir()
    assert problems(lake) == {
        f"{FOLDER}/notes.json": "not a file of a checkpoint",
        f"{FOLDER}/more": "a folder, expected a file",
    }
    found = fsck(lake.root, is_deep=True).problems
    assert {problem.remedy for problem in found} == {"remove it: training does not read it"}
    assert checkpoints.numbers(lake.files, "run") == [1, 2]


@pytest.mark.parametrize("name", ["databases/all/1.parquet", "results/run/run.json", "lake.json", "metadata"])
def test_pipe_is_found_and_never_read(lake, name):
    path = next((lake.root / name).rglob("*.parquet")) if name == "metadata" else lake.root / name
    path.parent.mkdir(parents=True, exist_ok=True)
    path.unlink(missing_ok=True)
    os.mkfifo(path)
    try:
        assert problems(lake)[path.relative_to(lake.root).as_posix()] == "a pipe, a socket or a device, expected a file"
    except LakeError as error:  # without the id of the lake, nothing bound to it can be read
        assert name == "lake.json"
        assert "it is no file" in str(error)


@pytest.mark.parametrize(
    ("target", "reason"),
    [("nowhere", "a link to nothing"), ("2.parquet", "a link in a circle"), ("..", "a link in a circle")],
)
def test_strange_links_are_found(lake, target, reason):
    path = lake.root / "databases/all/2.parquet"
    path.parent.mkdir(parents=True)
    path.symlink_to(target)
    assert problems(lake)["databases/all/2.parquet"] == f"{reason}, expected a file"
