"""Every validation rule, violated once: the message names the scenario and the field."""

from __future__ import annotations

from dataclasses import fields, replace

import numpy as np
import pytest

from scenarionet_data.arrays.ragged import Ragged
from scenarionet_data.errors import InvalidScenario
from scenarionet_data.scenario.description import (
    MapFeatures,
    ScenarioDescription,
    Tracks,
    is_scenario_id,
    make_scenario_id,
)
from tests.fixtures.scenarios import make_scenario


def whole(**changes):
    return lambda scenario: replace(scenario, **changes)


def part(name, **changes):
    """Change fields of ``tracks``, ``lights`` or ``map``; callables get a copy of the old array."""

    def broken(scenario: ScenarioDescription) -> ScenarioDescription:
        old = getattr(scenario, name)
        new = {key: value(_copy(getattr(old, key))) if callable(value) else value for key, value in changes.items()}
        return replace(scenario, **{name: replace(old, **new)})

    return broken


def _copy(value):
    return Ragged(value.offsets.copy(), value.values.copy()) if isinstance(value, Ragged) else value.copy()


def put(index, value):
    """Set one element."""

    def change(array):
        array[index] = value
        return array

    return change


def values(index, value):
    """Set one element of a ragged array's values."""

    def change(ragged):
        ragged.values[index] = value
        return ragged

    return change


def offsets(index, value):
    def change(ragged):
        ragged.offsets[index] = value
        return ragged

    return change


def invalid_step(scenario):
    """(object, step) that is not valid."""
    return tuple(np.argwhere(~scenario.tracks.valid)[0])


def not_zero_where_invalid(name, value):
    def broken(scenario):
        return part("tracks", **{name: put(invalid_step(scenario), value)})(scenario)

    return broken


def flat(**changes):
    """A scenario without heights, then broken."""

    def broken(scenario):
        return part(**changes.copy())(make_scenario(3, has_z=False))

    return broken


def cut(array):
    return array[:-1]


def wide(array):
    return array.astype(np.float64)


