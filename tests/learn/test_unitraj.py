"""The layout ``unitraj`` against UniTraj's own code, on recorded scenes; the checkout is ``SCENARIONET_UNITRAJ``."""

from __future__ import annotations

import json
import os
import pickle
import subprocess
import sys
from collections import defaultdict
from pathlib import Path

import numpy as np
import pytest

from scenarionet_data import Agents, Lake, Polylines, Samples, ScenarioLoader, Targets, TimeWindow
from scenarionet_data.conversion import convert
from scenarionet_data.samples.dataset import UNITRAJ
from tests.learn.unitraj_inputs import as_dictionary, config

pytestmark = [
    pytest.mark.learn,
    pytest.mark.filterwarnings("ignore::scenarionet_data.samples.selection.SamplesWarning"),
]
CHECKOUT = os.environ.get("SCENARIONET_UNITRAJ")
PAST, FUTURE, AGENTS, ROADS, POINTS = 21, 60, 64, 256, 20


@pytest.fixture(scope="module")
def lake(tmp_path_factory, recordings):
    root = tmp_path_factory.mktemp("unitraj") / "lake"
    convert("scenarionet", str(recordings / "scenarionet"), root)
    return Lake(root)


@pytest.fixture(scope="module")
def samples(lake):
    """Road users of the recorded nuScenes scenes, at the 21st timestep."""
    types = "object_type IN ('VEHICLE', 'PEDESTRIAN', 'CYCLIST')"
    return Samples(
        lake,
        lake.select("contains(source_file, 'nuscenes')"),
        window=TimeWindow(history=2.0, future=6.0, stride=100.0),
        agents=Agents(count=AGENTS),
        polylines=Polylines(count=ROADS, points=POINTS),
        targets=Targets("where", where=types, limit=20),
        layout=UNITRAJ,
    )


@pytest.fixture(scope="module")
def theirs(lake, samples, tmp_path_factory):
    """Arrays of UniTraj by scenario, target and name."""
    if CHECKOUT is None:
        pytest.skip("SCENARIONET_UNITRAJ names no checkout of github.com/vita-epfl/UniTraj")
    folder, targets = tmp_path_factory.mktemp("theirs"), defaultdict(list)
    for key in map(samples.key, range(len(samples))):
        targets[key.scenario_id].extend(key.track_ids)
    for number, scenario in enumerate(ScenarioLoader(lake, list(targets))):
        content = as_dictionary(scenario, targets[scenario.id])
        (folder / f"{number}.pkl").write_bytes(pickle.dumps(content))
    paths = [str(folder / f"{number}.pkl") for number in range(len(targets))]
    program = Path(__file__).with_name("unitraj_reference.py")
    chosen = json.dumps(config(PAST, FUTURE, AGENTS, ROADS, POINTS))
    command = [sys.executable, str(program), CHECKOUT, chosen, str(folder / "out.npz"), *paths]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    found = defaultdict(dict)
    for name, values in np.load(folder / "out.npz").items():
        file, target, array = name.split("|")
        found[list(targets)[int(file.removesuffix(".pkl"))], target][array] = values
    return found


def in_order(sample):
    """Order agents that are not seen now by their positions: they have no distance, and UniTraj sorts them anyhow."""
    rank = np.where(sample["obj_trajs_mask"][:, -1], np.arange(AGENTS), AGENTS)
    order = np.lexsort((*sample["obj_trajs_last_pos"].T.round(2), ~sample["obj_trajs_mask"].any(axis=1), rank))
    return {name: values[order] if name.startswith("obj_trajs") else values for name, values in sample.items()}


def test_every_array_equals_unitrajs(samples, theirs):
    assert len(theirs) == len(samples) > 100
    for index in range(len(samples)):
        key, ours = samples.key(index), samples[index]
        reference = theirs[key.scenario_id, key.track_ids[0]]
        assert set(ours) == set(reference) - {"map_center", "center_objects_id"}
        ours, reference = in_order(ours), in_order(reference)
        for name, values in ours.items():
            np.testing.assert_allclose(values, reference[name], atol=1e-4, rtol=1e-5, err_msg=f"{name} of {key}")
