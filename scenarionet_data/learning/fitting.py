"""Training runs of networks that learn from recordings: epochs, checkpoints and curves in the lake's results.

A run that was interrupted continues after its last whole epoch, and ends with the same weights on the same machine.
"""

from __future__ import annotations

import json
from collections.abc import Callable, Iterator, Mapping
from dataclasses import asdict, dataclass
from types import MappingProxyType
from typing import Any, ClassVar, Self, TypeVar

import numpy as np
import torch
from torch import Tensor, nn
from xxhash import xxh3_64

from scenarionet_data.errors import BadParameter, LakeError
from scenarionet_data.query.lake_view import LakeView
from scenarionet_data.scenario.settings import parse_texts
from scenarionet_data.storage import checkpoints, evaluation_runs
from scenarionet_data.storage.files.lake_files import LakeFiles

BatchLosses = Mapping[str, Tensor]
"""Losses of a batch by name, whose sum is minimised."""

OnEpoch = Callable[[list[dict[str, Any]]], None]
"""Called after each epoch with its rows of the table ``training``: of the training, and of each test."""


@dataclass(frozen=True)
class FitConfig:
    """Settings of every training of a network; those that learn something derive theirs from it.

    Attributes:
        kind: What is trained, the name of its settings in the description of a run.
        command: The command that trains it.
        clip: Largest norm of the gradient.
        uses_gpu: Whether it is trained on a GPU if there is one.
        size: Width of features.
        epochs: Times that all samples are seen.
        batch_size: Samples of a batch.
        rate: Learning rate at the beginning; it falls along a cosine to 0.
        decay: Weight decay.
    """

    kind: ClassVar[str]
    command: ClassVar[str]
    clip: ClassVar[float] = 1.0
    uses_gpu: ClassVar[bool] = False

    size: int = 64
    epochs: int = 2
    batch_size: int = 16
    rate: float = 1e-3
    decay: float = 1e-2

    def __post_init__(self) -> None:
        heads = getattr(self, "heads", 1)  # of attention, in some networks
        if self.size % heads:
            raise BadParameter(f"size: wanted a multiple of heads, {heads}, found {self.size}")

    @property
    def device(self) -> torch.device:
        """What trains here."""
        return torch.device("cuda" if self.uses_gpu and torch.cuda.is_available() else "cpu")

    @classmethod
    def parse(cls, given: Mapping[str, str]) -> Self:
        """Return settings with some values as texts.

        Raises:
            BadParameter: There is no such setting, or a value is not a positive number of its type, or they contradict.
        """
        values = parse_texts(cls, f"a {cls.kind}", given)
        for name, value in values.items():
            if not 0 < value < np.inf:
                raise BadParameter(f"{name}: wanted a number above 0, found {value}")
        return cls(**values)


@dataclass(frozen=True)
class FitRun:
    """A training run of a lake.

    Attributes:
        lake: The lake.
        database: Database whose scenarios are learned from.
        name: Name of the run, which has the checkpoints and the curve.
        seed: Seed of weights, order and random changes of samples.
        tests: Databases that the model is measured on after each epoch.
        on_epoch: Called after each epoch.
    """

    lake: LakeView
    database: str
    name: str
    seed: int = 0
    tests: tuple[str, ...] = ()
    on_epoch: OnEpoch | None = None


