"""A compact transformer that predicts trajectories, from the lake to a checkpoint, in one file and torch.

    scenarionet forecast fit lake driven_train --test driven_val -p epochs=8

Agents and polylines of the map are tokens; K mode queries read them and give K trajectories with probabilities. The
closest trajectory to the recorded one is trained (winner takes all), as in MTR and Wayformer. Checkpoints and metrics
are those of a training run of the lake: `SELECT round, learned ->> 'min_ade' FROM training WHERE test IS NOT NULL`.
"""

from __future__ import annotations

from scenarionet_data.samples.training import SampleStream, collate  # first: says how to install torch

# isort: split
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass

import numpy as np
import pyarrow as pa
import torch
from torch import Tensor, nn

from scenarionet_data.arrays.dtypes import Array
from scenarionet_data.forecasts.predictions import make_predictions
from scenarionet_data.learning.fitting import BatchLosses, FitConfig, FitRun, fit, load_model
from scenarionet_data.query.lake_view import LakeView
from scenarionet_data.samples.choices import Agents, Augmentation, Polylines, Targets, TimeWindow
from scenarionet_data.samples.dataset import Samples
from scenarionet_data.samples.order import Shuffling

_TYPES = 256  # codes of objects and of map features are below
TensorBatch = Mapping[str, Tensor]
Predictor = Callable[[TensorBatch], Array]
"""Returns (B, K, F, 2) positions of K trajectories in the frame of the target [m]."""


@dataclass(frozen=True)
class ForecasterConfig(FitConfig):
    """What is predicted, by which network, and how it is trained.

    Attributes:
        history, future, dt, stride: Time window of the samples [s].
        agents, polylines, radius: Tokens, and how far away they are at most [m].
        modes: Trajectories of a target.
        heads, layers: Attention heads, and layers of the encoder.
        rotation: Largest random turn of a sample [rad].
    """

    kind = "forecaster"
    command = "scenarionet forecast fit"

    history: float = 1.0
    future: float = 3.0
    dt: float = 0.1
    stride: float = 1.0
    agents: int = 16
    polylines: int = 48
    radius: float = 60.0
    modes: int = 6
    heads: int = 4
    layers: int = 2
    epochs: int = 8
    batch_size: int = 64
    rotation: float = 0.3

    def samples(self, lake: LakeView, database: str | Sequence[str], *, is_training: bool, seed: int = 0) -> Samples:
        """Return the samples of a database: one per moving road user and moment."""
        augmentation = Augmentation(rotation=self.rotation, flip=0.5, seed=seed) if is_training else Augmentation()
        return Samples(
            lake,
            database,
            window=self.window,
            agents=self.nearby_agents,
            polylines=self.nearby_polylines,
            targets=Targets("moving"),
            augmentation=augmentation,
        )

    @property
    def window(self) -> TimeWindow:
        """History and future, and how often."""
        return TimeWindow(self.history, self.future, self.dt, stride=self.stride)

    @property
    def nearby_agents(self) -> Agents:
        """Road users around the target."""
        return Agents(self.agents, self.radius)

    @property
    def nearby_polylines(self) -> Polylines:
        """The map around the target."""
        return Polylines(self.polylines, points=10, spacing=2.0, radius=self.radius)


class Forecaster(nn.Module):
    """Predicts K trajectories of each sample's first agent, with logits."""

    def __init__(self, config: ForecasterConfig) -> None:
        super().__init__()
        size = config.size
        self.history = _two_layers(config.window.num_history * 6 + 2, size)
        self.points = _two_layers(4, size)
        self.agent_type, self.line_type = nn.Embedding(_TYPES, size), nn.Embedding(_TYPES, size)
        layer = nn.TransformerEncoderLayer(size, config.heads, 2 * size, dropout=0.1, batch_first=True, norm_first=True)
        self.encoder = nn.TransformerEncoder(layer, config.layers, enable_nested_tensor=False)
        self.queries = nn.Parameter(0.1 * torch.randn(config.modes, size))
        decoder = nn.TransformerDecoderLayer(
            size, config.heads, 2 * size, dropout=0.1, batch_first=True, norm_first=True
        )
        self.decoder = nn.TransformerDecoder(decoder, 1)
        self.path = _two_layers(size, 2 * config.window.num_future)
        self.logit = _two_layers(size, 1)
        steps = torch.arange(1, config.window.num_future + 1)
        self.register_buffer("time", config.dt * steps[:, None], persistent=False)

    def forward(self, batch: TensorBatch) -> tuple[Tensor, Tensor]:
        """Return (B, K, F, 2) positions in the frame of the target [m], and (B, K) logits."""
        seen, is_absent = self.encode(batch)
        queries = self.queries + seen[:, :1]
        modes = self.decoder(queries, seen, memory_key_padding_mask=is_absent)
        velocity = batch["history"][:, 0, -1, None, None, 3:5]
        return velocity * self.time + _METRES * self.path(modes).unflatten(-1, (-1, 2)), self.logit(modes).squeeze(-1)

    def encode(self, batch: TensorBatch) -> tuple[Tensor, Tensor]:
        """Return (B, A + L, size) encoded tokens, the target's first, and which of them stand for nothing."""
        valid = batch["history_valid"]
        states = torch.cat([batch["history"] * _SCALE, valid[..., None]], dim=-1).flatten(2)
        agents = self.history(torch.cat([states, batch["agent_size"][..., :2] / 5.0], dim=-1))
        agents = agents + self.agent_type(batch["agent_type"].long())
        seen = batch["polylines_valid"]
        points = self.points(batch["polylines"] * _POINT_SCALE).masked_fill(~seen[..., None], -1e9)
        lines = points.amax(dim=2).clamp(min=-1e3) + self.line_type(batch["polyline_type"].long())
        is_absent = ~torch.cat([valid.any(dim=2), seen.any(dim=2)], dim=1)
        return self.encoder(torch.cat([agents, lines], dim=1), src_key_padding_mask=is_absent), is_absent

    @torch.no_grad()
    def modes(self, batch: TensorBatch) -> Array:
        """Return (B, K, F, 2) positions of all modes [m], without dropout."""
        self.eval()
        modes: Array = self(batch)[0].numpy()
        return modes


