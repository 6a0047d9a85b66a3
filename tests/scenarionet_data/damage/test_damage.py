"""Damaged lakes: no wrong value, no end of the process, no error without file and remedy."""

from __future__ import annotations

from pathlib import Path

import pytest

from scenarionet_data import Lake
from scenarionet_data.errors import LakeError
from tests.scenarionet_data.damage import trial
from tests.scenarionet_data.damage.lakes import copy_older, write_newer, write_small
from tests.scenarionet_data.damage.trial import Outcome
from tests.scenarionet_data.damage.worker import load, subject_of

pytestmark = pytest.mark.integration


@pytest.fixture(scope="module")
def lakes(tmp_path_factory: pytest.TempPathFactory) -> list[Path]:
    """Older and newer lakes, as many of both."""
    folder = tmp_path_factory.mktemp("lakes")
    newer = write_newer(folder / "newer")
    return [path for older in copy_older(folder) for path in (older, newer)]


def assert_harmless(outcome: Outcome, count: int) -> None:
    assert outcome.aborts == []
    assert outcome.findings == []
    assert outcome.num_trials == count
    assert outcome.num_errors > count // 4


@pytest.mark.damage
def test_no_wrong_value_is_loaded(lakes):
    assert_harmless(trial.run("load", 6000, lakes), 6000)


@pytest.mark.damage
def test_no_footer_ends_the_process(lakes):
    assert_harmless(trial.run("footer", 12_000, lakes), 12_000)


@pytest.mark.damage
def test_every_error_is_a_sentence(lakes):
    assert_harmless(trial.run("verbs", 2400, lakes), 2400)


def test_some_damaged_lakes(tmp_path):
    """A sample of the trial, in this process."""
    lakes = [write_small(tmp_path / "newer"), copy_older(tmp_path)[0]]
    for root in lakes:
        subject = subject_of(root, "load")
        outcomes = [load(subject, seed) for seed in range(6)]
        assert set(outcomes) <= {"same", "error"}
        assert "error" in outcomes


def test_exchanged_metadata_of_an_older_lake_is_found(tmp_path):
    root = copy_older(tmp_path)[0]
    one, other = (next((root / "metadata").glob(f"**/split={split}/*.parquet")) for split in ("train", "val"))
    contents = one.read_bytes(), other.read_bytes()
    other.write_bytes(contents[0])
    with pytest.raises(LakeError, match="its rows belong to another folder"):
        Lake(root).sql("SELECT scenario_id FROM metadata")


@pytest.mark.parametrize(
    "read", [lambda lake: lake.sql("SELECT scenario_id FROM metadata"), lambda lake: lake.loader()]
)
def test_exchanged_metadata_of_one_folder_is_found(read, tmp_path):
    """The file of a snapshot, and that of a shard which was merged into another: scenarios were missing or twice."""
    root = copy_older(tmp_path)[1]
    folder = root / "metadata/dataset=nuscenes/version=v1.0/split=mini"
    merged = next(folder.glob("merged-0fad*"))
    (other,) = (path for path in folder.glob("v1.0-mini*") if "singapore" in path.name)
    contents = merged.read_bytes(), other.read_bytes()
    assert read(Lake(root)) is not None
    merged.write_bytes(contents[1])
    other.write_bytes(contents[0])
    with pytest.raises(LakeError, match=r"expected [0-9]+: files were exchanged"):
        read(Lake(root))


def test_exchanged_manifests_of_an_older_lake_are_found(tmp_path):
    root = copy_older(tmp_path)[0]
    first, *_, last = sorted((root / "snapshots").glob("manifest-*"))
    contents = first.read_bytes(), last.read_bytes()
    first.write_bytes(contents[1])
    last.write_bytes(contents[0])
    lake = Lake(root)
    with pytest.raises(LakeError, match="which no shard of the snapshot lists"):
        lake.pack(lake.databases[0], tmp_path / "pack")
