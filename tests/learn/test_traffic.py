"""A model of traffic learns, places vehicles apart, and fills a lake with scenarios that can be driven."""

from __future__ import annotations

import json
from dataclasses import replace

import numpy as np
import pytest
import shapely

from scenarionet_data import Lake, ScenarioLoader, convert

pytestmark = pytest.mark.learn
torch = pytest.importorskip("torch", reason="no torch: run `make test-learn`")

from scenarionet_data.arrays.geometry import box_corners  # noqa: E402
from scenarionet_data.errors import BadParameter, LakeError  # noqa: E402
from scenarionet_data.forecasts import forecaster  # noqa: E402
from scenarionet_data.generation.driving import drive, place  # noqa: E402
from scenarionet_data.generation.frames import HEADING  # noqa: E402
from scenarionet_data.generation.scores import score_placement  # noqa: E402
from scenarionet_data.generation.snapshots import TrafficConfig, read_moments  # noqa: E402
from scenarionet_data.generation.traffic_model import TrafficModel, from_lane, placement_loss, to_lane  # noqa: E402
from scenarionet_data.generation.training import load, train  # noqa: E402
from scenarionet_data.generation.writing import GenerationChoice, generate  # noqa: E402
from scenarionet_data.learning.fitting import FitRun, weights_digest  # noqa: E402
from scenarionet_data.storage import checkpoints  # noqa: E402
from scenarionet_data.storage.snapshots import commit as commits  # noqa: E402
from scenarionet_data.variations.limits import check_limits  # noqa: E402
from scenarionet_sim import evaluate  # noqa: E402
from tests.fixtures.lakes import write_shard  # noqa: E402
from tests.fixtures.moments import along, moment  # noqa: E402

CONFIG = TrafficConfig(epochs=2, size=16, lanes=160, min_vehicles=3, components=3, modes=3, batch_size=8)
MANY = GenerationChoice(40, duration=2.0)


@pytest.fixture(scope="module")
def lake(tmp_path_factory):
    root = tmp_path_factory.mktemp("traffic") / "lake"
    convert("pg", "0:6", root, version="v2")
    lake = Lake(root)
    lake.filter("TRUE", name="recorded")
    train(FitRun(lake, "recorded", "model"), CONFIG)
    return lake


@pytest.fixture(scope="module")
def moments(lake):
    return read_moments(lake, "recorded", CONFIG)[0]


def test_interrupted_training_goes_on_to_the_same_weights(lake):
    class Killed(Exception):
        pass

    def kill(_rows):
        raise Killed

    with pytest.raises(Killed):
        train(FitRun(lake, "recorded", "parts", on_epoch=kill), CONFIG)
    continued, whole = train(FitRun(lake, "recorded", "parts"), CONFIG), load(lake, "model")
    for name, value in whole.state_dict().items():
        assert torch.equal(value, continued.state_dict()[name])


def test_training_lowers_the_losses(lake):
    train(FitRun(lake, "recorded", "longer", tests=("recorded",)), replace(CONFIG, epochs=12, rate=5e-3))
    rows = lake.sql("SELECT learned FROM training WHERE run = 'longer' AND test IS NOT NULL ORDER BY round")["learned"]
    first, last = json.loads(rows[0]), json.loads(rows[-1])
    assert last["placement"] < first["placement"] - 1.0 and last["motion"] < 0.95 * first["motion"]


def test_ten_moments_of_twenty_seconds():
    assert round((19.9 - TrafficConfig().future) / TrafficConfig().stride) + 1 == 10


def test_vehicles_are_found_again_on_their_lane_vectors(moments):
    rows, which = torch.nonzero(moments.cell >= 0, as_tuple=True)
    lanes, cars = moments.lanes[rows, moments.cell[rows, which]], moments.cars[rows, which]
    inside = to_lane(lanes, cars)[:, 0].abs() * 1.5 <= lanes[:, 3] / 2
    assert inside.any()
    found = from_lane(lanes, to_lane(lanes, cars))[inside]
    torch.testing.assert_close(found[:, [0, 1, 3, 4, 5]], cars[inside][:, [0, 1, 3, 4, 5]], atol=1e-4, rtol=1e-4)
    assert (found[:, HEADING] - cars[inside][:, HEADING]).cos().min() > 0.9999


