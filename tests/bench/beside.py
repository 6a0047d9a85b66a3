"""The simulator beside MetaDrive and beside an earlier version of itself, in turns within one run.

Machines differ by a factor of two from hour to hour, so ratios count: medians of the ratios within each repetition.
"""

from __future__ import annotations

import json
import os
import statistics
import subprocess
import sys
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from scenarionet_data.export import export_database
from tests.bench.measure import Figure

EARLIER = "6bd6a3f"
"""The version before worlds were pooled and steps compiled as one."""

_REPETITIONS = 3
_ROOT = Path(__file__).parents[2]
_WANTED = {"replay": ">= 700", "IDM": ">= 450", "one world": ">= 250", "several agents": ">= 50"}
_CONVERT = "import sys; from scenarionet_data.conversion import convert; convert(*sys.argv[1:])"
_RAYS, _BOUNDARY_RAYS, _SEGMENTS = 120, 12, 15
"""Rays, and segments of lines that a boundary ray passes on average."""

_TEST = 1e-9
"""Seconds for a ray and a box or segment: about ten operations."""


def figures(lake: Path, recordings: Path, objects: float) -> Iterator[Figure]:
    """Rates of this version, of the earlier one and of MetaDrive.

    Args:
        lake: Lake of the recordings.
        recordings: Folder of recordings, with the pickles that the earlier version converts.
        objects: Mean number of objects of a world, for the estimate.
    """
    ours, earlier, metadrive = [], [], []
    with _earlier_version(lake.parent) as sources:
        old_lake = lake.parent / "earlier_lake"
        _python(sources, "-c", _CONVERT, "scenarionet", str(recordings / "scenarionet"), str(old_lake))
        pickles = lake.parent / "pickles"
        export_database(lake, None, pickles, original=False)
        for _ in range(_REPETITIONS):
            ours.append(_rates(_ROOT, lake))
            earlier.append(_rates(sources, old_lake))
            metadrive.append(_metadrive(pickles))
    tests = _RAYS * objects + _BOUNDARY_RAYS * _SEGMENTS
    estimate = f"{tests:,.0f} tests of a ray at 1 ns each: {1 / (tests * _TEST):,.0f}/s"
    for name, wanted in _WANTED.items():
        unit = "agent-steps/s" if name == "several agents" else "steps/s"
        title = f"{ours[0]['agents']:.0f} agents" if name == "several agents" else name
        yield Figure(f"sim: {title}", _median(ours, name), unit, reference=estimate)
        yield Figure(f"sim: {name}, times commit {EARLIER}", _ratio(ours, earlier, name), "")
        if name in metadrive[0]:
            agents = f" of {metadrive[0]['agents']:.0f}" if name == "several agents" else ""
            yield Figure(f"sim: {name}{agents}, MetaDrive 0.4.3, resets not counted", _median(metadrive, name), unit)
            yield Figure(f"sim: {name}, times MetaDrive", _ratio(ours, metadrive, name), "", wanted)
    yield from _two_cores(lake)


def _two_cores(lake: Path) -> Iterator[Figure]:
    """Two threads against one, and against two processes of one thread each, in wall time."""
    shares, gains = [], []
    for _ in range(_REPETITIONS):
        one, both = (_rates(_ROOT, lake, threads, "wall")["replay"] for threads in (1, 2))
        command = _command(lake, 1, "wall")
        running = [subprocess.Popen(command, env=_environment(_ROOT), stdout=subprocess.PIPE) for _ in "ab"]
        plain = sum(_parsed(process.communicate()[0].decode())["replay"] for process in running)
        gains.append(both / one)
        shares.append(both / plain)
    yield Figure("sim: 64 worlds, two threads as a multiple of one", statistics.median(gains), "", ">= 1.7")
    yield Figure("sim: 64 worlds, two threads as a share of two processes", statistics.median(shares), "", ">= 0.9")


@contextmanager
def _earlier_version(folder: Path) -> Iterator[Path]:
    """Sources of the earlier version, from the history of this repository."""
    sources = folder / "earlier"
    subprocess.run(["git", "-C", str(_ROOT), "worktree", "add", "--detach", str(sources), EARLIER], check=True)
    try:
        yield sources
    finally:
        subprocess.run(["git", "-C", str(_ROOT), "worktree", "remove", "--force", str(sources)], check=True)


def _rates(sources: Path, lake: Path, threads: int = 1, clock: str = "processor") -> dict[str, float]:
    return _parsed(_python(sources, *_command(lake, threads, clock)[1:]))


def _command(lake: Path, threads: int, clock: str) -> list[str]:
    return [sys.executable, str(Path(__file__).with_name("rates.py")), str(lake), str(threads), clock]


def _python(sources: Path, *arguments: str) -> str:
    # -P: the current folder, which Python would search first, has this version.
    return _output([sys.executable, "-P", *arguments], _environment(sources))


def _output(command: list[str], environment: Mapping[str, str] | None = None) -> str:
    """Return what a program prints.

    Raises:
        RuntimeError: It fails, with the end of its errors.
    """
    done = subprocess.run(command, env=environment, capture_output=True, text=True, check=False)
    if done.returncode:
        raise RuntimeError(f"{' '.join(command)} failed: {done.stderr[-2000:]}")
    return done.stdout


def _environment(sources: Path) -> dict[str, str]:
    return os.environ | {"PYTHONPATH": str(sources)}


def _metadrive(database: Path) -> dict[str, float]:
    """MetaDrive's steps per second by traffic on a database of pickles, if its environment is there."""
    python = _ROOT / ".venv-metadrive" / "bin" / "python"
    if not python.exists():
        return {}
    command = [str(python), str(_ROOT / "tests" / "metadrive" / "speed.py"), str(database)]
    found = _parsed(_output(command))
    names = {"replay": "replay", "IDM": "reactive", "several agents": "several agents"}
    rates = {ours: found[theirs]["steps"] / found[theirs]["stepping"] for ours, theirs in names.items()}
    return rates | {"one world": rates["replay"], "agents": found["several agents"]["agents"]}


def _parsed(printed: str) -> dict[str, Any]:
    (result,) = [line.removeprefix("RESULT") for line in printed.splitlines() if line.startswith("RESULT")]
    parsed: dict[str, Any] = json.loads(result)
    return parsed


def _median(runs: list[dict[str, float]], name: str) -> float:
    return statistics.median(run[name] for run in runs)


def _ratio(runs: Sequence[Mapping[str, float]], others: Sequence[Mapping[str, float]], name: str) -> float:
    return statistics.median(run[name] / other[name] for run, other in zip(runs, others, strict=True))
