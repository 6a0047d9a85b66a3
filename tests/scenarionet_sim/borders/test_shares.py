"""Shares of correlated parameters that fail."""

from __future__ import annotations

import math

import numpy as np
import pytest

from scenarionet_data.logical import read_logical
from scenarionet_sim import SearchSpace
from scenarionet_sim.borders.lattice import MIXED
from scenarionet_sim.borders.search import FAILS, IMPOSSIBLE, PASSES, SearchReport

FIXED = {"ego_speed": 25, "lateral_time": 4}


def space(tmp_path, correlation: float) -> SearchSpace:
    pytest.importorskip("scipy", reason="the extra `vary` is not installed")
    path = tmp_path / "mine.toml"
    path.write_text(f'{read_logical("cut_in").text}\n[correlation]\n"gap, slower" = {correlation}\n')
    return SearchSpace(str(path), "constant", FIXED)


def test_shares_are_those_of_the_normal_distribution(tmp_path):
    """Both below their medians with 1/4 + asin(r) / (2 pi), Sheppard's formula."""
    found = space(tmp_path, 0.6).shares(2)
    both = 0.25 + math.asin(0.6) / (2 * math.pi)
    assert found == pytest.approx(np.array([[both, 0.5 - both], [0.5 - both, both]]), abs=1e-3)
    assert SearchSpace("cut_in", "constant", FIXED).shares(2).tolist() == [[0.25, 0.25], [0.25, 0.25]]


def test_the_share_that_fails_counts_cells_by_their_shares():
    regions = np.array([[FAILS, MIXED], [PASSES, IMPOSSIBLE]])
    shares = np.array([[0.1, 0.2], [0.3, 0.4]])
    report = SearchReport(("a", "b"), (), regions, 0, 0, 0.25, "", 0, 0, shares)
    assert report.failing == pytest.approx((0.1 / 0.6, 0.3 / 0.6))
