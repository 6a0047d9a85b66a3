"""Add scenarios that were made in Python to a lake."""

from __future__ import annotations

import hashlib
import re
import time
from collections import defaultdict
from collections.abc import Iterable, Iterator
from itertools import islice

from scenarionet_data.conversion.committer import Committer, ConversionReport
from scenarionet_data.conversion.jobs import ShardResult
from scenarionet_data.conversion.plan import ConversionPlan
from scenarionet_data.errors import BadParameter, InvalidScenario
from scenarionet_data.ingest.options import Options
from scenarionet_data.ingest.shard import RawItem, Shard
from scenarionet_data.quality.audit import audit
from scenarionet_data.scenario.content_hash import content_hash
from scenarionet_data.scenario.description import ScenarioDescription
from scenarionet_data.scenario.settings import check_is
from scenarionet_data.storage.files.lake_files import LakeFiles
from scenarionet_data.storage.files.places import LakeFilesLike, open_files
from scenarionet_data.storage.snapshots import manifests
from scenarionet_data.storage.snapshots import snapshot as snapshots
from scenarionet_data.storage.write.shard_writer import SCENARIOS_PER_FILE, ShardWriter

_VERSION = "1"
_PARTITION = re.compile(r"[A-Za-z0-9._-]+")


def add_scenarios(
    lake: LakeFilesLike, scenarios: Iterable[ScenarioDescription], *, check: bool = True
) -> ConversionReport:
    """Add scenarios to a lake, in one commit; the lake is created if missing.

    They keep their dataset, version, split and id. Those that the lake has already are skipped; those that are not
    valid, break a hard rule of ``sql/checks``, or differ from one with the same id go to quarantine with the reason,
    and the others are added. A part of a shared map becomes the scenario's own.

    Args:
        lake: The lake, its folder or its URL.
        scenarios: The scenarios; 64 of them are in memory at a time.
        check: Apply the hard rules.

    Raises:
        BadParameter: They are no scenarios.
        InvalidScenario: A dataset, version or split cannot be the name of a folder; nothing is added.
        LakeError: The lake cannot be written.
    """
    check_is("check", check, bool, "True or False")
    started, files, report = time.monotonic(), open_files(lake), ConversionReport()
    files.sweep()
    known = {
        (record.dataset, record.version, record.split, *each)
        for record in manifests.shards(files, snapshots.read(files))
        for each in zip(record.items, record.fingerprints, strict=True)
    }
    committer = Committer(files, ConversionPlan((), 0, {}, 0), "add scenarios", report, started, in_one=True)
    if isinstance(scenarios, ScenarioDescription) or not isinstance(scenarios, Iterable):
        raise BadParameter(f"scenarios: expected several, such as [scenario], found {scenarios!r}")
    waiting = iter(scenarios)
    while batch := list(islice(waiting, SCENARIOS_PER_FILE)):
        parts: dict[tuple[str, str, str], list[tuple[RawItem, ScenarioDescription]]] = defaultdict(list)
        for scenario in batch:
            if not isinstance(scenario, ScenarioDescription):
                raise BadParameter(f"scenarios: expected ScenarioDescriptions, found {scenario!r}")
            part = scenario.dataset, scenario.version, scenario.split
            for name, value in zip(("dataset", "version", "split"), part, strict=True):
                if not _PARTITION.fullmatch(value):
                    reason = f"expected letters, digits, '.', '_' and '-', found {value!r}"
                    raise InvalidScenario(scenario.id, name, reason)
            item = RawItem(scenario.id, f"{content_hash(scenario):016x}")
            if (*part, item.name, item.fingerprint) in known:
                report.skipped += 1
            else:
                parts[part].append((item, scenario.with_own_map()))
        for result in _write(files, parts, check):
            committer.add(result)
    committer.commit()
    return committer.report()


def _write(
    files: LakeFiles, parts: dict[tuple[str, str, str], list[tuple[RawItem, ScenarioDescription]]], check: bool
) -> Iterator[ShardResult]:
    for (dataset, version, split), members in parts.items():
        items = tuple(item for item, _ in members)
        digest = hashlib.blake2b(repr([(item.name, item.fingerprint) for item in items]).encode(), digest_size=8)
        shard = Shard(dataset, version, split, f"added-{digest.hexdigest()}", "", items, Options())
        licence = " / ".join(sorted({scenario.source.licence for _, scenario in members}))
        writer = ShardWriter(files, shard, _VERSION, licence, audit if check else None)
        try:
            for position, (_, scenario) in enumerate(members):
                try:
                    writer.add(scenario)
                except InvalidScenario as error:
                    writer.reject(position, error)
            yield ShardResult(shard.name, writer.finish(num_records=len(members)))
        finally:
            writer.abandon()
