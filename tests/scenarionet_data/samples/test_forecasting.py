"""Samples are the recorded states and maps, in another frame: compared with the whole scenarios, in plain NumPy."""

from __future__ import annotations

import pickle
from dataclasses import replace

import numpy as np
import pytest

from scenarionet_data import Agents, Augmentation, ObjectType, Polylines, Samples, Targets, TimeWindow, resample
from scenarionet_data.arrays.geometry import rotate, wrap_angle
from tests.fixtures.drives import Other, make_drive
from tests.fixtures.lakes import write_lake
from tests.scenarionet_data.samples.conftest import made

WINDOW = TimeWindow(history=0.4, future=1.2)
STATES = ("history", "future")
EVERYTHING = Agents(count=16, radius=1e6, types=tuple(ObjectType))
pytestmark = pytest.mark.filterwarnings("ignore::scenarionet_data.samples.selection.SamplesWarning")


@pytest.fixture(scope="module")
def samples(lake):
    return Samples(lake, window=WINDOW, agents=EVERYTHING, targets=Targets("moving"))


def seed_of(samples, index):
    return int(samples.key(index).scenario_id[-6:])


def in_scenario(sample, points):
    """Points of a sample in the frame of its scenario."""
    x, y, heading, mirror = sample["pose"].astype(np.float64)
    return rotate(points * [1.0, mirror], heading) + np.array([x, y])


def check_states(samples, index, dt=0.1):
    sample, key = samples[index], samples.key(index)
    scenario = resample(made(seed_of(samples, index)), dt)
    tracks, now = scenario.tracks, scenario.current_timestep
    first = now - samples.choices.window.num_history + 1
    last = now + samples.choices.window.num_future
    steps = {"history": slice(first, now + 1), "future": slice(now + 1, last + 1)}
    rows = sample["agent_row"][sample["agent_row"] >= 0]
    assert sorted(rows) == np.flatnonzero(made(seed_of(samples, index)).tracks.valid[:, 10]).tolist()
    assert tracks.ids[rows[0]] == key.track_ids[0]
    distance = np.hypot(*(tracks.position[rows, now] - tracks.position[rows[0], now])[:, :2].T)
    assert (np.diff(distance) >= 0).all()
    np.testing.assert_array_equal(sample["agent_type"][: len(rows)], tracks.object_type[rows])
    np.testing.assert_allclose(sample["agent_size"][: len(rows)], tracks.size[rows, now])
    for name in STATES:
        states, valid = sample[name], sample[f"{name}_valid"]
        span = steps[name]
        assert not valid[len(rows) :].any() and not states[~valid].any()
        np.testing.assert_array_equal(valid[: len(rows)], tracks.valid[rows, span])
        flags = sample[f"{name}_interpolated"][: len(rows)]
        np.testing.assert_array_equal(flags, tracks.is_interpolated[rows, span])
        for place, row in enumerate(rows):
            seen, found = tracks.valid[row, span], states[place]
            there = in_scenario(sample, found[seen, :2].astype(np.float64))
            np.testing.assert_allclose(there, tracks.position[row, span][seen, :2], atol=1e-4)
            turned = wrap_angle(found[seen, 2].astype(np.float64) + sample["pose"][2] - tracks.heading[row, span][seen])
            np.testing.assert_allclose(turned, 0, atol=1e-4)
            velocity = rotate(found[seen, 3:].astype(np.float64), sample["pose"][2])
            np.testing.assert_allclose(velocity, tracks.velocity[row, span][seen], atol=1e-4)


def test_states_are_the_recorded_ones(samples):
    for index in range(len(samples)):
        check_states(samples, index)


@pytest.mark.parametrize("dt", [0.05, 0.2, 0.25])
def test_other_timesteps_are_those_of_resample(lake, dt):
    """The same interpolation, angles along the shorter arc, as of whole scenarios."""
    window = TimeWindow(history=2 * dt, future=2 * dt, dt=dt, longest_gap=1.0)
    ids = [made(seed).id for seed in (0, 2)]
    samples = Samples(lake, ids, window=window, agents=EVERYTHING, targets=Targets("moving", limit=2))
    assert len(samples) == 4
    for index in range(len(samples)):
        check_states(samples, index, dt)


def test_gaps_are_bridged_up_to_a_limit(lake):
    def share(longest_gap):
        window = TimeWindow(history=0.4, future=1.2, dt=0.05, longest_gap=longest_gap)
        return Samples(lake, [made(0).id], window=window, agents=EVERYTHING)[0]["future_valid"].mean()

    assert share(0.5) == share(0.11) > share(0.05)


