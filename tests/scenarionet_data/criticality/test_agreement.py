"""Criticality is that of CommonRoad-CriMe 0.4.5, and safe distances are those of ad-rss 5.0.0.

Their answers are a fixture, made by ``tests/interop/crime_answers.py``; ``tests/interop/crime_corrections.py`` lists
the errors that are corrected first. ``tests/interop/test_criticality.py`` asks them anew.
"""

from __future__ import annotations

import gzip
import json

import pytest

from tests.fixtures.examples import ROOT
from tests.scenarionet_data.criticality.agreement import compare, rss_differences
from tests.scenarionet_data.criticality.scenes import SEEDS, scenes

FIXTURE = ROOT / "tests" / "fixtures" / "criticality.json.gz"


@pytest.fixture(scope="module")
def answers():
    return json.loads(gzip.decompress(FIXTURE.read_bytes()))


@pytest.mark.parametrize("seeds", [SEEDS[:2], pytest.param(SEEDS, marks=pytest.mark.integration)], ids=["some", "all"])
def test_values_are_those_of_commonroad_crime(seeds, answers):
    compared = list(scenes(seeds))
    found = compare(compared, answers["scenes"])
    assert len(compared) == len(seeds) and found.differences == []
    if seeds == SEEDS:
        assert len(seeds) >= 20
        assert [name for name, each in found.figures.items() if each["finite"] < 10] == []


def test_safe_distances_are_those_of_ad_rss(answers):
    assert len(answers["rss"]) >= 40
    assert rss_differences(answers["rss"]) < 1e-6
