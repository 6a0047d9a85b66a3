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
from tests.interop.test_opendrive import ROOT, SOURCES, TOOLS, run

PLAYER = os.environ.get("SCENARIONET_ESMINI")
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


@pytest.mark.skipif(PLAYER is None, reason="set SCENARIONET_ESMINI to the player esmini")
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
    x, y, heading = map(titles.index, ("World_Position_X", "World_Position_Y", "World_Heading_Angle"))
    found = {}
    for line in lines[head + 1 :]:
        step = round(float(line[1]) / scenario.dt)
        if step >= scenario.num_timesteps:
            break
        for start in range(2, len(line) - len(titles) + 1, len(titles)):
            state = line[start : start + len(titles)]
            found[names[state[0]], step] = tuple(float(state[column]) for column in (x, y, heading))
    return found
