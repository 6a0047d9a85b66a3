"""Every rule of sql/checks on every dataset: silent on its scenarios, and every deliberate violation is found."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
import pytest

from scenarionet_data import Lake, codec, converters
from scenarionet_data.building import MapBuilder
from scenarionet_data.errors import InvalidScenario
from scenarionet_data.ingest.options import Options
from scenarionet_data.ingest.shard import RawItem, Shard
from scenarionet_data.quality import audit, rules
from scenarionet_data.quality.checks import run_checks
from scenarionet_data.quality.report import CheckReport
from scenarionet_data.scenario.description import Lights, ScenarioDescription, strings
from scenarionet_data.scenario.vocabulary import MapFeatureType
from scenarionet_data.storage.files.local import LocalLakeFiles
from scenarionet_data.storage.snapshots import commit as commits
from scenarionet_data.storage.snapshots import snapshot as snapshots
from scenarionet_data.storage.write.map_tiles import write_shared_map
from tests.fixtures import datasets
from tests.fixtures.lakes import write_shard
from tests.fixtures.scenarios import renamed

pytestmark = pytest.mark.integration

LANE = MapFeatureType.LANE_SURFACE_STREET
EVERYWHERE = (-100.0, -100.0, 100.0, 100.0)


def changed(field: str, index: Callable[[ScenarioDescription], object], value: float):
    """The scenario with part of one of its track arrays overwritten."""

    def change(scenario: ScenarioDescription) -> ScenarioDescription:
        array = getattr(scenario.tracks, field).copy()
        array[index(scenario)] = value
        return replace(scenario, tracks=replace(scenario.tracks, **{field: array}))

    return change


def ego_now(scenario: ScenarioDescription) -> tuple[int, int]:
    return int(scenario.ego_index), scenario.current_timestep


def faster(scenario: ScenarioDescription) -> ScenarioDescription:
    velocity = scenario.tracks.velocity + np.float32(60) * scenario.tracks.valid[..., None]
    recorded = np.zeros(len(scenario.tracks), np.bool_)
    return replace(scenario, tracks=replace(scenario.tracks, velocity=velocity, is_velocity_estimated=recorded))


def stopped(scenario: ScenarioDescription) -> ScenarioDescription:
    """The ego's last velocity is 0, though it drives at 20 m/s."""
    velocity, position, ego = scenario.tracks.velocity.copy(), scenario.tracks.position.copy(), scenario.ego_index
    near, end = np.flatnonzero(scenario.tracks.valid[ego])[-2:]
    velocity[ego, [near, end], :] = [[20, 0], [0, 0]]
    position[ego, end, :2] = position[ego, near, :2] + [20 * np.diff(scenario.timestamps[[near, end]])[0], 0]
    return replace(scenario, tracks=replace(scenario.tracks, velocity=velocity, position=position))


def turned(scenario: ScenarioDescription) -> ScenarioDescription:
    """All objects slide, 2.3 rad off their heading: more than any budget, less than reversing."""
    tracks = scenario.tracks
    speed = np.hypot(tracks.velocity[..., 0], tracks.velocity[..., 1]) + 3
    velocity = np.stack([np.cos(tracks.heading + 2.3), np.sin(tracks.heading + 2.3)], axis=-1) * speed[..., None]
    return replace(scenario, tracks=replace(tracks, velocity=velocity.astype(np.float32) * tracks.valid[..., None]))


def lit(scenario: ScenarioDescription) -> ScenarioDescription:
    """A light that refers to a lane missing from the map."""
    lights = Lights(
        ids=strings(["light"]),
        lane_ids=strings(["nowhere"]),
        stop_point=np.zeros((1, 3), np.float32),
        state=np.ones((1, scenario.num_timesteps), np.uint8),
        is_lane_in_map=np.array([True]),
        provenance=np.zeros(1, np.uint8),
    )
    return replace(scenario, lights=lights)


def lanes(*rows: tuple[str, float, float, list[str], list[str]]) -> MapBuilder:
    """Lanes along x: id, start, end, entries, exits."""
    builder = MapBuilder()
    for name, start, end, entries, exits in rows:
        line = np.array([[start, 0, 0], [end, 0, 0]])
        builder.add(name, LANE, polyline=line, entry_lanes=entries, exit_lanes=exits)
    return builder


