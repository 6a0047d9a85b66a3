"""Runs of other simulators: what they did with exported scenarios, measured as a run of the lake.

Their output is converted as any recording is (``scenarionet convert sumo``, ``commonroad``, ``table`` ...) into a lake
of its own. The motion in each of its scenarios then takes the place of the recording in the scenario that was
exported, is replayed, and measured against the recording.
"""

from __future__ import annotations

import hashlib
import re
import time
from collections.abc import Iterator
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import numpy as np

from scenarionet_data import Lake, ScenarioDescription, ScenarioLoader, Tracks, resample, version
from scenarionet_data.arrays.dtypes import Array, IntP
from scenarionet_data.errors import BadParameter
from scenarionet_data.execution.progress import Progress
from scenarionet_data.interchange.files import stem_of
from scenarionet_data.storage import evaluation_runs
from scenarionet_sim.drivers.by_name import find_backend, resolve_drivers
from scenarionet_sim.evaluation.specification import PART_SIZE, RULE
from scenarionet_sim.metrics.measure import measure
from scenarionet_sim.rollouts.batch import RolloutBatch, RolloutJob
from scenarionet_sim.rollouts.parts import Part, parts_of
from scenarionet_sim.rollouts.span import EPISODES
from scenarionet_sim.rollouts.table import concat_rollouts, rollout_rows
from scenarionet_sim.worlds.world import STEP, World

_FARTHEST = 20.0
"""Distance [m] of the ego's first position from the recorded one, above which the frames are not the same."""


@dataclass
class AddedRun:
    """Result of adding a run.

    Attributes:
        run: Name of the run.
        scenarios: Number of scenarios that were measured.
        unknown_scenarios: Scenarios of the other simulator that the lake does not have.
        unknown_objects: Number of objects that their recordings do not have; they are left out.
        broken: Scenario id and reason of those that could not be measured.
        seconds: Wall time.
    """

    run: str
    scenarios: int = 0
    unknown_scenarios: list[str] = field(default_factory=list)
    unknown_objects: int = 0
    broken: list[tuple[str, str]] = field(default_factory=list)
    seconds: float = 0.0


@dataclass(frozen=True, eq=False)
class _Played:
    """A scenario as another simulator played it."""

    world: World
    played: World
    start: int
    num_steps: int
    unknown_objects: int


def add_run(
    lake: Lake | str | Path, output: Lake | str | Path, name: str, *, episode: str = "log",
    on_progress: Progress | None = None,
) -> AddedRun:  # fmt: skip
    """Store what another simulator did with scenarios of a lake as a run of the lake.

    Scenarios belong together by their ids, or the name of the file (``stem_of`` the exported scenario, then anything
    after a dot); objects by their ids. Objects that the output does not have move as recorded. An
    ego that ends before its recording does stands where it was last.

    Args:
        lake: The lake whose scenarios were exported.
        output: Lake with the converted output of the other simulator.
        name: Name of the run.
        episode: ``log`` or ``nuplan``, see ``rollouts.span.EPISODES``.
        on_progress: Called after each part of 32 scenarios.

    Raises:
        BadParameter: No scenario of the output is one of the lake, the episode is unknown, or a run of that name is
            another.
        LakeError: A lake cannot be read.
    """
    started = time.monotonic()
    lake, output = (each if isinstance(each, Lake) else Lake(each) for each in (lake, output))
    if episode not in EPISODES:
        raise BadParameter(f"unknown episode {episode!r}; choose from {', '.join(EPISODES)}")
    pairs, unknown = _pairs(lake, output)
    if not pairs:
        found = ", ".join(unknown[:3]) or "it has no scenarios"
        raise BadParameter(
            f"{output.root}: no scenario is one of {lake.root} ({found}); name each file after the exported scenario, "
            "its id with -- for each slash, as `scenarionet export` does"
        )
    ids, played = [pair[0] for pair in pairs], [pair[1] for pair in pairs]
    description = {
        "policy": "added", "traffic": "added", "episode": episode, "rule": RULE, "part": PART_SIZE,
        "software": version.name_and_version(), "output": _digest(output, played),
    }  # fmt: skip
    run = evaluation_runs.claim(lake.files, name, ("rollouts", "results"), description)
    report = AddedRun(name, len(pairs), unknown)
    loaders = ScenarioLoader(lake, ids), ScenarioLoader(output, played)
    done, parts = run.done() - run.failed(), parts_of(len(pairs), PART_SIZE)
    for number, part in enumerate(parts, 1):
        if part.number not in done:
            run.publish(part.number, _rows(loaders, part, episode, report))
        if on_progress is not None:
            on_progress(number, len(parts), part.end)
    report.seconds = time.monotonic() - started
    return report


