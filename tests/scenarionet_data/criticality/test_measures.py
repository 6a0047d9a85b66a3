"""Each measure in a case that is computed by hand."""

from __future__ import annotations

import math
from statistics import NormalDist

import numpy as np
import pytest

from scenarionet_data.criticality import LEFT_OUT, MEASURES, Assumptions, criticality
from scenarionet_data.errors import BadParameter
from scenarionet_data.operations.moments import relation
from tests.fixtures.lakes import write_lake
from tests.fixtures.moments import T, along, crosswalk, going, lane, moment

ROAD = lane("road", (-100, 0), (400, 0))
MASS = Assumptions().mass


def value(scenario, measure, step=0, other="other"):
    """The ego's criticality to another object at a step."""
    rows = criticality(scenario, [measure])
    return rows.filter(other_id=other, timestep=step)[measure].item()


def approach(name="approach", y=0.0, speed=20.0, features=(ROAD,)):
    """20 m/s behind a car 46.5 m ahead that drives 10 m/s."""
    return moment(name, along(0, 0, speed), features, other=along(50.5, y, 10))


@pytest.mark.parametrize(
    ("measure", "expected"),
    [
        ("hw", 50.5 - 2 - 2),
        ("thw", 2.4),  # the front is at 48.5 m after 2.325 s
        ("ttc", 4.65),
        ("pttc", (-10 + math.sqrt(10**2 + 2 * 8 * 46.5)) / 8),
        ("dst", 3 * 10**2 / (2 * (46.5 - 2 * 10))),
        ("a_long_req", -(10**2) / (2 * 46.5)),
        ("a_lat_req", 2 * 2 / 4.65**2),  # half the widths of both are 2 m
        ("a_req", math.hypot(10**2 / (2 * 46.5), 2 * 2 / 4.65**2)),
        ("btn", 10**2 / (2 * 46.5) / 11.5),
        ("stn", 2 * 2 / 4.65**2 / 8),
        ("tet", 2.0),  # from 2.7 to 4.6 s
        ("tit", sum(0.1 * (2 - (4.65 - 0.1 * k)) for k in range(27, 47))),
        ("msd", 20**2 / (2 * 11.5)),
        ("dce", 0.0),
        ("ttce", 4.7),
        ("ttc_star", 4.7),
        # Discs of 1.202 m: 50.5 - 10 t = 2.404 + 11.5 t^2
        ("wttc", (-10 + math.sqrt(100 + 4 * 11.5 * (50.5 - 2 * math.hypot(2 / 3, 1)))) / 23),
        ("delta_v", 5.0),
        ("long_jerk", 0.0),
        ("lat_jerk", 0.0),
        # 46.5 m; needed: 20 + 3.5 / 2 + 23.5^2 / 8 - 10^2 / 16 = 84.5 m
        ("rss", 1.0),
    ],
)
def test_one_behind_another(measure, expected):
    assert value(approach(), measure) == pytest.approx(expected, abs=1e-5)


@pytest.mark.parametrize(
    ("measure", "expected"),
    [("hw", np.inf), ("ttc", np.inf), ("thw", np.inf), ("pttc", np.inf), ("dst", 0.0), ("a_req", 0.0), ("cpi", 0.0),
     ("tet", 0.0), ("rss", 0.0), ("ttb", np.inf), ("ttr", np.inf)],
)  # fmt: skip
def test_one_behind_is_no_conflict(measure, expected):
    assert value(moment("behind", along(0, 0, 20), (ROAD,), other=along(-50, 0, 10)), measure) == expected


def test_one_that_brakes_is_met_earlier():
    """40 m ahead at the same speed, braking with 2 m/s^2: 40 = t^2; measured at a step inside, where both are known."""
    braking = going(44, 0, lambda t: 12 - 2 * np.minimum(t, 5))
    scenario = moment("braking", along(0, 0, 12), (ROAD,), other=braking)
    gap = 40 - 0.1**2
    assert value(scenario, "ttc", 1) == pytest.approx((-0.2 + math.sqrt(0.2**2 + 4 * gap)) / 2, abs=1e-3)
    assert value(scenario, "a_long_req", 1) == pytest.approx(-2 - 0.2**2 / (2 * gap), abs=1e-3)


