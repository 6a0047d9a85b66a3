"""What a variation cannot be: accelerations and jerk beyond those of road users, and contact at the start.

A recorded track may break a limit itself, by noise; its variation then has 5 % above what was recorded.
"""

from __future__ import annotations

import numpy as np
import shapely

from scenarionet_data.arrays.dtypes import Bool, Float64, IntP
from scenarionet_data.arrays.geometry import box_corners
from scenarionet_data.errors import InvalidScenario
from scenarionet_data.scenario.description import ScenarioDescription, Tracks

ACCELERATION = 9.81
"""Limit of acceleration, along and across [m/s^2]: what tyres transmit on a dry road."""

JERK = 40.0
"""Limit of jerk, over half a second [m/s^3]: full braking from coasting in a quarter of a second."""

_WINDOW = 0.5  # time over which accelerations are averaged, as in the events
_MORE = 1.05


def check_limits(
    parent: ScenarioDescription | None,
    changed: ScenarioDescription,
    origins: IntP,
    acceleration: float = ACCELERATION,
    jerk: float = JERK,
) -> None:
    """Refuse a variation that cannot be; its field is the reason: ``acceleration``, ``jerk`` or ``contact``.

    Args:
        parent: The recorded scenario; None if nothing of it was recorded.
        changed: The variation.
        origins: (N,) as :func:`~scenarionet_data.variations.changes.change` returns them.
        acceleration, jerk: Limits [m/s^2], [m/s^3].

    Raises:
        InvalidScenario: It is not plausible.
    """
    rows = np.flatnonzero(origins < 0)
    if not len(rows):
        return
    of_parent, steps = -1 - origins[rows], max(round(_WINDOW / changed.dt), 1)
    found = peaks(changed.tracks, rows, changed.timestamps, steps)
    recorded = (found[0] * 0.0,) * 2 if parent is None else peaks(parent.tracks, of_parent, parent.timestamps, steps)
    for name, limit, unit, peak, before in zip(
        ("acceleration", "jerk"), (acceleration, jerk), ("m/s^2", "m/s^3"), found, recorded, strict=True
    ):
        over = peak - np.maximum(limit, _MORE * before)
        if over.max() > 0:
            k = int(over.argmax())
            reason = f"wanted at most {limit:.4g} {unit}, found {peak[k]:.4g} in track {changed.tracks.ids[rows[k]]}"
            raise InvalidScenario(changed.id, name, reason)
    valid = changed.tracks.valid
    for step in sorted({0, changed.current_timestep, *valid[rows].argmax(axis=1).tolist()}):
        touching = _contact(changed.tracks, rows[valid[rows, step]], step)
        if touching and (parent is None or not _touched_before(parent, touching)):
            a, b = touching
            raise InvalidScenario(
                changed.id, "contact", f"tracks {a} and {b} touch at timestep {step}, where one starts"
            )


def peaks(tracks: Tracks, rows: IntP, time: Float64, steps: int) -> tuple[Float64, Float64]:
    """Return the largest acceleration [m/s^2] and jerk [m/s^3] of tracks (n,), over ``steps`` timesteps."""
    velocity, valid = tracks.velocity[rows].astype(np.float64), tracks.valid[rows]
    largest = []
    for _ in range(2):
        span = (time[steps:] - time[:-steps])[None, :, None]
        velocity, valid = (velocity[:, steps:] - velocity[:, :-steps]) / span, valid[:, steps:] & valid[:, :-steps]
        time = (time[steps:] + time[:-steps]) / 2
        size = np.where(valid, np.hypot(velocity[..., 0], velocity[..., 1]), 0.0)
        largest.append(size.max(axis=1, initial=0.0))
    return largest[0], largest[1]


def _contact(tracks: Tracks, rows: IntP, step: int) -> tuple[str, str] | None:
    """Return the ids of a track of ``rows`` and another one whose boxes overlap at a timestep."""
    present: Bool = tracks.valid[:, step]
    others = np.flatnonzero(present)
    size = tracks.size[others, step]
    boxes = shapely.polygons(
        box_corners(tracks.position[others, step, :2], tracks.heading[others, step], size[:, 0], size[:, 1])
    )
    for row in rows:
        mine = boxes[others == row][0]
        touching = others[shapely.intersects(boxes, mine) & (others != row)]
        if len(touching):
            return str(tracks.ids[row]), str(tracks.ids[touching[0]])
    return None


def _touched_before(parent: ScenarioDescription, ids: tuple[str, str]) -> bool:
    """Whether two tracks touch in the recording, too, where both are there first: boxes of loads, trailers, riders."""
    if not set(ids) <= set(parent.tracks.ids):
        return False
    rows = np.array([parent.tracks.index(each) for each in ids], np.intp)
    both = parent.tracks.valid[rows].all(axis=0)
    found = _contact(parent.tracks, rows[:1], int(both.argmax())) if both.any() else None
    return found is not None and set(found) == set(ids)
