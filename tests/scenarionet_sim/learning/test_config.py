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


MANY = {"rate": 1e-4, "minibatch": 512, "epochs": 10, "clip": 0.2, "smoothing": 0.95, "gamma": 0.99}
PUBLISHED = {
    "ppo": {"steps": 20_000_000, "rate": 1e-4, "epochs": 20, "minibatch": 200, "clip": 0.2, "smoothing": 0.95,
            "gamma": 0.99, "hidden": (512, 256, 128)},
    "td3": {"rate": 1e-4, "minibatch": 100, "tau": 0.005},
    "ippo": MANY,
    "copo": MANY | {"angle_rate": 1e-4, "angle_epochs": 5, "neighbourhood": 40.0},
    "gail": MANY | {"discriminator_rate": 5e-5, "discriminator_decay": 1e-5, "discriminator_epochs": 1,
                    "discriminator_minibatch": 1024},
    "airl": MANY | {"discriminator_rate": 3e-4, "discriminator_decay": 1e-5, "discriminator_epochs": 5,
                    "discriminator_minibatch": 1024, "inverse_steps": 100, "inverse_series": 1,
                    "inverse_minibatch": 512, "inverse_rate": 1e-4},
    "dagger": {},  # not of the paper
}  # fmt: skip
"""Tables of hyper-parameters in the paper's appendix."""


@pytest.mark.parametrize("algorithm", ALGORITHMS)
def test_paper_has_the_numbers_of_the_appendix(algorithm):
    config = make_learner_config(algorithm, "paper")
    assert {name: getattr(config, name) for name in PUBLISHED[algorithm]} == PUBLISHED[algorithm]
    if algorithm == "ppo":
        assert config.worlds * config.horizon == pytest.approx(50_000, rel=0.01)
    elif algorithm not in ("td3", "dagger"):  # batches of 2,000 steps of agents, about a fifth of the seats is taken
        assert config.worlds * config.seats * config.horizon / 5 == 2000


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
        ("ppo", {"delay": 2}, "ppo has no setting 'delay'; it has steps"),
        ("ppo", {"steps": "many"}, "ppo: steps wants int, for example 20000000; found 'many'"),
        ("gail", {"normalizes": "maybe"}, "normalizes wants bool, for example False; found 'maybe'"),
        ("ppo", {"worlds": 0}, "worlds=0; expected a whole number of 1 or more"),
        ("ppo", {"epochs": 0}, "epochs=0; expected a whole number of 1 or more"),
        ("ppo", {"rate": 0.0}, "rate=0.0; expected a number above 0"),
        ("ppo", {"bins": 1}, "expected 0 for continuous actions"),
        ("dagger", {"bins": 5}, "dagger imitates continuous controls, expected 0"),
        ("dagger", {"updates": 0}, "updates=0; expected a whole number of 1 or more"),
        ("dagger", {"share": 1.5}, "share=1.5; expected a share from 0 to 1"),
        ("ppo", {"traffic": "none"}, "traffic wants .*replay.*idm.*; found 'none'"),
        ("ppo", {"task": "fast"}, "task='fast'; expected paper or careful"),
        ("ippo", {"task": "careful"}, "several agents have paper"),
    ],
)
def test_wrong_settings_are_refused(algorithm, settings, message):
    with pytest.raises(BadParameter, match=message.replace("(", r"\(")):
        make_learner_config(algorithm, settings=settings)


def test_settings_do_not_import_torch():
    code = "import sys; import scenarionet_sim.learning.config; print('torch' in sys.modules)"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout == "False\n"
