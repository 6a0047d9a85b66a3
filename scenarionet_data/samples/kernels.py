"""Compiled loops from the joined lists of several scenarios to samples.

S scenarios, R rows (objects) of all scenarios, B samples, A agents, H timesteps of history, F of future, K = H + F.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np

from scenarionet_data.arrays.dtypes import Bool, Float32, Float64, Int32, Int64, UInt8, UInt64
from scenarionet_data.compiled.decorators import device_function, kernel

X, Y, HEADING, VX, VY = range(5)
"""Features of a state, in the sample's frame."""

_SAME_TIME = 1e-6
"""Times closer than this are the same [s]."""
_JITTER = 0.05
"""Recorded times may be this many timesteps away from the sample's, and are kept."""


class TrackLists(NamedTuple):
    """Objects of all scenarios: lists over their spans, as in the table ``tracks``."""

    bounds: Int64  # (S + 1,) first row of each scenario
    kind: UInt8  # (R,) ObjectType
    start: Int32  # (R,)
    spans: Int32  # (R,) length of each list
    offsets: Int32  # (R + 1,)
    x: Float32
    y: Float32
    heading: Float32
    vx: Float32
    vy: Float32
    length_offsets: Int32  # (R + 1,); lists of one element hold at all timesteps
    length: Float32
    width_offsets: Int32
    width: Float32
    height_offsets: Int32
    height: Float32
    valid_offsets: Int32  # (R + 1,); empty lists where all timesteps are valid
    valid: Bool
    flag_offsets: Int32  # (R + 1,); empty lists where no timestep is interpolated
    is_interpolated: Bool


class RecordedFrames(NamedTuple):
    """Recorded frames around each timestep of each sample."""

    before: Int32  # (B, K) last recorded timestep at or before it; -1 outside of the recording
    since: Float64  # (B, K) [s] from that to the sample's timestep
    span: Float64  # (B, K) [s] to the next recorded timestep; 0 at the last one


class Wanted(NamedTuple):
    """The samples."""

    scene: Int32  # (B,) scenario
    moment: Int32  # (B,) recorded timestep that is the current one
    centre: Int64  # (B,) row of the object in the origin; -1 for none
    bounds: Int64  # (B + 1,) of targets
    targets: Int64  # rows of targets
    angle: Float64  # (B,) [rad] by which the sample is turned
    mirror: Float64  # (B,) -1 for mirrored samples, else 1
    keys: UInt64  # (B,) of random numbers


class Rules(NamedTuple):
    """Numbers from the choices."""

    num_history: int
    dt: float
    longest_gap: float
    radius: float
    types: UInt8  # (T,) ObjectType
    noise: float
    drop: float


class AgentArrays(NamedTuple):
    """Arrays that are filled: zeros."""

    history: Float32  # (B, A, H, 5)
    history_valid: Bool  # (B, A, H)
    history_interpolated: Bool  # (B, A, H)
    future: Float32  # (B, A, F, 5)
    future_valid: Bool  # (B, A, F)
    future_interpolated: Bool  # (B, A, F)
    size: Float32  # (B, A, 3)
    kind: Int32  # (B, A)
    is_target: Bool  # (B, A)
    row: Int32  # (B, A) row in the scenario, -1 for none
    pose: Float64  # (B, 4) origin x, y [m], heading of +x [rad], mirror; NaN without a centre


@kernel(nogil=True)
def find_frames(times: Float64, bounds: Int64, wanted: Wanted, rules: Rules, frames: RecordedFrames) -> None:
    """Find the recorded frames around the timesteps of samples.

    Args:
        times: Recorded times of all scenarios [s].
        bounds: (S + 1,) first time of each scenario.
        wanted: The samples.
        rules: Timestep and length of the history.
        frames: Filled.
    """
    steps = frames.before.shape[1]
    for sample in range(len(wanted.scene)):
        first, end = bounds[wanted.scene[sample]], bounds[wanted.scene[sample] + 1]
        now = times[first + wanted.moment[sample]] - (rules.num_history - 1) * rules.dt
        tolerance = _JITTER * rules.dt
        if not _is_regular(times[first:end], now, rules.dt, steps, tolerance):
            tolerance = _SAME_TIME
        at = first
        for step in range(steps):
            time = now + step * rules.dt
            while at + 1 < end and times[at + 1] <= time + tolerance:
                at += 1
            since = time - times[at]
            frames.before[sample, step] = at - first if since >= -tolerance else -1
            frames.since[sample, step] = 0.0 if abs(since) <= tolerance else since
            frames.span[sample, step] = times[at + 1] - times[at] if at + 1 < end else 0.0


