"""Shadows of boxes on the ground, and the light of lamps there at night."""

from __future__ import annotations

import math

from scenarionet_data.arrays.dtypes import Float64
from scenarionet_data.compiled.decorators import device_function
from scenarionet_sim.arrays.minmax import larger, smaller
from scenarionet_sim.cameras.draw import codes
from scenarionet_sim.cameras.draw import columns as at
from scenarionet_sim.cameras.draw.structures import FrameView
from scenarionet_sim.cameras.draw.vertices import NEAREST

NUM_SHADOW = 13
"""Columns of a shadow, see ``FrameMemory.shadows``."""

SHADOW_REACH = 120.0
"""Shadows farther than this are not seen [m]."""

LEAST_CASTER = 0.45
"""Length and width up to which fixtures cast no shadows [m]: poles, and what hangs from them."""

LEAST_SHADOW = 0.6
"""Height on the screen [pixels] below which shadows are not drawn."""


@device_function(divides_by_zero=True, in_lanes=True)
def add_shadow(box: Float64, caster: int, view: FrameView, shadows: Float64, num_shadows: int) -> int:
    """Add the shadow of a box on the ground, by its class; return the new number of shadows.

    Cyclists are slimmer than their boxes, and crowns of trees do not touch the ground.
    """
    light, cos, sin = view.light, math.cos(box[3]), math.sin(box[3])
    share = 0.3 if caster in (codes.PERSON, codes.RIDER) else (0.4 if caster == codes.VEGETATION else 0.5)
    half_length, half_width = share * box[4], share * box[5]
    lift = 0.35 if caster == codes.VEGETATION else 0.0
    length = box[6] / larger(light[at.SUN + 2], 0.2)
    place = box[0] - lift * length * light[at.SUN], box[1] - lift * length * light[at.SUN + 1], box[2] * 1.0
    length *= 1.0 - lift
    sweep_x = -length * (cos * light[at.SUN] + sin * light[at.SUN + 1])
    sweep_y = -length * (cos * light[at.SUN + 1] - sin * light[at.SUN])
    touch = 0.0 if caster == codes.VEGETATION else 0.9
    halves, sweep = (half_length, half_width), (sweep_x, sweep_y)
    return _add(place, (cos, sin), halves, sweep, touch, view, shadows, num_shadows)


@device_function(divides_by_zero=True, in_lanes=True)
def add_light(box: Float64, source: int, view: FrameView, shadows: Float64, num_shadows: int) -> int:
    """Add the light on the ground of a vehicle's headlamps or of a street lamp; return the new number of shadows."""
    cos, sin, pose = math.cos(box[3]), math.sin(box[3]), view.pose
    if abs(box[0] - pose[at.EYE]) + abs(box[1] - pose[at.EYE + 1]) > SHADOW_REACH:
        return num_shadows
    is_lamp = source == codes.LAMP
    ahead = 0.0 if is_lamp else 0.5 * box[4] + 12.0
    halves, bright = (10.0, 10.0) if is_lamp else (14.0, 4.5), 0.5 if is_lamp else 0.9
    place = box[0] + ahead * cos, box[1] + ahead * sin, box[2] * 1.0
    return _add(place, (cos, sin), halves, (0.0, 0.0), -bright, view, shadows, num_shadows)


@device_function(divides_by_zero=True)
def light_at(x: float, y: float, shadows: Float64) -> float:
    """Return the light of lamps that arrives at a place."""
    total = 0.02
    for n in range(len(shadows)):
        if shadows[n, 12] < 0.0:
            dx, dy, cos, sin = x - shadows[n, 0], y - shadows[n, 1], shadows[n, 2], shadows[n, 3]
            along, beside = (cos * dx + sin * dy) / shadows[n, 4], (cos * dy - sin * dx) / shadows[n, 5]
            part = larger(1.0 - along * along - beside * beside, 0.0)
            total -= shadows[n, 12] * part * part
    return total


@device_function(divides_by_zero=True, in_lanes=True)
def _add(
    place: tuple[float, float, float], turn: tuple[float, float], halves: tuple[float, float],
    sweep: tuple[float, float], strength: float, view: FrameView, shadows: Float64, num_shadows: int,
) -> int:  # fmt: skip
    """Add a shadow or a light if it is in the picture; return the new number of shadows."""
    pose, lens, width, height = view.pose, view.lens, view.width, view.height
    if num_shadows >= len(shadows):
        return num_shadows
    (cos, sin), (half_length, half_width), (sweep_x, sweep_y) = turn, halves, sweep
    wx, wy = place[0] - pose[at.EYE], place[1] - pose[at.EYE + 1]
    pad = 0.45
    low_x, high_x = smaller(sweep_x, 0.0) - half_length - pad, larger(sweep_x, 0.0) + half_length + pad
    low_y, high_y = smaller(sweep_y, 0.0) - half_width - pad, larger(sweep_y, 0.0) + half_width + pad
    left, top, right, bottom = width * 1.0, height * 1.0, 0.0, 0.0
    bx = by = bz = 0.0
    for corner in range(5):  # the outline, clipped before the camera
        x = low_x if corner == 0 or corner >= 3 else high_x
        y = low_y if corner < 2 or corner == 4 else high_y
        if corner == 4:
            x = low_x
        dx, dy, dz = wx + cos * x - sin * y, wy + sin * x + cos * y, place[2] - pose[at.EYE + 2]
        ax = pose[at.RIGHT] * dx + pose[at.RIGHT + 1] * dy + pose[at.RIGHT + 2] * dz
        ay = pose[at.DOWN] * dx + pose[at.DOWN + 1] * dy + pose[at.DOWN + 2] * dz
        az = pose[at.FORWARD] * dx + pose[at.FORWARD + 1] * dy + pose[at.FORWARD + 2] * dz
        for step in range(2):
            px, py, pz = ax, ay, az
            if step == 0:
                if corner == 0 or (az < NEAREST) == (bz < NEAREST):
                    continue
                share = (NEAREST - bz) / (az - bz)
                px, py, pz = bx + share * (ax - bx), by + share * (ay - by), NEAREST
            if pz >= NEAREST:
                column, row = lens[at.FX] * px / pz + lens[at.CX], lens[at.FY] * py / pz + lens[at.CY]
                left, right = smaller(left, column), larger(right, column)
                top, bottom = smaller(top, row), larger(bottom, row)
        bx, by, bz = ax, ay, az
    if right <= 0.0 or left >= width or bottom <= 0.0 or top >= height or left >= right:
        return num_shadows
    shadow = shadows[num_shadows]
    shadow[0], shadow[1], shadow[2], shadow[3] = place[0], place[1], cos, sin
    shadow[4], shadow[5], shadow[6], shadow[7] = half_length, half_width, sweep_x, sweep_y
    shadow[12] = strength
    shadow[8], shadow[9] = larger(math.floor(left), 0.0), larger(math.floor(top) - 1.0, 0.0)
    shadow[10], shadow[11] = smaller(math.ceil(right), width), smaller(math.ceil(bottom) + 1.0, height)
    return num_shadows + 1
