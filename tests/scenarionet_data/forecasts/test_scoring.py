"""Predictions from samples to scores and submissions."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
import pytest
import shapely

from scenarionet_data import Samples, Targets, TimeWindow
from scenarionet_data.errors import BadParameter, UnknownEvent
from scenarionet_data.forecasts.displacements import argoverse, drivable_area, nuscenes, off_road_rate
from scenarionet_data.forecasts.predictions import _targets, make_predictions, read_predictions, write_predictions
from scenarionet_data.forecasts.scoring import fan_of_velocities, score, summary
from scenarionet_data.forecasts.submissions import WaymoEntry, write_argoverse2, write_waymo
from scenarionet_data.schema import tables
from tests.fixtures.lakes import write_lake
from tests.fixtures.scenarios import make_scenario

pytestmark = pytest.mark.filterwarnings("ignore::scenarionet_data.samples.selection.SamplesWarning")
STEPS = 80


@pytest.fixture(scope="module")
def lake(tmp_path_factory):
    scenarios = [make_scenario(seed, num_objects=6, num_steps=11 + STEPS) for seed in (0, 2)]
    for scenario in scenarios:
        numbers = np.array([str(100 + row) for row in range(6)], dtype=object)
        object.__setattr__(scenario.tracks, "ids", numbers)
        object.__setattr__(scenario, "ego_id", "100")
        object.__setattr__(scenario, "tracks_to_predict", (("100", 0),))
        object.__setattr__(scenario, "objects_of_interest", ())
    return write_lake(tmp_path_factory.mktemp("forecasts"), scenarios)


@pytest.fixture(scope="module")
def rows(lake):
    """Two modes for the ego: the recorded future, and one that is 3 m ahead of it."""
    samples = Samples(lake, window=TimeWindow(history=1.0, future=8.0), targets=Targets("ego"))
    batch = samples.batch(range(len(samples)))
    truth = batch["future"][:, 0, :, :2]
    modes = np.stack([truth, truth + np.array([3.0, 0.0])], axis=1)
    keys = [samples.key(index) for index in range(len(samples))]
    return make_predictions(keys, modes, np.array([[0.25, 0.75]] * len(keys)), batch["pose"], 0.1)


@pytest.fixture
def path(rows, tmp_path):
    pq.write_table(rows, tmp_path / "predictions.parquet")
    return tmp_path / "predictions.parquet"


def test_the_recorded_future_scores_best(lake, path):
    scores = score(lake, path)
    assert scores.findings == {}
    for row in scores.table.to_pylist():
        assert row["object_type"] == "VEHICLE" and row["num_modes"] == 2
        assert max(row[name] for name in ("min_ade", "min_fde", "min_ade_5", "waymo_min_ade_8s")) < 1e-3
        assert row["is_missed"] == row["miss_rate_top_5"] == row["waymo_miss_3s"] == 0
        np.testing.assert_allclose(row["brier_min_fde"] - row["min_fde"], 0.75**2)
    found = [scores.precision["VEHICLE", seconds, "map"] for seconds in (3, 8)]
    assert found == [0.5, 1.0]  # the more probable mode is 3 m off, within the limit at 8 s
    (mean,) = summary(lake, scores, "dataset").to_pylist()
    assert mean["by"] == "made" and mean["targets"] == 2


def test_scores_by_an_event(lake, path):
    happens = set(lake.select(events=["following"]).scenario_ids)
    scores = score(lake, path)
    expected = {"following": 0, "without following": 0}
    for row in scores.table.to_pylist():
        expected["following" if row["scenario_id"] in happens else "without following"] += 1
    found = {row["by"]: row["targets"] for row in summary(lake, scores, event="following").to_pylist()}
    assert found == {name: count for name, count in expected.items() if count}
    with pytest.raises(UnknownEvent):
        summary(lake, scores, event="folowing")


def test_a_prediction_is_in_the_frame_of_its_scenario(lake, rows):
    first = rows.slice(0, 1).to_pylist()[0]
    scenario = make_scenario(int(first["scenario_id"][-6:]), num_objects=6, num_steps=11 + STEPS)
    np.testing.assert_allclose(first["x"], scenario.tracks.position[0, 11:, 0], atol=1e-4)
    np.testing.assert_allclose(first["y"], scenario.tracks.position[0, 11:, 1], atol=1e-4)


def test_what_cannot_be_scored_is_counted(lake, rows, tmp_path):
    changed = [
        rows,
        rows.slice(0, 2).set_column(0, "scenario_id", pa.array(["made/v1/none"] * 2)),
        rows.slice(0, 2).set_column(1, "track_id", pa.array(["nobody"] * 2)),
        rows.slice(0, 2).set_column(2, "timestep", pa.array([40, 40], pa.int32())),
    ]
    write_predictions(tmp_path / "p.parquet", [each.cast(rows.schema) for each in changed])
    found = score(lake, tmp_path / "p.parquet").findings
    assert {reason: count for reason, (count, _) in found.items()} == {
        "of scenarios that the lake does not have": 1,
        "of objects or timesteps that the scenario does not have": 1,
        "of futures that are not recorded wholly: without scores of Argoverse and nuScenes": 1,
    }


def test_files_that_hold_no_predictions_are_refused(rows, tmp_path):
    with pytest.raises(BadParameter, match="no such file"):
        read_predictions(tmp_path / "none.parquet")
    pq.write_table(rows.drop_columns(["x"]), tmp_path / "p.parquet")
    with pytest.raises(BadParameter, match=r"expected the columns of schemas/predictions.toml, found"):
        read_predictions(tmp_path / "p.parquet")
    lists = rows["x"].to_pylist()
    ragged = rows.set_column(6, "x", pa.array([lists[0][:-1], *lists[1:]], rows.schema.field("x").type))
    pq.write_table(ragged, tmp_path / "p.parquet")
    with pytest.raises(BadParameter, match=r"expected trajectories of one length, at least 1, found \[79, 80\]"):
        read_predictions(tmp_path / "p.parquet")


def test_argoverse_takes_the_mode_that_ends_nearest():
    truth = np.column_stack([np.arange(1.0, 5.0), np.zeros(4)])
    near_at_first = truth + np.array([[0, 0], [0, 0], [0, 0], [0, 3]])
    near_at_last = truth + np.array([[0, 4], [0, 4], [0, 4], [0, 1]])
    found = argoverse(np.array([near_at_first, near_at_last]), np.array([0.6, 0.4]), truth)
    assert found == pytest.approx(
        {
            "min_ade": 13 / 4,
            "min_fde": 1.0,
            "is_missed": 0.0,
            "brier_min_fde": 1.36,
            "min_fde_1": 3.0,
            "is_missed_1": 1.0,
        }
    )


def test_nuscenes_misses_by_the_largest_error():
    truth = np.zeros((4, 2))
    modes = np.array([truth + np.array([[2.1, 0], [0, 0], [0, 0], [0, 0]]), truth + 1.0])
    assert nuscenes(modes, truth, 1) == pytest.approx({"min_ade_1": 0.525, "miss_rate_top_1": 1.0})
    assert nuscenes(modes, truth, 2) == pytest.approx({"min_ade_2": 0.525, "miss_rate_top_2": 0.0})


def test_waymo_takes_the_first_six_modes_as_given_and_argoverse_the_most_probable(lake, rows):
    """Seven modes: the recorded future is the last one given, and the most probable one."""
    (truth,) = read_predictions_of(rows.slice(0, 1))
    far = np.repeat(truth.modes[:1] + 50.0, 6, axis=0)
    modes, probabilities = np.concatenate([truth.modes[:1], far]), np.array([0.4, *[0.1] * 6])
    last = replace(truth, modes=modes, probabilities=probabilities, given=np.array([6, 0, 1, 2, 3, 4, 5]))
    first = replace(last, given=None)
    (missed,), (found,) = (score(lake, [each]).table.to_pylist() for each in (last, first))
    assert missed["waymo_min_fde_8s"] > 50.0 and missed["min_fde"] < 1e-3
    assert found["waymo_min_fde_8s"] < 1e-3


def read_predictions_of(rows):
    return list(_targets(rows.combine_chunks(), "rows"))


def test_nuscenes_misses_from_two_metres_on_and_argoverse_beyond():
    truth, modes = np.zeros((2, 2)), np.array([[[0.0, 0.0], [2.0, 0.0]]])
    assert nuscenes(modes, truth, 1)["miss_rate_top_1"] == 1.0
    assert argoverse(modes, np.ones(1), truth)["is_missed_1"] == 0.0


def test_the_floor_is_a_fan_of_six_constant_velocities(lake, path):
    listed = read_predictions(path)
    fan = fan_of_velocities(lake, listed)
    assert [(each.scenario_id, each.timestep) for each in fan] == [(each.scenario_id, each.timestep) for each in listed]
    scenario = lake.loader([fan[0].scenario_id])[0]
    at, velocity = scenario.tracks.position[0, 10, :2], scenario.tracks.velocity[0, 10]
    assert fan[0].modes.shape == (6, STEPS, 2) and fan[0].probabilities.sum() == pytest.approx(1.0)
    np.testing.assert_allclose(fan[0].modes[0, 9], at + velocity, atol=1e-4)
    np.testing.assert_allclose(fan[0].modes[3, 19], at + velocity, atol=1e-4)  # half as fast
    turned = fan[0].modes[4, 9] - at
    assert velocity[0] * turned[1] > velocity[1] * turned[0] and np.hypot(*turned) == pytest.approx(
        np.hypot(*velocity), rel=1e-4
    )
    assert "of scenarios that the lake does not have" not in score(lake, fan).findings


def test_modes_that_leave_the_road_are_counted():
    modes = np.array([[[1, 1], [2, 2]], [[1, 1], [9, 9]]], dtype=np.float64)
    assert off_road_rate(modes, shapely.box(0, 0, 5, 5), np.zeros(2)) == 0.5
    bend = np.array([[[0, 0], [4, 0], [8, 0.2], [10, 2], [10.2, 6], [10.2, 10]]], dtype=np.float64)
    corner = shapely.LineString(bend[0]).buffer(0.15)
    assert off_road_rate(bend, corner, np.zeros(2)) == 1.0, "the curve between the points is off the road"
    assert off_road_rate(bend, corner.buffer(1.0), np.zeros(2)) == 0.0
    edge, line = shapely.box(-1, -1, 3, 1.23), np.array([[[0, 1.25], [1, 1.25]]])
    assert off_road_rate(line, edge, np.zeros(2)) == 0.0, "on the owner's grid it is at 1.2 m"
    assert off_road_rate(line, edge, np.array([0.0, 0.06])) == 1.0, "and here at 1.24 m"


def test_a_road_without_outlines_has_no_area():
    """Every second lane of the made map has an outline."""
    features = make_scenario(0).map
    assert drivable_area(features) is None
    outlined = features.take(np.flatnonzero(features.polygon.lengths > 0))
    assert drivable_area(outlined).area > 100
    assert drivable_area(None) is None


def test_a_submission_to_argoverse_has_its_columns(lake, path, tmp_path):
    write_argoverse2(lake, read_predictions(path), tmp_path / "submission.parquet")
    found = pq.read_table(tmp_path / "submission.parquet").to_pylist()
    assert list(found[0]) == "scenario_id track_id probability predicted_trajectory_x predicted_trajectory_y".split()
    assert {len(row["predicted_trajectory_x"]) for row in found} == {60}
    assert sum(row["probability"] for row in found) == pytest.approx(2)
    assert found[0]["predicted_trajectory_x"][0] > 3_000_000  # in the frame of the source


def motion_submission():
    """The message of ``motion_submission.proto``, from its field numbers."""
    from google.protobuf import descriptor_pb2, descriptor_pool, message_factory

    kinds = descriptor_pb2.FieldDescriptorProto
    file = descriptor_pb2.FileDescriptorProto(name="motion_submission.proto", package="w", syntax="proto2")

    def message(name, *fields):
        made = file.message_type.add(name=name)
        for number, field, kind, repeated in fields:
            added = made.field.add(name=field, number=number, label=3 if repeated else 1)
            if isinstance(kind, str):
                added.type, added.type_name = kinds.TYPE_MESSAGE, f".w.{kind}"
            else:
                added.type = kind
            if repeated and kind == kinds.TYPE_FLOAT:
                added.options.packed = True

    message("Trajectory", (2, "center_x", kinds.TYPE_FLOAT, True), (3, "center_y", kinds.TYPE_FLOAT, True))
    message("Scored", (1, "trajectory", "Trajectory", False), (2, "confidence", kinds.TYPE_FLOAT, False))
    message("Single", (1, "object_id", kinds.TYPE_INT32, False), (2, "trajectories", "Scored", True))
    message("Set", (1, "predictions", "Single", True))
    message("Scenario", (1, "scenario_id", kinds.TYPE_STRING, False), (2, "single_predictions", "Set", False))
    texts = ((3, "account_name"), (4, "unique_method_name"), (6, "affiliation"), (7, "description"))
    texts += ((8, "method_link"), (12, "num_model_parameters"))
    flags = ((9, "uses_lidar_data"), (10, "uses_camera_data"), (11, "uses_public_model_pretraining"))
    message(
        "Submission",
        (1, "scenario_predictions", "Scenario", True),
        (2, "submission_type", kinds.TYPE_INT32, False),
        (5, "authors", kinds.TYPE_STRING, True),
        *((number, name, kinds.TYPE_STRING, False) for number, name in texts),
        *((number, name, kinds.TYPE_BOOL, False) for number, name in flags),
    )
    pool = descriptor_pool.DescriptorPool()
    pool.Add(file)
    return message_factory.GetMessageClass(pool.FindMessageTypeByName("w.Submission"))


def test_a_submission_to_waymo_is_its_message(lake, path, tmp_path):
    entry = WaymoEntry("me@example.org", "ahead", "2M", ("A", "B"), description="of a test", uses_camera=True)
    predictions = read_predictions(path)
    write_waymo(lake, predictions, tmp_path / "submission.binproto", entry)
    found = motion_submission().FromString((tmp_path / "submission.binproto").read_bytes())
    assert found.submission_type == 1 and found.account_name == "me@example.org" and list(found.authors) == ["A", "B"]
    assert found.unique_method_name == "ahead" and found.num_model_parameters == "2M"
    assert (found.uses_lidar_data, found.uses_camera_data) == (False, True) and found.HasField("uses_lidar_data")
    assert [each.scenario_id for each in found.scenario_predictions] == ["s000000", "s000002"]
    for each, prediction in zip(found.scenario_predictions, predictions, strict=True):
        (single,) = each.single_predictions.predictions
        assert single.object_id == 100
        origin = make_scenario(int(each.scenario_id[1:]), num_objects=6, num_steps=91).origin
        for scored, mode, probability in zip(single.trajectories, prediction.modes, (0.75, 0.25), strict=True):
            assert scored.confidence == probability
            np.testing.assert_array_equal(scored.trajectory.center_x, (mode[4::5, 0] + origin[0]).astype(np.float32))
            np.testing.assert_array_equal(scored.trajectory.center_y, (mode[4::5, 1] + origin[1]).astype(np.float32))


def test_submissions_need_their_timesteps(lake, rows, tmp_path):
    short = rows.set_column(6, "x", pa.array([x[:40] for x in rows["x"].to_pylist()], rows.schema.field("x").type))
    short = short.set_column(7, "y", pa.array([y[:40] for y in rows["y"].to_pylist()], rows.schema.field("y").type))
    pq.write_table(short, tmp_path / "p.parquet")
    for write in (write_argoverse2, lambda *given: write_waymo(*given, WaymoEntry("a", "b", "1K"))):
        with pytest.raises(BadParameter, match=r"expected positions every 0\.. s up to . s, found 40 every 0.1 s"):
            write(lake, read_predictions(tmp_path / "p.parquet"), tmp_path / "out")


def test_scores_have_the_columns_of_the_schema(lake, path):
    assert score(lake, path).table.schema == tables.load("scores").schema
