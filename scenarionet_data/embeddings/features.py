"""A scenario as 64 numbers that can be computed by hand: motion of the ego, road, traffic, interactions, lights.

All are independent of where a scenario lies and how it is turned, and change little with noise of the tracker, a few
road users more or less, or a window that begins a second later. ``features.json`` beside this file has the mean and
scale of each over recordings of six datasets and generated roads, so that vectors of any two lakes can be compared.
"""

from __future__ import annotations

import json
from functools import cache
from pathlib import Path
from typing import NamedTuple

import numpy as np
from xxhash import xxh3_64_hexdigest

from scenarionet_data.arrays.dtypes import Array, Bool, Float32, Float64
from scenarionet_data.arrays.geometry import wrap_angle
from scenarionet_data.scenario import vocabulary
from scenarionet_data.scenario.description import ScenarioDescription
from scenarionet_data.scenario.parts import MapFeatures
from scenarionet_data.scenario.vocabulary import LightColor, MapFeatureType, ObjectType

VERSION = 1
"""Of the formulas below; vectors of another version are another model."""
_FAR = 60.0  # radius of the scene around the middle of the ego's path [m]
_CLIP = 4.0  # of standardised values, so that one of them does not decide alone
_EIGHTHS = np.linspace(0.0, 1.0, 8)
_SPEED_LIMITS = np.array([0.5, 4.0, 8.0, 14.0])  # between bins of the speeds of vehicles [m/s]
_PAVED = {"crosswalks": MapFeatureType.CROSSWALK, "stop_signs": MapFeatureType.STOP_SIGN}


class Standard(NamedTuple):
    """Mean and scale of each feature, by name."""

    names: tuple[str, ...]
    mean: Float64
    scale: Float64
    digest: str


@cache
def standard() -> Standard:
    """Return the stored means and scales; their digest, with the version of the formulas, names the model."""
    text = Path(__file__).with_name("features.json").read_bytes()
    stored = json.loads(text)
    mean, scale = np.array([stored[name] for name in stored], np.float64).T
    return Standard(tuple(stored), mean, scale, xxh3_64_hexdigest(text + bytes([VERSION])))


def vector(scenario: ScenarioDescription) -> Float32:
    """Return the standardised features (64,) float32 of a scenario; 0, the mean, where one cannot be known."""
    known, found = standard(), measure(scenario)
    values = (np.array([found[name] for name in known.names]) - known.mean) / known.scale
    return np.clip(np.nan_to_num(values), -_CLIP, _CLIP).astype(np.float32)


def measure(scenario: ScenarioDescription) -> dict[str, float]:
    """Return the features by name before they are standardised; NaN for those of a map that is not there."""
    scene = _Scene.of(scenario)
    return {
        **_ego_motion(scene),
        **_road(scenario.map, scene.centre),
        **_traffic(scene),
        **_interactions(scene),
        **_lights(scenario),
    }


class _Scene(NamedTuple):
    """Road users around the ego, averaged over each second in which it is valid: T seconds, N others.

    Averages, so that noise of a tracker is small beside what is measured.

    Attributes:
        duration: Of the whole scenario [s].
        speed, heading: (T,) of the ego [m/s], [rad].
        speeds: (N, T) of the others [m/s].
        path: (T, 2) of the ego [m].
        centre: (2,) mean of the path.
        kind: (N,) codes of ``ObjectType``.
        place, motion: (N, T, 2) position and velocity seen from the ego, x ahead, y to the left [m], [m/s].
        world: (N, T, 2) position in the scenario's frame [m].
        turn: (N, T) heading seen from the ego [rad].
        lengths: (N,) [m].
        bumpers: (N,) half of the ego's and half of the other's length [m].
        valid: (N, T).
    """

    duration: float
    speed: Float64
    heading: Float64
    speeds: Float64
    path: Float64
    centre: Float64
    kind: Array
    place: Float64
    motion: Float64
    world: Float64
    turn: Float64
    lengths: Float64
    bumpers: Float64
    valid: Bool

    @classmethod
    def of(cls, scenario: ScenarioDescription) -> _Scene:
        tracks, ego = scenario.tracks, scenario.ego_index
        _, first = np.unique(np.floor(scenario.timestamps + 1e-6), return_index=True)
        count = np.add.reduceat(tracks.valid, first, axis=1, dtype=np.int64)
        whole = np.flatnonzero(count[ego])

        def averaged(values: Array) -> Float64:
            """(N, T, ...) means over the valid timesteps of each second."""
            known = np.where(tracks.valid[..., None], values, 0.0)
            sums: Float64 = np.add.reduceat(known, first, axis=1, dtype=np.float64)
            return sums[:, whole] / np.maximum(count[:, whole, None], 1)

        position, velocity = averaged(tracks.position[..., :2]), averaged(tracks.velocity)
        facing = averaged(np.stack([np.cos(tracks.heading), np.sin(tracks.heading)], axis=-1))
        heading = np.arctan2(facing[..., 1], facing[..., 0])
        others = np.flatnonzero(count[:, whole].any(axis=1) & (np.arange(len(tracks)) != ego))
        length = tracks.size[..., 0].max(axis=1).astype(np.float64)
        cosine, sine = np.cos(heading[ego]), np.sin(heading[ego])
        turned = np.stack([np.stack([cosine, sine], -1), np.stack([-sine, cosine], -1)], -2)  # (T, 2, 2)
        return cls(
            duration=float(scenario.timestamps[-1]),
            speed=np.hypot(*velocity[ego].T),
            heading=np.unwrap(heading[ego]),
            speeds=np.hypot(velocity[others, :, 0], velocity[others, :, 1]),
            path=position[ego],
            centre=position[ego].mean(axis=0),
            kind=tracks.object_type[others],
            place=np.einsum("tij,ntj->nti", turned, position[others] - position[ego]),
            motion=np.einsum("tij,ntj->nti", turned, velocity[others] - velocity[ego]),
            world=position[others],
            turn=wrap_angle(heading[others] - heading[ego]),
            lengths=length[others],
            bumpers=(length[others] + length[ego]) / 2,
            valid=count[np.ix_(others, whole)] > 0,
        )


