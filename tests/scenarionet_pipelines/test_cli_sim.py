"""The verbs that simulate: sim, record, check --simulate."""

from __future__ import annotations

import json
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from scenarionet_data import Lake
from scenarionet_pipelines.cli.progress import ProgressDisplay
from tests.fixtures.drives import Other, make_drive
from tests.fixtures.lakes import write_lake
from tests.scenarionet_pipelines.conftest import run

pytestmark = pytest.mark.integration

SCENARIOS = [make_drive(f"d{k}", speed=8.0 + k, others=(Other(15.0, vx=4.0),)) for k in range(3)]


@pytest.fixture
def lake(tmp_path) -> Path:
    return write_lake(tmp_path / "lake", SCENARIOS).root


def test_sim_prints_results_and_the_next_query(lake, ok):
    text = ok("sim", lake, "--policy", "replay", "--workers", "1")
    rows = {line.split()[0]: line.split()[1:] for line in text.splitlines() if line.split()}
    assert "run all-replay-replay-kinematic, took" in text
    assert rows["success"][:3] == ["1", "1", "1"], "the run, the recording, constant velocity; random actions"
    assert float(rows["success"][3]) < 1.0
    assert rows["crashed"][:3] == ["1", "1", "1"] and rows["collided_vehicles"][0] == "3"
    query = text.partition("Failures: scenarionet sql ")[2].partition(' "')[2].strip().removesuffix('"')
    assert "JOIN metadata" in query
    ok("sql", lake, query)
    assert "skipped    3 scenarios" in ok("sim", lake, "--policy", "replay", "--workers", "1")
    runs = ok("sql", lake, "runs")
    assert "all-replay-replay-kinematic" in runs and runs.count("reference-") == 3


def test_sim_and_its_comparison_need_no_matplotlib(lake):
    """The extra ``sim`` does not install it."""

    def without(*words):
        program = f"import sys; sys.modules['matplotlib'] = None; sys.argv = {['scenarionet', *map(str, words)]}\n"
        program += "from scenarionet_pipelines.cli import main; main()"
        done = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True, check=False)
        assert done.returncode == 0, done.stderr
        return done.stdout

    for policy in ("replay", "constant"):
        said = without("sim", lake, "--policy", policy, "--name", policy, "--no-references", "--workers", "1")
        assert "route_completion" in said
    assert "route_completion" in without("runs", "compare", lake, "replay", "constant")


def test_progress_counts_the_scenarios_of_the_run_and_of_missing_references(lake, ok, monkeypatch):
    def counted(*words):
        found = []
        with monkeypatch.context() as patch:
            patch.setattr(ProgressDisplay, "update", lambda _, done, total, scenarios=0: found.append((done, total)))
            ok("sim", lake, "--workers", "1", *words)
        return found

    monkeypatch.setattr("scenarionet_sim.evaluation.specification.PART_SIZE", 2)  # of three scenarios: two parts
    assert counted("--policy", "replay", "--no-references") == [(0, 3), (1, 3), (3, 3)]
    first = counted("--policy", "constant")
    assert first[0] == (0, 12) and first[-1] == (12, 12), "the run, the recording, constant velocity, random actions"
    assert [done for done, _ in first] == [0, 1, 3, 4, 6, 7, 9, 10, 12]
    assert counted("--policy", "idm") == [(0, 3), (1, 3), (3, 3)], "the references are there"


def test_sim_of_a_database_as_json(lake, ok, as_json):
    ok("filter", lake, "--where", "ego_mean_speed > 8.5", "--name", "fast")
    found = as_json("sim", lake, "fast", "--policy", "idm", "--traffic", "idm", "--name", "mine", "--workers", "1",
                    "--rollouts", "2", "--episode", "nuplan", "--no-references")  # fmt: skip
    assert (found["rollouts"], found["references"]) == (4, {})
    assert (found["run"], found["scenarios"], found["not_simulated"], found["broken"]) == ("mine", 2, 0, [])
    assert 0.0 < found["route_completion"] <= 1.0


