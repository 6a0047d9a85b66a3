"""OpenSCENARIO files in ASAM's schema, and played by esmini."""

from __future__ import annotations

import csv
import os
from pathlib import Path

import numpy as np
import pytest

from scenarionet_data import Lake, ScenarioLoader, convert
from scenarionet_data.interchange import writer_for
from scenarionet_data.interchange.base import Losses
from scenarionet_data.interchange.files import write_files
from scenarionet_data.interchange.openscenario.reader import OpenScenario
from scenarionet_data.testing import ConverterConformance
from scenarionet_sim.evaluation.adding import add_run
from tests.interop.test_opendrive import ROOT, SOURCES, TOOLS, run

PLAYER = os.environ.get("SCENARIONET_ESMINI")
needs_esmini = pytest.mark.skipif(PLAYER is None, reason="set SCENARIONET_ESMINI to the player esmini")
DATA = os.environ.get("SCENARIONET_TEST_DATA")

pytestmark = pytest.mark.interop


@pytest.fixture(scope="module")
def scenarios(tmp_path_factory):
    """Generated scenarios, and recorded ones where there are any."""
    folder = tmp_path_factory.mktemp("openscenario") / "lake"
    convert("pg", "0:6", folder)
    for name, raw in SOURCES.items() if DATA else ():
        convert(name, Path(DATA) / raw, folder)
    ids = Lake(folder).select("num_map_features > 0")
    return [*ScenarioLoader(folder, ids)]


def write(scenario, folder, **options) -> Path:
    for name, content in writer_for("openscenario", options).write(scenario, "scenario", Losses()).items():
        (folder / name).write_bytes(content)
    return folder / "scenario.xosc"


@pytest.mark.parametrize("version", ["1.2", "1.3"])
def test_schema(scenarios, tmp_path, version):
    if not DATA:
        pytest.skip("ASAM's schemas: set SCENARIONET_TEST_DATA to the folder with exchange/schema")
    schema = Path(DATA) / f"exchange/schema/OpenSCENARIOv{version}.xsd"
    paths = []
    for number, scenario in enumerate(scenarios):
        (tmp_path / str(number)).mkdir()
        paths.append(write(scenario, tmp_path / str(number), version=version))
    assert run(TOOLS / "python", ROOT / "tests/interop/validates.py", schema, *paths) == ""


@needs_esmini
def test_esmini_plays_what_was_recorded(scenarios, tmp_path):
    """At every recorded step every object is there, within 0.05 m (p99) and 0.10 m, and 1 degree.

    No object is there at other steps, but in the first two.
    """
    errors, turns = [], []
    for number, scenario in enumerate(scenarios):
        folder = tmp_path / str(number)
        folder.mkdir()
        played = play(write(scenario, folder), scenario)
        tracks = scenario.tracks
        wanted = {(row, step) for row, step in np.argwhere(tracks.valid).tolist()}
        assert wanted <= set(played), (scenario.id, sorted(wanted - set(played))[:5])
        assert {step for _, step in set(played) - wanted} <= {0, 1}, scenario.id
        rows, steps = np.array(sorted(wanted)).T
        found = np.array([played[key] for key in sorted(wanted)])
        errors.append(np.hypot(*(found[:, :2] - tracks.position[rows, steps, :2]).T))
        turns.append(np.abs((found[:, 2] - tracks.heading[rows, steps] + np.pi) % (2 * np.pi) - np.pi))
    error, turn = np.concatenate(errors), np.degrees(np.concatenate(turns))
    print(f"{len(scenarios)} scenarios, {len(error):,} states: p99 {np.quantile(error, 0.99):.4f} m, "
          f"at most {error.max():.4f} m, {turn.max():.3f} degrees")  # fmt: skip
    assert np.quantile(error, 0.99) <= 0.05
    assert error.max() <= 0.10
    assert turn.max() <= 1.0