def test_polylines_are_points_of_the_map(samples):
    sample = next(samples[i] for i in range(len(samples)) if seed_of(samples, i) == 1)
    features = made(1).map
    points, valid, kinds = sample["polylines"], sample["polylines_valid"], sample["polyline_type"]
    used = valid.any(axis=1)
    assert set(kinds[used]) == set(features.feature_type[(features.polyline.lengths + features.polygon.lengths) > 0])
    assert not points[~valid].any()
    lines = [
        line if len(line) else np.concatenate([area, area[:1]])
        for line, area in zip(features.polyline, features.polygon, strict=True)
    ]
    for piece in np.flatnonzero(used):
        there = in_scenario(sample, points[piece, valid[piece], :2].astype(np.float64))
        steps = np.linalg.norm(np.diff(there, axis=0), axis=1)
        assert (steps <= 1.0 + 1e-4).all()  # straight from point to point
        same_kind = [
            line for line, kind in zip(lines, features.feature_type, strict=True) if kind == kinds[piece] and len(line)
        ]
        assert min(max(distance_to(point, line) for point in there) for line in same_kind) < 1e-3
    nearest = [np.hypot(*points[piece, valid[piece], :2].T).min() for piece in np.flatnonzero(used)]
    assert (np.diff(nearest) >= -1e-3).all()
    whole = sum(np.linalg.norm(np.diff(line[:, :2], axis=0), axis=1).sum() for line in lines if len(line))
    pieces = [np.linalg.norm(np.diff(points[p, valid[p], :2], axis=0), axis=1).sum() for p in np.flatnonzero(used)]
    assert abs(sum(pieces) - whole) < 0.05 * whole  # corners are cut


def distance_to(point, line):
    """Distance of a point from a polyline in the plane."""
    start, step = line[:-1, :2].astype(np.float64), np.diff(line[:, :2].astype(np.float64), axis=0)
    if not len(step):
        return np.hypot(*(point - line[0, :2]))
    along = ((point - start) * step).sum(axis=1) / np.maximum((step**2).sum(axis=1), 1e-12)
    return np.hypot(*(point - start - np.clip(along, 0, 1)[:, None] * step).T).min()


def test_directions_point_along_the_line(samples):
    sample = samples[0]
    for piece in np.flatnonzero(sample["polylines_valid"].sum(axis=1) > 1):
        points = sample["polylines"][piece, sample["polylines_valid"][piece]]
        step = np.diff(points[:, :2], axis=0)
        length = np.linalg.norm(step, axis=1, keepdims=True)
        is_far = length[:, 0] > 1e-3
        np.testing.assert_allclose(points[:-1, 2:][is_far], (step / np.maximum(length, 1e-9))[is_far], atol=1e-3)


def test_a_batch_is_its_samples(samples):
    order = [5, 0, 3, 3, len(samples) - 1]
    batch = samples.batch(order)
    for place, index in enumerate(order):
        for name, values in samples[index].items():
            np.testing.assert_array_equal(batch[name][place], values)
    with pytest.raises(IndexError, match=f"sample {len(samples)} of {len(samples)}"):
        samples.batch([len(samples)])


def test_samples_pickle(samples):
    again = pickle.loads(pickle.dumps(samples))
    assert len(again) == len(samples) and again.key(2) == samples.key(2)
    for name, values in again[2].items():
        np.testing.assert_array_equal(values, samples[2][name])


def test_a_scene_has_the_ego_in_its_origin(lake):
    scenes = Samples(lake, window=WINDOW, agents=EVERYTHING, perspective="scene")
    assert [key.track_ids for key in map(scenes.key, range(len(scenes)))] == [("t0", "t1")] * len(scenes)
    for index in range(len(scenes)):
        sample, tracks = scenes[index], made(seed_of(scenes, index)).tracks
        ego = np.flatnonzero(sample["agent_row"] == tracks.index("t0"))[0]
        np.testing.assert_allclose(sample["history"][ego, -1, :3], 0, atol=1e-6)
        wanted = [row for row in map(tracks.index, ("t0", "t1")) if tracks.valid[row, 10]]
        assert sample["agent_row"][sample["is_target"]].tolist() == wanted


def test_augmentation_depends_on_seed_epoch_and_sample_only(lake):
    def turned(**how):
        augmentation = Augmentation(rotation=np.pi, flip=0.5, noise=0.1, drop=0.3, **how)
        return Samples(lake, window=WINDOW, targets=Targets("moving"), augmentation=augmentation)

    samples = turned(seed=3)
    whole = samples.batch(range(len(samples)), epoch=2)
    for index in (0, 4, 7):
        alone = samples.batch([index], epoch=2)
        assert all(np.array_equal(values[0], whole[name][index]) for name, values in alone.items())
    assert not np.array_equal(samples.batch([0])["pose"], whole["pose"][:1])
    assert not np.array_equal(turned(seed=4).batch([0], epoch=2)["pose"], whole["pose"][:1])
    assert {-1.0, 1.0} == set(whole["pose"][:, 3])


