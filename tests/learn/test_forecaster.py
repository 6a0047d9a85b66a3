"""The transformer learns, continues after an interruption with the same weights, and its experiment writes a page."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pyarrow as pa
import pytest

from scenarionet_data import Lake, convert

pytestmark = pytest.mark.learn
torch = pytest.importorskip("torch", reason="no torch: run `make test-learn`")

import forecaster as forecasters  # noqa: E402
from forecaster import ForecasterConfig, displacements, load, measure, predict, train  # noqa: E402
from forecaster_experiment import (  # noqa: E402
    Experiment,
    constant_velocity,
    interval,
    kalman_filter,
    run_experiment,
    write_page,
)

CONFIG = ForecasterConfig(epochs=2, size=32, layers=1, agents=4, polylines=8, stride=2.0)


@pytest.fixture(scope="module")
def lake(tmp_path_factory):
    root = tmp_path_factory.mktemp("generated") / "lake"
    convert("pg", "0:6", root, version="v1")
    lake = Lake(root)
    lake.filter("TRUE", name="driven")
    return lake


def test_interrupted_run_continues_to_the_same_weights(lake):
    whole = train(lake, "driven", CONFIG, run="whole", tests=("driven",))

    class Killed(Exception):
        pass

    def kill(_rows):
        raise Killed

    with pytest.raises(Killed):
        train(lake, "driven", CONFIG, run="parts", tests=("driven",), on_epoch=kill)
    continued = train(lake, "driven", CONFIG, run="parts", tests=("driven",))
    stored = load(lake, "parts", CONFIG)
    for name, value in whole.state_dict().items():
        assert torch.equal(value, continued.state_dict()[name]) and torch.equal(value, stored.state_dict()[name])
    curve = lake.sql(
        "SELECT run, round, learned ->> 'min_ade' AS ade FROM training WHERE test = 'driven' ORDER BY 2, 1"
    )
    assert curve["round"].to_list() == [1, 1, 2, 2]
    assert curve["ade"][0] == curve["ade"][1] and curve["ade"][2] == curve["ade"][3]


def test_training_lowers_the_error(lake):
    config = replace(CONFIG, epochs=20, batch_size=16, stride=1.0, rotation=0.0)
    samples = config.samples(lake, "driven", is_training=False)
    model = train(lake, "driven", config, run="longer")
    learned, _ = measure(model.modes, samples)
    constant, _ = measure(constant_velocity(config), samples)
    assert np.nanmean(learned) < 0.9 * np.nanmean(constant)
    rows = pa.concat_tables(predict(model, samples))
    assert rows.num_rows == config.modes * len(samples)


def test_displacements_are_those_of_the_closest_mode():
    truth = np.zeros((2, 3, 2))
    modes = np.stack([truth + 1.0, truth + np.array([3.0, 4.0])], axis=1)
    valid = np.array([[True, True, True], [True, False, False]])
    mean, end = displacements(modes, truth, valid)
    assert mean == pytest.approx([2**0.5, 2**0.5])
    assert end[0] == pytest.approx(2**0.5) and np.isnan(end[1])


def test_kalman_filter_follows_a_straight_path():
    config = ForecasterConfig()
    times = config.dt * np.arange(-config.num_history + 1, 1)
    path = np.stack([7.0 * times, -2.0 * times], axis=-1)
    history = np.zeros((1, 2, config.num_history, 5))
    history[0, 0, :, :2], history[0, 0, :, 3:] = path, (7.0, -2.0)
    batch = {"history": torch.from_numpy(history), "history_valid": torch.ones((1, 2, config.num_history), dtype=bool)}
    ahead = config.dt * np.arange(1, config.num_future + 1)[:, None] * (7.0, -2.0)
    assert kalman_filter(config)(batch)[0, 0] == pytest.approx(ahead, abs=1e-6)


def test_interval_contains_the_mean_of_its_rows():
    rng = np.random.default_rng(0)
    count = 400
    rows = pa.table(
        {
            "seed": np.repeat([0, 1], count // 2),
            "scenario_id": np.tile(np.arange(20).astype(str), count // 20),
            "x": rng.random(count),
        }
    )
    mean = interval(rows, "x", 500)
    assert mean.low < mean.value < mean.high and mean.value == pytest.approx(np.mean(rows["x"].to_numpy()))
    assert (mean.scenarios, mean.targets) == (20, 200)


def test_experiment_compares_sources(lake, tmp_path, monkeypatch):
    halves = (("even", "hash(scenario_id) % 2 = 0"), ("odd", "hash(scenario_id) % 2 = 1"))
    config = replace(CONFIG, epochs=1)
    experiment = Experiment(sources=halves, seeds=(0, 1), resamples=50, config=config)
    rows = run_experiment(lake, experiment)
    assert set(rows["trained_on"].to_pylist()) == {"constant velocity", "Kalman filter", "even", "odd", "all"}
    monkeypatch.setattr(forecasters, "loss", None)  # finished runs are not trained again
    assert run_experiment(lake, experiment).equals(rows)
    write_page(tmp_path / "page.md", rows, experiment, "abc123")
    page = (tmp_path / "page.md").read_text("utf-8")
    assert "`abc123`" in page and "| all | " in page and "| `seeds` | (0, 1) |" in page
