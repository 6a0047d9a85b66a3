"""Lyft: scenarios per second and core from recordings to a committed lake, and memory."""

from __future__ import annotations

import json
import tempfile
from collections.abc import Iterator
from pathlib import Path

import numpy as np

from scenarionet_data.converters.formats.zarr2 import ChunkedTable
from tests.bench.measure import Figure, in_fresh_process
from tests.fixtures import lyft as fixture
from tests.fixtures import lyft_world as world

_CONVERT = """
import json, re, resource, sys, time
from pathlib import Path
from scenarionet_data.conversion import convert
from scenarionet_data.converters.lyft import Lyft, LyftOptions
scenes, lake = Path(sys.argv[1]) / "scenes", sys.argv[2]
warm, raw = str(scenes / "warm.zarr"), str(scenes / "repeated.zarr")
convert("lyft", warm, lake + "-warm", split="train", options=LyftOptions(has_map=False))  # compiles, once a machine
started = time.process_time()
convert("lyft", warm, lake, split="train")
map_seconds = time.process_time() - started
before = resource.getrusage(resource.RUSAGE_SELF)
report = convert("lyft", raw, lake, split="train")
after = resource.getrusage(resource.RUSAGE_SELF)
cpu = after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime
assert report.is_clean and report.converted, report
# Of this process alone: ru_maxrss begins at what the parent process has.
peak = int(re.search(r"VmHWM:\\s+(\\d+) kB", Path("/proc/self/status").read_text())[1]) / 1024
print(json.dumps({"scenarios": report.converted, "cpu": cpu, "peak_mb": peak, "map": map_seconds}))
"""
_SCENES = 48
_MIDDLE = np.array([-694.0, 1104.0])  # of the recorded ego's path
_TOWNS = 28  # in each direction, 450 m apart: a map of 7,840 lanes, about as many as the real one


def figures(recordings: Path | None) -> Iterator[Figure]:
    """Benchmarks of the converter, on the recorded scene repeated if available."""
    with tempfile.TemporaryDirectory() as folder:
        root = Path(folder)
        if recordings:
            tables = repeated(recordings / "lyft" / "scenes" / "sample.zarr", _SCENES)
        else:
            tables = fixture.recording(_SCENES, 250)
        fixture.write_tables(root / "scenes" / "repeated.zarr", tables, chunks=fixture.REAL_CHUNKS)
        fixture.write_recording(root / "scenes" / "warm.zarr", num_scenes=1)
        world.write_meta(root / "meta.json")
        world.write_city(root / "semantic_map.pb", _TOWNS, _MIDDLE if recordings else np.zeros(2))
        runs = [json.loads(in_fresh_process(_CONVERT, str(root), str(root / f"lake{k}"))) for k in range(3)]
        middle = sorted(runs, key=lambda run: run["cpu"])[1]
        name = f"lyft: {_SCENES} scenes of 25 s, as {middle['scenarios']} windows of up to 20 s"
        yield Figure(name, middle["scenarios"] / middle["cpu"], "scenarios/s of CPU", ">= 20")
        yield Figure("lyft: the map of 7,840 lanes, once, and a scene", middle["map"], "s of CPU")
        yield Figure("lyft: peak memory of the converter", middle["peak_mb"], "MB", "<= 1500")


def repeated(path: Path, count: int) -> dict[str, np.ndarray]:
    """The tables of a recording with its scenes repeated at later times."""
    tables = {name: ChunkedTable(path / name) for name in fixture.CHUNKS}
    rows = {name: table.rows(0, len(table)) for name, table in tables.items()}
    made = {name: np.concatenate([part] * count) for name, part in rows.items()}
    number = {name: np.repeat(np.arange(count), len(part)) for name, part in rows.items()}
    made["scenes"]["frame_index_interval"] += number["scenes"][:, None] * len(rows["frames"])
    for field in ("start_time", "end_time"):
        made["scenes"][field] += number["scenes"] * 3_600_000_000_000
    made["frames"]["timestamp"] += number["frames"] * 3_600_000_000_000
    for name, field in (
        ("agents", "agent_index_interval"),
        ("traffic_light_faces", "traffic_light_faces_index_interval"),
    ):
        made["frames"][field] += number["frames"][:, None] * len(rows[name])
    return made
