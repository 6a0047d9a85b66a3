"""Objects and fixtures of one frame: their triangles in view with the light on their corners, and their shadows."""

from __future__ import annotations

import math

from scenarionet_data.arrays.dtypes import Bool, Float32, Float64, Int32
from scenarionet_data.compiled.decorators import device_function
from scenarionet_sim.arrays.log import HEADING, VX, VY, YAW_RATE, X, Y
from scenarionet_sim.arrays.minmax import larger, smaller
from scenarionet_sim.arrays.structures import LIGHTS, LOG, NUM_OBJECTS, NUM_STEPS
from scenarionet_sim.cameras.draw import codes
from scenarionet_sim.cameras.draw import columns as at
from scenarionet_sim.cameras.draw.fixture_sizes import measure_fixtures
from scenarionet_sim.cameras.draw.ground import height_at
from scenarionet_sim.cameras.draw.placement import SMALL, add_instance, is_beside_picture, mesh_for, screen_radius
from scenarionet_sim.cameras.draw.shadows import (
    LEAST_CASTER,
    LEAST_SHADOW,
    SHADOW_REACH,
    add_light,
    add_shadow,
    light_at,
)
from scenarionet_sim.cameras.draw.structures import GROUP, FrameMemory, FrameView, Ground, Item, Meshes, Solids

NUM_PAINTS, OWN_PAINT = 15, 15
"""Number of paints of other objects, and the paint of the own vehicle."""

STRIDES = 0.95
"""Strides of people a second, two steps each."""

LEAST, LEAST_FIXED = 0.4, 0.9
"""Radius below which objects and fixtures are not drawn."""


@device_function(divides_by_zero=True)
def shape_of(object_type: int, length: float) -> tuple[int, int]:
    """Return mesh and class of an object by its type and length [m]."""
    if object_type == 1:
        if length > 9.5:
            return codes.BUS, codes.BUS_CLASS
        if length > 6.2:
            return codes.TRUCK, codes.TRUCK_CLASS
        return (codes.VAN, codes.CAR_CLASS) if length > 5.2 else (codes.CAR, codes.CAR_CLASS)
    if object_type == 2:
        return codes.PEDESTRIAN, codes.PERSON
    if object_type == 3:
        return codes.CYCLIST, codes.RIDER
    if object_type == 5:
        return codes.CONE, codes.CONE_CLASS
    if object_type == 6:
        return codes.BARRIER, codes.FENCE
    return codes.BOX, codes.OBJECT_CLASS


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
def wheels_of(motion: Float64, box: Float64) -> tuple[float, float, float]:
    """Return how far a vehicle's wheels rolled [m], a function of its place, how they are steered [rad], and 0."""
    spin = motion[X] * math.cos(box[3]) + motion[Y] * math.sin(box[3])
    speed = math.hypot(motion[VX], motion[VY])
    steer = math.atan(0.6 * box[4] * motion[YAW_RATE] / larger(speed, 1.0))
    return spin, smaller(larger(steer, -0.6), 0.6), 0.0


@device_function(divides_by_zero=True)
def limbs_of(motion: Float64, seconds: float, row: int) -> tuple[float, float, float]:
    """Return how far a cyclist's wheels rolled [m], 0, and how far limbs swing [rad]: with speed more, not faster."""
    speed = math.hypot(motion[VX], motion[VY])
    spin = motion[X] * math.cos(motion[HEADING]) + motion[Y] * math.sin(motion[HEADING])
    return spin, 0.0, smaller(0.3 * speed, 0.5) * math.sin(2.0 * math.pi * (STRIDES * seconds + 0.618 * row))


@device_function(divides_by_zero=True)
def lamp_of(solids: Solids, slot: int, lamp: int) -> int:
    """Return the material of the lamp of a traffic light that shines, or -1."""
    place = solids.place[slot]
    step = smaller(larger(solids.timestep[slot], 0), place[NUM_STEPS] - 1)
    color = solids.light_color[solids.light_state[place[LIGHTS] + lamp * place[NUM_STEPS] + step]]
    return codes.LAMP_RED + 3 - color if 1 <= color <= 3 else -1


