"""Motion of objects independent of all others: replay of the log, or constant velocity."""

from __future__ import annotations

from scenarionet_data.arrays.compiled import device_function
from scenarionet_data.arrays.dtypes import Bool, Float32, Float64, UInt8
from scenarionet_sim.kernels.log import VALID, VX, VY, YAW_RATE, X, Y
from scenarionet_sim.kernels.minmax import smaller
from scenarionet_sim.kernels.structures import LOG, NUM_OBJECTS, NUM_STEPS, Recorded


@device_function
def place_as_recorded(row: Float32, w: int, n: int, motion: Float64, present: Bool) -> None:
    """Set object ``n`` of world ``w`` to a row of the log."""
    for column in range(motion.shape[2]):
        motion[w, n, column] = row[column]
    present[w, n] = True


@device_function
def replay(
    w: int,
    recorded: Recorded,
    timestep: int,
    driver: UInt8,
    policy_id: int,
    is_entry_only: bool,
    motion: Float64,
    present: Bool,
) -> None:
    """Set objects of a world to the next row of the log; after its last row, to that row at rest.

    Args:
        w: The world.
        recorded: Logs of W worlds.
        timestep: Current timestep.
        driver: (W, N) policy of each object.
        policy_id: The policy whose objects move.
        is_entry_only: Leave present objects unchanged: absent ones appear, until the end of the log.
        motion, present: (W, N, 7), (W, N) next state, written.
    """
    count, num_steps = recorded.place[w, NUM_OBJECTS], recorded.place[w, NUM_STEPS]
    is_over = timestep + 1 >= num_steps
    first = recorded.place[w, LOG] + smaller(timestep + 1, num_steps - 1) * count
    for n in range(count):
        if driver[w, n] != policy_id or (is_entry_only and (is_over or present[w, n])):
            continue
        row = recorded.log[first + n]
        if row[VALID] == 0.0:
            present[w, n] = False
            continue
        place_as_recorded(row, w, n, motion, present)
        if is_over:
            motion[w, n, VX], motion[w, n, VY], motion[w, n, YAW_RATE] = 0.0, 0.0, 0.0


@device_function
def move_on(
    w: int,
    recorded: Recorded,
    timestep: int,
    driver: UInt8,
    policy_id: int,
    dt: float,
    motion: Float64,
    present: Bool,
) -> None:
    """Advance objects of a world at constant velocity; absent ones appear at their first valid row of the log.

    Args:
        w, recorded, timestep, driver, policy_id: As in :func:`replay`.
        dt: [s].
        motion, present: (W, N, 7), (W, N) current state, advanced in place.
    """
    count = recorded.place[w, NUM_OBJECTS]
    first = recorded.place[w, LOG] + (timestep + 1) * count
    for n in range(count):
        if driver[w, n] != policy_id:
            continue
        if present[w, n]:
            motion[w, n, X] += motion[w, n, VX] * dt
            motion[w, n, Y] += motion[w, n, VY] * dt
        elif timestep + 1 < recorded.place[w, NUM_STEPS] and recorded.log[first + n, VALID] != 0.0:
            place_as_recorded(recorded.log[first + n], w, n, motion, present)