def test_a_turned_and_moved_map_gives_the_same_features(moments):
    model, scene = TrafficModel(CONFIG), moments.take(torch.arange(1))
    turn, shift = torch.tensor(0.7), torch.tensor([3.0, -2.0])
    turning = torch.stack([torch.stack([turn.cos(), -turn.sin()]), torch.stack([turn.sin(), turn.cos()])])

    def moved(poses):
        return torch.cat([poses[..., :2] @ turning.T + shift, poses[..., 2:3] + turn, poses[..., 3:]], dim=-1)

    other = scene._replace(lanes=moved(scene.lanes), cars=moved(scene.cars))
    with torch.no_grad():
        features = [model.map_features(each, each.lanes)[scene.lane_ok] for each in (scene, other)]
        mine, theirs = (model.motions(each.cars, each.car_ok, each) for each in (scene, other))
    ok = scene.car_ok

    def are_close(first, second, most):  # but where two neighbours are equally far
        return ((first - second).abs() < most).float().mean() > 0.98

    assert are_close(*features, 1e-3) and are_close(theirs[1][ok], mine[1][ok], 1e-3)
    assert are_close(theirs[0][ok], moved(mine[0])[ok], 2e-2)
    assert not are_close(theirs[0][ok], mine[0][ok], 2e-2)


def test_left_out_lane_vectors_count(moments):
    """With all lane vectors asked for, the loss is that of some of them on average."""
    scenes, losses = moments.take(torch.arange(8)), {}
    for queries in (40, 160):
        torch.manual_seed(0)
        model = TrafficModel(replace(CONFIG, queries=queries))
        with torch.no_grad():
            model.logit.weight.mul_(8.0)
            drawn = [placement_loss(model, scenes, torch.Generator().manual_seed(seed)) for seed in range(40)]
        losses[queries] = float(torch.stack(drawn).mean())
    assert losses[40] == pytest.approx(losses[160], abs=0.5)


def test_vehicles_are_placed_apart(lake, moments):
    model, scenes = load(lake, "model"), moments.take(torch.arange(4))
    nobody, number = torch.zeros_like(scenes.car_ok), torch.full((4,), 12)
    placed = place(model, scenes, nobody, number, torch.Generator().manual_seed(0))
    first = scenes.cars.shape[1]
    assert placed.drawn == 48 and (placed.ok[:, first:].sum(dim=1) >= 8).all()
    for cars, ok in zip(placed.cars, placed.ok, strict=True):
        there = cars[ok].numpy()
        boxes = shapely.polygons(box_corners(there[:, :2], there[:, 2], there[:, 4], there[:, 5]))
        assert shapely.intersects(boxes[:, None], boxes).sum() == len(boxes)  # each with itself
    again = place(model, scenes, nobody, number, torch.Generator().manual_seed(0))
    assert torch.equal(placed.cars, again.cars)
    raw = place(model, scenes, nobody, number, torch.Generator().manual_seed(0), may_touch=True)
    assert raw.ok[:, first:].all() and raw.touched > 0


def test_vehicles_are_replaced_when_they_leave(lake, moments):
    model, scene = load(lake, "model"), moments.take(torch.arange(1))
    cars = scene.cars[0][scene.car_ok[0]]
    far = cars.clone()
    far[:, 0] += 1000.0
    traffic = drive(model, scene, far, 60, torch.Generator().manual_seed(0))
    assert not traffic.valid[: len(far), 12:].any() and traffic.valid[len(far) :, 60].any()
    assert (np.diff(traffic.valid.astype(int), axis=1) > 0).sum(axis=1).max() <= 1  # once there, once gone


def test_generated_scenarios_can_be_driven_and_know_where_they_come_from(lake):
    report = generate(lake, "recorded", "model", GenerationChoice(2, seed=3, duration=25.0), name="first")
    assert not report.failed
    fresh = Lake(lake.root)
    rows = fresh.sql("SELECT scenario_id, parent, extras, split FROM metadata WHERE dataset = 'generated'")
    assert len(rows) == 12 and set(rows["parent"]) == set(lake.database("recorded").scenario_ids)
    made = json.loads(rows["extras"][0])["generated"]
    assert made["model"] == "model" and made["weights"] == weights_digest(load(lake, "model"))
    assert made["seed"] == 3 and made["placed"] <= made["wanted"]
    for scenario in ScenarioLoader(lake.root, rows["scenario_id"].to_list()):
        assert (
            scenario.num_timesteps == 251
            and scenario.tracks.valid[:, 0].sum() == scenario.extras["generated"]["placed"]
        )
        first = -1 - np.flatnonzero(scenario.tracks.valid[:, 0])
        check_limits(None, replace(scenario, current_timestep=0), first, jerk=np.inf)  # with contacts at the start
    fresh.filter("dataset = 'generated'", name="generated")
    evaluate(lake.root, "generated", policy="idm", name="driven")
    errors = Lake(lake.root).sql("SELECT error FROM results WHERE run = 'driven'")["error"]
    assert len(errors) == 12 and errors.null_count() == 12


