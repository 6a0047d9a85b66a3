"""Conversion: scenarios per second and core from raw files to a committed lake, memory, bytes against pickles."""

from __future__ import annotations

import json
import os
import pickle
import shutil
import statistics
import struct
import tempfile
from collections.abc import Iterator
from pathlib import Path

import pyarrow as pa
import pyarrow.parquet as pq

from scenarionet_data import Lake, ScenarioLoader
from scenarionet_data.conversion import convert
from scenarionet_data.converters.formats.tfrecord import masked_crc
from scenarionet_data.export import export
from scenarionet_data.maintenance import compact
from tests.bench.measure import Figure, in_fresh_process
from tests.fixtures import argoverse1, scenarionet_pickles

_CONVERT = """
import json, os, resource, sys, time
from scenarionet_data.conversion import convert
dataset, warm, raw, lake = sys.argv[1:5]
convert(dataset, warm, lake + "-warm")  # compiles, once a machine
before = resource.getrusage(resource.RUSAGE_SELF)
started = time.perf_counter()
report = convert(dataset, raw, lake)
seconds = time.perf_counter() - started
after = resource.getrusage(resource.RUSAGE_SELF)
status = open("/proc/self/status").read()  # ru_maxrss would count the parent's peak too
cpu = after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime
assert report.is_clean, report
peak_mb = int(status.split("VmHWM:")[1].split()[0]) / 1024
print(json.dumps({"scenarios": report.converted, "seconds": seconds, "cpu": cpu, "peak_mb": peak_mb}))
"""

_ONE_LOG = """
import contextlib, sys, time
from scenarionet_pipelines.cli import main
sys.argv = ["scenarionet", "convert", "waymo", *sys.argv[1:], "--quiet"]
with contextlib.suppress(SystemExit):
    main()
print(time.process_time())
"""

_ROADS = 300
"""Of a written Argoverse 1 map: 12,000 lanes; the real ones have 17,000."""

_GOALS = {
    "waymo": (">= 80", "ScenarioNet 7-10, compiled protobuf"),
    "argoverse2": (">= 60", "ScenarioNet 13"),
    "argoverse1": (">= 150", ""),
    "scenarionet": (">= 60", ""),
    "pg": (">= 20", "ScenarioNet 0.28"),
}


def figures(recordings: Path | None) -> Iterator[Figure]:
    """Benchmarks of the converters with one file per scenario; on real recordings if available."""
    with tempfile.TemporaryDirectory() as folder:
        root = Path(folder)
        sources = {
            "waymo": waymo_raw(root / "waymo", recordings, 500),
            "argoverse2": argoverse2_raw(root / "val", recordings, 192),
            "argoverse1": argoverse1_raw(root / "train", recordings, 400),
            "scenarionet": scenarionet_raw(root / "pickles", recordings, 140),
            "pg": "0:192",
        }
        for dataset, raw in sources.items():
            yield from _rate(dataset, str(raw), root)
        yield _one_log(root, recordings)
        if recordings:
            yield from _bytes(root, recordings)


def _rate(dataset: str, raw: str, root: Path) -> Iterator[Figure]:
    warm = raw if dataset != "pg" else "100000:100002"
    runs = []
    for attempt in range(3):
        lake = root / f"lake-{dataset}-{attempt}"
        runs.append(json.loads(in_fresh_process(_CONVERT, dataset, warm, raw, str(lake))))
        shutil.rmtree(f"{lake}-warm")
    middle = sorted(runs, key=lambda run: run["seconds"])[1]
    wanted, reference = _GOALS[dataset]
    name = f"{dataset}: {middle['scenarios']} scenarios to a committed lake"
    yield Figure(name, middle["scenarios"] / middle["cpu"], "scenarios/s of CPU time", wanted, reference)
    yield Figure(f"{dataset}: the same by the clock", middle["scenarios"] / middle["seconds"], "scenarios/s")
    yield Figure(f"{dataset}: peak memory of the converter", middle["peak_mb"], "MB", "<= 1024")


def _one_log(root: Path, recordings: Path | None) -> Figure:
    """A log of one scenario by the command, which imports and loads compiled code for it."""
    raw = waymo_raw(root / "one", recordings, 1)
    printed = [in_fresh_process(_ONE_LOG, str(raw), str(root / f"one-{attempt}")) for attempt in range(6)]
    times = [float(each.splitlines()[-1]) for each in printed[1:]]  # the first one compiles
    return Figure("waymo: a log of one scenario, processor time", statistics.median(times), "s", "<= 1.5")