ONE_WAY = (("a", 0, 5, [], ["b"]), ("b", 5, 9, [], []))
APART = (("a", 0, 5, [], ["b"]), ("b", 55, 99, ["a"], []))


def mapped(*rows):
    """The scenario with a map of its own."""

    def change(scenario: ScenarioDescription) -> ScenarioDescription:
        features = lanes(*rows).build(np.zeros(3), scenario.has_z)
        own = replace(scenario, map=features, map_id=None, map_crop=None)
        return replace(own, lights=Lights.empty(scenario.num_timesteps))

    return change


def on_shared_map(name: str, crop=EVERYWHERE):
    """The scenario as a window on a shared map."""
    return lambda scenario: replace(scenario, map_id=name, map_crop=crop, lights=Lights.empty(scenario.num_timesteps))


BROKEN: list[tuple[str, str, Callable[[ScenarioDescription], ScenarioDescription]]] = [
    ("ego_is_valid_now", "gone", changed("valid", ego_now, False)),
    ("timestamps_increase", "stands-still", lambda s: replace(s, timestamps=s.timestamps * 0)),
    ("sizes_are_positive", "flat", changed("size", lambda s: (s.ego_index, slice(None), 2), 0)),
    ("headings_are_wrapped", "dizzy", changed("heading", ego_now, 4)),
    ("states_are_finite", "endless", changed("velocity", ego_now, np.inf)),
    ("states_are_plausible", "huge", changed("size", lambda s: (s.ego_index, slice(None), 0), 201)),
    ("velocity_is_motion", "faster", faster),
    ("heading_is_direction", "turned", turned),
    ("nobody_stops_dead", "stops", stopped),
    ("nobody_teleports", "jumps", changed("position", ego_now, 900)),
    ("lights_refer_to_lanes", "lit", lit),
    ("lane_links_are_mutual", "one-way", mapped(*ONE_WAY)),
    ("successors_are_close", "apart", mapped(*APART)),
    ("lane_links_are_mutual", "on-one-way", on_shared_map("one-way")),
    ("successors_are_close", "on-apart", on_shared_map("apart")),
    ("shared_maps_are_present", "on-nothing", on_shared_map("missing")),
    ("counts_are_true", "miscounted", lambda s: s),
    ("content_is_present", "lost", lambda s: s),
    ("ids_are_unique", "twice", lambda s: s),
]
"""Rule, name of the scenario that breaks it, and how."""

SOUND = {"copy": lambda s: s, "beside-one-way": on_shared_map("one-way", (900.0, 900.0, 901.0, 901.0))}
"""Scenarios that are as good as recorded; one shares a map whose broken link it does not see."""


@dataclass(frozen=True)
class Case:
    """A dataset's lake with broken scenarios among valid ones."""

    recordings: datasets.Recordings
    template: ScenarioDescription
    findings: CheckReport

    def id(self, name: str) -> str:
        return renamed(self.template, name).id

    def details(self, check: str) -> dict[str | None, str]:
        rows = [row for row in self.findings.rows.to_pylist() if row["check"] == check]
        return {row["scenario_id"]: row["detail"] for row in rows}


BY_DEFAULT = ("nuplan", "pg", "waymo")
"""A dataset with shared maps, a generated one and one with heights; the others are tested with the long tests."""
DATASETS = [
    name if name in BY_DEFAULT else pytest.param(name, marks=pytest.mark.long) for name in sorted(datasets.WRITERS)
]


@pytest.fixture(scope="module", params=DATASETS)
def case(request, tmp_path_factory) -> Case:
    root = tmp_path_factory.mktemp(request.param)
    recordings = datasets.read(request.param, root / "raw")
    template = min(recordings.scenarios, key=lambda s: s.tracks.valid.sum())
    at_origin = replace(template, origin=np.zeros(3))
    variants = {name: renamed(change(at_origin), name) for _, name, change in BROKEN}
    variants |= {name: renamed(change(at_origin), name) for name, change in SOUND.items()}
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(ScenarioDescription, "validate", lambda scenario: None)
        patch.setattr(codec, "summarise", miscounting(variants["miscounted"].id, codec.summarise))
        write_case(root / "lake", recordings, variants)
    return Case(recordings, template, run_checks(Lake(root / "lake")))


def miscounting(scenario_id: str, summarise):
    def summary(scenario: ScenarioDescription) -> dict:
        row = summarise(scenario)
        return row | {"num_objects": row["num_objects"] + 1} if scenario.id == scenario_id else row

    return summary


