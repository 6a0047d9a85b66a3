"""Whole frames: the kernel of cameras."""

from __future__ import annotations

import math

from scenarionet_data.arrays.compiled import device_function, kernel
from scenarionet_data.arrays.dtypes import Float64, Int32, Int64, UInt8
from scenarionet_sim.kernels.cameras.ground import (
    cell_of,
    ground_color,
    height_at,
    meet_heights,
    paint_at,
    surface_at,
    wet_color,
)
from scenarionet_sim.kernels.cameras.instances import add_solids
from scenarionet_sim.kernels.cameras.layout import (
    CROSSING,
    CROSSWALK,
    CX,
    CY,
    DOWN,
    EXPOSURE,
    EYE,
    FACADE,
    FORWARD,
    FX,
    FY,
    HAS_STROKES,
    HAZE,
    HORIZON,
    INSTANCE_ROW,
    KERB,
    KIND,
    LANE_PAINT,
    MATERIAL,
    PAVEMENT,
    PINHOLE,
    PIVOT,
    RIGHT,
    ROAD,
    ROADWAY,
    SEMANTIC,
    SHADOW,
    SIDEWALK,
    SKY,
    TERRAIN,
    VELOCITY,
    VIGNETTE,
    WET,
    YAW_SPEED,
    FrameMemory,
    Ground,
    Look,
    Meshes,
    Pictures,
    Solids,
)
from scenarionet_sim.kernels.cameras.lens import project
from scenarionet_sim.kernels.cameras.sky import sky_color
from scenarionet_sim.kernels.cameras.triangles import list_band, trace_row
from scenarionet_sim.kernels.log import VX, YAW_RATE, X, Y
from scenarionet_sim.kernels.minmax import larger, smaller

BAND = 8
"""Rows of a band, the part of a frame that a thread draws at a time."""

NOTHING, ON_GROUND = -2, -1
"""Values of ``FrameMemory.seen`` after the ground: triangles are 0 and above."""

TILE = 256
"""Columns drawn at a time: their values stay in the processor's cache."""

DISTANCE, GROUND_X, GROUND_Y, SHADE, RAY_X, RAY_Y, RAY_Z, UNIT, RED, GREEN, BLUE = range(11)
"""Rows of ``FrameMemory.row``."""

SKY_STEP = 8
"""The sky is computed at every eighth column, and interpolated between."""


@device_function(divides_by_zero=True)
def meet_ground(
    row: int, start: int, count: int, slot: int, pose: Float64, lens: Float64, rays: Float64, reach: float,
    ground: Ground, near: Float64, seen: Int32, values: Float64,
) -> None:  # fmt: skip
    """Write directions and distances of the pixels of a tile's row, to the nearer of ground and triangle."""
    rx, ry, rz = pose[RIGHT], pose[RIGHT + 1], pose[RIGHT + 2]
    ex, ey, ez = pose[EYE], pose[EYE + 1], pose[EYE + 2]
    level = ground.level[slot] - ez
    if lens[KIND] == PINHOLE:
        v, step = (row + 0.5 - lens[CY]) / lens[FY], 1.0 / lens[FX]
        first = (start + 0.5 - lens[CX]) * step
        bx, by = v * pose[DOWN] + pose[FORWARD], v * pose[DOWN + 1] + pose[FORWARD + 1]
        bz = v * pose[DOWN + 2] + pose[FORWARD + 2]
        rest = v * v + 1.0
        # One output per loop: the compiler then computes several pixels at once.
        for k in range(count):
            values[RAY_X, k] = (first + step * k) * rx + bx
        for k in range(count):
            values[RAY_Y, k] = (first + step * k) * ry + by
        for k in range(count):
            values[RAY_Z, k] = (first + step * k) * rz + bz
        for k in range(count):
            u = first + step * k
            values[UNIT, k] = math.sqrt(u * u + rest)
    else:
        for k in range(count):
            x, y, z = rays[row, start + k, 0], rays[row, start + k, 1], rays[row, start + k, 2]
            values[RAY_X, k] = x * rx + y * pose[DOWN] + z * pose[FORWARD]
            values[RAY_Y, k] = x * ry + y * pose[DOWN + 1] + z * pose[FORWARD + 1]
            values[RAY_Z, k] = x * rz + y * pose[DOWN + 2] + z * pose[FORWARD + 2]
            values[UNIT, k] = math.sqrt(x * x + y * y + z * z)
    if ground.height_frame[slot, 3] > 0.0:
        for k in range(count):
            values[DISTANCE, k] = meet_heights(
                ground, slot, ex, ey, ez, values[RAY_X, k], values[RAY_Y, k], values[RAY_Z, k], reach
            )
    else:
        for k in range(count):
            values[DISTANCE, k] = level / values[RAY_Z, k]
    for k in range(count):
        far = values[DISTANCE, k]
        length = far * values[UNIT, k]
        values[DISTANCE, k] = far if (length > 0.0) & (length < reach) else 0.0
    for k in range(count):
        far, column = values[DISTANCE, k], start + k
        if seen[column] >= 0 and (far == 0.0 or near[column] * far >= 1.0):
            values[DISTANCE, k] = 1.0 / near[column]
        elif far > 0.0:
            seen[column] = ON_GROUND
        else:
            seen[column] = NOTHING
            values[DISTANCE, k] = reach
    for k in range(count):
        values[GROUND_X, k] = ex + values[DISTANCE, k] * values[RAY_X, k]
    for k in range(count):
        values[GROUND_Y, k] = ey + values[DISTANCE, k] * values[RAY_Y, k]
    for k in range(count):
        values[SHADE, k] = 1.0


