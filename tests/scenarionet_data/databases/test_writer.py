"""Writing databases: query results are written row group by row group, atomically."""

from __future__ import annotations

import subprocess
import sys

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
import pytest

from scenarionet_data import Lake
from scenarionet_data.databases import writer
from scenarionet_data.errors import LakeError, QueryError
from tests.fixtures.lakes import write_lake
from tests.fixtures.scenarios import make_scenario


@pytest.fixture
def lake(tmp_path) -> Lake:
    made = [make_scenario(seed, num_objects=1 + seed, num_steps=5, num_lanes=0, has_map=False) for seed in range(3)]
    return write_lake(tmp_path / "lake", made)


def left_over(lake):
    return list((lake.root / ".tmp").iterdir())


def test_members_arrive_in_any_batches_and_fill_row_groups(lake):
    lineage = lake.filter(name="all").lineage
    count = 150_000
    rows = pa.table(
        {
            "scenario_id": [f"s{k}" for k in range(count)],
            "weight": np.ones(count),
            "content_hash": np.arange(count, dtype=np.uint64),
        }
    )
    portions = [1, 70_000, 0, 65_535, 14_464]
    with writer.database_writers(lake.files, ["many"]) as made:
        draft, start = made["many"], 0
        for portion in portions:
            for batch in rows.slice(start, portion).to_batches():
                draft.add(batch)
            start += portion
        draft.finish(lineage)
        assert [name for ids in draft.ids() for name in ids.to_pylist()] == rows["scenario_id"].to_pylist()
        found = draft.publish("many", replace=False)
    footer = pq.read_metadata(lake.root / found.file)
    assert [footer.row_group(k).num_rows for k in range(footer.num_row_groups)] == [65_536, 65_536, 18_928]
    assert len(found) == found.lineage.count == count
    assert found.members["position"].to_pylist() == list(range(count))
    assert found.members.select(["scenario_id", "weight", "content_hash"]).cast(rows.schema).equals(rows)


def test_query_failing_half_way_leaves_no_files(lake):
    with pytest.raises(QueryError, match="Could not convert string"):
        lake.filter("num_objects = 1 OR dataset::INTEGER > 0", name="never")
    assert lake.databases == []
    assert left_over(lake) == []


def test_error_between_batches_is_a_query_error(lake):
    late = "SELECT range AS n FROM range(300000) WHERE range < 250000 OR concat(range, 'x')::INTEGER > 0"
    with pytest.raises(QueryError, match="Could not convert string '250000x'"):
        list(lake.engine.batches(late))
    assert len(lake) == 3


def test_query_does_not_wait_for_another_to_be_read(lake):
    rows = lake.engine.batches("SELECT range AS n FROM range(300000)")
    assert next(rows).num_rows > 0
    rows.close()
    assert len(lake) == 3


def test_failed_write_raises_error_and_lake_stays_usable(lake, monkeypatch):
    def full(*_: object, **__: object) -> None:
        raise OSError(28, "No space left on device")

    with monkeypatch.context() as patch:
        patch.setattr(pq.ParquetWriter, "write_table", full)
        with pytest.raises(LakeError, match="No space left on device; free some space") as failed:
            lake.filter(name="never")
    assert failed.traceback  # the connection still answers while the error is handled
    assert lake.databases == []
    assert left_over(lake) == []
    assert len(lake.filter(name="all")) == 3


@pytest.mark.long
def test_opening_and_filtering_a_lake_compiles_nothing(lake):
    code = (
        "import sys\nfrom scenarionet_data import Lake\nLake(sys.argv[1]).filter(name='all')\n"
        "print([name for name in ('numba', 'polars', 'shapely') if name in sys.modules])"
    )
    done = subprocess.run([sys.executable, "-c", code, str(lake.root)], capture_output=True, text=True, check=True)
    assert done.stdout.strip() == "[]"
