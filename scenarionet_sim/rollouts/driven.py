"""Scenarios as a run drove them: its motion in place of the recording, or the evaluated vehicle beside it."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import overload

import numpy as np
import polars as pl

from scenarionet_data import Lake, ScenarioDescription, ScenarioLoader, Tracks, resample
from scenarionet_data.arrays.dtypes import Bool, Float32
from scenarionet_sim.render.rollouts import read_rollout
from scenarionet_sim.worlds.world import STEP


@dataclass(frozen=True)
class DrivenScenarios(Sequence[ScenarioDescription]):
    """The scenarios of a loader as a run drove them (its first rollout), at the simulator's timestep of 0.1 s.

    Attributes:
        scenarios: The recordings.
        lake: Path or URL of the lake with the run.
        run: Name of the run.
        beside: Keep the recording, and add the evaluated vehicle as the track ``RUN:ID``.
    """

    scenarios: ScenarioLoader
    lake: str
    run: str
    beside: bool = False

    @property
    def scenario_ids(self) -> list[str]:
        """Ids of the scenarios with the name of the run, which tell exports apart."""
        return [f"{scenario_id} {self.run} {self.beside}" for scenario_id in self.scenarios.scenario_ids]

    def __len__(self) -> int:
        return len(self.scenarios)

    @overload
    def __getitem__(self, index: int) -> ScenarioDescription: ...
    @overload
    def __getitem__(self, index: slice) -> list[ScenarioDescription]: ...
    def __getitem__(self, index: int | slice) -> ScenarioDescription | list[ScenarioDescription]:
        """Return a scenario.

        Raises:
            BadParameter: The run has not simulated it, or without trajectories.
        """
        if isinstance(index, slice):
            return [self[each] for each in range(*index.indices(len(self)))]
        scenario = resample(self.scenarios[index], STEP)
        rows = read_rollout(Lake(self.lake), self.run, scenario.id)
        if self.beside:
            judged = rows.filter(pl.col("is_judged"))
            added = _driven(scenario.tracks, judged)
            row = scenario.tracks.index(judged["track_id"][0])
            ghost = added.take([row])
            names = np.array([f"{self.run}:{name}" for name in ghost.ids], object)
            return replace(scenario, tracks=_joined(scenario.tracks, replace(ghost, ids=names)))
        return replace(scenario, tracks=_driven(scenario.tracks, rows))


def _driven(tracks: Tracks, rows: pl.DataFrame) -> Tracks:
    """The tracks with the motion of a run from its first moment on; objects that it did not move are as recorded."""
    position, heading, velocity = tracks.position.copy(), tracks.heading.copy(), tracks.velocity.copy()
    size, valid, interpolated = tracks.size.copy(), tracks.valid.copy(), tracks.is_interpolated.copy()
    first = int(rows["start"][0])
    for name, x, y, turned, vx, vy, present in rows.drop("is_judged", "start").iter_rows():
        row = tracks.index(name)
        count = min(len(x), valid.shape[1] - first)
        steps, seen = slice(first, first + count), np.ones(count, np.bool_)
        if present is not None:
            seen = np.array(present[:count], np.bool_)
        height, box = (
            _nearest(tracks.position[row, :, 2], tracks.valid[row]),
            _nearest(tracks.size[row], tracks.valid[row]),
        )
        motion = np.array([x, y, turned, vx, vy], np.float32)[:, :count] * seen
        position[row, steps, :2], position[row, steps, 2] = motion[:2].T, height[steps] * seen
        heading[row, steps], velocity[row, steps] = (motion[2] + np.pi) % (2 * np.pi) - np.pi, motion[3:].T
        size[row, steps], valid[row, steps] = box[steps] * seen[:, None], seen
        valid[row, steps.stop :] = False
        interpolated[row, first:] = False
        for values in (position, heading, velocity, size):
            values[row, steps.stop :] = 0.0
        heading[row, steps] *= seen
    return replace(
        tracks, position=position, heading=heading, velocity=velocity, size=size, valid=valid,
        is_interpolated=interpolated,
    )  # fmt: skip


def _nearest(values: Float32, valid: Bool) -> Float32:
    """Values (T, ...) with those of the nearest valid timestep where there are none."""
    known = np.flatnonzero(valid)
    steps = np.arange(len(values))
    after = known[np.minimum(np.searchsorted(known, steps), len(known) - 1)]
    before = known[np.maximum(np.searchsorted(known, steps, side="right") - 1, 0)]
    filled: Float32 = values[np.where(np.abs(after - steps) < np.abs(steps - before), after, before)]
    return filled


def _joined(tracks: Tracks, others: Tracks) -> Tracks:
    fields = Tracks.__dataclass_fields__
    return Tracks(**{name: np.concatenate([getattr(tracks, name), getattr(others, name)]) for name in fields})
