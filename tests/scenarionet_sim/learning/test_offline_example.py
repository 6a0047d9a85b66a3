"""The example of offline learning, on episodes of constant speed."""

from __future__ import annotations

import pytest

torch = pytest.importorskip("torch", reason="no torch: run `make test-learn`")
pytest.importorskip("minari", reason="no minari: run `make test-learn`")

import offline_learning  # noqa: E402
from offline_learning import Transitions, drive, learn  # noqa: E402

from scenarionet_sim import ScenarioNetEnv, Scenarios, record_episodes  # noqa: E402
from tests.fixtures.drives import make_drive  # noqa: E402
from tests.fixtures.lakes import write_lake  # noqa: E402

pytestmark = pytest.mark.learn


@pytest.fixture
def lake(tmp_path, monkeypatch):
    monkeypatch.setenv("MINARI_DATASETS_PATH", str(tmp_path / "datasets"))
    return write_lake(tmp_path / "lake", [make_drive(f"d{k}", speed=6.0 + k) for k in range(3)])


@pytest.mark.parametrize("algorithm", ["bc", "td3bc"])
def test_it_acts_as_recorded(lake, monkeypatch, algorithm):
    """TD3+BC, too, where values have no weight."""
    record_episodes(Scenarios(lake), "drives/recorded-v0", observation="route")
    data = Transitions("drives/recorded-v0")
    torch.manual_seed(0)
    monkeypatch.setattr(offline_learning, "WEIGHT", 0.0)
    actor = learn(data, algorithm, 800)
    with torch.no_grad():
        assert (actor(data.seen) - data.action).abs().max() < 0.05
    mean, _ = drive(actor, data, ScenarioNetEnv(scenarios=Scenarios(lake), sensors="route"))
    assert mean > 0.0
