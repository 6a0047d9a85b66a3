"""Objects and fixtures of one frame: their triangles in view with the light on their corners, and their shadows."""

from __future__ import annotations

import math

from scenarionet_data.arrays.compiled import device_function
from scenarionet_data.arrays.dtypes import Float64
from scenarionet_sim.kernels.cameras.ground import height_at
from scenarionet_sim.kernels.cameras.layout import (
    BARRIER,
    BODY,
    BOTTOM,
    BOUNCE,
    BOX,
    BUS,
    BUS_CLASS,
    CAR,
    CAR_CLASS,
    CONE,
    CONE_CLASS,
    CYCLIST,
    DECK,
    DOWN,
    EYE,
    FACADE,
    FENCE,
    FORWARD,
    FX,
    FY,
    GLASS,
    HEADLAMP,
    HIDDEN,
    INSIDE,
    INSTANCE_ROW,
    KIND,
    LAMP_GREEN,
    LAMP_RED,
    LAMP_YELLOW,
    LAMPS,
    LEFT,
    MATERIAL,
    METAL,
    OBJECT_CLASS,
    OWN_VEHICLE,
    PEDESTRIAN,
    PERSON,
    PINHOLE,
    RIDER,
    RIGHT,
    RIGHT_END,
    SEMANTIC,
    SHADOW,
    SKYLIGHT,
    SUN,
    SUNLIGHT,
    TAIL_LAMP,
    TOP,
    TRI_END,
    TRI_FIRST,
    TRUCK,
    TRUCK_CLASS,
    VAN,
    FrameMemory,
    Ground,
    Meshes,
    Solids,
)
from scenarionet_sim.kernels.cameras.sky import sky_gradient
from scenarionet_sim.kernels.cameras.triangles import NEAREST, add_triangle, project_vertex
from scenarionet_sim.kernels.log import HEADING, VX, VY, YAW_RATE, X, Y
from scenarionet_sim.kernels.minmax import larger, smaller
from scenarionet_sim.kernels.structures import LIGHTS, LOG, NUM_OBJECTS, NUM_STEPS

NUM_MATERIALS, NUM_PAINTS = 21, 16
SMALL = 24.0
"""Radius on the screen [pixels] below which the mesh for small pictures is drawn, with the same light everywhere on a
triangle."""

TINY = 6.0
"""Radius below which the mesh for tiny pictures is drawn."""

LEAST, LEAST_FIXED = 0.4, 0.9
"""Radius below which objects and fixtures are not drawn."""


@device_function(divides_by_zero=True)
def shape_of(object_type: int, length: float) -> tuple[int, int]:
    """Return mesh and class of an object by its type and length [m]."""
    if object_type == 1:
        if length > 9.5:
            return BUS, BUS_CLASS
        if length > 6.2:
            return TRUCK, TRUCK_CLASS
        return (VAN, CAR_CLASS) if length > 5.2 else (CAR, CAR_CLASS)
    if object_type == 2:
        return PEDESTRIAN, PERSON
    if object_type == 3:
        return CYCLIST, RIDER
    if object_type == 5:
        return CONE, CONE_CLASS
    if object_type == 6:
        return BARRIER, FENCE
    return BOX, OBJECT_CLASS


@device_function(divides_by_zero=True)
def is_braking(solids: Solids, slot: int, row: int) -> bool:
    """Whether the brake lights of a vehicle are on: it stands, or its recording slows down by more than 0.8 m/s^2."""
    motion = solids.motion[slot, row]
    speed = math.hypot(motion[VX], motion[VY])
    if speed < 0.3:
        return True
    place, step = solids.place[slot], solids.timestep[slot]
    if step < 1 or step >= place[NUM_STEPS] or row >= place[NUM_OBJECTS]:
        return False
    now = solids.log[place[LOG] + step * place[NUM_OBJECTS] + row]
    before = solids.log[place[LOG] + (step - 1) * place[NUM_OBJECTS] + row]
    if before[7] == 0.0 or abs(now[X] - motion[X]) + abs(now[Y] - motion[Y]) > 0.5:
        return False
    return math.hypot(before[VX], before[VY]) - speed > 0.08


