"""Every check of sql/checks: silent on a valid lake, and every deliberate violation is found."""

from __future__ import annotations

import re
from dataclasses import replace

import numpy as np
import pytest

from scenarionet_data import codec
from scenarionet_data.errors import InvalidScenario, QueryError, UnknownQuery
from scenarionet_data.quality import audit, report, rules
from scenarionet_data.quality.checks import run_checks
from scenarionet_data.scenario.description import ScenarioDescription
from tests.fixtures.lakes import write_lake
from tests.fixtures.scenarios import make_scenario, renamed
from tests.fixtures.violations import changed, jump, mapped, sound


def shorter_lights(scenario):
    return replace(scenario, lights=replace(scenario.lights, state=scenario.lights.state[:, :-1]))


def scaled_velocity(scenario):
    return replace(scenario, tracks=replace(scenario.tracks, velocity=scenario.tracks.velocity * 1.5))


VIOLATIONS = [
    ("ego_is_valid_now", changed("tracks", valid=((0, 10), False)), "track t0 is not valid at timestep 10"),
    ("ego_is_valid_now", changed("tracks", valid=((0, slice(10, None)), False)), "track t0 is not valid"),
    ("ego_is_valid_now", changed("tracks", valid=((0, slice(0, 11)), False)), "track t0 is not valid"),
    ("timestamps_increase", lambda s: replace(s, timestamps=np.zeros(31)), "not after the one before"),
    ("timestamps_increase", lambda s: replace(s, timestamps=s.timestamps + 1), "the first is 1.0"),
    ("timestamps_increase", lambda s: replace(s, dt=-0.1, timestamps=s.timestamps + 0), "dt is -0.1"),
    ("sizes_are_positive", changed("tracks", size=((0, slice(None), 1), 0)), "a size of 4.5 x 0.0 x 1.6 m"),
    ("sizes_are_positive", changed("tracks", size=((0, 7, 2), -1)), "a size of 4.5 x 1.9 x -1.0 m"),
    ("headings_are_wrapped", changed("tracks", heading=((0, 3), np.float32(np.pi))), "track t0 has a heading of"),
    ("headings_are_wrapped", changed("tracks", heading=((0, 3), -4)), "track t0 has a heading of -4.0"),
    ("states_are_finite", changed("tracks", velocity=((0, 3, 1), np.inf)), "track t0"),
    ("states_are_finite", changed("tracks", position=((0, 3, 2), np.nan)), "track t0"),
    ("states_are_plausible", changed("tracks", position=((1, 3, 1), 2e4)), " m from the ego, expected up to 10000"),
    ("states_are_plausible", changed("tracks", size=((1, 3, 2), 1e9)), "has a size of 1e+09 m, expected up to 200"),
    ("states_are_plausible", changed("tracks", velocity=((1, 3, 0), -151)), "has a speed of 151 m/s, expected up to"),
    ("lights_refer_to_lanes", changed("lights", is_lane_in_map=(0, False)), "lane lane0, which is in the map"),
    ("lights_refer_to_lanes", changed("lights", lane_ids=(0, "far")), "lane far, which is not in"),
    ("lights_refer_to_lanes", lambda s: replace(s, map=None), "which is not in the map"),
    ("lights_refer_to_lanes", shorter_lights, "light light0 has 30 states over 31 timesteps"),
    ("lane_links_are_mutual", mapped(("a", 0, 5, [], ["b"]), ("b", 5, 9, [], [])), "example a -> b"),
    ("lane_links_are_mutual", mapped(("a", 0, 5, [], []), ("b", 5, 9, ["a"], [])), "example a -> b"),
    (
        "successors_are_close",
        mapped(("a", 0, 5, [], ["b"]), ("b", 11, 99, ["a"], [])),
        "the widest a -> b by 6.0 m",
    ),
    ("velocity_is_motion", scaled_velocity, "% of "),
    ("heading_is_direction", changed("tracks", heading=((0, slice(0, 9)), 1.5)), "9 of "),
    ("nobody_stops_dead", changed("tracks", velocity=((0, -1), 0)), "track t0 at timestep 30, at 10"),
    ("nobody_teleports", jump, "track t0 at 9"),
]


@pytest.fixture(scope="module")
def broken_lake(tmp_path_factory):
    """One scenario per violation among valid ones: check name to violations, scenario id to detail."""
    broken = [change(renamed(sound(5), f"broken{i:02d}")) for i, (_, change, _) in enumerate(VIOLATIONS)]
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(ScenarioDescription, "validate", lambda scenario: None)
        patch.setattr(report, "_NUM_EXAMPLES", 100)
        lake = write_lake(tmp_path_factory.mktemp("broken"), [sound(2), *broken, sound(3)])
        return {result.name: dict(result.examples) for result in run_checks(lake).results}


