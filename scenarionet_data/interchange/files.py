"""A database as files of a format, written in parts that other processes can take and an interrupted run keeps.

The files are written to a draft beside the folder. Each part ends with a list of what it wrote, and a repeated run
takes finished parts as they are. The folder appears when it is complete, with ``export.jsonl``: one line a scenario
with its id, its files and its losses.
"""

from __future__ import annotations

import hashlib
import json
import os
import shutil
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from scenarionet_data import version
from scenarionet_data.errors import BadParameter, DatabaseExists, InvalidScenario, LakeError
from scenarionet_data.execution.executors import Executor, run_serially
from scenarionet_data.execution.progress import Progress
from scenarionet_data.interchange.base import ExportReport, FormatWriter, Loss, Losses
from scenarionet_data.scenario.description import ScenarioDescription

INDEX = "export.jsonl"
_PART = 32
_LONGEST_NAME = 200  # bytes of a file's name, which most file systems limit to 255


@dataclass(frozen=True)
class _Part:
    """Scenarios ``first`` to ``end - 1``, to be written to ``draft``."""

    scenarios: Sequence[ScenarioDescription]
    writer: FormatWriter
    draft: Path
    first: int
    end: int

    @property
    def entries(self) -> Path:
        return self.draft / f".part-{self.first:09d}.jsonl"


def write_files(
    scenarios: Sequence[ScenarioDescription],
    directory: Path | str,
    writer: FormatWriter,
    *,
    replace: bool = False,
    executor: Executor = run_serially,
    on_progress: Progress | None = None,
) -> ExportReport:
    """Write every scenario in a format.

    Args:
        scenarios: A sequence such as a ``ScenarioLoader``; for several processes it must pickle.
        directory: Folder to create, new or empty unless ``replace``.
        writer: The format.
        replace: Replace an earlier export.
        executor: Runs the parts.
        on_progress: Called after each part.

    Raises:
        DatabaseExists: ``directory`` is not empty, or holds something else than an export.
        BadParameter: No scenarios.
        InvalidScenario: None of the scenarios can be written, with the first reason.
        LakeError: The disk is full, or ``directory`` is not writable; a repeated call goes on from there.
    """
    target, total = Path(directory).absolute(), len(scenarios)
    if not total:
        raise BadParameter(f"{directory}: no scenarios to export")
    _check_destination(target, replace)
    try:
        draft = _draft_for(target, scenarios, writer)
        parts = [_Part(scenarios, writer, draft, k, min(k + _PART, total)) for k in range(0, total, _PART)]
        waiting = [part for part in parts if not part.entries.exists()]
        done = total - sum(part.end - part.first for part in waiting)
        for count in executor(waiting, _write_part):
            done += count
            if on_progress:
                on_progress(done, total, done)
        report = _summarise(parts, target)
        if not report.num_scenarios:
            shutil.rmtree(draft)
            raise report.refused[0]
        with (draft / INDEX).open("w", encoding="utf-8") as file:
            for line in _lines(parts):
                file.write(json.dumps(line, sort_keys=True) + "\n")
        for part in parts:
            part.entries.unlink()
        for left in draft.rglob("*.tmp"):
            left.unlink()
        if target.exists():
            old = draft.with_suffix(".old")
            target.replace(old)
            draft.replace(target)
            shutil.rmtree(old)
        else:
            draft.replace(target)
    except OSError as error:
        raise LakeError(
            f"cannot write {directory}: {error.strerror or error}; free some space or choose another directory, and "
            "run the same command again, which keeps what is finished"
        ) from error
    return report


def stem_of(scenario_id: str) -> str:
    """Return the name of a scenario's files: its id with ``--`` for each slash.

    Raises:
        InvalidScenario: The name would be too long for a file system.
    """
    stem = scenario_id.replace("/", "--")
    if len(stem) > _LONGEST_NAME:
        reason = f"expected an id of at most {_LONGEST_NAME} bytes, which a file name can hold, found {len(stem):,}"
        raise InvalidScenario(scenario_id, "id", reason)
    return stem


def _check_destination(target: Path, replace: bool) -> None:
    if target.is_dir() and not any(target.iterdir()):
        return
    if not target.exists():
        return
    if not (target / INDEX).is_file():
        raise DatabaseExists(f"{target}: holds something else than an export; give another directory")
    if not replace:
        raise DatabaseExists(f"{target}: is not empty; pass replace=True (--replace), or give another directory")


def _draft_for(target: Path, scenarios: Sequence[ScenarioDescription], writer: FormatWriter) -> Path:
    """Return the draft of this export, with what an interrupted run of the same export left in it."""
    ids = getattr(scenarios, "scenario_ids", None)
    identity = [
        version.__version__,
        writer.name,
        repr(writer),
        str(len(scenarios)),
        *(map(str, ids) if ids is not None else ()),
    ]
    key = hashlib.blake2b("\n".join(identity).encode(), digest_size=8).hexdigest()
    for other in target.parent.glob(f".{target.name}.*.draft"):
        if other.name != f".{target.name}.{key}.draft":
            shutil.rmtree(other)
    draft = target.parent / f".{target.name}.{key}.draft"
    draft.mkdir(parents=True, exist_ok=True)
    return draft


def _write_part(part: _Part) -> int:
    """Write a part, on a worker; return its number of scenarios."""
    lines = list[dict[str, Any]]()
    for number in range(part.first, part.end):
        scenario, losses = part.scenarios[number], Losses()
        try:
            files = part.writer.write(scenario, stem_of(scenario.id), losses)
        except InvalidScenario as error:
            lines.append({"scenario_id": error.scenario_id, "field": error.field, "refused": error.reason})
            continue
        for name, content in files.items():
            _write_once(part.draft / name, content)
        sizes = {name: len(content) for name, content in files.items()}
        lines.append({"scenario_id": scenario.id, "files": sizes, "losses": losses.as_json()})
    _write_once(part.entries, "".join(json.dumps(line, sort_keys=True) + "\n" for line in lines).encode())
    return part.end - part.first


def _write_once(path: Path, content: bytes) -> None:
    """Write a file so that it is seen whole or not at all."""
    path.parent.mkdir(parents=True, exist_ok=True)
    draft = path.with_name(f"{path.name}.{os.getpid()}.tmp")
    draft.write_bytes(content)
    draft.replace(path)


def _lines(parts: Sequence[_Part]) -> Iterator[dict[str, Any]]:
    for part in parts:
        with part.entries.open(encoding="utf-8") as file:
            yield from map(json.loads, file)


def _summarise(parts: Sequence[_Part], target: Path) -> ExportReport:
    losses, refused, sizes, count = Losses(), list[InvalidScenario](), dict[str, int](), 0
    for line in _lines(parts):
        if "refused" in line:
            refused.append(InvalidScenario(line["scenario_id"], line["field"], line["refused"]))
            continue
        count += 1
        sizes |= line["files"]
        losses.add(Loss(**loss) for loss in line["losses"])
    return ExportReport(target, count, sum(sizes.values()), tuple(refused), len(sizes), losses.found())
