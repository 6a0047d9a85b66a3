"""Measures along the lanes that an object drives: of another one ahead of it, or in its way."""

from __future__ import annotations

import math

import numpy as np
import shapely

from scenarionet_data.arrays.dtypes import Float64
from scenarionet_data.criticality.registry import measure
from scenarionet_data.criticality.scene import Meeting

_CONSTANT = 0.1  # [m/s^2] relative accelerations up to this are none


def _along(scene: Meeting, values: Float64) -> Float64:
    """Return the parts of values along headings that are along the path."""
    return values * np.cos(scene.turn)


def _across(scene: Meeting, values: Float64) -> Float64:
    return values * np.sin(scene.turn)


def _closing(scene: Meeting) -> tuple[Float64, Float64]:
    """Return speed and acceleration of the other along the path, less those of the object."""
    speed, accel = (_along(scene, each) for each in (scene.traffic.speed, scene.traffic.accel))
    return speed - scene.own(speed), accel - scene.own(accel)


@measure("hw", "m", "min", "s_o - l_o/2 - (s + l/2); inf unless >= 0 and on the same lane", "Jansson 2005")
def headway(scene: Meeting) -> Float64:
    """Distance along the lane from the front of the object to the rear of the other, ahead of it on the same lane."""
    half = scene.traffic.length / 2
    gap = (scene.s - half) - scene.own(scene.s + half)
    missing = np.where(np.isnan(scene.own(scene.s)), np.nan, np.inf)
    gap = np.where(scene.is_on_same_lane & (gap >= 0), gap, missing)
    return np.where(scene.is_met, gap, np.nan)


@measure("thw", "s", "min", "first t' > t with s(t') + l/2 > s_o(t) - l_o/2, less t", "Jansson 2005")
def time_headway(scene: Meeting) -> Float64:
    """Time until the front of the object is where the rear of the other is now."""
    half = scene.traffic.length / 2
    front = scene.own(scene.s + half)[0]
    rear, gap = scene.s - half, headway(scene)
    seconds = scene.traffic.seconds
    result = np.where(np.isfinite(gap), np.inf, gap)
    for step in range(len(seconds) - 1):
        passed = front[step + 1 :] > rear[:, step, None]
        is_hit = np.isfinite(gap[:, step]) & passed.any(axis=1)
        result[is_hit, step] = seconds[step + 1 + passed.argmax(axis=1)[is_hit]] - seconds[step]
    return result


def collision_time(gap: Float64, speed: Float64, accel: Float64) -> Float64:
    """Time in which a gap [m] closes at a relative speed and constant relative acceleration; inf if it does not."""
    with np.errstate(divide="ignore", invalid="ignore"):
        root = speed**2 - 2 * gap * accel
        meets = (root >= 0) & ((speed < 0) | (accel < 0))
        time = np.where(meets, (-speed - np.sqrt(np.maximum(root, 0))) / accel, np.inf)
        time = np.where((speed < 0) & (np.abs(accel) <= _CONSTANT), -gap / speed, time)
    return np.where(np.isnan(gap + speed + accel) & ~np.isinf(gap), np.nan, np.where(np.isinf(gap), np.inf, time))


@measure("ttc", "s", "min", "hw + dv t + da t^2 / 2 = 0; |da| <= 0.1 m/s^2 is 0", "Jansson 2005, eq. 5.26")
def time_to_collision(scene: Meeting) -> Float64:
    """Time to collision with the one ahead, if both keep their accelerations along the lane."""
    return collision_time(headway(scene), *_closing(scene))


@measure("pttc", "s", "min", "hw + dv t - b t^2 / 2 = 0", "Wakabayashi et al. 2003")
def potential_time_to_collision(scene: Meeting) -> Float64:
    """Time to collision if the one ahead brakes as strongly as it can (8 m/s^2) from now on."""
    gap, (speed, _) = headway(scene), _closing(scene)
    time = (speed + np.sqrt(speed**2 + 2 * scene.limits.leader_braking * gap)) / scene.limits.leader_braking
    return np.where(np.isinf(gap), np.inf, time)


