"""Batches of samples for torch: an iterable dataset for any number of workers and ranks, and a collate function."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from typing import Any

import numpy as np

from scenarionet_data.arrays.dtypes import Array, is_count
from scenarionet_data.errors import BadParameter, MissingDependency
from scenarionet_data.samples.dataset import Sample, Samples
from scenarionet_data.samples.order import Shuffling, batches_of, epoch_order

try:
    import torch
    from torch.utils.data import IterableDataset, get_worker_info
except ModuleNotFoundError as error:
    told = MissingDependency("batches as tensors need torch", "learn")
    raise ModuleNotFoundError(str(told), name="torch") from error  # as tools that import all modules expect


class SampleStream(IterableDataset[dict[str, Any]]):
    """The batches of an epoch as dictionaries of tensors, with their ``number`` in the epoch.

    The batches, and their order, do not depend on the number of workers, or on how these are started: worker ``w`` of
    ``W`` makes every ``W``-th batch, and the ``DataLoader`` takes turns. Give it ``batch_size=None``.

    Args:
        samples: The samples.
        batch_size: Samples of a batch.
        shuffling: How they are shuffled; None for their own order.
        drop_last: Leave out a last batch that is smaller than the others.
        rank, world_size: Number of this process among those that train together; each has its own samples. By default
            those of ``torch.distributed``, if it is initialised.

    Example:
        stream = SampleStream(Samples("lake", "train"), batch_size=32, shuffling=Shuffling(seed=1))
        for epoch in range(10):
            stream.set_epoch(epoch)
            for batch in DataLoader(stream, batch_size=None, num_workers=4):
                ...
    """

    def __init__(
        self,
        samples: Samples,
        batch_size: int,
        *,
        shuffling: Shuffling | None = None,
        drop_last: bool = False,
        rank: int | None = None,
        world_size: int | None = None,
    ) -> None:
        if not is_count(batch_size, 1):
            raise BadParameter(f"batch_size: expected at least 1 sample, found {batch_size!r}")
        self._samples = samples
        self._batch_size = batch_size
        self._shuffling = shuffling
        self._drop_last = drop_last
        self._rank, self._world_size = _place_among(rank, world_size)
        self._epoch, self._done = 0, 0

    def __len__(self) -> int:
        """Number of batches of this rank in an epoch."""
        own = len(self._samples) // self._world_size
        return own // self._batch_size if self._drop_last else -(-own // self._batch_size)

    def set_epoch(self, epoch: int) -> None:
        """Choose the epoch, from its first batch on; its number determines order and augmentation."""
        self._epoch, self._done = epoch, 0

    def state_dict(self) -> dict[str, int]:
        """Position in the epoch: ``epoch``, and ``done``, the number of batches of this rank that were made.

        In the workers of a ``DataLoader``, copies of the stream make the batches. The position after a batch is then
        ``{"epoch": epoch, "done": batch["number"] + 1}``.
        """
        return {"epoch": self._epoch, "done": self._done}

    def load_state_dict(self, state: Mapping[str, int]) -> None:
        """Continue after ``done`` batches of an epoch.

        Raises:
            BadParameter: It is no state of a stream.
        """
        wanted = isinstance(state, Mapping) and all(is_count(state.get(name), 0) for name in ("epoch", "done"))
        if not wanted:
            raise BadParameter(f"expected what state_dict returned, as {{'epoch': 2, 'done': 100}}; found {state!r}")
        self._epoch, self._done = state["epoch"], state["done"]

    def __iter__(self) -> Iterator[dict[str, Any]]:
        worker = get_worker_info()
        number, workers = (0, 1) if worker is None else (worker.id, worker.num_workers)
        order = epoch_order(self._samples.places, self._shuffling, self._epoch)
        batches = batches_of(order, self._batch_size, self._rank, self._world_size, drop_last=self._drop_last)
        own = range(self._done + number, len(batches), workers)
        for k in own:
            if k + workers < len(batches):
                self._samples.prefetch(batches[k + workers])
            batch = collate(self._samples.batch(batches[k], self._epoch))
            self._done = k + 1
            yield {**batch, "number": k}


def collate(batch: Sample | Sequence[Sample]) -> dict[str, Any]:
    """Arrays as tensors, without a copy; single samples are stacked.

    It is the ``collate_fn`` of a ``DataLoader`` over :class:`Samples`, which asks for whole batches.
    """
    if isinstance(batch, Mapping):
        return {name: _tensor(values) for name, values in batch.items()}
    return {name: _tensor(np.stack([sample[name] for sample in batch])) for name in batch[0]}


def _tensor(values: Array) -> Any:
    """A tensor over the memory of an array; texts stay lists."""
    return torch.from_numpy(values) if values.dtype.kind in "biuf" else values.tolist()


def _place_among(rank: int | None, world_size: int | None) -> tuple[int, int]:
    """Rank and number of ranks."""
    if (rank is None) != (world_size is None):
        raise BadParameter("rank, world_size: expected both, or neither")
    if rank is None or world_size is None:
        distributed = torch.distributed
        is_on = distributed.is_available() and distributed.is_initialized()
        return (distributed.get_rank(), distributed.get_world_size()) if is_on else (0, 1)
    if not 0 <= rank < world_size:
        raise BadParameter(f"rank: expected 0 ... {world_size - 1}, found {rank}")
    return rank, world_size
