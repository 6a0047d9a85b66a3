"""The samples of a selection of scenarios: which scenarios fit, at which timesteps, for which targets."""

from __future__ import annotations

import warnings
from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np
import pyarrow as pa
import pyarrow.compute as pc

from scenarionet_data.arrays.dtypes import Array, Bool, Float64, Int32, Int64
from scenarionet_data.query.lake_view import LakeView
from scenarionet_data.samples.choices import Choices, Targets, TimeWindow
from scenarionet_data.storage.read.metadata_rows import MetadataRows

_COLUMNS = ("num_timesteps", "dt", "timestamps", "current_timestep", "ego_id", "tracks_to_predict", "map_id")

_SPANS = """
SELECT scenario_id, track_id, t.start, len(t.x)::INTEGER AS num_steps, t.valid
FROM ({chosen}) JOIN tracks AS t USING (scenario_id, track_id)
ORDER BY scenario_id, t.track_index
"""


class SamplesWarning(UserWarning):
    """Scenarios that give no samples, or interpolated ones."""


@dataclass(frozen=True, eq=False)
class Selection:
    """Samples by number.

    Attributes:
        scene: (n,) int32 scenario of each sample.
        moment: (n,) int32 recorded timestep that is the current one.
        first_target, num_targets: (n,) of ``target_ids``.
        target_ids: Ids of targets, strings.
        target_bounds: (scenarios + 1,) int64 first target of each scenario.
        findings: Number of scenarios and an example by what is wrong with them.
    """

    scene: Int32
    moment: Int32
    first_target: Int64
    num_targets: Int32
    target_ids: pa.Array
    target_bounds: Int64
    findings: Mapping[str, tuple[int, str]]

    def __len__(self) -> int:
        return len(self.scene)

    def targets(self, sample: int) -> tuple[str, ...]:
        """Ids of a sample's targets."""
        first = int(self.first_target[sample])
        return tuple(self.target_ids[first : first + int(self.num_targets[sample])].to_pylist())


def select(view: LakeView, rows: MetadataRows, choices: Choices) -> Selection:
    """Find the samples of scenarios; warn once of scenarios without any.

    Args:
        view: The lake.
        rows: The scenarios.
        choices: Time, map, targets and perspective.
    """
    table = rows.columns(_COLUMNS)
    times = _Times(table)
    scene, moment = times.moments(choices.window)
    moved = np.zeros(len(rows), np.bool_)
    if choices.window.stride is None:
        moved[scene] = moment != times.current[scene]
    unnamed = table["tracks_to_predict"].combine_chunks().value_lengths().to_numpy(zero_copy_only=False) == 0
    unnamed &= choices.targets.which == "default"
    are_current = choices.window.stride is None and not moved.any()
    targets = _targets(view, rows, table, choices.targets, are_current=are_current and not unnamed.any())
    lacks_map = table["map_id"].is_null().to_numpy() if choices.polylines.count else np.zeros(len(rows), np.bool_)
    is_kept = ~lacks_map[scene] & (targets.counts[scene] > 0)
    scene_now, moment_now = scene[is_kept], moment[is_kept]
    if choices.perspective == "scene":
        first, counts = targets.first[scene_now], targets.counts[scene_now]
    else:
        scene_now, moment_now, first = targets.at(scene_now, moment_now)
        counts = np.ones(len(first), np.int32)
    too_short, without = np.ones((2, len(rows)), np.bool_)
    too_short[scene], without[scene_now] = False, False
    findings = _findings(
        rows,
        {
            "too short for the window": too_short,
            "without a map": lacks_map & ~too_short,
            "without targets": without & ~too_short & ~lacks_map,
            "whose own timestep leaves no room for the window, at their first one that does": moved & ~without,
            "that name no targets, with their moving road users": unnamed & ~without,
            f"of another timestep than {choices.window.dt:g} s, which are interpolated": (
                np.abs(times.dt - choices.window.dt) > 0.05 * choices.window.dt
            ),
        },
    )
    bounds = np.append(targets.first, len(targets.ids))
    return Selection(scene_now, moment_now, first, counts, targets.ids, bounds, findings)


@dataclass(frozen=True, eq=False)
class _TargetLists:
    """Targets of scenarios, one after the other.

    Attributes:
        first: (S,) int64 first target of each scenario.
        counts: (S,) int32 number of its targets.
        ids: Ids of all targets.
        spans: Columns start, num_steps and valid of all targets; None if they need not be compared with moments.
    """

    first: Int64
    counts: Int32
    ids: pa.Array
    spans: pa.Table | None

    def at(self, scene: Int32, moment: Int32) -> tuple[Int32, Int32, Int64]:
        """Scenario, moment and target of each sample, of targets that are seen at the moments of their scenarios."""
        each = self.counts[scene]
        rank = np.arange(each.sum()) - np.repeat(np.cumsum(each) - each, each)
        scene, moment = np.repeat(scene, each), np.repeat(moment, each)
        target = self.first[scene] + rank
        is_seen = self._are_seen(target, moment)
        return scene[is_seen], moment[is_seen], target[is_seen]

    def _are_seen(self, target: Int64, moment: Int32) -> Bool:
        if self.spans is None:
            return np.ones(len(target), np.bool_)
        place = moment - self.spans["start"].to_numpy()[target]
        is_inside: Bool = (place >= 0) & (place < self.spans["num_steps"].to_numpy()[target])
        flags = self.spans["valid"].combine_chunks()
        is_listed = is_inside & flags.is_valid().to_numpy(zero_copy_only=False)[target]
        values = flags.values.to_numpy(zero_copy_only=False)
        is_inside[is_listed] = values[(flags.offsets.to_numpy()[target] + place)[is_listed]]
        return is_inside


