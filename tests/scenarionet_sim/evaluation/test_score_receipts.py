"""Scores and comparisons computed again from receipts: in another lake, by other workers, with a changed digit."""

from __future__ import annotations

import json
import shutil
from dataclasses import replace
from pathlib import Path

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
import pytest

from scenarionet_data import Lake
from scenarionet_data.errors import BadParameter
from scenarionet_data.forecasts import score
from scenarionet_data.scenario.description import make_scenario_id, strings
from scenarionet_data.schema import tables
from scenarionet_sim.evaluation.comparison import JUDGED_BY, compare_runs
from scenarionet_sim.evaluation.evaluation import evaluate
from scenarionet_sim.evaluation.receipts import Receipt
from scenarionet_sim.evaluation.score_receipts import score_receipt, verify_score
from scenarionet_sim.metrics.wosac import log_rollouts, score_submission, write_submission
from tests.fixtures.drives import Other, make_drive
from tests.fixtures.lakes import write_lake

pytestmark = pytest.mark.integration


def waymo(name: str, gap: float):
    made = make_drive(name, num_steps=91, others=(Other(gap, vx=5.0),))
    tracks, key = replace(made.tracks, ids=strings(["12", "7"])), make_scenario_id("waymo", "v1", name)
    return replace(made, id=key, dataset="waymo", tracks=tracks, ego_id="12", current_timestep=10)


SCENARIOS = [waymo(f"d{k}", 20.0 + 5.0 * k) for k in range(3)]


def predictions(path: Path) -> Path:
    """The recorded future of each ego, and one that is 3 m to the left."""
    rows = []
    for scenario in SCENARIOS:
        way = scenario.tracks.position[0, 11:41, :2].astype(np.float32)
        for mode, (left, probability) in enumerate(((0.0, 0.4), (3.0, 0.6))):
            names = {"scenario_id": scenario.id, "track_id": "12", "timestep": 10, "dt": 0.1, "mode": mode}
            rows.append(names | {"probability": probability, "x": way[:, 0].tolist(), "y": (way[:, 1] + left).tolist()})
    pq.write_table(pa.Table.from_pylist(rows, schema=tables.load("predictions").schema), path)
    return path


@pytest.fixture(scope="module")
def lake(tmp_path_factory) -> Lake:
    made = write_lake(tmp_path_factory.mktemp("score_receipts") / "lake", SCENARIOS)
    for policy in ("constant", "replay"):
        evaluate(made, policy=policy, name=policy)
    return made


@pytest.fixture(scope="module")
def other(tmp_path_factory) -> Lake:
    """A lake with the same scenarios in another order, one more, and no runs."""
    return write_lake(tmp_path_factory.mktemp("other") / "lake", [waymo("more", 9.0), *reversed(SCENARIOS)])


@pytest.fixture(scope="module")
def receipts(lake, tmp_path_factory) -> dict[str, Receipt]:
    folder, asked = tmp_path_factory.mktemp("scored"), {"where": "true", "by": None, "event": None}
    guessed, rollouts = predictions(folder / "guessed.parquet"), folder / "log.binproto"
    write_submission(rollouts, [log_rollouts(scenario, 4) for scenario in SCENARIOS])
    settings = {"configuration": "sim-agents-2025", "official": True}
    submission, runs = score_submission(str(lake.root), rollouts, **settings), ["constant", "replay"]
    compared = compare_runs(lake, *runs, **asked, judged_by=JUDGED_BY)
    made = (
        score_receipt(lake, "predictions", score(lake, guessed), {"file": str(guessed)}),
        score_receipt(lake, "submission", submission, {"file": str(rollouts), **settings}),
        score_receipt(lake, "comparison", compared, {"runs": runs, **asked, "judged_by": JUDGED_BY}),
    )
    return {each.kind: Receipt.loads(each.dumps()) for each in made}


KINDS = ("predictions", "submission", "comparison")


@pytest.mark.parametrize("kind", KINDS)
def test_it_comes_out_again_elsewhere_by_more_workers(receipts, other, kind):
    receipt = receipts[kind]
    assert [name for name, _ in receipt.scenarios] == [scenario.id for scenario in SCENARIOS]
    assert len(receipt.rows) >= 3 and receipt.description["software"] and receipt.description["snapshot"] >= 0
    found = verify_score(other, receipt, workers=2)
    assert (found.rows, found.differing, found.first, found.notes) == (len(receipt.rows), 0, None, ())


@pytest.mark.parametrize(
    ("kind", "column", "row"),
    [
        ("predictions", "min_ade", "waymo/v1/d1, 12, 10, VEHICLE"),
        ("submission", "submitted likelihoods linear_speed", "waymo/v1/d1"),
        ("comparison", "means 1", "all, out_of_road"),
    ],
)
def test_a_changed_digit_is_found(receipts, lake, kind, column, row):
    told = json.loads(receipts[kind].dumps())
    told["rows"][1][column] += 1e-9
    found = verify_score(lake, Receipt.loads(json.dumps(told)))
    assert found.first is not None and found.differing == 1
    assert str(found.first).startswith(f"{row}: {column} is ")
    told["rows"] = receipts[kind].rows[1:]
    assert verify_score(lake, Receipt.loads(json.dumps(told))).differing > 0, "a row is missing"


def test_a_changed_digit_of_a_run_in_a_comparison_is_found(receipts, other):
    told = json.loads(receipts["comparison"].dumps())
    told["runs"][1]["rows"][2]["mean_speed"] += 1e-6
    found = verify_score(other, Receipt.loads(json.dumps(told)))
    assert str(found.first).startswith("replay: waymo/v1/d2, rollout 0: mean_speed is ")


def test_what_was_scored_is_looked_for_beside_the_receipt(receipts, lake, tmp_path):
    receipt = receipts["predictions"]
    moved = replace(receipt, description={**receipt.description, "file": "/nowhere/guessed.parquet"})
    with pytest.raises(BadParameter, match=r"what was scored, /nowhere/guessed.parquet, is not there and not in "):
        verify_score(lake, moved, tmp_path)
    shutil.copy(receipt.description["file"], tmp_path)
    assert verify_score(lake, moved, tmp_path).first is None
    with (tmp_path / "guessed.parquet").open("ab") as file:
        file.write(b" ")
    with pytest.raises(BadParameter, match=r"is not what was scored for this receipt: its digest is "):
        verify_score(lake, moved, tmp_path)


def test_other_scenarios_are_refused(receipts, tmp_path):
    few = write_lake(tmp_path / "few", SCENARIOS[:2])
    for receipt in receipts.values():
        with pytest.raises(BadParameter, match="lacks 1 of 3 scenarios"):
            verify_score(few, receipt)
