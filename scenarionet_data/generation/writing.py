"""Write scenarios of generated traffic into the lake, shard by shard, as a conversion does.

A scenario has the map of its parent, the recorded scenario around whose ego vehicles are placed, and nothing else.
"""

from __future__ import annotations

from scenarionet_data.generation.driving import DrivenVehicles, drive, place  # first: says how to install torch

# isort: split
import dataclasses
import hashlib
import re
from collections.abc import Iterator
from dataclasses import dataclass, field
from functools import lru_cache
from typing import Any, ClassVar

import numpy as np
import torch

from scenarionet_data.arrays.dtypes import is_count
from scenarionet_data.arrays.geometry import rotate
from scenarionet_data.building import make_tracks
from scenarionet_data.conversion.committer import ConversionReport
from scenarionet_data.converters.base import Budgets
from scenarionet_data.errors import BadParameter, InvalidScenario
from scenarionet_data.execution.executors import Executor, executor_for
from scenarionet_data.execution.progress import Progress
from scenarionet_data.generation.snapshots import make_scenes
from scenarionet_data.generation.traffic_model import TrafficModel
from scenarionet_data.generation.training import load
from scenarionet_data.ingest.shard import RawItem, Shard, bucket
from scenarionet_data.learning.fitting import weights_digest
from scenarionet_data.query.lake_view import LakeLike, open_view
from scenarionet_data.scenario.description import Lights, ScenarioDescription, make_scenario_id
from scenarionet_data.scenario.vocabulary import ObjectType
from scenarionet_data.variations.writing import OfParents, ParentOptions, write_shards

DATASET = "generated"
"""The dataset of all generated scenarios in a lake; its versions are their names."""

HISTORY = 1.0
"""Time before the current timestep [s]."""

_HEIGHT = 1.6  # of every vehicle [m]; the model knows none
_FEWEST = 8  # vehicles that are placed, where the parent shows fewer


@dataclass(frozen=True)
class GenerationOptions(ParentOptions):
    """What generated scenarios depend on beside their parents and numbers.

    Attributes:
        model, weights: Training run of the model, and the hash of its weights.
        seed: Seed of the draws.
        vehicles: Vehicles at the start; 0 for as many as the parent shows, at least 8.
        duration: Length of a scenario [s].
    """

    model: str = field(default="", metadata={"doc": "training run of the model"})
    weights: str = field(default="", metadata={"doc": "hash of its weights"})
    seed: int = field(default=0, metadata={"doc": "seed of the draws"})
    vehicles: int = field(default=0, metadata={"doc": "vehicles at the start; 0: as many as the parent shows"})
    duration: float = field(default=20.0, metadata={"doc": "length of a scenario [s]"})


@dataclass(frozen=True)
class GenerationChoice:
    """Which scenarios are generated.

    Attributes:
        number: Scenarios for each of the database.
        seed: Seed of the draws.
        vehicles: Vehicles at the start; 0 for as many as are recorded within the crop, at least 8.
        duration: Length of a scenario [s]; it may be longer than the recording.

    Raises:
        BadParameter: A number or the duration is wrong.
    """

    number: int = 1
    seed: int = 0
    vehicles: int = 0
    duration: float = 20.0

    def __post_init__(self) -> None:
        if not (is_count(self.number, 1) and is_count(self.vehicles)):
            found = f"number={self.number!r}, vehicles={self.vehicles!r}"
            raise BadParameter(f"{found}: wanted whole numbers, of 1 or more and of 0 or more")
        if not HISTORY < self.duration < np.inf:
            raise BadParameter(f"duration={self.duration!r}: wanted more than {HISTORY:g} s, which are the history")


class Generated(OfParents):
    """Scenarios of generated traffic; :func:`generate` lists its shards."""

    name: ClassVar[str] = DATASET
    version: ClassVar[str] = "1"
    release: ClassVar[str] = "g"
    licence: ClassVar[str] = "that of the scenario whose map it has, see the column licence"
    raw: ClassVar[str] = "scenarios of the lake"
    Options = GenerationOptions
    budgets: ClassVar[Budgets] = Budgets()

    def records(self, shard: Shard) -> Iterator[Any]:
        """Yield each item with its parent and the moment in which vehicles are placed."""
        view, config = open_view(shard.options_as(GenerationOptions).lake), _model(shard).config
        parents = sorted({item.name.rpartition("@")[0] for item in shard.items})
        samples = config.samples(view, parents, moments=False)
        number_of = {samples.key(number).scenario_id: number for number in range(len(samples))}
        for parent, item in super().records(shard):
            number, now = number_of.get(parent.id), parent.current_timestep
            where = (parent.ego_index, now)
            pose = (*parent.tracks.position[where][:2].tolist(), float(parent.tracks.heading[where]))
            scene = None if number is None else make_scenes(samples.batch([number]), config)
            yield parent, item, scene, pose

    def scenario(self, shard: Shard, record: Any) -> ScenarioDescription:
        """Place vehicles, move them, and put them on the map of the parent."""
        (parent, item, scene, pose), options, model = record, shard.options_as(GenerationOptions), _model(shard)
        if scene is None or not scene.lane_ok.any():
            raise InvalidScenario(
                parent.id, "map", "wanted lanes around the ego, on which vehicles are placed; found none"
            )
        key = f"{options.seed} {item.name}".encode()
        generator = torch.Generator().manual_seed(int.from_bytes(hashlib.blake2b(key, digest_size=7).digest(), "big"))
        recorded = int((scene.cell >= 0).sum())
        number = options.vehicles or max(recorded, _FEWEST)
        nobody = torch.zeros_like(scene.car_ok)
        placed = place(model, scene, nobody, torch.tensor([number]), generator)
        cars = placed.cars[0][placed.ok[0]]
        if not len(cars):
            raise InvalidScenario(
                parent.id, "map", "wanted lanes within the crop around the ego; no vehicle could be placed"
            )
        dt = model.config.dt
        traffic = drive(model, scene, cars, round(options.duration / dt), generator)
        return _on_map(parent, traffic, pose, dt, shard, item, {
            "model": options.model, "weights": options.weights, "seed": options.seed, "placed": len(cars),
            "wanted": number, "touched": placed.touched,
        })  # fmt: skip


