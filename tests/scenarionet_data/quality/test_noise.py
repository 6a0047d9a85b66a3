"""Budgets derived from noise hold for motion with that noise, and gross errors break them."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from scenarionet_data.building import make_tracks
from scenarionet_data.building.motion import estimate_motion
from scenarionet_data.converters.argoverse1 import RARE_NOISE, USUAL_NOISE, Argoverse1
from scenarionet_data.converters.base import Budgets
from scenarionet_data.quality.checks import run_checks
from scenarionet_data.scenario.description import ScenarioDescription
from tests.fixtures.lakes import write_lake
from tests.fixtures.scenarios import make_scenario

NUM_SCENARIOS = 20
STEPS = 50


def noise(rng: np.random.Generator, shape: tuple[int, ...], usual: float, rare: float) -> np.ndarray:
    """Errors in the plane: 75 % below ``usual``, 99.5 % below ``rare``; normal ones, and some per cent far off."""
    size = usual / 1.665 * np.hypot(*rng.normal(size=(2, *shape)))
    size = np.where(rng.random(shape) < 0.02, rng.uniform(usual, rare * 4 / 3, shape), size)
    turn = rng.uniform(-np.pi, np.pi, shape)
    return np.stack([size * np.cos(turn), size * np.sin(turn)], axis=-1)


def recorded(seed: int, usual: float = USUAL_NOISE, rare: float = RARE_NOISE) -> ScenarioDescription:
    """Twelve objects that drive along arcs, with noise in their positions, at uneven times; velocities are fitted."""
    rng = np.random.default_rng(seed)
    times = np.arange(STEPS) * 0.1 + rng.uniform(-0.01, 0.01, STEPS)
    times -= times[0]
    speed, turn, start = rng.uniform(4, 15, 12), rng.uniform(-0.2, 0.2, 12), rng.uniform(-60, 60, (12, 2))
    course = rng.uniform(-np.pi, np.pi, 12)[:, None] + turn[:, None] * times
    step = np.stack([np.cos(course), np.sin(course)], axis=-1) * speed[:, None, None]
    place = start[:, None] + np.concatenate(
        [np.zeros((12, 1, 2)), np.cumsum((step[:, 1:] + step[:, :-1]) / 2 * np.diff(times)[:, None], axis=1)], axis=1
    )
    place += noise(rng, (12, STEPS), usual, rare)
    track, frame = np.repeat(np.arange(12), STEPS), np.tile(np.arange(STEPS), 12)
    found = estimate_motion(track, frame, place.reshape(-1, 2), times, "recorded", np.zeros(len(track), np.bool_))
    position = np.append(found.position, np.zeros((12, STEPS, 1)), axis=2)
    tracks = make_tracks(
        [f"t{k}" for k in range(12)],
        np.ones(12),
        position,
        found.course,
        found.velocity,
        np.ones((12, 3)),
        found.valid,
        origin=np.zeros(3),
    )
    empty = make_scenario(seed, num_objects=2, num_steps=STEPS, has_map=False, has_z=False, dataset="argoverse1")
    return replace(empty, tracks=tracks, timestamps=times, origin=np.zeros(3), extras={})


def num_broken(scenarios: list[ScenarioDescription], folder: Path, rule: str) -> int:
    found = {result.name: result for result in run_checks(write_lake(folder, scenarios)).results}
    return found[rule].num_scenarios


def test_defaults_are_those_of_the_stated_noise() -> None:
    derived = Budgets.from_noise(0.025, 0.25)
    assert (derived.velocity_median, derived.velocity_p99) == (Budgets().velocity_median, Budgets().velocity_p99)


def errors(scenario: ScenarioDescription, velocity: np.ndarray) -> np.ndarray:
    """Differences of velocity and change of position, as the rule measures them [m/s]."""
    moved = np.diff(scenario.tracks.position[..., :2], axis=1) / np.diff(scenario.timestamps)[:, None]
    return np.hypot(*((velocity[:, 1:] + velocity[:, :-1]) / 2 - moved)[:, 1:-1].reshape(-1, 2).T)


@pytest.mark.parametrize(("usual", "rare"), [(USUAL_NOISE, RARE_NOISE), (0.025, 0.25), (0.05, 0.1)])
def test_budgets_hold_for_the_noise_that_they_are_derived_from(usual: float, rare: float) -> None:
    velocity = usual / 1.665 / 1.05
    budgets = Budgets.from_noise(usual, rare, velocity=velocity)
    outliers = 0
    for seed in range(NUM_SCENARIOS):
        scenario = recorded(seed, usual, rare)
        found = errors(scenario, scenario.tracks.velocity)
        outliers += np.median(found) > budgets.velocity_median or np.percentile(found, 99) > budgets.velocity_p99
        assert np.hypot(*scenario.tracks.velocity.reshape(-1, 2).T).max() < budgets.step_speed
    assert outliers == 0


GROSS: dict[str, Callable[[np.ndarray, np.ndarray], np.ndarray]] = {
    "km/h": lambda velocity, heading: velocity * 3.6,
    "body axes": lambda velocity, heading: np.stack([np.hypot(*velocity.T).T, np.zeros(heading.shape)], axis=-1),
    "swapped axes": lambda velocity, heading: velocity[..., ::-1],
    "mirrored": lambda velocity, heading: velocity * [1, -1],
    "one sign": lambda velocity, heading: np.abs(velocity),
    "a clock of half the rate": lambda velocity, heading: velocity * 2,
}


@pytest.mark.parametrize("how", GROSS)
def test_gross_errors_are_found(how: str) -> None:
    budgets, found = Argoverse1.budgets, 0
    for seed in range(NUM_SCENARIOS):
        scenario = recorded(seed)
        wrong = errors(scenario, GROSS[how](scenario.tracks.velocity, scenario.tracks.heading))
        found += np.median(wrong) > budgets.velocity_median or np.percentile(wrong, 99) > budgets.velocity_p99
    assert found > Argoverse1.budgets.outliers * NUM_SCENARIOS
    assert found >= 0.9 * NUM_SCENARIOS


@pytest.mark.long
def test_rules_of_check_agree(tmp_path: Path) -> None:
    scenarios = [recorded(seed) for seed in range(4)]
    for rule in ("velocity_is_motion", "heading_is_direction", "nobody_teleports"):
        assert num_broken(scenarios, tmp_path / rule, rule) == 0
    tracks = [replace(s.tracks, velocity=(s.tracks.velocity * 3.6).astype(np.float32)) for s in scenarios]
    wrong = [replace(s, tracks=t) for s, t in zip(scenarios, tracks, strict=True)]
    assert num_broken(wrong, tmp_path / "wrong", "velocity_is_motion") == 4
