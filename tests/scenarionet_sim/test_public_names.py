"""The public names of ``scenarionet_sim``: complete, lazy, and registered with Gymnasium."""

from __future__ import annotations

import subprocess
import sys

import gymnasium
import pytest

import scenarionet_sim


def test_every_public_name_can_be_imported():
    assert dir(scenarionet_sim) == sorted(scenarionet_sim.__all__)
    assert "Idm" in scenarionet_sim.__all__ and len(scenarionet_sim.__all__) > 60
    for name in scenarionet_sim.__all__:
        assert getattr(scenarionet_sim, name) is not None


def test_unknown_name_is_an_attribute_error():
    with pytest.raises(AttributeError, match=r"has no 'Enviroment'; it has .*EnvConfig"):
        scenarionet_sim.Enviroment  # noqa: B018


def test_importing_registers_the_environment_and_little_else():
    code = "import scenarionet_sim, sys; print([m for m in ('numba', 'duckdb', 'polars') if m in sys.modules])"
    assert subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True).stdout == "[]\n"
    assert "ScenarioNet-v0" in gymnasium.registry


def test_configuration_has_a_one_line_repr():
    config = scenarionet_sim.EnvConfig(scenarionet_sim.Scenarios("lake", "busy"))
    assert "busy" in repr(config) and "Lidar" in repr(config) and "\n" not in repr(config)
