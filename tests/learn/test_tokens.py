"""A model of tokens: motions as words, their probabilities, training, and traffic of the simulator that it moves."""

from __future__ import annotations

import json
import math
from dataclasses import replace

import numpy as np
import pytest
from click.testing import CliRunner

from scenarionet_data import Lake, convert
from scenarionet_data.storage import checkpoints
from scenarionet_pipelines.cli import cli

pytestmark = pytest.mark.learn
torch = pytest.importorskip("torch", reason="no torch: run `make test-learn`")

from scenarionet_data.errors import BadParameter, LakeError  # noqa: E402
from scenarionet_data.generation.frames import composed, relative  # noqa: E402
from scenarionet_data.generation.snapshots import TrafficConfig  # noqa: E402
from scenarionet_data.generation.token_model import LANE, TokenConfig, TokenModel  # noqa: E402
from scenarionet_data.generation.token_recordings import map_pieces, read_recordings, train  # noqa: E402
from scenarionet_data.generation.token_training import (  # noqa: E402
    Recordings,
    draw,
    likelihood,
    load_tokens,
    make_model,
    measured,
    nearest,
    nearest_of_probable,
    roll,
)
from scenarionet_data.generation.tokens import BOXES, apart, choose_tokens, corners, motions  # noqa: E402
from scenarionet_data.learning.fitting import FitRun  # noqa: E402
from scenarionet_sim import evaluate  # noqa: E402
from scenarionet_sim.policies.tokens import TokenTraffic, _pieces  # noqa: E402
from scenarionet_sim.simulation.simulation import Simulation  # noqa: E402
from scenarionet_sim.worlds.world import World  # noqa: E402
from tests.fixtures.lakes import write_lake  # noqa: E402
from tests.fixtures.scenarios import make_scenario  # noqa: E402

CONFIG = TokenConfig(tokens=64, radius=0.2, size=16, heads=2, epochs=2, batch_size=3)
CPU = torch.device("cpu")


@pytest.fixture(scope="module")
def lake(tmp_path_factory):
    root = tmp_path_factory.mktemp("tokens") / "lake"
    convert("pg", "0:6", root, version="v2")
    lake = Lake(root)
    lake.filter("TRUE", name="recorded")
    train(FitRun(lake, "recorded", "clone"), CONFIG)
    return lake


@pytest.fixture(scope="module")
def recordings(lake):
    return read_recordings(lake, "recorded")


def straight(speed, steps=11):
    """One vehicle that drives along x, on a map with one lane piece."""
    states = torch.zeros(1, 1, steps, 5)
    states[0, 0, :, 0], states[0, 0, :, 3] = 0.1 * speed * torch.arange(steps), speed
    pieces = torch.tensor([[[5.0, 0.0, 0.0, 5.0, 0.0]]])
    here = torch.ones(1, 1, steps, dtype=torch.bool)
    return Recordings(states, here, torch.tensor([[[4.0, 2.0]]]), torch.zeros(1, 1, dtype=torch.long), pieces)


def test_distance_of_boxes_by_hand():
    box, here = BOXES[0], torch.zeros(3)
    moved, turned = torch.tensor([0.3, 0.4, 0.0]), torch.tensor([0.0, 0.0, math.pi])
    assert float(apart(corners(here, box), corners(moved, box))) == pytest.approx(0.5)
    assert float(apart(corners(here, box), corners(turned, box))) == pytest.approx(math.hypot(4.8, 2.0), rel=1e-5)


def test_disks_are_apart_and_cover():
    ends = torch.zeros(300, 5, 3)
    ends[:, :, 0] = torch.linspace(0, 3, 300)[:, None]
    chosen = choose_tokens(ends, BOXES[0], 100, 0.1, torch.Generator().manual_seed(0))
    places = chosen[:, -1, 0].sort().values
    assert (places.diff() > 0.1).all() and (ends[:, -1, :1] - places).abs().min(dim=1).values.max() <= 0.1
    assert len(choose_tokens(ends, BOXES[0], 5, 0.1, torch.Generator())) == 5
    assert len(choose_tokens(ends[:0], BOXES[0], 5, 0.1, torch.Generator())) == 0


def test_motions_are_in_the_frame_of_their_beginning():
    found = motions(straight(10.0).states[0, :, :, :3], straight(10.0).ok[0])
    assert found.shape == (6, 5, 3)
    torch.testing.assert_close(found[..., 0], torch.arange(1.0, 6.0).expand(6, 5), atol=1e-5, rtol=0)
    gap = straight(10.0).ok[0].clone()
    gap[0, 5] = False
    assert len(motions(straight(10.0).states[0, :, :, :3], gap)) == 0