def generate(
    lake: LakeLike,
    database: str,
    model: str,
    choice: GenerationChoice | None = None,
    *,
    name: str,
    replace: bool = False,
    executor: Executor | None = None,
    on_progress: Progress | None = None,
) -> ConversionReport:
    """Make scenarios on the maps of a database and store them in the lake, as version ``name`` of ``generated``.

    Each keeps the split and the log of its parent; ``extras`` has ``parent`` and ``generated``: the model, the hash of
    its weights, and the seed. Run again after an interruption, only what is missing is made.

    Args:
        lake: The lake.
        database: Database whose scenarios give maps, places and numbers of vehicles.
        model: Training run of the model.
        choice: How many scenarios, of which length.
        name: Name of the generated scenarios.
        replace: Replace scenarios of that name that were made otherwise.
        executor: Runs the shards, by default in this process.
        on_progress: Called before the first shard and after each one.

    Raises:
        BadParameter: The name is wrong.
        LakeError: The model cannot be loaded, see :func:`.training.load`.
        ScenarioNotFound: The lake does not have a scenario.
        DuplicateScenario: There are scenarios of that name that were made otherwise.
    """
    if not re.fullmatch(r"[A-Za-z0-9._-]+", name):
        raise BadParameter(f"name {name!r}: use letters, digits, '.', '_' and '-'")
    choice, (view, rows) = choice or GenerationChoice(), open_view(lake).find(database)
    options = GenerationOptions(
        lake=str(view.files.root), model=model, weights=weights_digest(load(view, model)), seed=choice.seed,
        vehicles=choice.vehicles, duration=choice.duration,
    )  # fmt: skip
    items: dict[str, list[RawItem]] = {}
    for row in rows.columns(["scenario_id", "split"]).to_pylist():
        parent = row["scenario_id"]
        items.setdefault(row["split"], []).extend(
            RawItem(f"{parent}@{k:06d}", str(choice.seed)) for k in range(choice.number)
        )
    shards = [
        Shard(DATASET, name, split, f"traffic-{part}", "", of_part, options)
        for split, of_split in items.items()
        for part, of_part in bucket(of_split).items()
    ]
    run = executor or executor_for(1, len(shards))
    return write_shards(view.files, Generated, shards, f"generate {name}", run, on_progress, replace=replace)


@lru_cache(maxsize=2)
def _loaded(lake: str, run: str, weights: str) -> TrafficModel:
    torch.set_num_threads(1)
    model = load(open_view(lake), run)
    if weights_digest(model) != weights:
        raise BadParameter(f"run {run}: its weights have changed since this generation began; start it again")
    return model


def _model(shard: Shard) -> TrafficModel:
    options = shard.options_as(GenerationOptions)
    return _loaded(options.lake, options.model, options.weights)


def _on_map(
    parent: ScenarioDescription,
    traffic: DrivenVehicles,
    pose: tuple[float, float, float],
    dt: float,
    shard: Shard,
    item: RawItem,
    made: dict[str, Any],
) -> ScenarioDescription:
    """Return the parent with other vehicles; the ego is the one that stays longest of those there now."""
    x, y, turn = pose
    states, valid = traffic.states.astype(np.float64), traffic.valid
    steps, now = valid.shape[1], round(HISTORY / dt)
    heading = states[..., 2] + turn
    position = np.zeros((*valid.shape, 3))
    position[..., :2] = rotate(states[..., :2], turn) + np.array([x, y])
    position[..., 2] = parent.tracks.position[parent.ego_index, parent.current_timestep, 2]
    velocity = states[..., 3:] * np.stack([np.cos(heading), np.sin(heading)], axis=-1)
    stays = np.where(valid[:, now], valid.sum(axis=1), 0)
    if not stays.any():
        raise InvalidScenario(parent.id, "ego_id", f"wanted a vehicle that is there after {HISTORY:g} s, found none")
    names = [f"g{k}" for k in range(len(valid))]
    size = np.column_stack([traffic.size, np.full(len(valid), _HEIGHT)])
    tracks = make_tracks(
        names, [ObjectType.VEHICLE] * len(valid), position, heading, velocity, size, valid, origin=np.zeros(3)
    )
    return dataclasses.replace(
        parent.with_own_map(),
        id=make_scenario_id(DATASET, shard.version, parent.id, item.name.rpartition("@")[2]),
        dataset=DATASET,
        version=shard.version,
        split=shard.split,
        timestamps=np.arange(steps, dtype=np.float64) * dt,
        dt=dt,
        current_timestep=now,
        ego_id=names[int(stays.argmax())],
        tracks=tracks,
        lights=Lights.empty(steps),
        objects_of_interest=(),
        tracks_to_predict=(),
        extras={"parent": parent.id, "generated": made},
    )
