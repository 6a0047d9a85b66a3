"""Loading: what comes out is what went in, bit for bit, in any order, from any thread or process."""

from __future__ import annotations

import copy
import dataclasses
import gc
import multiprocessing
import pickle
import random
import subprocess
import sys
from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace
from pathlib import Path

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
import pytest

from scenarionet_data import Lake, ScenarioLoader, codec
from scenarionet_data.arrays.ragged import Ragged
from scenarionet_data.building import MapBuilder
from scenarionet_data.errors import LakeError, NoSuchSnapshot, ScenarioNotFound
from scenarionet_data.schema import tables
from scenarionet_data.storage.files.local import LocalLakeFiles
from scenarionet_data.storage.read import scenario_reader
from scenarionet_data.storage.read.parquet import column_reader, footer
from scenarionet_data.storage.snapshots import snapshot as snapshots
from scenarionet_data.storage.snapshots.shard_record import partition
from scenarionet_data.storage.write.table_file import publish_data, publish_table
from scenarionet_data.testing import differences
from tests.fixtures.lakes import write_lake
from tests.fixtures.scenarios import make_scenario
from tests.fixtures.waiting import HANGS_AFTER

COUNT = 10


def made(seed):
    """Of every kind: with and without heights, lights, map, gaps, times of their own."""
    how = {"num_objects": 1 + seed % 5, "num_steps": 3 + seed, "num_lights": seed % 3}
    scenario = make_scenario(seed, has_z=seed % 4 > 0, has_map=seed % 5 > 0, **how)
    if seed == 5:
        scenario = replace(scenario, map=MapBuilder().build(np.zeros(3)))
    return scenario


@pytest.fixture(scope="module")
def lake(tmp_path_factory):
    root = tmp_path_factory.mktemp("loader")
    write_lake(root, [made(seed) for seed in range(6)], name="a")
    return write_lake(root, [made(seed) for seed in range(6, COUNT)], name="b")


def test_scenarios_keep_their_values_while_others_are_loaded(tmp_path):
    """Their memory is used again, but not while anything refers to it."""
    scenarios = [make_scenario(seed, num_objects=30, num_steps=60, num_lights=3) for seed in range(4)]
    loader = ScenarioLoader(write_lake(tmp_path, scenarios))
    expected = {scenario.id: scenario for scenario in scenarios}
    rng, kept = random.Random(0), []
    for _ in range(300):
        scenario = loader[rng.randrange(4)]
        whole = expected[scenario.id]
        chosen = rng.choice(
            [
                (scenario, whole),
                (scenario.tracks, whole.tracks),
                (scenario.tracks.position[3:, :, 1], whole.tracks.position[3:, :, 1]),
                (scenario.map.polyline.values[::2], whole.map.polyline.values[::2]),
                None,
            ]
        )
        kept += [chosen] if chosen else []
        del scenario, chosen
        if len(kept) > 20:
            del kept[rng.randrange(len(kept))]
    assert len(kept) == 20
    assert [differences(found, wanted) for found, wanted in kept] == [[]] * len(kept)


def seeds(scenarios):
    return [int(scenario.source.scenario_id[1:]) for scenario in scenarios]


def test_scenarios_are_the_sources_bit_for_bit(lake):
    for seed, scenario in enumerate(ScenarioLoader(lake)):
        assert differences(scenario, made(seed)) == []
        scenario.validate()


def test_tracks_alone_are_the_same(lake):
    loaded = ScenarioLoader(lake)
    for seed in range(COUNT):
        assert differences(loaded.tracks(seed), made(seed).tracks) == []


def test_a_loader_is_a_sequence(lake):
    loaded = ScenarioLoader(lake)
    assert len(loaded) == COUNT
    assert loaded.scenario_ids == [made(seed).id for seed in range(COUNT)]
    assert seeds(loaded) == list(range(COUNT))
    assert seeds([loaded[-1], loaded[-COUNT], loaded[np.int64(3)]]) == [COUNT - 1, 0, 3]
    assert seeds(loaded[2:5]) == [2, 3, 4]
    assert seeds(loaded[::-3]) == list(range(COUNT))[::-3]
    assert loaded[7:7] == []
    assert seeds(reversed(loaded)) == list(range(COUNT))[::-1]
    for index in (COUNT, -COUNT - 1):
        for load in (loaded.__getitem__, loaded.tracks, lambda k: loaded.batch([k])):
            with pytest.raises(IndexError, match=f"scenario {index} of {COUNT}"):
                load(index)


