"""Polylines without the points that hardly change their course."""

from __future__ import annotations

from scenarionet_data.arrays.dtypes import Bool, Float64, Int32
from scenarionet_data.compiled.decorators import kernel


@kernel(allocates=False)
def thin(points: Float64, offsets: Int32, area: float, longest: float, rows: Int32, is_kept: Bool) -> None:
    """Leave out points whose triangle with their neighbours is small, again and again until none is left.

    Source: M. Visvalingam, J. Whyatt, "Line generalisation by repeated elimination of points", 1993, in the passes of
    PufferDrive's preparation, which leave out no two neighbours at once.

    Args:
        points: (P, 2 or more) [m].
        offsets: (L + 1,) polylines, see ``Ragged``.
        area: Of the triangles that are left out [m²], less than that.
        longest: Longest segment that leaving out makes [m].
        rows: (P,) memory.
        is_kept: (P,) output.
    """
    for line in range(len(offsets) - 1):
        count = offsets[line + 1] - offsets[line]
        for k in range(count):
            rows[k] = offsets[line] + k
            is_kept[rows[k]] = False
        has_changed = True
        while has_changed:
            has_changed, place, found = False, 0, min(count, 1)
            while place + 2 < count:
                a, b, c = rows[place], rows[place + 1], rows[place + 2]
                along_x, along_y = points[c, 0] - points[a, 0], points[c, 1] - points[a, 1]
                cross = along_y * (points[b, 0] - points[a, 0]) - along_x * (points[b, 1] - points[a, 1])
                is_small = abs(cross) < 2.0 * area and along_x**2 + along_y**2 <= longest**2
                place += 2 if is_small else 1
                rows[found] = rows[place]
                found += 1
                has_changed |= is_small
            for k in range(place + 1, count):
                rows[found] = rows[k]
                found += 1
            count = found
        for k in range(count):
            is_kept[rows[k]] = True
