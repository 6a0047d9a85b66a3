"""A trained driver without torch: in NumPy and in ONNX it chooses the same, and `evaluate` compares it with others."""

from __future__ import annotations

import numpy as np
import pytest

from scenarionet_data import Lake
from scenarionet_data.errors import BadParameter
from scenarionet_data.storage import checkpoints, evaluation_runs
from scenarionet_data.storage.files.places import open_files
from scenarionet_sim.drivers.trained import TrainedDriver
from scenarionet_sim.environments.config import PAPER_OBSERVATION
from scenarionet_sim.environments.observation import Observation
from scenarionet_sim.evaluation.evaluation import evaluate


def arrays(bins=0, is_squashed=False):
    """Arrays of a checkpoint: two layers of a policy that sees 5 numbers."""
    rng, first = np.random.default_rng(0), "policy." if is_squashed else "policy.body."
    places = ("0.0", "0.2") if is_squashed else ("0", "2")
    sizes, found = [(8, 5), (2 * bins or 2, 8)], {}
    for place, (outputs, inputs) in zip(places, sizes, strict=True):
        found[f"{first}{place}.weight"] = rng.normal(size=(outputs, inputs)).astype("f4")
        found[f"{first}{place}.bias"] = rng.normal(size=outputs).astype("f4")
    return found | ({} if bins or is_squashed else {"policy.log_std": np.zeros(2, "f4")})


def test_the_network_by_hand():
    given = arrays()
    seen = np.random.default_rng(1).normal(size=(3, 5)).astype("f4")
    hidden = np.tanh(seen @ given["policy.body.0.weight"].T + given["policy.body.0.bias"])
    expected = np.clip(hidden @ given["policy.body.2.weight"].T + given["policy.body.2.bias"], -1, 1)
    driver = TrainedDriver.of_arrays(given, 0)
    np.testing.assert_allclose(driver(seen), expected, atol=1e-6)
    np.testing.assert_array_equal(driver.act(seen[1]), driver(seen[1:2])[0])


@pytest.mark.parametrize("kind", [{}, {"bins": 5}, {"is_squashed": True}])
def test_onnx_chooses_the_same(tmp_path, kind):
    onnxruntime = pytest.importorskip("onnxruntime")
    seen = np.random.default_rng(1).normal(size=(9, 5)).astype("f4")
    driver = TrainedDriver.of_arrays(arrays(**kind), kind.get("bins", 0))
    driver.export_onnx(tmp_path / "driver.onnx")
    session = onnxruntime.InferenceSession(tmp_path / "driver.onnx", providers=["CPUExecutionProvider"])
    np.testing.assert_allclose(session.run(None, {"observations": seen})[0], driver(seen), atol=1e-6)


@pytest.fixture
def lake(drives, tmp_path):
    """A lake with a run whose driver, of the paper's observation, steers straight on at full throttle."""
    import shutil

    opened = Lake(shutil.copytree(drives, tmp_path / "lake"))
    files, width = open_files(opened.root), Observation(PAPER_OBSERVATION, "flat").space.shape[0]
    evaluation_runs.claim(files, "fast", ("training",), {"config": {"bins": 0}})
    weights = {"policy.body.0.weight": np.zeros((2, width), "f4"), "policy.body.0.bias": np.array([0.0, 1.0], "f4")}
    weights |= {"policy.log_std": np.zeros(2, "f4")}
    for number in (1, 2):
        checkpoints.save(files, "fast", checkpoints.Checkpoint(number, {"steps": number}, weights))
    return opened


def test_a_trained_driver_is_evaluated_beside_others(lake):
    for policy in ("runs/fast", "idm"):
        assert evaluate(lake, ["made/v1/empty"], policy=policy, name=policy.replace("/", ".")).broken == []
    rows = lake.sql("SELECT run, success, mean_speed FROM results ORDER BY run")
    assert rows["success"].to_list() == [True, True]
    assert rows["mean_speed"][1] > rows["mean_speed"][0]  # the driver is faster than IDM
    assert evaluation_runs.describe(lake.files, "runs.fast")["policy"] == "runs/fast@2"  # the newest checkpoint


def test_an_unknown_driver_is_named_with_those_there_are(lake):
    with pytest.raises(BadParameter, match="no checkpoint 'runs/slow'; trained drivers: fast"):
        evaluate(lake, policy="runs/slow")
    with pytest.raises(BadParameter, match="no checkpoint 'runs/fast@7'"):
        evaluate(lake, policy="runs/fast@7")
