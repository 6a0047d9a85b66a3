"""Receipts of runs: everything that a run was made of, and its rows, so that it can be computed again elsewhere.

A receipt is JSON: the description of the run (policy, seed, snapshot, software ...), its scenarios with the digest of
their content, every row of its results, and a digest of every simulated trajectory. ``verify`` simulates the same
scenarios again, in this lake or in another one that has them, and compares every value bit by bit.
"""

from __future__ import annotations

import hashlib
import json
import math
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass, fields
from pathlib import Path
from typing import Any

import pyarrow as pa

from scenarionet_data import Lake, version
from scenarionet_data.arrays.dtypes import is_count
from scenarionet_data.errors import BadParameter
from scenarionet_data.execution.executors import Executor
from scenarionet_data.execution.progress import Progress
from scenarionet_data.schema import tables
from scenarionet_data.storage import evaluation_runs
from scenarionet_sim.drivers.own_process import executor_of
from scenarionet_sim.evaluation.comparison import runs_in_words
from scenarionet_sim.evaluation.parts import EvaluationJob, simulate
from scenarionet_sim.evaluation.specification import RULE, Evaluation, scenarios_of
from scenarionet_sim.rollouts.parts import parts_of, run_parts

FORMAT = 1
_NAMED = 3  # scenarios that a message lists
_TRAJECTORY = "trajectory"

Values = Mapping[str, Any]


@dataclass(frozen=True)
class Receipt:
    """What a run was made of, and what came out.

    Attributes:
        run: Name of the run.
        description: As stored with the run: policy, traffic, backend, seed, rollouts, episode, snapshot, software ...
        scenarios: Id and digest of the content of each scenario, in the order of the run.
        rows: Rows of ``results`` by scenario and rollout; the value ``trajectory`` is the digest of the rows of
            ``rollouts``, None for a run that kept none.
        kind: ``run``, or what ``score_receipts`` makes: ``predictions``, ``submission``, ``model``, ``comparison``.
        runs: Receipts of the runs of a comparison.
    """

    run: str
    description: Values
    scenarios: tuple[tuple[str, str], ...]
    rows: tuple[Values, ...]
    kind: str = "run"
    runs: tuple[Receipt, ...] = ()

    def dumps(self) -> str:
        """Return the receipt as JSON; ``loads`` is the opposite, to the last bit."""
        return json.dumps({"format": FORMAT} | asdict(self), indent=1, sort_keys=True) + "\n"

    def write(self, path: str | Path) -> None:
        """Write it to a file."""
        Path(path).write_text(self.dumps(), "utf-8")

    @classmethod
    def read(cls, path: str | Path) -> Receipt:
        """Read a file; raises BadParameter as :meth:`loads`, also if there is none."""
        try:
            return cls.loads(Path(path).read_text("utf-8"))
        except (OSError, UnicodeDecodeError) as error:
            raise BadParameter(f"{path}: cannot be read ({error})") from error

    @classmethod
    def loads(cls, text: str) -> Receipt:
        """Read a receipt.

        Raises:
            BadParameter: It is none, or of a newer version of this software.
        """
        try:
            told = json.loads(text)
            if told["format"] != FORMAT:
                raise BadParameter(f"a receipt of format {told['format']!r}, not {FORMAT}; update this software")
            return cls._read(told)
        except (ValueError, KeyError, TypeError) as error:
            raise BadParameter(
                f"no receipt of a run ({error!r}); `scenarionet runs verify --write` writes one"
            ) from error

    @classmethod
    def _read(cls, told: Values) -> Receipt:
        """Read what JSON holds; raises ValueError, KeyError or TypeError."""
        scenarios = tuple((str(key), str(digest)) for key, digest in told["scenarios"])
        rows, known, kind = tuple({**row} for row in told["rows"]), dict(scenarios), str(told.get("kind", "run"))
        if kind == "run" and any(row["scenario_id"] not in known or not is_count(row["rollout"]) for row in rows):
            raise ValueError("a row of another scenario")
        runs = tuple(map(cls._read, told.get("runs", ())))
        return cls(str(told["run"]), {**told["description"]}, scenarios, rows, kind, runs)


@dataclass(frozen=True)
class Difference:
    """The first value that came out differently.

    Attributes:
        scenario_id, rollout: Its row; of scores and comparisons the names in it, and None.
        column: A column of ``results``, or ``trajectory``.
        stored, found: Its value in the receipt, and now.
    """

    scenario_id: str
    rollout: int | None
    column: str
    stored: Any
    found: Any

    def __str__(self) -> str:
        where = self.scenario_id if self.rollout is None else f"{self.scenario_id}, rollout {self.rollout}"
        return f"{where}: {self.column} is {self.found!r}, the receipt has {self.stored!r}"


