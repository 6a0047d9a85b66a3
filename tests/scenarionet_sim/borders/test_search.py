"""The border of a driver that goes on at its speed, by hand; interruption; and what cannot be searched."""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np
import pytest

from scenarionet_data import Lake
from scenarionet_data.errors import BadParameter, QueryError
from scenarionet_sim import SearchSpace, search
from scenarionet_sim.borders.lattice import MIXED
from scenarionet_sim.borders.picture import save_map
from scenarionet_sim.borders.search import FAILS, PASSES

SPACE = SearchSpace("cut_in", "constant", {"ego_speed": 25, "lateral_time": 4}, resolution=1 / 32, monotone=("gap",))

pytestmark = pytest.mark.integration


@pytest.fixture(scope="module")
def whole(tmp_path_factory):
    lake = tmp_path_factory.mktemp("search") / "lake"
    return lake, search(str(lake), SPACE, name="whole")


def test_the_border_is_where_the_gap_closes_within_the_recording(whole):
    """The gap at 4 s closes by the difference of speeds within the remaining 6 s where gap <= 6 * slower."""
    lake, found = whole
    assert found.axes == ("slower", "gap") and found.resolution == 1 / 32 and found.impossible == 0
    slower, gap = map(np.array, found.edges)
    assert (slower[0], slower[-1], gap[0], gap[-1]) == (0, 10, 2, 28)
    passes = (gap[None, :] > 6 * slower[:, None]).astype(int)
    of_cell = sum(passes[i : i + 16, j : j + 16] for i in (0, 1) for j in (0, 1))
    by_hand = np.where(of_cell == 4, PASSES, np.where(of_cell == 0, FAILS, MIXED))
    assert np.array_equal(found.regions, by_hand)
    low, high = found.failing
    # Of the range of 10 m/s: from 4.6667 on all, from 0.3333 to that the triangle below the line.
    assert low < 1 - 0.46667 + 0.43333 / 2 < high < low + 0.2
    assert found.wrong == 0 and found.controls > 20 and found.simulated < 17**2 / 2
    crashed = Lake(lake).sql(
        "SELECT parameter(extras, 'gap') AS gap, parameter(extras, 'slower') AS slower, "
        "coalesce(first_collision <= duration, false) AS fails "
        "FROM results JOIN metadata USING (scenario_id) WHERE parent = 'logical/cut_in' AND version = 'whole'"
    )
    assert len(crashed) == found.simulated
    assert (crashed["fails"] == (crashed["gap"] <= 6 * crashed["slower"])).all()
    sides = Lake(lake).database("whole_border")
    assert 0 < len(sides) < found.simulated


def test_an_interrupted_search_goes_on(whole, tmp_path):
    lake, before = tmp_path / "lake", []

    def stop(number, simulated):
        before.append(simulated)
        if number == 3:
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        search(str(lake), SPACE, name="whole", on_round=stop)
    files = {path: path.stat().st_mtime_ns for path in (lake / "results").rglob("*.parquet")}
    found = search(str(lake), SPACE, name="whole")
    assert found == whole[1] and np.array_equal(found.regions, whole[1].regions)
    assert files and {path: path.stat().st_mtime_ns for path in files} == files, "what was simulated is not again"


def test_a_map_is_drawn(whole, tmp_path):
    save_map(whole[1], tmp_path / "map.png")
    assert (tmp_path / "map.png").read_bytes()[:4] == b"\x89PNG"


def test_the_example_of_the_guide_runs(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    page = (Path(__file__).parents[3] / "docs" / "guides" / "logical.md").read_text("utf-8")
    (example,) = [text for text in re.findall(r"```python\n(.*?)```", page, re.DOTALL) if "SearchSpace" in text]
    names: dict[str, object] = {}
    exec(example.replace("resolution=0.1", "resolution=0.25"), names)
    low, high = names["found"].failing
    assert low < 1 - 0.46667 + 0.43333 / 2 < high


def test_bad_input_is_a_sentence(tmp_path):
    with pytest.raises(BadParameter, match="no parameter 'speed'; it has ego_speed, slower"):
        SearchSpace("cut_in", "idm", {"speed": 1})
    with pytest.raises(BadParameter, match="every parameter has one value"):
        SearchSpace("cut_in", "idm", {"ego_speed": 25, "slower": 1, "gap": 5, "lateral_time": 4})
    with pytest.raises(BadParameter, match="LOW at most HIGH"):
        SearchSpace("cut_in", "idm", {"gap": (5, 2)})
    with pytest.raises(BadParameter, match=r"a share from 0\.001 to 0\.25"):
        SearchSpace("cut_in", "idm", resolution=0.0)
    one = {"ego_speed": 25, "lateral_time": 4, "slower": 5}
    with pytest.raises(QueryError, match="wanted true or false"):
        search(str(tmp_path / "lake"), SearchSpace("cut_in", "constant", one, failure="1.5"), name="s")
