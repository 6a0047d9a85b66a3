"""Receipts of scores and comparisons: what they were made of, and their rows, so that they can be computed again.

The receipt of a score has the digest of what was scored: a file of predictions, a submission, or a trained model. That
of a comparison has the receipts of its runs; ``verify_score`` simulates these again first, and then compares again.
"""

from __future__ import annotations

import hashlib
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import asdict, replace
from itertools import zip_longest
from pathlib import Path
from typing import Any

from scenarionet_data import Lake, version
from scenarionet_data.errors import BadParameter, needing
from scenarionet_data.execution.executors import Executor, executor_for
from scenarionet_data.forecasts.scoring import ForecastScores, score
from scenarionet_data.query.lake_view import open_view
from scenarionet_data.storage import checkpoints
from scenarionet_sim.evaluation import receipts
from scenarionet_sim.evaluation.comparison import RunComparison, compare_runs
from scenarionet_sim.evaluation.receipts import Difference, Receipt, Values, Verification
from scenarionet_sim.metrics.wosac import SubmissionReport, score_submission

_NAMES = ("scenario_id", "track_id", "timestep", "object_type", "seconds", "kind", "name", "group", "metric", "better")
"""Columns that say which row it is."""


def score_receipt(lake: Lake, kind: str, found: Any, description: Values, ids: Sequence[str] | None = None) -> Receipt:
    """Return the receipt of a score, or of a comparison.

    Args:
        lake: The lake.
        kind: ``predictions``, ``submission``, ``model`` or ``comparison``.
        found: What :func:`score`, :func:`score_submission`, :func:`score_forecaster` or :func:`compare_runs` returned.
        description: The arguments of that function: ``file``, with ``configuration`` and ``official`` of a submission;
            ``run`` and ``database``; ``runs``, ``where``, ``by``, ``event`` and ``judged_by``.
        ids: Scenarios of ``model``; those of the others are in ``found``.

    Raises:
        BadParameter: There is no such file or model, or a run cannot be computed again.
    """
    rows, runs = tuple(_rows(found)), tuple(receipts.make_receipt(lake, run) for run in description.get("runs", ()))
    name = description.get("file") or description.get("run") or " and ".join(description["runs"])
    if ids is None:
        of_runs = [scenario_id for run in runs for scenario_id, _ in run.scenarios]
        ids = list(dict.fromkeys(of_runs or [row["scenario_id"] for row in rows if row.get("scenario_id")]))
    digests = receipts.content_digests(lake, ids)
    told = {"snapshot": lake.snapshot.number, "software": version.name_and_version(), **description}
    if not runs:
        told["digest"] = _digest(lake, told, Path())[1]
    scenarios = tuple((scenario_id, digests[scenario_id]) for scenario_id in ids if scenario_id in digests)
    return Receipt(Path(name).name, told, scenarios, rows, kind, runs)


def verify_score(
    lake: Lake, receipt: Receipt, folder: str | Path = ".", *, workers: int = 1, executor: Executor | None = None
) -> Verification:
    """Compute a score or a comparison again and compare every value with what it was.

    Args:
        lake: A lake with the scenarios.
        receipt: Its receipt.
        folder: Where the file that was scored is, if not where it was.
        workers: Number of processes.
        executor: Runs parts instead of local processes.

    Raises:
        BadParameter: The lake lacks a scenario or has it with another content, or what was scored is not there.
    """
    told = receipt.description
    receipts.check_scenarios(lake, receipt)
    for run in receipt.runs:
        found = receipts.verify(lake, run, workers=workers, executor=executor)
        if found.first is not None:
            first = replace(found.first, scenario_id=f"{run.run}: {found.first.scenario_id}")
            return replace(found, run=receipt.run, first=first)
    path, digest = _digest(lake, told, Path(folder)) if not receipt.runs else ("", None)
    if digest != told.get("digest"):
        raise BadParameter(
            f"{path} is not what was scored for this receipt: its digest is {digest}, not {told['digest']}; put "
            "the same file there, or beside the receipt"
        )
    again: Any
    if receipt.kind == "predictions":
        again = score(lake, path)
    elif receipt.kind == "submission":
        executor = executor or executor_for(workers)
        again = score_submission(
            str(lake.root), path, told["configuration"], official=told["official"], executor=executor
        )
    elif receipt.kind == "model":
        with needing("a forecaster needs torch", "learn"):
            from scenarionet_data.forecasts.forecaster_scores import score_forecaster
        again = score_forecaster(open_view(lake), path, [scenario_id for scenario_id, _ in receipt.scenarios])
    else:
        asked = {name: told[name] for name in ("where", "by", "event", "judged_by")}
        given = {run.run: (run.description, run.rows) for run in receipt.runs}
        again = compare_runs(lake, *told["runs"], **asked, given=given)
    differences: list[Difference] = []
    nothing: Values = {}
    for before, after in zip_longest(receipt.rows, _rows(again), fillvalue=nothing):
        row = {**after, **before}
        where = ", ".join(str(row[name]) for name in _NAMES if row.get(name) is not None)
        differences += [
            Difference(where, None, column, before.get(column), after.get(column))
            for column in row
            if not receipts.is_equal(before.get(column), after.get(column))
        ]
    return receipts.verification(receipt, differences)


def _digest(lake: Lake, told: Values, folder: Path) -> tuple[str, str]:
    """Return what is scored, a path or the name of a run, and the digest of its bytes."""
    digest = hashlib.blake2b(digest_size=16)
    if "file" not in told:
        checkpoint = checkpoints.load(lake.files, told["run"])
        for name, array in sorted(checkpoint.arrays.items()) if checkpoint else ():
            digest.update(name.encode() + array.tobytes())
        return told["run"], digest.hexdigest()
    beside, there = folder / Path(told["file"]).name, Path(told["file"])
    path = beside if beside.exists() else there
    try:
        for file in sorted(path.iterdir()) if path.is_dir() else [path]:
            digest.update(file.read_bytes())
    except OSError as error:
        raise BadParameter(f"what was scored, {there}, is not there and not in {folder}: {error}") from error
    return str(path), digest.hexdigest()


def _rows(found: Any) -> Iterator[Values]:
    """Yield the numbers of a score or comparison."""
    if isinstance(found, ForecastScores):
        yield from found.table.to_pylist()
        for (kind, seconds, name), value in found.precision.items():
            yield {"object_type": kind, "seconds": seconds, "kind": name, "value": value}
    elif isinstance(found, RunComparison):
        yield from (dict(_flat("", asdict(each))) for each in found.metrics)
        for name in ("better", "worse"):
            yield from ({"scenario_id": key, "better": name, "change": value} for key, value in getattr(found, name))
    else:
        listed = found.scenarios if isinstance(found, SubmissionReport) else found
        yield from (dict(_flat("", asdict(each))) for each in listed)


def _flat(name: str, value: Any) -> Iterator[tuple[str, Any]]:
    """Yield the numbers and texts in nested mappings and sequences, by their path."""
    if isinstance(value, Mapping | list | tuple):
        items = value.items() if isinstance(value, Mapping) else enumerate(value)
        for key, inner in items:
            yield from _flat(f"{name} {key}".strip(), inner)
    else:
        yield name, value
