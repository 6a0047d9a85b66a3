"""Whole frames: the kernel of cameras."""

from __future__ import annotations

import math

from scenarionet_data.arrays.compiled import device_function, kernel
from scenarionet_data.arrays.dtypes import Float64, Int32, Int64
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
from scenarionet_sim.kernels.cameras.triangles import trace_row
from scenarionet_sim.kernels.log import VX, YAW_RATE, X, Y
from scenarionet_sim.kernels.minmax import larger, smaller

BAND = 8
"""Rows of a band, the part of a frame that a thread draws at a time."""

NOTHING, ON_GROUND = -2, -1
"""Values of ``FrameMemory.seen`` after the ground: triangles are 0 and above."""

DISTANCE, GROUND_X, GROUND_Y, SHADE, RAY_X, RAY_Y, RAY_Z, UNIT = range(8)
"""Rows of ``FrameMemory.row``."""


@device_function(divides_by_zero=True)
def meet_ground(
    row: int, slot: int, pose: Float64, lens: Float64, rays: Float64, width: int, reach: float, ground: Ground,
    near: Float64, seen: Int32, values: Float64,
) -> None:  # fmt: skip
    """Write directions and distances of the pixels of a row, to the nearer of ground and triangle."""
    is_level = ground.height_frame[slot, 3] == 0.0
    level = height_at(ground, slot, pose[EYE], pose[EYE + 1]) - pose[EYE + 2]
    v = (row + 0.5 - lens[CY]) / lens[FY]
    for column in range(width):
        if lens[KIND] == PINHOLE:
            x, y, z = (column + 0.5 - lens[CX]) / lens[FX], v, 1.0
        else:
            x, y, z = rays[row, column, 0], rays[row, column, 1], rays[row, column, 2]
        dx = x * pose[RIGHT] + y * pose[DOWN] + z * pose[FORWARD]
        dy = x * pose[RIGHT + 1] + y * pose[DOWN + 1] + z * pose[FORWARD + 1]
        dz = x * pose[RIGHT + 2] + y * pose[DOWN + 2] + z * pose[FORWARD + 2]
        values[RAY_X, column], values[RAY_Y, column], values[RAY_Z, column] = dx, dy, dz
        values[UNIT, column] = math.sqrt(x * x + y * y + z * z)
        values[DISTANCE, column] = level / dz if dz < -1e-9 else math.inf
    if not is_level:
        ex, ey, ez = pose[EYE], pose[EYE + 1], pose[EYE + 2]
        for column in range(width):
            dx, dy, dz = values[RAY_X, column], values[RAY_Y, column], values[RAY_Z, column]
            values[DISTANCE, column] = meet_heights(ground, slot, ex, ey, ez, dx, dy, dz, reach)
    for column in range(width):
        far = values[DISTANCE, column]
        if seen[column] >= 0 and near[column] * far >= 1.0:
            values[DISTANCE, column] = 1.0 / near[column]
        elif far * values[UNIT, column] < reach and far > 0.0:
            seen[column] = ON_GROUND
            values[GROUND_X, column] = pose[EYE] + far * values[RAY_X, column]
            values[GROUND_Y, column] = pose[EYE + 1] + far * values[RAY_Y, column]
        else:
            seen[column] = NOTHING
            values[DISTANCE, column] = reach
        values[SHADE, column] = 1.0


@device_function(divides_by_zero=True)
def cast_shadows(row: int, num_shadows: int, strength: float, seen: Int32, values: Float64, shadows: Float64) -> None:
    """Darken the ground under and behind objects."""
    for k in range(num_shadows):
        shadow = shadows[k]
        if not shadow[9] <= row < shadow[11]:
            continue
        square = shadow[6] * shadow[6] + shadow[7] * shadow[7] + 1e-9
        for column in range(int(shadow[8]), int(shadow[10])):
            if seen[column] != ON_GROUND:
                continue
            dx, dy = values[GROUND_X, column] - shadow[0], values[GROUND_Y, column] - shadow[1]
            x, y = shadow[2] * dx + shadow[3] * dy, shadow[2] * dy - shadow[3] * dx
            along = smaller(larger((x * shadow[6] + y * shadow[7]) / square, 0.0), 1.0)
            out = larger(abs(x - along * shadow[6]) - shadow[4], abs(y - along * shadow[7]) - shadow[5])
            soft = 0.05 + 0.30 * along
            cast = smaller(larger(0.5 - out / soft, 0.0), 1.0) * (1.0 - 0.35 * along)
            close = larger(abs(x) - shadow[4], abs(y) - shadow[5])
            contact = 0.9 * smaller(larger(0.55 - close / 0.5, 0.0), 1.0)
            values[SHADE, column] *= 1.0 - strength * larger(cast, contact)


