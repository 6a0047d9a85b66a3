"""Experiments: verdicts are computed from curves; the page has tables, figures and the commit."""

from __future__ import annotations

import json
from dataclasses import replace

import numpy as np
import polars as pl
import pytest

from scenarionet_data import Lake
from scenarionet_data.errors import BadParameter
from scenarionet_data.storage import evaluation_runs
from scenarionet_data.storage.files.places import open_files
from scenarionet_sim.learning.config import make_learner_config
from scenarionet_sim.learning.experiments import comparison as comparisons
from scenarionet_sim.learning.experiments.comparison import (
    Claim,
    Comparison,
    PublishedFigure,
    TrainingArm,
    judge,
    read_comparison,
)
from scenarionet_sim.learning.experiments.cross_dataset import cross_dataset
from scenarionet_sim.learning.experiments.multi_agent import multi_agent
from scenarionet_sim.learning.experiments.page import write_page
from scenarionet_sim.learning.experiments.statistics import has_flattened, holm, verdict


@pytest.mark.parametrize(
    ("differences", "are_flat", "expected"),
    [
        ([0.2, 0.3, 0.1, 0.25, 0.2], True, "supported"),
        ([-0.2, -0.3, -0.1, -0.25, -0.2], True, "not supported"),
        ([0.2, -0.3, 0.1, -0.25, 0.2], True, "inconclusive"),
        ([0.2, 0.3, 0.1, 0.25, 0.2], False, "inconclusive"),
    ],
)
def test_verdicts(differences, are_flat, expected):
    assert verdict(differences, are_flat=are_flat)[0] == expected


def test_several_claims_have_wider_intervals():
    differences = [0.2, 0.3, 0.1, 0.25, 0.02]
    assert verdict(differences, are_flat=True)[0] == "supported"
    assert verdict(differences, are_flat=True, claims=5)[0] == "inconclusive"


def test_the_clearest_claim_is_judged_most_severely():
    """Of three: two clear ones, and one whose interval has 0 at 5 %/1, which gets no wider by the others."""
    clear, clearer, none = [0.2, 0.3, 0.1, 0.25, 0.2], [0.2, 0.21, 0.2, 0.19, 0.2], [0.1, -0.1, 0.2, -0.2, 0.0]
    assert holm([clear, none, clearer]) == [2, 1, 3]
    assert holm([none, none, none]) == [3, 3, 3]
    assert holm([[0.0] * 5, [0.1] * 5]) == [1, 2]


def test_curves_flatten():
    assert has_flattened([[0.1, 0.5, 0.8, 0.82]])
    assert not has_flattened([[0.1, 0.3, 0.5, 0.7]])
    assert not has_flattened([[0.8, 0.8]])  # too few checkpoints to tell


@pytest.mark.parametrize("size", ["small", "paper"])
def test_experiments_are_as_the_paper(size):
    single, multi = cross_dataset(size, "recorded"), multi_agent(size)
    assert len(single.arms) == 6 and "recorded" in single.tests and len(multi.arms) == 7
    assert len(single.seeds) == (10 if size == "small" else 5) and len(multi.seeds) == 5
    own = {seed: single.tests_of(seed) for seed in single.seeds}
    assert [*own[3].values()] == [*single.tests] and "recorded" in own[3]
    assert len(own[3].keys() & own[4].keys()) == (
        1 if size == "small" else 3
    )  # but recorded ones, of each seed its own
    for comparison in (single, multi):
        names = {arm.name for arm in comparison.arms}
        assert {name for claim in comparison.claims for name in (claim.better, claim.worse)} <= names
        for each in comparison.published:
            assert each.arm in names and each.test in comparison.tests and each.metric in comparison.metrics
        runs = [comparison.run_name(arm, seed) for arm in comparison.arms for seed in comparison.seeds]
        assert len(set(runs)) == len(runs) and all(evaluation_runs._NAME.fullmatch(run) for run in runs)
    if size == "paper":
        steps = {arm.name: arm.config.steps for arm in single.arms}
        assert all(count == (80_000_000 if "both" in name else 20_000_000) for name, count in steps.items())
    if size == "small":  # a stand-in is never called recorded
        assert "stand-in" in next(iter(single.tests.values()))


