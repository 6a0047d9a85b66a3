"""Damaged nuPlan logs and maps: a bad row costs its windows, a bad file its shard, and the run completes."""

from __future__ import annotations

import json
import shutil
import sqlite3
import sys
from collections.abc import Callable
from contextlib import closing
from pathlib import Path

import polars as pl
import pytest
import shapely

from scenarionet_data.conversion import convert
from scenarionet_data.converters.nuplan import NuPlan, content
from scenarionet_data.errors import CorruptSource, InvalidScenario, MissingDependency, SourceError
from scenarionet_data.scenario.description import ScenarioDescription
from tests.fixtures import geopackage
from tests.fixtures import nuplan as fixture
from tests.fixtures import nuplan_drive as drives
from tests.fixtures.reading import scenarios, shards

CONVERTER = NuPlan()
DRIVE = drives.invented(seconds=6.0)
MIDDLE = 70
"""A sweep of the second of two scenes."""


@pytest.fixture(scope="module")
def written(tmp_path_factory: pytest.TempPathFactory) -> Path:
    root = tmp_path_factory.mktemp("nuplan") / "raw"
    tags = [(MIDDLE, "unprotected_left", DRIVE.boxes["track"][0]), (10, "stopping", None)]
    return fixture.write_raw(root, [DRIVE], scene_seconds=3.0, tags=tags)


@pytest.fixture
def raw(written: Path, tmp_path: Path) -> Path:
    """A copy to damage."""
    return shutil.copytree(written, tmp_path / "raw")


def log_of(raw: Path) -> Path:
    (path,) = raw.rglob("*.db")
    return path


def map_of(raw: Path) -> Path:
    (path,) = raw.rglob("map.gpkg")
    return path


def change(path: Path, statement: str, *parameters: object) -> None:
    with closing(sqlite3.connect(path)) as database, database:
        changed = database.execute(statement, parameters).rowcount
    assert changed != 0, "the statement changed nothing"


def outcomes(raw: Path, **options: object) -> list[ScenarioDescription | InvalidScenario]:
    """Scenarios and refusals of the only shard, in order."""
    (shard,) = shards(CONVERTER, raw, "mini", **options)
    found: list[ScenarioDescription | InvalidScenario] = []
    for record in CONVERTER.records(shard):
        try:
            scenario = CONVERTER.scenario(shard, record)
            scenario.validate()
            found.append(scenario)
        except InvalidScenario as error:
            found.append(error)
    return found


# --- rows -----------------------------------------------------------------------------------------------

ONE_BOX = "WHERE token = (SELECT token FROM lidar_box WHERE lidar_pc_token = :sweep LIMIT 1)"
NOWHERE = "x'0011223344556677'"

BAD_ROWS = {
    "a number is missing": (f"UPDATE lidar_box SET x = NULL {ONE_BOX}", "lidar_box", "numbers for the position"),
    "a word for a number": (f"UPDATE lidar_box SET yaw = 'north' {ONE_BOX}", "lidar_box", "numbers for the position"),
    "a blob for a number": (f"UPDATE lidar_box SET width = x'00' {ONE_BOX}", "lidar_box", "numbers for the position"),
    "a box without size": (f"UPDATE lidar_box SET height = 0.0 {ONE_BOX}", "tracks.size", "sizes above 0"),
    "a track nowhere": (f"UPDATE lidar_box SET track_token = {NOWHERE} {ONE_BOX}", "lidar_box", "row of track"),
    "a box twice": (
        "INSERT INTO lidar_box SELECT x'0102030405060708', lidar_pc_token, track_token, NULL, NULL, x, y, z, width, "
        f"length, height, vx, vy, vz, yaw, confidence FROM lidar_box {ONE_BOX}",
        "lidar_box",
        "one box per track and sweep",
    ),
    "a pose nowhere": (
        f"UPDATE lidar_pc SET ego_pose_token = {NOWHERE} WHERE token = :sweep",
        "ego_pose",
        "row of ego_pose for sweep",
    ),
    "no rotation": (
        "UPDATE ego_pose SET qw = 0.0, qz = 0.0 "
        "WHERE token = (SELECT ego_pose_token FROM lidar_pc WHERE token = :sweep)",
        "ego_pose",
        "numbers in a row of ego_pose",
    ),
    "no such light": (
        "UPDATE traffic_light_status SET status = 'purple' WHERE lidar_pc_token = :sweep",
        "traffic_light_status",
        "green, yellow, red or unknown",
    ),
    "no connector": (
        "UPDATE traffic_light_status SET lane_connector_id = NULL WHERE lidar_pc_token = :sweep",
        "traffic_light_status",
        "a lane connector",
    ),
    "a scene nowhere": (
        "UPDATE lidar_pc SET scene_token = x'0011223344556677' "
        "WHERE scene_token = (SELECT scene_token FROM lidar_pc WHERE token = :sweep)",
        "scene",
        "row of scene for token 0011223344556677",
    ),
    "a sweep twice": (
        "UPDATE lidar_pc SET timestamp = (SELECT timestamp FROM lidar_pc WHERE prev_token = :sweep) "
        "WHERE token = :sweep",
        "timestamps",
        "strictly increasing",
    ),
}


