"""Record what vehicles observe along the log: states without actions, for imitation learning.

Every object replays its recording; at each timestep every present vehicle (or the ego) observes. Rows are those of
``schemas/observations.toml``, and of ``schemas/frames.toml`` for cameras.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import asdict, dataclass, replace
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow as pa

from scenarionet_data import Database, Lake, ScenarioLoader, version
from scenarionet_data.arrays.columns import offsets_of
from scenarionet_data.arrays.dtypes import Int32
from scenarionet_data.codec.arrow import list_array, string_array
from scenarionet_data.errors import BadParameter
from scenarionet_data.execution.executors import Executor
from scenarionet_data.execution.progress import Progress
from scenarionet_data.schema import tables
from scenarionet_data.storage import evaluation_runs
from scenarionet_data.storage.files.places import open_files
from scenarionet_sim.environments.config import PAPER_OBSERVATION
from scenarionet_sim.environments.observation import Observation
from scenarionet_sim.evaluation.specification import describe_database
from scenarionet_sim.policies.objects import ego, vehicles
from scenarionet_sim.policies.replay import Replay
from scenarionet_sim.rollouts.parts import Part, parts_of, run_parts
from scenarionet_sim.scenarios.selection import resolved
from scenarionet_sim.sensors.camera import Camera
from scenarionet_sim.simulation.simulation import LOOK_AHEAD, LOOK_BACK, Simulation
from scenarionet_sim.worlds.path_kernels import follow_paths
from scenarionet_sim.worlds.world import World

PART_SIZE = 8
"""Scenarios per part: an observation takes half a kilobyte, and a scenario has thousands."""

AGENTS = {"vehicles": vehicles, "ego": ego}


@dataclass(frozen=True)
class ObservationPlan:
    """Specification of a recording of observations; picklable.

    Attributes:
        lake: Path or URL of the lake.
        database: ``name@version``, scenario ids, or None for the whole lake.
        snapshot: Number of the lake's snapshot.
        agents: ``vehicles`` or ``ego``.
        seed: Seed of the sensors' noise.
        cameras: Cameras on every agent.
    """

    lake: str
    database: str | tuple[str, ...] | None
    snapshot: int
    agents: str = "vehicles"
    seed: int = 0
    cameras: tuple[Camera, ...] = ()

    @property
    def description(self) -> dict[str, Any]:
        """Everything the observations depend on, as stored with the run."""
        spec = {name: value for name, value in asdict(self).items() if name not in ("lake", "cameras")}
        if self.cameras:
            spec["cameras"] = [repr(replace(camera, threads=1)) for camera in self.cameras]
        spec["database"] = describe_database(self.database)
        sensors = [repr(sensor) for sensor in PAPER_OBSERVATION]
        return spec | {"part": self.part_size, "sensors": sensors, "software": version.name_and_version()}

    @property
    def part_size(self) -> int:
        """Scenarios per part; pictures fill one."""
        return 1 if self.cameras else PART_SIZE

    @property
    def tables(self) -> tuple[str, ...]:
        """Tables that the run fills."""
        return ("observations", "frames") if self.cameras else ("observations",)


@dataclass(frozen=True)
class _RecordingJob:
    plan: ObservationPlan
    part: Part
    run: evaluation_runs.EvaluationRun


def record(
    lake: Lake | str | Path,
    database: Database | str | list[str] | tuple[str, ...] | None = None,
    *,
    name: str,
    agents: str = "vehicles",
    seed: int = 0,
    cameras: Sequence[Camera] = (),
    workers: int = 1,
    executor: Executor | None = None,
    on_progress: Progress | None = None,
) -> int:
    """Write the observations of recorded vehicles into the lake.

    A second call with the same arguments continues an interrupted run.

    Args:
        lake: The lake, its path or its URL.
        database: A ``Database``, its name, scenario ids, or None for the whole lake.
        name: Name of the run.
        agents: ``vehicles`` or ``ego``.
        seed: Seed of the sensors' noise.
        cameras: Cameras on every agent; their pictures are the table ``frames``. A picture takes its bytes before
            compression: 0.7 MB for rgb of 640 x 360.
        workers: Number of processes.
        executor: Runs the parts instead of local processes, for example on a cluster.
        on_progress: Called after each finished part.

    Returns:
        Number of scenarios that an earlier call had already recorded.

    Raises:
        DatabaseNotFound: The database does not exist.
        BadParameter: ``agents`` is unknown, or a run of that name has other parameters.
        LakeError: A scenario cannot be read.
        WorkerLost: A part kills its worker also when it runs alone; finished parts are kept.
    """
    if agents not in AGENTS:
        raise BadParameter(f"unknown agents {agents!r}; choose from {', '.join(AGENTS)}")
    if not isinstance(cameras, Sequence) or not all(isinstance(each, Camera) for each in cameras):
        raise BadParameter(
            f"cameras={cameras!r}; expected a tuple of cameras, such as (Camera(width=320, height=180),)"
        )
    lake, reference = resolved(lake, database)
    begun = None if reference is None else evaluation_runs.begun_at(lake.files, name)  # as in `run_evaluation`
    plan = ObservationPlan(str(lake.root), reference, begun or lake.snapshot.number, agents, seed, tuple(cameras))
    run = evaluation_runs.claim(open_files(plan.lake), name, plan.tables, plan.description)
    parts, done = parts_of(len(_loader(plan)), plan.part_size), run.done()
    jobs = [_RecordingJob(plan, part, run) for part in parts if part.number not in done]
    for _ in run_parts(jobs, record_part, workers, on_progress, executor):
        pass
    return sum(len(part) for part in parts if part.number in done)


@cache
def _loader(plan: ObservationPlan) -> ScenarioLoader:
    """Scenarios of a plan, resolved once per process."""
    return ScenarioLoader(Lake(plan.lake, plan.snapshot), plan.database)


# --- on a worker --------------------------------------------------------------------------------------


def record_part(job: _RecordingJob) -> list[str]:
    """Observe in the scenarios of a part and publish the rows; return their ids."""
    plan, loader = job.plan, _loader(job.plan)
    observation = Observation(PAPER_OBSERVATION, "flat")
    numbers = range(job.part.first, job.part.end)
    found = {name: [tables.load(name).schema.empty_table().drop_columns("run")] for name in plan.tables}
    for index in numbers:
        world, rng = World.from_scenario(loader[index]), np.random.default_rng([plan.seed, index])
        for rows in observe_log(world, observation, plan.agents, rng, plan.cameras):
            for name, content in rows.items():
                found[name].append(content)
    job.run.publish(job.part.number, {name: pa.concat_tables(rows) for name, rows in found.items()})
    return [loader.scenario_ids[index] for index in numbers]


def observe_log(
    world: World, observation: Observation, agents: str, rng: np.random.Generator, cameras: Sequence[Camera] = ()
) -> Iterator[dict[str, pa.Table]]:
    """Yield rows of ``observations`` and of ``frames``, without the column run, timestep by timestep.

    Args:
        world: The scenario.
        observation: Sensors of the agents.
        agents: A name in AGENTS.
        rng: Generator of the sensors' noise.
        cameras: Cameras on every agent.
    """
    simulation, is_agent = Simulation([world], (Replay(),)), AGENTS[agents](world)
    simulation.reset(0, start=0)
    batch = simulation.batch
    route = np.full((1, len(is_agent), 2), np.nan)
    for timestep in range(world.num_steps):  # each moment depends on the one before
        if timestep:
            simulation.step()
        state = simulation.state
        rows: Int32 = np.argwhere(state.present & is_agent).astype(np.int32, order="C")
        follow_paths(rows, state.motion, batch.recorded, LOOK_BACK, LOOK_AHEAD, route, False)
        if len(rows):
            seen = observation.of(batch, replace(state, route=route), rows, rng)
            count, schema = len(rows), tables.load("observations").schema
            columns = {
                "scenario_id": pa.array([world.scenario_id] * count, pa.string()),
                "track_id": string_array(world.track_ids[rows[:, 1]]),
                "timestep": pa.array(np.full(count, timestep, np.int32)),
                "observation": list_array(offsets_of(np.full(count, seen.shape[1])), seen.ravel()),
            }
            found = {"observations": pa.table(columns, schema=schema.remove(schema.get_field_index("run")))}
            if cameras:
                here = {"scenario_id": world.scenario_id, "timestep": timestep}
                frames = [
                    here | {
                        "track_id": track, "camera": number, "channel": channel, "height": picture.shape[0],
                        "width": picture.shape[1], "dtype": picture.dtype.name, "pixels": picture.tobytes(),
                    }
                    for number, camera in enumerate(cameras)
                    for channel, seen in camera.frames(batch, state, rows, rng).items()
                    for track, picture in zip(world.track_ids[rows[:, 1]].tolist(), seen, strict=True)
                ]  # fmt: skip
                schema = tables.load("frames").schema
                schema = schema.remove(schema.get_field_index("run"))
                found["frames"] = pa.Table.from_pylist(frames, schema=schema)
            yield found
    simulation.close()