def test_frames_are_inverted():
    frames, poses = torch.rand(2, 20, 3, generator=torch.Generator().manual_seed(0)) * 6 - 3  # headings as returned
    torch.testing.assert_close(composed(frames, relative(frames, poses)), poses, atol=1e-5, rtol=0)


def test_loss_by_hand():
    """Two tokens, at rest and 5 m ahead; their logits are 0 and ln 3, so the vehicle's token has probability 3/4."""
    model = TokenModel(replace(CONFIG, tokens=8))
    model.paths[0, 1, :, 0], model.has_token[0, :2] = torch.arange(1.0, 6.0), True
    torch.nn.init.zeros_(model.logit[0].weight)
    model.logit[0].bias.data = torch.tensor([0.0, math.log(3.0), *[0.0] * 6])
    given = straight(10.0)
    rolled = roll(model, given, 0, nearest_of_probable(1), sees=True)
    assert rolled.target[0, :, 0].tolist() == [1, 1, -1] and rolled.taken[0, :, 0].tolist() == [1, 1, -1]
    assert rolled.poses[0, :, 0, 0].tolist() == pytest.approx([0.0, 5.0, 10.0])
    assert rolled.before[0, :, 0, 0].tolist() == pytest.approx([-5.0, 0.0, 5.0])
    assert likelihood(model, given, rolled).tolist() == pytest.approx([math.log(0.75)] * 2)


def test_who_is_lost_goes_on_from_the_recording():
    """A token of rest is all there is: a vehicle at 10 m/s is 5 m behind after one, and 10 m after two."""
    model, given = TokenModel(replace(CONFIG, tokens=8)), straight(10.0, steps=16)
    model.has_token[0, 0] = True
    for lost, places, earlier in (
        (6.0, [0.0, 0.0, 10.0, 10.0], [-5.0, 0.0, 5.0, 10.0]),
        (math.inf, [0.0] * 4, [-5.0, 0.0, 0.0, 0.0]),
    ):
        rolled = roll(model, given, 0, nearest_of_probable(1), sees=False, lost=lost)
        assert rolled.poses[0, :, 0, 0].tolist() == pytest.approx(places)
        assert rolled.before[0, :, 0, 0].tolist() == pytest.approx(earlier)


def test_whole_training_sees_what_single_moments_see(lake, recordings):
    model, batch, seen = load_tokens(lake.files, "clone"), recordings.take(torch.arange(3), CPU), []

    def pick(_moment, logits, misses):
        seen.append(logits.gather(1, misses.argmin(dim=1, keepdim=True)).squeeze(1))
        return misses.argmin(dim=1)

    with torch.no_grad():
        rolled = roll(model, batch, 2, pick, sees=True)
        whole = torch.full(rolled.target.shape, torch.nan)
        whole[rolled.target >= 0] = likelihood(model, batch, rolled)
    one_by_one = torch.cat(seen)
    together = whole.transpose(0, 1)[rolled.target.transpose(0, 1) >= 0]
    torch.testing.assert_close(together, one_by_one, atol=2e-4, rtol=1e-4)


def test_a_turned_and_moved_scenario_gives_the_same_probabilities(lake, recordings):
    model, given = load_tokens(lake.files, "clone"), recordings.take(torch.arange(1), CPU)
    turn, shift = torch.tensor(0.7), torch.tensor([30.0, -20.0])
    turning = torch.stack([torch.stack([turn.cos(), -turn.sin()]), torch.stack([turn.sin(), turn.cos()])])

    def moved(values):
        return torch.cat([values[..., :2] @ turning.T + shift, values[..., 2:3] + turn, values[..., 3:]], dim=-1)

    states = moved(given.states)
    states[..., 3:] = given.states[..., 3:] @ turning.T
    other = given._replace(states=states, pieces=moved(given.pieces))
    pick = nearest(0.0, torch.Generator())
    with torch.no_grad():
        here, there = (likelihood(model, each, roll(model, each, 0, pick, sees=False)) for each in (given, other))
    assert ((here - there).abs() < 1e-2).float().mean() > 0.97  # but where two neighbours are equally far
    assert ((here - here.flip(0)).abs() < 1e-2).float().mean() < 0.5


def test_draws_by_hand():
    logits = torch.tensor([[0.2, 0.5, 0.3]]).log().expand(5, 3)
    chances = torch.tensor([0.0, 0.49, 0.51, 0.79, 0.999])
    assert draw(logits, 1.0, chances).tolist() == [1, 1, 2, 2, 0]
    assert draw(logits, 0.6, torch.tensor([0.0, 0.6, 0.63, 0.9, 0.999])).tolist() == [1, 1, 2, 2, 2]


