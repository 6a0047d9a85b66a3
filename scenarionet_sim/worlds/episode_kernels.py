"""The beginning of episodes: the worlds that slots play, and the state of a world at a timestep of its log."""

from __future__ import annotations

import numpy as np

from scenarionet_data.arrays.dtypes import Int32, Int64, UInt8
from scenarionet_data.compiled.decorators import device_function, kernel
from scenarionet_sim.arrays.log import VALID
from scenarionet_sim.arrays.structures import (
    LOG,
    NUM_OBJECTS,
    OBJECTS,
    SERIAL,
    USED,
    USERS,
    Recorded,
    Series,
    Slots,
    StateArrays,
    StoredWorlds,
)

BEGUN, GOES_ON, AT_FIRST = -1, -2, -3
"""Of a world: its episode has begun and does not move in this step; its episode goes on; an episode begins at the first
timestep with a valid ego."""

UNDRIVEN = 255
"""A policy number: a row that no policy drives and that is never present."""


@device_function
def begin_world(w: int, at: int, recorded: Recorded, now: StateArrays, then: StateArrays, driver: UInt8) -> None:
    """Set a world to a timestep of its log, in the current and in the next state, which share sizes and types.

    Args:
        w: The world.
        at: The timestep.
        recorded: Logs of W worlds.
        now, then: The two states.
        driver: (W, N) policy of each object, written.
    """
    count, objects = recorded.place[w, NUM_OBJECTS], recorded.place[w, OBJECTS]
    first = recorded.place[w, LOG] + at * count
    now.timestep[w], then.timestep[w] = at, at
    for n in range(driver.shape[1]):
        driver[w, n] = recorded.driver[objects + n] if n < count else UNDRIVEN
        is_present = driver[w, n] != UNDRIVEN and recorded.log[first + n, VALID] != 0.0
        now.present[w, n], then.present[w, n] = is_present, is_present
    for n in range(count):
        now.route[w, n, 0], now.route[w, n, 1] = np.nan, 0.0
        then.route[w, n, 0], then.route[w, n, 1] = np.nan, 0.0
        then.object_type[w, n] = recorded.object_type[objects + n]
        for axis in range(3):
            then.size[w, n, axis] = recorded.size[objects + n, axis]
        if then.present[w, n]:
            for column in range(VALID):
                value = recorded.log[first + n, column]
                now.motion[w, n, column], then.motion[w, n, column] = value, value


@kernel(allocates=False)
def play_worlds(which: Int64, numbers: Int64, moment: int, stored: StoredWorlds, slots: Slots) -> int:
    """Put worlds into slots.

    Args:
        which: (B,) the slots.
        numbers: (B,) numbers of their worlds among those that are stored.
        moment: Number of the call, from which the time follows since when a world is unused.
        stored: The worlds; written.
        slots: All slots; written.

    Returns:
        Number of worlds that no slot plays.
    """
    for b in range(len(which)):
        _play(which[b], numbers[b], moment, stored, slots)
    num_unused = 0
    for number in range(len(stored.usage)):
        num_unused += stored.usage[number, USERS] == 0
    return num_unused


@kernel(allocates=False)
def play_scenarios(
    which: Int64, coming: Int64, moment: int, series: Series, stored: StoredWorlds, slots: Slots, begins: Int32
) -> int:
    """Let episodes of scenarios begin in slots at their first timesteps, if all of their worlds are stored.

    Args:
        which: (B,) the slots.
        coming: (B + L,) their scenarios, and those that come later.
        series: What is known of scenarios; written.
        moment, stored, slots: See :func:`play_worlds`.
        begins: (W,) see ``StepArrays``; written.

    Returns:
        Number of the later ones that are not stored; -1 if one of the others is not, and then nothing is changed.
    """
    count, num_unknown = len(which), 0
    for k in range(len(coming)):
        number, serial = series.known[coming[k], 0], series.known[coming[k], 1]
        if serial == 0 or stored.usage[number, SERIAL] != serial:
            if k < count:
                return -1
            num_unknown += 1
    for b in range(count):
        series.playing[which[b]], series.was_played[coming[b]] = coming[b], True
        _play(which[b], series.known[coming[b], 0], moment, stored, slots)
        begins[which[b]] = AT_FIRST
    return num_unknown


@device_function
def _play(w: int, number: int, moment: int, stored: StoredWorlds, slots: Slots) -> None:
    """Put a world into a slot."""
    stored.usage[number, USERS] += 1
    if slots.number[w] >= 0:
        stored.usage[slots.number[w], USERS] -= 1
        stored.usage[slots.number[w], USED] = moment
    slots.number[w] = number
    for column in range(slots.place.shape[1]):
        slots.place[w, column] = stored.place[number, column]
    for column in range(slots.frame.shape[1]):
        slots.frame[w, column] = stored.frame[number, column]