@pytest.mark.parametrize(
    ("number", "name", "detail"), [(i, name, detail) for i, (name, _, detail) in enumerate(VIOLATIONS)]
)
def test_violation_is_found_in_its_scenario(number, name, detail, broken_lake):
    assert detail in broken_lake[name][renamed(sound(5), f"broken{number:02d}").id]


@pytest.mark.parametrize(("name", "change"), [(n, change) for n, change, _ in VIOLATIONS if n in audit.VALIDATED])
def test_validation_covers_rules_the_audit_omits(name, change):
    with pytest.raises(InvalidScenario):
        change(sound(5)).validate()


def test_every_rule_left_to_validation_has_a_violation():
    assert {name for name, _, _ in VIOLATIONS} >= audit.VALIDATED


def test_valid_scenarios_among_broken_ones_are_not_reported(broken_lake):
    found = {scenario_id for examples in broken_lake.values() for scenario_id in examples}
    assert len(found) == len(VIOLATIONS)
    assert found.isdisjoint({sound(2).id, sound(3).id})


@pytest.fixture(scope="module")
def sound_lake(tmp_path_factory):
    return write_lake(tmp_path_factory.mktemp("sound"), [sound(seed) for seed in range(8)])


def test_valid_lake_passes_every_check(sound_lake):
    results = run_checks(sound_lake).results
    assert {result.name for result in results} == set(rules.names())
    assert [(result.name, result.examples) for result in results if not result.is_met] == []
    hard = [result.is_hard for result in results]
    assert hard == sorted(hard, reverse=True)


@pytest.mark.long
def test_empty_lake_passes_every_check(tmp_path):
    (tmp_path / "snapshots").mkdir()
    from scenarionet_data import Lake

    assert all(result.is_met for result in run_checks(Lake(tmp_path)).results)


def test_every_check_has_a_violating_test_case():
    elsewhere = {"content_is_present", "ids_are_unique", "counts_are_true"}
    elsewhere |= {"shards_are_whole", "shared_maps_are_present"}  # in test_contracts.py
    assert {name for name, _, _ in VIOLATIONS} | elsewhere == set(rules.names())


@pytest.mark.parametrize("name", rules.names())
def test_every_check_is_documented(name):
    check = rules.load(name)
    assert check.doc.endswith(".")
    assert re.search(r"\bscenario_id\b", check.query)
    soft = {"velocity_is_motion", "heading_is_direction", "nobody_teleports", "successors_are_close"}
    assert check.is_hard == (name not in soft)


def test_unknown_and_malformed_checks_are_refused(sound_lake, tmp_path, monkeypatch):
    with pytest.raises(UnknownQuery, match="sizes_are_positive"):
        run_checks(sound_lake, names=["sizes_positive"])
    (tmp_path / "checks").mkdir()
    (tmp_path / "checks" / "vague.sql").write_text("-- Something.\nSELECT scenario_id, '' AS detail FROM metadata")
    monkeypatch.setattr("scenarionet_data.query.named_sql.SQL", tmp_path)
    with pytest.raises(QueryError, match=r"vague\.sql: wanted a first line"):
        rules.load("vague")


def test_checks_are_read_only(sound_lake, tmp_path, monkeypatch):
    (tmp_path / "checks").mkdir()
    (tmp_path / "checks" / "bad.sql").write_text("-- hard: No.\nSELECT 1) x; DROP VIEW metadata; SELECT (1")
    monkeypatch.setattr("scenarionet_data.query.named_sql.SQL", tmp_path)
    with pytest.raises(QueryError):
        run_checks(sound_lake, names=["bad"])


def test_lane_links_out_of_the_map_are_not_violations(tmp_path):
    change = mapped(("a", 0, 5, ["far"], ["b"]), ("b", 5, 9, ["a"], ["farther"]))
    lake = write_lake(tmp_path, [change(sound(4))])
    assert run_checks(lake, names=["lane_links_are_mutual"]).results[0].is_met


def test_invalid_steps_are_not_checked(tmp_path):
    """Zeros inside a span are not a size, a heading or a jump."""
    scenario = changed(
        "tracks",
        **{name: ((1, slice(5, 8)), 0) for name in ("valid", "position", "heading", "velocity", "size")},
    )(sound(4))
    assert not scenario.tracks.valid[1].all()
    lake = write_lake(tmp_path, [scenario])
    assert [result.name for result in run_checks(lake).results if not result.is_met] == []


def test_wrong_count_is_found(tmp_path, monkeypatch):
    columns = "num_objects num_vehicles num_cones num_states num_lights num_map_features num_lanes".split()
    liars = {sound(seed).id: column for seed, column in enumerate(columns)}
    honest = codec.summarise

    def lying(scenario):
        row, column = honest(scenario), liars.get(scenario.id)
        return row | {column: row[column] + 1} if column else row

    monkeypatch.setattr(codec, "summarise", lying)
    monkeypatch.setattr(report, "_NUM_EXAMPLES", 100)
    lake = write_lake(tmp_path, [sound(seed) for seed in range(len(columns) + 2)])
    (result,) = run_checks(lake, names=["counts_are_true"]).results
    rows = {sound(seed).id: honest(sound(seed)) for seed in range(len(columns))}
    assert dict(result.examples) == {
        name: f"{column} is {rows[name][column] + 1}, found {rows[name][column]}" for name, column in liars.items()
    }


