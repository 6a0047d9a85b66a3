"""Names of CommonRoad's planners, where their packages are not installed."""

from __future__ import annotations

import sys

import pytest

from scenarionet_data.errors import BadParameter
from scenarionet_sim.bridges.commonroad import by_name
from scenarionet_sim.drivers.by_name import resolve_drivers
from scenarionet_sim.drivers.code import interpreter_of


def test_without_their_packages_there_is_a_way_out_in_a_sentence():
    with pytest.raises(BadParameter, match=r"needs commonroad-reactive-planner.*`make planners`.*SCENARIONET_PLANNERS"):
        resolve_drivers("commonroad:reactive")


def test_other_names_are_refused_with_those_that_there_are():
    with pytest.raises(BadParameter, match="choose from commonroad:reactive, commonroad:frenetix"):
        resolve_drivers("commonroad:reactve")


def test_the_interpreter_is_the_given_one_or_that_of_the_variable(monkeypatch: pytest.MonkeyPatch):
    monkeypatch.delenv(by_name.ENVIRONMENT, raising=False)
    assert by_name.environment_of("commonroad:frenetix") == sys.executable
    monkeypatch.setenv(by_name.ENVIRONMENT, "/env/bin/python")
    assert by_name.environment_of("commonroad:frenetix") == "/env/bin/python"
    assert by_name.environment_of("commonroad:frenetix", "/mine/python") == "/mine/python"
    assert by_name.environment_of("lane-graph") == interpreter_of("commonroad:frenetix") == ""