def test_crash_potential_is_the_mean_over_all_later_steps():
    madr = NormalDist(8.45, 1.40)
    low, high = madr.cdf(4.23), madr.cdf(12.68)
    needed = [100 / (2 * (46.5 - k)) for k in range(47) if k <= 46]
    shares = [(madr.cdf(min(each, 12.68)) - low) / (high - low) for each in needed if each > 4.23]
    assert len(shares) > 5
    assert value(approach(), "cpi") == pytest.approx(sum(shares) / (len(T) - 1), abs=1e-5)


def test_jerk_is_along_and_across_the_lane():
    """Speed 10 + t^2 / 2 along x, on a lane that turns away from it by 0.1 m a metre."""
    scenario = moment(
        "jerk", going(0, 0, lambda t: 10 + t**2 / 2), (lane("road", (-100, -10), (400, 40)),), other=along(90, 9, 0)
    )
    assert value(scenario, "long_jerk", 10) == pytest.approx(1 / math.hypot(1, 0.1), abs=1e-3)
    assert value(scenario, "lat_jerk", 10) == pytest.approx(0.1 / math.hypot(1, 0.1), abs=1e-3)


@pytest.mark.parametrize(("y", "expected"), [(0.0, 39), (2.7, 39), (3.0, 0)])
def test_personal_space(y, expected):
    """29.156 m of braking from 72 km/h and 2 m ahead, half a metre behind, as wide as the lane of 3.5 m.

    The middles are apart by 50.3 - 10 t m: from 35.156 m, after 1.6 s, until -4.5 m, after 5.4 s.
    """
    scenario = moment("space", along(0, 0, 20), (ROAD,), other=along(50.3, y, 10))
    assert value(scenario, "soi") == expected


def test_crosswalk():
    """Its middle is 60 m ahead of the middle of the car."""
    scenario = approach("crosswalk", features=(ROAD, crosswalk("zebra", 58, -5, 62, 5)))
    assert value(scenario, "ttz") == pytest.approx((60 - 2) / 20, abs=1e-5)
    assert value(approach(), "ttz") == np.inf


@pytest.mark.parametrize(
    ("measure", "expected"),
    [
        # The lanes cross from 98.25 to 101.75 m: the car is at 96 m before, and at 104 m after.
        ("et", 0.4),
        ("pet", (76 - 52) * 0.1),  # the other is 4 m before the lane after 7.6 s, and its front in it 0.1 s later
        ("ags", (76 - 48) * 0.1),
        ("psd", 96 / (20**2 / 23)),
        # Half of the energy remains, since both weigh the same and are at a right angle.
        ("ci", math.exp(-2.4) * 0.5 * 0.5 * MASS * (20**2 + 10**2)),
    ],
)
def test_crossing(measure, expected):
    lanes = (ROAD, lane("side", (100, -100), (100, 100)))
    scenario = moment("crossing", along(0, 0, 20), lanes, other=along(100, -80, 0, 10))
    assert value(scenario, measure) == pytest.approx(expected, rel=1e-6)
    alone = moment("parallel", along(0, 0, 20), lanes, other=along(50.5, 0, 10))
    assert value(alone, measure) == (0.0 if measure == "ci" else np.inf)


def test_lanes_that_follow_each_other_do_not_conflict():
    lanes = (
        lane("road", (-100, 0), (100, 0), exit_lanes=["next"]),
        lane("next", (95, 0), (400, 0), entry_lanes=["road"]),
    )
    assert value(moment("next", along(0, 0, 20), lanes, other=along(50.5, 0, 10)), "pet") == np.inf


def braked(speed, start):
    """Whether a car at 46.5 m and 10 m/s is hit by one that brakes from a step on."""
    place, accel = speed * 0.1 * start, 0.0
    for step in range(start, len(T)):
        if place + 4 >= 50.5 + step:
            return True
        accel = max(accel - 2.5, -8.0)
        new = speed + accel * 0.1
        if new < 0.2:
            return any(place + 4 >= 50.5 + later for later in range(step + 1, len(T)))
        place, speed = place + speed * 0.1 + accel * 0.005, new
    return False


