"""Inputs that a dataset lists without a file: quarantined one by one, converted once they are present."""

from __future__ import annotations

from pathlib import Path

import pytest

from scenarionet_data import Lake, convert
from scenarionet_data.conversion import ConversionReport
from scenarionet_data.errors import DuplicateScenario, SourceNotFound
from tests.fixtures import scenarionet_pickles as made

NAMES = ("a", "b", "c")


@pytest.fixture
def database(tmp_path: Path) -> Path:
    """A database of three pickles; those of a and c are missing."""
    folder = made.write_database(tmp_path / "raw", {f"sd_{name}.pkl": made.waymo(name) for name in NAMES})
    for name in ("a", "c"):
        (folder / f"sd_{name}.pkl").unlink()
    return folder


def run(database: Path, replace: bool = False) -> ConversionReport:
    return convert("scenarionet", database, database.parent / "lake", split="train", replace=replace)


def stored(database: Path) -> set[str]:
    rows = Lake(database.parent / "lake").sql("SELECT scenario_id FROM metadata").rows()
    return {str(row[0]).rpartition("_")[2] for row in rows}


def test_present_files_are_converted_and_absent_ones_quarantined(database: Path) -> None:
    report = run(database)
    assert (report.converted, report.quarantined, report.failed) == (1, 2, [])
    assert stored(database) == {"b"}
    rows = Lake(database.parent / "lake").sql(
        "SELECT scenario_id, error, field, message FROM quarantine ORDER BY scenario_id"
    )
    reason = "is missing, although dataset_mapping.pkl lists it; restore it and run the same command again"
    assert rows.rows() == [(f"sd_{name}.pkl", "InvalidScenario", "pickle", reason) for name in ("a", "c")]


def test_files_that_stay_absent_are_not_tried_again(database: Path) -> None:
    run(database)
    again = run(database)
    assert (again.converted, again.quarantined, again.shards, again.skipped) == (0, 0, 0, 1)


def test_files_that_appear_are_converted(database: Path) -> None:
    run(database)
    made.write_pickle(made.waymo("a"), database / "sd_a.pkl")
    report = run(database)
    assert (report.converted, report.quarantined, report.failed) == (1, 0, [])
    assert stored(database) == {"a", "b"}
    assert run(database).shards == 0


def test_a_shard_with_absent_files_can_be_replaced(database: Path) -> None:
    run(database)
    made.write_pickle(made.waymo("a"), database / "sd_a.pkl")
    run(database)
    made.write_pickle(made.waymo("b") | {"version": "another"}, database / "sd_b.pkl")
    with pytest.raises(DuplicateScenario, match="has changed since"):
        run(database)
    report = run(database, replace=True)
    assert (report.replaced, report.failed) == (1, [])
    assert stored(database) == {"a", "b"}


def test_converted_scenarios_are_kept_when_their_files_disappear(database: Path) -> None:
    made.write_pickle(made.waymo("a"), database / "sd_a.pkl")
    run(database)
    (database / "sd_a.pkl").unlink()
    assert run(database).shards == 0
    made.write_pickle(made.waymo("b") | {"version": "another"}, database / "sd_b.pkl")
    with pytest.raises(DuplicateScenario, match=r"would drop sd_a\.pkl"):
        run(database, replace=True)
    assert stored(database) == {"a", "b"}


def test_a_mapping_without_any_present_file_is_refused(database: Path) -> None:
    (database / "sd_b.pkl").unlink()
    with pytest.raises(SourceNotFound, match=r"all 3 files that its mapping lists are missing, such as sd_a\.pkl"):
        run(database)
