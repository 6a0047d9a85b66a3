"""WOSAC: the realism of simulated agents, as scored by the Waymo Open Sim Agents Challenge.

Source: N. Montali et al., "The Waymo Open Sim Agents Challenge", 2023, and the code and configurations of the owner
(``waymo_open_dataset/wdl_limited/sim_agents_metrics``, release of 2025). 32 rollouts of 8 s follow 1.1 s of history;
every object observed at the last step of the history is simulated; the ego and the tracks to predict are scored.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from scenarionet_data.arrays.dtypes import Array, Bool, Float32, Float64, Int64
from scenarionet_data.building import cut_steps
from scenarionet_data.errors import InvalidScenario
from scenarionet_data.scenario.description import ScenarioDescription
from scenarionet_data.scenario.vocabulary import ObjectType
from scenarionet_sim.metrics.wosac.features import (
    Features,
    RolloutMotion,
    Surroundings,
    central_validity,
    compute_features,
)
from scenarionet_sim.metrics.wosac.likelihood import ScoredFeature, histogram, log_likelihood
from scenarionet_sim.metrics.wosac.submission import ScenarioRollouts

Configuration = Mapping[str, ScoredFeature]
"""How each feature is scored, by name."""

SIM_AGENTS_2025: Configuration = {
    "linear_speed": histogram(0.0, 25.0, 10, 0.05),
    "linear_acceleration": histogram(-12.0, 12.0, 11, 0.05),
    "angular_speed": histogram(-0.628, 0.628, 11, 0.05),
    "angular_acceleration": histogram(-3.14, 3.14, 11, 0.05),
    "distance_to_nearest_object": histogram(-5.0, 40.0, 10, 0.1),
    "collision": ScoredFeature(0.25),
    "time_to_collision": histogram(0.0, 5.0, 10, 0.1),
    "distance_to_road_edge": histogram(-20.0, 40.0, 10, 0.05),
    "offroad": ScoredFeature(0.25),
    "traffic_light_violation": ScoredFeature(0.05),
}
"""The challenge of 2025."""

SIM_AGENTS_2024: Configuration = {
    **SIM_AGENTS_2025,
    "distance_to_road_edge": histogram(-20.0, 40.0, 10, 0.1),
    "traffic_light_violation": ScoredFeature(0.0),
}
"""The challenge of 2024, without traffic lights."""

SCENARIO_GENERATION_2025: Configuration = {
    name: replace(feature, joins_objects=name != "traffic_light_violation") for name, feature in SIM_AGENTS_2025.items()
}
"""The challenge on scenario generation: whole scenarios of 9.1 s, distributions over all objects together."""

CONFIGURATIONS: Mapping[str, Configuration] = {
    "sim-agents-2025": SIM_AGENTS_2025,
    "sim-agents-2024": SIM_AGENTS_2024,
    "scenario-generation-2025": SCENARIO_GENERATION_2025,
}

DURATION = 8.0
"""Time that is simulated [s]."""

_GROUPS = {
    "kinematic": ("linear_speed", "linear_acceleration", "angular_speed", "angular_acceleration"),
    "interactive": ("distance_to_nearest_object", "collision", "time_to_collision"),
    "map_based": ("distance_to_road_edge", "offroad", "traffic_light_violation"),
}
_EVENTS = ("collision", "offroad", "traffic_light_violation")
_VEHICLES_ONLY = ("time_to_collision", "traffic_light_violation")


@dataclass(frozen=True)
class Score:
    """Score of one scenario, or the mean over several.

    Attributes:
        realism: The meta-metric, a weighted sum of the likelihoods.
        likelihoods: Likelihood of the recording under the simulations, by feature.
        groups: Weighted means of the likelihoods: ``kinematic``, ``interactive``, ``map_based``.
        ade, min_ade: Distance from the recording [m], averaged over the observed steps from the start of the history:
            mean over rollouts, and of the best rollout.
        rates: Share of objects with an event in simulation: ``collision``, ``offroad``, ``traffic_light_violation``.
    """

    realism: float
    likelihoods: Mapping[str, float]
    groups: Mapping[str, float]
    ade: float
    min_ade: float
    rates: Mapping[str, float]


def score(
    scenario: ScenarioDescription,
    rollouts: ScenarioRollouts,
    configuration: Configuration = SIM_AGENTS_2025,
    *,
    official: bool = True,
) -> Score:
    """Score the rollouts of a scenario.

    Args:
        scenario: The recording: 91 steps at 10 Hz for the challenges.
        rollouts: Its simulations, of every object observed at ``current_timestep``. For simulated agents they begin at
            the following step, for scenario generation at the first.
        configuration: How features are scored.
        official: Reproduce the owner's choice of the nearest lane, which is wrong away from the starts of segments.

    Raises:
        InvalidScenario: The rollouts do not fit the scenario; the message says what is expected.
    """
    generated = is_generation(configuration)
    rows = _simulated_rows(scenario, rollouts)
    start = 0 if generated else scenario.current_timestep + 1
    if start + rollouts.position.shape[2] != scenario.num_timesteps:
        reason = f"expected {scenario.num_timesteps - start} steps, found {rollouts.position.shape[2]}"
        raise InvalidScenario(scenario.id, "rollouts", reason)
    recorded, simulated = _motions(scenario, rollouts, rows, start)
    chosen = [scenario.ego_id, *(name for name, _ in scenario.tracks_to_predict)]
    ids = scenario.tracks.ids[rows].tolist()
    are_all = generated or not scenario.tracks_to_predict  # other recordings than Waymo's choose none
    evaluated = np.arange(len(rows)) if are_all else np.flatnonzero(np.isin(ids, chosen))
    around = Surroundings.of(scenario)
    valid = scenario.tracks.valid[rows[evaluated]]
    log = compute_features(recorded, evaluated, around, scenario.dt, official=official).since(start)
    sim = compute_features(simulated, evaluated, around, scenario.dt, official=official).since(start)
    is_vehicle = scenario.tracks.object_type[rows[evaluated]] == ObjectType.VEHICLE
    likelihoods, rates = _likelihoods(configuration, log, sim, valid[:, start:], is_vehicle)
    away = np.linalg.norm(simulated.position - recorded.position, axis=-1)[:, evaluated]
    ade = np.zeros(away.shape[:2]) if generated else np.where(valid, away, 0.0).sum(axis=2) / valid.sum(axis=1)
    weights = {name: feature.weight for name, feature in configuration.items()}

    def total(names: Iterable[str]) -> float:
        return sum(weights[name] * likelihoods[name] for name in names)

    groups = {group: total(names) / sum(weights[name] for name in names) for group, names in _GROUPS.items()}
    return Score(total(configuration), likelihoods, groups, float(ade.mean()), float(ade.mean(axis=1).min()), rates)


def log_rollouts(scenario: ScenarioDescription, count: int = 32, *, generated: bool = False) -> ScenarioRollouts:
    """The recording as rollouts for :func:`score`: a ceiling.

    Every object stays where it was last observed, as in the challenge, or drives on, see :func:`drives_on`.

    Args:
        scenario: The recording.
        count: Number of equal rollouts.
        generated: All steps, for scenario generation, instead of those after ``current_timestep``.
    """
    tracks, now = scenario.tracks, scenario.current_timestep
    rows = np.flatnonzero(tracks.valid[:, now])
    valid = tracks.valid[rows]
    observed = np.maximum.accumulate(np.where(valid, np.arange(scenario.num_timesteps), -1), axis=1)
    seen = np.where(observed < 0, valid.argmax(axis=1)[:, None], observed)[:, 0 if generated else now + 1 :]
    position = np.take_along_axis(tracks.position[rows], seen[..., None], axis=1) + scenario.origin
    if drives_on(scenario):
        lag = np.maximum(scenario.timestamps[0 if generated else now + 1 :] - scenario.timestamps[seen], 0.0)
        velocity = np.take_along_axis(tracks.velocity[rows], seen[..., None], axis=1)
        position[..., :2] += lag[..., None] * velocity
    heading = np.take_along_axis(tracks.heading[rows], seen, axis=1)
    return _repeated(scenario, rows, position, heading, count, has_size=generated)


def constant_velocity_rollouts(
    scenario: ScenarioDescription, count: int = 32, *, generated: bool = False
) -> ScenarioRollouts:
    """Every object at its velocity of ``current_timestep``, as rollouts for :func:`score`: a floor.

    Args:
        scenario, count, generated: As for :func:`log_rollouts`.
    """
    tracks, now = scenario.tracks, scenario.current_timestep
    rows = np.flatnonzero(tracks.valid[:, now])
    time = (scenario.timestamps - scenario.timestamps[now])[None, 0 if generated else now + 1 :, None]
    position = np.repeat((tracks.position[rows, now] + scenario.origin)[:, None], time.shape[1], axis=1)
    position[..., :2] += tracks.velocity[rows, now, None] * time
    heading = np.repeat(tracks.heading[rows, now, None], time.shape[1], axis=1)
    return _repeated(scenario, rows, position, heading, count, has_size=generated)


def challenge_id(scenario: ScenarioDescription) -> str:
    """Id of a scenario in rollouts: Waymo's own, or that of the lake for other recordings."""
    return scenario.source.scenario_id if scenario.dataset == "waymo" else scenario.id