def write_case(root: Path, recordings: datasets.Recordings, variants: dict[str, ScenarioDescription]) -> None:
    """Write the recorded scenarios, variants, good and bad shared maps, a miscounted shard, and a missing file."""
    files, release = LocalLakeFiles(root), recordings.scenarios[0]
    alone = {name: variants.pop(name) for name in ("lost", "twice")}
    records = [write_shard(root, recordings.scenarios, "recorded"), write_shard(root, variants.values(), "variants")]
    records += [write_shard(root, [scenario], name) for name, scenario in alone.items()]
    records[1] = replace(records[1], num_scenarios=len(variants) + 1)
    for name, rows in (("one-way", ONE_WAY), ("apart", APART)):
        shard = Shard(release.dataset, release.version, "", name, "/raw", (RawItem(name, "f"),), Options())
        records.append(write_shared_map(files, shard, lanes(*rows), "1", "CC0"))
    records += [write_shared_map(files, shard, features, "1", "CC0") for shard, features in recordings.maps]
    snapshot = commits.commit(files, records, "test").snapshot
    twice = next(name for name in snapshot.metadata if "/twice-" in name)
    snapshots.publish(files, replace(snapshot, number=2, metadata=(*snapshot.metadata, twice)))
    next(root.glob("tracks/**/lost-*.parquet")).unlink()


@pytest.mark.long
def test_recorded_scenarios_violate_no_rule(case: Case) -> None:
    sound = {scenario.id for scenario in case.recordings.scenarios} | {case.id(name) for name in SOUND}
    rows = [row for row in case.findings.rows.to_pylist() if row["scenario_id"] in sound]
    budgets = converters.budgets(case.template.dataset)
    assert rows == []
    assert budgets == case.recordings.converter.budgets


@pytest.mark.parametrize(("check", "name"), [(check, name) for check, name, _ in BROKEN])
def test_violations_are_located(case: Case, check: str, name: str) -> None:
    assert case.id(name) in case.details(check)


def test_shared_maps_are_checked_whole(case: Case) -> None:
    """The map itself, and among the scenarios that share it those whose crop contains the broken link."""
    release = f"{case.template.dataset}/{case.template.version}"
    assert case.details("lane_links_are_mutual")[None] == (
        f"map {release}/one-way: 1 links are one-way, for example a -> b"
    )
    assert case.details("successors_are_close")[None].startswith(
        f"map {release}/apart: 1 links jump, the widest a -> b"
    )
    assert case.details("shared_maps_are_present") == {case.id("on-nothing"): "map missing is not in the lake"}


def test_shard_counts_match_its_content(case: Case) -> None:
    rows = [row for row in case.findings.rows.to_pylist() if row["check"] == "shards_are_whole"]
    said = len(BROKEN) - 2 + len(SOUND)
    partition = f"{case.template.dataset}/{case.template.version}/{case.template.split}"
    assert f"shard {partition}/variants: {said} scenarios, {said + 1} were converted" in [row["detail"] for row in rows]


def test_audit_finds_hard_rule_violations(case: Case) -> None:
    """Before anything is written, with the rule as the field; valid scenarios pass; validation covers the rest."""
    at_origin = replace(case.template, origin=np.zeros(3))
    # For a window on a shared map, only the scenario is available.
    own = [row for row in BROKEN if rules.load(row[0]).kind == "hard" and not row[1].startswith("on-")]
    own = [row for row in own if row[1] != "lit" or case.template.map_crop is None]
    for _, name, change in (row for row in own if row[0] in audit.VALIDATED):
        with pytest.raises(InvalidScenario):
            renamed(change(at_origin), name).validate()
    own = [row for row in own if row[0] not in audit.VALIDATED]
    broken = [renamed(change(at_origin), name) for _, name, change in own]
    encoded = [codec.encode(scenario, "1") for scenario in [*broken, *case.recordings.scenarios]]
    found = audit.audit(encoded)
    assert {number: error.field for number, error in found.items()} == dict(enumerate(check for check, _, _ in own))
    for number, error in found.items():  # alone, without lights or a map that others of a batch have
        assert audit.audit([encoded[number]])[0].field == error.field


def test_every_rule_is_violated_on_every_dataset() -> None:
    assert {check for check, _, _ in BROKEN} | {"shards_are_whole"} == set(rules.names())
