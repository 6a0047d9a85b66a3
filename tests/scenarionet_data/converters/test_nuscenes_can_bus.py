"""The CAN bus expansion: ego signals in the extras of its track."""

from __future__ import annotations

import json
import shutil
from pathlib import Path

import numpy as np
import pytest

from scenarionet_data.converters.nuscenes import NuScenes
from scenarionet_data.scenario.canonical_json import from_json
from scenarionet_data.scenario.description import ScenarioDescription
from tests.fixtures import nuscenes as fixture
from tests.fixtures.reading import scenarios, shards

CONVERTER = NuScenes()


@pytest.fixture(scope="module")
def written(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Two scenes, the first with CAN bus data; read-only."""
    root = tmp_path_factory.mktemp("nuscenes")
    scenes = fixture.write_invented(root, num_scenes=2)
    fixture.write_can_bus(root, scenes[0])
    return root


@pytest.fixture
def raw(written: Path, tmp_path: Path) -> Path:
    """A writable copy of them."""
    return shutil.copytree(written, tmp_path / "raw")


def said(scenario: ScenarioDescription) -> dict[str, list]:
    return from_json(scenario.tracks.extras[scenario.ego_index]).get("can_bus", {})


def by_name(raw: Path, **options: object) -> dict[str, ScenarioDescription]:
    return {s.source.scenario_id: s for s in scenarios(CONVERTER, raw, "mini", **options)}


def test_signals_are_resampled_to_the_timesteps(raw: Path) -> None:
    scenario = by_name(raw)["scene-0061"]
    signals = said(scenario)
    assert {len(values) for values in signals.values()} == {scenario.num_timesteps}
    ego = scenario.tracks.velocity[scenario.ego_index]
    inside = slice(2, -2)
    speed = np.array(signals["pose.vel"])[:, 0]
    np.testing.assert_allclose(speed[inside], np.hypot(*ego.T)[inside], atol=0.3)
    np.testing.assert_allclose(
        np.array(signals["vehicle_monitor.vehicle_speed"])[inside] / 3.6, speed[inside], atol=0.3
    )
    assert set(signals["steeranglefeedback.value"]) == {-0.25}
    assert signals["pose.rotation_rate"][7] == [0.0, 0.0, 0.02]


def test_discrete_signals_hold_their_last_value(raw: Path) -> None:
    signals = said(by_name(raw)["scene-0061"])
    assert set(signals["vehicle_monitor.left_signal"]) == {0.0, 1.0}
    assert signals["vehicle_monitor.left_signal"] == sorted(signals["vehicle_monitor.left_signal"])
    assert set(signals["vehicle_monitor.gear_position"]) == {7.0}


def test_scenes_without_can_bus_and_with_the_option_off(raw: Path) -> None:
    assert said(by_name(raw)["scene-0103"]) == {}
    assert said(by_name(raw, has_can_bus=False)["scene-0061"]) == {}


def test_windows_have_their_part_of_the_signals(raw: Path) -> None:
    whole = said(by_name(raw)["scene-0061"])["vehicle_monitor.left_signal"]
    windows = [s for s in scenarios(CONVERTER, raw, "mini", by="window") if s.source.scenario_id == "scene-0061"]
    assert windows
    for window in windows:
        part = said(window)["vehicle_monitor.left_signal"]
        assert len(part) == window.num_timesteps < len(whole)


def test_missing_messages_are_unknown(raw: Path) -> None:
    path = raw / "can_bus" / "scene-0061_vehicle_monitor.json"
    messages = json.loads(path.read_text())
    path.write_text(json.dumps(messages[:4] + messages[12:-5]))
    values = said(by_name(raw)["scene-0061"])["vehicle_monitor.throttle"]
    assert {values[k] for k in (0, 10)} == {120.0}
    assert values[25] is None and values[-1] is None
    (raw / "can_bus" / "scene-0061_pose.json").unlink()
    assert "pose.vel" not in said(by_name(raw)["scene-0061"])


@pytest.mark.parametrize(
    "text", ["", "{", "[]", "[1]", '[{"utime": 1}]', '[{"utime": 1, "value": 0}]', '[{"utime": 1, "value": NaN}]']
)
def test_damaged_file_costs_its_signal(raw: Path, text: str) -> None:
    (raw / "can_bus" / "scene-0061_steeranglefeedback.json").write_text(text)
    found = by_name(raw)
    assert "steeranglefeedback.value" not in said(found["scene-0061"])
    assert "pose.vel" in said(found["scene-0061"])
    (defect,) = found["scene-0061"].defects
    assert (defect.file, defect.action) == ("can_bus/scene-0061_steeranglefeedback.json", "assumed")
    assert found["scene-0103"].defects == ()


@pytest.mark.parametrize("value", [None, "fast", [1.0, 2.0], [1.0, 2.0, float("nan")], {}])
def test_damaged_message_is_interpolated(raw: Path, value: object) -> None:
    path = raw / "can_bus" / "scene-0061_pose.json"
    whole = said(by_name(raw)["scene-0061"])["pose.vel"]
    messages = json.loads(path.read_text())
    messages[40]["vel"] = value
    path.write_text(json.dumps(messages))
    scenario = by_name(raw)["scene-0061"]
    np.testing.assert_allclose(np.array(said(scenario)["pose.vel"]), np.array(whole), atol=0.05)
    (defect,) = scenario.defects
    assert (defect.count, defect.location, defect.action) == (1, "row 40", "assumed")


def test_can_bus_added_later_changes_only_its_scene(raw: Path) -> None:
    def marks() -> dict[str, str]:
        return {item.name: item.fingerprint for shard in shards(CONVERTER, raw, "mini") for item in shard.items}

    before = marks()
    for path in (raw / "can_bus").iterdir():
        path.rename(path.with_name(path.name.replace("0061", "0103")))
    after = marks()
    assert [name for name in before if before[name] != after[name]] == list(before)
    assert len(before) == 2
