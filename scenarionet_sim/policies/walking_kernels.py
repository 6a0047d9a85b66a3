"""Pedestrians and cyclists that give way: the social force model on top of the recorded way.

Helbing and Molnár, Social force model for pedestrian dynamics (Physical Review E 51, 1995): an acceleration towards a
desired velocity, and repulsion that decays exponentially with the distance and is weaker from behind. The desired
velocity is the recorded one and leads back to the recorded position. Vehicles repel by the nearest point of the strip
that they are about to drive over.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from scenarionet_data.arrays.dtypes import Float64, UInt8
from scenarionet_data.compiled.decorators import device_function, kernel
from scenarionet_sim.arrays.log import HEADING, VALID, VX, VY, YAW_RATE, X, Y, Z
from scenarionet_sim.arrays.minmax import larger, smaller
from scenarionet_sim.arrays.structures import LOG, NUM_OBJECTS, NUM_STEPS, OBJECTS, Recorded, StateArrays
from scenarionet_sim.policies.motion_kernels import place_as_recorded


class ForceLaw(NamedTuple):
    """Parameters of the model, see ``policies.SocialForce``; all float."""

    relaxation: float
    return_time: float
    strength: float
    reach: float
    vehicle_strength: float
    vehicle_reach: float
    look_ahead: float
    behind: float
    hurry: float
    horizon: float


_VEHICLE = 1  # ObjectType
_TURNING = 0.2  # [m/s] from which an object faces where it goes


@kernel(allocates=False)
def walk(
    recorded: Recorded, now: StateArrays, then: StateArrays, driver: UInt8, policy_id: int, dt: float, law: ForceLaw
) -> None:
    """Write the next state of the objects of a policy; they are present while the log is valid.

    Args:
        recorded: Logs of W worlds.
        now: Current state.
        then: Next state, initially a copy of ``now``; the policy's rows are written.
        driver, policy_id: (W, N) policy of each object, and the policy whose objects move.
        dt: [s].
        law: Parameters of the model.
    """
    for w in range(driver.shape[0]):
        count, num_steps = recorded.place[w, NUM_OBJECTS], recorded.place[w, NUM_STEPS]
        is_over = now.timestep[w] + 1 >= num_steps
        step = smaller(now.timestep[w] + 1, num_steps - 1)
        log = recorded.place[w, LOG] + step * count
        for n in range(count):
            if driver[w, n] != policy_id:
                continue
            row = recorded.log[log + n]
            if row[VALID] == 0.0:
                then.present[w, n] = False
            elif not now.present[w, n]:
                place_as_recorded(row, w, n, then.motion, then.present)
            else:
                pace = 0.0 if is_over else 1.0
                goal = np.float64(row[X]), np.float64(row[Y]), pace * row[VX], pace * row[VY]
                fastest = law.hurry * larger(np.float64(recorded.top_speed[recorded.place[w, OBJECTS] + n]), 1.0)
                _move(w, n, goal, fastest, now, then.motion[w, n], dt, law)
                then.motion[w, n, Z] = row[Z]


@device_function
def _move(
    w: int,
    n: int,
    goal: tuple[float, float, float, float],
    fastest: float,
    now: StateArrays,
    moved: Float64,
    dt: float,
    law: ForceLaw,
) -> None:
    """Advance one object, with the row (7,) ``moved`` of the next state; ``goal`` is as recorded."""
    own = now.motion[w, n]
    push_x, push_y = 0.0, 0.0
    for m in range(now.present.shape[1]):
        if m != n and now.present[w, m]:
            fx, fy = _repulsion(w, n, m, now, law)
            push_x, push_y = push_x + fx, push_y + fy
    # Where the recording is a step later, less the way there at the recorded velocity, is where it is now.
    wanted_x = goal[2] + (goal[0] - goal[2] * dt - own[X]) / law.return_time
    wanted_y = goal[3] + (goal[1] - goal[3] * dt - own[Y]) / law.return_time
    share = smaller(fastest / larger(np.hypot(wanted_x, wanted_y), 1e-9), 1.0)
    gain = smaller(dt / law.relaxation, 1.0)
    vx = own[VX] + (share * wanted_x - own[VX]) * gain + push_x * dt
    vy = own[VY] + (share * wanted_y - own[VY]) * gain + push_y * dt
    share = smaller(fastest / larger(np.hypot(vx, vy), 1e-9), 1.0)
    vx, vy = share * vx, share * vy
    moved[VX], moved[VY], moved[YAW_RATE] = vx, vy, 0.0
    moved[X], moved[Y] = own[X] + vx * dt, own[Y] + vy * dt
    if np.hypot(vx, vy) > _TURNING:
        moved[HEADING] = np.arctan2(vy, vx)
        turn = moved[HEADING] - own[HEADING]
        moved[YAW_RATE] = (turn - 2.0 * np.pi * np.floor((turn + np.pi) / (2.0 * np.pi))) / dt


@device_function
def _repulsion(w: int, n: int, m: int, now: StateArrays, law: ForceLaw) -> tuple[float, float]:
    """Return the acceleration of object ``n`` away from object ``m`` [m/s²]."""
    own, other = now.motion[w, n], now.motion[w, m]
    dx, dy = own[X] - other[X], own[Y] - other[Y]
    radius, strength, reach = 0.5 * now.size[w, n, 1], law.strength, law.reach
    if now.object_type[w, m] == _VEHICLE:
        strength, reach = law.vehicle_strength, law.vehicle_reach
        cos, sin = np.cos(other[HEADING]), np.sin(other[HEADING])
        along, left = cos * dx + sin * dy, cos * dy - sin * dx
        ahead = (cos * other[VX] + sin * other[VY]) * law.look_ahead
        half_length, half_width = 0.5 * now.size[w, m, 0], 0.5 * now.size[w, m, 1]
        near_along = smaller(larger(along, -half_length + smaller(ahead, 0.0)), half_length + larger(ahead, 0.0))
        near_left = smaller(larger(left, -half_width), half_width)
        over, beside = along - near_along, left - near_left
        if over == 0.0 and beside == 0.0:  # on the strip: away sideways
            beside = np.copysign(1e-3, left)
        dx, dy = cos * over - sin * beside, sin * over + cos * beside
    else:
        radius += 0.5 * now.size[w, m, 1]
    distance = np.hypot(dx, dy)
    if distance - radius > law.horizon * reach or distance == 0.0:
        return 0.0, 0.0
    dx, dy = dx / distance, dy / distance
    speed = np.hypot(own[VX], own[VY])
    facing = -(own[VX] * dx + own[VY] * dy) / speed if speed > 0.0 else 1.0
    weight = law.behind + (1.0 - law.behind) * 0.5 * (1.0 + facing)
    force = strength * weight * np.exp(smaller(radius - distance, 0.0) / reach)
    return force * dx, force * dy
