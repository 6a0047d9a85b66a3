"""Samples of scenarios that are kept in memory are those of scenarios read anew, bit for bit, and memory is bounded."""

from __future__ import annotations

import threading
from itertools import pairwise

import numpy as np
import pytest

from scenarionet_data import Agents, Augmentation, Polylines, Samples, Targets, TimeWindow
from scenarionet_data.errors import BadParameter
from tests.fixtures.lakes import write_lake
from tests.fixtures.scenarios import make_scenario

pytestmark = pytest.mark.filterwarnings("ignore::scenarionet_data.samples.selection.SamplesWarning")
CHOICES = {
    "recorded times": {"window": TimeWindow(0.4, 1.2, stride=0.3)},
    "interpolated": {"window": TimeWindow(0.5, 1.0, dt=0.25)},
    "augmented": {"window": TimeWindow(0.4, 1.2), "augmentation": Augmentation(3.0, 0.5, 0.2, 0.3)},
    "scene": {"window": TimeWindow(0.4, 1.2), "perspective": "scene"},
    "few": {"window": TimeWindow(0.4, 1.2), "agents": Agents(2), "polylines": Polylines(7, 5, 2.5, 30.0)},
    "without a map": {"window": TimeWindow(0.4, 1.2), "polylines": Polylines(0)},
}


def assert_equal(found, wanted):
    assert found.keys() == wanted.keys()
    for name, values in wanted.items():
        np.testing.assert_array_equal(found[name], values, err_msg=name)
        assert found[name].tobytes() == values.tobytes()


@pytest.mark.parametrize("choices", CHOICES.values(), ids=CHOICES)
@pytest.mark.parametrize("cache_bytes", [2**29, 40_000])
def test_samples_are_those_of_scenarios_read_anew(lake, choices, cache_bytes):
    """Of random batches: in memory for all scenarios, for some, so that others are displaced, and for one at a time."""
    rng = np.random.default_rng(0)
    kept = Samples(lake, targets=Targets("moving"), cache_bytes=cache_bytes, **choices)
    for epoch in range(8):
        numbers = rng.integers(0, len(kept), rng.integers(1, 20))
        anew = Samples(lake, targets=Targets("moving"), cache_bytes=0, **choices)
        batch = kept.batch(numbers, epoch)
        for place in rng.permutation(len(numbers))[:3]:
            alone = anew.batch(numbers[place : place + 1], epoch)
            assert_equal({name: values[place : place + 1] for name, values in batch.items()}, alone)


def test_a_scenario_is_read_once(lake, monkeypatch):
    samples, read = Samples(lake, window=TimeWindow(0.4, 1.2), targets=Targets("moving")), []
    reader = samples._cache.reader
    whole = reader.read
    monkeypatch.setattr(reader, "read", lambda scenarios: read.extend(scenarios.tolist()) or whole(scenarios))
    for _ in range(2):
        samples.batch(range(len(samples)))
    assert len(read) == len(set(read)) > 1


def test_memory_grows_until_it_holds_all(tmp_path, monkeypatch):
    """However small the scenario is that is read first."""
    scenarios = [make_scenario(seed, num_objects=4 + 20 * seed, num_lanes=2 + 20 * seed) for seed in range(4)]
    lake, choices = write_lake(tmp_path / "lake", scenarios), {"window": TimeWindow(0.4, 1.2)}
    samples, anew = (Samples(lake, targets=Targets("moving"), cache_bytes=size, **choices) for size in (2**29, 0))
    reader, read = samples._cache.reader, []
    whole = reader.read
    monkeypatch.setattr(reader, "read", lambda scenarios: read.extend(scenarios.tolist()) or whole(scenarios))
    for _ in range(2):
        for number in range(len(samples)):
            assert_equal(samples.batch([number]), anew.batch([number]))
    assert len(read) == len(scenarios)
    sizes = [end - first for _, first, end in samples._cache._kept]
    assert 4 * sizes[0] < sum(sizes) <= samples._cache.num_bytes < 2 * sum(sizes)


def test_memory_is_bounded(lake):
    """Each block lies within the memory, and none over another; the newest ones stay."""
    samples = Samples(lake, window=TimeWindow(0.4, 1.2), targets=Targets("moving"), cache_bytes=40_000)
    rng, cache, most = np.random.default_rng(1), samples._cache, 0
    for _ in range(60):
        samples.batch(rng.integers(0, len(samples), 3))
        assert cache.num_bytes == 40_000
        spans = sorted((first, end) for _, first, end in cache._kept)
        assert all(end <= first for (_, end), (first, _) in pairwise(spans))
        assert spans[0][0] >= 0 and spans[-1][1] <= 40_000
        assert (cache._blocks >= 0).sum() == len(cache)
        most = max(most, len(cache))
    assert most == 2


def test_one_scenario_always_fits(lake):
    samples = Samples(lake, window=TimeWindow(0.4, 1.2), cache_bytes=0)
    samples.batch(range(len(samples)))
    assert len(samples._cache) == 1
    assert 0 < samples._cache.num_bytes < 20_000


def test_threads_have_scenarios_of_their_own(lake):
    samples, caches = Samples(lake, window=TimeWindow(0.4, 1.2)), []
    for _ in range(2):
        thread = threading.Thread(target=lambda: samples.batch([0]) and caches.append(samples._cache))
        thread.start()
        thread.join()
    assert caches[0] is not caches[1] and [len(cache) for cache in caches] == [1, 1]


def test_bytes_are_a_number(lake):
    with pytest.raises(BadParameter, match="cache_bytes: expected a whole number of 0 or more, found '1 GB'"):
        Samples(lake, cache_bytes="1 GB")
