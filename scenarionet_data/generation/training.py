"""Train a model of traffic on the moments of a database; an interrupted training goes on to the same weights."""

from __future__ import annotations

from scenarionet_data.generation.snapshots import (
    TrafficConfig,
    TrafficMoments,
    read_moments,
)  # first: says how to install torch

# isort: split
from collections.abc import Iterator, Mapping
from dataclasses import asdict

import torch

from scenarionet_data.generation.traffic_model import TrafficModel, motion_loss, placement_loss
from scenarionet_data.query.lake_view import LakeView
from scenarionet_data.storage.fitting import BatchLosses, FitRun, OnEpoch, fit, load_model, parse_settings


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
    on_epoch: OnEpoch | None = None,
) -> TrafficModel:
    """Train a model of traffic.

    Args:
        lake: The lake.
        database: Database whose scenarios it learns from.
        config: Networks and training.
        run: Name of the run, which has the checkpoints and the metrics.
        seed: Seed of weights, order and contexts.
        tests: Databases whose losses are measured after each epoch.
        on_epoch: Called after each epoch.

    Raises:
        BadParameter: No moment shows enough vehicles.
    """
    torch.manual_seed(seed)
    model = TrafficModel(config)
    moments, _ = read_moments(lake, database, config)
    tested = {name: read_moments(lake, name, config)[0] for name in tests}
    count = len(moments.cars)

    def losses(epoch: int) -> Iterator[BatchLosses]:
        generator = torch.Generator().manual_seed(hash((seed, epoch)) % 2**32)
        for rows in torch.randperm(count, generator=generator).split(config.batch_size):
            yield _losses(model, moments.take(rows), generator)

    @torch.no_grad()
    def measure() -> dict[str, dict[str, float]]:
        found = {}
        for name, scenes in tested.items():
            generator = torch.Generator().manual_seed(seed)
            parts = torch.arange(len(scenes.cars)).split(config.batch_size)
            losses = [_losses(model, scenes.take(rows), generator) for rows in parts]
            found[name] = {each: float(torch.stack([part[each] for part in losses]).mean()) for each in losses[0]}
        return found

    description = {"database": lake.record(database).reference, "traffic model": asdict(config), "seed": seed}
    fitted = FitRun(lake.files, run, description | {"tests": list(tests)})
    fit(fitted, model, config, count, losses, measure, clip=5.0, on_epoch=on_epoch)
    return model


def load(lake: LakeView, run: str) -> TrafficModel:
    """Return the trained model of a run.

    Raises:
        LakeError: There is no such run, it is not of a model of traffic of this layout, it has no checkpoint yet, or
            its weights are not finite.
    """
    model, _ = load_model(lake.files, run, "traffic model", "scenarionet traffic learn", TrafficConfig, TrafficModel)
    model.eval()
    return model


def _losses(model: TrafficModel, scenes: TrafficMoments, generator: torch.Generator) -> BatchLosses:
    return {"placement": placement_loss(model, scenes, generator), "motion": motion_loss(model, scenes, generator)}
