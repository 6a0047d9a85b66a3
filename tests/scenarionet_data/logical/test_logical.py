"""Files of logical scenarios: the library, arithmetic, grids, lineage, and sentences for what is wrong."""

from __future__ import annotations

import itertools
import xml.etree.ElementTree as ET

import numpy as np
import pytest

from scenarionet_data import Lake, convert
from scenarionet_data.errors import BadParameter
from scenarionet_data.logical import move, read_logical
from scenarionet_data.logical.description import LIBRARY, parse_logical
from scenarionet_data.logical.expressions import evaluate

FILE = """
[parameters]
speed = [10, 20]
[[actors]]
id = "ego"
speed = "speed"
at = 20
"""


def test_expressions_are_computed_over_arrays():
    speed = np.array([10.0, 20.0])
    assert evaluate("min(speed / 2, 7) ** 2 - -1", {"speed": speed}).tolist() == [26.0, 50.0]
    assert evaluate("where(speed > 15, 1, 0)", {"speed": speed}).tolist() == [0.0, 1.0]
    with pytest.raises(BadParameter, match="is unknown; wanted arithmetic"):
        evaluate("__import__('os')", {})
    with pytest.raises(BadParameter, match=r"gives inf; wanted finite"):
        evaluate("1 / (speed - 10)", {"speed": speed})


def test_a_car_that_brakes_and_moves_aside_is_where_the_formulas_say():
    logical = parse_logical(
        FILE.replace("speed = [10, 20]", "speed = [10, 20]\nrate = [2, 4]")
        + 'changes = [{ start = 2, to = "speed - 5", rate = "rate" }]\n'
        + "moves = [{ to = 3.5, duration = 4, start = 3 }, { to = 0, rate = 1, passes = 1, at = 9.5 }]",
        "braking",
    )
    motions = move(logical, np.array([[15.0, 2.5], [20.0, 4.0]]))
    assert motions.position[0, 0, 50, 0] == pytest.approx(20 + 15 * 2 + (15 + 10) / 2 * 2 + 10 * 1)
    assert motions.velocity[1, 0, -1].tolist() == pytest.approx([15.0, -1.0])
    lane = motions.position[0, 0, 0, 1]
    assert motions.position[:, 0, [50, 95], 1] == pytest.approx(np.array([[lane + 1.75, lane + 1.0]] * 2))
    step = np.diff(motions.position[:, 0], axis=1) / logical.dt
    assert (
        np.abs(step - (motions.velocity[:, 0, 1:] + motions.velocity[:, 0, :-1]) / 2).max() < 0.51
    )  # where a rate jumps
    heading = np.arctan2(motions.velocity[..., 1], motions.velocity[..., 0])
    assert motions.heading == pytest.approx(heading)


@pytest.mark.parametrize("path", sorted(LIBRARY.glob("*.toml")), ids=lambda path: path.stem)
def test_every_file_of_the_library_moves_its_road_users_on_their_routes(path):
    logical = read_logical(path.stem)
    rows = logical.draw(50, 0, "grid" if path.stem.startswith("ncap") else "sobol")
    motions = move(logical, rows)
    assert motions.valid[:, 0].all() and np.isfinite(motions.position).all()


@pytest.mark.parametrize("case", ["CCRs", "CCRm", "CCRb", "CCFhos", "CCFtap"])
def test_the_grids_of_ncap_are_those_of_the_openscenario_files(recordings, case):
    folder = recordings / "exchange/openscenario/OpenSCENARIO/NCAP/AEB_C2C_2023/Variations"
    path = folder / f"NCAP_AEB_C2C_{case}_Variation_2023.xosc"
    if not path.is_file():
        pytest.skip(f"{path} is not there")
    axes = {}
    for each in ET.parse(path).iter("DeterministicSingleParameterDistribution"):
        name = each.get("parameterName")
        if (bounds := each.find(".//Range")) is not None:
            low, high = float(bounds.get("lowerLimit")), float(bounds.get("upperLimit"))
            axes[name] = np.arange(low, high + 1e-6, float(each.find("DistributionRange").get("stepWidth"))).tolist()
        else:
            axes[name] = [element.get("value") for element in each.iter("Element")]
    logical = read_logical(f"ncap_{case.lower()}")
    names = [each.name for each in logical.parameters if each.name in axes]
    wanted = {tuple(map(float, row)) for row in itertools.product(*(axes[name] for name in names))}
    columns = [k for k, each in enumerate(logical.parameters) if each.name in axes]
    assert {tuple(row) for row in logical.draw(1, 0, "grid")[:, columns].tolist()} == wanted and wanted