def test_sim_with_a_driver_in_the_current_folder(lake, tmp_path, monkeypatch, as_json):
    (tmp_path / "my_planner.py").write_text(
        "class Planner:\n"
        "    def act(self, observation):\n"
        "        return [0.0, -1.0]\n"
        "class Broken:\n"
        "    def act(self, observation):\n"
        "        raise RuntimeError('no plan')\n"
    )
    monkeypatch.chdir(tmp_path)
    words = "sim", lake, "--backend", "kinematic", "--workers", "1", "--no-references"
    found = as_json(*words, "--policy", "my_planner:Planner")
    assert (found["run"], found["timeout"]) == ("all-my_planner.Planner-replay-kinematic", 1.0)
    failed = run(*words, "--policy", "my_planner:Broken")
    assert failed.exit_code == 1
    assert f"could not be simulated: {SCENARIOS[0].id}: RuntimeError: no plan" in failed.stderr


@pytest.mark.parametrize(
    ("words", "message"),
    [
        (("--policy", "idn"), "unknown policy 'idn'"),
        (("nothing", "--policy", "idm"), "no database 'nothing'"),
        ((), "Missing option '--policy'"),
        (("--policy", "idm", "--name", "a/b"), "'a/b' is not a valid name of a run"),
    ],
)
def test_sim_rejects_bad_options(lake, words, message):
    result = run("sim", lake, *words)
    assert result.exit_code == 2
    assert message in result.stderr


def test_run_with_other_parameters_is_refused(lake, ok):
    ok("sim", lake, "--policy", "replay", "--name", "mine", "--workers", "1")
    result = run("sim", lake, "--policy", "constant", "--name", "mine")
    assert result.exit_code == 2
    assert "a run 'mine' exists with policy 'replay', not 'constant'; choose another name" in result.stderr
    assert "--name NAME" in result.stderr


def test_verify_a_run_and_its_receipt(lake, ok, as_json, tmp_path):
    ok("sim", lake, "--policy", "idm", "--name", "mine", "--workers", "1", "--no-references")
    assert ok("runs", "verify", lake, "mine", "--workers", "1") == "mine: all values of 3 rows are equal, bit by bit\n"
    receipt = tmp_path / "mine.json"
    assert "with 3 rows" in ok("runs", "verify", lake, "mine", "--write", receipt)
    found = as_json("runs", "verify", lake, receipt, "--workers", "1")
    assert (found["rows"], found["differing"], found["first"]) == (3, 0, None)
    ok("sim", lake, "--policy", "constant", "--name", "slower", "--workers", "1", "--no-references")
    ok("runs", "compare", lake, "slower", "mine", "--receipt", tmp_path / "both.json")
    equal = ok("runs", "verify", lake, tmp_path / "both.json", "--workers", "1")
    assert equal.startswith("slower and mine: all values of ")
    told = json.loads(receipt.read_text())
    told["rows"][1]["mean_speed"] += 0.5
    receipt.write_text(json.dumps(told))
    result = run("runs", "verify", lake, receipt, "--workers", "1")
    assert result.exit_code == 1
    assert "mine: 1 of 3 rows differ\nthe first: " in result.stdout
    assert "largest difference of mean_speed: 0.5" in result.stdout
    missing = run("runs", "verify", lake, tmp_path / "none.json")
    assert missing.exit_code == 2 and "cannot be read" in missing.stderr


def test_a_run_of_another_simulator_is_added(lake, as_json, ok, tmp_path):
    ok("filter", lake, "--where", "true", "--name", "every")
    ok("export", lake, "every", tmp_path / "scenes", "--format", "sumo")  # with the recorded motion as SUMO writes it
    ok("convert", "sumo", tmp_path / "scenes", tmp_path / "played", "--workers", "1")
    found = as_json("runs", "add", lake, tmp_path / "played", "--name", "sumo")
    assert (found["scenarios"], found["broken"], found["unknown_scenarios"]) == (3, [], [])
    ok("sim", lake, "every", "--policy", "replay", "--name", "replay", "--workers", "1", "--no-references")
    query = "SELECT run, avg(crashed::INT) AS crashed, max(final_displacement) AS off FROM results GROUP BY run"
    runs = {run: (crashed, off) for run, crashed, off in Lake(lake).sql(query).rows()}
    assert runs == {"replay": (1.0, 0.0), "sumo": (1.0, pytest.approx(0.0, abs=1e-3))}
    stray = write_lake(tmp_path / "stray", [make_drive("other")]).root
    result = run("runs", "add", lake, stray, "--name", "stray")
    assert result.exit_code == 2 and "no scenario is one of" in result.stderr
    verified = run("runs", "verify", lake, "sumo")
    assert verified.exit_code == 2 and "no run of `scenarionet sim`" in verified.stderr


