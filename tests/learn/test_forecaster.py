"""The transformer learns, continues after an interruption with the same weights, and its experiment writes a page."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pyarrow as pa
import pytest

from scenarionet_data import Lake, convert

pytestmark = pytest.mark.learn
torch = pytest.importorskip("torch", reason="no torch: run `make test-learn`")

from forecaster_experiment import Experiment, interval, run_experiment, write_page  # noqa: E402

from scenarionet_data.errors import BadParameter, LakeError  # noqa: E402
from scenarionet_data.forecasts import forecaster as forecasters  # noqa: E402
from scenarionet_data.forecasts.forecaster import (  # noqa: E402
    ForecasterConfig,
    displacements,
    load,
    measure,
    predict,
    train,
)
from scenarionet_data.forecasts.forecaster_scores import (  # noqa: E402
    constant_velocity,
    fan,
    kalman_filter,
    score_forecaster,
)
from scenarionet_data.learning.fitting import FitRun  # noqa: E402
from scenarionet_data.storage import checkpoints, evaluation_runs  # noqa: E402
from scenarionet_sim.evaluation.receipts import Receipt  # noqa: E402
from scenarionet_sim.evaluation.score_receipts import score_receipt, verify_score  # noqa: E402

CONFIG = ForecasterConfig(epochs=2, size=32, layers=1, agents=4, polylines=8, stride=2.0)


@pytest.fixture(scope="module")
def lake(tmp_path_factory):
    root = tmp_path_factory.mktemp("generated") / "lake"
    convert("pg", "0:6", root, version="v1")
    lake = Lake(root)
    lake.filter("TRUE", name="driven")
    return lake


def test_interrupted_run_continues_to_the_same_weights(lake):
    whole = train(FitRun(lake, "driven", "whole", tests=("driven",)), CONFIG)

    class Killed(Exception):
        pass

    def kill(_rows):
        raise Killed

    with pytest.raises(Killed):
        train(FitRun(lake, "driven", "parts", tests=("driven",), on_epoch=kill), CONFIG)
    continued = train(FitRun(lake, "driven", "parts", tests=("driven",)), CONFIG)
    stored, config = load(lake, "parts")
    assert config == CONFIG
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
    model = train(FitRun(lake, "driven", "longer"), config)
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
    times = config.dt * np.arange(-config.window.num_history + 1, 1)
    path = np.stack([7.0 * times, -2.0 * times], axis=-1)
    history = np.zeros((1, 2, config.window.num_history, 5))
    history[0, 0, :, :2], history[0, 0, :, 3:] = path, (7.0, -2.0)
    batch = {
        "history": torch.from_numpy(history),
        "history_valid": torch.ones((1, 2, config.window.num_history), dtype=bool),
    }
    ahead = config.dt * np.arange(1, config.window.num_future + 1)[:, None] * (7.0, -2.0)
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


def test_forecaster_is_scored_beside_those_that_learn_nothing(lake):
    train(FitRun(lake, "driven", "scored"), CONFIG)
    found = {each.name: each for each in score_forecaster(lake, "scored", "driven")}
    samples = CONFIG.samples(lake, "driven", is_training=False)
    mean, end = measure(constant_velocity(CONFIG), samples)
    constant = found["constant velocity"]
    assert constant.min_ade == pytest.approx(np.nanmean(mean)) and constant.min_fde == pytest.approx(np.nanmean(end))
    known = end[np.isfinite(end)]
    assert (constant.miss_rate, constant.targets) == (pytest.approx((known > 2.0).mean()), len(known))
    assert found["scored"].min_ade <= found["scored, most probable"].min_ade
    assert found["six constant velocities"].min_ade <= constant.min_ade  # it is one of the six
    assert [each.modes for each in found.values()] == [CONFIG.modes, 1, 1, 1, 6]


def test_score_of_a_forecaster_has_a_receipt(lake):
    train(FitRun(lake, "driven", "told"), CONFIG)
    ids = lake.database("driven").scenario_ids
    receipt = score_receipt(
        lake, "model", score_forecaster(lake, "told", "driven"), {"run": "told", "database": "driven"}, ids
    )
    assert len(receipt.rows) == 5 and verify_score(lake, Receipt.loads(receipt.dumps())).first is None
    rows = ({**receipt.rows[0], "min_ade": receipt.rows[0]["min_ade"] + 1e-9}, *receipt.rows[1:])
    assert str(verify_score(lake, replace(receipt, rows=rows)).first).startswith("told: min_ade is ")
    train(FitRun(lake, "driven", "shorter"), replace(CONFIG, epochs=1))
    with pytest.raises(BadParameter, match="shorter is not what was scored for this receipt"):
        verify_score(lake, replace(receipt, description={**receipt.description, "run": "shorter"}))


def test_fan_has_slower_and_turned_paths():
    history = torch.zeros((1, 1, 11, 5))
    history[0, 0, -1, 3] = 10.0
    ends = fan(ForecasterConfig(future=1.0))({"history": history})[0, :, -1]
    assert ends == pytest.approx(
        np.array([(10, 0), (8, 0), (12, 0), (5, 0), (9.848, 1.736), (9.848, -1.736)]), abs=1e-3
    )


def test_encoder_embeds_scenarios(lake):
    train(FitRun(lake, "driven", "encoder"), CONFIG)
    record = lake.embed("encoded", model="encoder")
    assert record.type.endswith("[32]") and record.count == len(lake)
    assert record.source.startswith("embedding by the encoder of run encoder ")
    again = lake.embed("encoded", model="encoder", replace=True)
    assert again.source == record.source
    opened = Lake(lake.root)
    first = opened.sql("SELECT scenario_id FROM metadata ORDER BY 1")["scenario_id"][0]
    assert len(opened.similar(first, 3, by="encoded")) == 3


def test_runs_that_cannot_be_loaded_are_sentences(lake, tmp_path):
    with pytest.raises(LakeError, match="nobody"):
        load(lake, "nobody")
    evaluation_runs.claim(lake.files, "driver", ("training",), {"algorithm": "ppo"})
    with pytest.raises(
        LakeError, match=r"run driver of .* is not of a forecaster; train one: scenarionet forecast fit"
    ):
        load(lake, "driver")
    evaluation_runs.claim(lake.files, "begun", ("training",), {"forecaster": {}})
    with pytest.raises(LakeError, match="has no checkpoint yet"):
        load(lake, "begun")
    train(FitRun(lake, "driven", "good"), CONFIG)
    arrays = dict(checkpoints.load(lake.files, "good").arrays)
    for name, described, changed, words in (
        ("wide", {"size": 64}, arrays, "a forecaster of another layout, size mismatch"),
        ("old", {"colour": "red"}, arrays, "a forecaster of another layout, .*unexpected keyword argument 'colour'"),
        (
            "nan",
            {},
            {**arrays, "model.queries": arrays["model.queries"] * np.nan},
            "not finite, for example model.queries",
        ),
    ):
        settings = evaluation_runs.describe(lake.files, "good")["forecaster"] | described
        evaluation_runs.claim(lake.files, name, ("training",), {"forecaster": settings})
        checkpoints.save(lake.files, name, checkpoints.Checkpoint(1, {}, changed))
        with pytest.raises(LakeError, match=words):
            load(lake, name)
    with pytest.raises(BadParameter, match="no model 'other' that embeds"):
        lake.embed("w", model="other")


def test_settings_are_checked():
    assert ForecasterConfig.parse({"epochs": "2", "rate": "0.01"}) == ForecasterConfig(epochs=2, rate=0.01)
    for given, words in (
        ({"colour": "red"}, "no setting 'colour'; it has size, epochs"),
        ({"epochs": "two"}, "epochs wants int, for example 8; found 'two'"),
        ({"stride": "-1"}, "stride: wanted a number above 0, found -1"),
        ({"size": "30"}, "size: wanted a multiple of heads, 4, found 30"),
    ):
        with pytest.raises(BadParameter, match=words):
            ForecasterConfig.parse(given)