@pytest.fixture
def finished(drives, tmp_path):
    """A lake with the runs of an experiment of two arms: the first is better at every checkpoint but the last."""
    import shutil

    lake, config = Lake(shutil.copytree(drives, tmp_path / "lake")), make_learner_config("ppo", "small")
    lake.filter("true", name="val")
    lake.filter("true", name="test")
    arms = tuple(TrainingArm(name, "ppo", config, "val", "val") for name in ("good", "bad"))
    claims = Claim("Good is better", "good", "bad", "test"), Claim("Bad is better", "bad", "good", "test")
    made = Comparison(
        "made", "small", arms, (0, 1, 2), {"test": "the test"}, claims, sources={"all": "val"},
        published=(PublishedFigure("good", "test", "success", 0.5, "Table 9"),),
        published_sources={"PG": {"distance": 226.0}}, shared=("test",),
    )  # fmt: skip
    files = open_files(lake.root)
    for arm, level in (("good", 0.9), ("bad", 0.5)):
        for seed in made.seeds:
            name = f"made-small-{arm}-seed{seed}"
            run = evaluation_runs.claim(files, name, ("training",), {"config": {}})
            numbers = dict.fromkeys({*made.metrics, "speed"} - {"speed_ratio"}, 0.1)
            rows = [
                {"test": test, "round": k, "steps": 100 * k, "episodes": 9, **numbers, "success": success}
                for k in range(1, 9)
                for test, success in (("val@1", 0.1 * (k == 7)), ("test@1", level + 0.01 * seed - 0.2 * (k == 8) * 0.1))
            ]
            run.publish(1, {"training": [*rows, {"round": 1, "steps": 100, "episodes": 0, "learned": json.dumps({})}]})
    return lake, made


def test_tests_count_at_the_checkpoint_of_the_best_validation(finished):
    lake, made = finished
    found = read_comparison(lake, made)
    assert set(found.chosen["round"]) == {7}
    assert [judge(found, claim)[0] for claim in made.claims] == ["supported", "not supported"]
    _, interval, why = judge(found, made.claims[0])
    assert interval.mean == pytest.approx(0.4, abs=1e-6) and why == "all curves have flattened"


@pytest.mark.parametrize(("last", "expected"), [(1.3, "supported"), (1.0, "inconclusive")])
def test_a_discriminator_that_still_learns_decides_nothing(finished, last, expected):
    """Its loss is 1.3 up to the last quarter of the rounds."""
    lake, made = finished
    found = read_comparison(lake, made)
    loss = pl.when(pl.col("round") > 6).then(last).otherwise(1.3)
    learned = pl.lit('{"discriminator_loss": ') + loss.cast(pl.String) + pl.lit("}")
    tested = found.curves.filter(pl.col("test") == "test")
    trained = tested.with_columns(pl.lit(None).alias("test"), pl.lit(None).alias("database"), learned.alias("learned"))
    curves = pl.concat([found.curves, trained], how="vertical_relaxed")
    said, _, why = judge(replace(found, curves=curves), made.claims[0])
    assert said == expected and (expected == "supported" or "good's discriminator" in why)


def test_a_test_that_all_arms_pass_cannot_tell_them_apart(finished, monkeypatch):
    lake, made = finished
    found = read_comparison(lake, made)
    assert judge(found, made.claims[0])[0] == "supported"
    monkeypatch.setattr(comparisons, "CEILING", 0.5)
    said, _, why = judge(found, made.claims[0])
    assert said == "inconclusive" and why.startswith("both succeed in 50% or more")


def test_the_page_has_tables_verdicts_and_the_commit(finished, tmp_path):
    pytest.importorskip("matplotlib")
    lake, made = finished
    text = write_page(lake, made, tmp_path / "out", "abc1234").read_text("utf-8")
    assert "commit `abc1234`" in text and "| Good is better | **supported** |" in text
    assert "| good | 0.910 [0.885, 0.935] |" in text and "| all | 6 |" in text
    assert "| good | success | Table 9 | 0.500 | 0.910 [0.885, 0.935] |" in text
    assert "| the paper: PG |  |  |  | 226 |" in text
    assert {path.name for path in (tmp_path / "out").iterdir()} == {
        "page.md", "test.svg", "curves.parquet", "chosen.parquet",
    }  # fmt: skip


def test_a_missing_run_is_named(finished):
    lake, made = finished
    with pytest.raises(BadParameter, match="made: no tests of run made-small-bad-seed3; run the experiment to its end"):
        read_comparison(lake, replace(made, seeds=(0, 1, 2, 3)))


def test_flatness_uses_all_seeds():
    curves = np.array([[0.0, 0.5, 0.5, 0.9], [0.0, 0.5, 0.9, 0.5]])
    assert has_flattened(curves)