@device_function(forceinline=True, divides_by_zero=True)
def facade(x: float, y: float, z: float, nx: float, ny: float, footprint: float, paint: float) -> float:
    """Return how bright a wall is at a point: 1 on the wall, less on the windows of its storeys."""
    along = nx * y - ny * x
    u, v = along / 3.2, z / 3.3
    u, v = u - math.floor(u), v - math.floor(v)
    window = 1.0 if 0.22 < u < 0.78 and 0.28 < v < 0.80 else 0.0
    share = smaller(larger(1.2 - footprint * 0.8, 0.0), 1.0)
    window = window * share + 0.29 * (1.0 - share)
    return 1.0 - (0.72 - 0.15 * paint) * window


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
def color_row(
    frame: int, row: int, slot: int, pose: Float64, lens: Float64, rays: Float64, width: int, height: int,
    ground: Ground, look: Look, scratch: FrameMemory, pictures: Pictures,
) -> None:  # fmt: skip
    """Write the colours of a row."""
    values, seen = scratch.row, scratch.seen
    light, grain, tone = look.lights[frame], look.grain, look.tone
    angle, eye_height = 1.0 / lens[FX], pose[EYE + 2]
    is_wet = light[WET] > 0.0
    v = (row + 0.5 - lens[CY]) / lens[FY]
    for column in range(width):
        dx, dy, dz = values[RAY_X, column], values[RAY_Y, column], values[RAY_Z, column]
        far, unit = values[DISTANCE, column], values[UNIT, column]
        triangle = seen[column]
        if triangle == NOTHING:
            scale = 1.0 / unit
            red, green, blue = sky_color(light, grain, dx * scale, dy * scale, dz * scale)
        else:
            if triangle == ON_GROUND:
                x, y = values[GROUND_X, column], values[GROUND_Y, column]
                flat = 1.0 / math.sqrt(dx * dx + dy * dy + 1e-12)
                across = far * angle
                along = smaller(across * unit / larger(-dz, 1e-3), 30.0)
                cell = cell_of(ground, slot, x, y)
                red, green, blue = ground_color(
                    ground, light, grain, slot, cell, x, y, dx * flat, dy * flat, across, along, values[SHADE, column]
                )
                if is_wet:
                    red, green, blue = wet_color(light, grain, x, y, dz / unit, red, green, blue)
            else:
                if lens[KIND] == PINHOLE:
                    red, green, blue = shade_triangle(triangle, (column + 0.5 - lens[CX]) / lens[FX], v, 1.0, scratch)
                else:
                    red, green, blue = shade_triangle(
                        triangle, rays[row, column, 0], rays[row, column, 1], rays[row, column, 2], scratch
                    )
                if scratch.labels[triangle, MATERIAL] == FACADE:
                    x, y = pose[EYE] + far * dx, pose[EYE + 1] + far * dy
                    z = eye_height + far * dz
                    nx, ny = scratch.colors[triangle, 9] * 1.0, scratch.colors[triangle, 10] * 1.0
                    bright = facade(x, y, z, nx, ny, far * angle, 0.0)
                    red, green, blue = red * bright, green * bright, blue * (0.1 + 0.9 * bright)
            mist = far * unit * light[HAZE]
            clear = 1.0 / (1.0 + mist * (1.0 + 0.5 * mist))
            red = light[HORIZON] + clear * (red - light[HORIZON])
            green = light[HORIZON + 1] + clear * (green - light[HORIZON + 1])
            blue = light[HORIZON + 2] + clear * (blue - light[HORIZON + 2])
        gain = light[EXPOSURE]
        if light[VIGNETTE] > 0.0:
            cx, cy = (column + 0.5) / width - 0.5, (row + 0.5) / height - 0.5
            gain *= 1.0 - light[VIGNETTE] * 2.0 * (cx * cx + cy * cy)
        red, green, blue = red * gain, green * gain, blue * gain
        # Highlights are compressed: x / (x + 0.6) with the same slope at 0.
        pixel = pictures.rgb[frame, row, column]
        pixel[0] = tone[int(smaller(4095.0 * 1.25 * red / (red + 0.75), 4095.0))]
        pixel[1] = tone[int(smaller(4095.0 * 1.25 * green / (green + 0.75), 4095.0))]
        pixel[2] = tone[int(smaller(4095.0 * 1.25 * blue / (blue + 0.75), 4095.0))]


