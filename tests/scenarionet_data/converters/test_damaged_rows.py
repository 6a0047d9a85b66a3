"""A hundredth of the rows of a recording is damaged as real data is: everything else arrives, and the counts add up."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from scenarionet_data import Lake, ScenarioLoader, convert
from scenarionet_data.scenario.description import ScenarioDescription
from tests.fixtures import argoverse1, waymo

Cell = Callable[[list[str]], list[str]]


def set_cell(name: str, value: str) -> Cell:
    column = argoverse1.HEADER.split(",").index(name)
    return lambda cells: [*cells[:column], value, *cells[column + 1 :]]


CSV_DAMAGES: list[Cell] = [
    set_cell("X", "nan"),
    set_cell("Y", ""),
    set_cell("X", "1e12"),
    set_cell("Y", "-"),
    set_cell("TIMESTAMP", "null"),
    set_cell("TIMESTAMP", "9e99"),
    set_cell("TRACK_ID", ""),
    set_cell("CITY_NAME", "?"),
    lambda cells: cells[:4],
]


def damage_csv(path: Path, rng: np.random.Generator) -> set[tuple[str, str]]:
    """Damage 1 % of the rows, and repeat as many; return time and track of the damaged ones."""
    header, *lines = path.read_text().splitlines()
    chosen = rng.choice(len(lines), 2 * max(1, round(0.01 * len(lines))), replace=False)
    damaged, repeated = np.split(chosen, 2)
    keys = set()
    for row in damaged:
        cells = lines[row].split(",")
        keys.add((cells[0], cells[1]))
        lines[row] = ",".join(CSV_DAMAGES[rng.integers(len(CSV_DAMAGES))](cells))
    path.write_text("\n".join([header, *lines, *(lines[row] for row in repeated)]) + "\n")
    return keys


def test_argoverse1(tmp_path: Path) -> None:
    rng = np.random.default_rng(0)
    argoverse1.write_recordings(tmp_path / "whole" / "train" / "data", 8)
    argoverse1.write_recordings(tmp_path / "raw" / "train" / "data", 8)
    paths = sorted((tmp_path / "raw").rglob("*.csv"))
    num_rows = sum(len(path.read_text().splitlines()) - 1 for path in paths)
    keys = {path.stem: damage_csv(path, rng) for path in paths}
    num_damaged = sum(map(len, keys.values()))
    whole, found, report = both("argoverse1", tmp_path, {"has_map": False})
    assert report.dropped == 2 * num_damaged  # damaged, or there twice
    assert sum(int(s.tracks.valid.sum() - s.tracks.is_interpolated.sum()) for s in found) == num_rows - num_damaged
    for before, after in zip(whole, found, strict=True):
        lost = {
            (before.tracks.ids.tolist().index(name), int(np.abs(before.timestamps - seconds(time)).argmin()))
            for time, name in keys[before.source.scenario_id]
        }
        assert_others_arrived(before, after, lost)


def seconds(time: str) -> float:
    return float(time) - argoverse1.FIRST_TIME


NUMBERS: list[tuple[int, float]] = [(2, np.nan), (3, 1e12), (5, np.float32(0.0)), (6, np.float32(1e9)),
                                    (8, np.float32(np.nan)), (9, np.float32(1e6))]  # fmt: skip


def damage_states(payload: bytes, rng: np.random.Generator) -> tuple[bytes, set[tuple[int, int]]]:
    """A Scenario message with 1 % damaged states; and rows and steps of the valid ones of these."""
    message = waymo_message(payload)
    cells = [(row, step) for row, track in enumerate(message.tracks) for step in range(len(track.states))]
    lost = set()
    for index in rng.choice(len(cells), round(0.01 * len(cells)), replace=False):
        row, step = cells[index]
        state = message.tracks[row].states[step]
        if state.valid:
            lost.add((row, step))
        number, value = NUMBERS[rng.integers(len(NUMBERS))]
        name = {field.number: field.name for field in state.DESCRIPTOR.fields}[number]
        setattr(state, name, float(value))
    return message.SerializeToString(), lost


def waymo_message(payload: bytes):
    from tests.fixtures.waymo_messages import Scenario

    return Scenario.FromString(payload)


def test_waymo(tmp_path: Path) -> None:
    rng = np.random.default_rng(1)
    payloads = [waymo.scenario_bytes(seed) for seed in range(4)]
    damaged, lost = zip(*(damage_states(payload, rng) for payload in payloads), strict=True)
    name = "training.tfrecord-00000-of-00001"
    waymo.write_tfrecord(tmp_path / "whole" / name, payloads)
    waymo.write_tfrecord(tmp_path / "raw" / name, damaged)
    whole, found, report = both("waymo", tmp_path, {})
    assert report.dropped == sum(map(len, lost)) + report.dropped_features
    for before, after, cells in zip(whole, found, lost, strict=True):
        assert_others_arrived(before, after, cells)


class Dropped:
    """Counts of a conversion: of rows and features together, and of features."""

    def __init__(self, report) -> None:
        assert not report.quarantined
        assert not report.failed
        self.dropped = report.dropped
        self.dropped_features = sum(each.count for each in report.defects if each.table == "maps")


def both(
    dataset: str, folder: Path, options: dict
) -> tuple[list[ScenarioDescription], list[ScenarioDescription], Dropped]:
    """The scenarios of the whole recordings and of the damaged ones, and the report of the latter."""
    convert(dataset, folder / "whole", folder / "first", split="train", options=options)
    report = convert(dataset, folder / "raw", folder / "second", split="train", options=options)
    lake = Lake(folder / "second")
    assert lake.sql("SELECT sum(count) AS n FROM defects WHERE action = 'dropped'")["n"][0] == report.dropped
    rows = lake.sql("SELECT sum(num_dropped_rows) AS n FROM metadata")["n"][0]
    assert rows == sum(each.count for each in report.defects if (each.table, each.action) == ("tracks", "dropped"))
    return list(ScenarioLoader(folder / "first")), list(ScenarioLoader(lake)), Dropped(report)


def assert_others_arrived(before: ScenarioDescription, after: ScenarioDescription, lost: set[tuple[int, int]]) -> None:
    """Every state but the lost ones is there, bit for bit; lost ones of the ego may be interpolated."""
    kept = [before.tracks.ids.tolist().index(name) for name in after.tracks.ids]
    gone = set(range(len(before.tracks))) - set(kept)
    assert all((row, step) in lost for row in gone for step in np.flatnonzero(before.tracks.valid[row]))
    wanted = before.tracks.valid.copy()
    wanted[tuple(np.array(sorted(lost)).reshape(-1, 2).T)] = False
    is_filled = after.tracks.is_interpolated
    assert (after.tracks.valid & ~is_filled == wanted[kept]).all()
    assert all((row, step) in lost for row, step in np.argwhere(is_filled & ~wanted[kept]) if row == before.ego_index)
    moved = after.origin - before.origin
    position = np.where(wanted[kept][..., None], before.tracks.position[kept] - moved, after.tracks.position)
    np.testing.assert_allclose(after.tracks.position, position, atol=1e-3)


@pytest.mark.parametrize("share", [0.1, 0.4])
def test_too_many_damaged_rows_quarantine_the_scenario(tmp_path: Path, share: float) -> None:
    argoverse1.write_recordings(tmp_path / "raw" / "train", 1)
    path = tmp_path / "raw" / "train" / "1.csv"
    header, *lines = path.read_text().splitlines()
    for row in np.random.default_rng(0).choice(len(lines), round(share * len(lines)), replace=False):
        lines[row] = ",".join(set_cell("X", "nan")(lines[row].split(",")))
    path.write_text("\n".join([header, *lines]) + "\n")
    report = convert("argoverse1", tmp_path / "raw", tmp_path / "lake", split="train", options={"has_map": False})
    assert (report.converted, report.quarantined) == ((1, 0) if share < 0.2 else (0, 1))
