"""How well a forecaster predicts the scenarios of a database, beside constant velocity and a Kalman filter."""

from __future__ import annotations

from scenarionet_data.forecasts.forecaster import (  # first: says how to install torch
    Forecaster,
    ForecasterConfig,
    Predictor,
    TensorBatch,
    load,
    measure,
)

# isort: split
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import torch

from scenarionet_data.arrays.dtypes import Array, Float64
from scenarionet_data.errors import BadParameter
from scenarionet_data.forecasts.scoring import FAN
from scenarionet_data.query.lake_view import LakeView

MISS = 2.0
"""Distance of the last point from which on a target counts as missed, as in Argoverse [m]."""


@dataclass(frozen=True)
class DatabaseScore:
    """Scores of one predictor over the targets of a database.

    Attributes:
        name: The predictor.
        modes: Trajectories of a target; the one with the lowest error counts.
        min_ade, min_fde: Mean distance, and distance at the end [m], over targets whose future is recorded (wholly).
        miss_rate: Share of targets whose nearest end is more than 2 m away.
        targets: Targets with a recorded end.
    """

    name: str
    modes: int
    min_ade: float
    min_fde: float
    miss_rate: float
    targets: int


def score_forecaster(lake: LakeView, run: str, database: str | Sequence[str]) -> list[DatabaseScore]:
    """Score the trained forecaster of a run, and the predictors that learn nothing, on the same targets.

    Args:
        lake: The lake.
        run: The training run.
        database: Database whose scenarios are predicted, or their ids.

    Raises:
        LakeError: The run cannot be loaded, see :func:`.forecaster.load`.
        BadParameter: The database has no scenario that is long enough.
    """
    model, config = load(lake, run)
    samples = config.samples(lake, database, is_training=False)
    if not len(samples):
        named = database if isinstance(database, str) else "these scenarios"
        raise BadParameter(
            f"{named}: no scenario has {config.history + config.future:g} s with a moving road user, which the "
            "forecaster predicts; give another database"
        )
    predictors: dict[str, Predictor] = {
        run: model.modes,
        f"{run}, most probable": _most_probable(model),
        "constant velocity": constant_velocity(config),
        "Kalman filter": kalman_filter(config),
        "six constant velocities": fan(config),
    }
    found = []
    for name, predictor in predictors.items():
        mean, end = measure(predictor, samples)
        known = end[np.isfinite(end)]
        modes = {run: config.modes, "six constant velocities": len(FAN)}.get(name, 1)
        numbers = float(np.nanmean(mean)), float(known.mean()), float((known > MISS).mean())
        found.append(DatabaseScore(name, modes, *numbers, len(known)))
    return found


def _most_probable(model: Forecaster) -> Predictor:
    @torch.no_grad()
    def predict(batch: TensorBatch) -> Array:
        model.eval()
        modes, logits = model(batch)
        path: Array = modes[torch.arange(len(modes)), logits.argmax(dim=1)][:, None].numpy()
        return path

    found: Predictor = predict
    return found


def fan(config: ForecasterConfig) -> Predictor:
    """Return the floor of predictors with six modes: constant velocities that are slower, faster, or turned."""
    times = config.dt * np.arange(1, config.window.num_future + 1)
    factors, angles = np.array(FAN).T
    turns = factors * np.array([[np.cos(angles), -np.sin(angles)], [np.sin(angles), np.cos(angles)]])

    def predict(batch: TensorBatch) -> Array:
        velocity = np.einsum("ijk,bj->bki", turns, batch["history"][:, 0, -1, 3:5].numpy())
        path: Array = velocity[:, :, None] * times[:, None]
        return path

    return predict


def constant_velocity(config: ForecasterConfig) -> Predictor:
    """Return the predictor that keeps the current velocity."""
    times = config.dt * np.arange(1, config.window.num_future + 1)

    def predict(batch: TensorBatch) -> Array:
        velocity = batch["history"][:, 0, -1, 3:5].numpy()
        path: Array = velocity[:, None, None] * times[:, None]
        return path

    return predict


def kalman_filter(config: ForecasterConfig, noise: float = 0.1, acceleration: float = 1.0) -> Predictor:
    """Return the predictor that keeps the velocity estimated from the observed positions.

    Args:
        config: Timesteps.
        noise: Standard deviation of a position [m].
        acceleration: Standard deviation of the acceleration [m/s^2], constant within a timestep.
    """
    dt, times = config.dt, config.dt * np.arange(1, config.window.num_future + 1)
    move = np.array([[1.0, dt], [0.0, 1.0]])
    drift = acceleration**2 * np.array([[dt**4 / 4, dt**3 / 2], [dt**3 / 2, dt**2]])

    def predict(batch: TensorBatch) -> Array:
        positions = batch["history"][:, 0, :, :2].double().numpy()
        valid = batch["history_valid"][:, 0].numpy()
        state: Float64 = np.stack([positions[:, -1], batch["history"][:, 0, -1, 3:5].double().numpy()], axis=1)
        first = valid.argmax(axis=1)
        state[:, 0] = positions[np.arange(len(first)), first]
        spread = np.tile(np.diag([noise**2, 25.0]), (len(state), 1, 1))
        for step in range(positions.shape[1]):
            later = step > first
            state[later] = move @ state[later]
            spread[later] = move @ spread[later] @ move.T + drift
            seen = valid[:, step]
            gain = spread[seen, :, 0] / (spread[seen, 0, 0] + noise**2)[:, None]
            state[seen] += gain[:, :, None] * (positions[seen, step] - state[seen, 0])[:, None]
            spread[seen] -= gain[:, :, None] * spread[seen, 0][:, None]
        return state[:, None, None, 0] + state[:, None, None, 1] * times[:, None]

    return predict
