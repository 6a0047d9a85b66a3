"""OpenDRIVE files, read back as XML."""

from xml.etree import ElementTree as Xml

import numpy as np
import pytest

from scenarionet_data import ScenarioLoader
from scenarionet_data.errors import InvalidScenario
from scenarionet_data.interchange import writer_for
from scenarionet_data.interchange.base import Losses
from scenarionet_data.interchange.opendrive.writer import _lines, write_map
from tests.fixtures.scenarios import small
from tests.scenarionet_data.interchange.conformance import WriterConformance


class TestOpenDrive(WriterConformance):
    name = "opendrive"

    def test_roads_are_as_long_as_their_pieces(self, lake):
        (content,) = writer_for("opendrive").write(ScenarioLoader(lake)[0], "map", Losses()).values()
        root = Xml.fromstring(content)
        for road in root.findall("road"):
            pieces = road.findall("planView/geometry")
            total = sum(float(piece.get("length")) for piece in pieces)
            assert float(road.get("length")) == pytest.approx(total, abs=1e-6)
        ids = [element.get("id") for element in (*root.findall("road"), *root.findall("junction"))]
        assert len(set(ids)) == len(ids)


def test_lights_are_signals_with_controllers(lake):
    scenario = next(each for each in ScenarioLoader(lake) if len(each.lights))
    losses = Losses()
    root = Xml.fromstring(write_map(scenario, losses))
    signals = {signal.get("id") for signal in root.iter("signal")}
    assert len(signals) == len(scenario.lights)
    assert {control.get("signalId") for control in root.iter("control")} == signals


def test_a_function_is_kept_to_a_tolerance():
    stations = np.linspace(0.0, 20.0, 41)
    values = np.where(stations < 10.0, 3.5, 3.5 + 0.2 * (stations - 10.0))
    pieces = [tuple(map(float, piece)) for piece in _lines(stations, values, 0.001)]
    assert len(pieces) == 2
    assert pieces[0] == (0.0, 3.5, 0.0)
    assert pieces[1] == pytest.approx((10.0, 3.5, 0.2))


def test_scenarios_without_a_map_are_refused():
    with pytest.raises(InvalidScenario, match="expected a map, found none"):
        write_map(small(0, has_map=False), Losses())