@measure("ttz", "s", "min", "ttc with the middle of the next crosswalk", "Várhelyi 1998")
def time_to_crosswalk(scene: Meeting) -> Float64:
    """Time until the front of the object is in the middle of a crosswalk on its lane, at its acceleration."""
    t, crosswalks = scene.traffic, scene.traffic.crosswalks
    front = scene.own(scene.s + t.length / 2)[0]
    best = np.where(np.isnan(front), np.nan, np.inf)
    if scene.path is not None and len(crosswalks):
        middles = shapely.get_coordinates(shapely.centroid(crosswalks))
        places = scene.path.places(middles[:, 0], middles[:, 1])[0][:, None]
        own = t.neighbourhoods[scene.row].astype(np.int64)
        is_on = t.lanes.neighbourhood(crosswalks).astype(np.int64) @ own.T > 0
        gap = np.where(is_on & (places >= front), places - front, np.inf)
        motion = (-scene.own(_along(scene, each)) for each in (t.speed, t.accel))
        best = np.minimum(best, collision_time(gap, *motion).min(axis=0))
    return np.where(scene.is_met, best, np.nan)


def _later_sums(values: Float64) -> Float64:
    return np.cumsum(values[:, ::-1], axis=1)[:, ::-1]


def _exposure(scene: Meeting, excess: Float64) -> Float64:
    step = np.append(np.diff(scene.traffic.seconds), np.diff(scene.traffic.seconds)[-1:])
    return np.where(scene.is_met, _later_sums(np.nan_to_num(excess) * step), np.nan)


@measure("tet", "s", "max", "sum over t' >= t of dt [ttc(t') <= 2 s]", "Minderhoud and Bovy 2001")
def time_exposed(scene: Meeting) -> Float64:
    """Time from now on in which ttc is at most 2 s."""
    return _exposure(scene, np.where(time_to_collision(scene) <= scene.limits.tau, 1.0, 0.0))


@measure("tit", "s^2", "max", "sum over t' >= t of (2 s - ttc(t')) dt where positive", "Minderhoud and Bovy 2001")
def time_integrated(scene: Meeting) -> Float64:
    """By how much and how long ttc is below 2 s from now on."""
    return _exposure(scene, np.maximum(scene.limits.tau - time_to_collision(scene), 0.0))


@measure("dst", "m/s^2", "max", "3 (v - v_o)^2 / (2 (hw - 2 s v_o))", "Schubert et al. 2010, eq. 17")
def deceleration_to_safety_time(scene: Meeting) -> Float64:
    """Deceleration that leaves a safety time of 2 s to the one ahead; negative if that is too late."""
    speed, gap = _along(scene, scene.traffic.speed), headway(scene)
    with np.errstate(divide="ignore", invalid="ignore"):
        needed = 3 * (scene.own(speed) - speed) ** 2 / (2 * (gap - speed * scene.limits.safety_time))
    return np.where(np.isinf(gap), 0.0, needed)


@measure("a_long_req", "m/s^2", "min", "min(a_o - min(dv, 0)^2 / (2 hw), 0)", "Jansson 2005, sec. 5.3.5")
def required_deceleration(scene: Meeting) -> Float64:
    """Longitudinal acceleration with which the gap to the one ahead just does not close; 0 if there is none."""
    gap, (speed, _) = headway(scene), _closing(scene)
    with np.errstate(divide="ignore", invalid="ignore"):
        needed = np.minimum(_along(scene, scene.traffic.accel) - np.minimum(speed, 0) ** 2 / (2 * gap), 0.0)
    return np.where(np.isinf(gap), 0.0, needed)


@measure("a_lat_req", "m/s^2", "max", "min over sides of |a_o + 2 (d +- (w + w_o)/2 + dv ttc) / ttc^2|",
         "Jansson 2005, sec. 5.3.8")  # fmt: skip
