"""Runs computed again: in their lake, in another lake from a receipt, and with a changed digit."""

from __future__ import annotations

import json
from dataclasses import replace

import pytest

from scenarionet_data import Lake
from scenarionet_data.errors import BadParameter
from scenarionet_sim.evaluation.evaluation import evaluate
from scenarionet_sim.evaluation.receipts import Receipt, make_receipt, verify
from tests.fixtures.drives import Other, make_drive
from tests.fixtures.lakes import write_lake

pytestmark = pytest.mark.integration

SCENARIOS = [make_drive(f"d{k}", speed=8.0 + k, others=(Other(15.0 + 5 * k, vx=4.0),)) for k in range(5)]
LATER = make_drive("later", speed=9.0)


@pytest.fixture(scope="module")
def lake(tmp_path_factory) -> Lake:
    made = write_lake(tmp_path_factory.mktemp("receipts") / "lake", SCENARIOS)
    evaluate(made, policy="constant-noisy", name="noisy", num_rollouts=3, seed=7)
    return made


@pytest.fixture
def receipt(lake) -> Receipt:
    return make_receipt(lake, "noisy")


def test_a_run_comes_out_again(lake, monkeypatch):
    found = verify(lake, "noisy")
    assert (found.rows, found.differing, found.first, found.notes) == (15, 0, None, ())


def test_parts_and_workers_do_not_matter(lake, receipt, monkeypatch):
    monkeypatch.setattr("scenarionet_sim.evaluation.specification.PART_SIZE", 4)
    parts_of_four = replace(receipt, description={**receipt.description, "part": 4})
    assert verify(lake, parts_of_four, workers=2).first is None


def test_a_receipt_is_verified_in_another_lake(receipt, tmp_path):
    other = write_lake(tmp_path / "other", [LATER, *reversed(SCENARIOS)])
    read = Receipt.loads(receipt.dumps())
    assert read == receipt
    assert verify(other, read).first is None


@pytest.mark.parametrize("column", ["route_completion", "success", "status", "trajectory", "mean_speed"])
def test_a_changed_digit_is_found(lake, receipt, column):
    told = json.loads(receipt.dumps())
    row = told["rows"][7]
    was = row[column]
    row[column] = {float: lambda: was + 1e-6, bool: lambda: not was, str: lambda: was[:-1] + "x"}[type(was)]()
    found = verify(lake, Receipt.loads(json.dumps(told)))
    assert found.differing == 1 and found.first is not None
    assert (found.first.scenario_id, found.first.rollout, found.first.column) == (row["scenario_id"], 1, column)
    assert str(found.first) == f"made/v1/d2, rollout 1: {column} is {was!r}, the receipt has {row[column]!r}"
    assert dict(found.largest) == ({column: pytest.approx(1e-6)} if type(was) is float else {
        column: 1} if type(was) is bool else {})  # fmt: skip


def test_another_seed_gives_another_run(lake, receipt):
    found = verify(lake, replace(receipt, description={**receipt.description, "seed": 8}))
    assert found.differing == 15


def test_a_row_that_was_left_out_is_found(lake, receipt):
    found = verify(lake, replace(receipt, rows=receipt.rows[:4] + receipt.rows[5:]))
    assert found.first is not None and (found.first.column, found.first.stored) == ("row", None)


def test_other_scenarios_are_refused(receipt, tmp_path):
    few = write_lake(tmp_path / "few", SCENARIOS[:3])
    with pytest.raises(BadParameter, match=r"lacks 2 of 5 scenarios of the run, for example made/v1/d3, made/v1/d4;"):
        verify(few, receipt)
    other = write_lake(tmp_path / "other", [*SCENARIOS[:4], make_drive("d4", speed=3.0)])
    with pytest.raises(BadParameter, match=r"1 of 5 scenarios have another content in .*for example made/v1/d4;"):
        verify(other, receipt)


def test_what_is_no_receipt_is_refused(lake, receipt):
    with pytest.raises(BadParameter, match="no run 'none'; it has noisy"):
        make_receipt(lake, "none")
    for text in ("{", "[]", '{"format": 1}', receipt.dumps().replace('"made/v1/d1"', '"made/v1/x"', 1)):
        with pytest.raises(BadParameter, match="no receipt of a run"):
            Receipt.loads(text)
    with pytest.raises(BadParameter, match="format 2, not 1; update"):
        Receipt.loads(receipt.dumps().replace('"format": 1', '"format": 2'))
    old = replace(receipt, description={**receipt.description, "rule": "older"})
    with pytest.raises(BadParameter, match="made with rule 'older', this version has"):
        verify(lake, old)
