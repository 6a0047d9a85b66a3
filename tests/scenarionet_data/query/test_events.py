"""Every event of sql/events on hand-made scenarios: the exact hits, with objects, timesteps and values."""

from __future__ import annotations

import re
from dataclasses import replace

import numpy as np
import polars as pl
import pytest

from scenarionet_data import Lake, convert
from scenarionet_data.errors import BadParameter, QueryError, UnknownEvent
from scenarionet_data.query.named_sql import EVENTS
from scenarionet_data.scenario.vocabulary import LightState
from tests.fixtures.lakes import write_lake
from tests.fixtures.moments import Mover, T, along, crosswalk, going, lane, moment, shifting, shown, walking

EGO = along(0, 0, 10)
STANDING = along(0, 0)
RED, GREEN, ARROW = LightState.LANE_STATE_STOP, LightState.LANE_STATE_GO, LightState.LANE_STATE_ARROW_GO
ROAD = [lane("in", (-60, 0), (0, 0), exit_lanes=["out"]), lane("out", (0, 0), (60, 0), entry_lanes=["in"])]
TWO_LANES = [
    lane("right", (-20, 0), (60, 0), left_neighbors=["left"], exit_lanes=["on"]),
    lane("left", (-20, 3.5), (60, 3.5), right_neighbors=["right"]),
    lane("on", (60, 0), (150, 0), entry_lanes=["right"]),
]
ZEBRA = crosswalk("zebra", 10, -5, 14, 5)


def braking(rate, start=4.0, seconds=2.0, pace=20.0):
    return going(0, 30, lambda t: pace - rate * np.clip(t - start, 0, seconds))


def turning(x, y, angle, rate=0.5, pace=5.0):
    """Drive straight on until 2 s, then turn by an angle [rad]."""
    side = np.sign(angle)
    return going(x, y, pace, lambda t: np.where((t >= 2) & (t < 2 + abs(angle) / rate), side * rate, 0.0))


def red(name, car, *spans, ego=STANDING, stop=(0.0, 0.0)):
    """A car, a road, and a red light for lanes beyond x = 0."""
    return moment(name, ego, ROAD, [("out", stop, shown(*spans))], car=car)


FAR = along(0, 50)
# 20 m further on the same circle of 50 m as an ego at 10 m/s
BEND = Mover(
    *(50 * np.sin(0.4 + 0.2 * T), 50 - 50 * np.cos(0.4 + 0.2 * T)),
    *(10 * np.cos(0.4 + 0.2 * T), 10 * np.sin(0.4 + 0.2 * T)),
    0.4 + 0.2 * T,
)