def _pairs(lake: Lake, output: Lake) -> tuple[list[tuple[str, str]], list[str]]:
    """Ids in both lakes of the scenarios that belong together, ordered by the first; ids in the output of others."""
    stems = {stem_of(each): each for each in lake.sql("SELECT scenario_id FROM metadata")["scenario_id"]}
    pairs, unknown = dict[str, str](), []
    sources = output.sql("SELECT scenario_id, source_scenario_id, source_file FROM metadata ORDER BY scenario_id")
    for scenario_id, source_id, file in sources.iter_rows():
        words = Path(file or "").name.split(".")
        heads = [".".join(words[:count]) for count in range(len(words), 0, -1)]
        found = [stems[head] for head in (*map(stem_of, (scenario_id, source_id or "")), *heads) if head in stems]
        if not found:
            unknown.append(scenario_id)
        elif found[0] in pairs:
            raise BadParameter(
                f"{pairs[found[0]]} and {scenario_id} are both {found[0]}; add one output of each scenario, or convert "
                "with windows as long as the scenario"
            )
        else:
            pairs[found[0]] = scenario_id
    return sorted(pairs.items()), unknown


def _digest(output: Lake, ids: list[str]) -> str:
    """Digest of the content of scenarios."""
    hashes = output.sql(
        "SELECT content_hash FROM metadata WHERE list_contains($ids, scenario_id) ORDER BY scenario_id", {"ids": ids}
    )
    return hashlib.sha256(" ".join(map(str, hashes["content_hash"])).encode()).hexdigest()


def _rows(loaders: tuple[ScenarioLoader, ScenarioLoader], part: Part, episode: str, report: AddedRun) -> dict[str, Any]:
    """Rows of ``results`` and ``rollouts`` of a part, without the column run."""
    span, ids = EPISODES[episode], loaders[0].scenario_ids
    results: dict[int, dict[str, Any]] = {}
    rollouts, played_by = {}, dict[int, _Played]()

    def fail(index: int, error: Exception) -> None:
        results[index] = {"scenario_id": ids[index], "rollout": 0, "error": f"{type(error).__name__}: {error}"}
        report.broken.append((ids[index], str(error)))

    def jobs() -> Iterator[RolloutJob]:
        for index in range(part.first, part.end):
            try:
                found = played_by[index] = _play(loaders[0][index], loaders[1][index], episode)
            except MemoryError:
                raise
            except Exception as error:  # one scenario must not end the others
                fail(index, error)
                continue
            report.unknown_objects += found.unknown_objects
            yield RolloutJob(index, found.played, (0, index, 0), found.start, found.num_steps, span.waits)

    batch = RolloutBatch(resolve_drivers("replay"), find_backend("kinematic"))
    for job, rollout in batch.run(jobs()):
        if isinstance(rollout, Exception):
            fail(job.number, rollout)
            continue
        world = played_by.pop(job.number).world
        row = {"track_id": world.track_ids[rollout.agent], "is_reactive": None}
        results[job.number] = {"scenario_id": ids[job.number], "rollout": 0} | row | measure(rollout, world)
        rollouts[job.number] = rollout_rows(rollout, world)
    return {
        "results": [results[index] for index in sorted(results)],
        "rollouts": concat_rollouts([rollouts[index] for index in sorted(rollouts)]),
    }


