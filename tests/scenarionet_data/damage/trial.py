"""Run trials in processes that are started again when one ends them, and count what came of them."""

from __future__ import annotations

import json
import subprocess
import sys
import tempfile
from collections import Counter
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, field
from pathlib import Path


@dataclass
class Outcome:
    """What came of some trials.

    Attributes:
        counts: Number of trials by kind: same or error, with the way of reading if there are several; what is wrong.
        aborts: Trials that ended their process.
        findings: Trials that should not be, with what they found.
    """

    counts: Counter[str] = field(default_factory=Counter)
    aborts: list[str] = field(default_factory=list)
    findings: list[str] = field(default_factory=list)

    @property
    def num_trials(self) -> int:
        """Number of trials."""
        return self.counts.total() + len(self.aborts)

    @property
    def num_errors(self) -> int:
        """Number of trials that ended in an error of the project."""
        return sum(number for kind, number in self.counts.items() if kind.split()[0] == "error")


def run(trial: str, count: int, lakes: list[Path], workers: int = 2, first: int = 0) -> Outcome:
    """Run ``count`` trials of a kind, from the seed ``first`` on, on lakes in turn."""
    with ThreadPoolExecutor(workers) as pool:
        parts = pool.map(lambda k: _part(trial, first + k, workers, first + count, lakes), range(workers))
        total = Outcome()
        for part in parts:
            total.counts += part.counts
            total.aborts += part.aborts
            total.findings += part.findings
    return total


def _part(trial: str, first: int, step: int, count: int, lakes: list[Path]) -> Outcome:
    outcome = Outcome()
    while first < count:
        words = [trial, str(first), str(step), str(count), *map(str, lakes)]
        command = [sys.executable, "-m", "tests.scenarionet_data.damage.worker", *words]
        with (
            tempfile.TemporaryFile("w+") as errors,
            subprocess.Popen(command, stdout=subprocess.PIPE, stderr=errors, text=True) as worker,
        ):
            last = None
            for line in worker.stdout or ():
                answer = json.loads(line)
                last = answer.get("begins", last)
                if "found" in answer:
                    kind = answer["found"].partition(":")[0]
                    outcome.counts[kind] += 1
                    if kind.split()[0] not in ("same", "error"):
                        outcome.findings.append(f"{answer['lake']} {answer['seed']} {answer['found']}")
            if worker.wait() == 0:
                return outcome
            errors.seek(0)
            told = errors.read().strip()[-300:]
        if last is None:
            raise RuntimeError(f"the worker did not start: {told}")
        outcome.aborts.append(f"{trial} {last}: exit {worker.returncode} {told}")
        first = last + step
    return outcome
