"""Compare the traffic of lakes with that of recordings: Wasserstein distances of what vehicles do.

usage: python docs/compare_traffic.py RECORDED... -- GENERATED...    (each NAME=LAKE or NAME=LAKE:DATABASE)

Prints, for each recorded lake, a table with a row for each figure (its mean, and the distance of every generated lake,
in the figure's unit; the nearest is marked).
"""

from __future__ import annotations

import sys
from dataclasses import fields

import numpy as np
from scipy.stats import wasserstein_distance

from scenarionet_data import ScenarioLoader
from scenarionet_data.arrays.dtypes import Float64
from scenarionet_data.statistics.traffic import TrafficFigures, measure_traffic

UNITS = {"gap": "m", "headway": "s", "speed": "m/s", "acceleration": "m/s2", "lane_changes": "1/km"}
_MOST = 200
"""Scenarios of a lake that are read, evenly spaced."""


def measure(source: str) -> dict[str, Float64]:
    """Samples by figure of the scenarios of LAKE or LAKE:DATABASE."""
    lake, _, database = source.partition(":")
    loader = ScenarioLoader(lake, database or None)
    rows = np.unique(np.linspace(0, len(loader) - 1, min(_MOST, len(loader))).astype(int)).tolist()
    figures = [measure_traffic(loader[row]) for row in rows]
    return {each.name: np.concatenate([getattr(one, each.name) for one in figures]) for each in fields(TrafficFigures)}


def tables(recorded: dict[str, str], generated: dict[str, str]) -> str:
    """The tables as Markdown."""
    made = {name: measure(source) for name, source in generated.items()}
    lines = []
    for name, source in recorded.items():
        real = measure(source)
        lines += [f"| {name} | mean | " + " | ".join(made) + " |", "|---" * (len(made) + 2) + "|"]
        for figure, unit in UNITS.items():
            distances = [wasserstein_distance(real[figure], each[figure]) for each in made.values()]
            cells = [f"**{d:.3g}**" if d == min(distances) else f"{d:.3g}" for d in distances]
            label = figure.replace("_", " ")
            lines.append(f"| {label} [{unit}] | {real[figure].mean():.3g} | " + " | ".join(cells) + " |")
        lines.append("")
    return "\n".join(lines)


if __name__ == "__main__":
    words = sys.argv[1:]
    split = words.index("--")
    sys.stdout.write(
        tables(*(dict(word.split("=", 1) for word in part) for part in (words[:split], words[split + 1 :])))
    )
