"""Views of events inside scenarios, and their geometry macros, agree with NumPy on the arrays."""

from __future__ import annotations

import numpy as np
import polars as pl
import pytest
import shapely

from scenarionet_data import Lake
from scenarionet_data.arrays.geometry import wrap_angle
from scenarionet_data.conversion import convert
from scenarionet_data.scenario.vocabulary import LightState
from tests.fixtures import made_city
from tests.fixtures.lakes import write_lake
from tests.fixtures.made import write_raw
from tests.fixtures.moments import Mover, T, along, going, lane, moment, shown, walking
from tests.fixtures.scenarios import make_scenario


@pytest.fixture(scope="module")
def scenarios():
    return [make_scenario(seed, num_objects=5) for seed in range(6)]


@pytest.fixture(scope="module")
def lake(tmp_path_factory, scenarios) -> Lake:
    return write_lake(tmp_path_factory.mktemp("views"), scenarios)


def boxes(count: int) -> pl.DataFrame:
    """Pairs of boxes, the first at the origin, with relative velocities; some parallel, some at rest."""
    rng = np.random.default_rng(0)
    rows = pl.DataFrame(
        {
            "ahead": rng.uniform(-9, 9, count),
            "side": rng.uniform(-9, 9, count),
            "turn": rng.uniform(-4, 4, count) * (rng.random(count) < 0.8),
            "v_ahead": rng.normal(0, 4, count) * (rng.random(count) < 0.9),
            "v_side": rng.normal(0, 4, count) * (rng.random(count) < 0.9),
        }
    )
    sizes = {name: rng.uniform(0.5, 5, count) for name in ("l1", "w1", "l2", "w2")}
    return rows.with_columns(**{name: pl.Series(values) for name, values in sizes.items()})


def gap_after(rows: pl.DataFrame, seconds) -> np.ndarray:
    """Distance between the boxes by shapely, after the second has moved for a time."""
    zero = np.zeros(len(rows))
    x, y = (rows[p].to_numpy() + rows[f"v_{p}"].to_numpy() * seconds for p in ("ahead", "side"))
    first = polygons(zero, zero, zero, rows["l1"].to_numpy(), rows["w1"].to_numpy())
    return shapely.distance(
        first, polygons(x, y, rows["turn"].to_numpy(), rows["l2"].to_numpy(), rows["w2"].to_numpy())
    )


def polygons(x, y, heading, length, width) -> np.ndarray:
    corners = np.stack([sx * length / 2 + 1j * sy * width / 2 for sx, sy in ((1, 1), (-1, 1), (-1, -1), (1, -1))], 1)
    placed = (x + 1j * y)[:, None] + corners * np.exp(1j * heading)[:, None]
    return shapely.polygons(np.stack([placed.real, placed.imag], axis=2))


def test_box_gap_matches_shapely_distance(lake):
    rows = boxes(800)
    query = "SELECT box_gap(ahead, side, turn, l1, w1, l2, w2) AS gap FROM boxes"
    gap = lake.arrow(query, tables={"boxes": rows.to_arrow()})["gap"].to_numpy()
    np.testing.assert_allclose(gap, gap_after(rows, 0), atol=1e-12)
    assert 0.1 < (gap == 0).mean() < 0.5


def test_box_ttc_is_the_time_of_first_contact(lake):
    rows = boxes(800)
    query = "SELECT box_ttc(ahead, side, turn, v_ahead, v_side, l1, w1, l2, w2) AS ttc FROM boxes"
    ttc = lake.arrow(query, tables={"boxes": rows.to_arrow()})["ttc"].to_numpy(zero_copy_only=False)
    hits = np.isfinite(ttc)
    assert 0.1 < hits.mean() < 0.9
    hit = rows.filter(pl.Series(hits))
    assert (gap_after(hit, ttc[hits] + 1e-9) < 1e-6).all()
    later = ttc[hits] > 1e-3
    assert (gap_after(hit, ttc[hits] - 1e-3)[later] > 0).all()
    missed = rows.filter(pl.Series(~hits))
    for seconds in np.linspace(0, 20, 101):
        assert (gap_after(missed, seconds) > 0).all()


def test_segment_gap_and_wrap_angle(lake):
    found = lake.sql(
        "SELECT segment_gap(3, 4, 0, 0) AS a, segment_gap(5, 2, 10, 0) AS b, segment_gap(13, 4, 10, 0) AS c"
    )
    assert found.row(0) == (5.0, 2.0, 5.0)
    angles = np.linspace(-10, 10, 401)
    query = "SELECT wrap_angle(angle) AS w FROM angles"
    wrapped = lake.arrow(query, tables={"angles": pl.DataFrame({"angle": angles}).to_arrow()})["w"].to_numpy()
    np.testing.assert_allclose(wrapped, wrap_angle(angles), atol=1e-12)


