"""Compiled loops from blocks of scenarios to the states of one object over a sample's window.

K = H + F timesteps, of history and future.
"""

from __future__ import annotations

import math
from typing import Any, NamedTuple

import numpy as np

from scenarionet_data.arrays.dtypes import Float32, Float64, Int32, UInt8
from scenarionet_data.compiled.decorators import device_function
from scenarionet_data.samples.scene_kernels import (
    FIRST,
    FLAGS,
    INTERPOLATED,
    NUM_STATE_FIELDS,
    NUM_STATES,
    NUM_TIMES,
    NUM_TRACKS,
    SIZES,
    SPAN,
    START,
    STATES,
    TIMES,
    TRACK_FIELDS,
    TRACKS,
    VALID,
    WORD,
    SceneMemory,
)

_SAME_TIME = 1e-6
"""Times closer than this are the same [s]."""
_JITTER = 0.05
"""Recorded times may be this many timesteps away from the sample's, and are kept."""
_FULL_TURN = 2.0 * math.pi


class Rules(NamedTuple):
    """Numbers from the choices."""

    num_history: int
    dt: float
    longest_gap: float
    radius: float
    types: UInt8  # (T,) ObjectType
    noise: float
    drop: float


class SceneObjects(NamedTuple):
    """The objects of a scenario."""

    tracks: Int32  # (TRACK_FIELDS * R,)
    states: Float32  # (5 * n,)
    flags: UInt8  # (n,)
    sizes: Float32
    times: Float64


class RecordedFrames(NamedTuple):
    """Recorded frames around each timestep of a sample."""

    before: Int32  # (K,) last recorded timestep at or before it; -1 outside of the recording
    since: Float64  # (K,) [s] from that to the sample's timestep
    span: Float64  # (K,) [s] to the next recorded timestep; 0 at the last one


class Track(NamedTuple):
    """States of one object over the window, in the sample's frame: scratch memory."""

    x: Float32  # (K,)
    y: Float32
    heading: Float32
    vx: Float32
    vy: Float32
    flags: UInt8  # (K,) VALID and INTERPOLATED


@device_function(allocates=True, divides_by_zero=True)
def scene_of(memory: SceneMemory, block: int) -> SceneObjects:
    """The objects of a block."""
    ints, floats = memory.ints, memory.floats
    count, at = np.int64(ints[block + NUM_STATES]), block + ints[block + STATES]
    tracks, flags = block + ints[block + TRACKS], WORD * (block + ints[block + FLAGS])
    times = (block + TIMES) // 2
    return SceneObjects(
        ints[tracks : tracks + TRACK_FIELDS * ints[block + NUM_TRACKS]],
        floats[at : at + NUM_STATE_FIELDS * count],
        memory.bytes[flags : flags + count],
        floats[block + ints[block + SIZES] : tracks],
        memory.doubles[times : times + ints[block + NUM_TIMES]],
    )


@device_function(divides_by_zero=True)
def find_frames(times: Float64, moment: int, rules: Rules, frames: RecordedFrames) -> tuple[int, int]:
    """Find the recorded frames around the timesteps of a sample.

    Returns:
        First and last timestep of a run of consecutive frames, whose states are those of the recording.
    """
    steps = len(frames.before)
    now = times[moment] - (rules.num_history - 1) * rules.dt
    tolerance = _JITTER * rules.dt
    if not _is_regular(times, now, rules.dt, steps, tolerance):
        tolerance = _SAME_TIME
    at, begin, end = 0, 0, 0
    for step in range(steps):
        time = now + step * rules.dt
        while at + 1 < len(times) and times[at + 1] <= time + tolerance:
            at += 1
        since = time - times[at]
        frames.before[step] = at if since >= -tolerance else -1
        frames.since[step] = 0.0 if abs(since) <= tolerance else since
        frames.span[step] = times[at + 1] - times[at] if at + 1 < len(times) else 0.0
        is_recorded = abs(since) <= tolerance and not 0.0 < frames.span[step] <= _reach(rules)
        if is_recorded and end == 0:
            begin, end = step, step + 1
        elif is_recorded and end == step and at == frames.before[begin] + step - begin:
            end = step + 1
    return begin, end


@device_function(divides_by_zero=True)
def _is_regular(times: Float64, now: float, dt: float, steps: int, tolerance: float) -> bool:
    """Whether each timestep within the recording has a recorded frame."""
    at = 0
    for step in range(steps):
        time = now + step * dt
        if time < times[0] - tolerance or time > times[-1] + tolerance:
            continue
        while at + 1 < len(times) and times[at + 1] <= time + tolerance:
            at += 1
        if abs(times[at] - time) > tolerance:
            return False
    return True


@device_function
def _reach(rules: Rules) -> Any:
    """Time for which a state holds before and after it was recorded [s]."""
    return 0.5 * rules.dt + _SAME_TIME


@device_function
def element_at(scene: SceneObjects, row: int, step: int) -> Any:
    """Number of an object's state at a recorded timestep; -1 where it is not seen."""
    if row < 0:
        return -1
    place = step - scene.tracks[row * TRACK_FIELDS + START]
    if place < 0 or place >= scene.tracks[row * TRACK_FIELDS + SPAN]:
        return -1
    at = scene.tracks[row * TRACK_FIELDS + FIRST] + place
    return at if scene.flags[at] & VALID else -1


