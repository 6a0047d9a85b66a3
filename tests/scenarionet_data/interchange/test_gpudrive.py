"""GPUDrive's JSON, read back with Python's json."""

import json

import numpy as np

from scenarionet_data import ScenarioLoader
from scenarionet_data.interchange import writer_for
from scenarionet_data.interchange.base import Losses
from scenarionet_data.interchange.scenes import crosses_edges
from scenarionet_data.scenario.vocabulary import is_lane
from tests.scenarionet_data.interchange.conformance import WriterConformance


class TestGpuDrive(WriterConformance):
    name = "gpudrive"

    def test_values_are_those_of_the_scenario(self, lake):
        scenario = ScenarioLoader(lake)[0]
        losses = Losses()
        (content,) = writer_for("gpudrive").write(scenario, "stem", losses).values()
        written = json.loads(content)
        ego = written["objects"][written["metadata"]["sdc_track_index"]]
        row, first = scenario.ego_index, scenario.current_timestep - 10
        assert len(ego["position"]) == 91
        position = np.array([[point[axis] for axis in "xyz"] for point in ego["position"]])
        expected = scenario.tracks.position[row, first : first + 91] + scenario.origin
        valid = scenario.tracks.valid[row, first : first + 91]
        np.testing.assert_allclose(position[valid], expected[valid], atol=1e-9)
        assert ego["valid"] == valid.tolist()
        assert (ego["length"], ego["width"]) == tuple(scenario.tracks.size[row, scenario.current_timestep, :2].tolist())
        lanes = [road for road in written["roads"] if road["type"] == "lane"]
        assert len(lanes) == int(is_lane(scenario.map.feature_type).sum())
        assert any(loss.what == "links between lanes" for loss in losses.found())


def test_a_path_across_an_edge_is_an_experts(lake):
    scenario = ScenarioLoader(lake)[0]
    edge = next(
        scenario.map.polyline[row] for row in range(len(scenario.map)) if 33 <= scenario.map.feature_type[row] <= 35
    )
    middle = edge[len(edge) // 2].astype(float) + scenario.origin
    along = np.diff(edge[len(edge) // 2 - 1 : len(edge) // 2 + 1, :2], axis=0)[0]
    across = np.array([-along[1], along[0], 0.0]) / np.hypot(*along)
    path, valid = np.array([middle - across, middle + across]), np.ones(2, bool)
    assert crosses_edges(path, valid, scenario.map, scenario.origin)
    assert not crosses_edges(path + 1e5, valid, scenario.map, scenario.origin)
    assert not crosses_edges(path, ~valid, scenario.map, scenario.origin)
