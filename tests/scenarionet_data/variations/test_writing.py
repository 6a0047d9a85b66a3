"""Variations in a lake: lineage, repetition, and reasons of what cannot be."""

from __future__ import annotations

import re
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from scenarionet_data import Lake, ScenarioLoader
from scenarionet_data.errors import BadParameter, DuplicateScenario, InvalidScenario
from scenarionet_data.operations.moments import event
from scenarionet_data.variations import VariationSpace, variations_of, vary
from tests.fixtures.drives import Other, make_drive
from tests.fixtures.lakes import content, write_lake

PARENTS = [replace(make_drive(f"d{k}", others=(Other(20.0, vx=8.0),)), current_timestep=10) for k in range(2)]
PARAMETERS = {"t1.gap": "-20:10", "ego.speed": "0.9:1.1"}


@pytest.fixture
def lake(tmp_path) -> Lake:
    return write_lake(tmp_path / "lake", PARENTS)


def test_variations_are_scenarios_with_lineage(lake):
    report = vary(lake, PARENTS[0].id, VariationSpace(PARAMETERS, 30), name="v")
    assert report.converted + report.quarantined == 30 and 0 < report.quarantined < 20
    rows = Lake(lake.root).sql(
        "SELECT scenario_id, parent, parameter(extras, 't1.gap') AS gap, split "
        "FROM metadata WHERE dataset = 'variation'"
    )
    assert len(rows) == report.converted and set(rows["parent"]) == {PARENTS[0].id}
    assert set(rows["split"]) == {PARENTS[0].split}
    for each in rows.head(5).iter_rows(named=True):
        made = Lake(lake.root).loader([each["scenario_id"]])[0]
        assert made.tracks.position[1, 10, 0] == pytest.approx(28 + each["gap"], abs=1e-3)
    assert made.version == "v" and len(made.map) == len(PARENTS[0].map)
    reasons = Lake(lake.root).sql("SELECT field, count(*) AS n FROM quarantine GROUP BY 1").rows()
    assert reasons == [("contact", report.quarantined)]


def test_the_same_seed_makes_the_same_files_and_more_are_added(lake, tmp_path):
    ids = [each.id for each in PARENTS]
    vary(lake, ids, VariationSpace(PARAMETERS, 3, seed=1), name="v")
    other = write_lake(tmp_path / "other", PARENTS)
    vary(other, ids, VariationSpace(PARAMETERS, 3, seed=1), name="v")
    assert content(lake.root) == content(other.root)
    again = vary(lake, ids, VariationSpace(PARAMETERS, 3, seed=1), name="v")
    assert (again.converted, again.skipped) == (0, 1)
    more = vary(lake, ids, VariationSpace(PARAMETERS, 5, seed=1), name="v")
    assert more.converted + more.quarantined == 4
    with pytest.raises(DuplicateScenario, match="has changed since"):
        vary(lake, ids, VariationSpace(PARAMETERS, 3, seed=2), name="v")


def test_moments_say_who_acts_and_when(tmp_path):
    """t1 begins at 25 m and is 8 m/s slower than 10: less than 16 m from box to box until 4 s, from 4.6/8 s on."""
    lake = write_lake(tmp_path / "lake", [make_drive("m", others=(Other(20.6, vx=2.0), Other(80.0, y=3.5)))])
    lake.keep_moments("near", {"closing": event("time_to_collision", {"max": 1.5})})
    (moment,) = lake.sql("SELECT * FROM moments WHERE name = 'near'").rows(named=True)
    assert {moment["track_id"], moment["other_id"]} == {"t0", "t1"}
    follower, leader = moment["track_id"], moment["other_id"]
    space = VariationSpace({"actor.size": 0.9, "other.size": "0.8,0.9"}, 4, margin=0.3)
    report = vary(lake, "moments:near", space, name="v")
    assert report.converted == 4 and vary(lake, "moments:near", space, name="v").converted == 0
    made = lake.refresh().loader(
        lake.refresh().sql("SELECT scenario_id FROM metadata WHERE parent IS NOT NULL").to_series()
    )
    for each in made:
        assert each.current_timestep == 3 and each.timestamps[0] == 0
        assert each.num_timesteps == min(moment["last_timestep"] + 3, 40) - moment["first_timestep"] + 4
        sizes = {track: each.tracks.size[each.tracks.index(track), 3, 0] / np.float32(4.6) for track in ("t0", "t1")}
        assert sizes[follower] == pytest.approx(0.9, abs=1e-3) and sizes[leader] < 0.91
        assert each.tracks.position[0, 3, 0] == pytest.approx(moment["begins"] * 10, abs=1e-3)
    with pytest.raises(BadParameter, match=r"no moments are kept under this name.*there are: near"):
        vary(lake, "moments:far", space, name="w")


def test_the_example_of_the_guide_runs(lake, monkeypatch):
    monkeypatch.chdir(lake.root.parent)
    lake.filter(name="cut_ins")
    page = (Path(__file__).parents[3] / "docs" / "guides" / "variations.md").read_text("utf-8")
    example, on_the_fly, at_reset = re.findall(r"```python\n(.*?)```", page, re.DOTALL)
    example = example.replace("number=1000", "number=4").replace("-3:3", "-1:1")
    names: dict[str, object] = {}
    exec(example, names)
    assert names["report"].converted == 8
    exec(on_the_fly, names)
    assert len(names["simulation"].batch) == len(names["worlds"]) == 8
    exec(at_reset, names)
    assert re.fullmatch(rf"{PARENTS[0].id[:-1]}[01]@0\d{{5}}", names["info"]["scenario_id"])
    names["env"].close()


def test_variations_without_a_lake_are_those_that_are_stored(lake):
    parent = ScenarioLoader(lake, [PARENTS[0].id])[0]
    space = VariationSpace(PARAMETERS | {"road.friction": "0.2:0.8", "ego.speed": "0.9:2.5"}, number=12)
    vary(lake, parent.id, space, name="stored")
    ids = Lake(lake.root).sql("SELECT scenario_id FROM metadata WHERE version = 'stored' ORDER BY 1")["scenario_id"]
    stored = {each.extras["parameters"]["ego.speed"]: each for each in ScenarioLoader(Lake(lake.root), ids)}
    made = [each for each in variations_of(parent, space) if not isinstance(each, InvalidScenario)]
    assert 0 < len(made) == len(stored) < 12, "what cannot be is told"
    for each in made:
        same = stored[each.extras["parameters"]["ego.speed"]]
        assert each.extras == same.extras and 0.2 <= each.extras["friction"] <= 0.8
        np.testing.assert_array_equal(each.tracks.position, same.tracks.position)
        np.testing.assert_array_equal(each.tracks.valid, same.tracks.valid)
    assert len({each.id for each in made}) == len(made)


def test_bad_input_is_a_sentence(lake):
    with pytest.raises(BadParameter, match=r"road.friction=0:1 gives 0; friction is a factor above 0"):
        VariationSpace({"road.friction": (0, 1)})
    with pytest.raises(BadParameter, match=r"or lights\.start, road\.friction"):
        VariationSpace({"ego.friction": 0.5})
    with pytest.raises(InvalidScenario, match="wanted a track 't9'"):
        vary(lake, PARENTS[0].id, VariationSpace({"t9.gap": 1}), name="v")
    with pytest.raises(BadParameter, match="use letters"):
        vary(lake, PARENTS[0].id, VariationSpace(PARAMETERS), name="a b")
    with pytest.raises(BadParameter, match="a variation changes something"):
        vary(lake, PARENTS[0].id, VariationSpace({}), name="v")
