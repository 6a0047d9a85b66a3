"""Motion of all road users of many concrete scenarios at once, along their routes.

Speeds change linearly and sideways moves are of least jerk, so positions and velocities are exact at every timestep.
B concrete scenarios, N road users, T timesteps.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from scenarionet_data.arrays.dtypes import Bool, Float64
from scenarionet_data.errors import BadParameter
from scenarionet_data.logical.description import SIZES, ActorSpec, LogicalScenario, SpeedChange
from scenarionet_data.logical.expressions import evaluate
from scenarionet_data.logical.roads import Route, across, draw_road

_SHARES = np.linspace(0.0, 1.0, 4097)
_ROUNDS = 4  # of the time at which a road user passes, which depends on its speed then


@dataclass(frozen=True, eq=False)
class Motions:
    """States in the frame of the road.

    Attributes:
        position, velocity: (B, N, T, 2) [m], [m/s].
        heading: (B, N, T) [rad].
        size: (B, N, 3) [m].
        valid: (B, N, T): on the route.
        backwards: (B, N): a speed below 0 at the start, which cannot be.
    """

    position: Float64
    velocity: Float64
    heading: Float64
    size: Float64
    valid: Bool
    backwards: Bool


@dataclass(frozen=True, eq=False)
class _Placed:
    """A road user on its route: speeds (B, K) at knots of time (B, K), and where it began (B,)."""

    route: Route
    size: Float64
    knots: Float64
    speeds: Float64
    start: Float64
    sense: float

    def travelled(self, time: Float64) -> tuple[Float64, Float64]:
        """Return the distance since the start [m] and the speed [m/s] at times (B, T)."""
        distance, speed = np.zeros_like(time), np.broadcast_to(self.speeds[:, :1], time.shape).copy()
        for k in range(self.knots.shape[1]):
            begin, first = self.knots[:, k, None], self.speeds[:, k, None]
            last = k + 1 == self.knots.shape[1]
            end, final = (np.inf, first) if last else (self.knots[:, k + 1, None], self.speeds[:, k + 1, None])
            lasted = (time.clip(begin, end) if k else np.minimum(time, end)) - begin
            rate = np.zeros_like(first) if last else _ratio(final - first, end - begin)
            distance += first * lasted + 0.5 * rate * lasted**2
            speed = np.where(time >= begin, first + rate * lasted, speed)
        return distance, speed

    def along(self, time: Float64) -> Float64:
        """Return the arc length of the centre [m] at times (B, T)."""
        return self.start[:, None] + self.sense * self.travelled(time)[0]


def smooth(share: Float64) -> Float64:
    """Return the polynomial of least jerk from 0 to 1."""
    return np.asarray(share**3 * (10 - 15 * share + 6 * share**2))


def move(logical: LogicalScenario, rows: Float64) -> Motions:
    """Return the motions of concrete scenarios with parameters (B, P).

    Raises:
        BadParameter: An expression is wrong, a lane is unknown, or routes do not cross.
    """
    names, road, time = logical.named(rows), draw_road(logical.road), logical.time
    placed: dict[str, _Placed] = {}
    parts = []
    for actor in logical.actors:
        route = road.route(actor.route) if actor.across is None else across(placed["ego"].route, actor.across)
        placed[actor.id] = _place(actor, route, placed, names, time, len(rows))
        parts.append(_states(actor, placed[actor.id], names, time, len(rows)))
    stacked = (np.stack(each, axis=1) for each in zip(*parts, strict=True))
    return Motions(*stacked)


def _place(
    actor: ActorSpec,
    route: Route,
    placed: Mapping[str, _Placed],
    names: Mapping[str, Float64],
    time: Float64,
    number: int,
) -> _Placed:
    def value(text: str) -> Float64:
        return np.broadcast_to(evaluate(text, names), (number,))

    size = np.stack([value(text) for text in actor.size or SIZES[actor.object_type]], axis=1)
    if size.min() <= 0:
        raise BadParameter(f"actor {actor.id!r}: a size of {size.min():g} m; wanted more than 0")
    knots, speeds = [np.zeros(number)], [value(actor.speed)]
    for change in actor.changes:
        _add_change(change, knots, speeds, value)
    sense = -1.0 if actor.against else 1.0
    each = _Placed(route, size, np.stack(knots, axis=1), np.stack(speeds, axis=1), np.zeros(number), sense)
    if actor.at:
        when, along = value(actor.when), value(actor.at)
    elif actor.gap:
        other, when = placed[actor.of], value(actor.when)
        gap = value(actor.gap)
        ahead = gap + np.where(gap < 0, -0.5, 0.5) * (size[:, 0] + other.size[:, 0])
        along = other.along(when[:, None])[:, 0] + other.sense * ahead
    else:
        when, along = _crossing(each, placed[actor.of], value(actor.after or actor.meets), time, not actor.meets)
    start = along - sense * each.travelled(when[:, None])[0][:, 0]
    return _Placed(route, size, each.knots, each.speeds, start, sense)


def _add_change(change: SpeedChange, knots: list[Float64], speeds: list[Float64], value: object) -> None:
    """Add the knots at which a change of speed begins and ends."""
    evaluated = [value(text) for text in (change.start, change.to, change.rate)]  # type: ignore[operator]
    start, to, rate = evaluated
    if (rate <= 0).any() or (to < 0).any() or (start < knots[-1]).any():
        raise BadParameter(
            f"{change}: wanted a rate above 0, a speed of 0 or more, and a start not before the end of the last change"
        )
    knots += [start, start + np.abs(to - speeds[-1]) / rate]
    speeds += [speeds[-1], to]


def _crossing(each: _Placed, other: _Placed, lag: Float64, time: Float64, is_clear: bool) -> tuple[Float64, Float64]:
    """When (B,) the road user's centre is where routes cross, and the arc length there.

    The other one's is there ``lag`` [s] before, or with ``is_clear`` leaves the area that both sweep.

    The areas and times are those of the event ``post_encroachment_time``: Allen, Shin and Cooper 1978.
    """
    here, there, angle = each.route.crossing(other.route)
    sine, cosine = abs(np.sin(angle)), abs(np.cos(angle))
    grid = np.broadcast_to(time, (len(lag), len(time)))
    passes = np.array([np.interp(there, row, time, np.nan, np.nan) for row in other.along(grid)])
    if np.isnan(passes).any():
        raise BadParameter("the other road user never comes to where the routes cross; start it nearer, or later")
    halves = [
        mine.size[:, 0] / 2 + (its.size[:, 1] + mine.size[:, 1] * cosine) / (2 * sine)
        for mine, its in ((each, other), (other, each))
    ]
    when = passes if is_clear else passes + lag
    for _ in range(_ROUNDS if is_clear else 0):
        speeds = [mine.travelled(at[:, None])[1][:, 0] for mine, at in ((each, when), (other, passes))]
        apart = sum(half / np.maximum(speed, 0.1) for half, speed in zip(halves, speeds, strict=True))
        when = passes + np.where(lag < 0, -1.0, 1.0) * (np.abs(lag) + apart)
    return when, np.full(len(lag), here)


def _states(
    actor: ActorSpec, placed: _Placed, names: Mapping[str, Float64], time: Float64, number: int
) -> tuple[Float64, Float64, Float64, Float64, Bool, Bool]:
    """Position, velocity, heading, size, valid, backwards of a road user."""
    grid = np.broadcast_to(time, (number, len(time)))
    speed, along = placed.sense * placed.travelled(grid)[1], placed.along(grid)
    offset, drift = _sideways(actor, names, time, number)
    points, heading, curvature = placed.route.poses(along)
    ahead = speed * (1.0 - curvature * offset)
    tangent = np.stack([np.cos(heading), np.sin(heading)], axis=-1)
    left = np.stack([-tangent[..., 1], tangent[..., 0]], axis=-1)
    moves = (np.abs(ahead) > 1e-6) | (np.abs(drift) > 1e-6)
    heading = heading + np.where(moves, np.arctan2(drift, ahead), np.pi if actor.against else 0.0)
    return (
        points + offset[..., None] * left,
        ahead[..., None] * tangent + drift[..., None] * left,
        heading,
        placed.size,
        (along >= 0) & (along <= placed.route.length),
        placed.speeds[:, 0] < 0,
    )


def _sideways(actor: ActorSpec, names: Mapping[str, Float64], time: Float64, number: int) -> tuple[Float64, Float64]:
    """Offset to the left of the route [m] and its rate [m/s], (B, T)."""

    def value(text: str) -> Float64:
        return np.broadcast_to(evaluate(text, names), (number,))

    at, done = value(actor.offset), np.full(number, -np.inf)
    offset, drift = np.repeat(at[:, None], len(time), axis=1), np.zeros((number, len(time)))
    for each in actor.moves:
        to = value(each.to)
        lasts = value(each.duration) if each.duration else np.abs(to - at) / value(each.rate)
        if (lasts <= 0).any():
            raise BadParameter(f"actor {actor.id!r}: a move to {each.to} lasts {lasts.min():g} s; wanted more than 0")
        if each.start:
            start = value(each.start)
        else:
            share = _ratio(value(each.passes) - at, to - at)
            if (share < 0).any() or (share > 1).any():
                raise BadParameter(f"actor {actor.id!r}: passes={each.passes} is not between the offsets of its move")
            part = np.interp(share, smooth(_SHARES), _SHARES) if each.duration else share
            start = value(each.at) - part * lasts
        if (start < done - 1e-9).any():
            raise BadParameter(
                f"actor {actor.id!r}: two moves overlap; wanted the one to {each.to} after the other's end"
            )
        part = ((time - start[:, None]) / lasts[:, None]).clip(0.0, 1.0)
        offset += (to - at)[:, None] * (smooth(part) if each.duration else part)
        rate = 30.0 * part**2 * (1.0 - part) ** 2 if each.duration else ((part > 0) & (part < 1)) * 1.0
        drift += (to - at)[:, None] / lasts[:, None] * rate
        at, done = to, start + lasts
    return offset, drift


def _ratio(part: Float64, whole: Float64) -> Float64:
    """Part of a whole; 0 of nothing."""
    return np.where(whole == 0.0, 0.0, part / np.where(whole == 0.0, 1.0, whole))