def test_the_nearest_of_the_probable_ones_is_taken():
    logits, misses = torch.tensor([[0.0, -1.0, -2.0]]), torch.tensor([[3.0, 2.0, 1.0]])
    assert [int(nearest_of_probable(count)(0, logits, misses)) for count in (1, 2, 3)] == [0, 1, 2]


def test_interrupted_training_goes_on_to_the_same_weights(lake):
    class Killed(Exception):
        pass

    def kill(_rows):
        raise Killed

    with pytest.raises(Killed):
        train(FitRun(lake, "recorded", "parts", on_epoch=kill), CONFIG)
    continued, whole = train(FitRun(lake, "recorded", "parts"), CONFIG), load_tokens(lake.files, "clone")
    for name, value in whole.state_dict().items():
        assert torch.equal(value, continued.state_dict()[name])


def test_training_learns_and_goes_on_in_closed_loop(lake, recordings):
    longer = train(FitRun(lake, "recorded", "longer"), replace(CONFIG, epochs=12, rate=5e-3, noise=0.0, flip=0.0))
    tuned = train(FitRun(lake, "recorded", "tuned", tests=("recorded",)), replace(CONFIG, choices=8), start="longer")
    fresh = make_model(CONFIG, recordings, 0, CPU)
    worth = [measured(each, iter([recordings])) for each in (fresh, longer, tuned)]
    assert worth[1]["likelihood"] < worth[0]["likelihood"] - 0.5 and worth[2]["likelihood"] < worth[0]["likelihood"]
    assert worth[1]["away"] < worth[0]["away"] and worth[0]["error"] < CONFIG.radius
    assert torch.equal(tuned.paths, longer.paths)


def test_traffic_of_the_simulator(lake):
    for name in ("once", "again"):
        evaluate(lake, "recorded", policy="idm", traffic="model:clone", num_rollouts=2, name=name)
    evaluate(lake, "recorded", policy="model:clone", traffic="model:clone", name="all")
    rows = Lake(lake.root).sql("SELECT run, rollout, scenario_id, track_id, x, valid FROM rollouts ORDER BY ALL")
    driven = {name: part.drop("run") for (name,), part in rows.group_by("run", maintain_order=True)}
    assert driven["once"].equals(driven["again"])
    first, second = (driven["once"].filter(rollout=number).drop("rollout") for number in (0, 1))
    assert not first.equals(second)
    errors = Lake(lake.root).sql("SELECT error, is_reactive FROM results WHERE run IN ('once', 'all')")
    assert errors["error"].null_count() == len(errors) == 18 and errors["is_reactive"].all()


def test_objects_follow_their_tokens_and_leave(lake):
    world = World.from_scenario(lake.loader()[0])
    policy = TokenTraffic(run="clone", lake=str(lake.root))
    simulation = Simulation([world], policy)
    model, before = load_tokens(lake.files, "clone"), []
    for step in range(20):
        before.append(simulation.state.motion[0].copy())
        was = simulation.state.present[0].copy()
        simulation.step()
        if step % 5 == 4:
            start, end = before[-5], simulation.state.motion[0]
            rows = np.flatnonzero(
                was & simulation.state.present[0] & (world.object_type == 1) & world.log_valid[step - 4]
            )
            ends = relative(torch.tensor(start[rows][:, [0, 1, 3]]), torch.tensor(end[rows][:, [0, 1, 3]])).float()
            misses = (ends[:, None] - model.paths[0, :, -1])[:, model.has_token[0]].abs().amax(dim=2).amin(dim=1)
            assert len(rows) and (misses < 1e-4).all()
    simulation.state.motion[0, :, 0] = 1e4
    for _ in range(6):
        simulation.step()
    assert not simulation.state.present[0].any()


def test_the_simulator_sees_the_map_as_in_training(lake, recordings):
    scenario = lake.loader()[0]
    here = _pieces(World.from_scenario(scenario).roads)
    there = map_pieces(scenario.map.polyline, scenario.map.feature_type)
    assert len(here) == len(there) and len(here) > 10
    order = [np.lexsort(np.round(each, 2).T) for each in (here, there)]
    np.testing.assert_allclose(here[order[0]], there[order[1]], atol=1e-2)