def test_a_batch_keeps_the_order_asked_for(lake):
    order = [random.Random(3).randrange(-COUNT, COUNT) for _ in range(30)]
    wanted = [k % COUNT for k in order]
    loaded = ScenarioLoader(lake)
    assert seeds(loaded.batch(order)) == wanted
    assert seeds(loaded.batch(np.array(order))) == wanted
    assert seeds(loaded.__getitems__(order)) == wanted  # torch's DataLoader asks so
    assert loaded.batch([]) == []
    for tracks, seed in zip(loaded.batch_tracks(order), wanted, strict=True):
        assert differences(tracks, made(seed).tracks) == []


@pytest.mark.parametrize("known", ["everything", "nothing"])
def test_kernels_and_arrow_read_the_same(lake, known, monkeypatch):
    monkeypatch.setattr(column_reader.ColumnReader.__init__, "__defaults__", (None, 0))
    if known == "nothing":
        monkeypatch.setattr(footer, "_KNOWN", {})
    for seed, scenario in enumerate(ScenarioLoader(lake)):
        assert differences(scenario, made(seed)) == []


def test_a_batch_reads_in_the_order_on_disk(lake, monkeypatch):
    loaded, visited = ScenarioLoader(lake), []
    load = loaded._tracks
    monkeypatch.setattr(loaded, "_tracks", lambda rows: visited.extend(rows) or load(rows))
    loaded.batch_tracks([9, 0, 5, 7, 1])
    assert [row["scenario_id"] for row in visited] == [loaded.scenario_ids[k] for k in (0, 1, 5, 7, 9)]


def test_scenarios_of_every_kind_are_decoded_together(tmp_path):
    """More of them than are decoded in one go: other lengths, heights, lights, maps side by side."""
    scenarios = [made(seed) for seed in range(40)]
    loaded = ScenarioLoader(write_lake(tmp_path, scenarios))
    order = random.Random(5).sample(range(40), 40)
    for seed, scenario in zip(order, loaded.batch(order), strict=True):
        assert differences(scenario, scenarios[seed]) == []
    assert [differences(*pair) for pair in zip(loaded, scenarios, strict=True)] == [[]] * 40


def test_what_is_loaded_is_the_databases_ids_or_everything(lake, tmp_path):
    own = write_lake(tmp_path, [made(seed) for seed in range(4)])
    database = own.filter("num_objects > 1", name="some")
    for scenarios in ("some", "some@1", database, database.scenario_ids):
        for place in (own, tmp_path, str(tmp_path)):
            assert ScenarioLoader(place, scenarios).scenario_ids == database.scenario_ids
    assert seeds(ScenarioLoader(own, [made(k).id for k in (3, 1, 3)])) == [3, 1, 3]
    assert seeds(ScenarioLoader(own, (made(k).id for k in (2, 0)))) == [2, 0]
    assert len(ScenarioLoader(own, [])) == 0
    with pytest.raises(ScenarioNotFound, match="no scenario made/v1/x in snapshot 1"):
        ScenarioLoader(own, ["made/v1/x"])
    with pytest.raises(NoSuchSnapshot, match="no lake there"):
        ScenarioLoader(tmp_path / "nowhere")


def test_an_older_snapshot_is_loaded_as_it_was(lake):
    older = Lake(lake.root, snapshot=1)
    assert seeds(ScenarioLoader(older)) == list(range(6))


# --- compacted files ------------------------------------------------------------------------------------