def drives_on(scenario: ScenarioDescription) -> bool:
    """Whether objects that are gone go on as they were last seen, instead of staying there as in the challenge.

    A recording from above sees a small place, which most vehicles leave in 8 s: they would block its exits.
    """
    return scenario.dataset != "waymo"


def challenge_steps(scenario: ScenarioDescription) -> ScenarioDescription:
    """The history of a scenario, and the 8 s after it: all of a Waymo scenario, and what is scored of another."""
    until = scenario.timestamps[scenario.current_timestep] + DURATION
    return cut_steps(scenario, slice(0, int(np.searchsorted(scenario.timestamps, until + 1e-3, side="right"))))


def object_numbers(scenario: ScenarioDescription) -> Int64:
    """(N,) numbers of the tracks in rollouts: their ids, or where one is no number, its row below 0."""
    ids = scenario.tracks.ids.tolist()
    return np.array([int(name) if name.isdecimal() else -1 - row for row, name in enumerate(ids)], np.int64)


def is_generation(configuration: Configuration) -> bool:
    """Whether a configuration scores whole scenarios instead of what follows the history."""
    return configuration["linear_speed"].joins_objects


def mean_score(scores: Sequence[Score]) -> Score:
    """The mean over scenarios of every number."""
    return Score(
        float(np.mean([each.realism for each in scores])),
        {name: float(np.mean([each.likelihoods[name] for each in scores])) for name in scores[0].likelihoods},
        {name: float(np.mean([each.groups[name] for each in scores])) for name in scores[0].groups},
        float(np.mean([each.ade for each in scores])),
        float(np.mean([each.min_ade for each in scores])),
        {name: float(np.mean([each.rates[name] for each in scores])) for name in scores[0].rates},
    )


