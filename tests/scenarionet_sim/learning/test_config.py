"""Settings: parsed, checked and read back; without torch."""

from __future__ import annotations

import json
import subprocess
import sys

import pytest

from scenarionet_data.errors import BadParameter
from scenarionet_sim.learning.config import ALGORITHMS, CopoConfig, describe_config, make_learner_config


@pytest.mark.parametrize("algorithm", ALGORITHMS)
@pytest.mark.parametrize("size", ["paper", "small"])
def test_settings_survive_json(algorithm, size):
    config = make_learner_config(algorithm, size, {"steps": "20_000", "hidden": "64,32", "rate": "1e-3"})
    assert (config.steps, config.hidden, config.rate) == (20_000, (64, 32), 1e-3)
    described = describe_config(config)
    assert json.loads(json.dumps(described)) == described and described["hidden"] == [64, 32]


def test_copo_has_the_published_values():
    config = CopoConfig()
    assert (config.neighbourhood, config.gamma, config.global_gamma, config.smoothing) == (40.0, 0.99, 1.0, 0.95)
    assert (config.angle_spread, config.angle_rate, config.angle_epochs) == (0.1, 1e-4, 5)


@pytest.mark.parametrize(
    ("algorithm", "settings", "message"),
    [
        ("sac", {}, "unknown algorithm 'sac'; choose from ppo"),
        ("nowhere:Sac", {}, "nowhere:Sac: No module named 'nowhere'; is its folder on PYTHONPATH"),
        ("json:Sac", {}, "json:Sac: module 'json' has no attribute 'Sac'"),
        ("json:loads", {}, "expected a subclass of LearnerConfig"),
        ("scenarionet_sim.learning.config:LearnerConfig", {}, "expected a subclass of LearnerConfig that names"),
        ("ppo", {"delay": 2}, "ppo has no setting 'delay'; choose from steps"),
        ("ppo", {"steps": "many"}, "steps='many'; expected a value such as 1000000"),
        ("gail", {"normalizes": "maybe"}, "expected a value such as False"),
        ("ppo", {"worlds": 0}, "worlds=0; expected at least 1"),
        ("ppo", {"epochs": 0}, "epochs=0; expected at least 1"),
        ("ppo", {"rate": 0.0}, "expected rate > 0"),
        ("ppo", {"bins": 1}, "expected 0 for continuous actions"),
        ("ppo", {"traffic": "none"}, "expected replay or idm"),
    ],
)
def test_wrong_settings_are_refused(algorithm, settings, message):
    with pytest.raises(BadParameter, match=message.replace("(", r"\(")):
        make_learner_config(algorithm, settings=settings)


def test_settings_do_not_import_torch():
    code = "import sys; import scenarionet_sim.learning.config; print('torch' in sys.modules)"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout == "False\n"
