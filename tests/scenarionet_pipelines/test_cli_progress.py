"""The progress of a task: what it is doing while nothing is finished yet."""

from __future__ import annotations

import pytest

from scenarionet_data.compiled import announcing
from scenarionet_pipelines.cli.progress import ProgressDisplay


@pytest.fixture(autouse=True)
def nothing_announced(monkeypatch):
    monkeypatch.setattr(announcing, "_announced", set())


def test_compilation_is_not_called_listing(capsys):
    with ProgressDisplay("sim") as progress:
        assert progress.line.startswith("sim: listing the work to do, for ")
        announcing.announce("scenarionet_sim.simulation.step")
        assert progress.line.startswith(
            "sim: compiling loops for the simulator, once per installation (about 8 s), for "
        )
        progress.update(1, 4)
        assert progress.line.startswith("sim: 1 of 4 scenarios after ")
    assert capsys.readouterr().err == "Compiling loops for the simulator, once per installation (about 8 s)\n"


def test_quiet_display_announces_nothing(capsys):
    with ProgressDisplay("sim", is_quiet=True):
        announcing.announce("scenarionet_sim.simulation.step")
    assert capsys.readouterr().err == ""


def test_no_time_is_left_where_more_was_done_than_asked_for():
    with ProgressDisplay("train", "step", is_quiet=True) as progress:
        progress._started -= 40.0
        progress.update(20_480, 20_000)
        assert progress.line.endswith("about 0.0 s left")