def compacted(root: Path, scenarios, groups) -> Lake:
    """A lake whose files hold several scenarios a row group, as compaction leaves them."""
    files, rows = LocalLakeFiles(root), []
    encoded = [codec.encode(scenario, "1") for scenario in scenarios]
    addresses = [{} for _ in scenarios]
    for table in ("tracks", "lights", "maps"):
        path = files.temporary()
        with tables.load(table).writer(path, {}) as writer:
            number = 0
            for members in groups:
                batches = [getattr(encoded[k], table) for k in members]
                lengths = [batch.num_rows if batch is not None else 0 for batch in batches]
                kept = [batch for batch in batches if batch is not None and batch.num_rows]
                if kept:
                    together = pa.Table.from_batches(kept).unify_dictionaries()
                    writer.write_table(together, row_group_size=together.num_rows)
                for k, first, length in zip(members, np.cumsum([0, *lengths]), lengths, strict=False):
                    addresses[k][f"{table}_num_rows"] = length
                    if length:
                        addresses[k][f"{table}_row_group"] = number
                        addresses[k][f"{table}_first_row"] = int(first)
                number += bool(kept)
        name = publish_data(files, path, f"{partition(table, 'made', 'v1', 'train')}/compacted").name
        for address in addresses:
            address[f"{table}_file"] = name if address[f"{table}_num_rows"] else None
    rows = [{**e.metadata, **address} for e, address in zip(encoded, addresses, strict=True)]
    metadata = f"{partition('metadata', 'made', 'v1', 'train')}/compacted.parquet"
    publish_table(files, "metadata", rows, {}, metadata)
    snapshots.publish(files, snapshots.Snapshot(1, "", "compact", (metadata,), ()))
    return Lake(root)


def test_scenarios_are_found_inside_shared_row_groups(tmp_path):
    scenarios = [made(seed) for seed in range(COUNT)]
    lake = compacted(tmp_path, scenarios, [range(4), range(4, 9), [9]])
    path = next(tmp_path.glob("tracks/**/*.parquet"))
    assert pq.read_metadata(path).num_row_groups == 3
    loaded = ScenarioLoader(lake)
    for seed in random.Random(1).sample(range(COUNT), COUNT):
        assert differences(loaded[seed], scenarios[seed]) == []
        assert differences(loaded.tracks(seed), scenarios[seed].tracks) == []
    for order in ([6], [1, 2], [0, 3, 8, 9], [7, 5, 7, 1, 9], range(COUNT), [4, 5, 6, 7, 8]):
        for seed, scenario in zip(order, loaded.batch(order), strict=True):
            assert differences(scenario, scenarios[seed]) == []
    assert seeds(loaded) == list(range(COUNT))


def test_metadata_that_counts_too_many_rows_is_refused(tmp_path):
    loaded = ScenarioLoader(compacted(tmp_path, [made(seed) for seed in range(4)], [range(4)]))
    loaded._rows = [{**row, "tracks_num_rows": row["tracks_num_rows"] + 9} for row in loaded._rows]
    with pytest.raises(LakeError, match="fewer rows than its metadata"):
        loaded[3]


# --- threads, processes, handles ------------------------------------------------------------------------


@pytest.mark.long
def test_a_loader_pickles_as_path_and_ids(lake):
    loaded = ScenarioLoader(lake, [made(k).id for k in (4, 2)])
    _ = loaded[0]  # open files do not travel
    again = pickle.loads(pickle.dumps(loaded))
    assert seeds(again) == [4, 2]
    assert again.scenario_ids == loaded.scenario_ids
    for first, second in zip(loaded, again, strict=True):
        assert differences(first, second) == []
    large = ScenarioLoader(lake, [made(k % COUNT).id for k in range(1000)])
    assert len(pickle.dumps(large)) < 600 * len(large)


def test_threads_load_at_once(lake):
    loaded = ScenarioLoader(lake)
    wanted = [made(seed) for seed in range(COUNT)]

    def load(worker):
        order = random.Random(worker).choices(range(COUNT), k=25)
        return [differences(loaded[k], wanted[k]) for k in order]

    with ThreadPoolExecutor(8) as pool:
        for found in pool.map(load, range(8)):
            assert found == [[]] * 25


def _child(loaded, queue):
    queue.put([loaded[k].tracks.position.tobytes() for k in (3, 7)])


