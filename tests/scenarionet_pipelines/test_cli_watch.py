"""``convert --watch``, and the confirmation of ``--reconvert-stale``."""

from __future__ import annotations

import json
import re
import signal

import pytest
from click.testing import CliRunner

from scenarionet_data import Lake
from scenarionet_data.errors import BadParameter
from scenarionet_pipelines.cli import cli
from scenarionet_pipelines.cli.parameters import seconds
from tests.fixtures.made import NAME, NEWER, write_raw
from tests.fixtures.waiting import HANGS_AFTER, until
from tests.scenarionet_pipelines.conftest import run
from tests.scenarionet_pipelines.test_cli_convert import start

pytestmark = pytest.mark.integration


@pytest.mark.long
@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
def test_watching_ends_cleanly(number, tmp_path):
    raw, lake = tmp_path / "raw", tmp_path / "lake"
    raw.mkdir()
    log = tmp_path / "reports"
    with log.open("w") as output:
        watching = ("--watch", "--every", "0.2s", "--json")
        running = start("convert", NAME, raw, lake, "--workers", 1, *watching, stdout=output)
    write_raw(raw, {"a": [1, 2]})
    until(lambda: log.read_text().count("\n}\n") == 1, "the first shard is reported")
    write_raw(raw, {"b": [3]})
    until(lambda: log.read_text().count("\n}\n") == 2, "the second shard is reported")
    running.send_signal(number)
    _, errors = running.communicate(timeout=HANGS_AFTER)
    reported = log.read_text()
    is_killed = number == signal.SIGTERM
    assert running.returncode == (143 if is_killed else 0)
    assert errors.splitlines() == [
        f"watching {raw} every 0.2 s; stop with Ctrl-C",
        "terminated: " * is_killed + f"stopped watching {raw}; finished shards are kept in {lake}",
    ]
    reports = [json.loads(text) for text in re.split(r"(?<=^})\n", reported, flags=re.MULTILINE) if text]
    assert [report["converted"] for report in reports] == [2, 1]
    assert len(Lake(lake)) == 3


@pytest.mark.long
def test_reconvert_stale_lists_the_shards_first(raw, lake):
    refused = run("convert", NEWER, raw, lake, "--reconvert-stale")
    assert refused.exit_code == 2
    assert "would convert again 2 shards written by another version of the converter:" in refused.stderr
    assert "  made/v1/train/a\n  made/v1/train/b\n" in refused.stderr
    assert "cannot ask for confirmation: add --yes, or leave out --reconvert-stale" in refused.stderr
    assert "2 shards written by another version of the converter" in run("convert", NEWER, raw, lake).stdout
    report = json.loads(run("convert", NEWER, raw, lake, "--reconvert-stale", "--yes", "--json", "--quiet").stdout)
    assert (report["replaced"], report["stale"]) == (2, 0)
    assert run("convert", NEWER, raw, lake, "--reconvert-stale").exit_code == 0  # nothing left to confirm


@pytest.mark.parametrize(("answer", "replaced"), [("y", True), ("n", False)])
def test_reconvert_stale_asks_for_confirmation(raw, lake, monkeypatch, answer, replaced):
    monkeypatch.setattr("scenarionet_pipelines.cli.verbs.convert.is_interactive", lambda: True)
    before = Lake(lake).snapshot.number
    asked = CliRunner().invoke(
        cli, ["convert", NEWER, str(raw), str(lake), "--workers", "1", "--reconvert-stale"], input=f"{answer}\n"
    )
    assert "continue? [y/N]" in asked.stderr
    assert (Lake(lake).snapshot.number > before) == replaced


def test_limit_excludes_cluster_and_watch(tmp_path):
    for words in (("--cluster", "local"), ("--watch",)):
        result = run("convert", NAME, tmp_path, tmp_path / "lake", "--limit", 1, *words)
        assert result.exit_code == 2
        assert "--limit converts one shard at a time" in result.stderr


def test_durations():
    expected = {"30s": 30.0, "1.5 min": 90.0, "2h": 7200.0, "1.5d": 129_600.0, "2w": 1_209_600.0}
    assert {text: seconds(text, "--every") for text in expected} == expected
    for text in ("", "0s", "soon", "7", "5y", "-3s"):
        with pytest.raises(BadParameter, match="--every expects a duration such as 30s"):
            seconds(text, "--every")
