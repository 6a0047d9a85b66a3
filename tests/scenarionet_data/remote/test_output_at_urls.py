"""Packs and exports at a URL: the files of a local one, complete or not recognised as one."""

from __future__ import annotations

import pytest

from scenarionet_data import Lake, ScenarioLoader
from scenarionet_data.errors import BadParameter, DatabaseExists, LakeError
from scenarionet_data.packs.verifying import verify_pack
from scenarionet_data.storage.files.object_store import ObjectStore
from scenarionet_data.testing import differences
from tests.fixtures.lakes import everything, write_lake
from tests.fixtures.scenarios import make_scenario

pytestmark = pytest.mark.integration

MADE = [make_scenario(seed, num_objects=4, num_steps=11) for seed in range(3)]


@pytest.fixture(scope="module")
def lake(tmp_path_factory):
    made = write_lake(tmp_path_factory.mktemp("made") / "lake", MADE)
    made.filter("num_objects > 0", name="all")
    return made


@pytest.fixture
def download(tmp_path):
    """Download everything below a URL; return the folder."""

    def download(url):
        store, folder = ObjectStore(url), tmp_path / "downloaded"
        for each in store.walk():
            (folder / each.name).parent.mkdir(parents=True, exist_ok=True)
            store.download(each.name, folder / each.name)
        return folder

    return download


@pytest.mark.long
def test_pack_at_a_url(lake, url, tmp_path, download):
    report, local = lake.pack("all", url), lake.pack("all", tmp_path / "pack")
    assert (report.path, report.num_files, report.num_bytes) == (url, local.num_files, local.num_bytes)
    assert everything(download(url)).keys() == everything(local.path).keys()
    assert verify_pack(url).is_whole
    assert [differences(a, b) for a, b in zip(ScenarioLoader(Lake(url), "all"), MADE, strict=True)] == [[]] * 3
    with pytest.raises(BadParameter, match="exists; choose another name"):
        lake.pack("all", url)


def test_interrupted_pack_is_no_lake_and_can_be_repeated(lake, url, store, monkeypatch):
    monkeypatch.setenv("SCENARIONET_PATIENCE", "0.2")
    store.set(failures=10_000, status=503, method="PUT", part="/snapshots/")
    with pytest.raises(LakeError, match=r"503 .* run the same command again"):
        lake.pack("all", url)
    store.set()
    with pytest.raises(LakeError, match="no lake there"):
        len(Lake(url))
    lake.pack("all", url)
    assert verify_pack(url).is_whole


def test_export_to_a_url(lake, url, tmp_path, download):
    report = lake.export("all", url)
    assert (report.directory, report.num_scenarios) == (url, 3)
    local = lake.export("all", tmp_path / "local").directory
    assert everything(download(url)) == everything(local)
    with pytest.raises(DatabaseExists, match="is not empty; pass replace=True"):
        lake.export("all", url)
    first = ScenarioLoader(lake, "all").scenario_ids[:1]
    lake.export(first, url, replace=True)
    assert sorted(each.name for each in ObjectStore(url).walk()) == sorted(
        ["dataset_mapping.pkl", "dataset_summary.pkl", "sd_made_v1_s000000.pkl"]
    )


def test_export_beside_other_files_is_refused(lake, url):
    ObjectStore(url).put("thesis.tex", b"x")
    with pytest.raises(DatabaseExists, match=r"thesis\.tex"):
        lake.export("all", url, replace=True)
    with pytest.raises(BadParameter, match="exists"):
        lake.pack("all", url)