@device_function(divides_by_zero=True)
def lit(
    light: Float64, material: int, red: float, green: float, blue: float, vertex: Float64
) -> tuple[float, float, float]:
    """Return the light that a corner of a triangle sends to the camera.

    Args:
        light: Light of the frame.
        material: Material.
        red, green, blue: Its linear colour.
        vertex: (12,) see ``FrameMemory.vertices``.
    """
    nx, ny, nz = vertex[3], vertex[4], vertex[5]
    above = 0.5 + 0.5 * nz
    direct = larger(nx * light[SUN] + ny * light[SUN + 1] + nz * light[SUN + 2], 0.0)
    below = 1.0 - above
    red *= light[SUNLIGHT] * direct + light[SKYLIGHT] * above + light[BOUNCE] * below
    green *= light[SUNLIGHT + 1] * direct + light[SKYLIGHT + 1] * above + light[BOUNCE + 1] * below
    blue *= light[SUNLIGHT + 2] * direct + light[SKYLIGHT + 2] * above + light[BOUNCE + 2] * below
    if material in (BODY, GLASS, METAL):
        far = 1.0 / math.sqrt(vertex[6] ** 2 + vertex[7] ** 2 + vertex[8] ** 2 + 1e-9)
        vx, vy, vz = vertex[6] * far, vertex[7] * far, vertex[8] * far
        toward = smaller(larger(-(nx * vx + ny * vy + nz * vz), 0.0), 1.0)
        rest = 1.0 - toward
        share = (0.10 if material == GLASS else 0.045) + 0.7 * rest * rest * rest * rest * rest
        rx, ry, rz = vx + 2.0 * toward * nx, vy + 2.0 * toward * ny, vz + 2.0 * toward * nz
        if rz > 0.0:
            other = sky_gradient(light, rz)
        else:
            other = (0.22 * light[BOUNCE], 0.22 * light[BOUNCE + 1], 0.22 * light[BOUNCE + 2])
        shine = larger(rx * light[SUN] + ry * light[SUN + 1] + rz * light[SUN + 2], 0.0)
        shine *= shine
        shine *= shine
        shine *= shine
        shine *= shine
        shine = 0.35 * shine * shine
        red += share * other[0] + shine * light[SUNLIGHT]
        green += share * other[1] + shine * light[SUNLIGHT + 1]
        blue += share * other[2] + shine * light[SUNLIGHT + 2]
    return red, green, blue


@device_function(divides_by_zero=True)
def place_vertices(
    meshes: Meshes,
    mesh: int,
    box: Float64,
    spin: float,
    steer: float,
    pose: Float64,
    lens: Float64,
    scratch: FrameMemory,
) -> None:
    """Write the vertices of a mesh in view, for ``box`` x, y, z, heading, length, width, height."""
    cos, sin = math.cos(box[3]), math.sin(box[3])
    first, end = meshes.ranges[mesh, 0], meshes.ranges[mesh, 1]
    sx, sy, sz = box[4], box[5], box[6]
    for k in range(first, end):
        source, vertex = meshes.vertices[k], scratch.vertices[k - first]
        x, y, z = source[0] * sx, source[1] * sy, source[2] * sz
        nx, ny, nz = source[3] / sx, source[4] / sy, source[5] / sz
        part = meshes.part[k]
        if part > 0:
            wheel = meshes.wheels[mesh, part - 1]
            cx, cy, cz, radius = wheel[0] * sx, wheel[1] * sy, wheel[2] * sz, wheel[4] * sz
            angle = spin / larger(radius, 0.05)
            c, s = math.cos(angle), math.sin(angle)
            dx, dz = (x - cx) / larger(sx * wheel[3], 1e-3), (z - cz) / larger(radius, 1e-3)
            x, z = cx + radius * (c * dx + s * dz), cz + radius * (c * dz - s * dx)
            nx, nz = c * nx + s * nz, c * nz - s * nx
            if part <= 2:
                c, s = math.cos(steer), math.sin(steer)
                dx, dy = x - cx, y - cy
                x, y = cx + c * dx - s * dy, cy + s * dx + c * dy
                nx, ny = c * nx - s * ny, s * nx + c * ny
        unit = 1.0 / math.sqrt(nx * nx + ny * ny + nz * nz + 1e-30)
        vertex[3], vertex[4], vertex[5] = (cos * nx - sin * ny) * unit, (sin * nx + cos * ny) * unit, nz * unit
        wx = box[0] + cos * x - sin * y - pose[EYE]
        wy = box[1] + sin * x + cos * y - pose[EYE + 1]
        wz = box[2] + z - pose[EYE + 2]
        vertex[6], vertex[7], vertex[8] = wx, wy, wz
        vertex[0] = pose[RIGHT] * wx + pose[RIGHT + 1] * wy + pose[RIGHT + 2] * wz
        vertex[1] = pose[DOWN] * wx + pose[DOWN + 1] * wy + pose[DOWN + 2] * wz
        vertex[2] = pose[FORWARD] * wx + pose[FORWARD + 1] * wy + pose[FORWARD + 2] * wz
        project_vertex(lens, vertex)


