"""Write variations of a lake's scenarios into the lake, shard by shard, as a conversion does.

The values of a variation are the fingerprint of its item: the same values are the same scenario, not made twice.
"""

from __future__ import annotations

import dataclasses
import json
import re
import time
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass, field
from typing import Any, ClassVar

from scenarionet_data.conversion.committer import Committer, ConversionReport
from scenarionet_data.conversion.jobs import ShardJob, convert_shard, lost_shard
from scenarionet_data.conversion.plan import make_plan
from scenarionet_data.converters.base import Converter
from scenarionet_data.errors import BadParameter
from scenarionet_data.execution.executors import Executor, executor_for
from scenarionet_data.execution.progress import Progress
from scenarionet_data.ingest.options import Options
from scenarionet_data.ingest.shard import RawItem, Shard, bucket
from scenarionet_data.loader import ScenarioLoader
from scenarionet_data.query.lake_view import LakeLike, open_view
from scenarionet_data.scenario.description import ScenarioDescription, is_scenario_id, make_scenario_id
from scenarionet_data.scenario.settings import check_is
from scenarionet_data.storage.files.lake_files import LakeFiles
from scenarionet_data.storage.snapshots import manifests
from scenarionet_data.storage.snapshots import snapshot as snapshots
from scenarionet_data.variations.changes import find_track
from scenarionet_data.variations.drawing import VariationSpace, varied
from scenarionet_data.variations.limits import ACCELERATION, JERK
from scenarionet_data.variations.moment_windows import ALL, MOMENTS, MomentWindow, cut_out, read_windows
from scenarionet_data.variations.parameters import LIGHTS, ROAD, draw, parse_parameters

DATASET = "variation"
"""The dataset of all variations in a lake; its versions are their names."""

_MOMENT = "moment"  # in the fingerprint of an item, and in the extras of its scenario


@dataclass(frozen=True)
class ParentOptions(Options):
    """What scenarios that are made of others depend on.

    Attributes:
        lake: The lake of their parents.
    """

    lake: str = field(default="", metadata={"doc": "lake of the parents", "is_path": True})


@dataclass(frozen=True)
class VariationOptions(ParentOptions):
    """What variations depend on beside their values.

    Attributes:
        acceleration, jerk: Limits of changed road users.
        margin: Time kept around moments.
    """

    acceleration: float = field(default=ACCELERATION, metadata={"doc": "largest acceleration [m/s^2]"})
    jerk: float = field(default=JERK, metadata={"doc": "largest jerk [m/s^3]"})
    margin: float = field(default=ALL, metadata={"doc": "time kept around moments [s]"})


class OfParents(Converter[tuple[ScenarioDescription, RawItem]]):
    """Scenarios that are made of others of a lake: items are ``PARENT@KEY``, options have the ``lake``."""

    def shards(self, raw: str, split: str, version: str, options: ParentOptions) -> Iterable[Shard]:  # noqa: ARG002
        """Raise: what is made is listed by a function of its own.

        Raises:
            BadParameter: Always.
        """
        raise BadParameter(f"scenarios of the dataset {self.name} are made from a lake, not converted")

    def records(self, shard: Shard) -> Iterator[tuple[ScenarioDescription, RawItem]]:
        """Yield each item with its parent, which is loaded once."""
        parents = [item.name.rpartition("@")[0] for item in shard.items]
        loader = ScenarioLoader(shard.options_as(ParentOptions).lake, sorted(set(parents)))
        loaded: ScenarioDescription | None = None
        for parent, item in sorted(zip(parents, shard.items, strict=True), key=lambda pair: pair[1].name):
            if loaded is None or loaded.id != parent:
                loaded = loader[loader.scenario_ids.index(parent)]
            yield loaded, item


class Variations(OfParents):
    """Scenarios of a lake with other values; :func:`vary` lists its shards."""

    name: ClassVar[str] = DATASET
    version: ClassVar[str] = "1"
    release: ClassVar[str] = "v"
    licence: ClassVar[str] = "that of the varied scenario, see the column licence"
    raw: ClassVar[str] = "scenarios of the lake"
    Options = VariationOptions

    def scenario(self, shard: Shard, record: tuple[ScenarioDescription, RawItem]) -> ScenarioDescription:
        """Change the parent and check the result."""
        (parent, item), options = record, shard.options_as(VariationOptions)
        values: dict[str, Any] = json.loads(item.fingerprint)
        moments: dict[str, Any] = {}
        roles: Mapping[str, str] = {}
        if _MOMENT in values:
            moments[_MOMENT] = values.pop(_MOMENT)
            moment = MomentWindow(**moments[_MOMENT])
            parent, roles = cut_out(parent, moment, options.margin), moment.roles
        changed = varied(parent, values, roles, options)
        return dataclasses.replace(
            changed.with_own_map(),
            id=make_scenario_id(DATASET, shard.version, parent.id, item.name.rpartition("@")[2]),
            dataset=DATASET,
            version=shard.version,
            split=shard.split,
            extras={**changed.extras, **moments},
        )


