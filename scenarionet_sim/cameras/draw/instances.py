"""Objects and fixtures of one frame: their triangles in view with the light on their corners, and their shadows."""

from __future__ import annotations

import math

from scenarionet_data.arrays.dtypes import Bool, Float32, Float64, Int32
from scenarionet_data.compiled.decorators import device_function
from scenarionet_sim.arrays.log import HEADING, VX, VY, YAW_RATE, X, Y
from scenarionet_sim.arrays.minmax import larger, smaller
from scenarionet_sim.arrays.structures import LIGHTS, LOG, NUM_OBJECTS, NUM_STEPS
from scenarionet_sim.cameras.draw.fixtures import measure_fixtures
from scenarionet_sim.cameras.draw.ground import height_at
from scenarionet_sim.cameras.draw.layout import (
    BARRIER,
    BOX,
    BUS,
    BUS_CLASS,
    CAR,
    CAR_CLASS,
    CONE,
    CONE_CLASS,
    CYCLIST,
    DECK,
    EYE,
    FENCE,
    FY,
    GROUP,
    HIDDEN,
    INSIDE,
    KIND,
    LAMP_GREEN,
    LAMP_RED,
    LAMP_YELLOW,
    OBJECT_CLASS,
    OWN_VEHICLE,
    PEDESTRIAN,
    PERSON,
    PINHOLE,
    RIDER,
    SHADOW,
    SUN,
    TAIL_LAMP,
    TRUCK,
    TRUCK_CLASS,
    VAN,
    FrameMemory,
    Ground,
    Meshes,
    Solids,
)
from scenarionet_sim.cameras.draw.placement import add_instance, is_beside_picture, screen_radius
from scenarionet_sim.cameras.draw.shadows import LEAST_SHADOW, SHADOW_REACH, add_shadow

NUM_PAINTS = 16
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
def wheels_of(motion: Float64, box: Float64) -> tuple[float, float]:
    """Return how far the wheels of a vehicle rolled [m], a function of its place, and how they are steered [rad]."""
    spin = motion[X] * math.cos(box[3]) + motion[Y] * math.sin(box[3])
    speed = math.hypot(motion[VX], motion[VY])
    steer = math.atan(0.6 * box[4] * motion[YAW_RATE] / larger(speed, 1.0))
    return spin, smaller(larger(steer, -0.6), 0.6)


@device_function(divides_by_zero=True)
def lamp_of(solids: Solids, slot: int, lamp: int) -> int:
    """Return the material of the lamp of a traffic light that shines, or -1."""
    place = solids.place[slot]
    step = smaller(larger(solids.timestep[slot], 0), place[NUM_STEPS] - 1)
    color = solids.light_color[solids.light_state[place[LIGHTS] + lamp * place[NUM_STEPS] + step]]
    return LAMP_GREEN if color == 1 else (LAMP_YELLOW if color == 2 else (LAMP_RED if color == 3 else -1))


@device_function(forceinline=True, divides_by_zero=True, in_lanes=True)
def write_box(item: int, slot: int, pose: Float64, reach: float, solids: Solids, ground: Ground, box: Float64) -> bool:
    """Write x, y, z, heading, length, width, height of an object or fixture; return whether it may be in reach.

    Args:
        item: Row of an object in the state, or the number of rows plus that of a fixture of the world.
        slot, pose, reach, solids, ground: The scene and the camera.
        box: (7,) output.
    """
    rows = solids.motion.shape[1]
    if item >= rows:
        group, place = solids.fixed_range[slot, 0] + (item - rows) // GROUP, (item - rows) % GROUP
        for column in range(7):
            box[column] = solids.fixed[group, column, place]
        return True
    if not solids.present[slot, item]:
        return False
    motion, size = solids.motion[slot, item], solids.size[slot, item]
    box[0], box[1], box[3] = motion[X], motion[Y], motion[HEADING]
    box[4], box[5], box[6] = larger(size[0], 0.05), larger(size[1], 0.05), larger(size[2], 0.05)
    if not abs(box[0] - pose[EYE]) + abs(box[1] - pose[EYE + 1]) <= 2.0 * reach:  # not a number either
        return False
    box[2] = height_at(ground, slot, box[0], box[1])
    return True


@device_function(divides_by_zero=True, in_lanes=True)
def casts_shadow(
    is_object: bool, box: Float64, pose: Float64, lens: Float64, width: int, height: int, light: Float64
) -> bool:
    """Whether the shadow of a box may be seen: it is in the picture and high enough there, and not too far away."""
    if not is_object and box[4] + box[5] <= 0.6:
        return False
    reach = box[6] / larger(light[SUN + 2], 0.2)
    x, y = box[0] - pose[EYE] - 0.5 * reach * light[SUN], box[1] - pose[EYE + 1] - 0.5 * reach * light[SUN + 1]
    z, radius = box[2] - pose[EYE + 2], 0.5 * (reach + box[4] + box[5]) + 0.45
    square, far = x * x + y * y, SHADOW_REACH + radius
    if square >= far * far or 2.0 * radius * abs(z) * lens[FY] < LEAST_SHADOW * (square - radius * radius):
        return False
    return not is_beside_picture(x, y, z, radius, pose, lens, width, height)