@device_function(divides_by_zero=True)
def add_mesh(
    meshes: Meshes, mesh: int, paint: int, glow: int, row: int, semantic: int, lens: Float64,
    rings: Float64, width: int, height: int, light: Float64, scratch: FrameMemory, num_triangles: int, is_colored: bool,
    is_flat: bool,
) -> int:  # fmt: skip
    """Add the triangles of a mesh whose vertices are placed; return the new number of triangles.

    Args:
        meshes, mesh: The mesh.
        paint: Colour of ``BODY``.
        glow: Material that shines, or -1.
        row, semantic: Labels.
        lens, rings, width, height, light: Of the camera.
        scratch, num_triangles: Triangles so far.
        is_colored: Whether colours are needed.
        is_flat: Whether a triangle has one colour.
    """
    first = meshes.ranges[mesh, 0]
    for t in range(meshes.ranges[mesh, 2], meshes.ranges[mesh, 3]):
        if num_triangles >= len(scratch.labels):
            return num_triangles
        a, b, c = meshes.corners[t, 0] - first, meshes.corners[t, 1] - first, meshes.corners[t, 2] - first
        if not add_triangle(scratch.vertices, a, b, c, lens, rings, width, height, scratch, num_triangles):
            continue
        material = meshes.material[t]
        labels, colors = scratch.labels[num_triangles], scratch.colors[num_triangles]
        labels[INSTANCE_ROW], labels[SEMANTIC], labels[MATERIAL] = row, semantic, material
        pa, pb, pc = scratch.vertices[a], scratch.vertices[b], scratch.vertices[c]
        ux, uy, uz = pb[6] - pa[6], pb[7] - pa[7], pb[8] - pa[8]
        vx, vy, vz = pc[6] - pa[6], pc[7] - pa[7], pc[8] - pa[8]
        nx, ny, nz = uy * vz - uz * vy, uz * vx - ux * vz, ux * vy - uy * vx
        unit = 1.0 / math.sqrt(nx * nx + ny * ny + nz * nz + 1e-30)
        colors[9], colors[10], colors[11] = nx * unit, ny * unit, nz * unit
        num_triangles += 1
        if not is_colored:
            continue
        color = meshes.colors[NUM_MATERIALS + paint if material in (BODY, FACADE) else material]
        strength = 0.0
        if material == TAIL_LAMP and glow == TAIL_LAMP:
            strength = 5.0
        elif material in (HEADLAMP, TAIL_LAMP):
            strength = light[LAMPS] * (3.0 if material == HEADLAMP else 1.2)
        elif LAMP_RED <= material <= LAMP_GREEN:
            strength = 6.0 if glow == material else -0.85
        faint, extra = 1.0 + smaller(strength, 0.0), larger(strength, 0.0)
        for corner in range(1 if is_flat else 3):
            vertex = scratch.vertices[a if corner == 0 else (b if corner == 1 else c)]
            red, green, blue = lit(light, material, color[0], color[1], color[2], vertex)
            colors[3 * corner] = larger(red * faint + extra * color[0], 0.0)
            colors[3 * corner + 1] = larger(green * faint + extra * color[1], 0.0)
            colors[3 * corner + 2] = larger(blue * faint + extra * color[2], 0.0)
        if is_flat:
            for k in range(3, 9):
                colors[k] = colors[k - 3]
    return num_triangles


@device_function(divides_by_zero=True)
def screen_radius(box: Float64, pose: Float64, lens: Float64, width: int, height: int, reach: float) -> float:
    """Return the radius [pixels] of the ball around a box on the screen; -1 if no pixel can show it."""
    radius = 0.5 * math.sqrt(box[4] ** 2 + box[5] ** 2 + box[6] ** 2) + 0.1
    wx, wy, wz = box[0] - pose[EYE], box[1] - pose[EYE + 1], box[2] + 0.5 * box[6] - pose[EYE + 2]
    far = math.sqrt(wx * wx + wy * wy + wz * wz)
    if not far - radius <= reach:  # not a number either
        return -1.0
    if lens[KIND] == PINHOLE:
        x = pose[RIGHT] * wx + pose[RIGHT + 1] * wy + pose[RIGHT + 2] * wz
        y = pose[DOWN] * wx + pose[DOWN + 1] * wy + pose[DOWN + 2] * wz
        z = pose[FORWARD] * wx + pose[FORWARD + 1] * wy + pose[FORWARD + 2] * wz
        side = larger(lens[3], width - lens[3]) / lens[FX]
        rise = larger(lens[4], height - lens[4]) / lens[FY]
        if z < -radius:
            return -1.0
        if abs(x) - z * side > radius * math.sqrt(1.0 + side * side):
            return -1.0
        if abs(y) - z * rise > radius * math.sqrt(1.0 + rise * rise):
            return -1.0
    return float(lens[FX] * radius / larger(far, 0.1))