@dataclass(frozen=True)
class Verification:
    """Result of computing a run again.

    Attributes:
        run: Name of the run.
        rows: Rows that were compared.
        differing: Rows with a value that differs.
        first: The first such value, in the order of the run.
        largest: Largest absolute difference of numbers by column, of those that differ.
        notes: What is not as it was: the software.
    """

    run: str
    rows: int
    differing: int
    first: Difference | None
    largest: Mapping[str, float]
    notes: tuple[str, ...]


@dataclass(frozen=True)
class _VerifiedPart:
    """Rows of a part as they were, and what simulates it again."""

    job: EvaluationJob
    stored: tuple[Values, ...]
    has_trajectories: bool


def make_receipt(lake: Lake | str | Path, run: str) -> Receipt:
    """Return the receipt of a run of the lake.

    Raises:
        BadParameter: The lake has no run of that name, or one of an older version, which stored less.
        LakeError: A file is damaged.
    """
    lake = lake if isinstance(lake, Lake) else Lake(lake)
    names = evaluation_runs.names(lake.files)
    if run not in names:
        raise BadParameter(f"the lake has no run {run!r}; it has {runs_in_words(names)}")
    description = evaluation_runs.describe(lake.files, run)
    if "policy" not in description or "snapshot" not in description:
        raise BadParameter(f"{run!r} is no run of `scenarionet sim`, which can be computed again")
    loader = scenarios_of(_evaluation(lake, description, description["database"], description["snapshot"]))
    digests = content_digests(Lake(lake.root, description["snapshot"]), loader.scenario_ids)
    results = evaluation_runs.rows(lake.files, run, "results")
    trajectories = trajectory_digests(evaluation_runs.rows(lake.files, run, "rollouts"))
    order = {scenario_id: number for number, scenario_id in enumerate(loader.scenario_ids)}
    rows = sorted(results.to_pylist(), key=lambda row: (order[row["scenario_id"]], row["rollout"]))
    kept = {key: value for key, value in description.items() if key not in ("id", "tables")}
    scenarios = tuple((scenario_id, digests[scenario_id]) for scenario_id in loader.scenario_ids)
    return Receipt(run, kept, scenarios, tuple(_row(row, trajectories) for row in rows))


