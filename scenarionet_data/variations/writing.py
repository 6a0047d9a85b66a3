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
from scenarionet_data.scenario.settings import check_settings
from scenarionet_data.storage.snapshots import manifests
from scenarionet_data.storage.snapshots import snapshot as snapshots
from scenarionet_data.variations.changes import change, find_track
from scenarionet_data.variations.limits import ACCELERATION, JERK, check_limits
from scenarionet_data.variations.parameters import LIGHTS, Method, draw, parse_parameters

DATASET = "variation"
"""The dataset of all variations in a lake; its versions are their names."""


@dataclass(frozen=True)
class VariationSpace:
    """What is varied, how often, and within which limits.

    Attributes:
        parameters: Distributions by name; see :func:`~scenarionet_data.variations.parameters.parse_parameters`.
        number: Variations of each scenario.
        seed, method: See :func:`~scenarionet_data.variations.parameters.draw`.
        acceleration, jerk: Limits of changed road users [m/s^2], [m/s^3].
    """

    parameters: Mapping[str, Any]
    number: int = 1000
    seed: int = 0
    method: Method = "random"
    acceleration: float = ACCELERATION
    jerk: float = JERK

    def __post_init__(self) -> None:
        check_settings(self)
        parse_parameters(self.parameters)


@dataclass(frozen=True)
class VariationOptions(Options):
    """What variations depend on beside their values.

    Attributes:
        lake: The lake of their parents.
        acceleration, jerk: Limits of changed road users.
    """

    lake: str = field(default="", metadata={"doc": "lake of the parents", "is_path": True})
    acceleration: float = field(default=ACCELERATION, metadata={"doc": "largest acceleration [m/s^2]"})
    jerk: float = field(default=JERK, metadata={"doc": "largest jerk [m/s^3]"})


class Variations(Converter[tuple[ScenarioDescription, RawItem]]):
    """Scenarios of a lake with other values; :func:`vary` lists its shards."""

    name: ClassVar[str] = DATASET
    version: ClassVar[str] = "1"
    release: ClassVar[str] = "v"
    licence: ClassVar[str] = "that of the varied scenario, see the column licence"
    raw: ClassVar[str] = "scenarios of the lake"
    Options = VariationOptions

    def shards(self, raw: str, split: str, version: str, options: VariationOptions) -> Iterable[Shard]:  # noqa: ARG002
        """Raise: variations are listed by :func:`vary`.

        Raises:
            BadParameter: Always.
        """
        raise BadParameter("variations are made from a lake, by scenarionet vary")

    def records(self, shard: Shard) -> Iterator[tuple[ScenarioDescription, RawItem]]:
        """Yield each item with its parent, which is loaded once."""
        parents = [item.name.rpartition("@")[0] for item in shard.items]
        loader = ScenarioLoader(shard.options_as(VariationOptions).lake, sorted(set(parents)))
        loaded: ScenarioDescription | None = None
        for parent, item in sorted(zip(parents, shard.items, strict=True), key=lambda pair: pair[1].name):
            if loaded is None or loaded.id != parent:
                loaded = loader[loader.scenario_ids.index(parent)]
            yield loaded, item

    def scenario(self, shard: Shard, record: tuple[ScenarioDescription, RawItem]) -> ScenarioDescription:
        """Change the parent and check the result."""
        (parent, item), options = record, shard.options_as(VariationOptions)
        values: dict[str, float] = json.loads(item.fingerprint)
        changed, origins = change(parent, values)
        check_limits(parent, changed, origins, options.acceleration, options.jerk)
        return dataclasses.replace(
            changed.with_own_map(),
            id=make_scenario_id(DATASET, shard.version, parent.id, item.name.rpartition("@")[2]),
            dataset=DATASET,
            version=shard.version,
            split=shard.split,
            extras={**parent.extras, "parent": parent.id, "parameters": values},
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
        parents: Scenarios to vary: an id, several, or the name of a database.
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
    if not re.fullmatch(r"[A-Za-z0-9._-]+", str(name)):
        raise BadParameter(f"name {name!r}: use letters, digits, '.', '_' and '-'")
    started, parameters = time.monotonic(), parse_parameters(space.parameters)
    view, rows = open_view(lake).find([parents] if isinstance(parents, str) and is_scenario_id(parents) else parents)
    files = view.files
    if len(rows) == 1:
        (parent,) = ScenarioLoader.of_rows(view, rows)
        for each in parameters:
            if each.target != LIGHTS:
                find_track(parent, each.target)
    options = VariationOptions(lake=str(files.root), acceleration=space.acceleration, jerk=space.jerk)
    items: dict[str, list[RawItem]] = {}
    names = [each.name for each in parameters]
    for row in rows.columns(["scenario_id", "split"]).to_pylist():
        values = draw(parameters, space.number, space.seed, space.method, row["scenario_id"])
        items.setdefault(row["split"], []).extend(
            RawItem(f"{row['scenario_id']}@{k:06d}", json.dumps(dict(zip(names, each, strict=True))))
            for k, each in enumerate(values.tolist())
        )
    shards = [
        Shard(DATASET, name, split, f"vary-{part}", "", of_part, options)
        for split, of_split in items.items()
        for part, of_part in bucket(of_split).items()
    ]
    plan = make_plan(shards, manifests.shards(files, snapshots.read(files)), Variations.version, may_replace=replace)
    report = ConversionReport(skipped=plan.num_skipped, stale=plan.num_stale)
    committer = Committer(files, plan, f"vary {name}", report, started)
    jobs = [ShardJob(f"{__name__}:{Variations.__name__}", shard, str(files.root)) for shard in plan.shards]
    run = executor or executor_for(workers, len(jobs))
    return committer.add_all(run(jobs, convert_shard, lost_shard), len(jobs), on_progress)
