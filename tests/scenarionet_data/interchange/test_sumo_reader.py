"""SUMO's FCD output over its net: there and back, and damaged."""

from __future__ import annotations

from pathlib import Path
from xml.etree import ElementTree as Xml

import numpy as np
import pytest

from scenarionet_data import Lake
from scenarionet_data.converters.formats.xml_files import read_xml
from scenarionet_data.errors import InvalidScenario
from scenarionet_data.ingest.defects import Defects
from scenarionet_data.interchange import writer_for
from scenarionet_data.interchange.base import Losses
from scenarionet_data.interchange.lane_graph import read_lanes
from scenarionet_data.interchange.sumo.net_reader import read_net
from scenarionet_data.interchange.sumo.reader import Sumo
from scenarionet_data.scenario.vocabulary import LIGHT_COLORS
from scenarionet_data.testing import ConverterConformance
from tests.fixtures.reading import scenarios
from tests.scenarionet_data.converters.damage import DamageConformance, RowDamage


def write(scenario, folder: Path, stem: str = "scene") -> None:
    folder.mkdir(exist_ok=True)
    for name, content in writer_for("sumo").write(scenario, stem, Losses()).items():
        (folder / name).write_bytes(content)


@pytest.mark.integration
class TestReader(ConverterConformance):
    converter = Sumo()
    damaged_glob = "*.fcd.xml"

    @pytest.fixture(scope="class")
    @classmethod
    def raw(cls, lake, tmp_path_factory):
        folder = tmp_path_factory.mktemp("raw")
        for number, scenario in enumerate(Lake(lake).loader()):
            write(scenario, folder, f"scene{number}")
        return folder