def verify(
    lake: Lake | str | Path,
    receipt: Receipt | str,
    *,
    workers: int = 1,
    executor: Executor | None = None,
    on_progress: Progress | None = None,
) -> Verification:
    """Simulate a run again and compare every value with what it was.

    Args:
        lake: A lake with the scenarios of the run, its path or its URL.
        receipt: The receipt, or the name of a run of the lake.
        workers: Number of processes.
        executor: Runs the parts instead of local processes, for example on a cluster.
        on_progress: Called after each part.

    Raises:
        BadParameter: The lake lacks a scenario of the run, or has it with another content; or the run was scored by
            another rule than this version's.
    """
    lake = lake if isinstance(lake, Lake) else Lake(lake)
    if isinstance(receipt, str):
        receipt = make_receipt(lake, receipt)
        snapshot = receipt.description["snapshot"]
    else:
        snapshot = lake.snapshot.number
    told, ids = receipt.description, tuple(scenario_id for scenario_id, _ in receipt.scenarios)
    evaluation = _evaluation(lake, told, ids, snapshot)
    for key, wanted in (("rule", RULE), ("part", evaluation.part_size)):
        if told.get(key) != wanted:
            raise BadParameter(
                f"{receipt.run!r} was made with {key} {told.get(key)!r}, this version has {wanted!r}; verify it with "
                f"{told.get('software', 'the version that made it')}"
            )
    check_scenarios(Lake(lake.root, snapshot), receipt)
    stored: dict[str, list[Values]] = {scenario_id: [] for scenario_id in ids}
    for row in receipt.rows:
        stored[row["scenario_id"]].append(row)
    ordered = [rows for scenario_id in ids for rows in [sorted(stored[scenario_id], key=lambda row: row["rollout"])]]
    has_trajectories = any(row[_TRAJECTORY] is not None for row in receipt.rows)
    jobs = []
    for part in parts_of(len(ids) * evaluation.rollouts, evaluation.part_size):
        items = range(part.first, part.end)
        rows = [
            row
            for index in range(part.first // evaluation.rollouts, (part.end - 1) // evaluation.rollouts + 1)
            for row in ordered[index]
            if index * evaluation.rollouts + row["rollout"] in items
        ]
        jobs.append(_VerifiedPart(EvaluationJob(evaluation, part, None), tuple(rows), has_trajectories))
    place = {scenario_id: number for number, scenario_id in enumerate(ids)}
    executor = executor_of(evaluation.policy, evaluation.python, workers, executor)
    found = [
        each for differences in run_parts(jobs, _differences, workers, on_progress, executor) for each in differences
    ]
    found.sort(key=lambda each: (place[each.scenario_id], each.rollout))
    return verification(receipt, found)


def verification(receipt: Receipt, found: Sequence[Difference]) -> Verification:
    """Return what differs from a receipt, the first difference first, as a result."""
    largest: dict[str, float] = {}
    for each in found:
        if isinstance(each.stored, float | int) and isinstance(each.found, float | int):
            largest[each.column] = max(largest.get(each.column, 0.0), abs(each.stored - each.found))
    now, then = version.name_and_version(), receipt.description.get("software")
    notes = () if now == then else (f"made with {then}, computed again with {now}",)
    differing = len({(each.scenario_id, each.rollout) for each in found})
    return Verification(receipt.run, len(receipt.rows), differing, found[0] if found else None, largest, notes)


def _evaluation(lake: Lake, told: Values, database: str | tuple[str, ...] | None, snapshot: int) -> Evaluation:
    names = {field.name for field in fields(Evaluation)} - {"lake", "database", "snapshot"}
    settings = {name: value for name, value in told.items() if name in names}
    return Evaluation(str(lake.root), database, snapshot, **settings)


def content_digests(lake: Lake, ids: Sequence[str]) -> dict[str, str]:
    """Digest of the content of scenarios, as far as the lake has them."""
    query = "SELECT scenario_id, content_hash FROM metadata WHERE list_contains($ids, scenario_id)"
    found = lake.sql(query, {"ids": list(ids)}).rows()
    return {scenario_id: f"{content_hash:016x}" for scenario_id, content_hash in found}


def check_scenarios(lake: Lake, receipt: Receipt) -> None:
    """Raise BadParameter unless a lake has the scenarios of a receipt, with the same content."""
    there = content_digests(lake, [scenario_id for scenario_id, _ in receipt.scenarios])
    absent = [scenario_id for scenario_id, _ in receipt.scenarios if scenario_id not in there]
    if absent:
        raise BadParameter(
            f"{lake.root} lacks {len(absent):,} of {len(receipt.scenarios):,} scenarios of the run, for example "
            f"{', '.join(absent[:_NAMED])}; convert them first"
        )
    changed = [scenario_id for scenario_id, digest in receipt.scenarios if there[scenario_id] != digest]
    if changed:
        raise BadParameter(
            f"{len(changed):,} of {len(receipt.scenarios):,} scenarios have another content in {lake.root} than when "
            f"the run was made, for example {', '.join(changed[:_NAMED])}; convert the same recordings with the same "
            "options and version"
        )


def trajectory_digests(rollouts: pa.Table) -> dict[tuple[str, int], str]:
    """Digest of the rows of each scenario and rollout."""
    found: dict[tuple[str, int], Any] = {}
    for row in rollouts.drop_columns([name for name in ("run",) if name in rollouts.column_names]).to_pylist():
        key = row.pop("scenario_id"), row.pop("rollout") or 0
        found.setdefault(key, hashlib.blake2b(digest_size=16)).update(repr(sorted(row.items())).encode())
    return {key: digest.hexdigest() for key, digest in found.items()}


def _row(row: Values, trajectories: Mapping[tuple[str, int], str]) -> Values:
    kept = {name: value for name, value in row.items() if name != "run"}
    return kept | {_TRAJECTORY: trajectories.get((row["scenario_id"], row["rollout"]))}


# --- on a worker --------------------------------------------------------------------------------------


def _differences(part: _VerifiedPart) -> list[Difference]:
    """Simulate a part again; return every value that differs."""
    rows, rollouts = simulate(part.job)
    schema = tables.load("results").schema
    made = pa.Table.from_pylist([dict(row) for row in rows], schema=schema.remove(schema.get_field_index("run")))
    trajectories = trajectory_digests(rollouts) if part.has_trajectories else {}
    now = {(row["scenario_id"], row["rollout"]): _row(row, trajectories) for row in made.to_pylist()}
    stored = {(row["scenario_id"], row["rollout"]): row for row in part.stored}
    differences = []
    for key, found in now.items():
        before = stored.get(key)
        if before is None:
            differences.append(Difference(*key, "row", None, found.get("status") or found["error"]))
        elif before["error"] is not None or found["error"] is not None:  # the text of an error may differ
            if (before["error"] is None) != (found["error"] is None):
                differences.append(Difference(*key, "error", before["error"], found["error"]))
        else:
            differences += [
                Difference(*key, column, before.get(column), after)
                for column, after in found.items()
                if not is_equal(before.get(column), after)
            ]
    return differences


def is_equal(before: Any, after: Any) -> bool:
    """Whether two values are the same, or both NaN."""
    if isinstance(before, float) and isinstance(after, float) and math.isnan(before):
        return math.isnan(after)
    return bool(before == after)
