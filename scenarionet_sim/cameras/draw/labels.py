"""Channels of a row besides colour: depth, class, instance, normal and optical flow."""

from __future__ import annotations

import math

from scenarionet_data.arrays.dtypes import Float32, Float64, Int32
from scenarionet_data.compiled.decorators import device_function
from scenarionet_sim.arrays.log import VX, YAW_RATE, X, Y
from scenarionet_sim.cameras.draw.ground import cell_of, height_at, paint_at, surface_at
from scenarionet_sim.cameras.draw.layout import (
    CROSSING,
    CROSSWALK,
    DISTANCE,
    DISTORTED,
    DOWN,
    EYE,
    FORWARD,
    HAS_STROKES,
    INSTANCE_ROW,
    KERB,
    KIND,
    LANE_PAINT,
    NOTHING,
    ON_GROUND,
    PAVEMENT,
    PINHOLE,
    PIVOT,
    RAY_X,
    RAY_Y,
    RAY_Z,
    RIGHT,
    ROAD,
    ROADWAY,
    SEMANTIC,
    SIDEWALK,
    SKY,
    TERRAIN,
    VELOCITY,
    YAW_SPEED,
    Ground,
    Pictures,
)
from scenarionet_sim.cameras.draw.lens import project


@device_function(forceinline=True, divides_by_zero=True)
def ground_class(ground: Ground, slot: int, x: float, y: float) -> int:
    """Return the class of the ground at a point."""
    cell = cell_of(ground, slot, x, y)
    if cell < 0:
        return TERRAIN
    bits = int(ground.corner[cell])
    if bits >= HAS_STROKES:
        bits = surface_at(ground, slot, cell, x, y)
        paint = paint_at(ground, cell, x, y)
        if bits & CROSSWALK:
            return CROSSING
        if paint == KERB:
            return PAVEMENT
        if paint >= 0:
            return LANE_PAINT
    if bits & CROSSWALK:
        return CROSSING
    if bits & ROAD:
        return ROADWAY
    return PAVEMENT if bits & SIDEWALK else TERRAIN


@device_function(divides_by_zero=True)
def label_pixels(
    frame: int, first: int, slot: int, pose: Float64, ground: Ground, seen: Int32, labels: Int32, colors: Float32,
    shades: Float32, pictures: Pictures,
) -> None:  # fmt: skip
    """Write depth, class, instance and normal of pixels, from number ``first`` of the picture on, where wanted."""
    count, distances = len(seen), shades[DISTANCE]
    if len(pictures.depth):
        depth = pictures.depth[frame, first : first + count]
        for k in range(count):
            depth[k] = distances[k]
    if len(pictures.semantic):
        semantic = pictures.semantic[frame, first : first + count]
        for k in range(count):
            found = SKY
            if seen[k] >= 0:
                found = labels[seen[k], SEMANTIC]
            elif seen[k] == ON_GROUND:
                x, y = pose[EYE] + distances[k] * shades[RAY_X, k], pose[EYE + 1] + distances[k] * shades[RAY_Y, k]
                found = ground_class(ground, slot, x, y)
            semantic[k] = found
    if len(pictures.instance):
        instance = pictures.instance[frame, first : first + count]
        for k in range(count):
            instance[k] = labels[seen[k], INSTANCE_ROW] if seen[k] >= 0 else -1
    if len(pictures.normals):
        for k in range(count):
            normal = pictures.normals[frame, first + k]
            normal[0], normal[1], normal[2] = 0.0, 0.0, 0.0
            if seen[k] >= 0:
                normal[0], normal[1], normal[2] = colors[seen[k], 9], colors[seen[k], 10], colors[seen[k], 11]
            elif seen[k] == ON_GROUND and ground.height_frame[slot, 3] == 0.0:
                normal[2] = 1.0
            elif seen[k] == ON_GROUND:
                x, y = pose[EYE] + distances[k] * shades[RAY_X, k], pose[EYE + 1] + distances[k] * shades[RAY_Y, k]
                slope_x = (height_at(ground, slot, x + 0.05, y) - height_at(ground, slot, x - 0.05, y)) * 10.0
                slope_y = (height_at(ground, slot, x, y + 0.05) - height_at(ground, slot, x, y - 0.05)) * 10.0
                unit = 1.0 / math.sqrt(slope_x * slope_x + slope_y * slope_y + 1.0)
                normal[0], normal[1], normal[2] = -slope_x * unit, -slope_y * unit, unit


@device_function(divides_by_zero=True)
def write_flow(
    frame: int, first: int, width: int, slot: int, pose: Float64, lens: Float64, dt: float, motions: Float64,
    seen: Int32, labels: Int32, shades: Float32, flow: Float32,
) -> None:  # fmt: skip
    """Write where each pixel's point will be in the picture after ``dt``, at constant velocities and yaw rates."""
    turn = pose[YAW_SPEED] * dt
    cos, sin = math.cos(turn), math.sin(turn)
    for k in range(len(seen)):
        out = flow[frame, first + k]
        out[0], out[1] = 0.0, 0.0
        far = shades[DISTANCE, k]
        x, y, z = far * shades[RAY_X, k], far * shades[RAY_Y, k], far * shades[RAY_Z, k]
        if seen[k] != NOTHING:
            x, y = x + pose[EYE], y + pose[EYE + 1]
            if seen[k] >= 0 and labels[seen[k], INSTANCE_ROW] >= 0:
                motion = motions[slot, labels[seen[k], INSTANCE_ROW]]
                angle = motion[YAW_RATE] * dt
                c, s = math.cos(angle), math.sin(angle)
                ax, ay = x - motion[X], y - motion[Y]
                x = motion[X] + motion[VX] * dt + c * ax - s * ay
                y = motion[Y] + motion[VX + 1] * dt + s * ax + c * ay
            # Into the frame of the vehicle as it is now: undo the motion of the camera.
            x, y = x - pose[PIVOT] - pose[VELOCITY] * dt, y - pose[PIVOT + 1] - pose[VELOCITY + 1] * dt
            x, y = cos * x + sin * y + pose[PIVOT] - pose[EYE], cos * y - sin * x + pose[PIVOT + 1] - pose[EYE + 1]
        else:
            x, y = cos * x + sin * y, cos * y - sin * x
        right = pose[RIGHT] * x + pose[RIGHT + 1] * y + pose[RIGHT + 2] * z
        down = pose[DOWN] * x + pose[DOWN + 1] * y + pose[DOWN + 2] * z
        ahead = pose[FORWARD] * x + pose[FORWARD + 1] * y + pose[FORWARD + 2] * z
        if ahead > 1e-3 or (lens[KIND] != PINHOLE and lens[KIND] != DISTORTED):
            place = project(lens, right, down, ahead)
            row, column = (first + k) // width, (first + k) % width
            out[0], out[1] = place[0] - column - 0.5, place[1] - row - 0.5
