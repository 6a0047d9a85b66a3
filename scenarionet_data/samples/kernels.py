"""Compiled loops from blocks of scenarios to the agents of samples.

B samples, A agents, H timesteps of history, F of future, K = H + F.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np

from scenarionet_data.arrays.dtypes import Bool, Float32, Float64, Int32, Int64, UInt8, UInt64
from scenarionet_data.compiled.decorators import device_function, kernel
from scenarionet_data.samples.scene_kernels import (
    EXTENTS,
    INTERPOLATED,
    KIND,
    NUM_EXTENTS,
    NUM_TRACKS,
    START,
    TRACK_FIELDS,
    VALID,
    SceneMemory,
)
from scenarionet_data.samples.window_kernels import (
    RecordedFrames,
    Rules,
    SceneObjects,
    Track,
    element_at,
    fill_run,
    fill_step,
    find_frames,
    scene_of,
    state_at,
)

NUM_FEATURES = 5
X, Y, HEADING, VX, VY = range(NUM_FEATURES)
"""Features of a state, in the sample's frame."""


class Wanted(NamedTuple):
    """The samples."""

    block: Int64  # (B,) place of the scenario's block [words]; -1 for samples that are left out
    moment: Int32  # (B,) recorded timestep that is the current one
    centre: Int32  # (B,) row of the object in the origin; -1 for none
    bounds: Int64  # (B + 1,) of targets
    targets: Int32  # rows of targets
    angle: Float64  # (B,) [rad] by which the sample is turned
    mirror: Float64  # (B,) -1 for mirrored samples, else 1
    keys: UInt64  # (B,) of random numbers


class AgentArrays(NamedTuple):
    """Arrays that are filled."""

    history: Float32  # (B, A * H * 5)
    history_valid: Bool  # (B, A * H)
    history_interpolated: Bool  # (B, A * H)
    future: Float32  # (B, A * F * 5)
    future_valid: Bool  # (B, A * F)
    future_interpolated: Bool  # (B, A * F)
    size: Float32  # (B, A * 3)
    kind: Int32  # (B, A)
    is_target: Bool  # (B, A)
    row: Int32  # (B, A) row in the scenario, -1 for none
    pose: Float64  # (B, 4) origin x, y [m], heading of +x [rad], mirror; NaN without a centre


@kernel(nogil=True, divides_by_zero=True)
def fill_agents(memory: SceneMemory, wanted: Wanted, rules: Rules, out: AgentArrays) -> None:
    """Choose the agents of each sample, and fill in their states in the sample's frame."""
    num_agents, longest, past = out.kind.shape[1], 0, rules.num_history
    future = out.future_valid.shape[1] // num_agents
    steps = past + future
    for block in wanted.block:
        if block >= 0:
            longest = max(longest, memory.ints[block + NUM_TRACKS])
    rows, order, distances = np.empty(longest, np.int64), np.empty(longest, np.int64), np.empty(longest, np.float64)
    frames = RecordedFrames(np.empty(steps, np.int32), np.empty(steps, np.float64), np.empty(steps, np.float64))
    track = Track(
        np.empty(steps, np.float32),
        np.empty(steps, np.float32),
        np.empty(steps, np.float32),
        np.empty(steps, np.float32),
        np.empty(steps, np.float32),
        np.empty(steps, np.uint8),
    )
    for sample in range(len(wanted.block)):
        if wanted.block[sample] < 0:
            continue
        scene, moment = scene_of(memory, wanted.block[sample]), wanted.moment[sample]
        at = element_at(scene, wanted.centre[sample], moment)
        found, begin, end = 0, 0, 0
        out.pose[sample] = np.nan
        pose = (0.0, 0.0, 0.0, 0.0, 0.0, 0.0)
        if at >= 0:
            begin, end = find_frames(scene.times, moment, rules, frames)
            found = _agents_near(scene, wanted, rules, sample, at, rows, distances)
            order[:found] = np.arange(found)
            sort(distances, order, found)
            mirror = wanted.mirror[sample]
            origin_x, origin_y, turn, _, _ = state_at(scene, wanted.centre[sample], at)
            turn -= wanted.angle[sample] * mirror
            pose = (origin_x, origin_y, turn, np.cos(turn), np.sin(turn), mirror)
            out.pose[sample, 0], out.pose[sample, 1] = origin_x, origin_y
            out.pose[sample, 2], out.pose[sample, 3] = turn, mirror
        count = min(found, num_agents)
        for agent in range(count):
            row = rows[order[agent]]
            track.flags[:] = 0
            fill_run(scene, frames, row, begin, end, pose, track)
            for step in range(begin):
                fill_step(scene, frames, row, step, rules, pose, track)
            for step in range(end, steps):
                fill_step(scene, frames, row, step, rules, pose, track)
            _describe(scene, row, moment, sample, agent, out)
            out.is_target[sample, agent] = distances[order[agent]] < 0
            here, there = slice(agent * past, (agent + 1) * past), slice(agent * future, (agent + 1) * future)
            history = out.history[sample, here.start * NUM_FEATURES : here.stop * NUM_FEATURES]
            _write(track, 0, history, out.history_valid[sample, here], out.history_interpolated[sample, here])
            states = out.future[sample, there.start * NUM_FEATURES : there.stop * NUM_FEATURES]
            _write(track, past, states, out.future_valid[sample, there], out.future_interpolated[sample, there])
            if rules.noise > 0.0:
                for step in range(past):
                    if track.flags[step] & VALID:
                        number = row * past + step
                        _add_noise(wanted.keys[sample], number, rules.noise, history[step * NUM_FEATURES :])
        out.history[sample, count * past * NUM_FEATURES :], out.future[sample, count * future * NUM_FEATURES :] = (
            0.0,
            0.0,
        )
        out.history_valid[sample, count * past :], out.history_interpolated[sample, count * past :] = False, False
        out.future_valid[sample, count * future :], out.future_interpolated[sample, count * future :] = False, False
        out.size[sample, count * NUM_EXTENTS :] = 0.0
        out.kind[sample, count:], out.row[sample, count:], out.is_target[sample, count:] = 0, -1, False


