"""Training runs: killed at any moment they go on to the same weights; metrics in SQL; bad input is a sentence."""

from __future__ import annotations

import numpy as np
import pytest

pytestmark = pytest.mark.learn
torch = pytest.importorskip("torch", reason="no torch: run `make test-learn`")

from scenarionet_data import Lake, convert  # noqa: E402
from scenarionet_data.errors import BadParameter, LakeError  # noqa: E402
from scenarionet_data.maintenance.fsck import fsck  # noqa: E402
from scenarionet_data.storage import checkpoints  # noqa: E402
from scenarionet_data.storage.files.places import open_files  # noqa: E402
from scenarionet_sim import record  # noqa: E402
from scenarionet_sim.learning.config import make_learner_config  # noqa: E402
from scenarionet_sim.learning.training import plan_training, train  # noqa: E402

TINY = {
    "ppo": {"worlds": 3, "horizon": 20, "minibatch": 32, "epochs": 2, "steps": 600, "levels": 2, "traffic": "idm"},
    "ippo": {"worlds": 2, "seats": 8, "horizon": 15, "minibatch": 64, "epochs": 2, "steps": 1000},
    "copo": {"worlds": 2, "seats": 8, "horizon": 15, "minibatch": 64, "epochs": 2, "steps": 1000, "angle_rate": 0.01},
    "td3": {"worlds": 2, "seats": 8, "minibatch": 32, "warm_up": 100, "replay": 300, "steps": 1000},
    "gail": {"worlds": 2, "seats": 8, "horizon": 15, "minibatch": 64, "epochs": 2, "steps": 1000, "input_noise": 0.1},
    "airl": {"worlds": 2, "seats": 8, "horizon": 15, "minibatch": 64, "epochs": 2, "steps": 1000, "inverse_steps": 3},
    "dagger": {"worlds": 3, "horizon": 20, "minibatch": 32, "updates": 3, "steps": 600, "replay": 400},
}


class Killed(Exception):
    pass


def tiny(algorithm, **settings):
    small = {"hidden": (16, 16), "checkpoint_every": 3} | TINY[algorithm] | settings
    return make_learner_config(algorithm, "small", small)


def kill_after(rounds):
    left = [rounds]

    def on_round(row):
        left[0] -= 1
        if not left[0]:
            raise Killed

    return on_round


@pytest.fixture
def lake(drives, tmp_path):
    """A copy of the lake, which the test may write to."""
    import shutil

    return Lake(shutil.copytree(drives, tmp_path / "lake"))


@pytest.mark.parametrize("algorithm", TINY)
def test_a_killed_run_ends_with_the_same_weights(lake, algorithm):
    config, options = tiny(algorithm), {"observations": "experts"} if algorithm in ("gail", "airl") else {}
    if options:
        record(lake, name="experts")
    report = train(lake, algorithm=algorithm, config=config, name="whole", **options)
    for rounds in (2, 4, 2):  # before the first checkpoint, and twice after one
        with pytest.raises(Killed):
            train(lake, algorithm=algorithm, config=config, name="parts", on_round=kill_after(rounds), **options)
    again = train(lake, algorithm=algorithm, config=config, name="parts", **options)
    assert report.resumed == 0 < again.resumed < again.steps == report.steps
    files = open_files(lake.root)
    whole, parts = (checkpoints.load(files, name) for name in ("whole", "parts"))
    assert whole.facts["series"] == parts.facts["series"]
    for name, values in whole.arrays.items():
        np.testing.assert_array_equal(parts.arrays[name], values, err_msg=name)
    curve = "SELECT * EXCLUDE (run, environment_seconds, inference_seconds, update_seconds) FROM training"
    first, second = (lake.sql(f"{curve} WHERE run = $run ORDER BY round", {"run": run}) for run in ("whole", "parts"))
    assert first.equals(second) and first["steps"][-1] == report.steps
    assert (
        train(lake, algorithm=algorithm, config=config, name="whole", **options).resumed == report.steps
    )  # nothing left to do


def test_imitation_needs_experts(lake):
    with pytest.raises(BadParameter, match="GailConfig imitates experts; pass observations"):
        train(lake, algorithm="gail", config=tiny("gail"))
    with pytest.raises(BadParameter, match="no transitions of experts in run 'unknown'"):
        train(lake, algorithm="airl", config=tiny("airl"), observations="unknown")


def test_curves_have_tests_at_checkpoints(lake):
    lake.filter("true", name="six")
    report = train(lake, "six", algorithm="ppo", config=tiny("ppo", levels=0), name="curve", tests=["six"])
    rows = lake.sql("SELECT * FROM training WHERE run = 'curve' AND test IS NOT NULL ORDER BY steps")
    assert rows["episodes"].to_list() == [6] * len(rows) and len(rows) > 2
    assert report.tests["six@1"]["episodes"] == 6
    assert lake.sql("SELECT max(coverage) FROM training").item() == pytest.approx(1.0)
    assert len(checkpoints.numbers(open_files(lake.root), "curve")) == 2
    assert not fsck(lake.root).problems


def test_the_task_is_that_of_training_and_of_tests(lake):
    for task, road_user in (("paper", -2.0), ("careful", -20.0)):
        training = plan_training(lake, None, "ppo", config=tiny("ppo", levels=0, task=task))
        for environment in (training.environment(), training.environment(None, is_test=True)):
            assert environment.reward.road_user == road_user
        assert training.description["config"]["task"] == task


