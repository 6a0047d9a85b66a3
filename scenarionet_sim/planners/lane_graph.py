"""A planner on the lane graph that simulates and scores proposals, like PDM-Closed.

Source of the idea and of its constants: Dauner et al., Parting with Misconceptions about Learning-based Vehicle
Motion Planning (CoRL 2023): proposals of lateral offsets and target speeds along the centreline, driven by the
Intelligent Driver Model, scored like a closed-loop benchmark against forecasts at constant velocity.
"""

from __future__ import annotations

import numpy as np

from scenarionet_data.arrays.dtypes import Bool, Float64
from scenarionet_data.arrays.geometry import box_corners, wrap_angle
from scenarionet_sim.planners.base import Planner, Trajectory
from scenarionet_sim.planners.following import STEP, IdmPlanner, desired_speed
from scenarionet_sim.planners.view import View
from scenarionet_sim.planners.way import Obstacles, Way

_EVERY = 2  # simulated poses per scored one
_SOON = 0.9  # [s] within which moving on must not end in a collision
_EMERGENCY, _EMERGENCY_TIME = 5.0, 3.0  # [m/s²] of braking where every proposal collides within so many seconds


class LaneGraphPlanner(Planner):
    """Drives the best of some proposals: offsets from the route, each at 5 shares of the desired speed."""

    offsets = (0.0,)
    """[m] to the left of the route. PDM-Closed has (-1, 0, 1): on recordings that passes waiting cars too closely."""
    shares = (0.2, 0.4, 0.6, 0.8, 1.0)
    """Of the desired speed."""
    speed = 12.0
    """Desired speed where no limit is known [m/s]."""
    progress_weight, collision_weight, comfort_weight = 5.0, 5.0, 2.0
    """Weights of progress, of time to collision and of comfort in the score."""
    lateral_acceleration = 1.8
    """Largest in bends [m/s²]; at 3 m/s² nuPlan's tracker leaves the lane by more than a metre after them."""

    def __init__(self) -> None:
        self._driver = IdmPlanner()

    def act(self, view: View) -> Trajectory:
        """Return the best proposal; of equally good ones the first, which is the fastest in the middle.

        Where all end in a collision, that in which it is last; if it is within 3 s, the vehicle brakes.
        """
        way = Way.ahead(view)
        offset, share = (each.ravel() for each in np.meshgrid(sorted(self.offsets, key=abs), self.shares[::-1]))
        desired = share * min(desired_speed(view, self.speed), way.speed_for_bends(self.lateral_acceleration, 1.5))
        arcs, speeds = self._simulate(view, way, Obstacles.on(way, view), offset, desired)
        time = STEP * np.arange(1, arcs.shape[1] + 1)
        lateral = offset[:, None] + (way.lateral - offset[:, None]) * np.exp(-time)
        poses = way.along(arcs, lateral)
        scores, until_hit = self._scores(view, poses, arcs, speeds)
        is_safe = bool(np.isinf(until_hit).any())
        best = int(np.argmax(scores if is_safe else until_hit))
        chosen = arcs[best]
        if until_hit[best] < _EMERGENCY_TIME:
            speed = max(view.ego.speed, 0.0)
            braking = np.minimum(time, speed / _EMERGENCY)  # [s] until it stands
            chosen = speed * braking - 0.5 * _EMERGENCY * braking**2
        middle = way.pose(np.append(0.0, chosen), float(offset[best]))  # the tracker leads there
        return Trajectory(middle, np.append(0.0, time))

    def _simulate(
        self, view: View, way: Way, obstacles: Obstacles, offset: Float64, desired: Float64
    ) -> tuple[Float64, Float64]:
        """Drive all B proposals at once; distances along the way (B, T) [m] and speeds (B, T) [m/s]."""
        width = 0.5 * view.ego.width + obstacles.half_width
        is_ahead = obstacles.arc > 0.0
        at_goal = np.abs(obstacles.lateral - offset[:, None]) < width
        at_start = np.abs(obstacles.lateral - way.lateral) < width
        blocks = is_ahead & (at_goal | at_start)
        gap = np.where(blocks, obstacles.arc - obstacles.half_length - 0.5 * view.ego.length, np.inf)
        first = np.argmin(gap, axis=1) if gap.shape[1] else np.zeros(len(offset), np.intp)
        room = gap[np.arange(len(offset)), first] if gap.shape[1] else np.full(len(offset), np.inf)
        leading = obstacles.speed[first] if gap.shape[1] else np.zeros(len(offset))
        return self._driver.drive(np.full(len(offset), max(view.ego.speed, 0.0)), desired, room, leading)

    def _scores(self, view: View, poses: Float64, arcs: Float64, speeds: Float64) -> tuple[Float64, Float64]:
        """Scores (B,) of proposals with poses (B, T, 3), and times (B,) until they collide [s]: infinite if never."""
        seen = poses[:, _EVERY - 1 :: _EVERY]
        time = STEP * _EVERY * np.arange(1, seen.shape[1] + 1)
        hits = _hits(view, seen, time)
        until_hit = np.where(hits, time, np.inf).min(axis=1)
        forward = np.stack([np.cos(seen[..., 2]), np.sin(seen[..., 2])], axis=-1)
        moved = seen.copy()
        moved[..., :2] += _SOON * speeds[:, _EVERY - 1 :: _EVERY, None] * forward
        is_soon = _hits(view, moved, time + _SOON).any(axis=1)
        corners = box_corners(seen[..., :2], seen[..., 2], np.array(view.ego.length), np.array(view.ego.width))
        is_off = ~view.lanes.is_on_road(corners).all(axis=(1, 2)) if len(view.lanes) else np.zeros(len(poses), np.bool_)
        progress = arcs[:, -1] / max(float(arcs[:, -1].max()), 1.0)
        jerk = np.abs(np.diff(speeds, n=2, axis=1)).max(axis=1) / STEP**2
        weights = self.progress_weight + self.collision_weight + self.comfort_weight
        soft = self.progress_weight * progress + self.collision_weight * ~is_soon + self.comfort_weight * (jerk < 8.37)
        return np.where(np.isinf(until_hit), np.where(is_off, 0.1, 1.0), 0.0) * soft / weights, until_hit