def test_ego_states_match_the_ego_track(lake, scenarios):
    mine = lake.sql("SELECT * EXCLUDE (seconds) FROM ego_states ORDER BY scenario_id, timestep")
    states = "SELECT * EXCLUDE (object_type) FROM states WHERE track_id = 't0' ORDER BY scenario_id, timestep"
    assert mine.equals(lake.sql(states).select(mine.columns))
    seconds = lake.sql("SELECT scenario_id, seconds FROM ego_states ORDER BY scenario_id, timestep")
    for scenario in scenarios:  # every other one has explicit timestamps
        rows = seconds.filter(pl.col("scenario_id") == scenario.id)["seconds"]
        np.testing.assert_allclose(rows, scenario.timestamps, atol=1e-12)


def test_ego_pairs_are_in_the_ego_frame(lake, scenarios):
    found = lake.sql("SELECT * FROM ego_pairs")
    for scenario in scenarios:
        tracks = scenario.tracks
        rows = found.filter(pl.col("scenario_id") == scenario.id).sort("track_id", "timestep")
        row, step = np.nonzero(tracks.valid & (np.arange(len(tracks)) > 0)[:, None])
        assert rows["track_id"].to_list() == list(tracks.ids[row])
        assert rows["timestep"].to_list() == list(step)
        offset = (tracks.position[row, step] - tracks.position[0, step])[:, :2].astype(np.float64)
        heading = tracks.heading[0, step].astype(np.float64)
        to_frame = np.exp(-1j * heading)
        frame = (offset[:, 0] + 1j * offset[:, 1]) * to_frame
        np.testing.assert_allclose(rows["ahead"].to_numpy() + 1j * rows["left"].to_numpy(), frame, atol=1e-4)
        moved = tracks.velocity[row, step] - tracks.velocity[0, step]
        velocity = (moved[:, 0] + 1j * moved[:, 1]) * to_frame
        np.testing.assert_allclose(rows["v_ahead"].to_numpy() + 1j * rows["v_left"].to_numpy(), velocity, atol=1e-4)
        np.testing.assert_allclose(rows["distance"], np.hypot(*offset.T), atol=1e-4)


def test_corridor_follows_a_curved_ego_path(tmp_path):
    """On a circle of 50 m, an object 2 m inside and 0.4 rad ahead is 20 m ahead and 2 m to the left."""
    inside = Mover(48 * np.sin(0.4 + 0.2 * T), 50 - 48 * np.cos(0.4 + 0.2 * T), 0 * T, 0 * T, 0.4 + 0.2 * T)
    lake = write_lake(tmp_path, [moment("bend", going(0, 0, 10, 0.2), car=inside, away=along(0, 50))])
    found = lake.sql("SELECT * FROM ego_corridor WHERE seconds <= 7 ORDER BY timestep")
    assert found["track_id"].unique().to_list() == ["car"]
    assert len(found) == 71
    np.testing.assert_allclose(found["ahead"], 20.0, atol=0.1)
    np.testing.assert_allclose(found["left"], 2.0, atol=0.05)
    np.testing.assert_allclose(found["turn"], 0.0, atol=0.05)
    np.testing.assert_allclose(found["ego_passes"] - found["seconds"], 2.0, atol=0.02)


def test_path_is_extrapolated_straight_beyond_the_recording(tmp_path):
    lake = write_lake(tmp_path, [moment("straight", along(0, 0, 1), near=along(55, 1), far=along(65, 1))])
    rows = lake.sql('SELECT track_id, ahead, "left", ego_passes FROM ego_corridor WHERE timestep = 0')
    assert rows["track_id"].to_list() == ["near"]
    assert rows.row(0)[1:] == (pytest.approx(55.0, abs=1e-3), pytest.approx(1.0), None)
    path = lake.sql("SELECT min(s) AS a, max(s) AS b, max(seconds) AS t FROM ego_path").row(0)
    assert path == (0.0, pytest.approx(60.0, abs=1e-3), pytest.approx(10.0))