@device_function
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


@kernel(nogil=True)
def fill_agents(tracks: TrackLists, frames: RecordedFrames, wanted: Wanted, rules: Rules, out: AgentArrays) -> None:
    """Choose the agents of each sample, and fill in their states in the sample's frame."""
    num_agents, longest = out.kind.shape[1], 0
    for scene in range(len(tracks.bounds) - 1):
        longest = max(longest, tracks.bounds[scene + 1] - tracks.bounds[scene])
    rows, distances = np.empty(longest, np.int64), np.empty(longest, np.float64)
    for sample in range(len(wanted.scene)):
        centre, moment = wanted.centre[sample], wanted.moment[sample]
        at = _element(tracks, centre, moment)
        if at < 0:
            out.pose[sample] = np.nan
            continue
        origin_x, origin_y = np.float64(tracks.x[at]), np.float64(tracks.y[at])
        turn = np.float64(tracks.heading[at]) - wanted.angle[sample] * wanted.mirror[sample]
        found = _agents_near(tracks, wanted, rules, sample, origin_x, origin_y, rows, distances)
        order = np.argsort(distances[:found], kind="mergesort")
        cos, sin, mirror = np.cos(turn), np.sin(turn), wanted.mirror[sample]
        pose = (origin_x, origin_y, turn, cos, sin, mirror)
        out.pose[sample, 0], out.pose[sample, 1] = origin_x, origin_y
        out.pose[sample, 2], out.pose[sample, 3] = turn, mirror
        base = tracks.bounds[wanted.scene[sample]]
        for agent in range(min(found, num_agents)):
            row = rows[order[agent]]
            out.row[sample, agent], out.kind[sample, agent] = row - base, tracks.kind[row]
            out.is_target[sample, agent] = distances[order[agent]] < 0
            place = moment - tracks.start[row]
            out.size[sample, agent, 0] = _extent(tracks.length_offsets, tracks.length, row, place)
            out.size[sample, agent, 1] = _extent(tracks.width_offsets, tracks.width, row, place)
            out.size[sample, agent, 2] = _extent(tracks.height_offsets, tracks.height, row, place)
            _fill_states(tracks, frames, wanted, rules, sample, agent, pose, out)


@device_function
def _agents_near(
    tracks: TrackLists,
    wanted: Wanted,
    rules: Rules,
    sample: int,
    x: float,
    y: float,
    rows: Int64,
    distances: Float64,
) -> int:
    """Collect the rows of agents seen now, with their distances from the centre; below 0 for targets."""
    scene, moment, found = wanted.scene[sample], wanted.moment[sample], 0
    targets = wanted.targets[wanted.bounds[sample] : wanted.bounds[sample + 1]]
    for row in range(tracks.bounds[scene], tracks.bounds[scene + 1]):
        at = _element(tracks, row, moment)
        if at < 0:
            continue
        rank = -1
        for number in range(len(targets)):
            if targets[number] == row:
                rank = number
        distance = np.hypot(tracks.x[at] - x, tracks.y[at] - y)
        if rank < 0:
            is_near = distance <= rules.radius and _is_one_of(tracks.kind[row], rules.types)
            is_centre = row == wanted.centre[sample]
            draw = _uniform(wanted.keys[sample], 4 * (row - tracks.bounds[scene])) if rules.drop > 0.0 else 1.0
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


@device_function
def _element(tracks: TrackLists, row: int, step: int) -> Any:
    """Element of an object's state at a recorded timestep; -1 where it is not seen."""
    if row < 0:
        return -1
    place = step - tracks.start[row]
    if place < 0 or place >= tracks.spans[row]:
        return -1
    if not _flag(tracks.valid_offsets, tracks.valid, row, place, True):
        return -1
    return tracks.offsets[row] + place


@device_function
def _flag(offsets: Int32, flags: Bool, row: int, place: int, default: bool) -> Any:
    """Element of a list of flags, which is empty where all are the default."""
    return flags[offsets[row] + place] if offsets[row + 1] > offsets[row] else default


@device_function
def _extent(offsets: Int32, extents: Float32, row: int, place: int) -> Any:
    """Element of a list of extents, which has one element where they are constant."""
    return extents[offsets[row] + (place if offsets[row + 1] - offsets[row] > 1 else 0)]


