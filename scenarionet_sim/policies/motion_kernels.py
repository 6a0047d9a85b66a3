"""Motion of objects independent of all others: replay of the log, or constant velocity."""

from __future__ import annotations

from scenarionet_data.arrays.dtypes import Bool, Float32, Float64, UInt8
from scenarionet_data.compiled.decorators import device_function
from scenarionet_sim.arrays.log import VALID, VX, VY, YAW_RATE, X, Y
from scenarionet_sim.arrays.minmax import smaller
from scenarionet_sim.arrays.structures import LOG, NUM_OBJECTS, NUM_STEPS, Recorded, StateArrays

UNCOMPILED, REPLAY, ENTER, CARRY_ON, FOLLOW_PATH = range(5)
"""How a policy moves its objects: outside of the kernel; as recorded; only appearing; at constant velocity; by IDM."""


@device_function
def place_as_recorded(row: Float32, w: int, n: int, motion: Float64, present: Bool) -> None:
    """Set object ``n`` of world ``w`` to a row of the log."""
    for column in range(VALID):
        motion[w, n, column] = row[column]
    present[w, n] = True


@device_function
def move_objects(
    w: int, recorded: Recorded, now: StateArrays, then: StateArrays, driver: UInt8, movement: UInt8, dt: float
) -> None:
    """Write the next state of all objects of a world; it is the current one for those that something else moves.

    Replayed objects are where the next row of the log has them, and stay at its last row. Objects that enter or carry
    on appear at their first valid row.

    Args:
        w: The world.
        recorded: Logs of W worlds.
        now, then: Current state; next state, written.
        driver: (W, N) policy of each object, or ``UNDRIVEN``.
        movement: (P,) see ``REPLAY``.
        dt: [s].
    """
    count, t, num_steps = recorded.place[w, NUM_OBJECTS], now.timestep[w], recorded.place[w, NUM_STEPS]
    first, is_over = recorded.place[w, LOG] + smaller(t + 1, num_steps - 1) * count, t + 1 >= num_steps
    then.timestep[w] = t + 1
    for n in range(count):
        then.route[w, n, 0], then.route[w, n, 1] = now.route[w, n, 0], now.route[w, n, 1]
        policy, is_present, row = driver[w, n], now.present[w, n], recorded.log[first + n]
        kind = movement[policy] if policy < len(movement) else UNCOMPILED
        may_appear = ENTER <= kind <= CARRY_ON and not is_present and not is_over
        if (kind == REPLAY or may_appear) and row[VALID] != 0.0:
            place_as_recorded(row, w, n, then.motion, then.present)
            if is_over:
                then.motion[w, n, VX], then.motion[w, n, VY], then.motion[w, n, YAW_RATE] = 0.0, 0.0, 0.0
            continue
        then.present[w, n] = is_present and kind != REPLAY
        if is_present:
            for column in range(VALID):
                then.motion[w, n, column] = now.motion[w, n, column]
            if kind == CARRY_ON:
                then.motion[w, n, X] += now.motion[w, n, VX] * dt
                then.motion[w, n, Y] += now.motion[w, n, VY] * dt
