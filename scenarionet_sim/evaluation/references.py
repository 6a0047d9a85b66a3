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
from scenarionet_sim.drivers.by_name import RANDOM
from scenarionet_sim.evaluation.evaluation import Evaluation, run_evaluation

POLICIES: Mapping[str, str] = {"recording": "replay", "constant velocity": "constant", "random actions": RANDOM}
"""Policy of each reference: a ceiling and two floors."""


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
        on_progress: As there, but counts the parts of all references.

    Returns:
        Name of each run, by the names of POLICIES.
    """
    names = {}
    for number, (title, policy) in enumerate(POLICIES.items()):

        def count(done: int, parts: int, scenarios: int, number: int = number) -> None:
            if on_progress is not None:
                on_progress(number * parts + done, len(POLICIES) * parts, scenarios)

        is_random = policy == RANDOM
        reference = replace(
            evaluation,
            policy=policy,
            backend="kinematic",
            tracker="lqr",
            seed=evaluation.seed if is_random else 0,
            rollouts=evaluation.rollouts if is_random else 1,
        )
        digest = hashlib.sha256(json.dumps(reference.description, sort_keys=True).encode()).hexdigest()[:12]
        names[title] = f"reference-{policy}-{digest}"
        run_evaluation(reference, names[title], workers=workers, executor=executor, rollouts=False, on_progress=count)
    return names