@device_function(divides_by_zero=True)
def add_instance(
    meshes: Meshes, mesh: int, paint: int, glow: int, row: int, semantic: int, box: Float64, spin: float,
    steer: float, pose: Float64, lens: Float64, rings: Float64, width: int, height: int, reach: float,
    light: Float64, scratch: FrameMemory, count: tuple[int, int], is_colored: bool,
) -> tuple[int, int]:  # fmt: skip
    """Add an object in view; return the new numbers of triangles and instances."""
    num_triangles, num_instances = count
    radius = screen_radius(box, pose, lens, width, height, reach)
    if radius < (LEAST if row >= 0 else LEAST_FIXED) or num_instances >= len(scratch.instances):
        return count
    if radius < SMALL:
        mesh = meshes.ranges[mesh, 5 if radius < TINY else 4]
    place_vertices(meshes, mesh, box, spin, steer, pose, lens, scratch)
    after = add_mesh(
        meshes, mesh, paint, glow, row, semantic, lens, rings, width, height, light, scratch, num_triangles,
        is_colored, radius < SMALL,
    )  # fmt: skip
    if after == num_triangles:
        return count
    instance = scratch.instances[num_instances]
    instance[TRI_FIRST], instance[TRI_END] = num_triangles, after
    left, top, right, bottom = width * 2, height, -width, 0
    for t in range(num_triangles, after):
        left, top = smaller(left, scratch.bounds[t, 0]), smaller(top, scratch.bounds[t, 1])
        right, bottom = larger(right, scratch.bounds[t, 2]), larger(bottom, scratch.bounds[t, 3])
    instance[LEFT], instance[TOP], instance[RIGHT_END], instance[BOTTOM] = left, top, right, bottom
    return after, num_instances + 1


@device_function(divides_by_zero=True)
def add_shadow(
    box: Float64, pose: Float64, lens: Float64, width: int, height: int, light: Float64, scratch: FrameMemory,
    num_shadows: int,
) -> int:  # fmt: skip
    """Add the shadow of a box on the ground; return the new number of shadows."""
    wx, wy = box[0] - pose[EYE], box[1] - pose[EYE + 1]
    radius = 0.5 * math.hypot(box[4], box[5])
    if num_shadows >= len(scratch.shadows) or math.hypot(wx, wy) - radius > 120.0 or lens[KIND] != PINHOLE:
        return num_shadows
    cos, sin = math.cos(box[3]), math.sin(box[3])
    length = box[6] / larger(light[SUN + 2], 0.2)
    sweep_x = -length * (cos * light[SUN] + sin * light[SUN + 1])
    sweep_y = -length * (cos * light[SUN + 1] - sin * light[SUN])
    pad = 0.45
    low_x, high_x = smaller(sweep_x, 0.0) - 0.5 * box[4] - pad, larger(sweep_x, 0.0) + 0.5 * box[4] + pad
    low_y, high_y = smaller(sweep_y, 0.0) - 0.5 * box[5] - pad, larger(sweep_y, 0.0) + 0.5 * box[5] + pad
    left, top, right, bottom = width * 1.0, height * 1.0, 0.0, 0.0
    bx = by = bz = 0.0
    for corner in range(5):  # the outline, clipped before the camera
        x = low_x if corner == 0 or corner >= 3 else high_x
        y = low_y if corner < 2 or corner == 4 else high_y
        if corner == 4:
            x = low_x
        dx, dy, dz = wx + cos * x - sin * y, wy + sin * x + cos * y, box[2] - pose[EYE + 2]
        ax = pose[RIGHT] * dx + pose[RIGHT + 1] * dy + pose[RIGHT + 2] * dz
        ay = pose[DOWN] * dx + pose[DOWN + 1] * dy + pose[DOWN + 2] * dz
        az = pose[FORWARD] * dx + pose[FORWARD + 1] * dy + pose[FORWARD + 2] * dz
        for step in range(2):
            px, py, pz = ax, ay, az
            if step == 0:
                if corner == 0 or (az < NEAREST) == (bz < NEAREST):
                    continue
                share = (NEAREST - bz) / (az - bz)
                px, py, pz = bx + share * (ax - bx), by + share * (ay - by), NEAREST
            if pz >= NEAREST:
                column, row = lens[FX] * px / pz + lens[3], lens[FY] * py / pz + lens[4]
                left, right = smaller(left, column), larger(right, column)
                top, bottom = smaller(top, row), larger(bottom, row)
        bx, by, bz = ax, ay, az
    if right <= 0.0 or left >= width or bottom <= 0.0 or top >= height or left >= right:
        return num_shadows
    shadow = scratch.shadows[num_shadows]
    shadow[0], shadow[1], shadow[2], shadow[3] = box[0], box[1], cos, sin
    shadow[4], shadow[5], shadow[6], shadow[7] = 0.5 * box[4], 0.5 * box[5], sweep_x, sweep_y
    shadow[8], shadow[9] = larger(math.floor(left), 0.0), larger(math.floor(top) - 1.0, 0.0)
    shadow[10], shadow[11] = smaller(math.ceil(right), width), smaller(math.ceil(bottom) + 1.0, height)
    return num_shadows + 1


