"""Conversion of worlds and states to scenes and moments for plots."""

from __future__ import annotations

import numpy as np

from scenarionet_data.arrays.ragged import Ragged
from scenarionet_data.plots import Moment, Scene
from scenarionet_data.plots.shapes import MapShapes
from scenarionet_sim.roads.roads import Roads
from scenarionet_sim.worlds.state import State
from scenarionet_sim.worlds.world import World


def scene_of(world: World) -> Scene:
    """Convert a world to a scene with the same object rows."""
    velocity = world.log_velocity
    return Scene(
        scenario_id=world.scenario_id,
        dt=world.dt,
        current_timestep=0,
        ego=world.ego,
        track_ids=world.track_ids,
        object_type=world.object_type,
        size=world.size,
        position=world.log_position,
        heading=world.log_heading,
        speed=np.hypot(velocity[..., 0], velocity[..., 1]),
        present=world.log_valid,
        light_stop=world.light_stop,
        light_state=world.light_state,
        map=shapes_of(world.roads),
    )


def shapes_of(roads: Roads) -> MapShapes:
    """Convert a map to shapes; consecutive segments are joined to polylines."""
    segments = roads.segments
    is_new = np.ones(len(segments), np.bool_)
    is_new[1:] = (np.diff(roads.segment_feature) != 0) | (segments[1:, :2] != segments[:-1, 2:]).any(axis=1)
    starts = np.flatnonzero(is_new)
    lengths = np.diff(np.append(starts, len(segments))) + 1
    lines = Ragged.from_flat(lengths, np.empty((len(segments) + len(starts), 2), np.float32))
    is_last = np.zeros(len(lines.values), np.bool_)
    is_last[lines.offsets[1:] - 1] = True
    lines.values[~is_last] = segments[:, :2]
    lines.values[is_last] = segments[np.append(starts[1:], len(segments))[: len(starts)] - 1, 2:]
    return MapShapes(roads.polygons, roads.polygon_type, lines, roads.segment_type[starts], roads.lanes)


def moment_of(world: World, state: State, slot: int = 0) -> Moment:
    """Copy the current moment of a slot."""
    here = slice(0, world.num_objects)
    position, heading = state.position[slot, here].copy(), state.heading[slot, here].copy()
    return Moment(int(state.timestep[slot]), position, heading, state.present[slot, here].copy())