@device_function(divides_by_zero=True)
def cast_shadows(
    row: int, start: int, end: int, num_shadows: int, strength: float, seen: Int32, values: Float64, shadows: Float64
) -> None:
    """Darken the ground under and behind objects."""
    for n in range(num_shadows):
        shadow = shadows[n]
        if not shadow[9] <= row < shadow[11] or shadow[8] >= end or shadow[10] <= start:
            continue
        inverse = 1.0 / (shadow[6] * shadow[6] + shadow[7] * shadow[7] + 1e-9)
        for column in range(int(larger(shadow[8], start * 1.0)), int(smaller(shadow[10], end * 1.0))):
            if seen[column] != ON_GROUND:
                continue
            k = column - start
            dx, dy = values[GROUND_X, k] - shadow[0], values[GROUND_Y, k] - shadow[1]
            x, y = shadow[2] * dx + shadow[3] * dy, shadow[2] * dy - shadow[3] * dx
            along = smaller(larger((x * shadow[6] + y * shadow[7]) * inverse, 0.0), 1.0)
            out = larger(abs(x - along * shadow[6]) - shadow[4], abs(y - along * shadow[7]) - shadow[5])
            close = larger(abs(x) - shadow[4], abs(y) - shadow[5])
            if out > 0.2 and close > 0.3:
                continue
            soft = 0.05 + 0.30 * along
            cast = smaller(larger(0.5 - out / soft, 0.0), 1.0) * (1.0 - 0.35 * along)
            contact = 0.9 * smaller(larger(0.55 - close * 2.0, 0.0), 1.0)
            values[SHADE, k] *= 1.0 - strength * larger(cast, contact)


@device_function(forceinline=True, divides_by_zero=True)
def facade(x: float, y: float, z: float, nx: float, ny: float, footprint: float) -> float:
    """Return how bright a wall is at a point: 1 on the wall, less on the windows of its storeys."""
    along = nx * y - ny * x
    u, v = along / 3.2, z / 3.3
    u, v = u - math.floor(u), v - math.floor(v)
    window = 1.0 if 0.22 < u < 0.78 and 0.28 < v < 0.80 else 0.0
    share = smaller(larger(1.2 - footprint * 0.8, 0.0), 1.0)
    window = window * share + 0.29 * (1.0 - share)
    return 1.0 - 0.72 * window


@device_function(forceinline=True, divides_by_zero=True)
def shade_triangle(triangle: int, x: float, y: float, z: float, scratch: FrameMemory) -> tuple[float, float, float]:
    """Return the light at the point of a triangle along a ray of the camera's frame."""
    edges, colors = scratch.edges[triangle], scratch.colors[triangle]
    a = larger(edges[0] * x + edges[1] * y + edges[2] * z, 0.0)
    b = larger(edges[3] * x + edges[4] * y + edges[5] * z, 0.0)
    c = larger(edges[6] * x + edges[7] * y + edges[8] * z, 0.0)
    unit = 1.0 / (a + b + c + 1e-300)
    a, b, c = a * unit, b * unit, c * unit
    return (
        a * colors[0] + b * colors[3] + c * colors[6],
        a * colors[1] + b * colors[4] + c * colors[7],
        a * colors[2] + b * colors[5] + c * colors[8],
    )


