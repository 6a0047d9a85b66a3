"""Episodes whose metrics are computed together: those on one map, in arrays."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np

from scenarionet_data.arrays.dtypes import Array, Float32, Float64, Int32
from scenarionet_data.compiled.decorators import kernel
from scenarionet_sim.arrays.log import HEADING, VALID, X, Y
from scenarionet_sim.metrics.comfort import accelerate
from scenarionet_sim.metrics.drive import AXLES, DrivenEpisode, Drives, MovingBoxes, place_box_at
from scenarionet_sim.metrics.lane_links import LaneLinks
from scenarionet_sim.metrics.lanes import DrivenLanes, lanes_of
from scenarionet_sim.roads.roads import Roads

MeasuredColumns = dict[str, Sequence[Any] | Array | None]
"""Values of B episodes by name; None for none."""


def known(value: Any) -> Any:
    """Return a value, or None for a number that is not finite."""
    return None if isinstance(value, float) and not math.isfinite(value) else value


def rows_of(columns: MeasuredColumns, count: int) -> list[dict[str, Any]]:
    """Return values by episode: None for numbers that are not finite."""
    values = []
    for column in columns.values():
        listed = [None] * count if column is None else column.tolist() if isinstance(column, np.ndarray) else column
        if not (isinstance(column, np.ndarray) and column.dtype == np.float64 and np.isfinite(column).all()):
            listed = [known(each) for each in listed]
        values.append(listed)
    return [dict(zip(columns, row, strict=True)) for row in zip(*values, strict=True)]


@dataclass(frozen=True, eq=False)
class DrivenEpisodes:
    """Whole episodes on one map, in arrays.

    Attributes:
        episodes: B of them.
        drives: The scored drives.
        recorded: The recordings over the same time; without speeds and accelerations.
        boxes: All objects.
    """

    episodes: Sequence[DrivenEpisode]
    drives: Drives
    recorded: Drives
    boxes: MovingBoxes

    @cached_property
    def roads(self) -> Roads:
        """The map."""
        return self.episodes[0].world.roads

    @cached_property
    def lanes(self) -> DrivenLanes | None:
        """Lanes of the drives; None without a map of them."""
        return DrivenLanes.of(self.drives, self.roads) if self.roads.num_lanes else None

    @cached_property
    def recorded_lanes(self) -> Int32:
        """Lanes of the recordings, see ``DrivenLanes.lanes``."""
        return lanes_of(self.recorded, self.roads.once(LaneLinks.of))

    @classmethod
    def of(cls, episodes: Sequence[DrivenEpisode]) -> DrivenEpisodes:
        """Put episodes together."""
        rollouts, worlds = [each.rollout for each in episodes], [each.world for each in episodes]
        counts = np.array([each.present.shape[1] for each in rollouts])
        agents = np.array([each.agent for each in rollouts])
        objects, rows = np.append(0, np.cumsum(counts)), np.array([each.present.size for each in rollouts])
        boxes = MovingBoxes(
            first=np.append(0, np.cumsum(rows))[:-1],
            counts=counts,
            agents=agents,
            first_size=objects[:-1],
            position=np.concatenate([each.position.reshape(-1, 2) for each in rollouts]),
            velocity=np.concatenate([each.velocity.reshape(-1, 2) for each in rollouts]),
            heading=np.concatenate([each.heading.ravel() for each in rollouts]),
            present=np.concatenate([each.present.ravel() for each in rollouts]),
            size=np.concatenate([each.size[:, :2] for each in worlds], dtype=np.float64),
        )
        size = boxes.size[objects[:-1] + agents]
        box, steps = np.column_stack([size, 0.5 * AXLES * size[:, 0]]), [each.dt for each in worlds]
        drives = Drives.room(np.array([each.num_moments for each in episodes]), steps, box)
        velocity = np.empty((len(drives.heading), 2))
        take_drives(boxes, np.array(steps), drives, velocity)
        np.hypot(velocity[:, 0], velocity[:, 1], out=drives.speed)
        logs = [
            world.log[rollout.start : rollout.start + rollout.num_scored + 1, rollout.agent]
            for world, rollout in zip(worlds, rollouts, strict=True)
        ]
        log = np.concatenate(logs)
        is_valid = log[:, VALID] != 0
        ends = np.cumsum(np.array([len(each) for each in logs]))
        known = np.append(0, np.cumsum(is_valid))[np.append(0, ends)]
        recorded = Drives.room(np.diff(known), steps, box)
        take_logs(log[is_valid], recorded)
        return cls(episodes, drives, recorded, boxes)


@kernel(allocates=False)
def take_drives(boxes: MovingBoxes, dt: Float64, drives: Drives, velocity: Float64) -> None:
    """Write the drives of the evaluated vehicles, but for their speeds, and their velocities (S, 2)."""
    for b in range(len(dt)):
        begin, end = drives.offsets[b], drives.offsets[b + 1]
        box = drives.box[b, 0], drives.box[b, 1], drives.box[b, 2]
        row = boxes.first[b] + boxes.agents[b]
        for t in range(begin, end):
            x, y, heading = boxes.position[row, 0], boxes.position[row, 1], boxes.heading[row]
            drives.centre[t, 0, 0], drives.centre[t, 0, 1], drives.heading[t] = x, y, heading
            velocity[t, 0], velocity[t, 1] = boxes.velocity[row, 0], boxes.velocity[row, 1]
            place_box_at(x, y, heading, box, drives.corners[t], drives.axle[t])
            row += boxes.counts[b]
        accelerate(velocity[begin:end], drives.heading[begin:end], dt[b], drives.acceleration[begin:end])


@kernel(allocates=False)
def take_logs(log: Float32, recorded: Drives) -> None:
    """Write the recordings (S, 8) of vehicles, but for their speeds and accelerations."""
    for b in range(len(recorded.dt)):
        box = recorded.box[b, 0], recorded.box[b, 1], recorded.box[b, 2]
        for t in range(recorded.offsets[b], recorded.offsets[b + 1]):
            x, y, heading = np.float64(log[t, X]), np.float64(log[t, Y]), np.float64(log[t, HEADING])
            recorded.centre[t, 0, 0], recorded.centre[t, 0, 1], recorded.heading[t] = x, y, heading
            place_box_at(x, y, heading, box, recorded.corners[t], recorded.axle[t])
