"""Verbs on a lake in a faulty object store: the results of a folder, although a fifth of the answers is lost."""

from __future__ import annotations

import json

import pytest
from click.testing import CliRunner

from scenarionet_data import ScenarioLoader
from scenarionet_data.testing import differences
from scenarionet_pipelines.cli import cli
from tests.fixtures.lakes import content, everything

pytestmark = pytest.mark.long

COUNTS = "SELECT object_type, count(*) AS n, sum(len(x)) AS states FROM tracks GROUP BY ALL ORDER BY ALL"
VERBS = {
    "convert": ["convert", "pg", "0:8", "LAKE", "--split", "train", "--workers", "2", "--quiet", "--json"],
    "sql": ["sql", "LAKE", COUNTS, "--json"],
    "filter": ["filter", "LAKE", "--where", "num_objects > 1", "--name", "busy"],
    "split": ["split", "LAKE", "busy", "--fractions", "train=0.5", "val=0.5"],
    "export": ["export", "LAKE", "busy_val", "OUT/pickles", "--quiet"],
    "pack": ["pack", "LAKE", "busy_val", "OUT/pack", "--quiet"],
    "check": ["maintain", "check", "LAKE", "busy"],
    "fsck": ["maintain", "fsck", "LAKE", "--deep", "--quiet"],
    "sim": ["sim", "LAKE", "busy", "--policy", "idm", "--backend", "kinematic", "--quiet", "--json"],
    "compact": ["maintain", "compact", "LAKE", "--profile", "analytics", "--quiet", "--json"],
    "vacuum": ["maintain", "vacuum", "LAKE", "--keep-last", "1", "--json"],
    "list": ["list", "LAKE", "--json"],
}
_DIFFERENT = ("seconds", "created_at", "lake", "workers", "scenarios_per_second", "steps_per_second")
"""Measured, or a place."""


def run(verb, lake, out):
    """Exit code and output of a verb, without what differs from run to run."""
    words = [word.replace("LAKE", str(lake)).replace("OUT", str(out)) for word in VERBS[verb]]
    result = CliRunner().invoke(cli, words)
    assert result.exit_code in (0, 1), result.output
    text = result.stdout.replace(str(lake), "LAKE").replace(str(out), "OUT")
    return result.exit_code, _comparable(json.loads(text)) if "--json" in words else text


def _comparable(value):
    if isinstance(value, dict):
        return {key: _comparable(inner) for key, inner in value.items() if key not in _DIFFERENT}
    return [_comparable(inner) for inner in value] if isinstance(value, list) else value


@pytest.mark.parametrize("fault", ["cut", "reset", "lost", "mixed"])
def test_every_verb_has_the_result_of_an_undisturbed_one(url, store, tmp_path, monkeypatch, fault):
    monkeypatch.setenv("SCENARIONET_PATIENCE", "60")
    local = tmp_path / "lake"
    undisturbed = {verb: run(verb, local, tmp_path / "local") for verb in VERBS}
    store.set(fault=fault, share=0.2, seed=1)
    for verb, expected in undisturbed.items():
        assert run(verb, url, tmp_path / "remote") == expected, verb
    faulty, whole = ScenarioLoader(url, "busy"), ScenarioLoader(local, "busy")
    assert [differences(a, b) for a, b in zip(faulty, whole, strict=True)] == [[]] * len(whole)
    assert len(store.requests()) > 100
    store.set()
    assert content(url) == content(local)
    assert everything(tmp_path / "remote/pickles") == everything(tmp_path / "local/pickles")
