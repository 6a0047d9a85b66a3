"""Safety models against esmini's controllers, whose answers are in a file, or live with SCENARIONET_ESMINI."""

from __future__ import annotations

import json
import os
from dataclasses import replace
from pathlib import Path

import pytest

from scenarionet_data import Lake, convert
from scenarionet_data.logical import move, read_logical
from scenarionet_sim import evaluate
from scenarionet_sim.planners import safety_models
from scenarionet_sim.planners.safety_models import covers, lateral_distance, longitudinal_distance
from tests.fixtures.safety import DT, drive, play

ANSWERS = json.loads((Path(__file__).parents[2] / "fixtures" / "esmini_r157.json").read_text("utf-8"))
NUMBER = 12


@pytest.fixture(scope="module")
def motions():
    cases = {name: replace(read_logical(name), dt=DT) for name in ("cut_in", "cut_out", "deceleration")}
    return {name: move(logical, logical.draw(NUMBER, 7)) for name, logical in cases.items()}


@pytest.mark.parametrize("model", ["CarefulHuman", "FuzzySafety", "Rss"])
def test_models_brake_when_and_touch_where_esmini_does(motions, model):
    late = []
    for name, of_name in motions.items():
        for row in range(NUMBER):
            braked, touches = drive(getattr(safety_models, model)(), of_name, row)
            wanted, wanted_touches, hardest = ANSWERS[f"{name}/{row}/{model}"]
            assert (braked is None) == (wanted is None), (name, row)
            late.append(0.0 if braked is None else abs(braked - wanted))
            if model != "Rss" or hardest < 7.7:  # esmini's RSS does not limit its deceleration
                assert touches == wanted_touches, (name, row)
    assert len(late) == 36 and max(late) < 0.125 and sum(each > 0.105 for each in late) <= 2


@pytest.mark.skipif("SCENARIONET_ESMINI" not in os.environ, reason="set SCENARIONET_ESMINI to the player esmini")
def test_the_answers_are_those_of_esmini(motions, tmp_path):
    for key in list(ANSWERS)[::12]:
        name, row, model = key.split("/")
        braked, touches, hardest = play(
            Path(os.environ["SCENARIONET_ESMINI"]), model, motions[name], int(row), tmp_path
        )
        assert [None if braked is None else round(braked, 2), touches, round(hardest, 2)] == ANSWERS[key]


def test_distances_of_rss_are_those_computed_by_hand():
    # 20 m/s, 0.5 s at 2 m/s^2: 10.25 m, then 21 m/s braked by 4 m/s^2: 55.125 m; ahead 15 m/s by 8 m/s^2: 14.0625 m.
    assert longitudinal_distance(20.0, 15.0, 0.5, 2.0, 4.0, 8.0) == pytest.approx(10.25 + 55.125 - 14.0625)
    assert longitudinal_distance(5.0, 30.0, 0.5, 2.0, 4.0, 8.0) == 0.0
    # 1 m/s, 0.75 s at 1 m/s^2: 1.03125 m, then 1.75 m/s braked by 1 m/s^2: 1.53125 m.
    assert lateral_distance(1.0, 0.75, 1.0, 0.3) == pytest.approx(0.3 + 1.03125 + 1.53125)


def test_what_is_fully_ahead():
    assert covers(0.05, 0.9, 0.9) and covers(0.0, 2.0, 0.9) and covers(0.4, 0.3, 0.9)
    assert not covers(0.5, 0.9, 0.9) and not covers(-3.5, 0.9, 0.9)


@pytest.mark.integration
def test_a_careful_human_avoids_in_simulation_what_it_avoids_in_the_model(tmp_path):
    convert("logical", "deceleration", tmp_path / "lake", options={"number": 6, "seed": 7})
    for name in ("careful-human", "rss", "constant-planner"):
        evaluate(tmp_path / "lake", policy=name, name=name, tracker="perfect", rollouts=False)

    # The vehicle ahead stands still from the end of the recording on, after 10 s.
    query = "SELECT run, sum(coalesce(first_collision <= 10, false)::INTEGER)::INTEGER FROM results GROUP BY run"
    crashes = dict(Lake(tmp_path / "lake").sql(query).rows())
    assert crashes["careful-human"] == crashes["rss"] == 0 < crashes["constant-planner"]
