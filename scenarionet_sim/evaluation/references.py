"""Ceiling and floors of a run: the recording itself, constant velocity and random actions on the same scenarios.

No score says anything without them: recordings break rules of benchmarks, too, and some scenarios drive themselves.
They are runs like any other, named after what they depend on, so that each is simulated once.
"""

from __future__ import annotations

import hashlib
import json
from collections.abc import Mapping
from dataclasses import replace

from scenarionet_data.execution.executors import Executor
from scenarionet_data.execution.progress import Progress
from scenarionet_data.storage import evaluation_runs
from scenarionet_data.storage.files.places import open_files
from scenarionet_sim.drivers.by_name import RANDOM
from scenarionet_sim.evaluation.evaluation import run_evaluation
from scenarionet_sim.evaluation.specification import Evaluation

POLICIES: Mapping[str, str] = {"recording": "replay", "constant velocity": "constant", "random actions": RANDOM}
"""Policy of each reference: a ceiling and two floors."""


def references(evaluation: Evaluation) -> dict[str, tuple[str, Evaluation]]:
    """Return the runs that an evaluation is compared with, and what they evaluate, by the names of POLICIES."""
    found = {}
    for title, policy in POLICIES.items():
        is_random = policy == RANDOM
        reference = replace(
            evaluation,
            policy=policy,
            backend="kinematic",
            tracker="lqr",
            python="",
            code="",
            seed=evaluation.seed if is_random else 0,
            rollouts=evaluation.rollouts if is_random else 1,
        )
        digest = hashlib.sha256(json.dumps(reference.description, sort_keys=True).encode()).hexdigest()[:12]
        found[title] = f"reference-{policy}-{digest}", reference
    return found


def missing_references(evaluation: Evaluation) -> list[str]:
    """Return the runs that the lake does not have yet, in the order in which they are simulated."""
    there = evaluation_runs.names(open_files(evaluation.lake))
    return [name for name, _ in references(evaluation).values() if name not in there]


def run_references(
    evaluation: Evaluation,
    *,
    workers: int = 1,
    executor: Executor | None = None,
    on_progress: Progress | None = None,
) -> dict[str, str]:
    """Simulate the references of an evaluation that the lake does not have yet, without trajectories.

    Args:
        evaluation: The evaluation that they are compared with: same scenarios, traffic and episode.
        workers, executor: As for :func:`run_evaluation`.
        on_progress: As there, but counts the parts of all missing references.

    Returns:
        Name of each run, by the names of POLICIES.
    """
    missing, runs = missing_references(evaluation), references(evaluation)
    for name, reference in runs.values():

        def count(done: int, parts: int, scenarios: int, name: str = name) -> None:
            if on_progress is not None and name in missing:
                on_progress(missing.index(name) * parts + done, len(missing) * parts, scenarios)

        run_evaluation(reference, name, workers=workers, executor=executor, rollouts=False, on_progress=count)
    return {title: name for title, (name, _) in runs.items()}
