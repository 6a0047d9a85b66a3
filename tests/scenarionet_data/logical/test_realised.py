"""Concrete scenarios have the parameters that were asked, measured by the events and views of the lake."""

from __future__ import annotations

import pytest

from scenarionet_data import Lake, convert

_STATES = "SELECT scenario_id, speed FROM states WHERE timestep = 50 AND track_id = "
MEASURED = {
    "cut_in": {
        "ego_speed": "SELECT scenario_id, ego_mean_speed FROM metadata",
        "gap": "cut_in",
        "slower": "SELECT scenario_id, -v_ahead FROM ego_pairs WHERE timestep = 40 AND track_id = 'cutter'",
    },
    "cut_out": {
        "headway": "SELECT scenario_id, headway FROM ego_leads WHERE timestep = 0 AND track_id = 'leaver'",
        "reveal": "SELECT scenario_id, b.x - a.x - 4.6 FROM states a JOIN states b USING (scenario_id, timestep) "
        "WHERE timestep = 40 AND a.track_id = 'leaver' AND b.track_id = 'obstacle'",
    },
    "deceleration": {
        "headway": "SELECT scenario_id, headway FROM ego_leads WHERE timestep = 0",
        "deceleration": "hard_braking",
    },
    "crossing_pedestrian": {"walking_speed": f"{_STATES} 'pedestrian'", "clear": "post_encroachment_time"},
    "oncoming_left_turn": {"oncoming_speed": f"{_STATES} 'oncoming'", "clear": "post_encroachment_time"},
}
"""Event, or query, that measures the size of each parameter."""


@pytest.fixture(scope="module")
def lake(tmp_path_factory) -> Lake:
    root = tmp_path_factory.mktemp("logical") / "lake"
    for name in MEASURED:
        report = convert("logical", name, root, options={"number": 24})
        assert (report.converted, report.quarantined) == (24, 0)
    return Lake(root)


@pytest.mark.parametrize(("name", "parameter"), [(name, each) for name, all_of in MEASURED.items() for each in all_of])
def test_realised_parameters_are_those_asked(lake, name, parameter):
    measure = MEASURED[name][parameter]
    if measure.startswith("SELECT"):
        rows = lake.sql(measure).rows()
    else:
        rows = (
            lake.mine(measure, {"min": 1.0} if measure == "hard_braking" else None)
            .select("scenario_id", "value")
            .rows()
        )
    found = dict(rows)
    asked = lake.sql(
        f"SELECT scenario_id, abs(parameter(extras, '{parameter}')) FROM metadata "
        f"WHERE extras ->> '$.parent' = 'logical/{name}'"
    ).rows()
    pairs = [(found[key], value) for key, value in asked if key in found]
    assert len(asked) == 24 and len(pairs) >= 22
    # In a bend the event takes the ego's path as straight over 2 m, and speeds of walking are stored to 1 mm/s.
    tolerance = {"abs": 0.3} if (name, parameter) == ("oncoming_left_turn", "clear") else {"rel": 0.02}
    for measured, wanted in pairs:
        assert measured == pytest.approx(wanted, **tolerance)
