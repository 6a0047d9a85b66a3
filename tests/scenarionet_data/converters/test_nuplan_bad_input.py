"""Damaged nuPlan logs and maps: a bad row costs that row, a bad file its shard, and the run completes."""

from __future__ import annotations

import json
import shutil
import sqlite3
import sys
from collections.abc import Callable
from contextlib import closing
from pathlib import Path

import numpy as np
import polars as pl
import pytest
import shapely

from scenarionet_data.conversion import convert
from scenarionet_data.converters.nuplan import NuPlan, content
from scenarionet_data.converters.nuplan.map_features import read_city
from scenarionet_data.errors import CorruptSource, InvalidScenario, MissingDependency, SourceError
from scenarionet_data.scenario.description import ScenarioDescription
from scenarionet_data.scenario.vocabulary import ObjectType
from tests.fixtures import geopackage
from tests.fixtures import nuplan as fixture
from tests.fixtures import nuplan_drive as drives
from tests.fixtures.reading import scenarios, shards

pytestmark = pytest.mark.integration

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


def outcomes(raw: Path, **options: object) -> list[ScenarioDescription]:
    """Valid scenarios of the only shard, in order."""
    found = scenarios(CONVERTER, raw, "mini", **options)
    for scenario in found:
        scenario.validate()
    return found


@pytest.fixture(scope="module")
def undamaged(written: Path) -> list[ScenarioDescription]:
    """The scenes without damage, with every sweep."""
    return outcomes(written, frames="recorded")


# --- rows -----------------------------------------------------------------------------------------------

ONE_BOX = "WHERE token = (SELECT token FROM lidar_box WHERE lidar_pc_token = :sweep LIMIT 1)"
ONE_POSE = "WHERE token = (SELECT ego_pose_token FROM lidar_pc WHERE token = :sweep)"
NOWHERE = "x'0011223344556677'"

BAD_ROWS = {
    "a number is missing": (f"UPDATE lidar_box SET x = NULL {ONE_BOX}", "dropped 1 lidar_box.x, y"),
    "a word for a number": (f"UPDATE lidar_box SET yaw = 'north' {ONE_BOX}", "dropped 1 lidar_box.yaw"),
    "a blob for a number": (
        f"UPDATE lidar_box SET width = x'00' {ONE_BOX}",
        "dropped 1 lidar_box.length, width, height",
    ),
    "a box without size": (f"UPDATE lidar_box SET height = 0.0 {ONE_BOX}", "dropped 1 lidar_box.length, width, height"),
    "a large box": (f"UPDATE lidar_box SET width = 1e9 {ONE_BOX}", "dropped 1 lidar_box.length, width, height"),
    "a box far away": (f"UPDATE lidar_box SET x = 1e12 {ONE_BOX}", "dropped 1 lidar_box.x, y"),
    "a fast box": (f"UPDATE lidar_box SET vx = 1e6 {ONE_BOX}", "assumed 1 lidar_box.vx, vy"),
    "a track nowhere": (f"UPDATE lidar_box SET track_token = {NOWHERE} {ONE_BOX}", "dropped 1 lidar_box.track_token"),
    "a track in words": (f"UPDATE lidar_box SET track_token = 'tram' {ONE_BOX}", "dropped 1 lidar_box.track_token"),
    "a sweep nowhere": (
        f"UPDATE lidar_box SET lidar_pc_token = {NOWHERE} {ONE_BOX}",
        "dropped 1 lidar_box.lidar_pc_token",
    ),
    "a box twice": (
        "INSERT INTO lidar_box SELECT x'0102030405060708', lidar_pc_token, track_token, NULL, NULL, x, y, z, width, "
        f"length, height, vx, vy, vz, yaw, confidence FROM lidar_box {ONE_BOX}",
        "dropped 1 lidar_box.track_token",
    ),
    "a pose nowhere": (
        f"UPDATE lidar_pc SET ego_pose_token = {NOWHERE} WHERE token = :sweep",
        "dropped 1 ego_pose",
    ),
    "no rotation": (f"UPDATE ego_pose SET qw = 0.0, qz = 0.0 {ONE_POSE}", "dropped 1 ego_pose"),
    "a pose in words": (f"UPDATE ego_pose SET x = 'here' {ONE_POSE}", "dropped 1 ego_pose"),
    "a pose far away": (f"UPDATE ego_pose SET x = 1e12 {ONE_POSE}", "dropped 1 ego_pose"),
    "a pose beside": (f"UPDATE ego_pose SET x = x + 500 {ONE_POSE}", "dropped 1 ego_pose"),
    "no such light": (
        "UPDATE traffic_light_status SET status = 'purple' WHERE lidar_pc_token = :sweep",
        "dropped 3 traffic_light_status.status",
    ),
    "no connector": (
        "UPDATE traffic_light_status SET lane_connector_id = 'left' WHERE lidar_pc_token = :sweep",
        "dropped 3 traffic_light_status.lane_connector_id",
    ),
    "a scene nowhere": (
        "UPDATE lidar_pc SET scene_token = x'0011223344556677' "
        "WHERE scene_token = (SELECT scene_token FROM lidar_pc WHERE token = :sweep)",
        "assumed 1 scene",
    ),
}