@device_function
def state_at(scene: SceneObjects, row: int, element: int) -> tuple[float, float, float, float, float]:
    """An object's position, heading and velocity, in the frame of the scenario."""
    first, span = scene.tracks[row * TRACK_FIELDS + FIRST], np.int64(scene.tracks[row * TRACK_FIELDS + SPAN])
    at, states = NUM_STATE_FIELDS * first + element - first, scene.states
    return (
        np.float64(states[at]),
        np.float64(states[at + span]),
        np.float64(states[at + 2 * span]),
        np.float64(states[at + 3 * span]),
        np.float64(states[at + 4 * span]),
    )


@device_function(divides_by_zero=True)
def fill_run(
    scene: SceneObjects,
    frames: RecordedFrames,
    row: int,
    begin: int,
    end: int,
    pose: tuple[float, float, float, float, float, float],
    track: Track,
) -> None:
    """Fill the states of an object over a run of consecutive frames: several at once."""
    fields = scene.tracks[row * TRACK_FIELDS : (row + 1) * TRACK_FIELDS]
    shift = fields[START] - frames.before[begin] + begin if end > begin else 0  # step of its first state
    first, last = max(begin, shift), min(end, shift + fields[SPAN])
    if first >= last:
        return
    span, flags = np.int64(fields[SPAN]), scene.flags[fields[FIRST] + first - shift :]
    recorded = scene.states[NUM_STATE_FIELDS * fields[FIRST] + first - shift :]
    own = (
        track.x[first:last],
        track.y[first:last],
        track.heading[first:last],
        track.vx[first:last],
        track.vy[first:last],
    )
    _move(recorded, span, pose, *own)
    for step in range(first, last):
        track.flags[step] = flags[step - first]


@device_function(divides_by_zero=True, in_lanes=True)
def _move(
    recorded: Float32,
    span: Any,
    pose: tuple[float, float, float, float, float, float],
    x: Float32,
    y: Float32,
    heading: Float32,
    vx: Float32,
    vy: Float32,
) -> None:
    """Move states to the sample's frame: differences of float32 numbers, so that it may compute with these."""
    origin_x, origin_y, turn = np.float32(pose[0]), np.float32(pose[1]), np.float32(pose[2])
    cos, sin, mirror = np.float32(pose[3]), np.float32(pose[4]), np.float32(pose[5])
    for step in range(len(x)):
        ahead, aside = recorded[step] - origin_x, recorded[span + step] - origin_y
        x[step], y[step] = cos * ahead + sin * aside, mirror * (cos * aside - sin * ahead)
    for step in range(len(heading)):
        angle = mirror * (recorded[2 * span + step] - turn)
        heading[step] = angle - _FULL_TURN * np.floor(angle / _FULL_TURN + 0.5)
    for step in range(len(vx)):
        ahead, aside = recorded[3 * span + step], recorded[4 * span + step]
        vx[step], vy[step] = cos * ahead + sin * aside, mirror * (cos * aside - sin * ahead)


@device_function(divides_by_zero=True)
def fill_step(
    scene: SceneObjects,
    frames: RecordedFrames,
    row: int,
    step: int,
    rules: Rules,
    pose: tuple[float, float, float, float, float, float],
    track: Track,
) -> None:
    """Fill the state of an object at a timestep that may be between two recorded ones, or beyond one."""
    before, since, span, reach = frames.before[step], frames.since[step], frames.span[step], _reach(rules)
    if before < 0:
        return
    first = element_at(scene, row, before)
    share, beyond, second = 0.0, 0.0, first
    if since > 0.0 or first < 0:
        after = element_at(scene, row, before + 1) if span > 0.0 else -1
        if first >= 0 and after >= 0 and span <= rules.longest_gap:
            share, second = since / span, after
        elif first >= 0 and since <= reach:
            beyond = since
        elif after >= 0 and span - since <= reach:
            first, second, beyond = after, after, since - span
        else:
            first = -1
    if first < 0:
        return
    is_interpolated = share > 0.0 or beyond != 0.0
    track.flags[step] = scene.flags[first] | (INTERPOLATED if is_interpolated else 0)
    origin_x, origin_y, turn, cos, sin, mirror = pose
    from_x, from_y, from_heading, vx, vy = state_at(scene, row, first)
    x, y, heading = from_x - origin_x + beyond * vx, from_y - origin_y + beyond * vy, from_heading - turn
    if share > 0.0:
        to_x, to_y, to_heading, to_vx, to_vy = state_at(scene, row, second)
        x += share * (to_x - from_x)
        y += share * (to_y - from_y)
        heading += share * _wrapped(to_heading - from_heading)
        vx += share * (to_vx - vx)
        vy += share * (to_vy - vy)
    track.x[step], track.y[step] = cos * x + sin * y, mirror * (cos * y - sin * x)
    track.heading[step] = _wrapped(mirror * heading)
    track.vx[step], track.vy[step] = cos * vx + sin * vy, mirror * (cos * vy - sin * vx)


@device_function
def _wrapped(angle: float) -> Any:
    """Angle in [-pi, pi)."""
    if -np.pi <= angle < np.pi:
        return angle
    return angle - 2.0 * np.pi * np.floor((angle + np.pi) / (2.0 * np.pi))
