"""An executor that runs jobs in another interpreter, so that policies share neither modules nor packages.

Run as a program, it is the other side: it reads the jobs from its standard input and answers on its standard output.
"""

from __future__ import annotations

import os
import pickle
import signal
import subprocess
import sys
from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import IO, Any

from scenarionet_data import version
from scenarionet_data.errors import BadParameter, WorkerLost
from scenarionet_data.execution.executors import Done, Executor, OnLost, Work, executor_for
from scenarionet_sim.drivers.code import PolicyCode


@dataclass(frozen=True)
class OwnProcess:
    """Runs jobs in a process of its own, and in its processes. An :class:`Executor`.

    Attributes:
        folders: First on the import path there.
        python: The interpreter; empty for that of this process. This software must be installed in its environment,
            in the same version.
        workers: Number of processes.
    """

    folders: tuple[Path, ...]
    python: str = ""
    workers: int = 1

    def __call__(
        self, jobs: Iterable[Work], do: Callable[[Work], Done], on_lost: OnLost[Work, Done] | None = None
    ) -> Iterator[Done]:
        """Run every job; see :class:`~scenarionet_data.execution.executors.Executor`.

        Raises:
            BadParameter: The interpreter cannot be started, or lacks this version of this software.
        """
        path = os.pathsep.join([*map(str, self.folders), *filter(None, [os.environ.get("PYTHONPATH")])])
        words = [self.python or sys.executable, "-P", "-m", __name__]
        try:
            process = subprocess.Popen(  # noqa: S603 - the interpreter that the user names
                words, stdin=subprocess.PIPE, stdout=subprocess.PIPE, env=os.environ | {"PYTHONPATH": path}
            )
        except OSError as error:
            raise BadParameter(f"{self.python}: {error.strerror}; expected a Python interpreter") from error
        if process.stdin is None or process.stdout is None:
            raise WorkerLost("a process without pipes")
        with process:
            try:
                found = process.stdout.readline().decode(errors="replace").strip()
                if found != version.name_and_version():
                    raise BadParameter(
                        f"{words[0]} has {found or f'no working {version.PACKAGE}'}, not {version.name_and_version()}; "
                        "install that version in its environment"
                    )
                pickle.dump((self.workers, list(jobs), do, on_lost), process.stdin)
                process.stdin.flush()
                while (answer := _read(process.stdout)) is not None:
                    if isinstance(answer, Exception):
                        raise answer
                    yield answer[0]
            except (EOFError, BrokenPipeError) as error:
                raise WorkerLost(
                    f"the process of the policy ended (exit status {process.wait()}); finished work is kept"
                ) from error
            finally:
                process.kill()


def executor_of(policy: str, python: str, workers: int, executor: Executor | None = None) -> Executor | None:
    """Return what runs the jobs of a policy: a process of its own where it needs one, otherwise ``executor``.

    Args:
        policy: A pinned policy.
        python: Its interpreter; empty for that of this process.
        workers: Number of processes.
        executor: Of other policies.

    Raises:
        BadParameter: It needs a process of its own, and there is an executor.
    """
    code = PolicyCode.of(policy)
    if code is None and not python:
        return executor
    if executor is not None:
        raise BadParameter(f"{policy} runs in a process of its own, not on a cluster; name its class as module:Class")
    return OwnProcess((Path.cwd(),) if code is None else (code.folder, code.root), python, workers)


def _read(answers: IO[bytes]) -> Any:
    return pickle.load(answers)  # noqa: S301 - of a process that this one has started


def main() -> None:
    """Answer the jobs of the process that has started this one."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # reaches every process of a terminal; the parent ends this one
    with os.fdopen(os.dup(1), "wb") as answers:
        os.dup2(2, 1)  # what a policy prints
        answers.write(f"{version.name_and_version()}\n".encode())
        answers.flush()

        def answer(content: Any) -> None:
            pickle.dump(content, answers)
            answers.flush()

        try:
            workers, jobs, do, on_lost = _read(sys.stdin.buffer)
            for result in executor_for(workers, len(jobs))(jobs, do, on_lost):
                answer((result,))
        except Exception as error:  # is raised where the jobs are from
            answer(error)
        answer(None)


if __name__ == "__main__":
    main()
