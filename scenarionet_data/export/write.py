"""Write a database of pickles: one file per scenario, the summary of all metadata, the mapping to folders.

Scenarios are streamed; only the summary, a single pickle, grows with their number. Equal scenarios in the same order
give equal bytes.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence, Sized
from pathlib import Path
from typing import Any, cast

import numpy as np

from scenarionet_data.databases.record import DatabaseRecord
from scenarionet_data.errors import BadParameter, InvalidScenario
from scenarionet_data.execution.executors import Executor, run_serially
from scenarionet_data.execution.progress import Progress
from scenarionet_data.export.destination import MAPPING_FILE, SUMMARY_FILE, check_destination, new_directory
from scenarionet_data.export.pickling import dump, twice, write_parts, write_scenarios
from scenarionet_data.interchange import writer_for
from scenarionet_data.interchange.base import ExportReport, FormatWriter
from scenarionet_data.interchange.files import write_files
from scenarionet_data.loader import ScenarioLoader
from scenarionet_data.query.lake_view import LakeLike
from scenarionet_data.scenario.description import ScenarioDescription
from scenarionet_data.scenario.settings import check_is
from scenarionet_data.storage.files.places import is_url, local_path


def export(
    scenarios: Iterable[ScenarioDescription],
    directory: Path | str,
    *,
    replace: bool = False,
    original: bool = True,
    file_format: str | FormatWriter = "scenarionet",
    parameters: Mapping[str, Any] | None = None,
    executor: Executor | None = None,
    on_progress: Progress | None = None,
) -> ExportReport:
    """Write scenarios for other software: as a ScenarioNet database, or in a format of ``interchange``.

    A folder appears when it is complete. At a URL, the summary and the mapping are uploaded when all pickles are there.

    Args:
        scenarios: Scenarios, in the order of MetaDrive's scenario index.
        directory: Folder of the database, or its URL; new or empty unless ``replace``.
        replace: Replace an existing database of pickles.
        original: Write unchanged scenarios that were converted from pickles as these were, whatever their version;
            False for the current format, which MetaDrive 0.4.3 reads.
        file_format: ``"scenarionet"``, a name in ``interchange.WRITERS``, or a writer.
        parameters: Options of another format, see its writer.
        executor: Writes it in parts, for example on a cluster, which shares the file system of the folder (for a URL,
            of ``$TMPDIR``); requires ``scenarios`` to be a picklable sequence.
        on_progress: Called after each scenario; the total is 0 if ``scenarios`` has no length.

    Raises:
        DatabaseExists: ``directory`` is not empty, or contains other files than a database.
        BadParameter: No scenarios.
        InvalidScenario: None of the scenarios could be written, with the first reason.
        LakeError: The disk is full, or ``directory`` is not writable.
    """
    check_is("replace", replace, bool | np.bool_, "True or False")
    check_is("original", original, bool | np.bool_, "True or False")
    check_is("executor", executor, Callable | None, "a function, such as ProcessExecutor(2)")
    check_is("on_progress", on_progress, Callable | None, "a function, such as ProcessExecutor(2)")
    if file_format != "scenarionet":
        return write_files(
            cast(Sequence[ScenarioDescription], scenarios),
            local_path(directory, "an export in another format"),
            writer_for(file_format, parameters) if isinstance(file_format, str) else file_format,
            replace=replace,
            executor=executor or run_serially,
            on_progress=on_progress,
        )
    directory = str(directory) if is_url(directory) else local_path(directory, "an export").absolute()
    check_destination(directory, replace)
    summary: dict[str, Any] = {}
    refused: list[InvalidScenario] = []
    num_bytes, total = 0, len(scenarios) if isinstance(scenarios, Sized) else 0
    with new_directory(directory) as draft:
        entries = (
            write_scenarios(scenarios, draft, original)
            if executor is None
            else write_parts(scenarios, draft, executor, original)
        )
        for done, entry in enumerate(entries, start=1):
            if isinstance(entry, InvalidScenario):
                refused.append(entry)
            else:
                name = entry.path.name if entry.path.name not in summary else entry.other_name
                target = draft / name
                if target != entry.path and target.exists():
                    refused.append(twice(entry.scenario_id, name))
                else:
                    entry.path.replace(target)
                    summary[name] = _without_arrays(entry.metadata)
                    num_bytes += entry.num_bytes
            if on_progress:
                on_progress(done, total, done)
        if not summary:
            raise refused[0] if refused else BadParameter(f"{directory}: no scenarios to export")
        dump(summary, draft / SUMMARY_FILE)
        dump(dict.fromkeys(summary, ""), draft / MAPPING_FILE)
    return ExportReport(directory, len(summary), num_bytes, tuple(refused))


def export_database(
    lake: LakeLike,
    database: DatabaseRecord | str | Iterable[str] | None,
    directory: str | Path,
    *,
    replace: bool = False,
    original: bool = True,
    file_format: str = "scenarionet",
    parameters: Mapping[str, Any] | None = None,
    executor: Executor | None = None,
    on_progress: Progress | None = None,
) -> ExportReport:
    """Write the scenarios of a lake for other software; see :func:`export`.

    Args:
        lake: The lake, its path or its URL.
        database: A database (saved or not), its name, scenario ids, or None for all scenarios.
        directory, replace, original, file_format, parameters, executor, on_progress: See :func:`export`.
    """
    loader = ScenarioLoader(lake, database)
    return export(
        loader, directory, replace=replace, original=original, file_format=file_format, parameters=parameters,
        executor=executor, on_progress=on_progress,
    )  # fmt: skip


def _without_arrays(value: Any) -> Any:
    """Convert arrays to lists and sets to tuples, as in ScenarioNet's summaries."""
    if isinstance(value, np.ndarray):
        return value.tolist()
    if isinstance(value, set):
        return tuple(sorted(value, key=str))
    if isinstance(value, dict):
        return {key: _without_arrays(inner) for key, inner in value.items()}
    return value
