"""Planners that keep their lane and speed and brake by a safety model: drivers with known limits."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from scenarionet_data.scenario.vocabulary import ObjectType
from scenarionet_sim.planners.base import Planner, Trajectory
from scenarionet_sim.planners.safety_models import Ahead, CarefulHuman, FuzzySafety, Rss, SafetyModel, covers
from scenarionet_sim.planners.view import View
from scenarionet_sim.planners.way import Way

_USERS = (ObjectType.VEHICLE, ObjectType.PEDESTRIAN, ObjectType.CYCLIST)


class SafetyPlanner(Planner):
    """Drives along its route at the speed with which it begins, and brakes by a model; returns trajectories."""

    frame = "ego"
    make_model: Callable[[], SafetyModel]
    lane_width = 3.5
    """[m]"""

    def __init__(self) -> None:
        self._model = self.make_model()
        self._speeds: dict[str, float] = {}

    def act(self, view: View) -> Trajectory:
        """Return a trajectory along the route, at the speed that the model wants at the end of the step."""
        way, speed, dt = Way.ahead(view), max(view.ego.speed, 0.0), view.dt
        acceleration = self._model.step(speed, self.users_ahead(way, view, speed), dt)
        times = np.asarray(dt * np.arange(1, 11), np.float64)
        then = max(speed + acceleration * dt, 0.0)
        return Trajectory(way.pose(np.asarray(then * times, np.float64)), times)

    def users_ahead(self, way: Way, view: View, speed: float) -> list[Ahead]:
        """What is ahead of the ego, in the frame of the way."""
        seen, found = view.objects, []
        arcs, laterals = way.locate(seen.position)
        turns = seen.heading - np.interp(arcs, way.arc, way.heading)
        along = np.interp(arcs, way.arc, way.heading)
        speeds = np.cos(along) * seen.velocity[:, 0] + np.sin(along) * seen.velocity[:, 1]
        aside = np.cos(along) * seen.velocity[:, 1] - np.sin(along) * seen.velocity[:, 0]
        cos, sin = np.abs(np.cos(turns)), np.abs(np.sin(turns))
        half_x = 0.5 * (cos * seen.size[:, 0] + sin * seen.size[:, 1])
        half_y = 0.5 * (sin * seen.size[:, 0] + cos * seen.size[:, 1])
        last, self._speeds = self._speeds, dict(zip(seen.track_ids, speeds.tolist(), strict=True))
        for k in np.flatnonzero(np.isin(seen.object_type, _USERS) & (arcs > 0.0) & (arcs < self._model.range)).tolist():
            lateral, own, name = float(laterals[k]) - way.lateral, 0.5 * view.ego.width, str(seen.track_ids[k])
            lane = round(float(laterals[k]) / self.lane_width) - round(way.lateral / self.lane_width)
            found.append(
                Ahead(
                    name,
                    bool(seen.object_type[k] == ObjectType.PEDESTRIAN),
                    max(float(arcs[k] - half_x[k]) - 0.5 * view.ego.length, 0.0),
                    max(abs(lateral) - float(half_y[k]) - own, 0.0),
                    lane,
                    lateral,
                    float(laterals[k]) - self.lane_width * round(float(laterals[k]) / self.lane_width),
                    float(speeds[k]),
                    speed - float(speeds[k]),
                    -float(np.copysign(1.0, lateral) * aside[k]),
                    (float(speeds[k]) - last.get(name, float(speeds[k]))) / view.dt,
                    covers(lateral, float(half_y[k]), own),
                )
            )
        return found


class CarefulHumanPlanner(SafetyPlanner):
    """The competent and careful human driver of UN Regulation 157."""

    make_model = CarefulHuman


class FuzzySafetyPlanner(SafetyPlanner):
    """The fuzzy safety model."""

    make_model = FuzzySafety


class RssPlanner(SafetyPlanner):
    """Responsibility-sensitive safety."""

    make_model = Rss