@device_function(divides_by_zero=True)
def add_solids(
    slot: int, own: int, own_view: int, pose: Float64, lens: Float64, rings: Float64, width: int,
    height: int, reach: float, are_boxes: bool, is_colored: bool, solids: Solids, ground: Ground, meshes: Meshes,
    light: Float64, scratch: FrameMemory, box: Float64,
) -> tuple[int, int]:  # fmt: skip
    """Add all objects and fixtures of a world in view; return the numbers of instances and of shadows."""
    count, num_shadows = (0, 0), 0
    has_shadows = is_colored and light[SHADOW] > 0.0
    for row in range(solids.motion.shape[1]):
        if not solids.present[slot, row]:
            continue
        motion, size = solids.motion[slot, row], solids.size[slot, row]
        box[0], box[1], box[3] = motion[X], motion[Y], motion[HEADING]
        box[4], box[5], box[6] = larger(size[0], 0.05), larger(size[1], 0.05), larger(size[2], 0.05)
        if not abs(box[0] - pose[EYE]) + abs(box[1] - pose[EYE + 1]) <= 2.0 * reach:  # not a number either
            continue
        box[2] = height_at(ground, slot, box[0], box[1])
        mesh, semantic = shape_of(solids.object_type[slot, row], box[4])
        if row == own and own_view == INSIDE:
            mesh = DECK
        is_vehicle = solids.object_type[slot, row] == 1
        if has_shadows:
            num_shadows = add_shadow(box, pose, lens, width, height, light, scratch, num_shadows)
        if row == own and own_view == HIDDEN:
            continue
        paint = (row * 7 + 3 + (row >> 3)) % NUM_PAINTS if row != own else 4
        spin, steer, glow = 0.0, 0.0, -1
        if is_vehicle:
            cos, sin = math.cos(box[3]), math.sin(box[3])
            spin = motion[X] * cos + motion[Y] * sin
            speed = math.hypot(motion[VX], motion[VY])
            steer = smaller(larger(math.atan(0.6 * box[4] * motion[YAW_RATE] / larger(speed, 1.0)), -0.6), 0.6)
            if is_colored and is_braking(solids, slot, row):
                glow = TAIL_LAMP
        count = add_instance(
            meshes, BOX if are_boxes else mesh, paint, glow, row, semantic if row != own else OWN_VEHICLE, box, spin,
            steer, pose, lens, rings, width, height, reach, light, scratch, count, is_colored,
        )  # fmt: skip
    for k in range(solids.fixed_range[slot, 0], solids.fixed_range[slot, 1]):
        for column in range(7):
            box[column] = solids.fixed[k, column]
        kind, glow = solids.fixed_kind[k], -1
        if kind[3] >= 0:
            place = solids.place[slot]
            step = smaller(larger(solids.timestep[slot], 0), place[NUM_STEPS] - 1)
            color = solids.light_color[solids.light_state[place[LIGHTS] + kind[3] * place[NUM_STEPS] + step]]
            glow = LAMP_GREEN if color == 1 else (LAMP_YELLOW if color == 2 else (LAMP_RED if color == 3 else -1))
        if has_shadows and box[4] + box[5] > 0.6:
            num_shadows = add_shadow(box, pose, lens, width, height, light, scratch, num_shadows)
        count = add_instance(
            meshes, kind[0], kind[2], glow, -1, kind[1], box, 0.0, 0.0, pose, lens, rings, width, height, reach,
            light, scratch, count, is_colored,
        )  # fmt: skip
    return count[1], num_shadows