def test_counts_of_scenarios_without_lights_or_map(tmp_path):
    lake = write_lake(tmp_path, [make_scenario(1, has_map=False, num_lights=0)])
    assert run_checks(lake, names=["counts_are_true"]).results[0].is_met


def test_scenario_stored_in_two_files_is_found(tmp_path):
    from scenarionet_data import Lake
    from scenarionet_data.storage.snapshots import snapshot as snapshots

    lake = write_lake(tmp_path, [sound(1), sound(2)])
    twice = replace(lake.snapshot, number=2, metadata=lake.snapshot.metadata * 2)
    snapshots.publish(lake.files, twice)
    (result,) = run_checks(Lake(tmp_path), names=["ids_are_unique"]).results
    assert result.num_scenarios == 2
    assert result.examples[0] == (sound(1).id, "2 rows of metadata")


def test_missing_and_truncated_content_is_named(tmp_path):
    """One shard per kind of damage; the valid shard beside them is still read."""
    tables = ("tracks", "lights", "maps")
    damages = [(table, data) for table in tables for data in (None, b"PAR1")]
    for seed in range(len(damages) + 1):
        lake = write_lake(tmp_path, [sound(seed)], name=f"shard{seed}")
    for seed, (table, data) in enumerate(damages):
        (path,) = tmp_path.glob(f"{table}/**/shard{seed}-*.parquet")
        path.unlink()
        if data:
            path.write_bytes(data)
    names = ["content_is_present", "counts_are_true", "ids_are_unique"]
    content, counts, ids = run_checks(lake, names=names).results
    assert content.num_scenarios == counts.num_scenarios == len(damages)
    for (scenario_id, detail), (table, data), seed in zip(content.examples, damages, range(5), strict=False):
        assert scenario_id == sound(seed).id
        assert detail.startswith(f"{table}/dataset=made/version=v1/")
        assert detail.endswith("bytes long" if data else "is gone")
    assert ids.is_met


@pytest.mark.parametrize("executor", [None, lambda jobs, do: map(do, jobs)])
def test_checks_go_on_past_damaged_files(executor, lenient, tmp_path):
    """Files of the right size, of which bytes differ, and missing metadata; the other shards are still checked."""
    tables = ("tracks", "lights", "maps", "metadata")
    for seed, table in enumerate(tables):
        write_lake(tmp_path, [sound(seed)], name=table)
    write_lake(tmp_path, [sound(8)], name="lost")
    lake = write_lake(tmp_path, [changed("tracks", heading=((0, 3), -4))(sound(9))], name="whole")
    for table in tables:
        (path,) = tmp_path.glob(f"{table}/**/{table}-*.parquet")
        data = bytearray(path.read_bytes())
        data[60] ^= 1
        path.write_bytes(data)
    next(tmp_path.glob("metadata/**/lost-*.parquet")).unlink()
    names = ["content_is_present", "headings_are_wrapped"]
    content, headings = run_checks(lake, names=names, executor=executor).results
    assert (content.num_scenarios, content.num_others) == (3, 2)
    details = {detail.rpartition(" is ")[2] for _, detail in content.examples}
    assert details == {"damaged", "gone"}
    assert [scenario_id for scenario_id, _ in headings.examples] == [sound(9).id]


def test_only_members_of_a_database_are_checked(lenient, tmp_path):
    broken = [changed("tracks", heading=((0, 3), -4))(sound(seed)) for seed in (1, 2)]
    lake = write_lake(tmp_path, [*broken, sound(3)])
    lake.filter("ends_with(scenario_id, '2') OR ends_with(scenario_id, '3')", name="some")
    lake.filter("ends_with(scenario_id, '3')", name="good")
    for database in ("some", lake.database("some")):
        (result,) = run_checks(lake, database, names=["headings_are_wrapped"]).results
        assert [scenario_id for scenario_id, _ in result.examples] == [sound(2).id]
    assert run_checks(lake, "good", names=["headings_are_wrapped"]).results[0].is_met


def test_examples_are_limited_and_ordered(lenient, tmp_path):
    lake = write_lake(tmp_path, [changed("tracks", heading=((0, 3), -4))(sound(seed)) for seed in range(9)])
    (result,) = run_checks(lake, names=["headings_are_wrapped"]).results
    assert result.num_scenarios == 9
    assert [scenario_id for scenario_id, _ in result.examples] == [sound(seed).id for seed in range(5)]