def _simulated_rows(scenario: ScenarioDescription, rollouts: ScenarioRollouts) -> Int64:
    """(N,) rows of the scenario's tracks that the rollouts simulate."""
    tracks = scenario.tracks
    row_of = {number: row for row, number in enumerate(object_numbers(scenario).tolist())}
    expected = {name for name, row in row_of.items() if tracks.valid[row, scenario.current_timestep]}
    found = set(rollouts.object_ids.tolist())
    if found != expected:
        missing, unknown = sorted(expected - found)[:3], sorted(found - expected)[:3]
        reason = "expected every object observed at the current timestep"
        reason += f", without {missing}" if missing else ""
        raise InvalidScenario(scenario.id, "rollouts", reason + (f", found others: {unknown}" if unknown else ""))
    return np.array([row_of[name] for name in rollouts.object_ids.tolist()], np.int64)


def _motions(
    scenario: ScenarioDescription, rollouts: ScenarioRollouts, rows: Int64, start: int
) -> tuple[RolloutMotion, RolloutMotion]:
    """The recorded motion (one rollout) and the simulated one, both with the history before ``start``."""
    tracks, now = scenario.tracks, scenario.current_timestep
    valid = tracks.valid[rows]
    # Unobserved states are the origin of the source's frame in the owner's files.
    position = np.where(valid[..., None], tracks.position[rows] + scenario.origin, 0.0)[None]
    heading = tracks.heading[rows].astype(np.float64)[None]
    size = np.repeat(tracks.size[rows, now, None], scenario.num_timesteps, axis=1)[None]
    if not start:
        size = tracks.size[rows][None]
    recorded = RolloutMotion(
        position, heading, np.ascontiguousarray(size), valid[None] if start else np.ones_like(valid)[None]
    )
    count = len(rollouts.position)
    sizes = np.repeat(size, count, axis=0) if rollouts.size is None or start else rollouts.size
    simulated = RolloutMotion(
        _after(position[:, :, :start], rollouts.position, axis=2),
        _after(heading[:, :, :start], rollouts.heading, axis=2),
        np.ascontiguousarray(sizes, np.float32),
        _after(valid[None, :, :start], np.ones(rollouts.heading.shape, np.bool_), axis=2),
    )
    return recorded, simulated