STATES = ("valid", "position", "heading", "velocity", "size")
RULES = [
    ("id", whole(id="no id")),
    ("id", whole(id="made/v1/")),
    ("id", whole(id="other/v1/s000003")),
    ("id", whole(version="v2")),
    ("timestamps", whole(timestamps=np.zeros(0))),
    ("timestamps", whole(timestamps=np.arange(31))),
    ("timestamps", whole(timestamps=np.arange(31.0) + 5)),
    ("timestamps", whole(timestamps=np.append(np.arange(30.0), np.nan))),
    ("timestamps", whole(timestamps=np.append(np.arange(30.0), 29.0))),
    ("timestamps", whole(timestamps=np.append(np.arange(30.0), np.inf))),
    ("dt", whole(dt=0.0)),
    ("dt", whole(dt=np.nan)),
    ("dt", whole(dt=np.inf)),
    ("current_timestep", whole(current_timestep=31)),
    ("current_timestep", whole(current_timestep=-1)),
    ("origin", whole(origin=np.zeros(2))),
    ("origin", whole(origin=np.zeros(3, np.float32))),
    ("origin", whole(origin=np.full(3, np.nan))),
    ("tracks.ids", part("tracks", ids=lambda ids: ids.astype(str))),
    ("tracks.ids", part("tracks", ids=put(1, "t0"))),
    ("tracks.ids", part("tracks", ids=put(1, 7))),
    ("tracks.ids", part("tracks", ids=put(1, ""))),
    ("tracks.object_type", part("tracks", object_type=put(0, 200))),
    ("tracks.object_type", part("tracks", object_type=cut)),
    ("tracks.valid", part("tracks", valid=cut)),
    ("tracks.valid", part("tracks", valid=wide)),
    ("tracks.position", part("tracks", position=wide)),
    ("tracks.position", part("tracks", position=lambda p: p[..., :2])),
    ("tracks.position", part("tracks", position=put((0, 0, 0), np.nan))),
    ("tracks.position", part("tracks", position=lambda p: p.tolist())),
    ("tracks.heading", part("tracks", heading=put((0, 0), np.inf))),
    ("tracks.heading", part("tracks", heading=put((0, 0), np.float32(np.pi)))),
    ("tracks.heading", part("tracks", heading=put((0, 0), -4))),
    ("tracks.velocity", part("tracks", velocity=cut)),
    ("tracks.size", part("tracks", size=put((0, 0, 1), 0))),
    ("tracks.size", part("tracks", size=put((0, 0, 1), -1))),
    ("tracks.position", not_zero_where_invalid("position", 1)),
    ("tracks.heading", not_zero_where_invalid("heading", 1)),
    ("tracks.velocity", not_zero_where_invalid("velocity", 1)),
    ("tracks.size", not_zero_where_invalid("size", 1)),
    ("tracks.is_size_assumed", part("tracks", is_size_assumed=cut)),
    ("tracks.is_type_assumed", part("tracks", is_type_assumed=wide)),
    ("tracks.is_velocity_estimated", part("tracks", is_velocity_estimated=cut)),
    ("tracks.is_interpolated", part("tracks", is_interpolated=cut)),
    ("tracks.is_interpolated", part("tracks", is_interpolated=lambda flags: flags.astype(np.uint8))),
    ("tracks.is_interpolated", part("tracks", is_interpolated=np.ones_like)),
    ("tracks.source_type", part("tracks", source_type=cut)),
    ("tracks.extras", part("tracks", extras=cut)),
    ("ego_id", whole(ego_id="nobody")),
    ("ego_id", part("tracks", **dict.fromkeys(STATES, put((0, 10), 0)))),
    ("lights.ids", part("lights", ids=put(0, 7))),
    ("lights.ids", part("lights", ids=lambda ids: ids.astype(str))),
    ("lights.ids", part("lights", ids=put(1, "light0"), lane_ids=put(1, "lane0"))),
    ("lights.lane_ids", part("lights", lane_ids=put(0, ""))),
    ("lights.lane_ids", part("lights", lane_ids=cut)),
    ("lights.state", part("lights", state=put((0, 0), 99))),
    ("lights.state", part("lights", state=lambda s: s[:, :-1])),
    ("lights.stop_point", part("lights", stop_point=put((0, 0), np.inf))),
    ("lights.stop_point", part("lights", stop_point=wide)),
    ("lights.stop_point", flat(name="lights", stop_point=put((0, 2), 4))),
    ("lights.is_lane_in_map", part("lights", is_lane_in_map=put(0, False))),
    ("lights.is_lane_in_map", part("lights", lane_ids=put(0, "elsewhere"))),
    ("lights.is_lane_in_map", part("lights", is_lane_in_map=wide)),
    ("lights.is_lane_in_map", whole(map=None)),
    ("lights.provenance", part("lights", provenance=put(0, 9))),
    ("map.ids", part("map", ids=put(1, "lane0"))),
    ("map.ids", part("map", ids=lambda ids: ids.astype(str))),
    ("map.feature_type", part("map", feature_type=put(0, 5))),
    ("map.feature_type", part("map", feature_type=cut)),
    ("map.polyline", part("map", polyline=values((0, 0), np.nan))),
    ("map.polyline", part("map", polyline=offsets(-1, 3))),
    ("map.polyline", part("map", polyline=offsets(0, 1))),
    ("map.polyline", part("map", polyline=offsets(2, 1))),
    ("map.polyline", part("map", polyline=lambda r: Ragged(r.offsets, r.values.astype(np.float64)))),
    ("map.polyline", part("map", polyline=lambda r: Ragged(r.offsets, r.values[:, :2]))),
    ("map.polyline", part("map", polyline=lambda r: Ragged(r.offsets[:-1], r.values))),
    ("map.polyline", flat(name="map", polyline=values((0, 2), 1))),
    ("map.polygon", part("map", polygon=values((0, 1), np.inf))),
    ("map.width", part("map", width=lambda r: Ragged.from_lists([np.ones((3, 2))] * 10, width=2))),
    ("map.speed_limit", part("map", speed_limit=put(0, -1))),
    ("map.speed_limit", part("map", speed_limit=put(0, np.inf))),
    ("map.speed_limit", part("map", speed_limit=wide)),
    ("map.is_intersection", part("map", is_intersection=put(0, 2))),
    ("map.is_intersection", part("map", is_intersection=wide)),
    ("map.extras", part("map", extras=cut)),
    *[
        (f"map.{name}", part("map", **{name: lambda r: Ragged(np.full_like(r.offsets, 0), np.zeros(1, object))}))
        for name in ("left_neighbors", "right_neighbors", "left_boundaries", "right_boundaries")
    ],
    ("map.entry_lanes", part("map", entry_lanes=values(0, 3))),
    ("map.exit_lanes", part("map", exit_lanes=values(0, ""))),
    ("map.controlled_lanes", part("map", controlled_lanes=lambda r: Ragged(r.offsets, r.values.astype(str)))),
    ("map_crop", whole(map_id="city")),
    ("map_crop", whole(map_crop=(0.0, 0.0, 1.0, 1.0))),
    ("map_crop", whole(map_id="city", map_crop=(0.0, 0.0, -1.0, 1.0))),
    ("map_crop", whole(map_id="city", map_crop=(0.0, 0.0, 1.0))),
    ("map_crop", whole(map_id="city", map_crop=(0.0, 0.0, np.nan, 1.0))),
    ("objects_of_interest", whole(objects_of_interest=("t0", "nobody"))),
    ("tracks_to_predict", whole(tracks_to_predict=(("nobody", 1),))),
]


def test_valid_scenario_passes():
    make_scenario(3).validate()
    assert (~make_scenario(3).tracks.valid).any()


@pytest.mark.parametrize(("field", "broken"), RULES, ids=[f"{i}-{field}" for i, (field, _) in enumerate(RULES)])
def test_violation_names_scenario_and_field(field, broken):
    scenario = broken(make_scenario(3))
    with pytest.raises(InvalidScenario) as caught:
        scenario.validate()
    assert caught.value.field == field
    assert caught.value.scenario_id == scenario.id
    assert str(caught.value).startswith(f"{scenario.id}: {field}: wanted ")


def test_every_field_has_a_rule():
    """A new field of tracks, lights or map must come with a rule."""
    ruled = {field for field, _ in RULES}
    for name, kind in (("tracks", Tracks), ("map", MapFeatures)):
        assert {f"{name}.{field.name}" for field in fields(kind)} <= ruled


def test_a_scenario_may_lack_map_lights_and_heights():
    make_scenario(3, has_map=False, num_lights=0, has_z=False, num_objects=1).validate()
    make_scenario(3, num_steps=1).validate()


def test_ids_are_unique_across_datasets_and_safe_in_urls():
    assert make_scenario_id("waymo", "v1.2", "a/b c~d", 7) == "waymo/v1.2/a%2Fb%20c%7Ed@7"
    assert is_scenario_id(make_scenario_id("ü/@", "1 2", "x@y", "8:30"))
    assert make_scenario_id("a", "b", "c@d") != make_scenario_id("a", "b", "c", "d")
    for text in ("a/b", "a/b/c/d", "a/b/", "a b/c/d", "a/b/c\n"):
        assert not is_scenario_id(text)


def test_missing_track_is_named():
    with pytest.raises(KeyError, match="no track 'x'; there are 12"):
        make_scenario(3).tracks.index("x")