@pytest.mark.long
@pytest.mark.parametrize("method", ["fork", "spawn"])
def test_worker_processes_load(lake, method):
    """As a DataLoader's workers do: a copy by fork, with files open, or by pickle."""
    loaded = ScenarioLoader(lake)
    _ = loaded[0]
    context = multiprocessing.get_context(method)
    queue = context.Queue()
    worker = context.Process(target=_child, args=(loaded, queue))
    worker.start()
    assert queue.get(timeout=HANGS_AFTER) == [made(k).tracks.position.tobytes() for k in (3, 7)]
    worker.join()


def test_few_files_stay_open(tmp_path, monkeypatch):
    monkeypatch.setattr(scenario_reader, "_MAX_OPEN_FILES", 2)
    for seed in range(4):
        lake = write_lake(tmp_path, [made(seed)], name=f"s{seed}")
    loaded = ScenarioLoader(lake)
    for _ in range(2):
        for seed in random.Random(2).sample(range(4), 4):
            scenario = loaded[seed]
            assert len(loaded._reader._row_groups._open) <= 2
            assert differences(scenario, made(seed)) == []
    kept = [loaded[seed] for seed in range(4)]  # what was loaded outlives its file
    del loaded
    gc.collect()
    assert [differences(scenario, made(seed)) for seed, scenario in enumerate(kept)] == [[]] * 4


def test_loaded_arrays_are_the_callers(lake):
    """Changing a loaded scenario changes neither the lake nor the next load."""
    loaded = ScenarioLoader(lake)
    scenario = loaded[3]
    scenario.tracks.position[:] = 7
    scenario.tracks.valid[:] = False
    assert differences(loaded[3], made(3)) == []


def test_a_scenario_of_a_batch_keeps_no_other_in_memory(lake):
    alone = ScenarioLoader(lake)
    for seed, scenario in enumerate(ScenarioLoader(lake).batch(range(COUNT))):
        for name in ("tracks", "lights", "map"):
            part, same = getattr(scenario, name), getattr(alone[seed], name)
            if part is None or not len(part):
                continue
            memory = vars(part)["_unread"].memory
            assert memory.base is None
            assert memory.nbytes == vars(same)["_unread"].memory.nbytes
            fields = [getattr(part, field.name) for field in dataclasses.fields(part)]
            arrays = [field.values if isinstance(field, Ragged) else field for field in fields]
            assert all(array.dtype == object or array.base is memory for array in arrays)
            assert all(array.flags.writeable and array.flags.aligned for array in arrays)


def test_texts_are_made_when_they_are_read(lake):
    for seed in range(COUNT):
        scenario = ScenarioLoader(lake)[seed]
        assert not {"ids", "extras"} & vars(scenario.tracks).keys()
        with ThreadPoolExecutor(4) as threads:
            first, *others = threads.map(lambda _, tracks=scenario.tracks: tracks.ids, range(4))
        assert all(ids is first for ids in others)
        assert not hasattr(scenario.tracks, "nothing")
        for copied in (pickle.loads(pickle.dumps(scenario)), copy.deepcopy(scenario), copy.copy(scenario)):
            assert differences(copied, made(seed)) == []
        assert pickle.dumps(scenario) == pickle.dumps(ScenarioLoader(lake)[seed])


ROUNDS_OF_LOADING = """
import gc, sys
import psutil
from scenarionet_data import ScenarioLoader

loaded = ScenarioLoader(sys.argv[1])
for _ in range(8):
    for _ in range(10):
        for scenario in loaded:
            scenario.tracks.valid.any()
    gc.collect()
    print(psutil.Process().memory_info().rss)
"""


@pytest.mark.long
def test_memory_stays_flat(tmp_path):
    """In a process of its own, whose memory nothing else moves.

    What leaks grows in every round of 120 scenarios (84 MB); what the allocator takes or gives back comes and goes.
    """
    scenarios = [make_scenario(k, num_objects=60, num_steps=91, num_lanes=60) for k in range(12)]
    command = [sys.executable, "-c", ROUNDS_OF_LOADING, str(write_lake(tmp_path, scenarios).root)]
    done = subprocess.run(command, capture_output=True, text=True, check=True)
    memory = [int(line) for line in done.stdout.split()]
    assert len(memory) == 8
    assert np.diff(memory).min() < 1e6, memory
    assert memory[-1] - memory[1] < 8e6, memory