def required_swerve(scene: Meeting) -> Float64:
    """Lateral acceleration with which the object just passes the one ahead at ttc; 0 if they do not collide."""
    ttc = time_to_collision(scene)
    speed, offset = _across(scene, scene.traffic.speed), scene.d - scene.own(scene.d)
    width = (scene.traffic.width + scene.own(scene.traffic.width)) / 2
    with np.errstate(divide="ignore", invalid="ignore"):
        needed = [
            np.abs(
                _across(scene, scene.traffic.accel)
                + 2 * (offset + side * width + (speed - scene.own(speed)) * ttc) / ttc**2
            )
            for side in (1, -1)
        ]
    return np.where(np.isinf(ttc), 0.0, np.minimum(*needed))


@measure("a_req", "m/s^2", "max", "sqrt(a_long_req^2 + a_lat_req^2)", "Jansson 2005, sec. 5.3.10")
def required_acceleration(scene: Meeting) -> Float64:
    """Both required accelerations together."""
    return np.hypot(required_deceleration(scene), required_swerve(scene))


@measure("btn", "", "max", "a_long_req / -11.5 m/s^2", "Åsljung et al. 2017")
def brake_threat_number(scene: Meeting) -> Float64:
    """Required deceleration as a share of the strongest possible; the collision cannot be braked off above 1."""
    return np.abs(required_deceleration(scene)) / scene.limits.acceleration


@measure("stn", "", "max", "a_lat_req / 8 m/s^2", "Hosseini et al. 2016")
def steer_threat_number(scene: Meeting) -> Float64:
    """Required lateral acceleration as a share of the strongest possible."""
    return np.abs(required_swerve(scene)) / scene.limits.lateral_acceleration


_MEAN, _DEVIATION, _LOWEST, _HIGHEST = 8.45, 1.40, 4.23, 12.68  # [m/s^2] braking that drivers have available


def _normal(value: Float64 | float) -> Float64:
    erf = np.vectorize(math.erf, otypes=[np.float64])
    share: Float64 = 0.5 * (1 + erf((value - _MEAN) / (_DEVIATION * math.sqrt(2))))
    return share


@measure("cpi", "", "max", "mean over t' >= t of P(available braking < -a_long_req(t'))", "Cunto and Saccomanno 2007")
def crash_potential(scene: Meeting) -> Float64:
    """Mean probability from now on that the collision with the one ahead cannot be braked off."""
    needed = np.clip(-np.nan_to_num(required_deceleration(scene)), _LOWEST, _HIGHEST)
    share = np.zeros_like(needed)
    hit = needed > _LOWEST
    if hit.any():
        low = _normal(_LOWEST)
        share[hit] = (_normal(needed[hit]) - low) / (_normal(_HIGHEST) - low)
    last = int(np.flatnonzero(np.isfinite(scene.own(scene.traffic.x)[0]))[-1])
    left = last - np.arange(share.shape[1])
    share[:, left <= 0] = 0.0
    return np.where(scene.is_met, _later_sums(share) / np.maximum(left, 1), np.nan)


@measure("msd", "m", "max", "v^2 / (2 11.5 m/s^2)", "Allen et al. 1978")
def stopping_distance(scene: Meeting) -> Float64:
    """Shortest distance in which the object stops."""
    own = scene.own(_along(scene, scene.traffic.speed)) ** 2 / (2 * scene.limits.acceleration)
    return np.where(scene.is_met, own, np.nan)


@measure("long_jerk", "m/s^3", "max", "|da/dt cos(heading - lane)|", "Feng et al. 2017")
def longitudinal_jerk(scene: Meeting) -> Float64:
    """Jerk of the object along its lane."""
    return np.where(scene.is_met, np.abs(scene.own(_along(scene, scene.traffic.jerk))), np.nan)


@measure("lat_jerk", "m/s^3", "max", "|da/dt sin(heading - lane)|", "Feng et al. 2017")
def lateral_jerk(scene: Meeting) -> Float64:
    """Jerk of the object across its lane."""
    return np.where(scene.is_met, np.abs(scene.own(_across(scene, scene.traffic.jerk))), np.nan)