# Scenarios of each event; every expected hit is (track, other, first timestep, last timestep, value).
MOMENTS = {
    "closest_approach": [
        (moment("closest-hit", STANDING, who=walking(-10, 5, 2)), [("who", "ego", 50, 50, 5.0)]),
        (moment("closest-far", STANDING, who=walking(-10, 25, 2)), []),
    ],
    "minimum_gap": [
        (moment("gap-hit", STANDING, car=along(-20.25, 2.5, 5)), [("car", "ego", 33, 33, 0.5)]),
        (moment("gap-contact", STANDING, car=along(-20.25, 1.5, 5)), [("car", "ego", 33, 33, 0.0)]),
        (moment("gap-wide", STANDING, car=along(-20.25, 4, 5)), []),
    ],
    "time_to_collision": [
        (moment("ttc-hit", EGO, car=along(60.05, 0, seen=slice(0, 51))), [("car", "ego", 42, 50, 0.605)]),
        (
            moment("ttc-crossing", EGO, car=along(50, -52.55, 0, 10, seen=slice(0, 46))),
            [("car", "ego", 35, 45, 0.455)],
        ),
        (moment("ttc-beside", EGO, car=along(60.05, 3)), []),
        (moment("ttc-faster", EGO, car=along(10, 0, 11)), []),
        (moment("ttc-late", EGO, car=along(50, -80, 0, 10)), []),
    ],
    "near_miss": [
        (moment("miss-hit", EGO, car=along(60.05, 0, seen=slice(0, 51))), [("car", "ego", 47, 50, 0.605)]),
        (moment("miss-contact", EGO, car=along(60.05, 0)), []),
        (moment("miss-far", EGO, car=along(60.05, 0, seen=slice(0, 40))), []),
    ],
    "post_encroachment_time": [
        (moment("pet-hit", EGO, car=along(50, -70, 0, 10)), [("car", "ego", 50, 70, 1.4)]),
        (moment("pet-first", EGO, car=along(80, -50, 0, 10)), [("car", "ego", 50, 80, 2.4)]),
        (moment("pet-long", EGO, car=along(10, -98, 0, 10)), []),
        (moment("pet-beside", EGO, car=along(0, 3, 10)), []),
        (moment("pet-slanting", EGO, car=along(20, -10, 10, 2)), []),  # at 11 degrees
    ],
    "cut_in": [
        (moment("cut-hit", EGO, car=shifting(20, 3.5, 10, 0, 2.02, 3.5)), [("car", "ego", 31, 47, 16.0)]),
        (moment("cut-right", EGO, car=shifting(20, -3.5, 10, 0, 2.02, 3.5)), [("car", "ego", 31, 47, 16.0)]),
        (moment("cut-behind", EGO, car=shifting(-20, 3.5, 10, 0, 2.02, 3.5)), []),
        (moment("cut-beyond", EGO, car=shifting(60, 3.5, 10, 0, 2.02, 3.5)), []),
        (moment("cut-out", EGO, car=shifting(20, 0, 10, 3.5, 2.02, 3.5)), []),
        (moment("cut-back", EGO, car=shifting(20, 3.5, 10, 2.0, 2.02, 3.5)), []),  # over the marking, not beyond it
        (moment("cut-beside", EGO, car=along(20, 3.5, 10)), []),
        (moment("cut-crossing", EGO, car=along(60, -30, 0, 6)), []),
        (moment("cut-bend", going(0, 0, 10, 0.2), car=BEND), []),
    ],
    "hard_braking": [
        (moment("brake-hit", STANDING, car=braking(6.0)), [("car", None, 39, 61, 6.0)]),
        (moment("brake-soft", STANDING, car=braking(3.0)), []),
        (moment("brake-faster", STANDING, car=braking(-6.0, pace=5.0)), []),
    ],
    "hard_acceleration": [
        (moment("push-hit", STANDING, car=braking(-3.1, pace=5.0)), [("car", None, 39, 61, 3.1)]),
        (moment("push-soft", STANDING, car=braking(-2.0, pace=5.0)), []),
        (moment("push-slower", STANDING, car=braking(6.0)), []),
    ],
    "turn_left": [
        (moment("left-hit", STANDING, car=turning(0, 40, np.pi / 2)), [("car", None, 16, 55, 90.0)]),
        (moment("left-right", STANDING, car=turning(0, 40, -np.pi / 2)), []),
        (moment("left-bend", STANDING, car=turning(0, 40, np.pi / 5)), []),
        (moment("left-u", STANDING, car=turning(0, 40, np.pi)), []),
    ],
    "turn_right": [
        (moment("right-hit", STANDING, car=turning(0, 40, -np.pi / 2)), [("car", None, 16, 55, 90.0)]),
        (moment("right-left", STANDING, car=turning(0, 40, np.pi / 2)), []),
    ],
    "u_turn": [
        (moment("u-hit", STANDING, car=turning(0, 40, np.pi)), [("car", None, 16, 87, 180.0)]),
        (moment("u-left", STANDING, car=turning(0, 40, np.pi / 2)), []),
    ],
    "unprotected_left": [
        (
            moment("across-hit", FAR, car=turning(0, 0, np.pi / 2), other=along(50, 4, -10)),
            [("car", "other", 16, 55, 6.0)],
        ),
        (moment("across-alone", FAR, car=turning(0, 0, np.pi / 2)), []),
        (moment("across-parked", FAR, car=turning(0, 0, np.pi / 2), other=along(50, 4, heading=np.pi)), []),
        (moment("across-right", FAR, car=turning(0, 0, -np.pi / 2), other=along(50, 4, -10)), []),
        (moment("across-same", FAR, car=turning(0, 0, np.pi / 2), other=along(0, 4, 10)), []),
        (
            moment(
                "across-arrow",
                FAR,
                ROAD,
                [("out", None, shown((ARROW, 1)))],
                car=turning(0, 0, np.pi / 2),
                other=along(50, 4, -10),
            ),
            [],
        ),
        (
            moment(
                "across-green",
                FAR,
                ROAD,
                [("out", None, shown((GREEN, 1)))],
                car=turning(0, 0, np.pi / 2),
                other=along(50, 4, -10),
            ),
            [("car", "other", 16, 55, 6.0)],
        ),
    ],
    "stop_at_red": [
        (red("stop-hit", along(-4, 0), (RED, 71), (GREEN, 1), ego=FAR), [("car", None, 0, 70, 2.0)]),
        (red("stop-no-point", along(-4, 0), (RED, 71), (GREEN, 1), ego=FAR, stop=None), [("car", None, 0, 70, 2.0)]),
        (red("stop-green", along(-4, 0), (GREEN, 1), ego=FAR), []),
        (red("stop-short", along(-4, 0), (RED, 8), (GREEN, 1), ego=FAR), []),
        (red("stop-early", along(-15, 0), (RED, 1), ego=FAR), []),
        (red("stop-lane", along(-4, 3.5), (RED, 1), ego=FAR), []),
        (red("stop-oncoming", along(-4, 0, heading=np.pi), (RED, 1), ego=FAR), []),
        (red("stop-rolling", along(-14, 0, 1), (RED, 1), ego=FAR), []),
    ],
    "red_light_running": [
        (red("run-hit", along(-52.05, 0, 10), (RED, 1), ego=FAR), [("car", None, 50, 51, 10.0)]),
        (red("run-green", along(-52.05, 0, 10), (RED, 40), (GREEN, 1), ego=FAR), []),
        (red("run-lane", along(-52.05, 3.5, 10), (RED, 1), ego=FAR), []),
        (red("run-away", along(52.05, 0, -10), (RED, 1), ego=FAR), []),
        (red("run-stops", along(-8, 0, 0.5), (RED, 1), ego=FAR), []),
    ],
    "pedestrian_crossing": [
        (moment("walk-hit", along(0, 0, 5), who=walking(40, -3, 0, 1)), [("who", "ego", 13, 47, 14.5)]),
        (moment("walk-behind", along(0, 0, 5), who=walking(-10, -3, 0, 1)), []),
        (moment("walk-passed", along(0, 0, 5), who=walking(10, -9, 0, 1)), []),
        (moment("walk-along", along(0, 0, 5), who=walking(40, 1, 1)), []),
        (moment("walk-far", along(0, 0, 5), who=walking(90, -3, 0, 1)), []),
        (moment("walk-car", along(0, 0, 5), car=along(40, -3, 0, 1)), []),
    ],
    "following": [
        (moment("follow-hit", EGO, car=along(15, 0, 10)), [("ego", "car", 0, 100, 1.5)]),
        (moment("follow-nearest", EGO, car=along(15, 0, 10), next=along(25, 0, 10)), [("ego", "car", 0, 100, 1.5)]),
        (moment("follow-far", EGO, car=along(40, 0, 10)), []),
        (moment("follow-lane", EGO, car=along(15, 3.5, 10)), []),
        (moment("follow-behind", EGO, car=along(-15, 0, 10)), []),
        (moment("follow-short", EGO, car=along(15, 0, 10, seen=slice(0, 15))), []),
    ],
    "stationary_lead": [
        (moment("lead-hit", STANDING, car=along(10, 0)), [("ego", "car", 0, 100, 6.0)]),
        (moment("lead-lane", STANDING, car=along(10, 3.5)), []),
        (moment("lead-moving", STANDING, car=along(10, 0, 2)), []),
        (moment("lead-far", STANDING, car=along(40, 0)), []),
        (moment("lead-walker", STANDING, who=walking(10, 0)), []),
    ],
    "overtaking": [
        (moment("pass-hit", along(0, 0, 15), car=along(20.25, 3.5, 10)), [("ego", "car", 32, 49, 1.7)]),
        (moment("pass-other", EGO, car=along(-20.25, 3.5, 15)), [("car", "ego", 32, 49, 1.7)]),
        (moment("pass-parked", along(0, 0, 15), car=along(20.25, 3.5)), []),
        (moment("pass-oncoming", along(0, 0, 15), car=along(60, 3.5, -10)), []),
        (moment("pass-behind", along(0, 0, 15), car=along(40, 3.5, 12)), []),
        (moment("pass-far", along(0, 0, 15), car=along(20.25, 10, 10)), []),
    ],
    "lane_change": [
        (moment("lane-hit", shifting(0, 0, 5, 3.5, 4.02, 2), TWO_LANES), [("ego", None, 50, 51, 1.0)]),
        (moment("lane-right", shifting(0, 3.5, 5, 0, 4.02, 2), TWO_LANES), [("ego", None, 50, 51, -1.0)]),
        (moment("lane-on", along(0, 0, 10), TWO_LANES), []),
        (moment("lane-wobble", shifting(0, 0, 5, 1.5, 4.02, 2), TWO_LANES), []),
        (moment("lane-brief", shifting(0, 0, 5, 2.0, 9.0, 1), TWO_LANES), []),
        (moment("lane-unknown", shifting(0, 0, 5, 3.5, 4.02, 2), [*ROAD, lane("b", (-20, 3.5), (60, 3.5))]), []),
    ],
    "jaywalking": [
        (moment("jay-hit", FAR, [*ROAD, ZEBRA], who=walking(30, -5.05, 0, 1)), [("who", None, 36, 65, 2.9)]),
        (moment("jay-zebra", FAR, [*ROAD, ZEBRA], who=walking(12, -5.05, 0, 1)), []),
        (moment("jay-near", FAR, [*ROAD, ZEBRA], who=walking(15, -5.05, 0, 1)), []),
        (moment("jay-pavement", FAR, [*ROAD, ZEBRA], who=walking(0, 4, 1, 0)), []),
        (moment("jay-unknown", FAR, ROAD, who=walking(30, -5.05, 0, 1)), []),
        (moment("jay-car", FAR, [*ROAD, ZEBRA], car=along(30, -5.05, 0, 1)), []),
    ],
}


