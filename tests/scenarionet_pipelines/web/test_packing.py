"""The packed scenario, read back as ``static/scene.js`` reads it, equals the original."""

from __future__ import annotations

import json
import struct
from dataclasses import replace

import numpy as np
import pytest

from scenarionet_data.scenario.description import Lights
from scenarionet_data.scenario.lane_polygons import lane_outlines
from scenarionet_data.scenario.vocabulary import LIGHT_COLORS, LightColor, ObjectType, is_lane, names
from scenarionet_pipelines.web.packing import pack
from tests.fixtures.scenarios import make_scenario

pytestmark = pytest.mark.integration


def unpack(content: bytes):
    (length,) = struct.unpack_from("<I", content)
    header = json.loads(content[4 : 4 + length])
    arrays = {}
    for name, each in header["arrays"].items():
        begin = 4 + length + each["offset"]
        assert begin % 4 == 0, "views of typed arrays begin at their element's size"
        count = int(np.prod(each["shape"]))
        arrays[name] = np.frombuffer(content, each["type"], count, begin).reshape(each["shape"])
    return header, arrays


@pytest.mark.parametrize("seed", range(4))
def test_arrays_round_trip(seed):
    scenario = make_scenario(seed)
    header, arrays = unpack(pack(scenario))
    tracks = scenario.tracks
    np.testing.assert_array_equal(arrays["position"], tracks.position[..., :2])
    np.testing.assert_array_equal(arrays["heading"], tracks.heading)
    np.testing.assert_array_equal(arrays["velocity"], tracks.velocity)
    np.testing.assert_array_equal(arrays["valid"], tracks.valid)
    np.testing.assert_allclose(arrays["time"], scenario.timestamps, rtol=1e-6)
    assert [each["id"] for each in header["objects"]] == list(tracks.ids)
    assert [each["type"] for each in header["objects"]] == list(names(ObjectType)[tracks.object_type])
    assert (header["ego"], header["now"]) == (scenario.ego_index, scenario.current_timestep)
    features = scenario.map
    np.testing.assert_array_equal(arrays["linePoints"], features.polyline.values[:, :2])
    lanes = np.flatnonzero(is_lane(features.feature_type))
    outlines = dict(zip(lanes, lane_outlines(features, lanes), strict=True))
    assert len(arrays["areaOffsets"]) == len(features.ids) + 1
    for row, recorded in enumerate(features.polygon):
        packed = arrays["areaPoints"][slice(*arrays["areaOffsets"][row : row + 2])]
        np.testing.assert_array_equal(packed, recorded[:, :2] if len(recorded) else outlines.get(row, packed[:0]))
    kinds = {each["id"]: each["kind"] for each in header["features"]}
    assert kinds["lane0"] == "lane"
    assert kinds["line0"] == "line"
    assert kinds["cross"] == "crosswalk"
    assert kinds["sign"] == "stop"
    assert kinds["nothing"] == "area"
    shown = np.array(header["lightColors"])[arrays["lightState"]]
    assert (shown == names(LightColor)[LIGHT_COLORS[scenario.lights.state]]).all()


def test_lights_without_stop_point_are_placed_at_the_start_of_their_lane():
    scenario = make_scenario(1, num_lights=2)
    _, arrays = unpack(pack(scenario))
    np.testing.assert_array_equal(arrays["lightPosition"][0], scenario.lights.stop_point[0, :2])
    np.testing.assert_array_equal(arrays["lightPosition"][1], scenario.map.polyline[1][0, :2])


def test_packing_does_not_modify_the_scenario():
    """Also with a single light whose stop point is unknown."""
    lights = replace(make_scenario(1, num_lights=1).lights, stop_point=np.full((1, 3), np.nan, np.float32))
    pack(replace(make_scenario(1), lights=lights))
    assert np.isnan(lights.stop_point).all()


def test_scenario_without_map_or_lights():
    scenario = replace(make_scenario(1, has_map=False), lights=Lights.empty(31))
    header, arrays = unpack(pack(scenario))
    assert header["features"] == []
    assert "linePoints" not in arrays
    assert arrays["lightState"].shape == (0, 31)
