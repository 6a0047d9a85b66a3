"""Measures of two objects that meet anywhere: by their boxes, and by the area where their lanes conflict."""

from __future__ import annotations

import numpy as np
import shapely

from scenarionet_data.arrays.dtypes import Array, Bool, Float64, Int64
from scenarionet_data.arrays.geometry import box_corners
from scenarionet_data.criticality.following import stopping_distance
from scenarionet_data.criticality.registry import measure
from scenarionet_data.criticality.scene import Meeting, SurroundingTraffic

_LEAST_AREA = 0.01  # [m^2] lanes that overlap by less touch each other


def distances(scene: Meeting) -> Float64:
    """Distances between boxes (N, T) [m]; 0 where they overlap, NaN while not both are observed."""
    if "distance" not in scene.found:
        outlines = scene.traffic.outlines
        apart = shapely.distance(outlines, outlines[scene.row])
        scene.found["distance"] = np.where(scene.is_met, apart, np.nan)
    return scene.found["distance"]


def _next_step(mark: Bool) -> Int64:
    """Return for each step (N, T) the first one from it on that is marked; T for none."""
    count = mark.shape[1]
    steps = np.where(mark, np.arange(count), count)
    first: Int64 = np.minimum.accumulate(steps[:, ::-1], axis=1)[:, ::-1]
    return first


def _until(scene: Meeting, step: Int64) -> Float64:
    """Return the time from each step to another (N, T); inf for one beyond the last."""
    times = np.append(scene.traffic.seconds, np.inf)
    return np.where(scene.is_met, times[step] - scene.traffic.seconds, np.nan)


def _closest(scene: Meeting) -> tuple[Float64, Int64]:
    """Return the least distance from each step on while both are observed, and the first step that has it."""
    apart = distances(scene)
    best, when = np.full_like(apart, np.nan), np.zeros(apart.shape, np.int64)
    least, at = np.full(len(apart), np.inf), np.zeros(len(apart), np.int64)
    for step in reversed(range(apart.shape[1])):
        now = apart[:, step]
        is_met = ~np.isnan(now)
        nearer = is_met & ~(now > least)
        least, at = np.where(nearer, now, np.where(is_met, least, np.inf)), np.where(nearer, step, at)
        best[:, step], when[:, step] = np.where(is_met, least, np.nan), at
    return best, when


@measure("dce", "m", "min", "min over t' >= t of the distance between the boxes", "Eggert 2014")
def distance_of_closest_encounter(scene: Meeting) -> Float64:
    """Least distance from now on."""
    return _closest(scene)[0]


@measure("ttce", "s", "min", "first t' >= t at which the distance is dce, less t", "Eggert 2014")
def time_to_closest_encounter(scene: Meeting) -> Float64:
    """Time until the distance is least."""
    return _until(scene, _closest(scene)[1])


@measure("ttc_star", "s", "min", "first t' >= t at which the boxes overlap, less t", "Lin and Althoff 2023")
def time_to_overlap(scene: Meeting) -> Float64:
    """Time until the boxes overlap on the recorded trajectories."""
    return _until(scene, _next_step(distances(scene) <= 0))


@measure("wttc", "s", "min", "|dp + dv t| = r + r_o + (a + a_o) t^2 / 2, first root", "Wachenfeld et al. 2016")
def worst_time_to_collision(scene: Meeting) -> Float64:
    """Time to the earliest collision that accelerations up to 11.5 m/s^2 can bring about, of discs of their size."""
    t = scene.traffic
    radius = np.hypot(t.length / 6, t.width / 2)
    dx, dy, vx, vy = (each - scene.own(each) for each in (t.x, t.y, t.vx, t.vy))
    reach = radius + scene.own(radius)
    accel = scene.limits.acceleration * (t.moves.astype(np.float64) + 1)
    wanted = scene.is_met & (dx**2 + dy**2 > reach**2)
    lead = -0.25 * accel[:, None] ** 2 * np.ones_like(dx)
    terms = (vx**2 + vy**2 - accel[:, None] * reach, 2 * (vx * dx + vy * dy), dx**2 + dy**2 - reach**2)
    time = np.where(scene.is_met, 0.0, np.nan)
    time[wanted] = _first_root(*((term / lead)[wanted] for term in terms))
    return time