def play(path: Path, scenario) -> dict[tuple[int, int], tuple[float, float, float]]:
    """Position and heading of each object at each timestep at which it is there."""
    states = path.with_suffix(".csv")
    run(
        PLAYER, "--osc", path, "--headless", "--fixed_timestep", scenario.dt, "--traj_filter", "0", "--csv_logger",
        states, "--disable_stdout", cwd=path.parent,
    )  # fmt: skip
    names = {"Ego": scenario.ego_index} | {f"object-{track}": row for row, track in enumerate(scenario.tracks.ids)}
    with states.open(newline="") as file:
        lines = [[word.strip() for word in line] for line in csv.reader(file)]
    head = next(number for number, line in enumerate(lines) if line[0].startswith("Index"))
    titles = [title.split("#1 ")[-1].split(" [")[0] for title in lines[head][2:] if title.startswith("#1 ")]
    columns = [*map(titles.index, ("World_Position_X", "World_Position_Y", "World_Heading_Angle", "bb_x"))]
    found = {}
    for line in lines[head + 1 :]:
        step = round(float(line[1]) / scenario.dt)
        if step >= scenario.num_timesteps:
            break
        for start in range(2, len(line) - len(titles) + 1, len(titles)):
            state = line[start : start + len(titles)]
            x, y, heading, ahead = (float(state[column]) for column in columns)
            found[names[state[0]], step] = x + ahead * np.cos(heading), y + ahead * np.sin(heading), heading
    return found


@needs_esmini
class TestReader(ConverterConformance):
    converter = OpenScenario()
    damaged_glob = "*.xosc"

    @pytest.fixture(scope="class")
    @classmethod
    def raw(cls, scenarios, tmp_path_factory):
        folder = tmp_path_factory.mktemp("raw")
        generated = [scenario for scenario in scenarios if scenario.dataset == "pg"]
        for number, scenario in enumerate(generated[:3]):
            (folder / str(number)).mkdir()
            write(scenario, folder / str(number))
        return folder


@needs_esmini
def test_samples_become_scenarios_with_the_positions_of_the_log(tmp_path):
    """Of all files that esmini plays, each permutation of each file of distributions among them."""
    if not DATA:
        pytest.skip("samples: set SCENARIONET_TEST_DATA to the folder with exchange/openscenario")
    raw = Path(DATA) / "exchange" / "openscenario"
    report = convert("openscenario", str(raw), tmp_path / "lake")
    found = {scenario.source.file: scenario for scenario in ScenarioLoader(tmp_path / "lake")}
    told = Lake(tmp_path / "lake").sql("SELECT message FROM quarantine")["message"].to_list()
    assert all("esmini does not play it: " in reason for reason in told)
    files = [path for path in raw.rglob("*.xosc") if "<Catalog " not in path.read_text("utf-8")]
    distributions = [path for path in files if "<ParameterValueDistribution>" in path.read_text("utf-8")]
    assert len(found) - sum("_of_" in name for name in found) + report.quarantined == len(files) - len(distributions)
    assert sum("_of_" in name for name in found) >= 100
    most = 0.0
    for path in files:
        if path in distributions or path.relative_to(raw).as_posix() not in found:
            continue
        scenario = found[path.relative_to(raw).as_posix()]
        run(PLAYER, "--osc", path, "--headless", "--fixed_timestep", "0.1", "--traj_filter", "0", "--csv_logger",
            tmp_path / "log.csv", "--disable_stdout", cwd=tmp_path)  # fmt: skip
        lines = [
            [word.strip() for word in line] for line in csv.reader((tmp_path / "log.csv").read_text().splitlines())
        ]
        for line in lines[7 : 7 + scenario.num_timesteps]:
            for first in range(2, len(line) - 30, 31):
                name, box, x, y, heading = (line[first + at] for at in (0, 5, 11, 12, 24))
                row, step = scenario.tracks.index(name.removeprefix("object-")), int(line[0])
                middle = np.array([float(x), float(y)]) + float(box) * np.array(
                    [np.cos(float(heading)), np.sin(float(heading))]
                )
                most = max(most, np.abs(scenario.tracks.position[row, step, :2] + scenario.origin[:2] - middle).max())
    assert most < 1e-3


@needs_esmini
def test_what_esmini_plays_comes_back_as_a_run(tmp_path):
    convert("pg", "0:4", tmp_path / "lake")
    lake = Lake(tmp_path / "lake")
    write_files(ScenarioLoader(lake), tmp_path / "files", writer_for("openscenario"))
    convert("openscenario", str(tmp_path / "files"), tmp_path / "played")
    added = add_run(lake, tmp_path / "played", "esmini")
    assert (added.scenarios, added.broken, added.unknown_objects) == (4, [], 0)
    results = lake.sql("SELECT * FROM results WHERE run = 'esmini'")
    assert results["final_displacement"].max() < 0.1
    assert results["success"].all()