@device_function(forceinline=True, divides_by_zero=True)
def ground_class(ground: Ground, slot: int, x: float, y: float) -> int:
    """Return the class of the ground at a point."""
    cell = cell_of(ground, slot, x, y)
    if cell < 0:
        return TERRAIN
    bits = int(ground.corner[cell])
    if ground.cell_start[cell] < ground.cell_start[cell + 1]:
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
    frame: int, row: int, slot: int, width: int, ground: Ground, scratch: FrameMemory, pictures: Pictures
) -> None:
    """Write depth, class, instance and normal of the pixels of a row, where wanted."""
    values, seen = scratch.row, scratch.seen
    if len(pictures.depth):
        for column in range(width):
            pictures.depth[frame, row, column] = values[DISTANCE, column]
    if len(pictures.semantic):
        for column in range(width):
            found = SKY
            if seen[column] >= 0:
                found = scratch.labels[seen[column], SEMANTIC]
            elif seen[column] == ON_GROUND:
                found = ground_class(ground, slot, values[GROUND_X, column], values[GROUND_Y, column])
            pictures.semantic[frame, row, column] = found
    if len(pictures.instance):
        for column in range(width):
            pictures.instance[frame, row, column] = (
                scratch.labels[seen[column], INSTANCE_ROW] if seen[column] >= 0 else -1
            )
    if len(pictures.normals):
        for column in range(width):
            normal = pictures.normals[frame, row, column]
            normal[0], normal[1], normal[2] = 0.0, 0.0, 0.0
            if seen[column] >= 0:
                colors = scratch.colors[seen[column]]
                normal[0], normal[1], normal[2] = colors[9], colors[10], colors[11]
            elif seen[column] == ON_GROUND:
                x, y = values[GROUND_X, column], values[GROUND_Y, column]
                slope_x = (height_at(ground, slot, x + 0.05, y) - height_at(ground, slot, x - 0.05, y)) * 10.0
                slope_y = (height_at(ground, slot, x, y + 0.05) - height_at(ground, slot, x, y - 0.05)) * 10.0
                unit = 1.0 / math.sqrt(slope_x * slope_x + slope_y * slope_y + 1.0)
                normal[0], normal[1], normal[2] = -slope_x * unit, -slope_y * unit, unit


@device_function(divides_by_zero=True)
def flow_row(
    frame: int, row: int, slot: int, pose: Float64, lens: Float64, width: int, dt: float, solids: Solids,
    scratch: FrameMemory, pictures: Pictures,
) -> None:  # fmt: skip
    """Write where each pixel's point will be in the picture after ``dt``, at constant velocities and yaw rates."""
    values, seen = scratch.row, scratch.seen
    turn = pose[YAW_SPEED] * dt
    cos, sin = math.cos(turn), math.sin(turn)
    for column in range(width):
        out = pictures.flow[frame, row, column]
        out[0], out[1] = 0.0, 0.0
        far = values[DISTANCE, column]
        x, y = far * values[RAY_X, column], far * values[RAY_Y, column]
        z = far * values[RAY_Z, column]
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
        who: (B, 3) slot, row of the own vehicle or -1, and 1 to show it.
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
                slot, who[frame, 1], who[frame, 2] > 0, pose, lens, rings, width, height, reach, are_boxes,
                is_colored, solids, ground, meshes, look.lights[frame], scratch, scratch.row[0],
            )  # fmt: skip
            drawn = frame
        for row in range(band * BAND, smaller(band * BAND + BAND, height)):
            trace_row(row, count, lens, rays, width, scratch)
            near, seen, values = scratch.near, scratch.seen, scratch.row
            meet_ground(row, slot, pose, lens, rays, width, reach, ground, near, seen, values)
            if is_colored:
                cast_shadows(row, num_shadows, look.lights[frame, SHADOW], seen, values, scratch.shadows)
                color_row(
                    frame, row, slot, pose, lens, rays, width, height, ground, look, scratch, pictures
                )  # fmt: skip
            label_row(frame, row, slot, width, ground, scratch, pictures)
            if len(pictures.flow):
                flow_row(frame, row, slot, pose, lens, width, dt, solids, scratch, pictures)