@device_function(divides_by_zero=True)
def sort(values: Any, order: Int64, count: int) -> None:
    """Sort an order of a few numbers, or one that is nearly right, by their values: equal ones stay."""
    for number in range(count):
        moved, place = order[number], number
        while place > 0 and values[order[place - 1]] > values[moved]:
            order[place] = order[place - 1]
            place -= 1
        order[place] = moved


@device_function(divides_by_zero=True)
def _agents_near(
    scene: SceneObjects, wanted: Wanted, rules: Rules, sample: int, centre: int, rows: Int64, distances: Float64
) -> int:
    """Collect the rows of agents seen now, with their distances from the centre; below 0 for targets."""
    moment, found = wanted.moment[sample], 0
    x, y, _, _, _ = state_at(scene, wanted.centre[sample], centre)
    targets = wanted.targets[wanted.bounds[sample] : wanted.bounds[sample + 1]]
    for row in range(len(scene.tracks) // TRACK_FIELDS):
        at = element_at(scene, row, moment)
        if at < 0:
            continue
        rank = -1
        for number in range(len(targets)):
            if targets[number] == row:
                rank = number
        there_x, there_y, _, _, _ = state_at(scene, row, at)
        distance = np.hypot(there_x - x, there_y - y)
        if rank < 0:
            is_near = distance <= rules.radius and _is_one_of(scene.tracks[row * TRACK_FIELDS + KIND], rules.types)
            is_centre = row == wanted.centre[sample]
            draw = _uniform(wanted.keys[sample], 4 * row) if rules.drop > 0.0 else 1.0
            if not is_centre and (not is_near or draw < rules.drop):
                continue
        rows[found], distances[found] = row, distance if rank < 0 else rank - len(targets)
        found += 1
    return found


@device_function
def _is_one_of(kind: int, types: UInt8) -> bool:
    is_found = False
    for each in types:
        is_found |= kind == each
    return is_found


@device_function(divides_by_zero=True)
def _describe(scene: SceneObjects, row: int, moment: int, sample: int, agent: int, out: AgentArrays) -> None:
    """Fill row, type and size of an agent."""
    fields = scene.tracks[row * TRACK_FIELDS : (row + 1) * TRACK_FIELDS]
    out.row[sample, agent], out.kind[sample, agent] = row, fields[KIND]
    for axis in range(NUM_EXTENTS):
        first, changes = fields[EXTENTS + axis] >> 1, fields[EXTENTS + axis] & 1
        size = scene.sizes[first + changes * (moment - fields[START])]
        out.size[sample, agent * NUM_EXTENTS + axis] = size


@device_function(divides_by_zero=True, in_lanes=True)
def _write(track: Track, first: int, out: Float32, valid: Bool, is_interpolated: Bool) -> None:
    """Write states from a timestep on, which are 0 where they are not valid."""
    for step in range(len(valid)):
        flags = track.flags[first + step]
        valid[step], is_interpolated[step] = flags & VALID != 0, flags == VALID | INTERPOLATED
    for step in range(len(valid)):
        at, is_seen = step * NUM_FEATURES, track.flags[first + step] & VALID != 0
        out[at + X] = track.x[first + step] if is_seen else 0.0
        out[at + Y] = track.y[first + step] if is_seen else 0.0
        out[at + HEADING] = track.heading[first + step] if is_seen else 0.0
        out[at + VX] = track.vx[first + step] if is_seen else 0.0
        out[at + VY] = track.vy[first + step] if is_seen else 0.0


@device_function(divides_by_zero=True)
def _add_noise(key: int, number: int, deviation: float, state: Float32) -> None:
    """Add normally distributed noise to a position (Box and Muller 1958)."""
    radius = deviation * np.sqrt(-2.0 * np.log(1.0 - _uniform(key, 4 * number + 1)))
    angle = 2.0 * np.pi * _uniform(key, 4 * number + 2)
    state[X] += radius * np.cos(angle)
    state[Y] += radius * np.sin(angle)


@device_function
def _uniform(key: int, number: int) -> Any:
    """Random number in [0, 1): SplitMix64 (Steele, Lea, Flood 2014), a function of key and number."""
    state = np.uint64(key) + np.uint64(number + 1) * np.uint64(0x9E3779B97F4A7C15)
    state = (state ^ (state >> np.uint64(30))) * np.uint64(0xBF58476D1CE4E5B9)
    state = (state ^ (state >> np.uint64(27))) * np.uint64(0x94D049BB133111EB)
    state = state ^ (state >> np.uint64(31))
    return np.float64(state >> np.uint64(11)) * 2.0**-53
