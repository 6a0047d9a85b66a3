"""All metrics of a rollout, as a row of ``schemas/results.toml``."""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from scenarionet_data.arrays.dtypes import Bool, Float64
from scenarionet_data.scenario.vocabulary import LIGHT_COLORS, LightColor
from scenarionet_sim.metrics.collisions import count_collisions
from scenarionet_sim.metrics.drive import EgoDrive
from scenarionet_sim.metrics.nuplan.measure import measure_nuplan
from scenarionet_sim.metrics.progress import displacement, mean_speed
from scenarionet_sim.metrics.road import runs_red_light
from scenarionet_sim.metrics.waymax.measure import measure_waymax
from scenarionet_sim.rollouts.rollout import Rollout
from scenarionet_sim.worlds.world import World


def measure(rollout: Rollout, world: World) -> dict[str, Any]:
    """Return the metrics of a rollout; null where the scenario lacks what a metric needs, such as a map or lights.

    The outcome and the collisions are those of the whole episode, all other metrics cover the time of the recording.
    """
    scored = rollout.scored()
    row = _outcome(rollout) | _collisions(rollout, world) | _beside_the_log(scored, world)
    if _is_whole(scored):
        recorded = EgoDrive.recorded(world, rollout.agent, rollout.start, rollout.num_scored)
        drive = EgoDrive.of(scored, world)
        row |= measure_nuplan(scored, drive, recorded, world) | measure_waymax(scored, drive, recorded, world)
        row |= {"red_light_violations": _red_lights(scored, world)}
    return {name: _plain(value) for name, value in row.items()}


def _plain(value: Any) -> Any:
    """Replace NaN and infinity by None."""
    return None if isinstance(value, float) and not math.isfinite(value) else value


def _is_whole(rollout: Rollout) -> bool:
    """Whether the vehicle moves at least a step and is present at every moment: no motion is known across a gap."""
    agent = rollout.agent
    states = rollout.position[:, agent], rollout.velocity[:, agent], rollout.heading[:, agent]
    return (
        rollout.num_steps > 0
        and bool(rollout.present[:, agent].all())
        and all(np.isfinite(state).all() for state in states)
    )


def _outcome(rollout: Rollout) -> dict[str, Any]:
    return {
        "status": rollout.end,
        "steps": rollout.num_steps,
        "outcome_time": None if rollout.end_step is None else rollout.end_step * rollout.dt,
        "success": rollout.end == "success",
        "out_of_road": rollout.end == "out_of_road",
        "timeout": rollout.end == "timeout",
        "route_completion": rollout.completion,
    }


def _collisions(rollout: Rollout, world: World) -> dict[str, Any]:
    found = count_collisions(rollout.contacts, world.object_type)
    return {
        "collided_vehicles": found.vehicles,
        "collided_humans": found.humans,
        "collided_objects": found.objects,
        "cost": found.cost,
        "first_collision": None if found.first is None else found.first * rollout.dt,
    }


def _beside_the_log(rollout: Rollout, world: World) -> dict[str, Any]:
    """Speed, and distance from the recording."""
    recorded = world.log_position[rollout.start :, rollout.agent].astype(np.float64)
    valid = world.log_valid[rollout.start :, rollout.agent]
    average, final = displacement(rollout.position[:, rollout.agent], recorded, valid)
    return {
        "mean_speed": mean_speed(rollout.velocity[:, rollout.agent]),
        "average_displacement": average,
        "final_displacement": final,
    }


def _red_lights(rollout: Rollout, world: World) -> int | None:
    """Lights that the vehicle runs; None without lights."""
    stop, direction, is_red = _lights(rollout, world)
    position = np.ascontiguousarray(rollout.position[:, rollout.agent])
    return int(runs_red_light(position, stop, direction, is_red).sum()) if len(stop) else None


def _lights(rollout: Rollout, world: World) -> tuple[Float64, Float64, Bool]:
    """Return stop points, lane directions and red phases of the lights whose lane is in the map."""
    rows = np.flatnonzero((world.light_lane >= 0) & np.isfinite(world.light_stop).all(axis=1))
    rows = rows[world.roads.lanes.lengths[world.light_lane[rows]] > 1]
    steps = np.minimum(rollout.start + np.arange(rollout.num_steps + 1), world.num_steps - 1)  # the last state stays
    is_red: Bool = LIGHT_COLORS[world.light_state[rows][:, steps]] == LightColor.RED
    stop = world.light_stop[rows].astype(np.float64)
    lanes = (world.roads.lanes[lane].astype(np.float64) for lane in world.light_lane[rows])
    direction = [_direction(lane, point) for lane, point in zip(lanes, stop, strict=True)]
    return stop, np.array(direction).reshape(-1, 2), is_red


def _direction(line: Float64, point: Float64) -> Float64:
    """(2,) direction of a line at its point nearest to a given one."""
    along = np.diff(line, axis=0)
    square = np.maximum((along**2).sum(axis=1), 1e-12)
    share = np.clip(((point - line[:-1]) * along).sum(axis=1) / square, 0.0, 1.0)
    nearest = np.argmin(((line[:-1] + share[:, None] * along - point) ** 2).sum(axis=1))
    unit: Float64 = along[nearest] / np.sqrt(square[nearest])
    return unit
