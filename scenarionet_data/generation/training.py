"""Train a model of traffic on the moments of a database; an interrupted training goes on to the same weights."""

from __future__ import annotations

from scenarionet_data.generation.snapshots import (
    TrafficConfig,
    TrafficMoments,
    read_moments,
)  # first: says how to install torch

# isort: split
from collections.abc import Callable, Mapping
from dataclasses import asdict
from typing import Any

import numpy as np
import torch
from torch import nn

from scenarionet_data.forecasts.forecaster import load_model, make_checkpoint, metrics_row, parse_settings, restore
from scenarionet_data.generation.traffic_model import TrafficModel, motion_loss, placement_loss
from scenarionet_data.query.lake_view import LakeView
from scenarionet_data.storage import checkpoints, evaluation_runs


def make_config(given: Mapping[str, str]) -> TrafficConfig:
    """Return settings with some values as texts.

    Raises:
        BadParameter: There is no such setting, or a value is not a positive number of its type.
    """
    return TrafficConfig(**parse_settings(given, asdict(TrafficConfig()), "a model of traffic"))


def train(
    lake: LakeView,
    database: str,
    config: TrafficConfig,
    *,
    run: str,
    seed: int = 0,
    tests: tuple[str, ...] = (),
    on_epoch: Callable[[list[dict[str, Any]]], None] | None = None,
) -> TrafficModel:
    """Train a model of traffic.

    Args:
        lake: The lake.
        database: Database whose scenarios it learns from.
        config: Networks and training.
        run: Name of the run, which has the checkpoints and the metrics.
        seed: Seed of weights, order and contexts.
        tests: Databases whose losses are measured after each epoch.
        on_epoch: Called with the rows of metrics after each epoch.

    Raises:
        BadParameter: No moment shows enough vehicles.
    """
    torch.set_num_threads(1)
    torch.manual_seed(seed)
    model = TrafficModel(config)
    moments, _ = read_moments(lake, database, config)
    tested = {name: read_moments(lake, name, config)[0] for name in tests}
    count = len(moments.cars)
    steps = -(-count // config.batch_size)
    optimizer = torch.optim.AdamW(model.parameters(), lr=config.rate, weight_decay=config.decay)
    total = config.epochs * steps
    schedule = torch.optim.lr_scheduler.LambdaLR(optimizer, lambda step: 0.5 + 0.5 * np.cos(np.pi * step / total))
    description = {"database": lake.record(database).reference, "traffic model": asdict(config), "seed": seed}
    claimed = evaluation_runs.claim(lake.files, run, ("training",), description | {"tests": list(tests)})
    begun = checkpoints.load(lake.files, run)
    if begun is not None:
        restore(model, optimizer, schedule, begun)
    for epoch in range(begun.facts["epoch"] if begun else 0, config.epochs):
        generator = torch.Generator().manual_seed(hash((seed, epoch)) % 2**32)
        losses = []
        for rows in torch.randperm(count, generator=generator).split(config.batch_size):
            placement, motion = _losses(model, moments.take(rows), generator)
            optimizer.zero_grad()
            (placement + motion).backward()
            nn.utils.clip_grad_norm_(model.parameters(), 5.0)
            optimizer.step()
            schedule.step()
            losses.append((float(placement.detach()), float(motion.detach())))
        found = [metrics_row(None, epoch, count, _named(losses))]
        for name, scenes in tested.items():
            generator = torch.Generator().manual_seed(seed)
            with torch.no_grad():
                parts = torch.arange(len(scenes.cars)).split(config.batch_size)
                losses = [(float(a), float(b)) for a, b in (_losses(model, scenes.take(k), generator) for k in parts)]
            found.append(metrics_row(name, epoch, count, _named(losses)))
        claimed.publish(epoch + 1, {"training": found})
        checkpoints.save(lake.files, run, make_checkpoint(epoch + 1, model, optimizer, schedule))
        if on_epoch is not None:
            on_epoch(found)
    return model


def load(lake: LakeView, run: str) -> TrafficModel:
    """Return the trained model of a run.

    Raises:
        LakeError: There is no such run, it is not of a model of traffic of this layout, it has no checkpoint yet, or
            its weights are not finite.
    """
    model, _ = load_model(lake, run, "traffic model", "scenarionet traffic learn", TrafficConfig, TrafficModel)
    model.eval()
    return model


def _losses(
    model: TrafficModel, scenes: TrafficMoments, generator: torch.Generator
) -> tuple[torch.Tensor, torch.Tensor]:
    return placement_loss(model, scenes, generator), motion_loss(model, scenes, generator)


def _named(losses: list[Any]) -> dict[str, float]:
    placement, motion = np.mean(losses, axis=0)
    return {"placement": float(placement), "motion": float(motion)}
