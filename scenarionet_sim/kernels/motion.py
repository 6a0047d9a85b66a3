"""Motion of objects independent of all others: replay of the log, or constant velocity."""

from __future__ import annotations

from scenarionet_data.arrays.compiled import device_function, kernel
from scenarionet_data.arrays.dtypes import Bool, Float32, Float64, Int32, UInt8
from scenarionet_sim.kernels.log import VALID, VX, VY, YAW_RATE, X, Y
from scenarionet_sim.kernels.minmax import smaller


@device_function
def place_as_recorded(row: Float32, w: int, n: int, motion: Float64, present: Bool) -> None:
    """Set object ``n`` of world ``w`` to a row of the log."""
    for column in range(motion.shape[2]):
        motion[w, n, column] = row[column]
    present[w, n] = True


@kernel
def replay(
    log: Float32,
    num_steps: Int32,
    timestep: Int32,
    driver: UInt8,
    policy_id: int,
    is_entry_only: bool,
    motion: Float64,
    present: Bool,
) -> None:
    """Set objects to the next row of the log; after its last row, to that row at rest.

    Args:
        log: (W, T, N, 8).
        num_steps: (W,) timesteps of each log.
        timestep: (W,) current timestep.
        driver: (W, N) policy of each object.
        policy_id: The policy whose objects move.
        is_entry_only: Leave present objects unchanged: absent ones appear, until the end of the log.
        motion, present: (W, N, 7), (W, N) next state, written.
    """
    for w in range(len(timestep)):
        t = smaller(timestep[w] + 1, num_steps[w] - 1)
        is_over = timestep[w] + 1 >= num_steps[w]
        for n in range(driver.shape[1]):
            if driver[w, n] != policy_id or (is_entry_only and (is_over or present[w, n])):
                continue
            if log[w, t, n, VALID] == 0.0:
                present[w, n] = False
                continue
            place_as_recorded(log[w, t, n], w, n, motion, present)
            if is_over:
                motion[w, n, VX], motion[w, n, VY], motion[w, n, YAW_RATE] = 0.0, 0.0, 0.0


@kernel
def move_on(
    log: Float32,
    num_steps: Int32,
    timestep: Int32,
    driver: UInt8,
    policy_id: int,
    dt: float,
    motion: Float64,
    present: Bool,
) -> None:
    """Advance objects at constant velocity; absent ones appear at their first valid row of the log.

    Args:
        log, num_steps, timestep, driver, policy_id: As in :func:`replay`.
        dt: [s].
        motion, present: (W, N, 7), (W, N) current state, advanced in place.
    """
    for w in range(len(timestep)):
        t = timestep[w] + 1
        for n in range(driver.shape[1]):
            if driver[w, n] != policy_id:
                continue
            if present[w, n]:
                motion[w, n, X] += motion[w, n, VX] * dt
                motion[w, n, Y] += motion[w, n, VY] * dt
            elif t < num_steps[w] and log[w, t, n, VALID] != 0.0:
                place_as_recorded(log[w, t, n], w, n, motion, present)
