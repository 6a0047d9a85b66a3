"""``scenarionet runs experiment --cluster local`` trains seeds side by side and writes the page."""

from __future__ import annotations

from dataclasses import replace

import pytest
from click.testing import CliRunner

from scenarionet_data import Lake
from scenarionet_pipelines.cli import cli
from scenarionet_sim.learning.experiments import cross_dataset, multi_agent

pytestmark = [pytest.mark.learn, pytest.mark.integration]
pytest.importorskip("torch", reason="no torch: run `make test-learn`")
pytest.importorskip("distributed", reason="the extra `cluster` is not installed")


def test_seeds_train_on_a_local_cluster(tmp_path, monkeypatch):
    """With a few scenarios and steps, which say nothing about the drivers."""
    monkeypatch.setattr(cross_dataset, "SMALL_TRAIN", 8)
    monkeypatch.setattr(cross_dataset, "SMALL_TEST", 4)
    tiny = {"steps": 400, "worlds": 2, "seats": 8, "hidden": (16, 16), "minibatch": 64}
    monkeypatch.setattr(multi_agent, "SMALL", tiny)
    monkeypatch.setattr(multi_agent, "EVERY", 50)
    whole = multi_agent.multi_agent

    def without_imitation(*given):
        made = whole(*given)
        arms = tuple(arm for arm in made.arms if arm.name in ("ippo", "td3"))
        published = tuple(each for each in made.published if each.arm in ("ippo", "td3"))
        return replace(made, arms=arms, published=published, claims=made.claims[:1], seeds=(0, 1))

    monkeypatch.setattr(multi_agent, "multi_agent", without_imitation)
    words = [
        "runs",
        "experiment",
        "multi-agent",
        str(tmp_path / "lake"),
        "-o",
        str(tmp_path / "out"),
        "--cluster",
        "local",
    ]
    done = CliRunner().invoke(cli, [*words, "--workers", "2", "--quiet"], catch_exceptions=False)
    assert done.exit_code == 0, done.output
    runs = Lake(tmp_path / "lake").sql("SELECT DISTINCT run FROM training WHERE test IS NOT NULL")
    assert len(runs) == 4
    assert "| td3 |" in (tmp_path / "out" / "page.md").read_text("utf-8")