def test_killed_generation_goes_on_without_doubles(lake):
    with pytest.raises(KeyboardInterrupt):
        generate(lake, "recorded", "model", MANY, name="killed", on_progress=kill_after(2))
    generate(lake, "recorded", "model", MANY, name="killed")
    generate(lake, "recorded", "model", MANY, name="whole")
    query = "SELECT content_hash FROM metadata WHERE dataset = 'generated' AND version = '{}' ORDER BY scenario_id"
    killed, whole = (Lake(lake.root).sql(query.format(name))["content_hash"].to_list() for name in ("killed", "whole"))
    assert len(killed) == len(whole) == 240 and len(set(whole)) == 240
    again = generate(lake, "recorded", "model", MANY, name="killed")
    assert again.shards == 0 and again.converted == 0


def kill_after(calls):
    left = [calls]

    def count(*_):
        left[0] -= 1
        if left[0] < 0:
            raise KeyboardInterrupt

    return count


def test_mistakes_are_said(lake, tmp_path, monkeypatch):
    with pytest.raises(BadParameter, match="no setting 'widht'"):
        TrafficConfig.parse({"widht": "3"})
    forecaster.train(FitRun(lake, "recorded", "other"), forecaster.ForecasterConfig(epochs=1, stride=5.0))
    with pytest.raises(LakeError, match=r"is not of a traffic model.*traffic learn"):
        generate(lake, "recorded", "other", name="none")
    found = checkpoints.load(lake.files, "model")
    assert found is not None
    broken = {name: values * np.nan if "logit" in name else values for name, values in found.arrays.items()}
    monkeypatch.setattr(checkpoints, "load", lambda *_: checkpoints.Checkpoint(1, found.facts, broken))
    with pytest.raises(LakeError, match=r"weights are not finite, for example .*logit"):
        load(lake, "model")
    smaller = {name: values[:1] if values.ndim else values for name, values in found.arrays.items()}
    monkeypatch.setattr(checkpoints, "load", lambda *_: checkpoints.Checkpoint(1, found.facts, smaller))
    with pytest.raises(LakeError, match="another layout"):
        load(lake, "model")
    monkeypatch.undo()
    (scenario, *_) = read_moments(lake, "recorded", CONFIG)[1]
    one = lake.filter(f"scenario_id = '{scenario}'", name="one")
    with pytest.raises(BadParameter, match="all moments are on one map"):
        score_placement(lake, "model", one.name)
    with pytest.raises(BadParameter, match="no moment of its scenarios shows 99 vehicles"):
        train(FitRun(lake, "one", "none"), replace(CONFIG, min_vehicles=99))
    for wrong in ({"duration": 0.5}, {"number": 0}, {"vehicles": -1}):
        with pytest.raises(BadParameter):
            GenerationChoice(**wrong)
    with pytest.raises(BadParameter, match="use letters"):
        generate(lake, "recorded", "model", name="a b")


def test_maps_without_lanes_are_said(lake):
    bare = moment("bare", along(0, 0, 10), car=along(20, 0, 10))
    commits.commit(lake.files, [write_shard(lake.root, [bare], "bare")], "test")
    lake = lake.refresh()
    lake.filter("dataset = 'moments'", name="bare")
    report = generate(lake, "bare", "model", name="bare", choice=MANY)
    assert (report.converted, report.quarantined) == (0, 40)
    said = lake.refresh().sql("SELECT DISTINCT message FROM quarantine WHERE version = 'bare'")["message"]
    assert "wanted lanes around the ego, on which vehicles are placed; found none" in said.item()


def test_scores_stand_beside_baselines(lake):
    scores = score_placement(lake, "model", "recorded")
    assert [each.name for each in scores] == ["model", "another map", "uniform"]
    assert scores[0].touching is not None and 0 <= scores[0].touching <= 1
    uniform = scores[2]
    for attribute, (mean, low, high) in uniform.differences.items():
        assert low <= mean <= high
        assert mean == pytest.approx(uniform.means[attribute] - scores[0].means[attribute])