def _play(scenario: ScenarioDescription, output: ScenarioDescription, episode: str) -> _Played:
    """Put the motion of another simulator in place of the recording."""
    span, recorded, output = EPISODES[episode], resample(scenario, STEP), resample(output, STEP)
    world = World.from_scenario(recorded)
    rows, others, unknown = _same_objects(recorded, output)
    shift = output.origin - recorded.origin
    start = span.start(scenario, world)
    ego, count = recorded.ego_index, max(len(recorded.timestamps), len(output.timestamps))
    own = others[rows == ego]
    if not len(own) or not output.tracks.valid[own[0]].any():
        raise BadParameter(f"the output has no motion of the ego, {recorded.ego_id!r}; it has {_named(output.tracks)}")
    first = int(np.argmax(output.tracks.valid[own[0]]))
    apart = output.tracks.position[own[0], first, :2] + shift[:2]
    apart = apart - recorded.tracks.position[ego, min(max(first, start), world.num_steps - 1), :2]
    if np.hypot(*apart) > _FARTHEST:
        raise BadParameter(
            f"the ego begins {np.hypot(*apart):.1f} m from where it was recorded then: the output is in another "
            "frame, or begins at another time; expected the frame of the source, and 0 s at the first timestep"
        )
    tracks = _replaced(recorded.tracks, output.tracks, rows, others, shift, count)
    _stand_at_end(tracks, ego, int(np.flatnonzero(world.log_valid[:, ego])[-1]))
    lights = replace(recorded.lights, state=_extended(recorded.lights.state, count))
    moved = replace(recorded, timestamps=np.arange(count, dtype=np.float64) * STEP, tracks=tracks, lights=lights)
    played = replace(World.from_scenario(moved), paths=world.paths, stops=world.stops, size=world.size)
    return _Played(world, played, start, span.num_steps(world, start), unknown)


def _same_objects(recorded: ScenarioDescription, output: ScenarioDescription) -> tuple[IntP, IntP, int]:
    """Rows of objects in a recording and in an output that belong together, and the number of others in the output.

    Formats replace characters that they do not allow by ``_``. An ego without its id is the ego of the output.
    """
    names = {re.sub(r"[^A-Za-z0-9._-]", "_", str(name)): row for row, name in enumerate(recorded.tracks.ids)}
    names |= {str(name): row for row, name in enumerate(recorded.tracks.ids)}
    found = [names.get(str(name), -1) for name in output.tracks.ids]
    if recorded.ego_index not in found:
        found[output.ego_index] = recorded.ego_index
    rows = np.array(found, np.intp)
    return rows[rows >= 0], np.flatnonzero(rows >= 0), int((rows < 0).sum())


def _replaced(tracks: Tracks, others: Tracks, rows: IntP, by: IntP, shift: Array, count: int) -> Tracks:
    """Tracks of ``count`` timesteps in which objects move as others do."""
    arrays = {
        name: _extended(getattr(tracks, name), count, fill=0)
        for name in ("position", "heading", "velocity", "size", "valid", "is_interpolated")
    }
    steps = others.valid.shape[1]
    for name, values in arrays.items():
        if name == "size":
            continue
        values[rows] = 0
        values[rows, :steps] = getattr(others, name)[by]
    is_seen = arrays["valid"][rows]
    arrays["position"][rows] += np.where(is_seen[..., None], shift, 0.0).astype(np.float32)
    return replace(tracks, **arrays)


def _extended(values: Array, count: int, fill: int | None = None) -> Array:
    """Copy values (N, T, ...) for ``count`` timesteps: zeros, or the last ones again, after the end."""
    more = np.repeat(values[:, -1:], count - values.shape[1], axis=1)
    if fill is not None:
        more[:] = fill
    return np.concatenate([values, more], axis=1)


def _stand_at_end(tracks: Tracks, ego: int, last: int) -> None:
    """Let the ego stand where it was last until its recording ends; its velocity is 0 there already."""
    end = int(np.flatnonzero(tracks.valid[ego])[-1])
    if end < last:
        tracks.valid[ego, end + 1 : last + 1] = True
        for values in (tracks.position, tracks.heading):
            values[ego, end + 1 : last + 1] = values[ego, end]


def _named(tracks: Tracks) -> str:
    """A few ids for a message."""
    return ", ".join(map(str, tracks.ids[:5])) + (" ..." if len(tracks.ids) > 5 else "")