def test_record(lake, as_json, ok):
    words = "record", lake, "--agents", "ego", "--workers", "1"
    found = as_json(*words)
    assert (found["run"], found["scenarios"], found["observations"]) == ("all-ego-observed", 3, 3 * 41)
    assert as_json(*words)["skipped"] == 3
    assert "all-ego-observed: 123 observations of 3 scenarios" in ok(*words)


def test_record_with_a_camera(lake, ok):
    ok("runs", "record", lake, "--agents", "ego", "--workers", "1", "--camera", "48x32", "--name", "seen")
    frames = Lake(lake).sql("SELECT * FROM frames WHERE run = 'seen' ORDER BY scenario_id, timestep")
    assert len(frames) == 3 * 41
    assert set(frames.select("camera", "channel", "height", "width", "dtype").rows()) == {(0, "rgb", 32, 48, "uint8")}
    pictures = [np.frombuffer(pixels, np.uint8).reshape(32, 48, 3) for pixels in frames["pixels"]]
    assert not np.array_equal(pictures[0], pictures[40]), "the vehicle moves"
    wrong = run("runs", "record", lake, "--camera", "48")
    assert wrong.exit_code == 2 and "--camera" in wrong.stderr


def test_check_simulate_names_failing_scenarios(lake, ok):
    words = "maintain", "check", lake, "--simulate", "--only", "ids_are_unique", "--workers", "1"
    assert "ok  replays         The ego of every recording reaches its destination when replayed.\n" in ok(*words)
    path = next((lake / "tracks").rglob("*.parquet"))
    damaged = bytearray(path.read_bytes())
    damaged[200:400] = bytes(200)
    path.write_bytes(bytes(damaged))
    result = run(*words)
    assert result.exit_code == 1
    assert "FAILED  replays" in result.stdout, result.stderr
    assert SCENARIOS[0].id in result.stdout


@pytest.fixture
def compared(lake, ok) -> tuple:
    """A command that compares two runs, the first without trajectories."""
    for words in (("idm", "--metrics-only"), ("constant",)):
        ok("sim", lake, "--policy", *words, "--workers", "1", "--no-references", "--name", words[0])
    return "compare-runs", lake, "idm", "constant"


def test_compare_runs_prints_saves_and_fails(compared, lake, as_json):
    found = as_json(*compared, "--worse", "crashes")
    assert [name for name, _ in found["worse"]] == sorted(scenario.id for scenario in SCENARIOS)
    assert Lake(lake).database("crashes").scenario_ids == [name for name, _ in found["worse"]]
    failed = run(*compared, "--fail-if", "crashed > 0.01")
    assert failed.exit_code == 1 and "failed: crashed > 0.01 holds for constant" in failed.stderr
    assert "+1 [+1, +1] (n = 3)" in failed.stdout and "0 scenarios better, 3 worse in constant" in failed.stdout
    assert all(scenario.id in failed.stdout for scenario in SCENARIOS), "the worst cases are listed"
    last = failed.stdout.splitlines()[-1]
    assert last.startswith(f"constant is significantly worse in {len(found['verdict']['worse'])} of ")
    assert "crashed" in last and f" of {found['verdict']['measures']} measures: " in last


@pytest.mark.long
def test_page_of_runs_has_pictures_of_the_worst(compared, tmp_path, ok):
    page = tmp_path / "page.html"
    ok(*compared, "--html", page)
    html = page.read_text("utf-8")
    assert html.count("data:image/png") == 3 and SCENARIOS[0].id in html