def test_leads_are_the_nearest_vehicles_ahead(tmp_path):
    ego = along(0, 0, 10)
    others = {"near": along(15, 0, 10), "next": along(30, 0, 10), "who": walking(8, 0, 10), "side": along(8, 3.5, 10)}
    lake = write_lake(tmp_path, [moment("lead", ego, **others)])
    found = lake.sql("SELECT DISTINCT track_id, round(gap, 3) AS gap, round(headway, 3) AS headway FROM ego_leads")
    assert found.rows() == [("near", 11.0, 1.5)]


def test_motion_and_turns(tmp_path):
    car = going(0, 40, lambda t: 5 + 2 * t, 0.1)
    lake = write_lake(tmp_path, [moment("motion", along(0, 0), car=car)])
    rows = lake.sql("SELECT * FROM motion WHERE track_id = 'car' ORDER BY timestep")
    assert rows["timestep"].to_list() == list(range(5, 101))
    np.testing.assert_allclose(rows["acceleration"], 2.0, atol=1e-3)
    np.testing.assert_allclose(rows["yaw_rate"], 0.1, atol=1e-4)
    (turn,) = lake.sql("SELECT track_id, is_ego, first_timestep, last_timestep, angle FROM turns").rows()
    assert turn == ("car", False, 0, 100, pytest.approx(0.96, abs=1e-3))


def test_lane_graph_has_every_link(lake, scenarios):
    found = set(lake.sql("SELECT map_id, lane_id, relation, other_lane_id, is_in_map FROM lane_graph").rows())
    wanted = set()
    columns = {
        "SUCCESSOR": "exit_lanes",
        "PREDECESSOR": "entry_lanes",
        "LEFT": "left_neighbors",
        "RIGHT": "right_neighbors",
    }
    for scenario in scenarios:
        ids, types = scenario.map.ids, scenario.map.feature_type
        lanes = {name for name, kind in zip(ids, types, strict=True) if kind < 16}
        for row, name in enumerate(ids):
            for relation, column in columns.items():
                others = getattr(scenario.map, column)[row] if name in lanes else ()
                wanted |= {(scenario.id, name, relation, other, other in lanes) for other in others}
    assert found == wanted
    assert {row[4] for row in wanted} == {True, False}


def test_ego_lanes_in_a_shared_map_use_the_scenario_frame(tmp_path):
    """Lanes run along x every 3 m of the source's frame, and so does the ego."""
    convert(made_city.LANES, str(write_raw(tmp_path / "raw", {"a": list(range(6))})), tmp_path / "lake")
    found = Lake(tmp_path / "lake").sql("""
        SELECT l.scenario_id, timestep, lane_id, apart, y + origin_y - 600000 AS y
        FROM ego_lanes AS l JOIN ego_states USING (scenario_id, timestep) JOIN metadata USING (scenario_id)
    """)
    assert len(found) == 6 * 31
    assert found["lane_id"].to_list() == [f"lane{round(y / 3)}" for y in found["y"]]
    np.testing.assert_allclose(found["apart"], [abs(y - 3 * round(y / 3)) for y in found["y"]], atol=1e-3)
    assert found["lane_id"].n_unique() > 2


def test_stop_lines_are_on_their_lane(tmp_path):
    road = [lane("up", (0, 10), (0, 40)), lane("across", (-20, 0), (20, 0))]
    red = shown((LightState.LANE_STATE_STOP, 1))
    lights = [("up", None, red), ("across", (5.0, 0.5), red), ("gone", (1.0, 1.0), red)]
    lake = write_lake(tmp_path, [moment("lines", along(0, 0), road, lights)])
    rows = lake.sql("SELECT lane_id, x, y, heading FROM stop_lines ORDER BY lane_id DESC").rows()
    assert rows == [("up", 0.0, 10.0, pytest.approx(np.pi / 2)), ("across", 5.0, 0.5, pytest.approx(0.0))]


@pytest.mark.long
def test_restricted_lake_shows_only_selected_scenarios(tmp_path, scenarios):
    lake = write_lake(tmp_path, scenarios)
    ids = [scenarios[k].id for k in (1, 4)]
    few = lake.restrict_to(ids)
    for view in ("metadata", "tracks", "lights", "states", "ego_pairs"):
        found = few.sql(f"SELECT DISTINCT scenario_id FROM {view} ORDER BY 1")["scenario_id"].to_list()
        assert found == ids, view
    assert few.sql("SELECT DISTINCT map_id FROM maps ORDER BY 1")["map_id"].to_list() == ids
    lake.filter("true", name="all")
    assert len(lake.restrict_to("all")) == len(scenarios)
    assert len(lake.restrict_to([])) == 0