def told(scenario: ScenarioDescription) -> list[str]:
    return [f"{defect.action} {defect.count} {defect.field}" for defect in scenario.defects]


@pytest.mark.parametrize("rows_at_once", [content._CHUNK, 512])
@pytest.mark.parametrize("name", BAD_ROWS)
def test_bad_row_costs_that_row(
    raw: Path, undamaged: list[ScenarioDescription], name: str, rows_at_once: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    """With the bad row among the first ones, from which the driver infers column types, and further back."""
    monkeypatch.setattr(content, "_CHUNK", rows_at_once)
    statement, wanted = BAD_ROWS[name]
    with closing(sqlite3.connect(log_of(raw))) as database, database:
        assert database.execute(statement, {"sweep": DRIVE.lidar_tokens[MIDDLE]}).rowcount
    found = outcomes(raw, frames="recorded")
    bridged = ["assumed 1 ego_pose"] if "ego_pose" in wanted else []  # the state between its neighbours
    assert [told(scenario) for scenario in found] == [[], [wanted, *bridged], []]
    for before, after in zip(undamaged, found, strict=True):
        lost = np.argwhere(before.tracks.valid & ~after.tracks.valid)
        assert len(lost) == (after is found[1] and wanted.startswith("dropped 1 lidar_box") and "twice" not in name)
        kept = after.tracks.valid & ~after.tracks.is_interpolated
        for column in ("position", "heading", "size"):
            assert np.array_equal(getattr(before.tracks, column)[kept], getattr(after.tracks, column)[kept])


def test_bad_pose_is_interpolated(raw: Path, undamaged: list[ScenarioDescription]) -> None:
    with closing(sqlite3.connect(log_of(raw))) as database, database:
        database.execute(f"UPDATE ego_pose SET y = NULL {ONE_POSE}", {"sweep": DRIVE.lidar_tokens[MIDDLE]})
    scenario = outcomes(raw, frames="recorded")[1]
    ego, step = scenario.ego_index, MIDDLE - 60
    assert np.flatnonzero(scenario.tracks.is_interpolated[ego]).tolist() == [step]
    assert scenario.tracks.valid[ego].all()
    moved = scenario.tracks.position[ego] - undamaged[1].tracks.position[ego]
    assert 0 < np.abs(moved).max() < 0.02
    assert scenario.defects[0].location == DRIVE.lidar_tokens[MIDDLE].hex()


def test_scene_without_ego_is_quarantined(raw: Path) -> None:
    scene = "(SELECT scene_token FROM lidar_pc WHERE token = ?)"
    change(
        log_of(raw),
        f"UPDATE lidar_pc SET ego_pose_token = {NOWHERE} WHERE scene_token = {scene}",
        DRIVE.lidar_tokens[MIDDLE],
    )
    (shard,) = shards(CONVERTER, raw, "mini")
    first, bad, *rest = CONVERTER.records(shard)
    with pytest.raises(InvalidScenario, match="ego_pose: expected numbers in a row of ego_pose"):
        CONVERTER.scenario(shard, bad)
    assert all(CONVERTER.scenario(shard, record).defects == () for record in (first, *rest))


def test_scene_without_times_is_quarantined(raw: Path) -> None:
    scene = "(SELECT scene_token FROM lidar_pc WHERE token = ?)"
    change(
        log_of(raw), f"UPDATE lidar_pc SET timestamp = 'noon' WHERE scene_token = {scene}", DRIVE.lidar_tokens[MIDDLE]
    )
    (shard,) = shards(CONVERTER, raw, "mini")
    *good, bad = CONVERTER.records(shard)
    with pytest.raises(InvalidScenario, match="lidar_pc: expected a row of lidar_pc with a time"):
        CONVERTER.scenario(shard, bad)
    assert len([CONVERTER.scenario(shard, record) for record in good]) == 2


BAD_TIMES = {
    "no time": "NULL",
    "a word for a time": "'noon'",
    "a time long ago": "5",
    "that of the sweep before": "(SELECT timestamp FROM lidar_pc WHERE prev_token = :sweep)",
}


@pytest.mark.parametrize("name", BAD_TIMES)
def test_sweep_without_a_time_is_dropped(raw: Path, undamaged: list[ScenarioDescription], name: str) -> None:
    """Its boxes and lights are counted, too."""
    with closing(sqlite3.connect(log_of(raw))) as database, database:
        statement = f"UPDATE lidar_pc SET timestamp = {BAD_TIMES[name]} WHERE token = :sweep"
        assert database.execute(statement, {"sweep": DRIVE.lidar_tokens[MIDDLE]}).rowcount == 1
    found = outcomes(raw, frames="recorded")
    assert [scenario.num_timesteps for scenario in found] == [60, 59, 1]
    assert found[0].defects == found[2].defects == ()
    fields = {defect.field: defect.count for defect in found[1].defects}
    assert fields.pop("lidar_pc.timestamp") == 1
    lost = undamaged[1].tracks.valid.sum() - found[1].tracks.valid.sum() - 1
    assert fields == {"lidar_box.lidar_pc_token": lost, "traffic_light_status.lidar_pc_token": 3}


def test_dangling_category_reference(raw: Path) -> None:
    """Such a track has the type OTHER, assumed."""
    track = DRIVE.boxes.filter(DRIVE.boxes["step"] == MIDDLE)["track"][0]
    change(log_of(raw), f"UPDATE track SET category_token = {NOWHERE} WHERE token = ?", track)
    seen = set(DRIVE.boxes.filter(pl.col("track") == track)["step"] // 60)
    for number, scenario in enumerate(outcomes(raw, frames="recorded")):
        assert told(scenario) == (["assumed 1 track.category_token"] if number in seen else [])
        if number in seen:
            row = scenario.tracks.index(track.hex())
            assert scenario.tracks.is_type_assumed[row]
            assert scenario.tracks.object_type[row] == ObjectType.OTHER
            assert scenario.tracks.source_type[row] is None


def test_text_that_is_not_utf8(raw: Path) -> None:
    """It is kept with replaced characters, and no message contains its bytes."""
    change(log_of(raw), "UPDATE category SET name = CAST(x'ff41' AS TEXT) WHERE name = 'barrier'")
    change(log_of(raw), "UPDATE scene SET name = CAST(x'ff42' AS TEXT)")
    found = outcomes(raw)
    assert {scenario.extras["scene"] for scenario in found} == {"\ufffdB"}
    assert "\ufffdA" in set(found[0].tracks.source_type)


def test_dangling_tag_reference(raw: Path) -> None:
    change(log_of(raw), f"UPDATE scenario_tag SET lidar_pc_token = {NOWHERE} WHERE type = 'stopping'")
    (shard,) = shards(CONVERTER, raw, "mini", by="tag")
    bad, good = CONVERTER.records(shard)
    with pytest.raises(InvalidScenario, match="@0011223344556677: lidar_pc: expected a row of lidar_pc"):
        CONVERTER.scenario(shard, bad)
    CONVERTER.scenario(shard, good).validate()


def test_tag_of_a_track_outside_the_window(raw: Path) -> None:
    change(log_of(raw), f"UPDATE scenario_tag SET agent_track_token = {NOWHERE} WHERE agent_track_token IS NOT NULL")
    assert [scenario.objects_of_interest for scenario in scenarios(CONVERTER, raw, "mini", by="tag")] == [(), ()]


def test_incomplete_tags_goals_and_routes_are_accepted(raw: Path) -> None:
    """A tag without a type, a goal without a rotation, a route that is not a string."""
    change(log_of(raw), "UPDATE scenario_tag SET type = NULL WHERE type = 'stopping'")
    change(log_of(raw), "UPDATE scene SET roadblock_ids = x'3437'")
    change(log_of(raw), "UPDATE ego_pose SET qw = NULL WHERE token = (SELECT goal_ego_pose_token FROM scene)")
    (shard,) = shards(CONVERTER, raw, "mini")
    first = CONVERTER.scenario(shard, next(iter(CONVERTER.records(shard))))
    assert first.extras["tags"] == [""]
    assert first.extras["roadblock_ids"] == ["47"]
    assert "goal" not in first.extras


def test_rows_without_a_sweep_are_counted_once(raw: Path) -> None:
    """With the scene of the row before them."""
    change(
        log_of(raw),
        f"UPDATE lidar_box SET lidar_pc_token = {NOWHERE} WHERE rowid <= 2",
    )
    light = "(SELECT max(rowid) FROM traffic_light_status)"
    change(log_of(raw), f"UPDATE traffic_light_status SET lidar_pc_token = {NOWHERE} WHERE rowid = {light}")
    first, second, last = outcomes(raw, frames="recorded")
    assert told(first) == ["dropped 2 lidar_box.lidar_pc_token"]
    assert second.defects == ()
    assert told(last) == ["dropped 1 traffic_light_status.lidar_pc_token"]


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
    "no log": (empty("log"), "expected a row of table log"),
    "no sweeps": (empty("lidar_pc"), "expected rows of table lidar_pc"),
    "no table of boxes": (rename("lidar_box"), "found no table lidar_box"),
    "no table of scenes": (rename("scene"), "found no table scene"),
    "no times": (lambda p: change(p, "UPDATE lidar_pc SET timestamp = 'noon'"), "with a timestamp, found none"),
    "no column of boxes": (lambda p: change(p, "ALTER TABLE lidar_box RENAME COLUMN yaw TO turn"), "no column yaw"),
    "empty": (lambda p: p.write_bytes(b""), "found no table"),
    "truncated": (lambda p: p.write_bytes(p.read_bytes()[:20_000]), "found a damaged file"),
    "garbage": (lambda p: p.write_bytes(b"garbage" * 999), "found another format"),
    "garbage in the middle": (overwrite_middle, "found a damaged file"),
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
    "empty": (lambda p: p.write_bytes(b""), "found no table"),
    "truncated": (lambda p: p.write_bytes(p.read_bytes()[:20_000]), "found a damaged file"),
    "garbage": (lambda p: p.write_bytes(b"garbage" * 999), "found another format"),
    "no projection": (empty("meta"), "projectedCoordSystem"),
    "no such projection": (
        lambda p: change(p, "UPDATE meta SET value = 'epsg:123456'"),
        "found .epsg:4326. and .epsg:123456.",
    ),
    "no layer": (empty("gpkg_geometry_columns"), "no layer"),
    "no geometry column": (
        lambda p: change(p, "UPDATE gpkg_geometry_columns SET column_name = 'a b'"),
        "no geometry of layer",
    ),
    "a folder": (lambda p: (p.unlink(), p.mkdir()), "map.gpkg is not in"),
}


@pytest.mark.parametrize("name", BAD_MAPS)
def test_bad_map_is_named(raw: Path, name: str) -> None:
    damage, message = BAD_MAPS[name]
    damage(map_of(raw))
    with pytest.raises(SourceError, match=message) as caught:
        scenarios(CONVERTER, raw, "mini")
    assert "map" in str(caught.value)


BAD_FEATURES: dict[str, tuple[Callable[[Path], object], str, str, int]] = {
    "no geometry": (lambda p: geopackage.set_geometry(p, "crosswalks", None), "dropped", "crosswalks", 1),
    "no polygon": (
        lambda p: geopackage.set_geometry(p, "walkways", shapely.Point(-115.0, 36.0)),
        "dropped",
        "walkways",
        2,
    ),
    "damaged geometry": (
        lambda p: geopackage.set_geometry(p, "carpark_areas", b"GP\0\3" + bytes(50)),
        "dropped",
        "carpark_areas",
        1,
    ),
    "beyond the pole": (
        lambda p: geopackage.set_geometry(p, "walkways", shapely.box(-115.0, 95.0, -114.0, 96.0)),
        "dropped",
        "walkways",
        2,
    ),
    "no centreline": (lambda p: change(p, "DELETE FROM baseline_paths WHERE fid = 7"), "assumed", "lanes_polygons", 1),
    "two of one id": (
        lambda p: change(p, "UPDATE lanes_polygons SET lane_fid = 50001 WHERE lane_fid = 50002"),
        "dropped",
        "lanes_polygons",
        1,
    ),
    "a lane in words": (
        lambda p: change(p, "UPDATE lanes_polygons SET lane_fid = 'left' WHERE lane_fid = 50002"),
        "dropped",
        "lanes_polygons",
        1,
    ),
    "a road block twice": (
        lambda p: change(p, "UPDATE lane_group_connectors SET fid = 47000 WHERE fid = 58000"),
        "dropped",
        "lane_group_connectors",
        1,
    ),
}


@pytest.mark.parametrize("name", BAD_FEATURES)
def test_bad_feature_costs_that_feature(raw: Path, written: Path, name: str) -> None:
    damage, action, layer, count = BAD_FEATURES[name]
    damage(map_of(raw))
    builder, whole = (read_city(map_of(folder), folder / "maps").features for folder in (raw, written))
    found = [(defect.table, defect.action, defect.field, defect.count) for defect in builder.defects]
    assert found == [("maps", action, layer, count)]
    assert builder.defects[0].file == "us-nv-las-vegas-strip/9.15.1915/map.gpkg"
    assert len(whole) - len(builder) == (count if action == "dropped" else 0)
    assert len(outcomes(raw)) == 3


@pytest.mark.parametrize("column", ["lane_type_fid", "speed_limit_mps", "lane_index", "left_boundary_fid"])
@pytest.mark.parametrize("value", ["x'ff00'", "'fast'", "NULL", "1e308", "-5"])
def test_other_values_of_lanes_are_unknown(raw: Path, column: str, value: str) -> None:
    change(map_of(raw), f"UPDATE lanes_polygons SET {column} = {value}")
    assert len(outcomes(raw)) == 3


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
    assert report.converted == 3
    assert report.quarantined == 0
    assert report.dropped > 0
    assert {name for name, _ in report.failed} == {"truncated", away.stem}
    assert not list((tmp_path / "lake").rglob("*truncated*"))
    again = convert("nuplan", str(raw), tmp_path / "lake", split="mini")
    assert again.converted == 0
    assert len(again.failed) == 2