def fit(
    run: FitRun,
    model: nn.Module,
    config: FitConfig,
    count: int,
    losses: Callable[[int], Iterator[BatchLosses]],
    measure: Callable[[], Mapping[str, Mapping[str, float]]] = dict,
    facts: Mapping[str, Any] = MappingProxyType({}),
) -> None:
    """Train a model with AdamW, on its device, to the end of its epochs.

    Args:
        run: The run.
        model: The model, as it was made from the seed.
        config: Settings.
        count: Samples of an epoch.
        losses: Yields the losses of the batches of an epoch, given its number; it draws what is random from that.
        measure: Returns what tests say after an epoch, by the name of the test.
        facts: What else the weights depend on, JSON-serialisable.

    Raises:
        BadParameter: There is no sample, or another run has this name.
    """
    if not count:
        raise BadParameter("no sample to learn from; give a database with more or longer scenarios")
    torch.set_num_threads(1)
    optimizer = torch.optim.AdamW(model.parameters(), lr=config.rate, weight_decay=config.decay)
    total = max(1, config.epochs * -(-count // config.batch_size))
    schedule = torch.optim.lr_scheduler.LambdaLR(optimizer, lambda step: 0.5 + 0.5 * np.cos(np.pi * step / total))
    description = {
        "database": run.lake.record(run.database).reference,
        config.kind: asdict(config),
        "seed": run.seed,
        "tests": list(run.tests),
        **facts,
    }
    files = run.lake.files
    claimed = evaluation_runs.claim(files, run.name, ("training",), description)
    begun = checkpoints.load(files, run.name)
    if begun is not None:
        restore(model, begun)
        _restore_optimizer(optimizer, schedule, begun)
    for epoch in range(begun.facts["epoch"] if begun else 0, config.epochs):
        model.train()
        found = []
        for batch in losses(epoch):
            optimizer.zero_grad()
            sum(batch.values(), torch.zeros(())).backward()
            nn.utils.clip_grad_norm_(model.parameters(), config.clip)
            optimizer.step()
            schedule.step()
            found.append({name: value.detach() for name, value in batch.items()})
        means = {name: float(np.mean([float(each[name]) for each in found])) for name in found[0]}
        rows = [
            {"test": test, "round": epoch + 1, "steps": (epoch + 1) * count, "episodes": 0, "learned": json.dumps(each)}
            for test, each in [(None, means), *measure().items()]
        ]
        claimed.publish(epoch + 1, {"training": rows})
        checkpoints.save(files, run.name, _checkpoint(epoch + 1, model, optimizer, schedule))
        if run.on_epoch is not None:
            run.on_epoch(rows)


_Config = TypeVar("_Config", bound=FitConfig)
_Model = TypeVar("_Model", bound=nn.Module)


def load_model(
    files: LakeFiles, run: str, config_type: type[_Config], model_type: Callable[[_Config], _Model]
) -> tuple[_Model, _Config]:
    """Return the model of a training run whose description has its settings under the name of its kind.

    Args:
        files: The lake.
        run: Name of the run.
        config_type: Class of its settings.
        model_type: Its class.

    Raises:
        LakeError: There is no such run, it is not of that kind or of another layout, it has no checkpoint yet, or its
            weights are not finite.
    """
    kind, advice = config_type.kind, f"train one: {config_type.command}"
    if run not in evaluation_runs.names(files):
        raise LakeError(f"{files.root} has no run {run}; {advice}")
    described = evaluation_runs.describe(files, run)
    found = checkpoints.load(files, run)
    if kind not in described or found is None:
        what = "has no checkpoint yet" if kind in described else f"is not of a {kind}"
        raise LakeError(f"run {run} of {files.root} {what}; {advice}")
    broken = [name for name, values in found.arrays.items() if not np.isfinite(values).all()]
    if broken:
        raise LakeError(
            f"run {run}: weights are not finite, for example {broken[0]}; train it again under another name"
        )
    try:
        config = config_type(**described[kind])
        model = model_type(config)
        restore(model, found)
    except (TypeError, RuntimeError) as error:
        reason = str(error).splitlines()[-1].strip()
        raise LakeError(f"run {run}: a {kind} of another layout, {reason}; train it again with this version") from error
    return model, config


def weights_digest(model: nn.Module) -> str:
    """Return 16 hex digits that change with the weights of a model."""
    digest = xxh3_64()
    for name, weights in sorted(model.state_dict().items()):
        digest.update(name.encode() + weights.numpy().tobytes())
    return digest.hexdigest()


def restore(model: nn.Module, found: checkpoints.Checkpoint) -> None:
    """Set a model to where a training stood."""
    arrays = {name[6:]: values for name, values in found.arrays.items() if name.startswith("model.")}
    model.load_state_dict({name: torch.from_numpy(values.copy()) for name, values in arrays.items()})


def _checkpoint(number: int, model: nn.Module, optimizer: Any, schedule: Any) -> checkpoints.Checkpoint:
    """Where a training stands."""
    arrays = {f"model.{name}": value.cpu().numpy() for name, value in model.state_dict().items()}
    for index, state in optimizer.state_dict()["state"].items():
        arrays |= {f"optimizer.{index}.{name}": value.cpu().numpy() for name, value in state.items()}
    return checkpoints.Checkpoint(number, {"epoch": number, "updates": schedule.last_epoch}, arrays)


def _restore_optimizer(optimizer: Any, schedule: Any, found: checkpoints.Checkpoint) -> None:
    """Set the optimizer and its schedule to where a training stood."""
    state: dict[int, dict[str, Tensor]] = {}
    for name, values in found.arrays.items():
        if name.startswith("optimizer."):
            _, index, part = name.split(".", 2)
            state.setdefault(int(index), {})[part] = torch.from_numpy(values.copy())
    optimizer.load_state_dict(optimizer.state_dict() | {"state": state})
    schedule.load_state_dict(schedule.state_dict() | {"last_epoch": found.facts["updates"]})
    for group in optimizer.param_groups:
        group["lr"] = schedule.lr_lambdas[0](found.facts["updates"]) * group["initial_lr"]