def test_rounds_say_how_difficult_their_scenarios_are(tmp_path):
    convert("pg", "0:2", tmp_path / "lake")
    lake = Lake(tmp_path / "lake")
    for scenario, difficulty in lake.sql("SELECT scenario_id, difficulty FROM metadata").rows():
        train(lake, [scenario], algorithm="ppo", config=tiny("ppo", levels=0), name=scenario[-1])
        rows = lake.sql(f"SELECT difficulty FROM training WHERE run = '{scenario[-1]}'")
        np.testing.assert_allclose(rows["difficulty"], difficulty, rtol=1e-6)
    assert lake.sql("SELECT count(DISTINCT difficulty) FROM training").item() == 2


def test_a_driver_learns(lake):
    """PPO reaches the end of straight roads after a few thousand steps."""
    config = tiny("ppo", steps=20_000, levels=0, traffic="replay", worlds=16, horizon=50, minibatch=256, epochs=5)
    lake.filter("ego_distance > 10", name="driving")
    report = train(lake, "driving", algorithm="ppo", config=config, name="learner", tests=["driving"])
    assert report.tests["driving@1"]["success"] > 0.9


def test_another_setting_needs_another_name(lake):
    train(lake, algorithm="ppo", config=tiny("ppo"), name="mine")
    with pytest.raises(BadParameter, match="a run 'mine' exists with seed 0, not 1"):
        train(lake, algorithm="ppo", config=tiny("ppo"), name="mine", seed=1)


def test_more_levels_than_scenarios_are_refused(lake):
    with pytest.raises(BadParameter, match="100 levels of 2 scenarios"):
        train(lake, ["made/v1/wall", "made/v1/empty"], algorithm="ppo", config=tiny("ppo", levels=100))
    report = train(lake, ["made/v1/wall", "made/v1/empty"], algorithm="ppo", config=tiny("ppo"))
    assert report.steps == 600


def test_a_reward_that_is_no_number_names_its_scenario(lake, monkeypatch):
    from scenarionet_sim.environments.flat import FlatEnv

    config, step = tiny("ppo"), FlatEnv.step

    def broken(self, actions):
        result = step(self, actions)
        self.rewards[1] = np.nan
        return result

    monkeypatch.setattr(FlatEnv, "step", broken)
    with pytest.raises(LakeError, match=r"made/v1/.*: a reward is nan, expected a number"):
        train(lake, algorithm="ppo", config=config, name="broken")


def test_a_loss_that_is_no_number_ends_the_run(lake):
    with pytest.raises(LakeError, match="expected a number; train again under another name with a smaller rate"):
        train(lake, algorithm="ppo", config=tiny("ppo", rate=1e30, reward_scale=1e30))


def test_a_lake_that_grows_changes_nothing(lake):
    """A run goes on with the snapshot that it began with."""
    from tests.fixtures.drives import make_drive
    from tests.fixtures.lakes import write_lake

    config = tiny("ppo")
    train(lake, algorithm="ppo", config=config, name="whole")
    with pytest.raises(Killed):
        train(lake, algorithm="ppo", config=config, name="parts", on_round=kill_after(5))
    write_lake(lake.root, [make_drive("new")], name="new")
    train(Lake(lake.root), algorithm="ppo", config=config, name="parts")
    whole, parts = (checkpoints.load(open_files(lake.root), name) for name in ("whole", "parts"))
    np.testing.assert_array_equal(whole.arrays["policy.body.0.weight"], parts.arrays["policy.body.0.weight"])


def test_files_that_vanish_end_the_run_with_a_sentence(lake):
    """What was learned before stays."""
    config = tiny("ppo")
    with pytest.raises(Killed):
        train(lake, algorithm="ppo", config=config, name="parts", on_round=kill_after(5))
    for file in (lake.root / "tracks").rglob("*.parquet"):
        file.unlink()
    with pytest.raises(
        LakeError, match="No such file or directory; `scenarionet maintain check` lists the affected scenarios"
    ):
        train(lake, algorithm="ppo", config=config, name="parts")
    assert checkpoints.numbers(open_files(lake.root), "parts") == [1]


def test_scenarios_of_several_timesteps_are_resampled(tmp_path):
    from tests.fixtures.drives import make_drive
    from tests.fixtures.lakes import write_lake

    mixed = write_lake(tmp_path / "lake", [make_drive("slow", dt=0.5), make_drive("fast", dt=0.1)])
    assert train(mixed, algorithm="ppo", config=tiny("ppo", levels=0)).skipped == {}


def test_a_damaged_checkpoint_is_named(lake):
    train(lake, algorithm="ppo", config=tiny("ppo"), name="mine")
    newest = sorted((lake.root / "results/mine/checkpoints").glob("*.safetensors"))[-1]
    data = bytearray(newest.read_bytes())
    data[-100] ^= 1
    newest.write_bytes(data)
    with pytest.raises(LakeError, match="a damaged checkpoint, its bytes differ"):
        checkpoints.load(open_files(lake.root), "mine")


MINE = """
from dataclasses import dataclass
from typing import ClassVar

from scenarionet_sim.learning.config import PpoConfig
from scenarionet_sim.learning.ppo import PpoLearner


@dataclass(frozen=True)
class CalmConfig(PpoConfig):
    learner: ClassVar[str] = "calm:CalmLearner"
    calmness: float = 0.5


class CalmLearner(PpoLearner):
    def round(self):
        done, learned = super().round()
        return done, learned | {"calmness": self.config.calmness}
"""


def test_an_algorithm_of_ones_own_is_one_file(lake, tmp_path, monkeypatch):
    (tmp_path / "calm.py").write_text(MINE)
    monkeypatch.syspath_prepend(str(tmp_path))
    settings = TINY["ppo"] | {"steps": 120, "hidden": "16,16", "calmness": "0.75"}
    config = make_learner_config("calm:CalmConfig", "small", settings)
    report = train(lake, algorithm="calm:CalmConfig", config=config)
    assert report.run == "all-calm.CalmConfig-seed0" and '"calmness": 0.75' in report.last["learned"]
