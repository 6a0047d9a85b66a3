"""Train a model of traffic on the moments of a database; an interrupted training goes on to the same weights."""

from __future__ import annotations

from scenarionet_data.generation.snapshots import (
    TrafficConfig,
    TrafficMoments,
    read_moments,
)  # first: says how to install torch

# isort: split
from collections.abc import Iterator

import torch

from scenarionet_data.generation.traffic_model import TrafficModel, motion_loss, placement_loss
from scenarionet_data.learning.fitting import BatchLosses, FitRun, fit, load_model
from scenarionet_data.query.lake_view import LakeView


def train(run: FitRun, config: TrafficConfig) -> TrafficModel:
    """Train a model of traffic.

    Raises:
        BadParameter: No moment shows enough vehicles.
    """
    torch.manual_seed(run.seed)
    model = TrafficModel(config)
    moments, _ = read_moments(run.lake, run.database, config)
    tested = {name: read_moments(run.lake, name, config)[0] for name in run.tests}
    count = len(moments.cars)

    def losses(epoch: int) -> Iterator[BatchLosses]:
        generator = torch.Generator().manual_seed(hash((run.seed, epoch)) % 2**32)
        for rows in torch.randperm(count, generator=generator).split(config.batch_size):
            yield _losses(model, moments.take(rows), generator)

    @torch.no_grad()
    def measure() -> dict[str, dict[str, float]]:
        found = {}
        for name, scenes in tested.items():
            generator = torch.Generator().manual_seed(run.seed)
            parts = torch.arange(len(scenes.cars)).split(config.batch_size)
            losses = [_losses(model, scenes.take(rows), generator) for rows in parts]
            found[name] = {each: float(torch.stack([part[each] for part in losses]).mean()) for each in losses[0]}
        return found

    fit(run, model, config, count, losses, measure)
    return model


def load(lake: LakeView, run: str) -> TrafficModel:
    """Return the trained model of a run.

    Raises:
        LakeError: There is no such run, it is not of a model of traffic of this layout, it has no checkpoint yet, or
            its weights are not finite.
    """
    model, _ = load_model(lake.files, run, TrafficConfig, TrafficModel)
    model.eval()
    return model


def _losses(model: TrafficModel, scenes: TrafficMoments, generator: torch.Generator) -> BatchLosses:
    return {"placement": placement_loss(model, scenes, generator), "motion": motion_loss(model, scenes, generator)}
