"""Damaged CommonRoad files: a bad state, obstacle or lanelet costs itself, a bad file its scenario."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from xml.etree import ElementTree as Xml

import numpy as np
import pytest

from scenarionet_data import Lake
from scenarionet_data.errors import InvalidScenario
from scenarionet_data.interchange import writer_for
from scenarionet_data.interchange.base import Losses
from scenarionet_data.interchange.commonroad.layout import SOLUTION
from scenarionet_data.interchange.commonroad.reader import CommonRoad
from scenarionet_data.scenario.description import ScenarioDescription
from scenarionet_data.scenario.vocabulary import is_lane
from tests.fixtures.reading import scenarios
from tests.scenarionet_data.converters.damage import DamageConformance, RowDamage

pytestmark = pytest.mark.integration


class TestCommonRoadDamage(DamageConformance):
    converter = CommonRoad()

    @pytest.fixture
    def raw(self, lake: Path, tmp_path: Path) -> Path:
        (tmp_path / "raw").mkdir()
        for number, scenario in enumerate(Lake(lake).loader()[:2]):
            for file, content in writer_for("commonroad").write(scenario, f"scene{number}", Losses()).items():
                (tmp_path / "raw" / file).write_bytes(content)
        return tmp_path / "raw"

    def damage_rows(self, raw: Path, rng: np.random.Generator) -> RowDamage:
        hit = set()
        for path in sorted(raw.glob("*.xml")):
            if path.name.endswith(SOLUTION):
                continue
            tree = Xml.parse(path)
            seen = [each for each in tree.findall("dynamicObstacle") if len(each.findall("trajectory/state")) > 9]
            for each, (place, value) in zip(
                seen,
                (("position/point/x", "nan"), ("orientation/exact", "north"), ("time/exact", "-4"), ("time/exact", "")),
                strict=False,
            ):
                state = each.findall("trajectory/state")[-2]
                state.find(place).text = value
                hit.add(f"{path.stem} {each.get('id')}")
            tree.write(path)
        return RowDamage(frozenset(hit))


LANELET = """<lanelet id="{id}"><leftBound><point><x>0</x><y>2</y></point><point><x>50</x><y>2</y></point></leftBound>
<rightBound><point><x>0</x><y>-2</y></point><point><x>50</x><y>-2</y></point></rightBound>{more}
<laneletType>urban</laneletType></lanelet>"""
STATE = """<position><point><x>{x}</x><y>0</y></point></position><orientation><exact>0</exact></orientation>
<time><exact>{t}</exact></time><velocity><exact>10</exact></velocity>"""
RECTANGLE = "<rectangle><length>4</length><width>2</width></rectangle>"
OBSTACLE = f"""<dynamicObstacle id="{{id}}"><type>car</type><shape>{RECTANGLE}</shape>
<initialState>{STATE.format(x=0, t=0)}</initialState><trajectory>{{states}}</trajectory></dynamicObstacle>"""
STATES = "".join(f"<state>{STATE.format(x=step, t=step)}</state>" for step in range(1, 6))
PROBLEM = f"""<planningProblem id="90"><initialState>{STATE.format(x=5, t=0)}</initialState>
<goalState><time><intervalStart>3</intervalStart><intervalEnd>5</intervalEnd></time></goalState></planningProblem>"""


def file(*elements: str, head: str = "", version: str = "2020a", step: str = "0.1") -> str:
    inside = "".join(elements)
    return f'{head}<commonRoad commonRoadVersion="{version}" timeStepSize="{step}">{inside}</commonRoad>'


def read(folder: Path, content: str) -> ScenarioDescription:
    (folder / "a.xml").write_text(content)
    (scenario,) = scenarios(CommonRoad(), folder)
    scenario.validate()
    return scenario


@pytest.mark.parametrize(
    "bad",
    ['<dynamicObstacle id="7"/>', OBSTACLE.format(id="", states=STATES), OBSTACLE.format(id=5, states=STATES),
     OBSTACLE.format(id=7, states=STATES).replace("<length>4", "<length>0"),
     OBSTACLE.format(id=7, states=STATES).replace("<width>2", "<width>wide"),
     OBSTACLE.format(id=7, states="").replace("<exact>0</exact></time>", "<exact>1e9</exact></time>"),
     '<environmentObstacle id="7"/>'],
)  # fmt: skip
def test_a_bad_obstacle_costs_itself(tmp_path: Path, bad: str) -> None:
    scenario = read(tmp_path, file(LANELET.format(id=1, more=""), OBSTACLE.format(id=5, states=STATES), bad, PROBLEM))
    assert [*scenario.tracks.ids] == ["5", "90"] and scenario.num_timesteps == 6
    assert scenario.defects and all("expected" in defect.reason for defect in scenario.defects)


@pytest.mark.parametrize(
    "bad",
    ['<lanelet id="7"/>', LANELET.format(id=1, more=""), LANELET.format(id="", more=""),
     LANELET.format(id=7, more="").replace("<x>50", "<x>nan", 1),
     LANELET.format(id=7, more="").replace("<x>50", "<x>1e12"),
     LANELET.format(id=7, more="").replace("<point><x>0</x><y>2</y></point>", ""),
     LANELET.format(id=7, more="").replace("urban", "parking")],
)  # fmt: skip
def test_a_bad_lanelet_costs_itself(tmp_path: Path, bad: str) -> None:
    good = [LANELET.format(id=1, more='<successor ref="2"/>'), LANELET.format(id=2, more='<successor ref="1"/>')]
    scenario = read(tmp_path, file(*good, bad, OBSTACLE.format(id=5, states=STATES), PROBLEM))
    assert [*scenario.map.ids] == ["1", "2"]
    assert [list(each) for each in scenario.map.exit_lanes] == [["2"], ["1"]]  # a circle
    assert [(defect.table, defect.count) for defect in scenario.defects] == [("maps", 1)]


def test_references_to_nothing_are_left_out(tmp_path: Path) -> None:
    more = '<successor ref="9"/><adjacentLeft ref="1" drivingDir="same"/>'
    more += '<adjacentRight ref="7" drivingDir="same"/><trafficLightRef ref="8"/>'
    scenario = read(tmp_path, file(LANELET.format(id=1, more=more), OBSTACLE.format(id=5, states=STATES), PROBLEM))
    assert not scenario.map.exit_lanes.lengths.any() and not scenario.map.left_neighbors.lengths.any()
    assert not scenario.map.right_neighbors.lengths.any()
    assert not len(scenario.lights)
    assert {(defect.table, defect.count) for defect in scenario.defects} == {("maps", 1), ("lights", 1)}


@pytest.mark.parametrize("cycle", ["", "<cycle/>", "<cycle><cycleElement><duration>0</duration></cycleElement></cycle>",
                                   "<cycle><cycleElement><duration>nan</duration></cycleElement></cycle>"])  # fmt: skip
def test_lights_without_a_cycle_are_left_out(tmp_path: Path, cycle: str) -> None:
    lanelet = LANELET.format(id=1, more='<trafficLightRef ref="8"/>')
    light = f'<trafficLight id="8">{cycle}</trafficLight>'
    scenario = read(tmp_path, file(lanelet, light, OBSTACLE.format(id=5, states=STATES), PROBLEM))
    assert not len(scenario.lights) and [defect.table for defect in scenario.defects] == ["lights"]


def test_a_long_cycle_takes_no_memory(tmp_path: Path) -> None:
    cycle = "".join(
        f"<cycleElement><duration>{length}</duration><color>{color}</color></cycleElement>"
        for length, color in ((3, "green"), (10**15, "red"))
    )
    lanelet = LANELET.format(id=1, more='<trafficLightRef ref="8"/>')
    light = f'<trafficLight id="8"><cycle>{cycle}<timeOffset>1</timeOffset></cycle></trafficLight>'
    scenario = read(tmp_path, file(lanelet, light, OBSTACLE.format(id=5, states=STATES), PROBLEM))
    assert scenario.lights.state.tolist() == [[5, 7, 7, 7, 5, 5]]


@pytest.mark.parametrize(
    "content",
    ["", "<commonRoad", file(version="2017a"), file(step="0"), file(step="soon"), "<OpenDRIVE/>",
     file(LANELET.format(id=1, more="")), file(OBSTACLE.format(id=5, states=STATES))[:-300],
     file(PROBLEM, head='<!DOCTYPE a [<!ENTITY b "c"><!ENTITY d "&b;&b;&b;&b;">]>'),
     file("&x;", PROBLEM, head='<!DOCTYPE a [<!ENTITY x SYSTEM "file:///etc/hostname">]>'),
     file("<planningProblem/>")],
)  # fmt: skip
def test_what_is_no_scenario_is_a_sentence(tmp_path: Path, content: str) -> None:
    with pytest.raises(InvalidScenario, match="expected"):
        read(tmp_path, content)


@pytest.mark.parametrize("damage", [lambda text: text[: len(text) // 2], lambda text: "", lambda text: "<a/>"])
def test_a_bad_solution_is_a_sentence(lake: Path, tmp_path: Path, damage: Callable[[str], str]) -> None:
    for name, content in writer_for("commonroad").write(Lake(lake).loader()[0], "a", Losses()).items():
        (tmp_path / name).write_bytes(content)
    path = tmp_path / f"a{SOLUTION}"
    path.write_text(damage(path.read_text()))
    with pytest.raises(InvalidScenario, match="CommonRoadSolution"):
        scenarios(CommonRoad(), tmp_path)


def test_shapes_and_areas_of_2018b(tmp_path: Path) -> None:
    """Obstacles whose place is an area, with polygons and circles as shapes, and areas in place of states."""
    obstacle = OBSTACLE.format(id=5, states=STATES)
    polygon = "".join(f"<point><x>{x}</x><y>{y}</y></point>" for x, y in ((-2, -1), (2, -1), (2, 1), (-2, 1)))
    as_polygon = obstacle.replace(RECTANGLE, f"<polygon>{polygon}</polygon>")
    as_circle = obstacle.replace(RECTANGLE, "<circle><radius>1</radius></circle>")
    occupied = "".join(
        "<occupancy><shape><rectangle><length>4</length><width>2</width><orientation>0.5</orientation><center>"
        f"<x>{step}</x><y>1</y></center></rectangle></shape><time><exact>{step}</exact></time></occupancy>"
        for step in range(1, 6)
    )  # fmt: skip
    as_areas = obstacle.replace(f"<trajectory>{STATES}</trajectory>", f"<occupancySet>{occupied}</occupancySet>")
    elements = [
        each.replace('id="5"', f'id="{name}"') for name, each in enumerate((as_polygon, as_circle, as_areas), 5)
    ]
    scenario = read(tmp_path, file(LANELET.format(id=1, more=""), *elements, PROBLEM, version="2018b"))
    assert scenario.tracks.size[:3, 0, :2].tolist() == [[4.0, 2.0], [2.0, 2.0], [4.0, 2.0]]
    assert scenario.tracks.is_velocity_estimated.tolist() == [False, False, True, False]
    np.testing.assert_allclose(scenario.tracks.velocity[2, 2], [10.0, 0.0], atol=1e-3)
    assert is_lane(scenario.map.feature_type).all()