@pytest.fixture(scope="module")
def lake(tmp_path_factory) -> Lake:
    scenarios = [scenario for group in MOMENTS.values() for scenario, _ in group]
    return write_lake(tmp_path_factory.mktemp("moments"), scenarios)


@pytest.fixture(scope="module")
def found(lake) -> dict[str, pl.DataFrame]:
    return {name: lake.sql(EVENTS.load(name).text, EVENTS.load(name).defaults) for name in EVENTS.names()}


@pytest.mark.parametrize("name", EVENTS.names())
def test_exact_hits_are_found(name, found):
    assert found[name].columns == ["scenario_id", "track_id", "other_id", "first_timestep", "last_timestep", "value"]
    for scenario, wanted in MOMENTS[name]:
        rows = [row[1:] for row in found[name].rows() if row[0] == scenario.id]
        assert [row[:4] for row in rows] == [row[:4] for row in wanted], scenario.id
        tolerance = 1.0 if "turn" in name else 0.01
        assert [row[4] for row in rows] == pytest.approx([row[4] for row in wanted], abs=tolerance), scenario.id


def test_time_of_red_is_the_recorded_one(tmp_path):
    scenario = red("run-late", along(-52.05, 0, 10), (GREEN, 40), (RED, 1), ego=FAR)
    times = scenario.timestamps + np.where(np.arange(scenario.num_timesteps) > 45, 1.0, 0.0)  # frames were lost
    lake = write_lake(tmp_path, [replace(scenario, timestamps=times)])
    assert [len(lake.mine("red_light_running", {"min_red": least})) for least in (1.0, 2.0, 2.5)] == [1, 1, 0]


