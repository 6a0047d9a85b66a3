"""nuPlan: scenarios per second and core from a log of six minutes, and memory on one cut into 1,000 windows."""

from __future__ import annotations

import json
import tempfile
from collections.abc import Iterator
from pathlib import Path

from tests.bench.measure import Figure, crop_loads, in_fresh_process
from tests.fixtures import nuplan as fixture
from tests.fixtures import nuplan_drive as drives

_CONVERT = """
import json, re, resource, sys
from pathlib import Path
from scenarionet_data.conversion import convert
from scenarionet_data.converters.nuplan import NuPlanOptions
warm, raw, lake, options = sys.argv[1:5]
options = NuPlanOptions(**json.loads(options))
convert("nuplan", warm, lake + "-warm", split="mini", options=options)
before = resource.getrusage(resource.RUSAGE_SELF)
report = convert("nuplan", raw, lake, split="mini", options=options)
after = resource.getrusage(resource.RUSAGE_SELF)
cpu = after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime
assert report.is_clean and report.converted, report
size = report.size / report.converted / 1000
# Of this process alone: ru_maxrss begins at what the parent process has.
peak = int(re.search(r"VmHWM:\\s+(\\d+) kB", Path("/proc/self/status").read_text())[1]) / 1024
print(json.dumps({"scenarios": report.converted, "cpu": cpu, "peak_mb": peak, "kb": size}))
"""
_WAYS = {
    "scenes, 10 Hz": ({}, ">= 10"),
    "scenes, 20 Hz": ({"frames": "recorded"}, ""),
    "1,000 tag windows of 10 s, 10 Hz": ({"by": "tag"}, ">= 10"),
}


def figures(recordings: Path | None) -> Iterator[Figure]:
    """Benchmarks of the converter, on the recorded scenario repeated if available."""
    with tempfile.TemporaryDirectory() as folder:
        root = Path(folder)
        drive = _drive(recordings)
        last = len(drive.timestamps) - 1
        tags = [(round(number * last / 999), "unprotected_left", None) for number in range(1000)]
        raw = fixture.write_raw(root / "raw", [drive], tags=tags)
        warm = fixture.write_raw(root / "warm", [drives.invented()], tags=tags[:3])
        for name, (options, wanted) in _WAYS.items():
            yield from _rate(f"nuplan, {name}", (warm, raw, root / name.replace(" ", "-")), options, wanted)


def _drive(recordings: Path | None) -> drives.Drive:
    if recordings is None:
        return drives.invented(seconds=360.0, num_tracks=160)
    return drives.repeated(drives.recorded(recordings / "nuplan" / "recorded" / "262a4b7a1f2c5ab6"), 24)


def _rate(name: str, places: tuple[Path, Path, Path], options: dict[str, object], wanted: str) -> Iterator[Figure]:
    warm, raw, lake = places
    runs = [
        json.loads(in_fresh_process(_CONVERT, str(warm), str(raw), f"{lake}-{attempt}", json.dumps(options)))
        for attempt in range(3)
    ]
    middle = sorted(runs, key=lambda run: run["cpu"])[1]
    rate = middle["scenarios"] / middle["cpu"]
    yield Figure(f"{name}: {middle['scenarios']} scenarios", rate, "scenarios/s of CPU", wanted, "ScenarioMax 0.5")
    yield Figure(f"{name}: peak memory of the converter", middle["peak_mb"], "MB", "<= 1500")
    yield Figure(f"{name}: stored bytes per scenario, its share of the map included", middle["kb"], "kB")
    if "tag" not in name:
        yield from crop_loads(name, Path(f"{lake}-0"))
