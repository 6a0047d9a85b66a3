"""Runs of other simulators: motion in place of the recording, in cases where the metrics are known."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from scenarionet_data import Lake, ScenarioDescription
from scenarionet_data.errors import BadParameter
from scenarionet_data.scenario.description import strings
from scenarionet_sim.evaluation.adding import AddedRun, add_run
from scenarionet_sim.evaluation.evaluation import evaluate
from tests.fixtures.drives import Other, make_drive
from tests.fixtures.lakes import write_lake

pytestmark = pytest.mark.integration

RECORDED = [make_drive(f"d{k}", speed=8.0 + k, others=(Other(25.0, vx=4.0), Other(60.0, 3.5))) for k in range(3)]


def output_of(scenario: ScenarioDescription, ending: str = "fcd.xml", **changes) -> ScenarioDescription:
    """A scenario as another simulator played it, with other values of its tracks."""
    file = f"{scenario.id.replace('/', '--')}.{ending}"
    return replace(
        scenario,
        id=f"sumo/v1/{file}",
        dataset="sumo",
        source=replace(scenario.source, scenario_id=file.removesuffix(".xml"), file=file),
        tracks=replace(scenario.tracks, **changes),
    )


@pytest.fixture
def lake(tmp_path) -> Lake:
    return write_lake(tmp_path / "lake", RECORDED)


def add(lake: Lake, *outputs: ScenarioDescription, name: str = "theirs") -> AddedRun:
    return add_run(lake, write_lake(lake.root.parent / f"output-{name}", outputs), name)


def rows(lake: Lake, run: str, *columns: str) -> list[tuple]:
    wanted = ", ".join(columns) if columns else "* EXCLUDE (run, is_reactive)"
    return lake.sql(f"SELECT {wanted} FROM results WHERE run = $run ORDER BY scenario_id", {"run": run}).rows()


def test_the_recording_itself_measures_as_a_replay(lake):
    evaluate(lake, policy="replay", name="replay")
    found = add(lake, *map(output_of, RECORDED))
    assert (found.scenarios, found.unknown_objects, found.broken) == (3, 0, [])
    assert rows(lake, "theirs") == rows(lake, "replay")
    moved = "SELECT * EXCLUDE (run) FROM rollouts WHERE run = $run ORDER BY scenario_id, track_id"
    assert lake.sql(moved, {"run": "theirs"}).equals(lake.sql(moved, {"run": "replay"}))


def test_an_ego_beside_its_path_is_out_of_road(lake):
    position = RECORDED[0].tracks.position.copy()
    position[0, 10:, 1] += 4.0
    add(lake, output_of(RECORDED[0], position=position))
    assert rows(lake, "theirs", "scenario_id", "out_of_road", "success") == [("made/v1/d0", True, False)]
    (displacement,) = rows(lake, "theirs", "final_displacement")[0]
    assert displacement == pytest.approx(4.0)


def test_an_ego_that_ends_early_stands_there(lake):
    names = "valid", "position", "heading", "velocity", "size"
    ended = {name: getattr(RECORDED[0].tracks, name).copy() for name in names}
    for values in ended.values():
        values[0, 21:] = 0  # of 41: 2 s at 8 m/s, then 2 s standing
    add(lake, output_of(RECORDED[0], **ended))
    ((displacement, speed, is_successful),) = rows(lake, "theirs", "final_displacement", "mean_speed", "success")
    assert (displacement, speed, is_successful) == (pytest.approx(16.0), pytest.approx(4.0, rel=0.06), False)


def test_others_move_as_in_the_output_or_as_recorded(lake):
    output = output_of(RECORDED[0])
    kept = np.array([0, 1])
    tracks = replace(output.tracks, **{name: getattr(output.tracks, name)[kept] for name in vars(output.tracks)})
    position = tracks.position.copy()
    position[1, :, 0] = 10.0  # stands in the way
    add(lake, replace(output, tracks=replace(tracks, position=position, velocity=0 * tracks.velocity)))
    assert rows(lake, "theirs", "crashed") == [(True,)]
    seen = "SELECT x FROM rollouts WHERE run = 'theirs' AND track_id = $track"
    assert set(lake.sql(seen, {"track": "t1"})["x"][0][:41]) == {10.0}
    assert set(lake.sql(seen, {"track": "t2"})["x"][0][:41]) == {60.0}


def test_names_as_formats_change_them(tmp_path):
    named = replace(RECORDED[0].tracks, ids=strings(["ego:0", "a b", "t2"]))
    recorded = replace(RECORDED[0], ego_id="ego:0", tracks=named)
    lake = write_lake(tmp_path / "lake", [recorded])
    output = output_of(recorded, ids=strings(["ego_0", "a_b", "strange"]))
    found = add(lake, replace(output, ego_id="strange"))
    assert found.unknown_objects == 1
    assert rows(lake, "theirs", "track_id", "success") == [("ego:0", True)]


def test_an_ego_with_an_id_of_its_own(lake):
    ids = strings(["problem", "t1", "t2"])
    found = add(lake, replace(output_of(RECORDED[0], ids=ids), ego_id="problem"))
    assert found.unknown_objects == 0
    assert rows(lake, "theirs", "success") == [(True,)]


def test_the_frame_is_that_of_the_source(tmp_path):
    origin = np.array([1000.0, -500.0, 0.0])
    recorded = replace(RECORDED[0], origin=origin)
    lake = write_lake(tmp_path / "lake", [recorded])
    moved = np.array([7.0, 3.0, 0.0], np.float32)
    shifted = output_of(recorded, position=RECORDED[0].tracks.position + moved)
    add(lake, replace(shifted, origin=origin - moved))
    assert rows(lake, "theirs", "final_displacement") == [(0.0,)]
    found = add(lake, replace(output_of(recorded), origin=np.zeros(3)), name="elsewhere")
    assert [scenario_id for scenario_id, _ in found.broken] == ["made/v1/d0"]
    assert "the ego begins 1118.0 m from where it was recorded" in found.broken[0][1]
    assert rows(lake, "elsewhere", "success") == [(None,)]


def test_a_longer_output_can_still_arrive(lake):
    slow = make_drive("d0", speed=6.0, num_steps=56, others=(Other(25.0, vx=4.0), Other(60.0, 3.5)))
    add(lake, output_of(replace(slow, id=RECORDED[0].id)))
    ((completion, steps),) = rows(lake, "theirs", "route_completion", "steps")
    assert completion > 0.95 and 50 <= steps <= 55


def test_other_scenarios_are_named_and_of_two_of_one_neither_is_chosen(lake, tmp_path):
    stray = make_drive("stray")
    found = add(lake, output_of(RECORDED[1]), output_of(stray))
    assert found.unknown_scenarios == ["sumo/v1/made--v1--stray.fcd.xml"]
    with pytest.raises(BadParameter, match="name each file after the exported scenario"):
        add(lake, output_of(stray), name="none")
    with pytest.raises(BadParameter, match="are both made/v1/d1"):
        add(lake, output_of(RECORDED[1]), output_of(RECORDED[1], "second.fcd.xml"), name="both")


def test_the_same_output_again_adds_nothing_and_another_is_refused(lake):
    output = write_lake(lake.root.parent / "output", map(output_of, RECORDED))
    add_run(lake, output, "theirs")
    before = rows(lake, "theirs")
    assert add_run(lake, output, "theirs").scenarios == 3
    assert rows(lake, "theirs") == before
    with pytest.raises(BadParameter, match="a run 'theirs' exists with output"):
        add_run(lake, write_lake(lake.root.parent / "fewer", map(output_of, RECORDED[:2])), "theirs")