_METRES = 10.0  # of an output of 1, so that paths can differ early in training
_SCALE = torch.tensor([0.05, 0.05, 1.0, 0.1, 0.1])
_POINT_SCALE = torch.tensor([0.05, 0.05, 1.0, 1.0])


def _two_layers(size: int, out: int) -> nn.Sequential:
    hidden = max(out, 64)
    return nn.Sequential(nn.Linear(size, hidden), nn.ReLU(), nn.Linear(hidden, out))


def loss(predicted: tuple[Tensor, Tensor], batch: TensorBatch) -> Tensor:
    """Distance of the closest mode from the recorded path [m], and how probable it was found to be."""
    modes, logits = predicted
    truth, valid = batch["future"][:, 0, :, :2], batch["future_valid"][:, 0]
    count = valid.sum(dim=1)
    distance = (modes - truth[:, None]).norm(dim=-1)
    mean = (distance * valid[:, None]).sum(dim=-1) / count.clamp(min=1)[:, None]
    best, number = mean.min(dim=1)
    each = best + nn.functional.cross_entropy(logits, number.detach(), reduction="none")
    is_known = count > 0
    return (each * is_known).sum() / is_known.sum().clamp(min=1)


@torch.no_grad()
def predict(model: Forecaster, samples: Samples, batch_size: int = 256) -> Iterator[pa.Table]:
    """Yield the predictions of samples, batch by batch, see ``scenarionet_data.forecasts``."""
    model.eval()
    for first in range(0, len(samples), batch_size):
        numbers = range(first, min(first + batch_size, len(samples)))
        batch = samples.batch(numbers)
        modes, logits = model(collate(batch))
        keys, dt = [samples.key(number) for number in numbers], float(model.time[0])
        yield make_predictions(keys, modes.numpy(), logits.softmax(dim=1).numpy(), batch["pose"], dt)


def measure(model: Predictor, samples: Samples, batch_size: int = 256) -> tuple[Array, Array]:
    """Return minADE and minFDE of each sample [m], see :func:`displacements`."""
    means, ends = [], []
    for first in range(0, len(samples), batch_size):
        batch = collate(samples.batch(range(first, min(first + batch_size, len(samples)))))
        modes = model(batch)
        truth, valid = batch["future"][:, 0, :, :2].numpy(), batch["future_valid"][:, 0].numpy()
        mean, end = displacements(modes, truth, valid)
        means.append(mean)
        ends.append(end)
    return np.concatenate(means), np.concatenate(ends)


def displacements(modes: Array, truth: Array, valid: Array) -> tuple[Array, Array]:
    """Return minADE and minFDE of B targets, NaN where the future is not recorded (wholly).

    Args:
        modes: (B, K, F, 2) positions [m].
        truth, valid: (B, F, 2), (B, F) the recorded future.
    """
    distance = np.linalg.norm(modes - truth[:, None], axis=-1)
    count = valid.sum(axis=1)
    mean = np.where(valid[:, None], distance, 0.0).sum(axis=-1) / np.maximum(count, 1)[:, None]
    ends = np.where(valid[:, -1, None], distance[:, :, -1], np.nan)
    return np.where(count > 0, mean.min(axis=1), np.nan), ends.min(axis=1)


def train(run: FitRun, config: ForecasterConfig) -> Forecaster:
    """Train a forecaster; a run that was interrupted continues after its last whole epoch, with the same result."""
    torch.manual_seed(run.seed)
    model = Forecaster(config)
    samples = config.samples(run.lake, run.database, is_training=True, seed=run.seed)
    stream = SampleStream(samples, config.batch_size, shuffling=Shuffling(seed=run.seed))
    tested = {name: config.samples(run.lake, name, is_training=False) for name in run.tests}

    def losses(epoch: int) -> Iterator[BatchLosses]:
        torch.manual_seed(hash((run.seed, epoch)) % 2**32)  # of dropout, so that a resumed run draws the same
        stream.set_epoch(epoch)
        for batch in stream:
            yield {"loss": loss(model(batch), batch)}

    def measured() -> dict[str, dict[str, float]]:
        means = {name: measure(model.modes, each) for name, each in tested.items()}
        return {
            name: {"min_ade": float(np.nanmean(mean)), "min_fde": float(np.nanmean(end))}
            for name, (mean, end) in means.items()
        }

    fit(run, model, config, len(samples), losses, measured)
    return model


def load(lake: LakeView, run: str) -> tuple[Forecaster, ForecasterConfig]:
    """Return the trained forecaster of a run, and its settings.

    Raises:
        LakeError: There is no such run, it is not of a forecaster of this layout, it has no checkpoint yet, or its
            weights are not finite.
    """
    return load_model(lake.files, run, ForecasterConfig, Forecaster)
