"""Closed-loop evaluation: results in the lake, in parts, resumable, independent of the workers."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import polars as pl
import pytest

from scenarionet_data import Lake, converters
from scenarionet_data.conversion import convert
from scenarionet_data.errors import BadParameter
from scenarionet_sim.evaluation import evaluation as evaluations
from scenarionet_sim.evaluation.evaluation import EvaluationReport, evaluate, find_broken, plan_evaluation
from scenarionet_sim.evaluation.recording import record
from scenarionet_sim.evaluation.references import run_references
from scenarionet_sim.evaluation.specification import Evaluation
from scenarionet_sim.policies.constant_velocity import ConstantVelocity
from scenarionet_sim.sensors.state import EgoState
from tests.fixtures.drives import Other, make_drive
from tests.fixtures.lakes import write_lake
from tests.fixtures.made import NAME, write_raw

pytestmark = pytest.mark.integration

SCENARIOS = [make_drive(f"d{k}", speed=8.0 + k, others=(Other(15.0 + 5 * k, vx=4.0),)) for k in range(5)]


class GoAhead:
    """Go straight on at full throttle."""

    def __init__(self) -> None:
        self.episodes = 0

    def reset(self) -> None:
        self.episodes += 1

    def act(self, observation: np.ndarray) -> list[float]:
        assert observation.ndim == 1 and observation.dtype == np.float32
        return [0.0, 1.0]


class Confused:
    """Answers no number to egos at 9 m/s and 11 m/s."""

    sensors = (EgoState(),)

    def act(self, observation: np.ndarray) -> list[float]:
        speed = round(40.0 * float(observation[0]))
        return [np.nan, 0.0] if speed in (9, 11) else [0.0, 0.0]


class Glide(ConstantVelocity):
    """A custom policy."""


class NoDriver:
    pass


@pytest.fixture
def lake(tmp_path, monkeypatch) -> Lake:
    monkeypatch.setattr("scenarionet_sim.evaluation.specification.PART_SIZE", 2)
    evaluations.scenarios_of.cache_clear()
    return write_lake(tmp_path / "lake", SCENARIOS)


def own(name: str) -> str:
    return f"{__name__}:{name}"


@pytest.mark.long
def test_run_over_a_database_goes_on_after_the_lake_has_grown(lake, tmp_path):
    raw = str(write_raw(tmp_path / "raw", {"a": [1]}))
    database = lake.filter("true", name="drives")
    evaluate(lake, database, policy="replay", name="first")
    convert(NAME, raw, lake.root)
    grown = Lake(lake.root)
    assert (grown.snapshot.number, len(grown)) == (2, 6)
    assert evaluate(grown, "drives", policy="replay", name="first").skipped == 5
    assert record(grown, "drives", name="seen") == 0
    write_raw(tmp_path / "raw", {"b": [2]})
    convert(NAME, raw, lake.root)
    assert record(Lake(lake.root), "drives", name="seen") == 5
    evaluate(grown, policy="replay", name="all")
    with pytest.raises(BadParameter, match="a run 'all' exists with snapshot 2, not 3"):
        evaluate(Lake(lake.root), policy="replay", name="all")


def test_results_and_rollouts_are_in_the_lake(lake):
    calls = []
    report = evaluate(lake, policy="idm", name="first", on_progress=lambda *numbers: calls.append(numbers))
    assert (report.scenarios, report.skipped, report.broken) == (5, 0, [])
    assert calls == [(1, 3, 2), (2, 3, 4), (3, 3, 5)]
    rows = lake.sql("SELECT * FROM results JOIN metadata USING (scenario_id) ORDER BY scenario_id")
    assert rows["scenario_id"].to_list() == [scenario.id for scenario in SCENARIOS]
    assert (rows["cost"] == 0).all() and (rows["route_completion"] > 0.5).all()
    assert rows["track_id"].to_list() == ["t0"] * 5
    ends = lake.sql("SELECT *, len(x) - 1 AS steps, x[-1] AS end FROM rollouts WHERE is_judged ORDER BY scenario_id")
    assert ends["steps"].to_list() == rows["steps"].to_list()
    assert (ends["track_id"] == "t0").all() and (ends["end"] > 15.0).all()
    assert lake.named_query("runs", {"run": "first"})["success"].item() == rows["success"].mean()


def test_killed_run_is_continued(lake):
    whole = evaluate(lake, policy="replay", name="whole")
    evaluate(lake.root, policy="replay", name="killed")
    lake.files.path("results/killed/results/000001.parquet").unlink()
    again = evaluate(str(lake.root), policy="replay", name="killed")
    assert (whole.skipped, again.skipped) == (0, 3)
    one, two = (lake.sql("SELECT * EXCLUDE run FROM results WHERE run = $run ORDER BY scenario_id", {"run": run})
                for run in ("whole", "killed"))  # fmt: skip
    assert one.equals(two)
    with pytest.raises(BadParameter, match="exists with policy 'replay', not 'idm'"):
        evaluate(lake, policy="idm", name="killed")


@pytest.mark.long
def test_rollouts_of_stochastic_policies_differ_and_are_continued(lake):
    words = {"policy": "constant-noisy", "traffic": "idm-sampled", "num_rollouts": 3, "seed": 7}
    evaluate(lake, **words, name="whole")
    keys = lake.sql("SELECT scenario_id, rollout, is_reactive FROM results WHERE run = 'whole' ORDER BY ALL")
    assert keys.rows() == [(scenario.id, k, True) for scenario in SCENARIOS for k in range(3)]
    ends = lake.sql("SELECT scenario_id, rollout, x[-1] AS x FROM rollouts WHERE is_judged AND run = 'whole'")
    assert ends["x"].n_unique() == 15
    evaluate(lake, **words, name="killed")
    lake.files.path("results/killed/results/000001.parquet").unlink()
    assert evaluate(lake, **words, name="killed").skipped == 3, "the part holds rollouts of two scenarios"
    one, two = (lake.sql("SELECT * EXCLUDE run FROM results WHERE run = $run ORDER BY ALL", {"run": run})
                for run in ("whole", "killed"))  # fmt: skip
    assert one.equals(two)
    with pytest.raises(BadParameter, match="exists with rollouts 3, not 2"):
        evaluate(lake, **words | {"num_rollouts": 2}, name="killed")
    with pytest.raises(BadParameter, match="0 rollouts of each scenario; expected at least 1"):
        evaluate(lake, **words | {"num_rollouts": 0})


def test_episode_of_a_benchmark_ends_in_time_and_may_begin_after_the_history(tmp_path):
    scenario = replace(make_drive("long", num_steps=201), current_timestep=10)
    lake = write_lake(tmp_path / "lake", [scenario])
    for episode in ("log", "nuplan", "wosac"):
        evaluate(lake, policy="constant", episode=episode, name=episode)
    rows = lake.sql("SELECT run, steps, status, progress_ratio FROM results ORDER BY run").rows()
    assert rows == [("log", 200, "success", 1.0), ("nuplan", 150, "unfinished", 1.0), ("wosac", 80, "unfinished", 1.0)]
    starts = lake.sql("SELECT DISTINCT run, start, len(x) FROM rollouts ORDER BY run").rows()
    assert starts == [("log", 0, 201), ("nuplan", 0, 151), ("wosac", 10, 81)]
    with pytest.raises(BadParameter, match="unknown episode 'day'; choose from log, nuplan, wosac"):
        evaluate(lake, policy="constant", episode="day")


def test_references_are_simulated_once(lake):
    plan = plan_evaluation(lake, None, "idm", num_rollouts=2)
    names = run_references(plan)
    assert list(names) == ["recording", "constant velocity", "random actions"]
    assert run_references(replace(plan, policy="replay")) == names
    runs = {run: (rollouts, crashed) for run, rollouts, crashed in lake.named_query("runs").select(
        "run", "rollouts", "nuplan_score").rows()}  # fmt: skip
    assert runs[names["recording"]] == (5, 0.0), "the recording drives through the slower car"
    assert runs[names["random actions"]][0] == 10


@pytest.mark.long
def test_results_do_not_depend_on_the_number_of_processes(lake):
    for run, workers in (("one", 1), ("two", 2)):
        evaluate(lake, policy="idm", traffic="idm", name=run, workers=workers)
    for table in ("results", "rollouts"):
        one, two = (
            lake.sql(f"SELECT * EXCLUDE run FROM {table} WHERE run = '{run}' ORDER BY scenario_id, track_id")
            for run in ("one", "two")
        )
        assert one.equals(two)


def test_backend_option(lake):
    assert [plan_evaluation(lake, None, "replay", backend=name).backend for name in ("bullet", "kinematic")] == [
        "bullet",
        "kinematic",
    ]
    assert plan_evaluation(lake, None, "replay").backend == "kinematic"
    assert plan_evaluation(lake, None, own("GoAhead")).backend == "kinematic"


@pytest.mark.parametrize("backend", ["kinematic", "bullet"])
def test_custom_driver(lake, backend):
    if backend == "bullet":
        pytest.importorskip("pybullet")
    report = evaluate(lake, policy=own("GoAhead"), backend=backend, name=backend)
    assert report.broken == []
    rows = lake.sql("SELECT * FROM results")
    assert (rows["cost"] == 1).all(), "it runs into the slower car"
    assert (rows["max_lon_acceleration"] > 2.0).all()


def test_custom_policy_drives_the_ego(lake):
    for policy in (own("Glide"), "constant"):
        evaluate(lake, policy=policy, name=policy.rpartition(":")[2])
    rows = "SELECT scenario_id, steps, mean_speed, cost FROM results WHERE run = $run ORDER BY ALL"
    glide, constant = (lake.sql(rows, {"run": run}) for run in ("Glide", "constant"))
    assert glide.equals(constant)


def test_failing_scenario_does_not_end_the_run(lake):
    report = evaluate(lake, policy=own("Confused"), backend="kinematic", name="confused")
    failed = lake.sql("SELECT scenario_id, error FROM results WHERE error IS NOT NULL ORDER BY ALL")
    assert failed["scenario_id"].to_list() == [scenario.id for scenario in SCENARIOS[1::2]], "each part's second"
    assert failed["error"][0].startswith("BadParameter: an action is not finite")
    assert sorted(report.broken) == failed.rows()
    assert lake.named_query("runs").select("scenarios", "not_simulated").rows() == [(5, 2)]


def test_scenarios_that_could_not_be_read_are_tried_again(lake):
    """A file is damaged while a run is made, and restored afterwards."""
    path = next((Path(lake.root) / "tracks").rglob("*.parquet"))
    whole = path.read_bytes()
    path.write_bytes(whole[:200] + bytes(200) + whole[400:])
    first = evaluate(Lake(lake.root), policy="replay", name="again")
    failures = "SELECT scenario_id FROM results WHERE run = 'again' AND success IS NOT TRUE"
    assert first.broken and len(lake.sql(failures)) == len(first.broken)
    path.write_bytes(whole)
    second = evaluate(Lake(lake.root), policy="replay", name="again")
    assert not second.broken and second.skipped < 5 and lake.sql(failures).is_empty()
    assert lake.sql("SELECT count(*) FROM results").item() == 5
    assert evaluate(Lake(lake.root), policy="replay", name="again").skipped == 5


def test_database_is_evaluated_in_its_order(lake):
    lake.filter("ego_mean_speed > 9.5", name="fast")
    evaluate(lake, "fast", policy="replay", name="fast", rollouts=False)
    assert lake.sql("SELECT scenario_id FROM results ORDER BY ALL")["scenario_id"].to_list() == [
        s.id for s in SCENARIOS[2:]
    ]
    assert lake.sql("SELECT * FROM rollouts").is_empty()
    report = evaluate(lake, [SCENARIOS[3].id, SCENARIOS[0].id], policy="replay", rollouts=False)
    assert report.scenarios == 2 and report.run.startswith("2-scenarios-") and repr(report).count("\n") == 0


@pytest.mark.parametrize(
    ("policy", "options", "message"),
    [
        (
            "idn",
            {},
            "unknown policy 'idn'; choose from replay, idm, idm-sampled, constant, constant-noisy, log-planner, ",
        ),
        ("idm", {"traffic": "none"}, "unknown traffic 'none'; choose from replay, idm"),
        ("idm", {"backend": "cuda"}, "unknown backend 'cuda'; choose from kinematic, bullet"),
        ("nowhere:Planner", {}, "nowhere:Planner: No module named 'nowhere'; is its folder on PYTHONPATH"),
        (own("Missing"), {}, "has no attribute 'Missing'"),
        (own("NoDriver"), {}, "is not a driver: expected a subclass of Planner or Policy, or a class"),
    ],
)
def test_unknown_names_are_refused(lake, policy, options, message):
    with pytest.raises(BadParameter, match=message):
        evaluate(lake, policy=policy, **options)


def test_recordings_that_do_not_replay_are_listed(tmp_path):
    gone = make_drive("gone", hidden=slice(20, None))
    lake = write_lake(tmp_path / "lake", [*SCENARIOS[:2], gone])
    assert find_broken(lake) == []
    path = next(p for p in (tmp_path / "lake" / "tracks").rglob("*.parquet"))
    data = bytearray(path.read_bytes())
    data[200:400] = bytes(200)
    path.write_bytes(bytes(data))
    (broken,) = {reason.split(":")[0] for _, reason in find_broken(Lake(lake.root))} or {None}
    assert broken == "LakeError"


@pytest.mark.long
def test_real_recordings_replay(recordings, tmp_path):
    sources = [
        ("scenarionet", "scenarionet", {}),
        ("waymo", "waymo/training", {}),
        ("argoverse2", "argoverse2/motion-forecasting/val", {}),
        ("argoverse2", "argoverse2/sensor/val", {}),
        ("argoverse1", "argoverse1/forecasting/train", {"has_map": False}),
        ("lyft", "lyft", {"has_map": False}),
    ]
    for name, folder, options in sources:
        chosen = converters.get(name).Options(**options)
        convert(name, str(recordings / folder), tmp_path / "lake", split="train", options=chosen)
    lake = Lake(tmp_path / "lake")
    assert len(lake) >= 50
    assert find_broken(lake) == []
    evaluate(lake, policy="replay", name="replay", rollouts=False)
    rows = lake.sql("SELECT * FROM results")
    assert rows["success"].all()
    assert rows["average_displacement"].max() < 1e-5
    assert rows.select(pl.col("red_light_violations").sum(), pl.col("wrong_way_distance").max()).row(0) < (1, 2.0)


def test_report_is_shown_as_html():
    broken = [(f"d{k}", "<b>no lanes</b>") for k in range(12)]
    html = EvaluationReport("idm", scenarios=20, skipped=3, broken=broken, seconds=1.5)._repr_html_()
    assert "20, 3 of them simulated earlier" in html
    assert html.count("&lt;b&gt;no lanes&lt;/b&gt;") == 10 and "<b>" not in html


def test_parts_of_slow_planners_are_small():
    """So that workers share few scenarios, and what is finished is kept."""
    sizes = [Evaluation("lake", None, 1, policy).part_size for policy in ("idm", "commonroad:reactive")]
    assert sizes == [32, 2]
