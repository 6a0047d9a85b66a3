"""The card of a pack names its tables and licences."""

from __future__ import annotations

from dataclasses import replace

import pytest

from scenarionet_data.errors import BadParameter
from scenarionet_data.packs.verifying import verify_pack
from tests.fixtures.lakes import write_lake
from tests.fixtures.scenarios import small


def licensed(seed, licence):
    scenario = small(seed)
    return replace(scenario, source=replace(scenario.source, licence=licence))


@pytest.fixture
def lake(tmp_path):
    lake = write_lake(tmp_path / "lake", [licensed(0, "CC BY-NC-SA 4.0"), licensed(1, "for members only")])
    lake.filter(name="all")
    lake.filter("licence LIKE 'CC %'", name="free")
    return lake


def test_tables_are_configurations_and_licences_are_counted(lake, tmp_path):
    lake.pack("all", tmp_path / "pack")
    card = (tmp_path / "pack" / "README.md").read_text()
    assert card.startswith(
        "---\nlicense: other\nconfigs:\n- config_name: metadata\n  default: true\n  data_files:\n"
        '  - split: train\n    path: "metadata/**/split=train/*.parquet"\n- config_name: tracks\n'
    )
    assert '- config_name: maps\n  data_files:\n  - split: train\n    path: "maps/**/*.parquet"\n---\n' in card
    assert "| CC BY-NC-SA 4.0 | 1 |\n| for members only | 1 |\n" in card
    assert verify_pack(tmp_path / "pack").is_whole


def test_a_licence_that_forbids_redistribution_stops_a_publishable_pack(lake, tmp_path):
    wanted = f"all@1: the licence 'for members only' of 1 scenarios, for example {small(1).id}, is not known to allow"
    with pytest.raises(BadParameter, match=wanted):
        lake.pack("all", tmp_path / "pack", publishable=True)
    assert not (tmp_path / "pack").exists()
    lake.pack("free", tmp_path / "pack", publishable=True)
    assert "license: cc-by-nc-sa-4.0\n" in (tmp_path / "pack" / "README.md").read_text()
