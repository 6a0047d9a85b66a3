"""The lane that an object is on, as columns of states and objects."""

from __future__ import annotations

import pytest

from scenarionet_data.errors import QueryError
from tests.fixtures.lakes import write_lake
from tests.fixtures.moments import T, along, lane, moment

LANES = (lane("south", (-100, 0), (400, 0)), lane("north", (-100, 3.5), (400, 3.5)))


@pytest.fixture(scope="module")
def lake(tmp_path_factory):
    scenario = moment(
        "lanes", along(0, 0.5, 10), LANES, beside=along(0, 3.25, 10, source_type="bus"), meadow=along(0, 40, 10)
    )
    return write_lake(tmp_path_factory.mktemp("lanes") / "lake", [scenario])


@pytest.mark.parametrize(("view", "rows"), [("states", len(T)), ("objects", 1)])
def test_lane_and_offset(view, rows, lake):
    found = lake.sql(f"SELECT track_id, lane_id, lane_type, lane_offset, source_type FROM {view}")
    assert len(found) == 3 * rows
    for track, lane_id, offset, kind in (("ego", "south", 0.5, None), ("beside", "north", -0.25, "bus")):
        mine = found.filter(track_id=track)
        assert set(mine["lane_id"]) == {lane_id} and set(mine["lane_type"]) == {"VEHICLE"}
        assert set(mine["source_type"]) == {kind}
        assert mine["lane_offset"].to_list() == pytest.approx([offset] * rows, abs=1e-4)
    away = found.filter(track_id="meadow")
    assert away["lane_id"].null_count() == away["lane_offset"].null_count() == rows


def test_columns_of_lanes_are_there_when_they_are_named(lake):
    """They come and go with the queries of one connection; views that use states go on working."""
    assert "lane_id" not in lake.sql("SELECT * FROM states").columns
    assert len(lake.sql("SELECT * FROM ego_pairs")) == 2 * len(T)
    assert "lane_id" in lake.sql("SELECT * FROM states WHERE lane_id IS NOT NULL").columns
    assert len(lake.sql("SELECT * FROM ego_pairs")) == 2 * len(T)
    joined = "FROM states JOIN object_lanes AS l USING (scenario_id, track_id, timestep)"
    assert lake.sql(f"SELECT count(DISTINCT states.lane_id) {joined}").item() == 2
    lights = "SELECT count(*) FROM objects LEFT JOIN lights USING (scenario_id) WHERE lights.lane_id IS NULL"
    assert lake.sql(lights).item() == 3  # the lane of a light
    assert "lane_id" not in lake.sql("SELECT 'lane_id' AS word, * FROM states").columns  # no column, but a text
    with pytest.raises(QueryError):
        lake.sql("SELECT lane_number FROM states")