@pytest.mark.parametrize("rows_at_once", [content._CHUNK, 512])
@pytest.mark.parametrize("name", BAD_ROWS)
def test_bad_row_quarantines_only_its_scene(
    raw: Path, name: str, rows_at_once: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    """With the bad row among the first ones, from which the driver infers column types, and further back."""
    monkeypatch.setattr(content, "_CHUNK", rows_at_once)
    statement, field, message = BAD_ROWS[name]
    with closing(sqlite3.connect(log_of(raw))) as database, database:
        assert database.execute(statement, {"sweep": DRIVE.lidar_tokens[MIDDLE]}).rowcount
    good, bad, *rest = outcomes(raw, rate=20)
    assert isinstance(good, ScenarioDescription)
    assert isinstance(bad, InvalidScenario)
    assert all(isinstance(scenario, ScenarioDescription) for scenario in rest)
    assert bad.field == field
    assert message in bad.reason
    assert bad.scenario_id.startswith(f"nuplan/v1.1/{DRIVE.name}@")


def test_dangling_category_reference(raw: Path) -> None:
    """All scenes that contain such a track are refused, others are not."""
    track = DRIVE.boxes.filter(DRIVE.boxes["step"] == MIDDLE)["track"][0]
    change(log_of(raw), f"UPDATE track SET category_token = {NOWHERE} WHERE token = ?", track)
    seen = set(DRIVE.boxes.filter(pl.col("track") == track)["step"] // 60)
    for number, found in enumerate(outcomes(raw, rate=20)):
        assert isinstance(found, InvalidScenario) == (number in seen)
        if isinstance(found, InvalidScenario):
            assert track.hex() in found.reason


def test_dangling_tag_reference(raw: Path) -> None:
    change(log_of(raw), f"UPDATE scenario_tag SET lidar_pc_token = {NOWHERE} WHERE type = 'stopping'")
    bad, good = outcomes(raw, by="tag")
    assert isinstance(bad, InvalidScenario)
    assert bad.field == "scenario_tag"
    assert bad.scenario_id.endswith("@0011223344556677")
    assert isinstance(good, ScenarioDescription)


def test_tag_of_a_track_outside_the_window(raw: Path) -> None:
    change(log_of(raw), f"UPDATE scenario_tag SET agent_track_token = {NOWHERE} WHERE agent_track_token IS NOT NULL")
    assert [scenario.objects_of_interest for scenario in scenarios(CONVERTER, raw, "mini", by="tag")] == [(), ()]


def test_incomplete_tags_goals_and_routes_are_accepted(raw: Path) -> None:
    """A tag without a type, a goal without a rotation, a route that is not a string."""
    change(log_of(raw), "UPDATE scenario_tag SET type = NULL WHERE type = 'stopping'")
    change(log_of(raw), "UPDATE scene SET roadblock_ids = x'3437'")
    change(log_of(raw), "UPDATE ego_pose SET qw = NULL WHERE token = (SELECT goal_ego_pose_token FROM scene)")
    first, *_ = outcomes(raw)
    assert isinstance(first, ScenarioDescription)
    assert first.extras["tags"] == [""]
    assert first.extras["roadblock_ids"] == ["47"]
    assert "goal" not in first.extras


def test_rows_without_a_sweep_are_counted(raw: Path) -> None:
    """They cannot be assigned to a scenario."""
    assert "num_lost_rows" not in scenarios(CONVERTER, raw, "mini")[0].extras
    change(
        log_of(raw),
        f"UPDATE lidar_box SET lidar_pc_token = {NOWHERE} WHERE rowid IN (SELECT rowid FROM lidar_box LIMIT 2)",
    )
    light = "(SELECT rowid FROM traffic_light_status LIMIT 1)"
    change(log_of(raw), f"UPDATE traffic_light_status SET lidar_pc_token = {NOWHERE} WHERE rowid IN {light}")
    found = scenarios(CONVERTER, raw, "mini")
    assert [scenario.extras["num_lost_rows"] for scenario in found] == [3] * len(found)


# --- logs -----------------------------------------------------------------------------------------------


def empty(table: str) -> Callable[[Path], None]:
    return lambda path: change(path, f"DELETE FROM {table}")


def rename(table: str) -> Callable[[Path], None]:
    return lambda path: change(path, f"ALTER TABLE {table} RENAME TO other")


def overwrite_middle(path: Path) -> None:
    """Overwrite a third of the file with garbage; the header and the first tables stay intact."""
    data = bytearray(path.read_bytes())
    third = len(data) // 3 // 4096 * 4096
    data[third : 2 * third] = bytes(range(256)) * (third // 256)
    path.write_bytes(data)


BAD_LOGS: dict[str, tuple[Callable[[Path], None], str]] = {
    "no log": (empty("log"), "table log has no row"),
    "no sweeps": (empty("lidar_pc"), "table lidar_pc has no rows"),
    "no table of boxes": (rename("lidar_box"), "no such table: lidar_box"),
    "no table of scenes": (rename("scene"), "no such table: scene"),
    "no time": (lambda p: change(p, "UPDATE lidar_pc SET timestamp = NULL WHERE rowid = 3"), "has no timestamp"),
    "a word for a time": (
        lambda p: change(p, "UPDATE lidar_pc SET timestamp = 'noon' WHERE rowid = 3"),
        "has no timestamp",
    ),
    "empty": (lambda p: p.write_bytes(b""), "no such table"),
    "truncated": (lambda p: p.write_bytes(p.read_bytes()[:20_000]), "malformed|disk I/O"),
    "garbage": (lambda p: p.write_bytes(b"garbage" * 999), "not a database"),
    "garbage in the middle": (overwrite_middle, "malformed|cannot be read"),
    "another zone": (lambda p: change(p, "UPDATE ego_pose SET epsg = 32610"), "recorded in epsg:32610, but its map"),
    "no such city": (
        lambda p: change(p, "UPDATE log SET map_version = 'us-tx-austin', location = NULL"),
        "us-tx-austin",
    ),
}


@pytest.mark.parametrize("name", BAD_LOGS)
def test_bad_log_is_named(raw: Path, name: str) -> None:
    damage, message = BAD_LOGS[name]
    damage(log_of(raw))
    with pytest.raises(SourceError, match=message) as caught:
        scenarios(CONVERTER, raw, "mini")
    assert str(log_of(raw)) in str(caught.value)


def test_location_names_the_map_if_the_log_has_no_map_version(raw: Path) -> None:
    change(log_of(raw), "UPDATE log SET location = map_version, map_version = NULL")
    assert len(scenarios(CONVERTER, raw, "mini")) == 3


def test_map_version_may_end_in_gpkg(raw: Path) -> None:
    change(log_of(raw), "UPDATE log SET map_version = map_version || '.gpkg'")
    assert len(scenarios(CONVERTER, raw, "mini")) == 3


# --- maps -----------------------------------------------------------------------------------------------

BAD_MAPS: dict[str, tuple[Callable[[Path], None], str]] = {
    "missing": (Path.unlink, "map.gpkg is not in"),
    "empty": (lambda p: p.write_bytes(b""), "no such table"),
    "truncated": (lambda p: p.write_bytes(p.read_bytes()[:20_000]), "malformed|disk I/O"),
    "garbage": (lambda p: p.write_bytes(b"garbage" * 999), "not a database"),
    "no projection": (empty("meta"), "projectedCoordSystem"),
    "no such projection": (lambda p: change(p, "UPDATE meta SET value = 'epsg:123456'"), "no projection from"),
    "no layer": (empty("gpkg_geometry_columns"), "no layer"),
    "no geometry": (lambda p: geopackage.set_geometry(p, "crosswalks", None), "crosswalks [0-9]+: expected a POLYGON"),
    "no polygon": (
        lambda p: geopackage.set_geometry(p, "walkways", shapely.Point(-115.0, 36.0)),
        "walkways [0-9]+: expected a POLYGON",
    ),
    "damaged geometry": (
        lambda p: geopackage.set_geometry(p, "boundaries", b"GP\0\3" + bytes(50)),
        "boundaries [0-9]+: expected a LINESTRING",
    ),
    "beyond the pole": (
        lambda p: geopackage.set_geometry(p, "walkways", shapely.box(-115.0, 95.0, -114.0, 96.0)),
        "outside the map",
    ),
    "no centreline": (lambda p: change(p, "DELETE FROM baseline_paths WHERE fid = 7"), "has no baseline path"),
    "two of one id": (lambda p: change(p, "UPDATE lanes_polygons SET lane_fid = 50001"), "have one id"),
    "a road block twice": (
        lambda p: change(p, "UPDATE lane_group_connectors SET fid = 47000"),
        "occurs twice in a nuPlan map",
    ),
}


@pytest.mark.parametrize("name", BAD_MAPS)
def test_bad_map_is_named(raw: Path, name: str) -> None:
    damage, message = BAD_MAPS[name]
    damage(map_of(raw))
    with pytest.raises(SourceError, match=message) as caught:
        scenarios(CONVERTER, raw, "mini")
    assert "map" in str(caught.value)


@pytest.mark.parametrize("text", ["", "{", "[1]", '{"us-nv-las-vegas-strip": 9}', '{"us-nv-las-vegas-strip": {}}'])
def test_bad_version_list_is_named(raw: Path, text: str) -> None:
    (raw / "maps" / "nuplan-maps-v1.0.json").write_text(text)
    with pytest.raises(CorruptSource, match=r"nuplan-maps-v1\.0\.json: expected map versions"):
        shards(CONVERTER, raw, "mini")


def test_unlisted_city_is_refused(raw: Path) -> None:
    (raw / "maps" / "nuplan-maps-v1.0.json").write_text(json.dumps({"us-ma-boston": {"version": "9.12.1817"}}))
    with pytest.raises(SourceError, match=r"recorded at 'us-nv-las-vegas-strip'.*it lists us-ma-boston"):
        scenarios(CONVERTER, raw, "mini")


@pytest.mark.parametrize("module", ["pyproj", "adbc_driver_sqlite"])
def test_missing_package_is_named(raw: Path, module: str, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, module, None)
    map_of(raw).touch()  # so that no cached map is used
    with pytest.raises(MissingDependency, match=r"scenarionet-lake\[nuplan\]"):
        scenarios(CONVERTER, raw, "mini")


# --- a run ----------------------------------------------------------------------------------------------


def test_the_rest_of_a_run_completes(raw: Path, tmp_path: Path) -> None:
    """With a bad log, a bad row and a log without a map, everything else is converted and the failures are reported."""
    logs = raw / "splits" / "mini"
    good = log_of(raw)
    change(good, "UPDATE lidar_box SET x = NULL WHERE lidar_pc_token = ?", DRIVE.lidar_tokens[MIDDLE])
    other = drives.invented(seed=1, seconds=2.0, num_tracks=4)
    truncated = shutil.copy(good, logs / "truncated.db")
    Path(truncated).write_bytes(good.read_bytes()[:30_000])
    away = Path(shutil.copy(good, logs / f"{other.name}.db"))
    change(away, "UPDATE log SET map_version = 'us-ma-boston', location = 'boston'")
    report = convert("nuplan", str(raw), tmp_path / "lake", split="mini")
    assert report.converted == 2
    assert report.quarantined == 1
    assert {name for name, _ in report.failed} == {"truncated", away.stem}
    assert not list((tmp_path / "lake").rglob("*truncated*"))
    again = convert("nuplan", str(raw), tmp_path / "lake", split="mini")
    assert again.converted == 0
    assert len(again.failed) == 2