def vary(
    lake: LakeLike,
    parents: str | Iterable[str],
    space: VariationSpace,
    *,
    name: str,
    replace: bool = False,
    workers: int = 1,
    executor: Executor | None = None,
    on_progress: Progress | None = None,
) -> ConversionReport:
    """Make variations of scenarios and store them in the lake, as version ``name`` of the dataset ``variation``.

    Each keeps the split and the log of its parent; ``extras`` has ``parent`` and ``parameters``. What is not plausible
    goes to quarantine with the reason. Run again after an interruption, only what is missing is made.

    Args:
        lake: The lake.
        parents: Scenarios to vary: an id, several, the name of a database, or ``moments:NAME`` for each of the moments
            kept under a name, whose objects are the targets ``actor`` and ``other``.
        space: What is varied, how often, and within which limits.
        name: Name of the variations.
        replace: Replace variations of that name with other values.
        workers: Number of processes.
        executor: Runs the shards instead.
        on_progress: Called before the first shard and after each one.

    Raises:
        BadParameter: A name, number or method is wrong.
        InvalidScenario: The only scenario has no such road user.
        ScenarioNotFound: The lake does not have a scenario.
        DuplicateScenario: There are variations of that name with other values.
    """
    if not isinstance(space, VariationSpace):
        raise BadParameter(f"space: wanted VariationSpace({{'ego.speed': (0.8, 1.2)}}), found {space!r}")
    check_is("name", name, str, "a text")
    if not re.fullmatch(r"[A-Za-z0-9._-]+", name):
        raise BadParameter(f"name {name!r}: use letters, digits, '.', '_' and '-'")
    parameters = parse_parameters(space.parameters)
    windows: dict[str, list[MomentWindow]] = {}
    view = open_view(lake)
    if isinstance(parents, str) and parents.startswith(MOMENTS):
        windows = read_windows(view, parents.removeprefix(MOMENTS))
        parents = list(windows)
    elif isinstance(parents, str) and is_scenario_id(parents):
        parents = [parents]
    view, rows = view.find(parents)
    files = view.files
    if len(rows) == 1 and not windows:
        (parent,) = ScenarioLoader.of_rows(view, rows)
        for each in parameters:
            if each.target not in (LIGHTS, ROAD):
                find_track(parent, each.target)
    limits = {name: getattr(space, name) for name in ("acceleration", "jerk", "margin")}
    options = VariationOptions(lake=str(files.root), **limits)
    items: dict[str, list[RawItem]] = {}
    names = [each.name for each in parameters]
    for row in rows.columns(["scenario_id", "split"]).to_pylist():
        parent_id = row["scenario_id"]
        for moment in windows.get(parent_id, [None] * (not windows)):
            key = "" if moment is None else f"{moment.key}-"
            roles = {} if moment is None else {_MOMENT: dataclasses.asdict(moment)}
            values = draw(parameters, space.number, space.seed, space.method, f"{parent_id}{key}")
            items.setdefault(row["split"], []).extend(
                RawItem(f"{parent_id}@{key}{k:06d}", json.dumps(dict(zip(names, each, strict=True)) | roles))
                for k, each in enumerate(values.tolist())
            )
    shards = [
        Shard(DATASET, name, split, f"vary-{part}", "", of_part, options)
        for split, of_split in items.items()
        for part, of_part in bucket(of_split).items()
    ]
    run = executor or executor_for(workers, len(shards))
    return write_shards(files, Variations, shards, f"vary {name}", run, on_progress, replace=replace)


def write_shards(
    files: LakeFiles,
    converter: type[Converter[Any]],
    shards: list[Shard],
    operation: str,
    run: Executor,
    on_progress: Progress | None = None,
    *,
    replace: bool = False,
) -> ConversionReport:
    """Convert what the lake does not have of some shards, and commit it.

    Args:
        files: The lake.
        converter: Converter of the shards.
        shards: All that is wanted.
        operation: Recorded in the snapshot.
        run: Runs the jobs.
        on_progress: Called before the first shard and after each one.
        replace: Replace shards with other content.

    Raises:
        DuplicateScenario: The lake has other content for an item, and ``replace`` is False.
    """
    started = time.monotonic()
    plan = make_plan(shards, manifests.shards(files, snapshots.read(files)), converter.version, may_replace=replace)
    report = ConversionReport(skipped=plan.num_skipped, stale=plan.num_stale)
    committer = Committer(files, plan, operation, report, started)
    jobs = [ShardJob(f"{converter.__module__}:{converter.__name__}", each, str(files.root)) for each in plan.shards]
    return committer.add_all(run(jobs, convert_shard, lost_shard), len(jobs), on_progress)
