"""Objects of a few pixels, drawn as upright outlines that face the camera: one span a row and one light for all."""

from __future__ import annotations

import math

import numpy as np

from scenarionet_data.arrays.dtypes import Float32, Float64, Int32
from scenarionet_data.compiled.decorators import device_function
from scenarionet_sim.arrays.minmax import larger, smaller
from scenarionet_sim.cameras.draw import columns as at
from scenarionet_sim.cameras.draw.structures import FrameView, Item

Ends = tuple[float, float, float, float, float, float]
"""Depth, column and row of the top of an outline, then of its foot."""

_NEAREST, _MOST_LEAN = 1.0, 0.5
"""Least distance [m], and largest slope of columns over rows, at which outlines are used."""

_UPWARD, _LEVEL = 0.2, 0.98
"""Vertical and horizontal part of the normal of all outlines."""

_MIRRORED = 0.045
"""Share of the light of the horizon that is mirrored, as by meshes seen from straight ahead."""


@device_function(forceinline=True, divides_by_zero=True, in_lanes=True)
def ends_of(outline: Float32, box: Float64, pose: Float64, lens: Float64) -> Ends:
    """Return where the top and the foot of an outline are in a pinhole's picture, see :func:`add_outline`."""
    x, y, z = box[0] - pose[at.EYE], box[1] - pose[at.EYE + 1], box[2] - pose[at.EYE + 2]
    low, high = z + outline[at.LOW] * box[6], z + outline[at.HIGH] * box[6]
    right, down = pose[at.RIGHT] * x + pose[at.RIGHT + 1] * y, pose[at.DOWN] * x + pose[at.DOWN + 1] * y
    ahead = pose[at.FORWARD] * x + pose[at.FORWARD + 1] * y
    top, foot = ahead + pose[at.FORWARD + 2] * high, ahead + pose[at.FORWARD + 2] * low
    column = lens[at.FX] * (right + pose[at.RIGHT + 2] * high) / top + lens[at.CX]
    row = lens[at.FY] * (down + pose[at.DOWN + 2] * high) / top + lens[at.CY]
    last_column = lens[at.FX] * (right + pose[at.RIGHT + 2] * low) / foot + lens[at.CX]
    last_row = lens[at.FY] * (down + pose[at.DOWN + 2] * low) / foot + lens[at.CY]
    return top, column, row, foot, last_column, last_row


@device_function(forceinline=True, divides_by_zero=True)
def is_upright(ends: Ends) -> bool:
    """Whether an outline is before the camera and upright on the screen; else its mesh is to be drawn."""
    top, column, row, foot, last_column, last_row = ends
    is_ahead = smaller(top, foot) > _NEAREST
    return bool(is_ahead and abs(last_column - column) < _MOST_LEAN * (last_row - row))


@device_function(divides_by_zero=True, in_lanes=True)
def add_outline(outline: Float32, ends: Ends, item: Item, view: FrameView, spans: Float64, bounds: Int32) -> bool:
    """Write the spans (12,) and bounds (4,) of an upright object in a pinhole's picture; return whether it is in view.

    Args:
        outline: (NUM_OUTLINE,) see ``Meshes.outlines``.
        ends: See :func:`ends_of`.
        item, view: The object and the camera.
        spans: Output: place of row 0 between the middle (0) and the foot (1) of the outline, and its step a row;
            half the width in the middle [pixels], its slope and bend; column of the middle in row 0 and its step a row;
            at 9 the inverse depth, with steps of 0, as of triangles.
        bounds: Output.
    """
    pose, lens, box, turn, width, height = view.pose, view.lens, item.box, item.turn, view.width, view.height
    x, y = box[0] - pose[at.EYE], box[1] - pose[at.EYE + 1]
    top, column, row, foot, last_column, last_row = ends
    tall = last_row - row
    lean = (last_column - column) / tall
    flat, middle = math.sqrt(x * x + y * y), 0.5 * (foot + top)
    straight, beside = abs(turn[0] * x + turn[1] * y) / flat, abs(turn[0] * y - turn[1] * x) / flat
    half = lens[at.FX] * outline[at.WIDE] * (box[4] * beside + box[5] * straight) / middle
    widest = half * (1.0 + abs(outline[at.SLOPE]) + larger(outline[at.BEND] * 1.0, 0.0))
    bounds[0] = int(smaller(larger(math.ceil(smaller(column, last_column) - widest - 0.5), 0.0), width))
    bounds[1] = int(smaller(larger(math.ceil(row - 0.5), 0.0), height))
    bounds[2] = int(smaller(larger(math.ceil(larger(column, last_column) + widest - 0.5), 0.0), width))
    bounds[3] = int(smaller(larger(math.ceil(last_row - 0.5), 0.0), height))
    if bounds[0] >= bounds[2] or bounds[1] >= bounds[3]:
        return False
    per = 2.0 / tall
    spans[0], spans[1] = (0.5 - row) * per - 1.0, per
    spans[2], spans[3], spans[4] = half, outline[at.SLOPE], outline[at.BEND]
    spans[5], spans[6] = column - 0.5 + lean * (0.5 - row), lean
    spans[9] = 1.0 / (middle - outline[at.DEEP] * (box[4] * straight + box[5] * beside))
    spans[10] = spans[11] = 0.0
    return True


@device_function(forceinline=True, divides_by_zero=True, in_lanes=True)
def span_of_outline(bounds: Int32, spans: Float64, row: int) -> tuple[float, float]:
    """Return the first column and the end of an outline in a row, from its bounds and spans."""
    place = spans[0] + spans[1] * row
    half = spans[2] * (1.0 + place * (spans[3] + place * spans[4]))
    middle = spans[5] + spans[6] * row
    return larger(bounds[0] * 1.0, np.ceil(middle - half)), smaller(bounds[2] * 1.0, np.ceil(middle + half))


@device_function(divides_by_zero=True, in_lanes=True)
def color_outline(color: Float32, item: Item, pose: Float64, light: Float64, colors: Float32) -> None:
    """Write the light and the normal of an outline to ``colors`` (12,), see ``FrameMemory``.

    Args:
        color: Linear RGB of the object.
        item, pose, light: The object, the camera and the light of the frame.
        colors: Output.
    """
    x, y = pose[at.EYE] - item.box[0], pose[at.EYE + 1] - item.box[1]
    per = _LEVEL / math.sqrt(x * x + y * y)
    colors[9], colors[10], colors[11] = x * per, y * per, _UPWARD
    direct = larger(x * per * light[at.SUN] + y * per * light[at.SUN + 1] + _UPWARD * light[at.SUN + 2], 0.0)
    direct *= item.lit
    above = 0.5 + 0.5 * _UPWARD
    for channel in range(3):
        arrives = light[at.SUNLIGHT + channel] * direct + light[at.SKYLIGHT + channel] * above
        arrives += light[at.BOUNCE + channel] * (1.0 - above)
        colors[3 * channel] = color[channel] * arrives + _MIRRORED * light[at.HORIZON + channel]
        colors[3 * channel + 1] = colors[3 * channel + 2] = 0.0
