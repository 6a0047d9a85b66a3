"""Real schedulers and workers as separate processes on loopback, started for one test and stopped with it."""

from __future__ import annotations

import os
import re
import signal
import subprocess
import sys
from collections.abc import Iterator, Mapping
from pathlib import Path

import pytest

from tests.fixtures.waiting import until

ROOT = Path(__file__).parents[3]


def environment(**others: str) -> dict[str, str]:
    """Environment variables of processes that import this checkout and the tests' converters."""
    return {**os.environ, "PYTHONPATH": str(ROOT), "DASK_DISTRIBUTED__SCHEDULER__ALLOWED_FAILURES": "1", **others}


class Processes:
    """Processes started by a test, each with its output in a file."""

    def __init__(self, folder: Path) -> None:
        self._folder = folder
        self._running: list[subprocess.Popen[bytes]] = []

    def start(
        self, *words: str, variables: Mapping[str, str] | None = None, **how: object
    ) -> tuple[subprocess.Popen[bytes], Path]:
        """Start a Python module; return the process and its output file."""
        log = self._folder / f"process-{len(self._running)}.log"
        with log.open("wb") as output:
            process = subprocess.Popen(
                [sys.executable, "-m", *words],
                stdout=output,
                stderr=subprocess.STDOUT,
                env=environment(**(variables or {})),
                cwd=self._folder,
                start_new_session=True,
                **how,
            )
        self._running.append(process)
        return process, log

    def end(self) -> None:
        for process in reversed(self._running):
            if process.poll() is None:
                os.killpg(process.pid, signal.SIGKILL)
            process.wait()


class Dask(Processes):
    """A scheduler, and workers."""

    def start_scheduler(self, port: int = 0) -> str:
        """Start a scheduler and return its address."""
        self.scheduler, log = self.start(
            "distributed.cli.dask_scheduler", "--host", "127.0.0.1", "--port", str(port), "--no-dashboard"
        )
        addresses = lambda: re.findall(r"tcp://127.0.0.1:\d+", log.read_text())  # noqa: E731
        until(addresses, "the scheduler listens")
        self.address = addresses()[0]
        return self.address

    def start_worker(self, *words: str, **how: object) -> subprocess.Popen[bytes]:
        """Start a worker with one thread and wait until the scheduler lists it."""
        process, log = self.start(
            "distributed.cli.dask_worker", self.address, "--nthreads", "1", "--no-dashboard", "--host", "127.0.0.1",
            "--local-directory", str(self._folder / "scratch"), *words, **how,
        )  # fmt: skip
        until(lambda: "Registered to" in log.read_text(), "the worker is registered")
        return process


@pytest.fixture
def processes(tmp_path: Path) -> Iterator[Processes]:
    started = Processes(tmp_path)
    yield started
    started.end()


@pytest.fixture
def dask(tmp_path: Path) -> Iterator[Dask]:
    """A running scheduler without workers."""
    started = Dask(tmp_path)
    started.start_scheduler()
    yield started
    started.end()