@device_function(divides_by_zero=True)
def sky_along(k: int, light: Float64, grain: UInt8, values: Float64) -> tuple[float, float, float]:
    """Return the light of the sky along the ray of a pixel."""
    scale = 1.0 / values[UNIT, k]
    return sky_color(light, grain, values[RAY_X, k] * scale, values[RAY_Y, k] * scale, values[RAY_Z, k] * scale)


@device_function(divides_by_zero=True)
def color_sky(start: int, count: int, light: Float64, grain: UInt8, seen: Int32, values: Float64) -> None:
    """Write the light of the sky where nothing else is seen."""
    known, red, green, blue = -1, 0.0, 0.0, 0.0
    for first in range(0, count, SKY_STEP):
        last = smaller(first + SKY_STEP, count - 1)
        is_sky = False
        for k in range(first, smaller(first + SKY_STEP, count)):
            is_sky |= seen[start + k] == NOTHING
        if not is_sky:
            continue
        if known != first:
            red, green, blue = sky_along(first, light, grain, values)
        r, g, b = sky_along(last, light, grain, values)
        step = 1.0 / larger(last - first, 1)
        for k in range(first, last + 1):
            if seen[start + k] == NOTHING:
                share = (k - first) * step
                values[RED, k] = red + share * (r - red)
                values[GREEN, k] = green + share * (g - green)
                values[BLUE, k] = blue + share * (b - blue)
        known, red, green, blue = last, r, g, b


@device_function(divides_by_zero=True)
def color_ground(
    start: int, count: int, slot: int, angle: float, ground: Ground, light: Float64, grain: UInt8, seen: Int32,
    values: Float64,
) -> None:  # fmt: skip
    """Write the light of the ground."""
    frame = ground.frame[slot]
    low_x, low_y, inverse, columns, rows = frame[0], frame[1], 1.0 / frame[2], frame[3], frame[4]
    first, num_columns, is_wet = ground.place[slot, 0], int(columns), light[WET] > 0.0
    for k in range(count):
        if seen[start + k] != ON_GROUND:
            continue
        x, y, dz = values[GROUND_X, k], values[GROUND_Y, k], values[RAY_Z, k]
        across = values[DISTANCE, k] * angle
        along = smaller(across * values[UNIT, k] / larger(-dz, 1e-3), 30.0)
        u, v = (x - low_x) * inverse, (y - low_y) * inverse
        cell = -1
        if u >= 0.0 and v >= 0.0 and u < columns and v < rows:
            cell = first + int(v) * num_columns + int(u)
        red, green, blue = ground_color(
            ground, light, grain, slot, cell, x, y, values[RAY_X, k], values[RAY_Y, k], across, along, values[SHADE, k]
        )
        if is_wet:
            red, green, blue = wet_color(light, grain, x, y, dz / values[UNIT, k], red, green, blue)
        values[RED, k], values[GREEN, k], values[BLUE, k] = red, green, blue


@device_function(divides_by_zero=True)
def color_triangles(
    row: int, start: int, count: int, pose: Float64, lens: Float64, rays: Float64, scratch: FrameMemory
) -> None:
    """Write the light of triangles."""
    values, seen, angle = scratch.row, scratch.seen, 1.0 / lens[FX]
    y = (row + 0.5 - lens[CY]) / lens[FY]
    for k in range(count):
        triangle = seen[start + k]
        if triangle < 0:
            continue
        x, z = (start + k + 0.5 - lens[CX]) * angle, 1.0
        if lens[KIND] != PINHOLE:
            x, y, z = rays[row, start + k, 0], rays[row, start + k, 1], rays[row, start + k, 2]
        red, green, blue = shade_triangle(triangle, x, y, z, scratch)
        if scratch.labels[triangle, MATERIAL] == FACADE:
            far = values[DISTANCE, k]
            wx, wy = pose[EYE] + far * values[RAY_X, k], pose[EYE + 1] + far * values[RAY_Y, k]
            wz = pose[EYE + 2] + far * values[RAY_Z, k]
            nx, ny = scratch.colors[triangle, 9] * 1.0, scratch.colors[triangle, 10] * 1.0
            bright = facade(wx, wy, wz, nx, ny, far * angle)
            red, green, blue = red * bright, green * bright, blue * (0.1 + 0.9 * bright)
        values[RED, k], values[GREEN, k], values[BLUE, k] = red, green, blue


