"""Soft rules within the budgets declared by a dataset's converter."""

from __future__ import annotations

from dataclasses import asdict, replace

import numpy as np
import pytest

from scenarionet_data import converters
from scenarionet_data.converters.base import Budgets
from scenarionet_data.quality import checks
from scenarionet_data.quality.checks import run_checks
from scenarionet_data.scenario.description import ScenarioDescription
from tests.fixtures.lakes import write_lake
from tests.fixtures.motion import motion_errors
from tests.fixtures.violations import changed, jump, mapped, sound


def budgeted(monkeypatch, **numbers):
    """Let the made dataset's converter declare these budgets."""
    monkeypatch.setattr(converters, "budgets", lambda dataset: Budgets(**numbers))


def noisy(seed: int) -> ScenarioDescription:
    """A scenario whose velocities are off by about 1 m/s."""
    scenario = sound(seed)
    noise = np.random.default_rng(seed).normal(0, 1, scenario.tracks.velocity.shape) * scenario.tracks.valid[..., None]
    tracks = replace(scenario.tracks, velocity=(scenario.tracks.velocity + noise).astype(np.float32))
    return replace(scenario, tracks=tracks)


@pytest.fixture(scope="module")
def noisy_lake(tmp_path_factory):
    return write_lake(tmp_path_factory.mktemp("noisy"), [noisy(seed) for seed in range(4)])


@pytest.mark.parametrize(
    ("check", "field", "part", "quantile"),
    [
        ("velocity_is_motion", "velocity_median", 0, 0.5),
        ("velocity_is_motion", "velocity_p99", 0, 0.99),
        ("heading_is_direction", "heading_p99", 1, 0.99),
    ],
)
def test_rules_measure_the_same_values_as_the_oracle(check, field, part, quantile, noisy_lake, monkeypatch):
    """With a budget between the scenarios' values, exactly those above it are reported."""
    figures = {s.id: np.quantile(motion_errors(s)[part], quantile) for s in map(noisy, range(4))}
    middle = float(np.mean(sorted(figures.values())[1:3]))
    large = {"velocity_median": 99.0, "velocity_p99": 99.0, "heading_p99": 9.0, "outliers": 0.0}
    budgeted(monkeypatch, **(large | {field: middle}))
    (result,) = run_checks(noisy_lake, names=[check]).results
    assert {scenario_id for scenario_id, _ in result.examples} == {i for i, found in figures.items() if found > middle}
    assert len(result.examples) == 2


@pytest.mark.parametrize(("outliers", "is_met"), [(0.0, False), (0.24, False), (0.25, True)])
def test_budgeted_share_of_scenarios_may_violate_soft_rule(outliers, is_met, tmp_path, lenient, monkeypatch):
    lake = write_lake(tmp_path, [jump(sound(1)), *(sound(seed) for seed in (2, 3, 4))])
    budgeted(monkeypatch, outliers=outliers)
    (result,) = run_checks(lake, names=["nobody_teleports"]).results
    assert (result.num_scenarios, result.is_met) == (1, is_met)
    budgeted(monkeypatch, outliers=1.0)
    broken = changed("tracks", heading=((0, 3), -4))(sound(5))
    assert not run_checks(write_lake(tmp_path, [broken], "b"), names=["headings_are_wrapped"]).results[0].is_met


@pytest.mark.parametrize(
    ("budget", "rule"), [({"step_speed": 950.0}, "nobody_teleports"), ({"link_gap": 6.5}, "successors_are_close")]
)
def test_jumps_are_limited_by_a_budget(budget, rule, tmp_path, lenient, monkeypatch):
    gap = mapped(("a", 0, 5, [], ["b"]), ("b", 11, 99, ["a"], []))
    lake = write_lake(tmp_path, [gap(jump(sound(1)))])
    assert not run_checks(lake, names=[rule]).results[0].is_met
    budgeted(monkeypatch, **budget)
    assert run_checks(lake, names=[rule]).results[0].is_met


def test_dataset_without_its_converter_uses_default_budgets(tmp_path):
    (row,) = checks.budget_table(write_lake(tmp_path, [sound(1)])).to_pylist()
    assert row == {"dataset": "made", **asdict(Budgets())}
    assert converters.budgets("argoverse1") == converters.get("argoverse1").budgets != Budgets()
