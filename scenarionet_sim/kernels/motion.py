"""The next moment of objects that need nobody else for it: as recorded, or carrying on as they are."""

from __future__ import annotations

from scenarionet_data.arrays.compiled import device_function, kernel
from scenarionet_data.arrays.dtypes import Bool, Float32, Float64, Int32, UInt8
from scenarionet_sim.kernels.log import HEADING, VALID, VX, VY, YAW_RATE, X, Y, Z
from scenarionet_sim.kernels.minmax import smaller


@device_function
def place_as_recorded(
    row: Float32,
    w: int,
    n: int,
    position: Float64,
    heading: Float64,
    velocity: Float64,
    yaw_rate: Float64,
    z: Float64,
    present: Bool,
) -> None:
    """Put object ``n`` of world ``w`` where a row of the log has it."""
    position[w, n, 0], position[w, n, 1] = row[X], row[Y]
    velocity[w, n, 0], velocity[w, n, 1] = row[VX], row[VY]
    heading[w, n], yaw_rate[w, n], z[w, n] = row[HEADING], row[YAW_RATE], row[Z]
    present[w, n] = True


@kernel
def replay(
    log: Float32,
    num_steps: Int32,
    timestep: Int32,
    driver: UInt8,
    me: int,
    position: Float64,
    heading: Float64,
    velocity: Float64,
    yaw_rate: Float64,
    z: Float64,
    present: Bool,
) -> None:
    """The log's next row; after its last, the last at rest.

    Args:
        log, num_steps, timestep: (W, T, N, 8), (W,), (W,) of now.
        driver, me: (W, N) and the value it has for the objects to move.
        position, heading, velocity, yaw_rate, z, present: The next moment, written.
    """
    for w in range(len(timestep)):
        t = smaller(timestep[w] + 1, num_steps[w] - 1)
        is_over = timestep[w] + 1 >= num_steps[w]
        for n in range(driver.shape[1]):
            if driver[w, n] != me:
                continue
            if log[w, t, n, VALID] == 0.0:
                present[w, n] = False
                continue
            place_as_recorded(log[w, t, n], w, n, position, heading, velocity, yaw_rate, z, present)
            if is_over:
                velocity[w, n, 0], velocity[w, n, 1], yaw_rate[w, n] = 0.0, 0.0, 0.0


@kernel
def carry_on(
    log: Float32,
    num_steps: Int32,
    timestep: Int32,
    driver: UInt8,
    me: int,
    dt: float,
    position: Float64,
    heading: Float64,
    velocity: Float64,
    yaw_rate: Float64,
    z: Float64,
    present: Bool,
    arc: Float64,
    lateral: Float64,
    next_position: Float64,
    next_heading: Float64,
    next_velocity: Float64,
    next_yaw_rate: Float64,
    next_z: Float64,
    next_present: Bool,
    next_arc: Float64,
    next_lateral: Float64,
) -> None:
    """Straight on for ``dt``; what is not there yet appears where the log has it, when the log has it.

    Args:
        log, num_steps, timestep: (W, T, N, 8), (W,), (W,) of now.
        driver, me: (W, N) and the value it has for the objects to move.
        dt: [s]; 0 leaves them where they are.
        position, ...: This moment and the next, see ``State``.
    """
    for w in range(len(timestep)):
        t = timestep[w] + 1
        for n in range(driver.shape[1]):
            if driver[w, n] != me:
                continue
            next_arc[w, n], next_lateral[w, n], next_present[w, n] = arc[w, n], lateral[w, n], present[w, n]
            if present[w, n]:
                for axis in range(2):
                    next_velocity[w, n, axis] = velocity[w, n, axis]
                    next_position[w, n, axis] = position[w, n, axis] + velocity[w, n, axis] * dt
                next_heading[w, n], next_yaw_rate[w, n], next_z[w, n] = heading[w, n], yaw_rate[w, n], z[w, n]
            elif t < num_steps[w] and log[w, t, n, VALID] != 0.0:
                row = log[w, t, n]
                place_as_recorded(
                    row, w, n, next_position, next_heading, next_velocity, next_yaw_rate, next_z, next_present
                )
