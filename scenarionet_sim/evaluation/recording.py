"""What vehicles observe along the log: states without actions, for imitation, as rows of ``schemas/observations.toml``.

Every object replays its recording; at each of its timesteps every vehicle that is there (or the ego) observes.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import asdict, dataclass, replace
from functools import cache
from typing import Any

import numpy as np
import pyarrow as pa

from scenarionet_data import Lake, ScenarioLoader, version
from scenarionet_data.arrays.dtypes import Int32
from scenarionet_data.codec.arrow import list_array, offsets_of, string_array
from scenarionet_data.errors import BadParameter
from scenarionet_data.execution.executors import Executor
from scenarionet_data.execution.progress import Progress
from scenarionet_data.schema import tables
from scenarionet_data.storage import evaluation_runs
from scenarionet_data.storage.files.opening import open_files
from scenarionet_sim.environments.config import PAPER_OBSERVATION
from scenarionet_sim.environments.observation import Observation
from scenarionet_sim.evaluation.parts import Part, do_parts, parts_of
from scenarionet_sim.kernels.paths import follow_paths
from scenarionet_sim.policies import Replay, ego, vehicles
from scenarionet_sim.simulation import LOOK_AHEAD, LOOK_BACK, Simulation
from scenarionet_sim.worlds.world import World

PART = 8
"""Scenarios of a part; a vehicle's observation is half a kilobyte, and there are thousands in a scenario."""

AGENTS = {"vehicles": vehicles, "ego": ego}


@dataclass(frozen=True)
class Recording:
    """What is recorded; picklable.

    Attributes:
        lake: The lake's folder.
        database: ``name@version``; None for the whole lake.
        snapshot: Number of the snapshot of the lake.
        agents: ``vehicles`` or ``ego``.
        seed: Of the sensors' noise.
    """

    lake: str
    database: str | None
    snapshot: int
    agents: str = "vehicles"
    seed: int = 0

    @property
    def description(self) -> dict[str, Any]:
        """All that the observations depend on."""
        spec = {name: value for name, value in asdict(self).items() if name != "lake"}
        sensors = [repr(sensor) for sensor in PAPER_OBSERVATION]
        return spec | {"part": PART, "sensors": sensors, "software": version.name_and_version()}


@dataclass(frozen=True)
class _Job:
    recording: Recording
    part: Part
    run: evaluation_runs.Run


def prepare(lake: Lake, database: str | None, agents: str = "vehicles", seed: int = 0) -> Recording:
    """A recording of what a lake holds.

    Raises:
        DatabaseNotFound: There is no such database.
        BadParameter: ``agents`` is no name in AGENTS.
    """
    if agents not in AGENTS:
        raise BadParameter(f"no agents {agents!r}; there are {', '.join(AGENTS)}")
    reference = None if database is None else lake.database(database).reference
    return Recording(str(lake.root), reference, lake.snapshot.number, agents, seed)


def record(
    recording: Recording,
    name: str,
    *,
    workers: int = 1,
    executor: Executor | None = None,
    on_progress: Progress | None = None,
) -> int:
    """Write the observations that are not there yet into the lake.

    Args:
        recording: What.
        name: Of the run.
        workers: Processes.
        executor: Does the parts in place of the processes, for example a cluster.
        on_progress: Told about every finished part.

    Returns:
        Scenarios that were done before.

    Raises:
        BadParameter: A run of that name is there and is another one.
        LakeError: A scenario cannot be read.
        WorkerLost: A part kills its worker, also when it runs alone; finished parts are kept.
    """
    run = evaluation_runs.claim(open_files(recording.lake), name, ("observations",), recording.description)
    parts, done = parts_of(len(_scenarios(recording)), PART), run.done()
    jobs = [_Job(recording, part, run) for part in parts if part.number not in done]
    for _ in do_parts(jobs, record_part, workers, on_progress, executor):
        pass
    return sum(len(part) for part in parts if part.number in done)


@cache
def _scenarios(recording: Recording) -> ScenarioLoader:
    """Scenarios of a recording: looked up once a process."""
    return ScenarioLoader(Lake(recording.lake, recording.snapshot), recording.database)


# --- on a worker --------------------------------------------------------------------------------------


def record_part(job: _Job) -> list[str]:
    """Observe in a part's scenarios and publish the rows; returns the scenarios' ids."""
    recording, loader = job.recording, _scenarios(job.recording)
    observation = Observation(PAPER_OBSERVATION, "flat")
    numbers = range(job.part.first, job.part.end)
    found = [
        rows
        for index in numbers
        for rows in observe_log(
            World.from_scenario(loader[index]),
            observation,
            recording.agents,
            np.random.default_rng([recording.seed, index]),
        )
    ]
    schema = tables.load("observations").schema
    empty = schema.remove(schema.get_field_index("run")).empty_table()
    job.run.publish(job.part.number, {"observations": pa.concat_tables([empty, *found])})
    return [loader.scenario_ids[index] for index in numbers]


def observe_log(world: World, observation: Observation, agents: str, rng: np.random.Generator) -> Iterator[pa.Table]:
    """Rows of ``schemas/observations.toml`` without the column run, timestep by timestep.

    Args:
        world: The scenario.
        observation: How agents observe.
        agents: A name in AGENTS.
        rng: Noise of the sensors.
    """
    simulation, wanted = Simulation([world], (Replay(),)), AGENTS[agents](world)
    simulation.reset(0, start=0)
    stage = simulation.stage
    paths = stage.path_points, stage.path_arc, stage.path_heading, stage.path_z, stage.path_offsets
    arc, lateral, height = np.full((1, len(wanted)), np.nan), np.zeros((1, len(wanted))), np.zeros((1, len(wanted)))
    for timestep in range(world.num_steps):  # each moment comes out of the one before
        if timestep:
            simulation.step()
        state = simulation.state
        rows: Int32 = np.argwhere(state.present & wanted).astype(np.int32, order="C")
        follow_paths(rows, state.position, *paths, LOOK_BACK, LOOK_AHEAD, arc, lateral, height)
        if len(rows):
            seen = observation.of(stage, replace(state, arc=arc, lateral=lateral), rows, rng)
            yield _rows(world, timestep, rows[:, 1], seen)
    simulation.close()


def _rows(world: World, timestep: int, rows: Int32, seen: Any) -> pa.Table:
    count = len(rows)
    columns = {
        "scenario_id": pa.array([world.scenario_id] * count, pa.string()),
        "track_id": string_array(world.track_ids[rows]),
        "timestep": pa.array(np.full(count, timestep, np.int32)),
        "observation": list_array(offsets_of(np.full(count, seen.shape[1])), seen.ravel()),
    }
    schema = tables.load("observations").schema
    return pa.table(columns, schema=schema.remove(schema.get_field_index("run")))