def _ego_motion(scene: _Scene) -> dict[str, float]:
    """Speed and turn along the time, and sums of both."""
    share = np.linspace(0.0, 1.0, len(scene.speed)) if len(scene.speed) > 1 else np.zeros(1)
    turned = np.interp(_EIGHTHS[1::2], share, scene.heading - scene.heading[0])
    steps, rates = np.hypot(*np.diff(scene.path, axis=0).T), np.diff(scene.speed)
    distance, direct = float(steps.sum()), float(np.hypot(*(scene.path[-1] - scene.path[0])))
    turns = np.abs(np.diff(scene.heading))[steps > 0.5]
    return {
        "ego_distance": float(np.log1p(distance)),
        "ego_duration": float(np.log1p(scene.duration)),
        **{f"ego_speed_{i}": float(v) for i, v in enumerate(np.interp(_EIGHTHS, share, scene.speed))},
        **{f"ego_turned_{i}": float(v) for i, v in enumerate(np.clip(turned, -np.pi, np.pi))},
        "ego_turning": min(float(turns.sum()), 2 * np.pi),
        "ego_braking": float(rates.min(initial=0.0)),
        "ego_accelerating": float(rates.max(initial=0.0)),
        "ego_straightness": (direct + 5.0) / (distance + 5.0),
        "ego_standing": float((scene.speed < 0.5).mean()),
    }


def _road(features: MapFeatures | None, centre: Float64) -> dict[str, float]:
    """Length, directions and curvature of lanes, and what else the map has, within 60 m of the ego's path."""
    if features is None or not len(features):
        return dict.fromkeys(_ROAD, np.nan)
    lines = features.polyline
    points = lines.values[:, :2].astype(np.float64)
    row = np.repeat(np.arange(len(features)), lines.lengths)
    step, is_inner = np.diff(points, axis=0), np.diff(row) == 0
    middle, length = points[:-1] + step / 2, np.hypot(*step.T)
    away = np.hypot(*(middle - centre).T)
    kind = features.feature_type[row[:-1]]
    is_near = is_inner & (away < _FAR)
    lane = is_near & vocabulary.is_lane(kind)
    metres, angle = length[lane], np.arctan2(step[lane, 1], step[lane, 0])
    total = max(float(metres.sum()), 1e-6)
    order = {k: abs(np.sum(metres * np.exp(1j * k * angle))) / total for k in (1, 2, 4)}
    follows = lane[:-1] & lane[1:] & (length[:-1] > 0.1) & (length[1:] > 0.1)
    bend = np.abs(wrap_angle(np.diff(np.arctan2(step[:, 1], step[:, 0]))))[follows]
    along = ((length[:-1] + length[1:]) / 2)[follows]
    curvature = np.minimum(bend / np.maximum(along, 0.5), 0.5)
    found = (
        np.log1p(metres.sum()),
        np.log1p(length[lane & (away < _FAR / 3)].sum()),
        *order.values(),
        float((curvature * along).sum() / max(along.sum(), 1e-6)),
        float(along[curvature > 0.05].sum() / max(along.sum(), 1e-6)),
        *(np.log1p(_count_near(features, code, centre)) for code in _PAVED.values()),
        np.log1p(length[is_near & vocabulary.is_road_edge(kind)].sum()),
        np.log1p(length[is_near & vocabulary.is_road_line(kind)].sum()),
    )
    return dict(zip(_ROAD, map(float, found), strict=True))


def _count_near(features: MapFeatures, code: int, centre: Float64) -> int:
    """Number of features of a type whose middle is within 60 m."""
    rows = np.flatnonzero(features.feature_type == code).tolist()
    outlines = [features.polygon[row] if len(features.polygon[row]) else features.polyline[row] for row in rows]
    middles = [each[:, :2].mean(axis=0) for each in outlines if len(each)]
    return sum(bool(np.hypot(*(middle - centre)) < _FAR) for middle in middles)