@device_function
def _fill_states(
    tracks: TrackLists,
    frames: RecordedFrames,
    wanted: Wanted,
    rules: Rules,
    sample: int,
    agent: int,
    pose: tuple[float, float, float, float, float, float],
    out: AgentArrays,
) -> None:
    """Fill the states of one agent over the window."""
    row, num_history = tracks.bounds[wanted.scene[sample]] + out.row[sample, agent], rules.num_history
    reach = 0.5 * rules.dt + _SAME_TIME
    for step in range(frames.before.shape[1]):
        before, since = frames.before[sample, step], frames.since[sample, step]
        if before < 0:
            continue
        first = _element(tracks, row, before)
        share, beyond, second = 0.0, 0.0, first
        if since > 0.0 or first < 0:
            span = frames.span[sample, step]
            after = _element(tracks, row, before + 1) if span > 0.0 else -1
            if first >= 0 and after >= 0 and span <= rules.longest_gap:
                share, second = since / span, after
            elif first >= 0 and since <= reach:
                beyond = since
            elif after >= 0 and span - since <= reach:
                first, second, beyond = after, after, since - span
            else:
                first = -1
        if first < 0:
            continue
        place = first - tracks.offsets[row]
        is_interpolated = (
            share > 0.0 or beyond != 0.0 or _flag(tracks.flag_offsets, tracks.is_interpolated, row, place, False)
        )
        if step < num_history:
            state = out.history[sample, agent, step]
            out.history_valid[sample, agent, step] = True
            out.history_interpolated[sample, agent, step] = is_interpolated
        else:
            state = out.future[sample, agent, step - num_history]
            out.future_valid[sample, agent, step - num_history] = True
            out.future_interpolated[sample, agent, step - num_history] = is_interpolated
        _fill_state(tracks, first, second, share, beyond, pose, state)
        if rules.noise > 0.0 and step < num_history:
            _add_noise(wanted.keys[sample], out.row[sample, agent] * num_history + step, rules.noise, state)


@device_function
def _add_noise(key: int, number: int, deviation: float, state: Float32) -> None:
    """Add normally distributed noise to a position (Box and Muller 1958)."""
    radius = deviation * np.sqrt(-2.0 * np.log(1.0 - _uniform(key, 4 * number + 1)))
    angle = 2.0 * np.pi * _uniform(key, 4 * number + 2)
    state[X] += radius * np.cos(angle)
    state[Y] += radius * np.sin(angle)


@device_function
def _fill_state(
    tracks: TrackLists,
    first: int,
    second: int,
    share: float,
    beyond: float,
    pose: tuple[float, float, float, float, float, float],
    state: Float32,
) -> None:
    """Fill one state: between two elements, or beyond one, moved to the sample's frame."""
    origin_x, origin_y, turn, cos, sin, mirror = pose
    vx, vy = np.float64(tracks.vx[first]), np.float64(tracks.vy[first])
    x = tracks.x[first] - origin_x + beyond * vx
    y = tracks.y[first] - origin_y + beyond * vy
    heading = tracks.heading[first] - turn
    if share > 0.0:
        x += share * (np.float64(tracks.x[second]) - tracks.x[first])
        y += share * (np.float64(tracks.y[second]) - tracks.y[first])
        heading += share * _wrapped(np.float64(tracks.heading[second]) - tracks.heading[first])
        vx += share * (tracks.vx[second] - vx)
        vy += share * (tracks.vy[second] - vy)
    state[X], state[Y] = cos * x + sin * y, mirror * (cos * y - sin * x)
    state[HEADING] = _wrapped(mirror * heading)
    state[VX], state[VY] = cos * vx + sin * vy, mirror * (cos * vy - sin * vx)


@device_function
def _wrapped(angle: float) -> Any:
    """Angle in [-pi, pi)."""
    if -np.pi <= angle < np.pi:
        return angle
    return angle - 2.0 * np.pi * np.floor((angle + np.pi) / (2.0 * np.pi))


@device_function
def _uniform(key: int, number: int) -> Any:
    """Random number in [0, 1): SplitMix64 (Steele, Lea, Flood 2014), a function of key and number."""
    state = np.uint64(key) + np.uint64(number + 1) * np.uint64(0x9E3779B97F4A7C15)
    state = (state ^ (state >> np.uint64(30))) * np.uint64(0xBF58476D1CE4E5B9)
    state = (state ^ (state >> np.uint64(27))) * np.uint64(0x94D049BB133111EB)
    state = state ^ (state >> np.uint64(31))
    return np.float64(state >> np.uint64(11)) * 2.0**-53
