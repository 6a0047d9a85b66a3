"""Start-up: processor time of commands about a small lake in processes of their own, beside the imports below them."""

from __future__ import annotations

import os
import statistics
import subprocess
import sys
import tempfile
from collections.abc import Iterator
from pathlib import Path

from scenarionet_data.conversion import convert
from tests.bench.converting import argoverse2_raw
from tests.bench.measure import Figure

_REPEATS = 5
_VERB = "import sys; from scenarionet_pipelines.cli import main; sys.argv = ['scenarionet', *sys.argv[1:]]; main()"
_LOAD = "import sys; from scenarionet_data import ScenarioLoader; ScenarioLoader(sys.argv[1])[0]"


def figures(recordings: Path | None) -> Iterator[Figure]:
    """Medians, the exit of the process included; the first process, which may compile, does not count."""
    with tempfile.TemporaryDirectory() as folder:
        lake, raw = f"{folder}/lake", str(argoverse2_raw(Path(folder, "val"), recordings, 1))
        convert("pg", "0:4", lake)
        below = _seconds("import numpy, pyarrow, duckdb")
        yield Figure("start: import numpy, pyarrow, duckdb, which nothing here can save", below, "s")
        measured = {
            "list": (_VERB, ["list", lake], 0.4),
            "show": (_VERB, ["show", lake, "pg/v2/1"], 0.4),
            "sql": (_VERB, ["sql", lake, "SELECT count(*) FROM metadata"], 0.4),
            "filter": (_VERB, ["filter", lake, "--where", "num_objects > 1", "--name", "new", "--replace"], 0.4),
            "load a scenario": (_LOAD, [lake], 0.4),
            "convert one log": (_VERB, ["convert", "argoverse2", raw, f"{folder}/new", "--replace", "--quiet"], 0.7),
        }
        for name, (code, words, wanted) in measured.items():
            seconds = _seconds(code, *words)
            yield Figure(f"start: {name}", seconds, "s", f"<= {wanted}", f"{seconds / below:.1f} times the imports")


def _seconds(code: str, *words: str) -> float:
    """Median processor time of a process that runs a piece of code [s]."""
    took = []
    for _ in range(1 + _REPEATS):
        before = os.times()
        subprocess.run([sys.executable, "-c", code, *words], check=True, stdout=subprocess.DEVNULL)
        after = os.times()
        spent = after.children_user - before.children_user + after.children_system - before.children_system
        took.append(spent)
    return statistics.median(took[1:])