def test_turned_and_mirrored_samples_show_the_same_scenario(lake):
    plain = Samples(lake, window=WINDOW, targets=Targets("moving"))
    augmented = Samples(
        lake, window=WINDOW, targets=Targets("moving"), augmentation=Augmentation(rotation=3.0, flip=0.5, seed=1)
    )
    for index in range(0, len(plain), 3):
        first, second = plain[index], augmented[index]
        for name in ("future", "polylines"):
            np.testing.assert_array_equal(first[f"{name}_valid"].sum(), second[f"{name}_valid"].sum())
        valid = first["future_valid"]
        there = [in_scenario(sample, sample["future"][valid][:, :2].astype(np.float64)) for sample in (first, second)]
        np.testing.assert_allclose(*there, atol=1e-3)


def test_noise_and_dropping_leave_targets_in(lake):
    noisy = Samples(lake, window=WINDOW, targets=Targets("moving"), augmentation=Augmentation(noise=0.2, drop=1.0))
    plain = Samples(lake, window=WINDOW, targets=Targets("moving"))
    first, second = plain.batch(range(len(plain))), noisy.batch(range(len(plain)))
    assert second["is_target"][:, 0].all() and not (second["agent_row"][:, 1:] >= 0).any()
    np.testing.assert_array_equal(first["future"][:, 0], second["future"][:, 0])
    valid = first["history_valid"][:, 0]
    shift = (second["history"] - first["history"])[:, 0, :, :2][valid]
    assert 0.15 < shift.std() < 0.25


def test_without_a_map_nothing_of_it_is_read(lake):
    samples = Samples(lake, window=WINDOW, polylines=Polylines(count=0))
    assert "polylines" not in samples[0]
    assert any(seed_of(samples, index) == 4 for index in range(len(samples)))


def test_a_layout_is_a_function(lake):
    def positions(scenes, choices):
        return {"ego": np.array([scene.tracks.position[0, 0] for scene in scenes.descriptions])[scenes.requests.scene]}

    samples = Samples(lake, window=WINDOW, layout=positions)
    np.testing.assert_array_equal(samples[0]["ego"], made(seed_of(samples, 0)).tracks.position[0, 0])


def test_two_vehicles_by_hand(tmp_path):
    """The ego drives north at 10 m/s through (3, 4) now; another stands 5 m ahead and 2 m to its left, facing east."""
    drive = make_drive(num_steps=21, others=(Other(50.0),), has_map=False)
    steps = np.arange(21, dtype=np.float32)
    position = np.zeros((2, 21, 3), np.float32)
    position[0, :, 0], position[0, :, 1] = 3.0, 4.0 + (steps - 10)
    position[1, :, :2] = 1.0, 9.0
    heading = np.zeros((2, 21), np.float32)
    heading[0] = np.pi / 2
    velocity = np.zeros((2, 21, 2), np.float32)
    velocity[0, :, 1] = 10.0
    tracks = replace(drive.tracks, position=position, heading=heading, velocity=velocity)
    root = write_lake(tmp_path / "lake", [replace(drive, tracks=tracks, current_timestep=10)]).root
    samples = Samples(root, window=(0.2, 0.3), targets="ego", agents=Agents(count=3), polylines=Polylines(count=0))
    batch = samples.batch([0])
    assert batch["history"][0, 0] == pytest.approx(
        np.array([[-2, 0, 0, 10, 0], [-1, 0, 0, 10, 0], [0, 0, 0, 10, 0]]), abs=1e-5
    )
    assert batch["future"][0, 0] == pytest.approx(np.array([[x, 0, 0, 10, 0] for x in (1, 2, 3)]), abs=1e-5)
    assert batch["history"][0, 1] == pytest.approx(np.array([[5, 2, -np.pi / 2, 0, 0]] * 3), abs=1e-5)
    assert batch["pose"][0] == pytest.approx([3, 4, np.pi / 2, 1], abs=1e-5)
    assert batch["is_target"][0].tolist() == [True, False, False]
    assert batch["history_valid"][0].all(axis=1).tolist() == [True, True, False]
    assert not batch["history"][0, 2].any() and batch["agent_row"][0].tolist() == [0, 1, -1]