def _first_root(p: Float64, q: Float64, r: Float64) -> Float64:
    """Return the least positive root of t^4 + p t^2 + q t + r with r < 0, by Descartes' two quadratics."""
    # The greatest root of u^3 + 2 p u^2 + (p^2 - 4 r) u - q^2, which is positive.
    a, b, c = 2 * p, p**2 - 4 * r, -(q**2)
    big_q, big_r = (a**2 - 3 * b) / 9, (2 * a**3 - 9 * a * b + 27 * c) / 54
    root = np.sqrt(np.maximum(big_q, 0))
    with np.errstate(divide="ignore", invalid="ignore"):
        angle = np.arccos(np.clip(big_r / root**3, -1, 1))
        three = -2 * root * np.cos((angle + 2 * np.pi) / 3)
        single = -np.sign(big_r) * np.cbrt(np.abs(big_r) + np.sqrt(np.maximum(big_r**2 - big_q**3, 0)))
        u = np.where(big_r**2 < big_q**3, three, single + np.where(single == 0, 0, big_q / single)) - a / 3
        s = np.sqrt(u)
        candidates = [
            0.5 * (side * s + sign * np.sqrt(-u - 2 * p - side * 2 * q / s)) for side in (1, -1) for sign in (1, -1)
        ]
        level = np.sqrt((np.sqrt(p**2 - 4 * r) - p) / 2)  # the root for q = 0, where u vanishes
    times: Float64 = np.fmin.reduce([np.where(each > 0, each, np.nan) for each in candidates])
    times = np.where((np.abs(q) < 1e-6) | np.isnan(times), level, times)
    for _ in range(3):  # the last digits
        times = times - (((times**2 + p) * times + q) * times + r) / ((4 * times**2 + 2 * p) * times + q)
    return times


@measure("delta_v", "m/s", "max", "m_o / (m + m_o) |v - v_o|", "Shelby 2011")
def delta_v(scene: Meeting) -> Float64:
    """Change of velocity that a collision now would bring to the object, if both moved on together."""
    vx, vy = (each - scene.own(each) for each in (scene.traffic.vx, scene.traffic.vy))
    share = scene.limits.other_mass / (scene.limits.mass + scene.limits.other_mass)
    return np.where(scene.is_met, share * np.hypot(vx, vy), np.nan)


def conflict_area(traffic: SurroundingTraffic, row: int, other: int) -> shapely.Geometry | None:
    """Return where lanes that another object drives cross or join those that an object drives; None without.

    Lanes that continue, or come from, the same lane do not conflict.
    """
    lanes = traffic.lanes
    areas = []
    for mine in set(traffic.driven[row].tolist()):
        for theirs in set(traffic.driven[other].tolist()):
            here, there = lanes.lanelets[mine], lanes.lanelets[theirs]
            is_linked = here.row in (*there.before, *there.after, there.row)
            if not is_linked and set(here.before).isdisjoint(there.before):
                areas.append(lanes.outline(mine).intersection(lanes.outline(theirs)))
    area = shapely.unary_union([each for each in areas if each.area > _LEAST_AREA])
    return None if area.is_empty else area


def _passes(scene: Meeting) -> dict[str, Float64]:
    """Return when the object and the other enter and leave the conflict area from each step on [steps], inf if never.

    One enters at the last step before it touches the area, and leaves at the first at which it no longer does.
    """
    if "enter" not in scene.found:
        count = scene.traffic.x.shape[1]
        times = {
            name: np.full(scene.traffic.x.shape, np.inf) for name in ("enter", "leave", "other_enter", "other_leave")
        }
        for other in np.flatnonzero(scene.is_met.any(axis=1)).tolist():
            area = conflict_area(scene.traffic, scene.row, other)
            if area is None:
                continue
            shapely.prepare(area)
            for prefix, row in (("", scene.row), ("other_", other)):
                inside = shapely.intersects(scene.traffic.outlines[row : row + 1], area)
                is_gone = np.isfinite(
                    scene.own(scene.traffic.x) if row == scene.row else scene.traffic.x[other : other + 1]
                )
                enter = _next_step(inside)
                leave = np.append(_next_step(~inside & is_gone), [[count]], axis=1)[0, enter]
                times[f"{prefix}enter"][other] = np.where(enter < count, np.maximum(enter - 1, 0), np.inf)
                times[f"{prefix}leave"][other] = np.where(leave < count, leave, np.inf)
        scene.found.update(times)
    return scene.found


def _seconds(scene: Meeting, steps: Float64) -> Float64:
    """Return durations in steps as seconds."""
    spacing = float(np.median(np.diff(scene.traffic.seconds)))
    return np.where(scene.is_met, steps * spacing, np.nan)


@measure("et", "s", "min", "t_leave - t_enter of the object", "Allen et al. 1978")
def encroachment_time(scene: Meeting) -> Float64:
    """Time that the object is in the area where its lanes and the other's conflict."""
    passes = _passes(scene)
    with np.errstate(invalid="ignore"):
        spent = passes["leave"] - passes["enter"]
    return _seconds(scene, np.where(np.isnan(spent), np.inf, spent))


@measure("pet", "s", "min", "t_enter of the second - t_leave of the first", "Allen et al. 1978")
def post_encroachment_time(scene: Meeting) -> Float64:
    """Time from the first leaving the area where their lanes conflict to the second entering it."""
    passes = _passes(scene)
    with np.errstate(invalid="ignore"):
        gaps = (passes["other_enter"] - passes["leave"], passes["enter"] - passes["other_leave"])
    gap = np.fmin(*(np.where(each >= 0, each, np.inf) for each in gaps))
    return _seconds(scene, gap)