@device_function(divides_by_zero=True)
def expose(
    row: int, start: int, count: int, size: tuple[int, int], light: Float64, tone: UInt8, seen: Int32,
    values: Float64, picture: UInt8,
) -> None:  # fmt: skip
    """Add haze and write the colours of a tile's row into a picture (H, W, 3).

    Highlights are compressed: 1.25 x / (x + 0.75).
    """
    haze, gain, vignette = light[HAZE], light[EXPOSURE], 2.0 * light[VIGNETTE]
    for k in range(count):
        mist = values[DISTANCE, k] * values[UNIT, k] * haze
        values[SHADE, k] = 1.0 / (1.0 + mist * (1.0 + 0.5 * mist))
    for k in range(count):
        if seen[start + k] == NOTHING:
            values[SHADE, k] = 1.0
    for channel in range(3):
        horizon = light[HORIZON + channel]
        for k in range(count):
            values[RED + channel, k] = (horizon + values[SHADE, k] * (values[RED + channel, k] - horizon)) * gain
        if vignette > 0.0:
            below = (row + 0.5) / size[0] - 0.5
            for k in range(count):
                beside = (start + k + 0.5) / size[1] - 0.5
                values[RED + channel, k] *= 1.0 - vignette * (below * below + beside * beside)
        for k in range(count):
            bright = values[RED + channel, k]
            level = 5119.0 * bright / (bright + 0.75)
            values[RED + channel, k] = level if level < 4095.0 else 4095.0
    for k in range(count):
        picture[row, start + k, 0] = tone[int(values[RED, k])]
        picture[row, start + k, 1] = tone[int(values[GREEN, k])]
        picture[row, start + k, 2] = tone[int(values[BLUE, k])]


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
def label_row(
    frame: int, row: int, start: int, end: int, slot: int, ground: Ground, scratch: FrameMemory, pictures: Pictures
) -> None:
    """Write depth, class, instance and normal of the pixels of a row, where wanted."""
    values, seen = scratch.row, scratch.seen
    if len(pictures.depth):
        for column in range(start, end):
            pictures.depth[frame, row, column] = values[DISTANCE, column - start]
    if len(pictures.semantic):
        for column in range(start, end):
            found = SKY
            if seen[column] >= 0:
                found = scratch.labels[seen[column], SEMANTIC]
            elif seen[column] == ON_GROUND:
                found = ground_class(ground, slot, values[GROUND_X, column - start], values[GROUND_Y, column - start])
            pictures.semantic[frame, row, column] = found
    if len(pictures.instance):
        for column in range(start, end):
            pictures.instance[frame, row, column] = (
                scratch.labels[seen[column], INSTANCE_ROW] if seen[column] >= 0 else -1
            )
    if len(pictures.normals):
        for column in range(start, end):
            normal = pictures.normals[frame, row, column]
            normal[0], normal[1], normal[2] = 0.0, 0.0, 0.0
            if seen[column] >= 0:
                colors = scratch.colors[seen[column]]
                normal[0], normal[1], normal[2] = colors[9], colors[10], colors[11]
            elif seen[column] == ON_GROUND:
                x, y = values[GROUND_X, column - start], values[GROUND_Y, column - start]
                slope_x = (height_at(ground, slot, x + 0.05, y) - height_at(ground, slot, x - 0.05, y)) * 10.0
                slope_y = (height_at(ground, slot, x, y + 0.05) - height_at(ground, slot, x, y - 0.05)) * 10.0
                unit = 1.0 / math.sqrt(slope_x * slope_x + slope_y * slope_y + 1.0)
                normal[0], normal[1], normal[2] = -slope_x * unit, -slope_y * unit, unit


