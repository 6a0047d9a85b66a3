"""Run the benchmarks, print a table and write ``bench.json``: ``python -m tests.bench [--only load]``."""

from __future__ import annotations

import argparse
import json
import platform
from collections.abc import Callable, Iterator
from importlib.metadata import version
from pathlib import Path

from rich.console import Console
from rich.table import Table

from tests.bench import (
    bridges,
    cameras,
    cameras_on_card,
    cluster,
    converting,
    growth,
    learning,
    loading,
    lyft,
    maintaining,
    mining,
    nuplan,
    nuscenes,
    observing,
    packing,
    plots,
    remote,
    samples,
    scale,
    sim,
    starting,
    variations,
    web,
)
from tests.bench.measure import Figure

_OF_THEIR_OWN = {"bridges", "card", "learn"}
"""Groups that need an environment of their own, and run only by name."""


def main() -> None:
    """Run all groups, or one."""
    recordings = converting.recordings_folder()
    groups: dict[str, Callable[[], Iterator[Figure]]] = {
        "bridges": bridges.figures,
        "cameras": cameras.figures,
        "card": cameras_on_card.figures,
        "cluster": lambda: cluster.figures(recordings),
        "growth": lambda: growth.figures(recordings),
        "convert": lambda: converting.figures(recordings),
        "lyft": lambda: lyft.figures(recordings),
        "nuplan": lambda: nuplan.figures(recordings),
        "nuscenes": lambda: nuscenes.figures(recordings),
        "learn": lambda: learning.figures(recordings),
        "load": lambda: loading.figures(recordings),
        "maintain": lambda: maintaining.figures(recordings),
        "mine": lambda: mining.figures(recordings),
        "pack": lambda: packing.figures(recordings),
        "remote": lambda: remote.figures(recordings),
        "observe": lambda: observing.figures(recordings),
        "plots": lambda: plots.figures(recordings),
        "samples": lambda: samples.figures(recordings),
        "scale": scale.figures,
        "sim": lambda: sim.figures(recordings),
        "start": lambda: starting.figures(recordings),
        "vary": variations.figures,
        "web": lambda: web.figures(recordings),
    }
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--only", choices=groups, action="append", help="run this group; may be repeated")
    parser.add_argument("--json", type=Path, default=Path("bench.json"), help="where to write the figures")
    arguments = parser.parse_args()
    console = Console()
    console.print(f"recordings: {recordings or 'none (SCENARIONET_TEST_DATA is unset): written fixtures are used'}")
    found: list[Figure] = []
    for name in arguments.only or [name for name in groups if name not in _OF_THEIR_OWN]:
        for figure in groups[name]():
            found.append(figure)
            console.print(f"{figure.name}: {figure.value:.3g} {figure.unit}")
    console.print(_table(found))
    machine = {"python": platform.python_version(), "machine": platform.platform()}
    machine |= {name: version(name) for name in ("numpy", "pyarrow", "duckdb", "polars", "numba")}
    arguments.json.write_text(json.dumps({"machine": machine, "figures": [f.row() for f in found]}, indent=1))


def _table(figures: list[Figure]) -> Table:
    table = Table("figure", "measured", "unit", "wanted", "", "elsewhere", title="Benchmarks (medians)")
    marks = {True: "yes", False: "NO", None: ""}
    for figure in figures:
        mark = marks[figure.is_reached]
        table.add_row(figure.name, f"{figure.value:.3g}", figure.unit, figure.wanted, mark, figure.reference)
    return table


if __name__ == "__main__":
    main()
