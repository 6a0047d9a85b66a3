"""OpenSCENARIO files, read back as XML."""

from dataclasses import replace
from xml.etree import ElementTree as Xml

import numpy as np
import pytest

from scenarionet_data import ScenarioLoader
from scenarionet_data.errors import BadParameter
from scenarionet_data.interchange import writer_for
from scenarionet_data.interchange.base import Losses
from scenarionet_data.scenario.vocabulary import LightState
from tests.scenarionet_data.interchange.conformance import WriterConformance


class TestOpenScenario(WriterConformance):
    name = "openscenario"


def written(scenario, **options):
    files = writer_for("openscenario", options).write(scenario, "stem", Losses())
    root = Xml.fromstring(files["stem.xosc"])
    assert root.find("RoadNetwork/LogicFile").get("filepath") in files
    return root


def with_valid(scenario, row, valid):
    """The scenario, with an object seen in some timesteps only."""
    changed = scenario.tracks.valid.copy()
    changed[row] = valid
    return replace(scenario, tracks=replace(scenario.tracks, valid=changed))


def test_an_object_with_a_gap_appears_twice(lake):
    scenario = ScenarioLoader(lake)[0]
    row = next(row for row in range(len(scenario.tracks)) if row != scenario.ego_index)
    valid = np.zeros(scenario.num_timesteps, bool)
    valid[[5, 6, 7, 10]] = True
    root = written(with_valid(scenario, row, valid))
    name = f"object-{scenario.tracks.ids[row]}"
    (group,) = [group for group in root.iter("ManeuverGroup") if group.get("name") == name]
    assert [action.get("name") for action in group.iter("Action")] == [
        "AddEntityAction", "follow", "DeleteEntityAction", "AddEntityAction", "follow", "DeleteEntityAction",
    ]  # fmt: skip
    triggers = [float(entry.get("value")) for entry in group.iter("SimulationTimeCondition")]
    np.testing.assert_allclose(triggers, [0.375, 0.675, 0.875, 0.975])
    first, single = group.iter("Polyline")
    assert [float(vertex.get("time")) for vertex in first] == pytest.approx([0.5, 0.6, 0.7])
    assert [float(vertex.get("time")) for vertex in single] == pytest.approx([1.0, 1.1])
    places = [(float(p.get("x")), float(p.get("y")), float(p.get("h"))) for p in first.iter("WorldPosition")]
    np.testing.assert_allclose(np.array(places)[:, :2], scenario.tracks.position[row, 5:8, :2], atol=1e-5)
    np.testing.assert_allclose(np.array(places)[:, 2], scenario.tracks.heading[row, 5:8], atol=1e-5)
    deleted = root.findall("Storyboard/Init/Actions/GlobalAction/EntityAction")
    assert name in {action.get("entityRef") for action in deleted}


def test_lights_are_phases_of_controllers(lake):
    scenario = next(each for each in ScenarioLoader(lake) if len(each.lights))
    states = np.full_like(scenario.lights.state, LightState.LANE_STATE_STOP)
    states[:, 20:] = LightState.LANE_STATE_GO
    root = written(replace(scenario, lights=replace(scenario.lights, state=states)))
    controllers = root.findall("RoadNetwork/TrafficSignals/TrafficSignalController")
    assert len(controllers) == len(scenario.lights)
    for controller in controllers:
        red, green = controller
        assert (red.find("TrafficSignalState").get("state"), green.find("TrafficSignalState").get("state")) == (
            "red", "green",
        )  # fmt: skip
        assert float(red.get("duration")) == pytest.approx(2.0)
        assert float(green.get("duration")) == pytest.approx((scenario.num_timesteps - 20) * scenario.dt)


def test_the_ego_can_be_left_to_another_simulator(lake):
    scenario = ScenarioLoader(lake)[0]
    assert "Ego" in {group.get("name") for group in written(scenario).iter("ManeuverGroup")}
    root = written(scenario, leave_ego=True)
    assert "Ego" not in {group.get("name") for group in root.iter("ManeuverGroup")}
    (ego,) = [entry for entry in root.iter("Private") if entry.get("entityRef") == "Ego"]
    speed = float(np.hypot(*scenario.tracks.velocity[scenario.ego_index, 0]))
    assert float(ego.find(".//AbsoluteTargetSpeed").get("value")) == pytest.approx(speed, abs=1e-5)


def test_versions():
    with pytest.raises(BadParameter, match=r"wanted 1\.2 or 1\.3, found '2'"):
        writer_for("openscenario", {"version": "2"})