def _after(history: Array, future: Array, axis: int) -> Array:
    """The same history before each rollout."""
    repeated = np.repeat(history, len(future), axis=0)
    return np.concatenate([repeated, future.astype(history.dtype)], axis=axis)


def _likelihoods(
    configuration: Configuration, log: Features, sim: Features, valid: Bool, is_vehicle: Bool
) -> tuple[dict[str, float], dict[str, float]]:
    """Likelihood of every feature, and the rate of every event.

    Args:
        configuration: How features are scored.
        log, sim: Features (1, E, T) of the recording and (R, E, T) of the simulations.
        valid: (E, T) where the recording observes the object.
        is_vehicle: (E,).
    """
    of_speed = central_validity(valid)
    of_acceleration = central_validity(of_speed)
    of_vehicles = valid & is_vehicle[:, None]
    masks = {
        "linear_speed": of_speed,
        "angular_speed": of_speed,
        "linear_acceleration": of_acceleration,
        "angular_acceleration": of_acceleration,
        **dict.fromkeys(_VEHICLES_ONLY, of_vehicles),
    }
    found, rates = {}, {}
    for name, feature in configuration.items():
        recorded, simulated = getattr(log, name)[0], getattr(sim, name)
        mask = masks.get(name, valid)
        if name in _EVENTS:  # whether it happens at all
            rates[name] = float((simulated & valid).any(axis=2).mean())
            recorded, simulated = (recorded & mask).any(axis=1)[:, None], (simulated & mask).any(axis=2)[..., None]
            mask = np.ones_like(recorded)
        logs = log_likelihood(feature, recorded, simulated)
        # As the owner's code: no mean where nothing is observed.
        found[name] = float(np.exp(logs[mask].mean())) if mask.any() else float("nan")
    return found, rates


def _repeated(
    scenario: ScenarioDescription, rows: Int64, position: Float64, heading: Array, count: int, *, has_size: bool
) -> ScenarioRollouts:
    """The same motion in each rollout, ordered by object id."""
    ids = object_numbers(scenario)[rows]
    order = np.argsort(ids)

    def repeated(values: Array) -> Float32:
        return np.repeat(values[order].astype(np.float32)[None], count, axis=0)

    size = scenario.tracks.size[rows, scenario.current_timestep, None]
    return ScenarioRollouts(
        challenge_id(scenario),
        ids[order],
        repeated(position),
        repeated(heading),
        repeated(np.repeat(size, position.shape[1], axis=1)) if has_size else None,
    )