def test_every_event_has_hits_and_near_misses():
    assert set(MOMENTS) == set(EVENTS.names())
    for name, group in MOMENTS.items():
        assert any(wanted for _, wanted in group), name
        assert any(not wanted for _, wanted in group), name


@pytest.mark.parametrize("name", EVENTS.names())
def test_every_event_cites_its_source_and_uses_its_parameters(name):
    event = EVENTS.load(name)
    assert "Source: " in event.doc
    assert "value" in event.doc.lower()
    assert set(re.findall(r"\$(\w+)", event.text)) == set(event.defaults)


def test_columns_have_the_same_types_in_every_event(found):
    kinds = {name: tuple(rows.dtypes) for name, rows in found.items()}
    assert set(kinds.values()) == {(pl.String, pl.String, pl.String, pl.Int32, pl.Int32, pl.Float64)}, kinds


# --- queries ------------------------------------------------------------------------------------------------


def ids_of(name: str) -> list[str]:
    """Ids among the event's own scenarios in which it happens."""
    return sorted(scenario.id for scenario, wanted in MOMENTS[name] if wanted)


def test_mine_lists_hits_in_order_and_takes_parameters(lake):
    rows = lake.mine("cut_in")
    assert rows["scenario_id"].is_sorted()
    assert set(ids_of("cut_in")) <= set(rows["scenario_id"])
    assert lake.mine("cut_in", {"max_gap": 15}).is_empty()
    assert len(lake.mine("hard_braking", {"ego_only": True})) == 0
    own = lake.mine("closest_approach").sort("scenario_id", "first_timestep", "track_id", "other_id")
    assert own.equals(lake.mine("closest_approach"))
    with pytest.raises(UnknownEvent, match="cut_in"):
        lake.mine("cutin")
    with pytest.raises(BadParameter, match="max_gap"):
        lake.mine("cut_in", {"gap": 15})


