"""Batches for torch are the same for any number and kind of workers, for ranks together, and after a restart."""

from __future__ import annotations

import multiprocessing

import numpy as np
import pytest

from scenarionet_data import Agents, Augmentation, Polylines, Samples, Shuffling, Targets, TimeWindow

pytestmark = [
    pytest.mark.learn,
    pytest.mark.filterwarnings("ignore::scenarionet_data.samples.selection.SamplesWarning"),
    pytest.mark.filterwarnings("ignore:This DataLoader will create:UserWarning"),
    pytest.mark.filterwarnings("ignore:This process .* is multi-threaded:DeprecationWarning"),
]
torch = pytest.importorskip("torch", reason="no torch: run `make test-learn`")

SIZE = 4


@pytest.fixture(scope="module")
def samples(lake):
    return Samples(
        lake,
        window=TimeWindow(history=0.4, future=1.2, stride=0.5),
        agents=Agents(count=4),
        polylines=Polylines(count=3, points=4),
        targets=Targets("moving"),
        augmentation=Augmentation(rotation=3.0, flip=0.5, noise=0.1, drop=0.2, seed=5),
    )


def stream(samples, **how):
    from scenarionet_data.samples.training import SampleStream

    return SampleStream(samples, SIZE, shuffling=Shuffling(block=8, buffer=16, seed=2), **how)


def loaded(dataset, workers=0, start=None):
    context = multiprocessing.get_context(start) if workers else None
    return list(
        torch.utils.data.DataLoader(dataset, batch_size=None, num_workers=workers, multiprocessing_context=context)
    )


def assert_same(found, wanted):
    assert len(found) == len(wanted) > 0
    for one, other in zip(found, wanted, strict=True):
        assert one.keys() == other.keys()
        assert all(torch.equal(torch.as_tensor(one[name]), torch.as_tensor(other[name])) for name in one)


@pytest.fixture(scope="module")
def wanted(samples):
    return list(stream(samples))


@pytest.mark.parametrize(("workers", "start"), [(0, None), (1, "fork"), (4, "fork"), (2, "spawn")])
def test_workers_make_no_difference(samples, wanted, workers, start):
    assert_same(loaded(stream(samples), workers, start), wanted)


@pytest.mark.parametrize("workers", [0, 3])
def test_a_run_continues_in_the_middle_of_an_epoch(samples, workers):
    first = stream(samples)
    first.set_epoch(3)
    whole = loaded(first)
    again = stream(samples)
    again.load_state_dict({"epoch": 3, "done": whole[4]["number"] + 1})
    assert_same(loaded(again, workers, "fork"), whole[5:])


def test_the_state_counts_batches(samples, wanted):
    first = stream(samples)
    batches = iter(first)
    for _ in range(3):
        next(batches)
    again = stream(samples)
    again.load_state_dict(first.state_dict())
    assert_same(list(again), wanted[3:])
    assert first.state_dict() == {"epoch": 0, "done": 3}


def test_two_ranks_share_the_samples(samples, wanted):
    parts = [list(stream(samples, rank=rank, world_size=2)) for rank in (0, 1)]
    assert len(parts[0]) == len(parts[1]) == len(stream(samples, rank=0, world_size=2))

    def poses(batches):
        return sorted(map(tuple, torch.cat([batch["pose"] for batch in batches]).tolist()))

    assert set(poses(parts[0] + parts[1])) <= set(poses(wanted))
    assert len(poses(parts[0] + parts[1])) == len(samples) // 2 * 2


def test_epochs_differ(samples, wanted):
    other = stream(samples)
    other.set_epoch(1)
    assert not torch.equal(next(iter(other))["pose"], wanted[0]["pose"])


def test_a_data_loader_over_samples_asks_for_batches(samples):
    from scenarionet_data.samples.training import collate

    (first, *_) = torch.utils.data.DataLoader(samples, batch_size=SIZE, collate_fn=collate)
    whole = samples.batch(range(SIZE))
    assert all(np.array_equal(first[name].numpy(), values) for name, values in whole.items())
    apart = collate([samples[index] for index in range(SIZE)])
    assert all(torch.equal(apart[name], first[name]) for name in first)


def test_tensors_share_the_memory_of_arrays(samples):
    from scenarionet_data.samples.training import collate

    batch = samples.batch([0])
    tensors = collate(batch)
    assert all(tensors[name].data_ptr() == values.ctypes.data for name, values in batch.items())