@device_function(divides_by_zero=True)
def flow_row(
    frame: int, row: int, start: int, end: int, slot: int, pose: Float64, lens: Float64, dt: float, solids: Solids,
    scratch: FrameMemory, pictures: Pictures,
) -> None:  # fmt: skip
    """Write where each pixel's point will be in the picture after ``dt``, at constant velocities and yaw rates."""
    values, seen = scratch.row, scratch.seen
    turn = pose[YAW_SPEED] * dt
    cos, sin = math.cos(turn), math.sin(turn)
    for column in range(start, end):
        out = pictures.flow[frame, row, column]
        out[0], out[1] = 0.0, 0.0
        far = values[DISTANCE, column - start]
        x, y = far * values[RAY_X, column - start], far * values[RAY_Y, column - start]
        z = far * values[RAY_Z, column - start]
        if seen[column] != NOTHING:
            x, y = x + pose[EYE], y + pose[EYE + 1]
            if seen[column] >= 0 and scratch.labels[seen[column], INSTANCE_ROW] >= 0:
                motion = solids.motion[slot, scratch.labels[seen[column], INSTANCE_ROW]]
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
        if ahead > 1e-3 or (lens[KIND] != PINHOLE and lens[KIND] != 1.0):
            place = project(lens, right, down, ahead)
            out[0], out[1] = place[0] - column - 0.5, place[1] - row - 0.5


@kernel(allocates=False, nogil=True, divides_by_zero=True)
def draw_frames(
    first: int,
    end: int,
    order: Int64,
    who: Int32,
    poses: Float64,
    lens: Float64,
    rays: Float64,
    rings: Float64,
    size: tuple[int, int],
    options: tuple[bool, float, float],
    solids: Solids,
    ground: Ground,
    meshes: Meshes,
    look: Look,
    scratch: FrameMemory,
    pictures: Pictures,
) -> None:
    """Draw bands of frames.

    Args:
        first, end: Bands of all frames, frame by frame.
        order: (number of bands of a frame,) the band to draw at each turn.
        who: (B, 3) slot, row of the own vehicle or -1, and how it is shown.
        poses: (B, NUM_POSE) cameras.
        lens: (NUM_LENS,).
        rays: (H, W, 3) directions right, down, ahead; unused by a pinhole.
        rings: (H,) descending elevations of a lidar's rings [rad]; unused by others.
        size: Height and width [pixels].
        options: Whether objects are boxes, reach [m], time of the flow [s].
        solids, ground, meshes, look: The scenes.
        scratch: Memory of the calling thread.
        pictures: Outputs.
    """
    height, width = size
    are_boxes, reach, dt = options
    is_colored = len(pictures.rgb) > 0
    drawn, count, num_shadows = -1, 0, 0
    for turn in range(first, end):
        frame, band = turn // len(order), order[turn % len(order)]
        slot, pose = who[frame, 0], poses[frame]
        if frame != drawn:
            count, num_shadows = add_solids(
                slot, who[frame, 1], who[frame, 2], pose, lens, rings, width, height, reach, are_boxes,
                is_colored, solids, ground, meshes, look.lights[frame], scratch, scratch.row[0],
            )  # fmt: skip
            drawn = frame
        top, bottom = band * BAND, smaller(band * BAND + BAND, height)
        num_active = list_band(top, bottom, count, scratch)
        for row in range(top, bottom):
            trace_row(row, num_active, lens, rays, width, scratch)
            for start in range(0, width, TILE):
                end = smaller(start + TILE, width)
                num = end - start
                near, seen, values = scratch.near, scratch.seen, scratch.row
                meet_ground(row, start, num, slot, pose, lens, rays, reach, ground, near, seen, values)
                label_row(frame, row, start, end, slot, ground, scratch, pictures)
                if len(pictures.flow):
                    flow_row(frame, row, start, end, slot, pose, lens, dt, solids, scratch, pictures)
                if is_colored:
                    light, grain = look.lights[frame], look.grain
                    cast_shadows(row, start, end, num_shadows, light[SHADOW], seen, values, scratch.shadows)
                    color_sky(start, num, light, grain, seen, values)
                    color_ground(start, num, slot, 1.0 / lens[FX], ground, light, grain, seen, values)
                    color_triangles(row, start, num, pose, lens, rays, scratch)
                    expose(row, start, num, size, light, look.tone, seen, values, pictures.rgb[frame])
