"""The ten v1.0-mini scenes, converted from tables rebuilt from ScenarioNet's pickles, against those pickles."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest

from scenarionet_data.converters.nuscenes import NuScenes
from scenarionet_data.scenario.description import ScenarioDescription
from scenarionet_data.scenario.vocabulary import MapFeatureType, ObjectType, is_lane
from tests.fixtures.motion import motion_errors, one_way_links
from tests.fixtures.nuscenes_recorded import read_pickles, write_recorded
from tests.fixtures.reading import scenarios

pytestmark = pytest.mark.integration

CONVERTER = NuScenes()
Pair = tuple[dict[str, Any], ScenarioDescription]


@pytest.fixture(scope="module")
def pairs(recordings: Path, tmp_path_factory: pytest.TempPathFactory) -> list[Pair]:
    """Each pickle with the scenario converted from its tables."""
    root = tmp_path_factory.mktemp("nuscenes")
    pickles = read_pickles(recordings)
    write_recorded(root, pickles)
    made = {s.source.scenario_id: s for s in scenarios(CONVERTER, root, "mini")}
    assert len(made) == len(pickles) == 10
    return [(pickled, made[pickled["id"]]) for pickled in pickles]


def turned(angle: Any) -> np.ndarray:
    return np.abs((np.asarray(angle, np.float64) + np.pi) % (2 * np.pi) - np.pi)


def state(track: dict[str, Any], name: str) -> np.ndarray:
    return np.asarray(track["state"][name])


def test_scenes_validate_and_are_linked(pairs: list[Pair]) -> None:
    for pickled, scenario in pairs:
        scenario.validate()
        assert scenario.num_timesteps == pickled["length"]
        assert len(scenario.tracks) == len(pickled["tracks"])
        np.testing.assert_allclose(scenario.timestamps, pickled["metadata"]["ts"], atol=1e-6)
        assert scenario.source.city == scenario.map_id == pickled["metadata"]["map"]
        assert scenario.source.date == pickled["metadata"]["date"]
        assert one_way_links(scenario) == []


def test_objects_match_the_pickle(pairs: list[Pair]) -> None:
    """Every state at every step, including interpolated ones; only velocities are estimated differently."""
    for pickled, scenario in pairs:
        tracks = scenario.tracks
        for token, track in pickled["tracks"].items():
            if token == "ego":
                continue
            k = tracks.index(token)
            valid = state(track, "valid") > 0
            assert np.array_equal(tracks.valid[k], valid)
            position = tracks.position[k, valid].astype(np.float64) + scenario.origin
            assert np.abs(position - state(track, "position")[valid]).max() < 1e-4
            keyframes = np.flatnonzero(valid[::5]) * 5
            assert turned(tracks.heading[k, keyframes] - state(track, "heading")[keyframes]).max() < 2e-6
            for column, name in enumerate(("length", "width", "height")):
                wanted = state(track, name).reshape(-1)[valid]
                np.testing.assert_allclose(tracks.size[k, valid, column], wanted, atol=1e-4)
            assert tracks.source_type[k] == track["metadata"]["type"]
            assert ObjectType(tracks.object_type[k]).name == track["type"]


def test_ego_is_ahead_of_its_position_in_the_pickle(pairs: list[Pair]) -> None:
    """ScenarioNet uses the rear axle as the centre of the box, and swaps length and width."""
    for pickled, scenario in pairs:
        tracks, k, ego = scenario.tracks, scenario.ego_index, pickled["tracks"]["ego"]
        heading = state(ego, "heading")
        axle = state(ego, "position")[:, :2]
        ahead = 1.385 * np.stack([np.cos(heading), np.sin(heading)], axis=-1)
        position = tracks.position[k, :, :2].astype(np.float64) + scenario.origin[:2]
        assert np.abs(position - axle - ahead).max() < 2e-4
        assert turned(tracks.heading[k] - heading).max() < 1e-4
        assert tracks.size[k, 0].tolist() == pytest.approx([4.084, 1.73, 1.562])
        assert state(ego, "length")[0] == 1.73


def test_motion_is_within_budget(pairs: list[Pair]) -> None:
    velocity, heading = (np.concatenate(e) for e in zip(*(motion_errors(s) for _, s in pairs), strict=True))
    assert np.median(velocity) < CONVERTER.budgets.velocity_median / 10
    assert np.quantile(velocity, 0.99) < CONVERTER.budgets.velocity_p99 / 2
    assert np.quantile(heading, 0.99) < CONVERTER.budgets.heading_p99 / 2


def test_lanes_and_dividers_match_the_pickle(pairs: list[Pair]) -> None:
    """Centrelines are rebuilt through arcs; dividers and outlines match point by point."""
    for pickled, scenario in pairs:
        features, source = scenario.map, pickled["map_features"]
        assert features is not None
        found = [k for k, name in enumerate(features.ids) if name in source]
        assert is_lane(features.feature_type[found]).sum() > 60
        for k in found:
            wanted = np.array(source[features.ids[k]]["polyline"])[:, :2]
            step = np.hypot(*np.diff(wanted, axis=0, prepend=np.inf).T)
            points = features.polyline[k][:, :2].astype(np.float64) + scenario.origin[:2]
            assert np.abs(points - wanted[step > 0.01]).max() < 2e-3
            polygon = features.polygon[k][:, :2].astype(np.float64) + scenario.origin[:2]
            if len(polygon):
                outline = np.array(source[features.ids[k]]["polygon"])
                assert np.abs(polygon - outline[: len(polygon)]).max() < 1e-3


def test_recorded_lanes_have_dividers_beside_them(pairs: list[Pair]) -> None:
    """In the recorded maps every node of a divider is a corner of some lane."""
    for _, scenario in pairs:
        features = scenario.map
        assert features is not None
        lanes = is_lane(features.feature_type)
        bounded = (features.left_boundaries.lengths > 0) | (features.right_boundaries.lengths > 0)
        assert bounded[lanes].sum() > 20
        for k in np.flatnonzero(lanes & bounded):
            ids = {*features.left_boundaries[k], *features.right_boundaries[k]}
            assert len(ids) == len(features.left_boundaries[k]) + len(features.right_boundaries[k])
        edges = features.feature_type == MapFeatureType.ROAD_EDGE_BOUNDARY
        areas = features.feature_type == MapFeatureType.DRIVABLE_AREA
        assert edges.any()
        assert areas.any()