@pytest.mark.integration
class TestSumoDamage(DamageConformance):
    converter = Sumo()

    @pytest.fixture
    def raw(self, lake: Path, tmp_path: Path) -> Path:
        for number, scenario in enumerate(Lake(lake).loader()[:2]):
            write(scenario, tmp_path / "raw", f"scene{number}")
        return tmp_path / "raw"

    def damage_rows(self, raw: Path, rng: np.random.Generator) -> RowDamage:
        hit = set()
        for path in sorted(raw.glob("*.fcd.xml")):
            tree = Xml.parse(path)
            elements = [each for step in tree.getroot() for each in step]
            names = list(dict.fromkeys(each.get("id") for each in elements))
            # The vehicle seen longest is the ego: its first states are its origin.
            for name, (key, value) in zip(names, (("x", "nan"), ("angle", "north"), ("speed", "900")), strict=False):
                own = [each for each in elements if each.get("id") == name]
                own[len(own) // 2].set(key, value)
                hit.add(f"{path.name.removesuffix('.xml')} {name}")
            tree.write(path)
        return RowDamage(frozenset(hit))


@pytest.mark.integration
def test_what_went_out_comes_back(lake, tmp_path):
    for number, scenario in enumerate(Lake(lake).loader()):
        write(scenario, tmp_path / str(number))
        (found,) = scenarios(Sumo(), tmp_path / str(number))
        found.validate()
        tracks, rows = scenario.tracks, [scenario.tracks.index(name) for name in found.tracks.ids]
        assert found.tracks.ids.tolist() == [tracks.ids[row] for row in rows]
        assert np.array_equal(found.tracks.valid, tracks.valid[rows])
        assert np.array_equal(found.tracks.object_type, tracks.object_type[rows])
        off = (found.tracks.position + found.origin - tracks.position[rows] - scenario.origin)[found.tracks.valid]
        assert np.abs(off[:, :2]).max() < 1e-2
        np.testing.assert_allclose(found.tracks.size, tracks.size[rows], atol=1e-3)
        speed = np.hypot(*np.moveaxis(found.tracks.velocity - tracks.velocity[rows], -1, 0))
        assert speed.max() < 0.01
        graph = read_lanes(scenario.map, Losses())
        again = read_lanes(found.map, Losses())
        inside = found.map.is_intersection == 1
        assert (~inside).sum() == len(graph.lines)
        # Links through a junction have a lane of their own.
        assert len(again.links) - inside.sum() == len(graph.links)
        if len(scenario.lights):
            colors = {tuple(row) for row in LIGHT_COLORS[found.lights.state].tolist()}
            assert colors <= {tuple(row) for row in LIGHT_COLORS[scenario.lights.state].tolist()}
            assert len(found.lights)


@pytest.mark.parametrize(("name", "lanes"), [("cologne1", 1), ("ingolstadt7", 1), ("e6mini", 1)])
def test_nets_of_others(recordings, name, lanes):
    path = recordings / "exchange" / "sumo" / f"{name}.net.xml"
    defects = Defects()
    builder, ends = read_net(read_xml(path, "net"), np.zeros(3), path.name, defects)
    features = builder.build(np.zeros(3))
    told = [lane.get("id") for edge in Xml.parse(path).getroot().findall("edge") for lane in edge.findall("lane")
            if edge.get("function", "internal") == "internal"]  # fmt: skip
    assert defects.found() == () and len(features) == len(ends) <= len(told)
    assert sum(features.exit_lanes.lengths) >= lanes


NET = """<net><location netOffset="0,0"/><edge id="a"><lane id="a_0" index="0" speed="10" shape="0,0 50,0"/></edge>
{more}<connection from="a" to="a" fromLane="0" toLane="0"/></net>"""
FCD = """<fcd-export>{steps}</fcd-export>"""
STEP = '<timestep time="{t}"><vehicle id="v" x="{t}" y="0" angle="90" speed="1" type="t"/></timestep>'


def read(folder: Path, fcd: str, net: str | None = NET.format(more="")):
    (folder / "a.fcd.xml").write_text(fcd)
    if net is not None:
        (folder / "a.net.xml").write_text(net)
    (scenario,) = scenarios(Sumo(), folder)
    scenario.validate()
    return scenario


GOOD = FCD.format(steps="".join(STEP.format(t=t) for t in range(4)))


def test_files_of_sumo_alone(tmp_path):
    """Without types sizes are SUMO's, told as assumed; the place is that of the box."""
    scenario = read(tmp_path, GOOD)
    assert scenario.dt == 1.0 and scenario.tracks.is_size_assumed.tolist() == [True]
    assert scenario.tracks.size[0, 0].tolist() == [5.0, pytest.approx(1.8), 1.5]
    np.testing.assert_allclose((scenario.tracks.position + scenario.origin)[0, :, 0], np.arange(4) - 2.5, atol=1e-3)
    assert [list(each) for each in scenario.map.exit_lanes] == [["a_0"]]  # a circle


@pytest.mark.parametrize(
    "more",
    ['<edge id="b"><lane id="b_0" shape="0,0"/></edge>', '<edge id="b"><lane id="b_0" shape="0,0 nan,3"/></edge>',
     '<edge id="b"><lane id="a_0" shape="0,0 1,1"/></edge>', '<edge id="b"><lane id="b_0" shape="0,0 1e12,3"/></edge>',
     '<edge id="b"><lane id="b_0"/></edge>', '<connection from="x" to="y" fromLane="0" toLane="0"/>'],
)  # fmt: skip
def test_a_bad_lane_or_link_costs_itself(tmp_path, more):
    scenario = read(tmp_path, GOOD, NET.format(more=more))
    assert [*scenario.map.ids] == ["a_0"]
    assert [defect.table for defect in scenario.defects if defect.field != "ego"] == ["maps"]


@pytest.mark.parametrize(
    ("fcd", "net"),
    [("", NET), ("<fcd-export/>", NET), (GOOD[:-40], NET), (GOOD, None), (GOOD, "<net"), (GOOD, "<routes/>"),
     (GOOD.replace('time="2"', 'time="nan"'), NET), (GOOD.replace('time="2"', 'time="1.2"'), NET),
     (f'<!DOCTYPE a [<!ENTITY b SYSTEM "file:///etc/hostname">]>{GOOD}', NET),
     (GOOD, '<!DOCTYPE a [<!ENTITY b "c"><!ENTITY d "&b;&b;">]><net/>')],
)  # fmt: skip
def test_what_is_no_scenario_is_a_sentence(tmp_path, fcd, net):
    with pytest.raises(InvalidScenario, match="expected"):
        read(tmp_path, fcd, net)


def test_a_configuration_does_not_lead_out_of_its_folder(tmp_path):
    (tmp_path / "secret.net.xml").write_text(NET.format(more=""))
    inside = tmp_path / "inside"
    inside.mkdir()
    (inside / "a.sumocfg").write_text(
        '<configuration><input><net-file value="../secret.net.xml"/></input></configuration>'
    )
    with pytest.raises(InvalidScenario, match="expected its net"):
        read(inside, GOOD, None)
