"""The same damage to every format, through a whole conversion: damage is named, the rest is committed."""

from __future__ import annotations

import shutil
from collections.abc import Callable
from pathlib import Path

import pytest

from scenarionet_data import Lake, convert
from scenarionet_data.conversion import ConversionReport
from scenarionet_data.errors import SourceError
from tests.scenarionet_data.conversion.test_choosing_recordings import SPLIT, WRITE

pytestmark = pytest.mark.integration

RECORDING = {
    "argoverse1": "train/PIT/1.csv",
    "argoverse2": "motion/*/scenario_*.parquet",
    "lyft": "scenes/*.zarr/agents/0",
    "nuplan": "splits/mini/*.db",
    "nuscenes": "v1.0-mini/sample_annotation.json",
    "scenarionet": "waymo_0/sd_*_a1.pkl",
    "waymo": "*-00001-of-*",
}
"""A file with recorded motion."""
COMPANION = {
    "argoverse1": "pruned_argoverse_PIT_*.xml",
    "argoverse2": "motion/*/log_map_archive_*.json",
    "lyft": "meta.json",
    "nuplan": "maps/*/*/map.gpkg",
    "nuscenes": "v1.0-mini/instance.json",
}
"""A file that a recording needs beside it; the other formats are one file a scenario."""
OTHERS_GO_ON = {"argoverse1", "argoverse2", "scenarionet", "waymo"}
"""Fixtures that hold other recordings than the damaged one."""
DAMAGES: dict[str, Callable[[bytes], bytes]] = {
    "cut": lambda data: data[: len(data) * 2 // 3],
    "empty": lambda data: b"",
    "garbage": lambda data: bytes(range(251)) * (len(data) // 251 + 1),
}


@pytest.fixture(scope="module")
def written(tmp_path_factory: pytest.TempPathFactory) -> Callable[[str], Path]:
    """The raw folder of a dataset, written once; tests copy it."""
    found: dict[str, Path] = {}

    def raw(dataset: str) -> Path:
        if dataset not in found:
            found[dataset] = Path(WRITE[dataset](tmp_path_factory.mktemp(dataset)))
        return found[dataset]

    return raw


def outcome(dataset: str, raw: Path, lake: Path) -> ConversionReport | SourceError:
    """Run a conversion and return its report or error; check that no partial files are left in the lake."""
    try:
        report: ConversionReport | SourceError = convert(dataset, str(raw), lake, split=SPLIT.get(dataset, "train"))
    except SourceError as error:
        report = error
    if isinstance(report, ConversionReport) and report.converted:
        assert len(Lake(lake)) == report.converted
        assert Lake(lake).sql("SELECT count(DISTINCT scenario_id) AS n FROM tracks")["n"].item() == report.converted
    assert not [path for path in lake.rglob("*") if path.name.startswith(".") and path.is_file()]
    return report


@pytest.mark.parametrize(
    "damage", [name if name == "garbage" else pytest.param(name, marks=pytest.mark.long) for name in DAMAGES]
)
@pytest.mark.parametrize("dataset", RECORDING)
def test_damaged_recording(dataset: str, damage: str, written: Callable[[str], Path], tmp_path: Path) -> None:
    raw = Path(shutil.copytree(written(dataset), tmp_path / "raw"))
    victim = sorted(raw.glob(RECORDING[dataset]))[0]
    victim.write_bytes(DAMAGES[damage](victim.read_bytes()))
    found = outcome(dataset, raw, tmp_path / "lake")
    if isinstance(found, ConversionReport):
        assert found.failed or found.quarantined
        assert (found.converted > 0) >= (dataset in OTHERS_GO_ON)
    else:
        assert dataset not in OTHERS_GO_ON


@pytest.mark.parametrize("dataset", COMPANION)
def test_missing_companion_file(dataset: str, written: Callable[[str], Path], tmp_path: Path) -> None:
    raw = Path(shutil.copytree(written(dataset), tmp_path / "raw"))
    victim = sorted(raw.glob(COMPANION[dataset]))[0]
    victim.unlink()
    found = outcome(dataset, raw, tmp_path / "lake")
    if isinstance(found, ConversionReport):
        assert found.failed or found.quarantined
        assert (found.converted > 0) >= (dataset in OTHERS_GO_ON)
    else:
        assert "download" in str(found)


@pytest.mark.parametrize("dataset", RECORDING)
@pytest.mark.parametrize("other", ["waymo", "nuplan", "scenarionet", "nothing"])
def test_folder_of_another_dataset(dataset: str, other: str, written: Callable[[str], Path], tmp_path: Path) -> None:
    if dataset == other:
        other = "lyft"
    raw = tmp_path if other == "nothing" else written(other)
    found = outcome(dataset, raw, tmp_path / "lake")
    if isinstance(found, ConversionReport):  # a pickle may be named like a tfrecord
        assert found.failed and not found.converted
    else:
        assert "give" in str(found) or "set " in str(found) or "no " in str(found)
    assert not (tmp_path / "lake" / "tracks").exists()
