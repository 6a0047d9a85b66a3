"""Compare criticality with answers of CommonRoad-CriMe and ad-rss."""

from __future__ import annotations

import time
from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np

from scenarionet_data.criticality import MEASURES
from scenarionet_data.criticality.encounters import distances
from scenarionet_data.criticality.rss import safe_distance, safe_lateral_distance
from scenarionet_data.criticality.scene import Assumptions, Meeting
from tests.scenarionet_data.criticality.scenes import Compared

_ABSOLUTE, _RELATIVE = 1e-3, 1e-5


class Agreement(NamedTuple):
    """How far values agree.

    Attributes:
        figures: By measure, the number of values, of those that are finite and not 0, and the largest difference: as a
            share of values above 1.
        differences: Values that differ: scenario, measure, other, step, theirs, ours.
        ratio: How many times their processor time is that of ours, for all measures of one pair and step.
    """

    figures: dict[str, dict[str, float]]
    differences: list[tuple[str, str, str, int, float, float]]
    ratio: float


def compare(compared: Sequence[Compared], answers: Mapping[str, Any]) -> Agreement:
    """Compare scenes with their answers."""
    figures = {name: {"values": 0, "finite": 0, "largest": 0.0} for name in MEASURES}
    differences, ours, theirs = [], 0.0, 0.0
    for each in compared:
        answer = answers[each.scenario.id]
        scene = Meeting(each.scene.traffic, each.scene.row)
        started = time.process_time()
        values = {name: MEASURES[name].function(scene) for name in answer["values"]}
        ours += (time.process_time() - started) / scene.is_met.sum()
        theirs += sum(answer["seconds"].values())
        for name, others in answer["values"].items():
            for other, steps in others.items():
                row = each.scenario.tracks.index(other)
                for step, text in steps:
                    if np.isnan(scene.s[scene.row, step]):
                        continue  # off the lanes nothing is defined along them, and theirs is infinite
                    mine, wanted = float(values[name][row, step]), float(text or "nan")
                    found = figures[name]
                    found["values"] += 1
                    if np.isfinite(wanted) and np.isfinite(mine):
                        found["finite"] += int(wanted != 0)
                        if _is_tie(name, scene, row, step, wanted, mine):
                            continue
                        found["largest"] = max(found["largest"], abs(wanted - mine) / max(1.0, abs(wanted)))
                    if not np.isclose(wanted, mine, rtol=_RELATIVE, atol=_ABSOLUTE, equal_nan=True):
                        differences.append((each.scenario.id, name, other, step, wanted, mine))
    return Agreement({name: found for name, found in figures.items() if found["values"]}, differences, theirs / ours)


def _is_tie(name: str, scene: Meeting, row: int, step: int, wanted: float, mine: float) -> bool:
    """Whether two times of closest encounter have the same distance: cars at one speed are as close for a while."""
    if name != "ttce":
        return False
    seconds = scene.traffic.seconds
    at = np.searchsorted(seconds, seconds[step] + np.array([wanted, mine]) - 1e-6)
    return bool(np.ptp(distances(scene)[row, at]) < 1e-4)


def rss_differences(cases: Sequence[Sequence[float]]) -> float:
    """Return the largest difference of safe distances [m] from ad-rss; rows of speeds and its two distances."""
    behind, ahead, left, right, longitudinal, lateral = np.array(cases).T
    ours = safe_distance(behind, ahead, Assumptions()), safe_lateral_distance(left, right, Assumptions())
    # It gives less than 0 to two that part slowly.
    return float(max(np.abs(ours[0] - longitudinal).max(), np.abs(ours[1] - np.maximum(lateral, 0)).max()))