def _bytes(root: Path, recordings: Path) -> Iterator[Figure]:
    """Stored bytes against our own exported pickles, over recordings and generated scenarios."""
    sources = {
        "waymo (recorded and imported)": [
            ("waymo", recordings / "waymo/training"),
            ("scenarionet", recordings / "scenarionet/waymo_0"),
            ("scenarionet", recordings / "scenarionet/overpass"),
        ],
        "argoverse2": [("argoverse2", recordings / "argoverse2/motion-forecasting/val")],
        "pg": [("pg", "0:64")],
    }
    for name, parts in sources.items():
        lake = root / f"bytes-{name.split()[0]}"
        for dataset, raw in parts:
            convert(dataset, str(raw), lake)
        loader = ScenarioLoader(lake)
        exported = root / f"{lake.name}-pickles"
        export(iter(loader), exported)
        pickled = sum(path.stat().st_size for path in exported.glob("sd_*.pkl"))
        stored = _stored(lake)
        goal = "<= 0.3" if name.startswith("waymo") else ""
        yield Figure(f"{name}: stored bytes over exported pickles", stored / pickled, "", goal)
        yield Figure(f"{name}: stored bytes per scenario", stored / len(loader) / 1000, "kB", "", "prototype 194 kB")
        compact(lake, "archive")
        goal = {"waymo": "<= 0.24", "argoverse2": "<= 0.21", "pg": "<= 0.13"}[name.split()[0]]
        yield Figure(f"{name}: bytes of an archive over exported pickles", _stored(lake) / pickled, "", goal)


def _stored(root: Path) -> int:
    """Bytes of all that scenarios are loaded from."""
    lake = Lake(root)
    return sum(Path(path).stat().st_size for table in ("tracks", "lights", "maps", "metadata")
               for path in lake.paths(table))  # fmt: skip


def waymo_raw(folder: Path, recordings: Path | None, count: int) -> Path:
    """One shard of ``count`` scenarios: the recorded one under new ids, or written ones."""
    folder.mkdir(parents=True)
    if recordings is None:
        from tests.fixtures import waymo

        payloads = [  # as large as a recorded one
            waymo.scenario_bytes(0, num_rows=32, num_vehicles=76, num_others=10, scenario_id=f"{seed:016x}")
            for seed in range(count)
        ]
    else:
        record = next((recordings / "waymo/training").glob("*.tfrecord*")).read_bytes()
        (length,) = struct.unpack_from("<Q", record)
        payload = record[12 : 12 + length]
        payloads = [payload.replace(b"637f20cafde22ff8", f"{number:016x}".encode()) for number in range(count)]
    with (folder / "training.tfrecord-00000-of-01000").open("wb") as file:
        for payload in payloads:
            head = struct.pack("<Q", len(payload))
            file.write(head + struct.pack("<I", masked_crc(head)) + payload)
            file.write(struct.pack("<I", masked_crc(payload)))
    return folder


def argoverse2_raw(folder: Path, recordings: Path | None, count: int) -> Path:
    """``count`` scenario folders: the recorded one under new ids, or written ones."""
    if recordings is None:
        from tests.fixtures.argoverse2 import write_forecasting

        write_forecasting(folder, num_scenarios=count, seed=0)
        return folder
    source = next((recordings / "argoverse2/motion-forecasting").rglob("scenario_*.parquet"))
    table, old = pq.read_table(source), source.parent.name
    column = table.schema.get_field_index("scenario_id")
    for number in range(count):
        new = f"{number:08x}{old[8:]}"
        target = folder / new
        target.mkdir(parents=True)
        ids = pa.array([new] * len(table), table.schema.field(column).type)
        pq.write_table(table.set_column(column, table.schema.field(column), ids), target / f"scenario_{new}.parquet")
        shutil.copyfile(source.parent / f"log_map_archive_{old}.json", target / f"log_map_archive_{new}.json")
    return folder


def argoverse1_raw(folder: Path, recordings: Path | None, count: int) -> Path:
    """``count`` recordings, the recorded ones moved onto roads of a written map, which has as many as a real one."""
    argoverse1.write_map(folder, "PIT", num_roads=_ROADS)
    if recordings is None:
        argoverse1.write_recordings(folder, count)
        return folder
    files = sorted((recordings / "argoverse1").rglob("*.csv"))
    for number in range(count):
        rows = [line.split(",") for line in files[number % len(files)].read_text().splitlines()[1:]]
        x, y = next((float(row[3]), float(row[4])) for row in rows if row[2] == "AV")
        place = argoverse1.CENTER["PIT"] + argoverse1.road(0.0, 60.0 * (number % _ROADS))
        right, up = (place - (x, y)).tolist()
        for row in rows:
            row[3:] = repr(float(row[3]) + right), repr(float(row[4]) + up), "PIT"
        argoverse1.write_csv(folder / f"{number}.csv", rows)
    return folder


def scenarionet_raw(folder: Path, recordings: Path | None, count: int) -> Path:
    """``count`` pickles: the recorded ones of every vintage, or written ones, under new ids."""
    found = recordings / "scenarionet" if recordings else scenarionet_pickles.write_vintages(folder.parent / "vintages")
    files = sorted(path for path in found.rglob("*.pkl") if not path.name.startswith("dataset_"))
    folder.mkdir(parents=True)
    for number in range(count):
        description = pickle.loads(files[number % len(files)].read_bytes())
        description["id"] = f"{number}-{description['id']}"
        (folder / f"sd_{number}.pkl").write_bytes(pickle.dumps(description, protocol=4))
    return folder


def recordings_folder() -> Path | None:
    """Folder of real recordings, when the environment names one."""
    folder = os.environ.get("SCENARIONET_TEST_DATA")
    return Path(folder) if folder else None
