"""Traffic that flows (version 2): arrivals, no contact, nobody steps back; and version 1 keeps its scenarios."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from scenarionet_data.converters.pg import Procedural, ProceduralOptions
from scenarionet_data.errors import BadParameter
from scenarionet_data.procedural.flow import first_contact
from scenarionet_data.procedural.generate import generate
from scenarionet_data.procedural.graph import NONE
from scenarionet_data.procedural.options import GeneratorOptions
from scenarionet_data.procedural.population import arrival_times
from scenarionet_data.scenario.content_hash import content_hash
from tests.scenarionet_data.procedural.test_traffic import runs_red, touches

OPTIONS = GeneratorOptions()


def steps_back(episode):
    """(vehicle, timestep) of those that move against their heading."""
    motion, valid = episode.motion, episode.valid
    ahead = np.stack([np.cos(motion[..., 2]), np.sin(motion[..., 2])], axis=-1)[:, :-1]
    along = (np.diff(motion[..., :2], axis=1) * ahead).sum(axis=-1)
    return np.argwhere((along < -1e-3) & valid[:, 1:] & valid[:, :-1])


def accelerations(episode):
    """Of every vehicle between timesteps [m/s2]."""
    both = episode.valid[:, 1:] & episode.valid[:, :-1]
    return (np.diff(episode.motion[..., 3], axis=1) / OPTIONS.dt)[both]


def jumps(episode):
    """Differences between the recorded speed and that of the positions [m/s]."""
    both = episode.valid[:, 1:] & episode.valid[:, :-1]
    moved = np.hypot(*np.moveaxis(np.diff(episode.motion[..., :2], axis=1), -1, 0)) / OPTIONS.dt
    return np.abs(moved - (episode.motion[:, 1:, 3] + episode.motion[:, :-1, 3]) / 2.0)[both]


def check_flow(episodes):
    """Vehicles are as many at the end as at the beginning, and a quarter of all come later."""
    first, last = (sum(e.valid[:, part].any(axis=1).sum() for e in episodes) for part in (np.s_[:10], np.s_[-10:]))
    later = sum((~e.valid[:, :10].any(axis=1)).sum() for e in episodes)
    assert last >= 0.8 * first
    assert later >= 0.25 * sum(map(len, (e.valid for e in episodes)))


def check_motion(episode):
    assert not touches(episode)
    assert not len(steps_back(episode))
    assert episode.motion[..., 3].min() >= 0.0
    assert jumps(episode).max() < 1.0
    assert accelerations(episode).max() <= 2.2 + 1e-9
    assert episode.valid[0].all()
    assert episode.valid.any(axis=1).all(), "vehicles that are never there"


def test_traffic_flows():
    episodes = [generate(seed, OPTIONS) for seed in range(16)]
    check_flow(episodes)
    for episode in episodes[:8]:
        check_motion(episode)
    assert np.percentile(np.concatenate([accelerations(e) for e in episodes]), 0.1) > -4.0


@pytest.mark.long
def test_traffic_of_a_hundred_seeds_flows():
    episodes = [generate(seed, OPTIONS) for seed in range(100)]
    check_flow(episodes)
    for episode in episodes:
        check_motion(episode)
    assert sum(bool(runs_red(episode)) for episode in episodes) <= 3
    assert np.mean([e.valid.shape[1] < OPTIONS.max_steps for e in episodes]) > 0.85
    assert sum(len(e.valid) == 1 or not e.valid[1:, -1].any() for e in episodes) <= 5, "the ego is alone"


@settings(max_examples=8, deadline=None)
@given(
    st.integers(0, 10**6),
    st.floats(0.0, 6.0),
    st.floats(0.0, 2.0),
    st.integers(1, 3),
    st.sampled_from([0.05, 0.1, 0.2]),
)
def test_no_setting_makes_contacts_or_steps_back(seed, density, oncoming, lanes, dt):
    options = GeneratorOptions(density=density, oncoming=oncoming, max_lanes=lanes, dt=dt, max_steps=round(20.0 / dt))
    episode = generate(seed, options)
    assert not touches(episode)
    assert not len(steps_back(episode))
    assert episode.motion[..., 3].min() >= 0.0


@given(st.integers(0, 10**6), st.floats(0.01, 2.0))
def test_arrivals_keep_a_headway_and_the_rate(seed, rate):
    lanes, times = arrival_times(np.array([0.0, rate]), 2000.0, np.random.default_rng(seed))
    assert (lanes == 1).all()
    assert (np.diff(times) >= 1.0 - 1e-9).all()
    expected = 2000.0 * min(rate, 0.5)
    assert abs(len(times) - expected) < 6.0 * np.sqrt(expected) + 2.0


def test_first_contact_is_the_later_of_two_that_touch():
    motion = np.zeros((3, 2, 4))
    motion[:, :, 0] = [[0.0, 0.0], [30.0, 3.9], [60.0, 60.0]]
    valid, size = np.ones((3, 2), bool), np.tile([4.0, 2.0, 1.5], (3, 1))
    nothing, beside = np.zeros((0, 5)), np.array([[61.0, 1.6, 0.0, 1.0, 1.0]])
    assert first_contact(motion, valid, size, nothing) == 1
    motion[1, 1, 0] = 4.1
    assert first_contact(motion, valid, size, nothing) == first_contact(motion, valid, size, beside) == NONE
    assert first_contact(motion, valid, size, beside - [[0.0, 0.2, 0.0, 0.0, 0.0]]) == 2


def scenario(seed, label, **options):
    (shard,) = Procedural().shards(f"{seed}:{seed + 1}", "train", label, ProceduralOptions(**options))
    return Procedural().scenario(shard, seed)


@pytest.mark.parametrize(
    ("seed", "expected"), [(0, 11148460433952844903), (5, 17144990301430188976), (7, 3045698796473966742)]
)
def test_version_1_keeps_its_scenarios(seed, expected):
    assert content_hash(scenario(seed, "v1")) == expected
    assert content_hash(scenario(seed, "v2", version="v1")) == expected


def test_versions_have_equal_roads_and_their_own_ids():
    first, second = scenario(3, "v1"), scenario(3, "v2")
    assert (first.id, second.id) == ("pg/v1/3", "pg/v2/3")
    assert set(first.map.ids.tolist()) < set(second.map.ids.tolist()), "the same roads, and bays"
    assert np.array_equal(scenario(3, "mine", version="v1").tracks.position, first.tracks.position)
    assert np.array_equal(scenario(3, "mine").tracks.position, second.tracks.position)


def test_shards_of_version_1_are_those_of_older_lakes():
    (shard,) = Procedural().shards("0:64", "train", "v1", ProceduralOptions())
    assert "version" not in shard.options.identity
    (other,) = Procedural().shards("0:64", "train", "mine", ProceduralOptions())
    assert other.options.identity["version"] == "v2"


@pytest.mark.parametrize(("label", "version"), [("v1", "v2"), ("mine", "v3")])
def test_wrong_versions_are_refused(label, version):
    with pytest.raises(BadParameter, match="version: "):
        scenario(0, label, version=version)


def test_ego_of_seed_36_does_not_step_back_any_more():
    assert len(steps_back(generate(36, replace(OPTIONS, version="v1"))))
    assert not len(steps_back(generate(36, OPTIONS)))


def test_left_hand_traffic_is_the_mirror_image():
    right, left = scenario(9, "v2"), scenario(9, "v2", left_hand=True)
    flip = np.array([1.0, -1.0, 1.0])
    np.testing.assert_allclose(
        left.tracks.position * flip + left.origin * flip, right.tracks.position + right.origin, atol=1e-3
    )
    np.testing.assert_allclose(np.sin(left.tracks.heading), -np.sin(right.tracks.heading), atol=1e-3)
    rows = {name: row for row, name in enumerate(right.map.ids)}
    for row, name in enumerate(left.map.ids):
        assert list(left.map.left_neighbors[row]) == list(right.map.right_neighbors[rows[name]])
        np.testing.assert_allclose(
            left.map.polyline[row] * flip + left.origin * flip, right.map.polyline[rows[name]] + right.origin, atol=1e-2
        )


def test_left_hand_traffic_needs_a_map_of_its_own():
    with pytest.raises(BadParameter, match="left_hand: a given map"):
        scenario(0, "v2", left_hand=True, map="town.xodr")
