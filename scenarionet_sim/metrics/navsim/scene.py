"""What plans are scored against: objects, roads, the route and red lights over the horizon of a plan."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from scenarionet_data.arrays.dtypes import Bool, Float64
from scenarionet_data.scenario.vocabulary import LIGHT_COLORS, LightColor, MapFeatureType
from scenarionet_sim.metrics.drive import EgoDrive, SurroundingBoxes
from scenarionet_sim.metrics.lane_links import LaneLinks
from scenarionet_sim.metrics.lanes import lanes_of
from scenarionet_sim.roads.roads import Roads
from scenarionet_sim.worlds.world import World


@dataclass(frozen=True, eq=False)
class PlanScene:
    """Surroundings of a plan of T poses.

    Attributes:
        others: Boxes over the T moments; objects follow the recording.
        roads: The map.
        centreline: (K, 2) points along the route [m].
        route: (M,) whether each lane is on the route.
        is_red: (T, M) whether each lane has a red light.
    """

    others: SurroundingBoxes
    roads: Roads
    centreline: Float64
    route: Bool
    is_red: Bool

    @classmethod
    def of(cls, world: World, others: SurroundingBoxes, start: int, recorded: EgoDrive) -> PlanScene:
        """Return the scene of a recording; its route are the lanes that the ego drives.

        Args:
            world: The scenario.
            others: Boxes of the other objects, a moment every timestep.
            start: First timestep of the plan.
            recorded: The whole recorded drive, of which the lanes are the route.
        """
        roads, count = world.roads, len(others.position)
        driven = lanes_of(recorded.drives, roads.once(LaneLinks.of))[:, 0]
        order = list(dict.fromkeys(driven[driven >= 0].tolist()))
        lines = [roads.lanes[lane].astype(np.float64) for lane in order if len(roads.lanes[lane]) > 1]
        steps = np.minimum(start + np.arange(count), world.num_steps - 1)
        is_red = np.zeros((count, roads.num_lanes), np.bool_)
        for lane, states in zip(world.light_lane.tolist(), world.light_state, strict=True):
            if lane >= 0:
                is_red[:, lane] |= LIGHT_COLORS[states[steps]] == LightColor.RED
        return cls(
            others,
            roads,
            np.concatenate(lines) if lines else recorded.position,
            np.isin(np.arange(roads.num_lanes), order),
            is_red,
        )


@dataclass(frozen=True, eq=False)
class PlanAreas:
    """Where a plan drives, at each of T poses.

    Attributes:
        is_between_lanes: (T,) several lanes contain a corner, and none contains all.
        is_off_road: (T,) a corner is in no drivable polygon.
        is_off_route: (T,) the centre is in no lane of the route.
        is_crossing: (T,) the centre is in an intersection.
        rear_is_crossing: (T,) the rear axle is in an intersection.
    """

    is_between_lanes: Bool
    is_off_road: Bool
    is_off_route: Bool
    is_crossing: Bool
    rear_is_crossing: Bool

    @classmethod
    def of(cls, plan: EgoDrive, scene: PlanScene) -> PlanAreas:
        """Find the areas of a plan."""
        roads = scene.roads
        corners = roads.lanes_around(plan.corners)  # (T, 4, M)
        has_corner, has_all = np.any(corners, axis=1), np.all(corners, axis=1)
        centre = roads.lanes_around(plan.position)
        crossing = roads.polygon_type == MapFeatureType.INTERSECTION
        return cls(
            is_between_lanes=(has_corner.sum(axis=1) > 1) & ~np.any(has_all, axis=1),
            is_off_road=np.any(~roads.is_on_road(plan.corners), axis=1),
            is_off_route=np.all(~(centre & scene.route), axis=1),
            is_crossing=roads.is_in(plan.position, crossing),
            rear_is_crossing=roads.is_in(plan.rear_axle, crossing),
        )