@device_function(forceinline=True, divides_by_zero=True, in_lanes=True)
def write_box(item: int, view: FrameView, solids: Solids, ground: Ground, box: Float64) -> bool:
    """Write x, y, z, heading, length, width, height of an object or fixture; return whether it may be in reach.

    Args:
        item: Row of an object in the state, or the number of rows plus that of a fixture of the world.
        view, solids, ground: The camera and the scene.
        box: (7,) output.
    """
    slot, pose = view.slot, view.pose
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
    if solids.object_type[slot, item] == 2 and not view.are_boxes:  # recorded boxes have room for arms and bags
        box[4], box[5] = smaller(box[4], 0.36 * box[6]), smaller(box[5], 0.36 * box[6])
    if not abs(box[0] - pose[at.EYE]) + abs(box[1] - pose[at.EYE + 1]) <= 2.0 * view.reach:  # not a number either
        return False
    box[2] = height_at(ground, slot, box[0], box[1])
    return True


@device_function(divides_by_zero=True, in_lanes=True)
def casts_shadow(is_object: bool, box: Float64, view: FrameView) -> bool:
    """Whether the shadow of a box may be seen: it is in the picture and high enough there, and not too far away."""
    if not is_object and smaller(box[4], box[5]) <= LEAST_CASTER:
        return False
    pose, light = view.pose, view.light
    reach = box[6] / larger(light[at.SUN + 2], 0.2)
    x = box[0] - pose[at.EYE] - 0.5 * reach * light[at.SUN]
    y = box[1] - pose[at.EYE + 1] - 0.5 * reach * light[at.SUN + 1]
    z, radius = box[2] - pose[at.EYE + 2], 0.5 * (reach + box[4] + box[5]) + 0.45
    square, far = x * x + y * y, SHADOW_REACH + radius
    if square >= far * far or 2.0 * radius * abs(z) * view.lens[at.FY] < LEAST_SHADOW * (square - radius * radius):
        return False
    return not is_beside_picture(x, y, z, radius, view)


@device_function(forceinline=True)
def source_of(item: int, view: FrameView, solids: Solids) -> int:
    """Return the mesh of an object or fixture that lights the ground, or -1."""
    slot, rows = view.slot, solids.motion.shape[1]
    if view.light[at.NIGHT] == 0.0:
        return -1
    if item >= rows:
        group, place = solids.fixed_range[slot, 0] + (item - rows) // GROUP, (item - rows) % GROUP
        return codes.LAMP if solids.fixed_kind[group, place, 0] == codes.LAMP else -1
    return codes.CAR if solids.object_type[slot, item] == 1 else -1