@device_function(forceinline=True, divides_by_zero=True)
def appearance_of(
    item: int, slot: int, own: int, own_view: int, are_boxes: bool, is_colored: bool, solids: Solids, box: Float64
) -> tuple[int, int, int, int, float, float]:
    """Return mesh, class, paint, shining material or -1, and how far wheels rolled [m] and are steered [rad]."""
    rows = solids.motion.shape[1]
    spin, steer, glow = 0.0, 0.0, -1
    if item >= rows:
        kind = solids.fixed_kind[solids.fixed_range[slot, 0] + (item - rows) // GROUP, (item - rows) % GROUP]
        if kind[3] >= 0:
            glow = lamp_of(solids, slot, kind[3])
        return int(kind[0]), int(kind[1]), int(kind[2]), glow, spin, steer
    mesh, semantic = shape_of(solids.object_type[slot, item], box[4])
    paint = (item * 7 + 3 + (item >> 3)) % NUM_PAINTS
    if solids.object_type[slot, item] == 1:
        spin, steer = wheels_of(solids.motion[slot, item], box)
        if is_colored and is_braking(solids, slot, item):
            glow = TAIL_LAMP
    if item == own:
        paint, semantic = 4, OWN_VEHICLE
        if own_view == INSIDE:
            mesh = DECK
    if are_boxes:
        mesh = BOX
    return mesh, semantic, paint, glow, spin, steer


@device_function(divides_by_zero=True, in_lanes=True)
def add_solids(
    slot: int, own: int, own_view: int, pose: Float64, lens: Float64, rings: Float64, width: int,
    height: int, reach: float, are_boxes: bool, is_colored: bool, has_normals: bool, solids: Solids, ground: Ground,
    meshes: Meshes, light: Float64, scratch: FrameMemory, box: Float64,
) -> tuple[int, int]:  # fmt: skip
    """Add all objects and fixtures of a world in view; return the numbers of instances and of shadows."""
    count, num_triangles, num_shadows = 0, 0, 0
    has_shadows = is_colored and light[SHADOW] > 0.0 and lens[KIND] == PINHOLE
    rows = solids.motion.shape[1]
    num_items = rows + GROUP * int(solids.fixed_range[slot, 1] - solids.fixed_range[slot, 0])
    radii, shadows, listed, begin = scratch.radii, scratch.has_shadow, scratch.listed, 0
    while begin < num_items:
        is_object = begin < rows
        end = smaller(begin + len(listed), rows if is_object else num_items)
        if is_object:
            num_listed = list_present(begin, end, solids.present[slot], listed)
        else:
            measure_fixtures(
                (end - begin) // GROUP, int(solids.fixed_range[slot, 0]) + (begin - rows) // GROUP,
                lens[KIND] == PINHOLE, pose, lens, width * 1.0, height * 1.0, reach, light, solids.fixed, radii,
                shadows,
            )  # fmt: skip
            num_listed = list_visible(end - begin, has_shadows, radii, shadows, listed)
        for place in range(num_listed):
            item, number = begin + listed[place], listed[place]
            if not write_box(item, slot, pose, reach, solids, ground, box):
                continue
            if is_object:
                radius = screen_radius(box, pose, lens, width, height, reach)
                has_shadow = has_shadows and casts_shadow(True, box, pose, lens, width, height, light)
            else:
                radius, has_shadow = radii[number] * 1.0, has_shadows and shadows[number] > 0
            if has_shadow:
                num_shadows = add_shadow(box, pose, lens, width, height, light, scratch.shadows, num_shadows)
            if radius < (LEAST if is_object else LEAST_FIXED) or (item == own and own_view == HIDDEN):
                continue
            mesh, semantic, paint, glow, spin, steer = appearance_of(
                item, slot, own, own_view, are_boxes, is_colored, solids, box
            )
            num_triangles, count = add_instance(
                meshes, mesh, paint, glow, item if is_object else -1, semantic, box, spin, steer, pose, lens, rings,
                width, height, radius, light, scratch, (num_triangles, count), is_colored, has_normals,
            )  # fmt: skip
        begin = end
    return count, num_shadows


@device_function(in_lanes=True)
def list_present(first: int, end: int, present: Bool, listed: Int32) -> int:
    """List objects that are present, counted from the first one; return their number."""
    count = 0
    for item in range(first, end):
        listed[count] = item - first
        count += 1 if present[item] else 0
    return count


@device_function(divides_by_zero=True, in_lanes=True)
def list_visible(num_items: int, has_shadows: bool, radii: Float32, shadows: Int32, listed: Int32) -> int:
    """List fixtures that are in view or whose shadows are; return their number."""
    count, least = 0, 0 if has_shadows else 1
    for number in range(num_items):
        listed[count] = number
        count += 1 if (radii[number] >= LEAST_FIXED) | (shadows[number] > least) else 0
    return count
