"""Examples read by Waymax itself, from a checkout, with TensorFlow and JAX in a Python of their own."""

from __future__ import annotations

import os
from pathlib import Path

import numpy as np
import pytest

from scenarionet_data import ScenarioLoader, convert
from scenarionet_data.interchange import writer_for
from scenarionet_data.interchange.base import Losses
from scenarionet_data.interchange.scenes import make_scene
from scenarionet_data.interchange.waymax.features import KINDS, MAX_LIGHTS, MAX_OBJECTS
from tests.interop.test_opendrive import ROOT, run

CHECKOUT, PYTHON = os.environ.get("SCENARIONET_WAYMAX"), os.environ.get("SCENARIONET_WAYMAX_PYTHON")
DATA = os.environ.get("SCENARIONET_TEST_DATA")
SOURCES = {"waymo": "waymo", "scenarionet": "scenarionet", "argoverse2": "argoverse2"}

pytestmark = pytest.mark.interop


@pytest.mark.skipif(
    not (CHECKOUT and PYTHON),
    reason="Waymax: set SCENARIONET_WAYMAX to its checkout, SCENARIONET_WAYMAX_PYTHON to a Python that has its needs",
)
def test_waymax_makes_the_same_state(tmp_path, monkeypatch):
    """Positions to a millimetre, states of lights at each step, the road graph, paths of which one is the route."""
    convert("pg", "0:6", tmp_path / "lake")
    for name, raw in SOURCES.items() if DATA else ():
        convert(name, Path(DATA) / raw, tmp_path / "lake")
    scenarios, files = [*ScenarioLoader(tmp_path / "lake")], []
    for number, scenario in enumerate(scenarios):
        for content in writer_for("waymax").write(scenario, str(number), Losses()).values():
            files.append(tmp_path / f"{number}.tfrecord")
            files[-1].write_bytes(content)
    monkeypatch.setenv("PYTHONPATH", str(CHECKOUT))
    run(Path(str(PYTHON)), ROOT / "tests/interop/reads_waymax.py", tmp_path / "states.npz", *files)
    states = np.load(tmp_path / "states.npz")
    for number, scenario in enumerate(scenarios):
        scene, part = make_scene(scenario, Losses(), KINDS), {
            name.partition("/")[2]: states[name] for name in states.files if name.startswith(f"{number}/")
        }  # fmt: skip
        is_far = np.abs(scenario.origin[:2]).max() >= 2.0**14
        expected = scene.position - (scenario.origin if is_far else 0.0)
        position = np.stack([part[f"log/{axis}"] for axis in "xyz"], axis=-1)
        place_of = {int(key): place for place, key in enumerate(part["objects/ids"]) if part["objects/is_valid"][place]}
        kept = [row for row, key in enumerate(scene.ids) if key in place_of]
        assert (
            len(kept) == min(len(scene.ids), MAX_OBJECTS)
            and part["objects/is_sdc"].argmax() == place_of[scene.ids[scene.ego]]
        )
        places = [place_of[scene.ids[row]] for row in kept]
        valid = scene.valid[kept]
        assert np.array_equal(part["log/valid"][places], valid)
        np.testing.assert_allclose(position[places][valid], expected[kept][valid], atol=1e-3)
        lights = (scenario.lights.state[:, scene.steps] != 0).sum(axis=1)
        if (lights > 0).sum() <= MAX_LIGHTS:
            assert part["lights/valid"].sum() == lights.sum()
        assert part["roads/valid"].any() and part["paths/valid"].any()
    assert part["paths/on_route"].any(), "the last are Argoverse 2's, whose lanes are linked"