@measure("ags", "s", "min", "t_enter of the other - t_enter of the object, if it is first", "Ashworth 1968")
def accepted_gap(scene: Meeting) -> Float64:
    """Gap that the object accepts: how long after it the other enters the area where their lanes conflict."""
    passes = _passes(scene)
    with np.errstate(invalid="ignore"):
        gap = passes["other_enter"] - passes["enter"]
    return _seconds(scene, np.where(gap >= 0, gap, np.inf))


@measure("psd", "", "min", "distance to the conflict area / msd", "Allen et al. 1978")
def proportion_of_stopping_distance(scene: Meeting) -> Float64:
    """Distance that the object drives until the area where lanes conflict, as a share of that in which it can stop."""
    t, enter = scene.traffic, _passes(scene)["enter"]
    step = np.hypot(np.diff(scene.own(t.x)), np.diff(scene.own(t.y)))[0]
    driven = np.concatenate([[0.0], np.cumsum(np.nan_to_num(step))])
    is_met = scene.is_met & np.isfinite(enter)
    entry = np.where(np.isfinite(enter), enter, 0).astype(np.int64)
    left = np.maximum(driven[entry] - driven, 0.0)
    with np.errstate(divide="ignore", invalid="ignore"):
        share = left / stopping_distance(scene)
    return np.where(is_met, np.where(np.isnan(share), 0.0, share), np.where(scene.is_met, np.inf, np.nan))


@measure("ci", "J", "max", "exp(-pet / s) (m v^2 + m_o v_o^2 - |m v + m_o v_o|^2 / (m + m_o)) / 2", "Alhajyaseen 2015")
def conflict_index(scene: Meeting) -> Float64:
    """Kinetic energy that a collision at the entries into the conflict area would take, less the longer pet is."""
    t, pet, passes = scene.traffic, post_encroachment_time(scene), _passes(scene)
    is_conflict = scene.is_met & (pet < scene.limits.pet_threshold)
    rows, steps = np.nonzero(is_conflict)
    enter, other_enter = (passes[name][rows, steps].astype(np.int64) for name in ("enter", "other_enter"))
    mass, other_mass = scene.limits.mass, scene.limits.other_mass
    energy = np.zeros(len(rows))
    for velocity in (t.vx, t.vy):
        own, other = velocity[scene.row, enter], velocity[rows, other_enter]
        energy += 0.5 * (
            mass * own**2 + other_mass * other**2 - (mass * own + other_mass * other) ** 2 / (mass + other_mass)
        )
    index = np.where(scene.is_met, 0.0, np.nan)
    index[rows, steps] = energy * np.exp(-pet[rows, steps])
    return index


_GRIP, _BESIDE, _NEAR_AHEAD, _NEAR_BEHIND, _NEAR_ASIDE = 0.7, 5.0, 2.0, 0.5, 0.5  # personal space: friction, [m]


@measure("soi", "", "max", "steps t' >= t at which the other is in the object's personal space",
         "Tsukaguchi and Mori 1987")  # fmt: skip
def space_occupancy(scene: Meeting) -> Float64:
    """Steps from now on at which the other is in the object's way of braking on its lanes, or 0.5 m beside it."""
    t, row = scene.traffic, scene.row
    seen = np.flatnonzero(np.isfinite(t.x[row]))
    x, y, heading, length, width = (each[row, seen] for each in (t.x, t.y, t.heading, t.length, t.width))
    braking = (3.6 * t.speed[row, seen]) ** 2 / (254 * _GRIP)

    def box(more_ahead: Float64, aside: float) -> Array:
        shift = (more_ahead + _NEAR_AHEAD - _NEAR_BEHIND) / 2
        middle = np.stack([x + shift * np.cos(heading), y + shift * np.sin(heading)], axis=-1)
        corners = box_corners(middle, heading, length + more_ahead + _NEAR_AHEAD + _NEAR_BEHIND, width + 2 * aside)
        boxes: Array = shapely.polygons(corners)
        return boxes

    near, reached = box(np.zeros_like(x), _NEAR_ASIDE), box(braking, _NEAR_ASIDE + _BESIDE)
    hit = np.zeros(t.x.shape, np.bool_)
    for step, core, reach in zip(seen.tolist(), near, reached, strict=True):
        points = shapely.points([*shapely.get_coordinates(core), *shapely.get_coordinates(core.centroid)])
        parts = [lane.intersection(reach) for lane in t.lanes.at(points)]
        others = scene.is_met[:, step]
        hit[others, step] = shapely.intersects(shapely.union_all([core, *parts]), t.outlines[others, step])
    return np.where(scene.is_met, np.cumsum(hit[:, ::-1], axis=1)[:, ::-1], np.nan)
