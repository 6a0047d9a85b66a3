"""Write a database of pickles: one file per scenario, the summary of all metadata, the mapping to folders.

It is written to a temporary folder and renamed when complete, so that partial databases are never visible. Scenarios
are streamed; only the summary, a single pickle, grows with their number.
"""

from __future__ import annotations

import secrets
import shutil
from collections.abc import Iterable, Iterator, Sized
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from scenarionet_data.databases.record import DatabaseRecord
from scenarionet_data.errors import BadParameter, DatabaseExists, InvalidScenario, LakeError, ScenarioNetError
from scenarionet_data.execution.executors import Executor
from scenarionet_data.execution.progress import Progress
from scenarionet_data.export.parts import write_parts
from scenarionet_data.export.pickling import WrittenPickle, dump, twice, write_scenarios
from scenarionet_data.loader import ScenarioLoader
from scenarionet_data.query.lake_view import LakeLike
from scenarionet_data.scenario.description import ScenarioDescription

SUMMARY_FILE = "dataset_summary.pkl"
MAPPING_FILE = "dataset_mapping.pkl"


@dataclass(frozen=True)
class ExportReport:
    """Result of :func:`export`.

    Attributes:
        directory: The database.
        num_scenarios, num_bytes: Pickled scenarios and their size.
        refused: Scenarios that the format cannot represent, which are not written.
    """

    directory: Path
    num_scenarios: int
    num_bytes: int
    refused: tuple[InvalidScenario, ...]


def export(
    scenarios: Iterable[ScenarioDescription],
    directory: Path,
    *,
    replace: bool = False,
    original: bool = True,
    executor: Executor | None = None,
    on_progress: Progress | None = None,
) -> ExportReport:
    """Write a ScenarioNet database.

    Args:
        scenarios: Scenarios, in the order of MetaDrive's scenario index.
        directory: Folder of the database; new or empty unless ``replace``.
        replace: Replace an existing database of pickles.
        original: Write unchanged scenarios that were converted from pickles as these were, whatever their version; False
            for the current format, which MetaDrive 0.4.3 reads.
        executor: Writes it in parts, for example on a cluster; requires ``scenarios`` to be a picklable sequence.
        on_progress: Called after each scenario; the total is 0 if ``scenarios`` has no length.

    Raises:
        DatabaseExists: ``directory`` is not empty, or contains other files than a database.
        BadParameter: No scenarios.
        InvalidScenario: None of the scenarios could be written, with the first reason.
        LakeError: The disk is full, or ``directory`` is not writable.
    """
    directory = Path(directory)
    _check_target(directory, replace)
    summary: dict[str, Any] = {}
    refused: list[InvalidScenario] = []
    num_bytes, total = 0, len(scenarios) if isinstance(scenarios, Sized) else 0
    with _new_directory(directory) as draft:
        entries = (
            write_scenarios(scenarios, draft, original)
            if executor is None
            else write_parts(scenarios, draft, executor, original)
        )
        for done, entry in enumerate(entries, start=1):
            try:
                num_bytes += _take(entry, draft, summary)
            except InvalidScenario as error:
                refused.append(error)
            if on_progress:
                on_progress(done, total, done)
        if not summary:
            raise refused[0] if refused else BadParameter(f"{directory}: no scenarios to export")
        dump(_without_arrays(summary), draft / SUMMARY_FILE)
        dump(dict.fromkeys(summary, ""), draft / MAPPING_FILE)
    return ExportReport(directory, len(summary), num_bytes, tuple(refused))


def export_database(
    lake: LakeLike,
    database: DatabaseRecord | str | Iterable[str] | None,
    directory: str | Path,
    *,
    replace: bool = False,
    original: bool = True,
    executor: Executor | None = None,
    on_progress: Progress | None = None,
) -> ExportReport:
    """Write the scenarios of a lake as a ScenarioNet database; see :func:`export`.

    Args:
        lake: The lake, its path or its URL.
        database: A database (saved or not), its name, scenario ids, or None for all scenarios.
        directory, replace, original, executor, on_progress: See :func:`export`.
    """
    loader = ScenarioLoader(lake, database)
    return export(
        loader, Path(directory), replace=replace, original=original, executor=executor, on_progress=on_progress
    )


def _take(entry: WrittenPickle | InvalidScenario, draft: Path, summary: dict[str, Any]) -> int:
    """Move a pickled scenario into the database; return its size."""
    if isinstance(entry, InvalidScenario):
        raise entry
    name = entry.path.name if entry.path.name not in summary else entry.other_name
    if name in summary:
        raise twice(entry.scenario_id, name)
    entry.path.replace(draft / name)
    summary[name] = entry.metadata
    return entry.num_bytes


def _without_arrays(value: Any) -> Any:
    """Convert arrays to lists and sets to tuples, as in ScenarioNet's summaries."""
    if isinstance(value, np.ndarray):
        return value.tolist()
    if isinstance(value, set):
        return tuple(sorted(value, key=str))
    if isinstance(value, dict):
        return {key: _without_arrays(inner) for key, inner in value.items()}
    return value


def _check_target(directory: Path, replace: bool) -> None:
    if not directory.exists() or (directory.is_dir() and not any(directory.iterdir())):
        return
    foreign = [p.name for p in directory.iterdir() if not _is_ours(p)] if directory.is_dir() else [directory.name]
    if foreign:
        raise DatabaseExists(
            f"{directory}: contains {foreign[0]!r} and is not a database of pickles; give another directory"
        )
    if not replace:
        raise DatabaseExists(f"{directory}: is not empty; pass replace=True, or give another directory")


def _is_ours(path: Path) -> bool:
    is_scenario = path.suffix == ".pkl" and (path.stem.startswith("sd_") or path.stem.isdigit())
    return path.is_file() and (is_scenario or path.name in (SUMMARY_FILE, MAPPING_FILE))


@contextmanager
def _new_directory(directory: Path) -> Iterator[Path]:
    """Yield a temporary sibling folder that replaces ``directory`` when the block ends, or is deleted if it fails.

    Raises:
        LakeError: The disk is full or not writable, also on workers.
    """
    mark = secrets.token_hex(4)
    draft = directory.with_name(f".{directory.name}.{mark}.new")
    try:
        draft.mkdir(parents=True)
        yield draft
        _swap_in(draft, directory, directory.with_name(f".{directory.name}.{mark}.old"))
    except ScenarioNetError:
        raise
    except OSError as error:
        raise LakeError(
            f"cannot write {directory}: {error.strerror or error}; nothing was written: free some space or choose "
            "another directory, and run the same command again"
        ) from error
    finally:
        shutil.rmtree(draft, ignore_errors=True)


def _swap_in(draft: Path, directory: Path, old: Path) -> None:
    if not directory.exists():
        draft.replace(directory)
        return
    directory.replace(old)
    try:
        draft.replace(directory)
    except OSError:
        old.replace(directory)
        raise
    shutil.rmtree(old)
