"""The Argoverse 2 converter agrees with what av2 reads from the same scenarios and maps."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
import shapely
import shapely.affinity

from scenarionet_data.converters.argoverse2 import Argoverse2
from scenarionet_data.forecasts.predictions import make_predictions, read_predictions, write_predictions
from scenarionet_data.forecasts.submissions import write_argoverse2
from scenarionet_data.samples.dataset import SampleKey
from scenarionet_data.scenario.description import ScenarioDescription
from scenarionet_data.scenario.vocabulary import MapFeatureType, is_lane
from tests.devkits.environments import read_with
from tests.fixtures import argoverse2 as fixture
from tests.fixtures.lakes import write_lake
from tests.fixtures.reading import scenarios

pytestmark = pytest.mark.devkits
Read = tuple[ScenarioDescription, Any]


@pytest.fixture(scope="module", params=["written", "recorded", "written log", "recorded log"])
def read(request: pytest.FixtureRequest, tmp_path_factory: pytest.TempPathFactory) -> Read:
    """The scenario of a folder with av2's reading of it, or for a log, of its map."""
    kind = "sensor" if request.param.endswith("log") else "motion-forecasting"
    if request.param.startswith("recorded"):
        (folder,) = (request.getfixturevalue("recordings") / "argoverse2" / kind / "val").iterdir()
    elif kind == "sensor":
        folder = fixture.write_sensor_log(tmp_path_factory.mktemp("log"), seconds=2.0)
    else:
        root = tmp_path_factory.mktemp("forecasting")
        fixture.write_forecasting(root, num_scenarios=1, num_tracks=12)
        (folder,) = root.iterdir()
    (scenario,) = scenarios(Argoverse2(), folder, "val")
    return scenario, read_with("readers", "argoverse2_reads.py", folder)


def test_states(read: Read) -> None:
    scenario, outside = read
    for described in outside["scenarios"]:
        tracks = scenario.tracks
        assert (scenario.source.scenario_id, scenario.source.city) == (described["id"], described["city"])
        assert described["focal"] in dict(scenario.tracks_to_predict)
        assert set(tracks.ids) == set(described["tracks"])
        for name, track in described["tracks"].items():
            row, states = tracks.index(name), np.array(track["states"])
            steps = states[:, 0].astype(int)
            assert np.flatnonzero(tracks.valid[row]).tolist() == steps.tolist()
            assert tracks.source_type[row] == track["type"]
            place = tracks.position[row, steps, :2] + scenario.origin[:2]
            np.testing.assert_allclose(place, states[:, 1:3], atol=1e-3)
            turn = (tracks.heading[row, steps] - states[:, 3] + np.pi) % (2 * np.pi) - np.pi
            assert np.abs(turn).max() < 1e-5
            np.testing.assert_allclose(tracks.velocity[row, steps], states[:, 4:6], atol=1e-3)


def test_lanes_and_their_links(read: Read) -> None:
    scenario, outside = read
    features = scenario.map
    assert features is not None
    rows = {name: row for row, name in enumerate(features.ids)}
    lanes = outside["map"]["lanes"]
    assert sum(is_lane(features.feature_type)) == len(lanes)
    for name, lane in lanes.items():
        row = rows[name]
        assert bool(features.is_intersection[row]) == lane["is_intersection"]
        assert set(map(str, lane["successors"])) <= set(features.exit_lanes[row])
        assert set(map(str, lane["predecessors"])) <= set(features.entry_lanes[row])
        line = features.polyline[row][:, :2] + scenario.origin[:2]
        center = np.array(lane["center"])[:, :2]
        # av2 resamples centrelines to ten points; ours is the file's, or the midline of the boundaries.
        for own, theirs in ((line[0], center[0]), (line[-1], center[-1])):
            assert np.hypot(*(own - theirs)) < 0.5


def test_areas(read: Read) -> None:
    scenario, outside = read
    features = scenario.map
    assert features is not None
    drivable = features.feature_type == MapFeatureType.DRIVABLE_AREA
    own = [shapely.Polygon(features.polygon[row][:, :2]) for row in np.flatnonzero(drivable)]
    theirs = [shapely.make_valid(shapely.Polygon(np.array(area)[:, :2])) for area in outside["map"]["areas"].values()]
    moved = shapely.affinity.translate(shapely.union_all(own), *scenario.origin[:2])
    assert moved.symmetric_difference(shapely.union_all(theirs)).area < 1e-3 * moved.area
    places = [area + scenario.origin for area in features.polygon if len(area)]
    for edges in outside["map"]["crossings"].values():
        corners = np.concatenate(edges)[:, :2]
        assert any(
            len(place) == len(corners) and all(np.hypot(*(place[:, :2] - c).T).min() < 1e-2 for c in corners)
            for place in places
        )


def test_submission_is_read_by_the_owner(tmp_path) -> None:
    """Trajectories are in the frame of the city, the most probable one first."""
    fixture.write_forecasting(tmp_path / "raw", num_scenarios=2, num_tracks=6)
    recorded = scenarios(Argoverse2(), tmp_path / "raw", "val")
    lake = write_lake(tmp_path / "lake", recorded)
    keys = [SampleKey(each.id, each.current_timestep, (each.tracks_to_predict[0][0],)) for each in recorded]
    modes = np.random.default_rng(0).normal(0.0, 10.0, (len(keys), 6, 60, 2)).astype(np.float32)
    shares = np.tile([0.3, 0.25, 0.2, 0.15, 0.07, 0.03], (len(keys), 1))
    poses = np.zeros((len(keys), 4), np.float32)
    poses[:, 3] = 1.0
    write_predictions(tmp_path / "p.parquet", [make_predictions(keys, modes, shares, poses, 0.1)])
    write_argoverse2(lake, read_predictions(tmp_path / "p.parquet"), tmp_path / "submission.parquet")
    found = read_with("readers", "argoverse2_reads.py", tmp_path / "submission.parquet")
    assert set(found) == {each.source.scenario_id for each in recorded}
    for number, each in enumerate(recorded):
        read = found[each.source.scenario_id]
        np.testing.assert_allclose(read["probabilities"], shares[number], atol=1e-6)
        (trajectories,) = read["tracks"].values()
        assert tuple(read["tracks"]) == keys[number].track_ids
        np.testing.assert_allclose(np.array(trajectories) - each.origin[:2], modes[number], atol=1e-3)