def test_the_command_line_learns_the_same(lake, monkeypatch):
    monkeypatch.setattr("scenarionet_pipelines.cli.progress._SECONDS_BETWEEN_LINES", 0.01)
    settings = {"tokens": 64, "radius": 0.2, "size": 16, "heads": 2, "epochs": 2, "batch_size": 3}
    words = ["traffic", "learn", str(lake.root), "recorded", "--kind", "tokens", "--json", "--test", "recorded"]
    for name, value in settings.items():
        words += ["-p", f"{name}={value}"]
    result = CliRunner().invoke(cli, [*words, "--name", "typed"])
    assert result.exit_code == 0, result.output
    told = json.loads(result.stdout)
    assert "--traffic model:typed" in told["next"]
    assert told["device"] in ("cpu", "cuda") and f"train typed on {told['device']}" in result.stderr
    assert [(row["test"], row["round"]) for row in told["curve"]] == [
        (n, e) for e in (1, 2) for n in (None, "recorded")
    ]
    weights = [checkpoints.load(lake.files, run).arrays for run in ("clone", "typed")]
    assert all(np.array_equal(weights[0][name], weights[1][name]) for name in weights[0] if name.startswith("model."))
    result = CliRunner().invoke(
        cli, ["traffic", "learn", str(lake.root), "recorded", "--name", "x", "--start", "clone"]
    )
    assert result.exit_code == 2 and "--start belongs to --kind tokens" in result.output


def test_mistakes_are_said(lake):
    with pytest.raises(BadParameter, match="no setting 'sise'"):
        TokenConfig.parse({"sise": "3"})
    with pytest.raises(BadParameter, match="size: wanted a multiple of heads"):
        TokenConfig.parse({"size": "15"})
    with pytest.raises(BadParameter, match="tokens: wanted at least 100, as many as choices, found 64"):
        replace(CONFIG, choices=100)
    with pytest.raises(BadParameter, match="tokens: wanted at least 8"):
        TokenConfig.parse({"tokens": "5"})
    with pytest.raises(BadParameter, match="run clone has size=16, heads=2; give the same: -p size=16 -p heads=2"):
        train(FitRun(lake, "recorded", "other"), replace(CONFIG, size=32, heads=4), start="clone")
    with pytest.raises(LakeError, match="has no run nobody; train one: scenarionet traffic learn --kind tokens"):
        evaluate(lake, "recorded", policy="idm", traffic="model:nobody")
    lake.filter("FALSE", name="empty", allow_empty=True)
    with pytest.raises(BadParameter, match="no road user is there"):
        train(FitRun(lake, "empty", "none"), CONFIG)


def test_only_tokens_are_learned_on_a_gpu_and_only_if_there_is_one(monkeypatch):
    for is_available, device in ((True, "cuda"), (False, "cpu")):
        monkeypatch.setattr(torch.cuda, "is_available", lambda found=is_available: found)
        assert (CONFIG.device.type, TrafficConfig().device.type) == (device, "cpu")


@pytest.mark.parametrize("options", [{"has_map": False}, {"num_lanes": 0}], ids=["no map", "no lanes"])
def test_recordings_without_lanes_are_learned_and_driven(tmp_path, options):
    lake = write_lake(tmp_path / "lake", [make_scenario(number, **options) for number in range(2)])
    lake.filter("TRUE", name="recorded")
    assert (read_recordings(lake, "recorded").pieces[..., 4] != LANE).all()
    train(FitRun(lake, "recorded", "bare"), replace(CONFIG, epochs=1))
    evaluate(lake, "recorded", policy="constant", traffic="model:bare", name="driven")
    errors = Lake(lake.root).sql("SELECT error, is_reactive FROM results WHERE run = 'driven'")
    assert len(errors) == 2 and errors["error"].null_count() == 2 and errors["is_reactive"].all()


def test_one_scenario_is_enough_and_damaged_weights_are_said(lake):
    lake.filter("scenario_id = 'pg/v2/1'", name="single")
    train(FitRun(lake, "single", "single", tests=("single",)), replace(CONFIG, epochs=1))
    evaluate(lake, "single", policy="idm", traffic="model:single", name="of_one")
    found = checkpoints.load(lake.files, "single")
    for number, values, said in ((2, np.float32("nan"), "weights are not finite"), (3, None, "of another layout")):
        arrays = dict(found.arrays)
        arrays["model.norm.weight"] = arrays["model.norm.weight"][:5] if values is None else np.full(16, values)
        checkpoints.save(lake.files, "single", checkpoints.Checkpoint(number, found.facts, arrays))
        with pytest.raises(LakeError, match=f"run single.*{said}"):
            load_tokens(lake.files, "single")