@device_function(forceinline=True)
def caster_of(item: int, slot: int, solids: Solids) -> int:
    """Return the class by which an object or fixture casts its shadow."""
    rows = solids.motion.shape[1]
    if item >= rows:
        return int(solids.fixed_kind[solids.fixed_range[slot, 0] + (item - rows) // GROUP, (item - rows) % GROUP, 1])
    return codes.PERSON if solids.object_type[slot, item] in (2, 3) else codes.CAR_CLASS


@device_function(forceinline=True, divides_by_zero=True)
def appearance_of(
    item: int, view: FrameView, solids: Solids, box: Float64
) -> tuple[int, int, int, int, tuple[float, float, float]]:
    """Return mesh, class, paint, shining material or -1, and how wheels and limbs move, see ``Item.moves``."""
    slot, rows = view.slot, solids.motion.shape[1]
    moves, glow = (0.0, 0.0, 0.0), -1
    if item >= rows:
        kind = solids.fixed_kind[solids.fixed_range[slot, 0] + (item - rows) // GROUP, (item - rows) % GROUP]
        if kind[3] >= 0:
            glow = lamp_of(solids, slot, kind[3])
        return int(kind[0]), int(kind[1]), int(kind[2]), glow, moves
    mesh, semantic = shape_of(solids.object_type[slot, item], box[4])
    paint = (item * 7 + 3 + (item >> 3)) % NUM_PAINTS
    if solids.object_type[slot, item] == 1:
        moves = wheels_of(solids.motion[slot, item], box)
        if view.is_colored and is_braking(solids, slot, item):
            glow = codes.TAIL_LAMP
    elif solids.object_type[slot, item] in (2, 3):
        moves = limbs_of(solids.motion[slot, item], solids.timestep[slot] * solids.dt[slot], item)
    if item == view.own:
        paint, semantic = OWN_PAINT, codes.OWN_VEHICLE
        if view.own_view == codes.INSIDE:
            mesh = codes.DECK
    return codes.BOX if view.are_boxes else mesh, semantic, paint, glow, moves


@device_function(forceinline=True, divides_by_zero=True)
def has_shadows(view: FrameView) -> bool:
    """Whether objects cast shadows."""
    return bool(view.is_colored and view.light[at.SHADOW] > 0.0 and view.lens[at.KIND] == codes.PINHOLE)


@device_function(divides_by_zero=True, in_lanes=True)
def add_solids(
    view: FrameView, solids: Solids, ground: Ground, meshes: Meshes, scratch: FrameMemory
) -> tuple[int, int]:
    """Add all objects and fixtures of a world in view; return the numbers of instances and of shadows."""
    count, num_triangles, num_shadows, box = 0, 0, 0, scratch.box
    are_cast, slot, rows = has_shadows(view), view.slot, solids.motion.shape[1]
    num_items = rows + GROUP * int(solids.fixed_range[slot, 1] - solids.fixed_range[slot, 0])
    radii, shadows, listed, begin = scratch.radii, scratch.has_shadow, scratch.listed, 0
    is_night = are_cast and view.light[at.NIGHT] > 0.0
    if is_night:
        for number in range(num_items):
            source = source_of(number, view, solids)
            if source >= 0 and write_box(number, view, solids, ground, box):
                num_shadows = add_light(box, source, view, scratch.shadows, num_shadows)
    lights = scratch.shadows[:num_shadows]
    while begin < num_items:
        is_object = begin < rows
        end = smaller(begin + len(listed), rows if is_object else num_items)
        if is_object:
            num_listed = list_present(begin, end, solids.present[slot], listed)
        else:
            first = int(solids.fixed_range[slot, 0]) + (begin - rows) // GROUP
            measure_fixtures((end - begin) // GROUP, first, view, solids.fixed, radii, shadows)
            num_listed = list_visible(end - begin, are_cast, radii, shadows, listed)
        for place in range(num_listed):
            number, number_listed = begin + listed[place], listed[place]
            if not write_box(number, view, solids, ground, box):
                continue
            if is_object:
                radius, has_shadow = screen_radius(box, view), are_cast and casts_shadow(True, box, view)
            else:
                radius, has_shadow = radii[number_listed] * 1.0, are_cast and shadows[number_listed] > 0
            if has_shadow and source_of(number, view, solids) < 0:
                num_shadows = add_shadow(box, caster_of(number, slot, solids), view, scratch.shadows, num_shadows)
            is_hidden = number == view.own and view.own_view == codes.HIDDEN
            if radius < (LEAST if is_object else LEAST_FIXED) or is_hidden or count >= len(scratch.instances):
                continue
            mesh, semantic, paint, glow, moves = appearance_of(number, view, solids, box)
            mesh, cos, sin = mesh_for(meshes, mesh, radius, box, view.pose)
            row, lit = number if is_object else -1, light_at(box[0], box[1], lights) if is_night else 1.0
            item = Item(row, box, mesh, (cos, sin), semantic, paint, glow, moves, radius < SMALL, lit)
            num_triangles, count = add_instance(item, view, meshes, scratch, (num_triangles, count))
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