def test_stationary_target_of_ncap_stands_five_seconds_ahead_with_its_overlap():
    logical = read_logical("ncap_ccrs")
    motions = move(logical, np.array([[36.0, 50.0, 0.0], [36.0, -50.0, 0.0], [36.0, 100.0, 0.0]]))
    ego, target = motions.position[:, 0, 0], motions.position[:, 1, 0]
    assert (target - ego)[:, 0] == pytest.approx([50 - 0.021] * 3)
    shared = 1.815 / 2 + 1.712 / 2 - np.abs(target - ego)[:, 1]  # of the width of the ego's front, on one side
    assert shared[:2] == pytest.approx([0.5 * 1.815] * 2) and (target - ego)[:, 1] == pytest.approx([0.856, -0.856, 0])


def test_concrete_scenarios_have_a_lineage_and_are_not_made_twice(tmp_path):
    assert convert("logical", "cut_in", tmp_path / "lake", options={"number": 3}).converted == 3
    more = convert("logical", "cut_in", tmp_path / "lake", options={"number": 5})
    assert more.converted == 2
    lake = Lake(tmp_path / "lake")
    query = "SELECT extras ->> '$.parent', parameter(extras, 'gap') FROM metadata ORDER BY scenario_id"
    wanted = read_logical("cut_in").draw(5)[:, 2]
    assert [row[1] for row in lake.sql(query).rows()] == wanted.tolist()
    assert {row[0] for row in lake.sql(query).rows()} == {"logical/cut_in"}


def test_what_cannot_be_is_quarantined_with_its_reason(tmp_path):
    text = FILE + "changes = [{ start = 2, to = 0, rate = 12 }]"
    (tmp_path / "stop.toml").write_text(text)
    report = convert("logical", str(tmp_path / "stop.toml"), tmp_path / "lake", options={"number": 4})
    assert (report.converted, report.quarantined) == (0, 4)
    reasons = Lake(tmp_path / "lake").sql("SELECT DISTINCT field FROM quarantine").rows()
    assert reasons == [("acceleration",)]


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ("[10, 20]", "[20, 10]", "wanted LOW:HIGH with LOW at most HIGH"),
        ("[10, 20]", '"norm(0, -1)"', "gives nan"),
        ('"ego"', '"car"', "the first road user is 'car'; wanted 'ego'"),
        ("at = 20", "", "wanted one of at, gap, after and meets"),
        ("at = 20", 'gap = 3\nof = "ego"', "wanted a road user listed before: none"),
        ("at = 20", "at = 20\nwhere = 3", "'where' is unknown; wanted id, type"),
        ("at = 20", 'at = "speeds"', "'speeds' is unknown"),
        ("at = 20", 'at = 20\nroute = ["9.f9"]', "lane '9.f9' is unknown; the road has 0.f0"),
        ("at = 20", "at = 20\nchanges = [{ start = 1, to = 5, rate = -2 }]", "wanted a rate above 0"),
        ("at = 20", "at = 20\nmoves = [{ to = 3, duration = 2, passes = 4, at = 3 }]", "not between the offsets"),
        (
            "at = 20",
            "at = 20\nmoves = [{ to = 3, duration = 2, start = 1 }, { to = 0, rate = 1, start = 2 }]",
            "two moves",
        ),
        ("[[actors]]", "[road]\nradius = 3.0\n[[actors]]", "radius=3: wanted 0, or more than the road is wide"),
        ("[[actors]]", "[road]\nlanes = 1.5\n[[actors]]", "lanes=1.5; wanted int"),
    ],
)
def test_bad_files_are_a_sentence(tmp_path, old, new, message):
    (tmp_path / "bad.toml").write_text(FILE.replace(old, new))
    with pytest.raises(BadParameter, match=message.replace("(", "\\(")):
        convert("logical", str(tmp_path / "bad.toml"), tmp_path / "lake", options={"number": 2})


def test_an_unknown_name_lists_the_library():
    with pytest.raises(BadParameter, match="one of crossing_pedestrian, cut_in, cut_out"):
        read_logical("cutin")


def test_combinations_with_a_speed_below_0_cannot_be(tmp_path):
    """And the others can."""
    text = (LIBRARY / "cut_in.toml").read_text().replace("[15, 33]", '"5"').replace("[0, 10]", '"2,8"')
    (tmp_path / "slow.toml").write_text(text)
    report = convert("logical", str(tmp_path / "slow.toml"), tmp_path / "lake", options={"number": 20})
    assert report.converted + report.quarantined == 20 and report.converted and report.quarantined
    lake = Lake(tmp_path / "lake")
    assert set(lake.sql("SELECT parameter(extras, 'slower') FROM metadata").to_series()) == {2.0}
    told = lake.sql("SELECT DISTINCT message FROM quarantine").item()
    assert "wanted speeds from 0 on, found one below of cutter at the start" in told
