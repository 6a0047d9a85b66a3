"""``scenarionet forecast score`` with predictions, and ``scenarionet forecast submit``."""

from __future__ import annotations

import json

import numpy as np
import pyarrow.parquet as pq
import pytest
from click.testing import CliRunner

from scenarionet_data import Samples, Targets, TimeWindow
from scenarionet_data.forecasts import make_predictions, write_predictions
from scenarionet_pipelines.cli import cli
from tests.fixtures.lakes import write_lake
from tests.fixtures.scenarios import make_scenario

pytestmark = pytest.mark.integration


@pytest.fixture(scope="module")
def lake(tmp_path_factory):
    lake = write_lake(tmp_path_factory.mktemp("cli") / "lake", [make_scenario(0, num_objects=3, num_steps=72)])
    samples = Samples(lake, window=TimeWindow(history=1.0, future=6.0), targets=Targets("ego"))
    batch = samples.batch([0])
    rows = make_predictions([samples.key(0)], batch["future"][:, :1, :, :2], np.ones((1, 1)), batch["pose"], 0.1)
    write_predictions(lake.root / "predictions.parquet", [rows])
    return lake.root


def run(*words):
    return CliRunner().invoke(cli, [str(word) for word in words], catch_exceptions=False)


def test_scores_are_printed_and_written(lake, tmp_path):
    done = run(
        "forecast", "score", lake, lake / "predictions.parquet", "--by", "dataset", "-o", tmp_path / "scores.parquet"
    )
    assert done.exit_code == 0 and "waymo_min_fde_5s" in done.output and "made" in done.output
    assert pq.read_table(tmp_path / "scores.parquet")["track_id"].to_pylist() == ["t0"]
    found = json.loads(run("forecast", "score", lake, lake / "predictions.parquet", "--json").stdout)
    assert found["by"][0]["targets"] == 1 and found["by"][0]["min_fde"] < 1e-3 and found["findings"] == {}
    assert {each["seconds"] for each in found["precision"]} == {3, 5}


def test_scores_have_a_receipt(lake, tmp_path):
    receipt = tmp_path / "score.json"
    assert run("forecast", "score", lake, lake / "predictions.parquet", "--receipt", receipt).exit_code == 0
    done = run("runs", "verify", lake, receipt, "--workers", "1")
    assert done.exit_code == 0
    assert done.stdout == "predictions.parquet: all values of 5 rows are equal, bit by bit\n"
    told = json.loads(receipt.read_text())
    told["rows"][0]["min_fde"] += 1e-9
    receipt.write_text(json.dumps(told))
    done = run("runs", "verify", lake, receipt, "--workers", "1")
    assert done.exit_code == 1 and "min_fde is " in done.stdout


def test_a_submission_is_written(lake, tmp_path):
    done = run(
        "forecast", "submit", lake, lake / "predictions.parquet", tmp_path / "out.parquet", "--format", "argoverse2"
    )
    assert done.exit_code == 0 and done.output == f"wrote 1 target to {tmp_path / 'out.parquet'}\n"
    assert pq.read_table(tmp_path / "out.parquet").num_rows == 1


@pytest.mark.parametrize(
    ("words", "message"),
    [
        (("score", "lake"), "give one of PREDICTIONS, --model, --rollouts and --run"),
        (("score", "lake", "--run", "r", "--receipt", "r.json"), "--receipt of --run needs -o"),
        (("submit", "lake", "p", "out", "--format", "waymo", "--method", "m"), "needs --account, --num-parameters"),
    ],
)
def test_wrong_options_are_usage_errors(words, message):
    done = run(*words)
    assert done.exit_code == 2 and message in done.output