def _hits(view: View, poses: Float64, time: Float64) -> Bool:
    """Where (B, T) boxes (B, T, 3) overlap an object that moves on at its velocity; not one from behind."""
    seen, ego = view.objects, view.ego
    near = np.hypot(*(seen.position - [ego.x, ego.y]).T) < 80.0
    place = seen.position[near, None] + seen.velocity[near, None] * time[:, None]
    size, angle = 0.5 * seen.size[near, :2], seen.heading[near]
    apart = place - poses[:, None, :, :2]  # (B, N, T, 2)
    own = poses[:, None, :, 2]
    turn = wrap_angle(angle[:, None] - own)
    cos, sin = np.abs(np.cos(turn)), np.abs(np.sin(turn))
    length, width = size[:, 0, None], size[:, 1, None]
    half = 0.5 * ego.length, 0.5 * ego.width
    x = np.cos(own) * apart[..., 0] + np.sin(own) * apart[..., 1]
    y = np.cos(own) * apart[..., 1] - np.sin(own) * apart[..., 0]
    overlap = (np.abs(x) < half[0] + cos * length + sin * width) & (np.abs(y) < half[1] + sin * length + cos * width)
    other = angle[:, None]
    u = np.cos(other) * apart[..., 0] + np.sin(other) * apart[..., 1]
    v = np.cos(other) * apart[..., 1] - np.sin(other) * apart[..., 0]
    overlap &= (np.abs(u) < length + cos * half[0] + sin * half[1]) & (
        np.abs(v) < width + sin * half[0] + cos * half[1]
    )
    from_behind = x < -half[0]
    return np.asarray((overlap & ~from_behind).any(axis=1))
