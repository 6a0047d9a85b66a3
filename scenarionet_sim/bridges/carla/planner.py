"""An agent of CARLA's leaderboard as a planner."""

from __future__ import annotations

import math
import os
import weakref
from functools import cached_property
from itertools import groupby
from typing import Any

import numpy as np

from scenarionet_data.building.features import MapBuilder
from scenarionet_data.errors import BadParameter
from scenarionet_data.interchange.base import Losses
from scenarionet_data.interchange.opendrive.writer import write_features
from scenarionet_data.scenario.vocabulary import MapFeatureType
from scenarionet_sim.backends.base import Drive
from scenarionet_sim.bridges.carla.sensors import AgentSensors, degrees_of
from scenarionet_sim.bridges.carla.stand_ins import CarlaDataProvider, GameTime
from scenarionet_sim.planners.base import Action, Planner
from scenarionet_sim.planners.view import View
from scenarionet_sim.roads.roads import Roads

CONFIG = "TEAM_CONFIG"
"""Variable that names the file that agents are set up with, as in the leaderboard's own scripts."""

_MAX_STEER = math.radians(70.0)
_STEERING = (0.0, 20.0, 60.0, 120.0), (1.0, 0.9, 0.8, 0.7)
"""Largest angle of the front wheels of CARLA's cars, and the share of it by speed [km/h]: the defaults of Unreal
Engine's ``UWheeledVehicleMovementComponent4W``."""

_TURN = math.radians(30.0)  # change of heading through a junction from which a route turns
_NARROWEST, _WIDEST = 2.0, 8.0  # [m] of lanes


class AgentPlanner(Planner):
    """Drives by an agent, which is made and set up where an episode begins, and destroyed after it.

    Args:
        kind: The agent's class.
    """

    def __init__(self, kind: Any) -> None:
        self._kind, self._frame = kind, 0
        self._agent: Any = None
        self._roads: Roads | None = None

    def act(self, view: View) -> Action:
        """Return what the agent tells the vehicle to do."""
        CarlaDataProvider.road_map = lambda: self.road_map
        if self._agent is None:
            self._begin(view)
        self._frame += 1
        GameTime.frame, GameTime.time = self._frame, self._frame * view.dt
        interface = self._agent.sensor_interface
        for name, measured in self._sensors.read(view):
            interface.update_sensor(name, measured, self._frame)
        control = self._agent.run_step(interface.get_data(self._frame), GameTime.time)
        return action_of(control, view.ego.speed)

    @cached_property
    def opendrive(self) -> str:
        """The scenario's map."""
        return opendrive_of(self._roads)

    @cached_property
    def road_map(self) -> Any:
        """The scenario's map as a ``carla.Map``."""
        import carla

        return carla.Map("scenario", self.opendrive)

    def _begin(self, view: View) -> None:
        self._roads = view.world.roads
        agent = self._kind("127.0.0.1", 0)
        weakref.finalize(self, agent.destroy)
        agent.setup(os.environ.get(CONFIG, ""))
        specs = agent.sensors()
        self._sensors = AgentSensors(specs, lambda: self.opendrive)
        for spec in specs:
            agent.sensor_interface.register_sensor(spec["id"], spec["type"], spec)
        agent.set_global_plan(*plan_of(view, self.road_map if self._roads.num_lanes else None))
        self._agent = agent


def opendrive_of(roads: Roads | None) -> str:
    """Return the lanes of a map as OpenDRIVE: their centres, mean widths, links and limits, but no neighbours."""
    builder = MapBuilder()
    if roads is not None:
        for row, line in enumerate(roads.lanes):
            outline = roads.polygons[row].astype(np.float64)
            length = np.hypot(*np.diff(line, axis=0).T).sum()
            x, y = outline.T
            area = abs(x @ np.roll(y, 1) - y @ np.roll(x, 1)) / 2.0
            half = min(max(area / max(length, 1e-3), _NARROWEST), _WIDEST) / 2.0
            builder.add(
                str(row), MapFeatureType(roads.lane_type[row]), polyline=line, width=(half, half),
                speed_limit=float(roads.speed_limit[row]), exit_lanes=[str(other) for other in roads.successors[row]],
            )  # fmt: skip
    return write_features(builder.build(np.zeros(3)), "scenario", Losses()).decode()


def plan_of(view: View, road_map: Any) -> tuple[list[Any], list[Any]]:
    """Return the route in degrees and in CARLA's world, each point with its ``RoadOption``.

    Junctions are those of the map; a route turns there if it changes its heading by 30 degrees.
    """
    import carla
    from agents.navigation.local_planner import RoadOption

    route = view.route
    points, headings = route.centreline.tolist(), np.unwrap(route.heading)
    places = [carla.Location(x, -y, 0.0) for x, y in points]
    waypoints = [road_map and road_map.get_waypoint(place) for place in places]
    options = []
    for is_junction, group in groupby(range(len(points)), lambda k: bool(waypoints[k] and waypoints[k].is_junction)):
        rows = list(group)
        turned = headings[rows[-1]] - headings[rows[0]]
        option = RoadOption.LANEFOLLOW
        if is_junction:
            option = (
                RoadOption.STRAIGHT if abs(turned) < _TURN else RoadOption.LEFT if turned > 0.0 else RoadOption.RIGHT
            )
        options += [option] * len(rows)
    degrees = [dict(zip(("lat", "lon"), degrees_of(x, y), strict=True)) | {"z": 0.0} for x, y in points]
    turns = [carla.Rotation(yaw=-math.degrees(heading)) for heading in headings.tolist()]
    transforms = map(carla.Transform, places, turns)
    return list(zip(degrees, options, strict=True)), list(zip(transforms, options, strict=True))


def action_of(control: Any, speed: float) -> Action:
    """Return a ``carla.VehicleControl`` as an action of a vehicle at a speed [m/s].

    Steering is the same angle of the front wheels, within what the vehicle can; the brake goes before the throttle.
    There is no reverse gear: a throttle backwards brakes.

    Raises:
        BadParameter: It is no such control, or a number is not finite.
    """
    try:
        steer, throttle, brake = float(control.steer), float(control.throttle), float(control.brake)
        is_held = bool(control.hand_brake) or (bool(control.reverse) and throttle > 0.0)
    except (AttributeError, TypeError) as error:
        raise BadParameter(f"the agent returned {control!r}; expected a carla.VehicleControl") from error
    if not np.isfinite([steer, throttle, brake]).all():
        raise BadParameter(
            f"the agent returned steer {steer}, throttle {throttle}, brake {brake}; expected finite numbers"
        )
    share = float(np.interp(3.6 * abs(speed), *_STEERING))
    steering = -min(max(steer, -1.0), 1.0) * share * _MAX_STEER / Drive().max_steer
    pull = -1.0 if is_held else -brake if brake > 0.0 else throttle
    return [min(max(steering, -1.0), 1.0), min(max(pull, -1.0), 1.0)]