def test_brake_and_the_other_manoeuvres():
    latest = max(start for start in range(47) if not braked(20.0, start))
    assert 30 < latest < 45
    assert value(approach(), "ttb") == pytest.approx(0.1 * latest)
    assert value(approach(), "ttb", 46) == -np.inf  # too late
    assert value(approach(), "ttk") == -np.inf  # faster into the one ahead
    assert value(approach(), "tts") == -np.inf  # 0.8 m to a side are not enough to pass 2 m
    assert value(approach(), "ttr") == value(approach(), "ttb")


def test_kickdown_gets_away_in_time():
    """A car comes from the side: 1 s later it would pass behind."""
    scenario = moment("kickdown", along(0, 0, 10), (ROAD,), other=along(51, -56, 0, 10))
    assert value(scenario, "ttc_star") > 4
    assert 0 < value(scenario, "ttk") < value(scenario, "ttc_star")


@pytest.mark.parametrize("side", [1, -1])
def test_steering_passes_one_at_the_edge(side):
    """It overlaps the car's way by 0.4 m: steering 0.8 m away passes, and braking begins earlier than that must."""
    scenario = approach("edge", y=-1.6 * side)
    assert value(scenario, "ttb") < value(scenario, "tts") < value(scenario, "ttc_star")
    assert value(scenario, "ttr") == value(scenario, "tts")


def test_off_the_lanes_nothing_along_them_is_known():
    scenario = moment("meadow", along(0, 80, 20), (ROAD,), other=along(50, 80, 10))
    assert np.isnan([value(scenario, name) for name in ("hw", "ttc", "a_long_req", "msd", "rss")]).all()
    assert value(scenario, "wttc") > 0 and value(scenario, "delta_v") == pytest.approx(5)


def test_gaps_and_ends_of_tracks():
    """The other is not seen from 1 to 2 s, and ends at 3 s: no rows there, and nothing of later."""
    scenario = moment("gap", along(0, 0, 20), (ROAD,), other=along(50.5, 0, 10, seen=slice(0, 31)))
    rows = criticality(scenario)
    assert rows["timestep"].to_list() == list(range(31))
    assert value(scenario, "dce") == pytest.approx(50.5 - 30 - 4, abs=1e-5)
    assert value(scenario, "ttc_star") == np.inf
    assert value(scenario, "tet") == pytest.approx(0.4)  # 2.7, 2.8, 2.9 and 3.0 s


def test_every_measure_is_of_every_pair():
    rows = criticality(approach(), objects=["ego", "other"])
    assert rows.columns == ["scenario_id", "track_id", "other_id", "timestep", *MEASURES]
    assert len(rows) == 2 * len(T)
    assert {measure.worst for measure in MEASURES.values()} == {"min", "max"}


def test_moments_get_the_worst_value(tmp_path):
    lake = write_lake(tmp_path, [approach(), moment("free", along(0, 0, 20), (ROAD,), other=along(50, 0, 30))])
    near = relation("near_objects", {"distance_thresh": 20.0}).lasting()
    found = lake.measure_moments(lake.moments(near).filter(track_id="ego"), ["ttc", "btn"])
    (row,) = found.to_dicts()
    assert row["ttc"] == pytest.approx(0.05, abs=1e-4)
    assert row["btn"] == pytest.approx(100 / (2 * 0.5) / 11.5, rel=1e-3)
    alone = lake.measure_moments(found.select("scenario_id", "track_id", "first_timestep", "last_timestep"), ["ttc"])
    assert alone["ttc"].to_list() == found["ttc"].to_list()
    assert len(lake.criticality(["ttc"])) == 2 * len(T)
    with pytest.raises(BadParameter, match="a column ttc already"):
        lake.measure_moments(found, ["ttc"])


@pytest.mark.parametrize(
    ("names", "message"),
    [
        (["tcc"], "no measure 'tcc'; there are hw"),
        (["p_mc"], "no measure 'p_mc': it samples"),
        ("ttc", r"write \['ttc'\]"),
    ],
)
def test_what_is_no_measure_is_refused(names, message):
    with pytest.raises(BadParameter, match=message):
        criticality(approach(), names)
    assert not set(LEFT_OUT) & set(MEASURES)