_ROAD = (
    *("lanes", "lanes_near", "lanes_one_way", "lanes_parallel", "lanes_on_axes", "lanes_curvature", "lanes_bent"),
    *_PAVED, "road_edges", "road_lines",
)  # fmt: skip


def _traffic(scene: _Scene) -> dict[str, float]:
    """How many road users of each kind there are at a time, how fast, where and in which directions."""
    time = max(scene.valid.shape[1], 1)
    vehicle = scene.valid & (scene.kind == ObjectType.VEHICLE)[:, None]
    away = np.hypot(scene.place[..., 0], scene.place[..., 1])
    counts = {
        "vehicles": vehicle,
        "pedestrians": scene.valid & (scene.kind == ObjectType.PEDESTRIAN)[:, None],
        "cyclists": scene.valid & (scene.kind == ObjectType.CYCLIST)[:, None],
        "others": scene.valid & (scene.kind > ObjectType.CYCLIST)[:, None],
        **{f"within_{limit}m": vehicle & (away < limit) for limit in (15, 30, 60)},
    }
    moving = vehicle & (scene.speeds > 0.5)
    speeds = scene.speeds[vehicle]
    shares = np.bincount(np.digitize(speeds, _SPEED_LIMITS), minlength=5) / max(len(speeds), 1)
    directions = np.exp(1j * scene.turn[moving]).mean() if moving.any() else 0.0
    near = scene.world[vehicle & (away < 2 * _FAR)]
    spread = np.sqrt(np.maximum(np.linalg.eigvalsh(np.cov(near.T)), 0)) if len(near) > 2 else np.zeros(2)
    return {
        **{name: float(np.log1p(where.sum() / time)) for name, where in counts.items()},
        "turnover": float(np.log1p(len(scene.valid) / max(scene.valid.sum() / time, 1.0))),
        "moving": float(moving.sum() / max(vehicle.sum(), 1)),
        **{f"speeds_{i}": float(np.sqrt(value)) for i, value in enumerate(shares)},
        "speed_mean": float(scene.speeds[moving].mean()) if moving.any() else 0.0,
        "speed_spread": float(scene.speeds[moving].std()) if moving.any() else 0.0,
        "along": float(np.real(directions)),
        "across": float(np.imag(directions)),
        "spread_long": float(spread[1]),
        "spread_wide": float(spread[0]),
        "long_vehicles": float((scene.lengths[vehicle.any(axis=1)] > 7.0).mean()) if len(speeds) else 0.0,
        "ego_lags": float(scene.speeds[moving].mean() - scene.speed.mean()) if moving.any() else 0.0,
    }


def _interactions(scene: _Scene) -> dict[str, float]:
    """How near others come to the ego, whom it follows, and who crosses in front of it or closes in."""
    away = np.where(scene.valid, np.hypot(scene.place[..., 0], scene.place[..., 1]), np.inf)
    near = np.minimum(away.min(axis=0, initial=_FAR), _FAR)
    is_soft = np.isin(scene.kind, (ObjectType.PEDESTRIAN, ObjectType.CYCLIST))
    ahead, side = scene.place[..., 0], np.abs(scene.place[..., 1])
    vehicle = scene.valid & (scene.kind == ObjectType.VEHICLE)[:, None]
    leads = vehicle & (side < 2.0) & (ahead > 0) & (ahead < 50.0) & (np.abs(scene.turn) < np.pi / 4)
    gap = np.where(leads, np.maximum(ahead - scene.bumpers[:, None], 0.0), np.inf).min(axis=0, initial=np.inf)
    headway = np.minimum(gap / np.maximum(scene.speed, 1.0), 8.0)
    closing = -(scene.place * scene.motion).sum(axis=-1) / np.maximum(away, 1.0)
    crossing = vehicle & (away < 30.0) & (np.abs(np.abs(scene.turn) - np.pi / 2) < np.pi / 4) & (scene.speeds > 0.5)
    return {
        "nearest": float(near.min()),
        "nearest_mean": float(near.mean()),
        "nearest_soft": float(away[is_soft].min(initial=_FAR)),
        "lead": float(np.isfinite(gap).mean()),
        "lead_gap": float(np.minimum(gap, 50.0).mean()),
        "headway": float(headway.mean()),
        "closing": float(np.clip(np.where(away < 30.0, closing, 0.0).max(initial=0.0), 0.0, 30.0)),
        "crossing": float(np.log1p(crossing.sum() / scene.valid.shape[1])),
    }


def _lights(scenario: ScenarioDescription) -> dict[str, float]:
    """How many lights there are, and the share of their time in each colour."""
    colors = vocabulary.LIGHT_COLORS[scenario.lights.state]
    known = max(int((colors != LightColor.UNKNOWN).sum()), 1)
    named = {"green": LightColor.GREEN, "yellow": LightColor.YELLOW, "red": LightColor.RED}
    shares = {f"lights_{name}": float((colors == color).sum() / known) for name, color in named.items()}
    return {"lights": float(np.log1p(len(scenario.lights)))} | shares
