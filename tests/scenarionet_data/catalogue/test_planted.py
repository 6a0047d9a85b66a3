"""Disturbances that were planted in traffic with noise are found, nothing else is, and their parameters are right."""

from __future__ import annotations

import pytest

from scenarionet_data.catalogue import gather_catalogue
from tests.fixtures.lakes import write_lake
from tests.fixtures.planted import DT, KINDS, Noise, planted

pytestmark = pytest.mark.integration

TOLERANCE = {"ego_speed": 0.0, "speed": 0.1, "gap": 0.1, "lateral_speed": 0.0, "rate": 0.0, "revealed_gap": 0.1}
"""Least error that is allowed beside 2 % [m], [m/s]: gaps of a few metres, and vehicles at walking pace."""


def score(lake, truths):
    """Recall, precision, and by parameter the relative errors of those that were found; see TOLERANCE."""
    found = gather_catalogue(lake).disturbances.to_pylist()
    wanted = {key: truth for key, truth in truths.items() if truth["kind"] != "none"}
    matched, errors = {}, {}
    for row in found:
        truth = wanted.get(row["scenario_id"], {"kind": "none"})
        when = row["last_timestep"] if row["definition"] == "cut_out" else row["first_timestep"]
        if row["definition"] == truth["kind"] and row["track_id"] == "v1" and abs(when * DT - truth["at"]) <= 0.5:
            matched[row["scenario_id"]] = row
    for key, row in matched.items():
        for name, least in TOLERANCE.items():
            if name in wanted[key]:
                off = abs(row[name] - wanted[key][name])
                errors.setdefault((row["definition"], name), []).append(
                    0.0 if off <= least else off / abs(wanted[key][name])
                )
    counted = [row for row in found if row["definition"] != "acceleration"]
    return len(matched) / len(wanted), len(matched) / len(counted), errors


def test_a_few_of_each_are_found(tmp_path):
    scenarios, truths = planted([*KINDS] * 6, 3, Noise())
    recall, precision, errors = score(write_lake(tmp_path / "lake", scenarios), truths)
    assert recall == precision == 1.0
    assert max(max(each) for each in errors.values()) <= 0.05


@pytest.mark.long
def test_a_thousand_of_each_are_found(tmp_path, record_testsuite_property):
    scenarios, truths = planted([*KINDS] * 1000, 11, Noise())
    recall, precision, errors = score(write_lake(tmp_path / "lake", scenarios), truths)
    record_testsuite_property("recall", recall)
    record_testsuite_property("precision", precision)
    for (kind, name), each in sorted(errors.items()):
        each.sort()
        within = sum(error <= 0.02 for error in each) / len(each)
        record_testsuite_property(f"{kind} {name} within 2 %", within)
        assert within >= 0.98, (kind, name)
    assert recall >= 0.98 and precision >= 0.98