class _Times:
    """Recorded times of scenarios, from their metadata."""

    def __init__(self, table: pa.Table) -> None:
        self.dt: Float64 = table["dt"].to_numpy()
        self._steps: Int64 = table["num_timesteps"].to_numpy().astype(np.int64)
        self.current: Int64 = table["current_timestep"].to_numpy().astype(np.int64)
        listed = table["timestamps"].combine_chunks()
        self._is_regular: Bool = listed.is_null().to_numpy(zero_copy_only=False)
        self._starts = listed.offsets.to_numpy()
        self._recorded = np.append(listed.values.to_numpy(), 0.0)

    def _at(self, step: Int64) -> Float64:
        """Time of one timestep of each scenario [s]."""
        places = np.minimum(self._starts[:-1] + step, len(self._recorded) - 1)
        found: Float64 = np.where(self._is_regular, step * self.dt, self._recorded[places])
        return found

    def moments(self, window: TimeWindow) -> tuple[Int32, Int32]:
        """Scenario and current timestep of each window that is recorded; a state holds for half a timestep."""
        slack = 0.5 * window.dt
        if window.stride is None:
            now, end = self._at(self.current), self._at(self._steps - 1)
            fits = (now >= window.history - slack) & (end - now >= window.future - slack)
            chosen = self.current.copy()
            for scene in np.flatnonzero(~fits & (end >= window.history + window.future - 2 * slack)).tolist():
                earliest = self._strided(scene, replace(window, stride=float(end[scene])), slack)[:1]
                if len(earliest):
                    chosen[scene], fits[scene] = earliest[0], True
            scenes = np.flatnonzero(fits)
            return scenes.astype(np.int32), chosen[scenes].astype(np.int32)
        found = [self._strided(scene, window, slack) for scene in range(len(self._steps))]
        counts = [len(moments) for moments in found]
        moments = np.concatenate(found) if found else np.zeros(0)
        return np.repeat(np.arange(len(counts)), counts).astype(np.int32), moments.astype(np.int32)

    def _strided(self, scene: int, window: TimeWindow, slack: float) -> Array:
        count, first = int(self._steps[scene]), self._starts[scene]
        regular = np.arange(count) * self.dt[scene]
        times = regular if self._is_regular[scene] else self._recorded[first : first + count]
        earliest, latest = window.history - slack, times[-1] - window.future + slack
        begin = times[min(int(np.searchsorted(times, earliest)), count - 1)]
        wanted = np.arange(begin, latest + slack, window.stride)
        moments: Array = np.unique(np.searchsorted(times, wanted - slack))
        moments = moments[moments < count]
        found: Array = moments[(times[moments] >= earliest) & (times[moments] <= latest)]
        return found


def _targets(
    view: LakeView, rows: MetadataRows, table: pa.Table, targets: Targets, *, are_current: bool
) -> _TargetLists:
    """Find targets. Those that the metadata names are seen at the scenario's own current timestep."""
    spans = None
    if are_current and targets.which == "ego":
        counts, ids = np.ones(len(rows), np.int64), table["ego_id"].combine_chunks()
    elif are_current and targets.which in ("default", "recorded"):
        listed = table["tracks_to_predict"].combine_chunks()
        counts, ids = listed.value_lengths().to_numpy().astype(np.int64), listed.flatten()
    else:
        found = view.restrict_to(rows.ids.to_pylist()).arrow(_SPANS.format(chosen=_chosen(targets)))
        scene = pc.index_in(found["scenario_id"], value_set=rows.ids).to_numpy()
        spans = found.take(pa.array(np.argsort(scene, kind="stable")))
        counts, ids = np.bincount(scene, minlength=len(rows)), spans["track_id"].combine_chunks()
    limited = counts if targets.limit is None else np.minimum(counts, targets.limit)
    return _TargetLists(np.cumsum(counts) - counts, limited.astype(np.int32), ids, spans)


def _chosen(targets: Targets) -> str:
    """SQL for the chosen objects."""
    if targets.which == "ego":
        return "SELECT scenario_id, ego_id AS track_id FROM metadata"
    objects = f"SELECT scenario_id, track_id FROM objects WHERE ({targets.condition}\n)"
    if targets.which not in ("default", "recorded"):
        return objects
    named = "SELECT scenario_id, unnest(tracks_to_predict) AS track_id FROM metadata"
    if targets.which == "recorded":
        return named
    unnamed = "SELECT scenario_id FROM metadata WHERE coalesce(len(tracks_to_predict), 0) = 0"
    return f"{named} UNION ALL {objects} AND scenario_id IN ({unnamed})"


def _findings(rows: MetadataRows, affected: Mapping[str, Bool]) -> dict[str, tuple[int, str]]:
    """Count scenarios by what is wrong with them, and warn once."""
    found = {
        what: (int(mask.sum()), rows.ids[int(np.argmax(mask))].as_py()) for what, mask in affected.items() if mask.any()
    }
    if found:
        text = "; ".join(f"{count:,} {what}, for example {example}" for what, (count, example) in found.items())
        warnings.warn(SamplesWarning(f"of {len(rows):,} scenarios: {text}"), stacklevel=4)
    return found
