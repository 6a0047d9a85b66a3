"""Which scenarios give samples, at which timesteps, for which targets; what gives none is counted and named once."""

from __future__ import annotations

import re
import warnings
from dataclasses import replace

import numpy as np
import pytest

from scenarionet_data import Augmentation, Polylines, Samples, Targets, TimeWindow
from scenarionet_data.errors import BadParameter, UnsafeSql
from scenarionet_data.samples.selection import SamplesWarning
from tests.fixtures.drives import make_drive
from tests.fixtures.lakes import write_lake
from tests.fixtures.scenarios import renamed
from tests.scenarionet_data.samples.conftest import COUNT, made

WINDOW = TimeWindow(history=0.4, future=1.2)


def keys(samples):
    return [samples.key(index) for index in range(len(samples))]


def quietly(*arguments, **how):
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", SamplesWarning)
        return Samples(*arguments, **how)


def test_scenarios_without_samples_are_counted_and_named(lake):
    short, bare = (f"for example {made(seed).id}" for seed in (5, 4))
    wanted = f"of 6 scenarios: 1 too short for the window, {short}; 1 without a map, {bare}"
    with pytest.warns(SamplesWarning, match=re.escape(wanted)):
        samples = Samples(lake, window=WINDOW)
    assert samples.findings == {"too short for the window": (1, made(5).id), "without a map": (1, made(4).id)}
    assert {key.scenario_id for key in keys(samples)} == {made(seed).id for seed in range(4)}


def test_scenarios_without_targets_and_of_another_timestep_are_named(lake):
    window, targets = TimeWindow(history=0.4, future=1.2, dt=0.05), Targets("where", where="scenario_id LIKE '%3'")
    with pytest.warns(SamplesWarning, match=r"4 without targets.*6 of another timestep than 0.05 s, which are interp"):
        samples = Samples(lake, window=window, targets=targets, polylines=Polylines(count=0))
    assert {key.scenario_id for key in keys(samples)} == {made(3).id}


def test_recorded_targets_and_the_ego(lake):
    assert [key.track_ids for key in keys(quietly(lake, window=WINDOW))] == [("t0",), ("t1",)] * 4
    assert [key.track_ids for key in keys(quietly(lake, window=WINDOW, targets=Targets("ego")))] == [("t0",)] * 4
    assert len(quietly(lake, window=WINDOW, targets=Targets(limit=1))) == 4


def test_a_long_scenario_that_is_current_at_its_start_gives_samples_by_default(tmp_path):
    """As a scene of nuScenes: 19 s, current at its first timestep, and no targets named."""
    scene = replace(make_drive(num_steps=39, dt=0.5), current_timestep=0)
    named = replace(renamed(scene, "named"), tracks_to_predict=((scene.ego_id, 0),))
    short = renamed(replace(make_drive(num_steps=10, dt=0.5), current_timestep=0), "short")
    root = write_lake(tmp_path / "lake", [scene, named, short]).root
    with pytest.warns(SamplesWarning) as warned:
        samples = Samples(root, polylines=Polylines(count=0))
    assert (scene.id, 2) in {(key.scenario_id, key.timestep) for key in keys(samples)}  # 1 s of history, at 2 Hz
    assert [key for key in keys(samples) if key.scenario_id == named.id] == [(named.id, 2, (scene.ego_id,))]
    assert samples.findings["too short for the window"] == (1, short.id)
    assert samples.findings["whose own timestep leaves no room for the window, at their first one that does"][0] == 2
    assert samples.findings["that name no targets, with their moving road users"] == (1, scene.id)
    assert "1 too short for the window" in str(warned[0].message)
    assert samples.batch(range(len(samples)))["has_centre"].all()
    strict = quietly(root, targets=Targets("recorded"), polylines=Polylines(count=0))
    assert {key.scenario_id for key in keys(strict)} == {named.id}


def test_sql_over_objects_chooses_targets(lake):
    how = {"targets": Targets("where", where="object_type = 'PEDESTRIAN'"), "polylines": Polylines(count=0)}
    found = {(key.scenario_id, *key.track_ids) for key in keys(quietly(lake, window=WINDOW, **how))}
    tracks = [(made(seed).id, made(seed).tracks) for seed in range(COUNT - 1)]
    wanted = {(name, t.ids[row]) for name, t in tracks for row in np.flatnonzero((t.object_type == 2) & t.valid[:, 10])}
    assert found == wanted != set()
    with pytest.raises(UnsafeSql):
        Targets("where", where="1 = 1; DROP TABLE tracks")


def test_a_stride_gives_a_sample_at_every_moment_at_which_the_target_is_seen(lake):
    window = TimeWindow(history=0.4, future=1.2, stride=0.5)
    samples = quietly(lake, [made(0).id, made(1).id], window=window, targets=Targets("recorded"))
    moments = (4, 9, 14)  # 3 s are recorded
    wanted = [
        (made(seed).id, step, (name,))
        for seed in (0, 1)
        for step in moments
        for name in ("t0", "t1")
        if made(seed).tracks.valid[made(seed).tracks.index(name), step]
    ]
    assert keys(samples) == wanted
    assert samples.batch(range(len(samples)))["has_centre"].all()


def test_targets_that_are_not_seen_are_masked_with_one_warning(lake):
    tracks = [made(seed).tracks for seed in range(4)]
    unseen = [each for each in tracks if not each.valid[each.index("t1"), 10]]
    assert unseen
    samples = quietly(lake, window=WINDOW)
    with pytest.warns(SamplesWarning, match="is not seen at the current timestep: such samples are masked"):
        batch = samples.batch(range(len(samples)))
    assert (~batch["has_centre"]).sum() == len(unseen)
    masked = {name: values[~batch["has_centre"]] for name, values in batch.items()}
    assert not any(masked[name].any() for name in ("history_valid", "future_valid", "polylines_valid", "is_target"))
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        samples.batch(range(len(samples)))


@pytest.mark.parametrize(
    ("part", "how", "message"),
    [
        (TimeWindow, {"history": 0.25}, "history: expected a multiple of 0.1 s, found 0.25"),
        (TimeWindow, {"dt": 0.0}, "dt: expected a timestep above 0 s, found 0.0"),
        (Targets, {"which": "all"}, "which: expected default or recorded or ego or moving or where, found 'all'"),
        (Targets, {"where": "true"}, "where: expected a condition exactly with"),
        (Polylines, {"points": 1}, "points: expected at least 2 points, found 1"),
        (Augmentation, {"flip": 2}, "flip: expected a probability, found 2"),
    ],
)
def test_wrong_choices_are_refused(part, how, message):
    with pytest.raises(BadParameter, match=message):
        part(**how)