def test_mine_searches_only_members_of_a_database(tmp_path):
    lake = write_lake(tmp_path, [scenario for scenario, _ in MOMENTS["cut_in"]])
    hits = lake.mine("cut_in")
    one = lake.filter("scenario_id = $id", name="one", parameters={"id": hits["scenario_id"][0]})
    assert lake.mine("cut_in", database="one").equals(hits.head(1))
    assert lake.mine("cut_in", database=one).equals(hits.head(1))
    lake.filter("scenario_id <> ALL ($ids)", name="none", parameters={"ids": hits["scenario_id"].to_list()})
    assert lake.mine("cut_in", database="none").is_empty()


def test_condition_with_lake_wide_aggregate_combines_with_an_event(tmp_path):
    lake = write_lake(tmp_path, [scenario for name in ("cut_in", "following") for scenario, _ in MOMENTS[name]])
    below = "ego_distance <= (SELECT median(ego_distance) FROM metadata) AND difficulty_level(2) = 1"
    below_in_turn = set(lake.filter(below, name="below").scenario_ids)
    found = lake.filter(below, name="found", events=["closest_approach:max=1000"])
    assert set(found.scenario_ids) == below_in_turn
    assert lake.rebuild("found").is_same


@pytest.mark.long
def test_filter_keeps_scenarios_in_which_an_event_happens(tmp_path):
    lake = write_lake(tmp_path, [scenario for name in ("cut_in", "following") for scenario, _ in MOMENTS[name]])
    found = lake.filter("ego_distance > 10", name="cut", events=["cut_in"])
    assert found.scenario_ids == ids_of("cut_in")
    assert "cut-in" not in found.lineage.sql  # comments of the SQL file are not copied
    assert found.lineage.parameters == {"f0_max_gap": 30.0, "f0_min_speed": 2.0, "f0_within": 4.0}
    assert lake.rebuild("cut").is_same
    both = lake.filter(
        "true", name="both", database="cut", filters=["ego_distance:min=1"], events=["cut_in:max_gap=20", "following"]
    )
    assert set(both.scenario_ids) <= set(ids_of("cut_in"))
    assert both.lineage.parameters["f1_max_gap"] == 20.0
    assert lake.rebuild("both").is_same
    with pytest.raises(UnknownEvent):
        lake.filter(name="x", events=["nothing"])
    with pytest.raises(QueryError, match="no column"):
        lake.filter("ego_distanse > 1", name="x", events=["cut_in"])


@pytest.mark.parametrize("name", EVENTS.names())
def test_an_empty_lake_has_no_hits(name, empty_lake):
    assert empty_lake.mine(name).is_empty()


@pytest.mark.long
def test_events_run_on_generated_scenarios(tmp_path):
    """Every event runs on generated scenarios, and some find hits."""
    convert("pg", "0:6", tmp_path)
    lake = Lake(tmp_path)
    counts = {name: len(lake.mine(name)) for name in EVENTS.names()}
    assert counts["closest_approach"] > 0
    assert counts["following"] + counts["stationary_lead"] > 0
    assert counts["turn_left"] + counts["turn_right"] > 0
    assert counts["minimum_gap"] >= lake.sql("SELECT count(*) FROM metadata WHERE min_ego_gap <= 1").item()


@pytest.mark.long
def test_events_run_on_recorded_scenarios(recordings, tmp_path):
    sources = {
        "waymo": "waymo/training",
        "argoverse2": "argoverse2/motion-forecasting/val",
        "scenarionet": "scenarionet",
    }
    for dataset, folder in sources.items():
        convert(dataset, str(recordings / folder), tmp_path)
    lake = Lake(tmp_path)
    counts = {name: len(lake.mine(name)) for name in EVENTS.names()}
    assert counts["stop_at_red"] > 0
    assert counts["turn_left"] > 0
    assert counts["pedestrian_crossing"] > 0
    gaps = lake.sql("SELECT scenario_id, min_ego_gap FROM metadata WHERE min_ego_gap <= 1 ORDER BY 1")
    mined = lake.mine("minimum_gap").group_by("scenario_id").agg(pl.col("value").min()).sort("scenario_id")
    assert mined["scenario_id"].to_list() == gaps["scenario_id"].to_list()
    assert mined["value"].to_list() == pytest.approx(gaps["min_ego_gap"].to_list(), abs=1e-4)
