"""nuScenes: scenarios per second and core, memory, bytes against ScenarioNet's pickles, loading with a map crop."""

from __future__ import annotations

import json
import tempfile
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

from scenarionet_data.conversion import convert
from tests.bench.measure import Figure, crop_loads, in_fresh_process
from tests.fixtures import nuscenes as fixture
from tests.fixtures.nuscenes_recorded import read_pickles, write_recorded
from tests.fixtures.nuscenes_world import write_district

_NUM_SCENES = {"scene": 160, "window": 32}
_CONVERT = """
import json, re, resource, sys
from pathlib import Path
from scenarionet_data.conversion import convert
from scenarionet_data.converters.nuscenes import NuScenesOptions
warm, raw, lake, by = sys.argv[1:5]
options = NuScenesOptions(by=by)
convert("nuscenes", warm, lake + "-warm", split="mini", options=options)
before = resource.getrusage(resource.RUSAGE_SELF)
report = convert("nuscenes", raw, lake, split="mini", options=options)
after = resource.getrusage(resource.RUSAGE_SELF)
cpu = after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime
assert report.is_clean and report.converted, report
# Of this process alone: ru_maxrss begins at what the parent process has.
peak = int(re.search(r"VmHWM:\\s+(\\d+) kB", Path("/proc/self/status").read_text())[1]) / 1024
print(json.dumps({"scenarios": report.converted, "cpu": cpu, "peak_mb": peak}))
"""


def figures(recordings: Path | None) -> Iterator[Figure]:
    """Benchmarks of the converter, on the ten recorded scenes repeated if available."""
    with tempfile.TemporaryDirectory() as folder:
        root = Path(folder)
        fixture.write_invented(root / "warm", num_scenes=1)
        for by, count in _NUM_SCENES.items():
            raw = root / f"raw-{by}"
            scenes = _recorded(raw, recordings) if recordings else _invented(raw)
            fixture.write_release(raw, _repeated(scenes, count), sensors=fixture.ALL_SENSORS)
            yield from _rate(by, root / "warm", raw, root / f"lake-{by}")
        if recordings:
            yield from _bytes(root, recordings)


def _recorded(raw: Path, recordings: Path) -> list[fixture.Scene]:
    return write_recorded(raw, read_pickles(recordings))


def _invented(raw: Path) -> list[fixture.Scene]:
    write_district(raw / "maps" / "expansion", "boston-seaport")
    return [fixture.invented_scene(f"scene-{seed}", "boston-seaport", seed) for seed in range(10)]


def _repeated(scenes: list[fixture.Scene], count: int) -> Iterator[fixture.Scene]:
    """``count`` scenes: the given ones with new names and tokens."""
    for number in range(count):
        scene = scenes[number % len(scenes)]
        things = [replace(thing, token=fixture.token(number, thing.token)) for thing in scene.things]
        name = f"scene-{number + 1:04d}"
        yield replace(scene, name=name, token=fixture.token(number, scene.token), things=things)


def _rate(by: str, warm: Path, raw: Path, lake: Path) -> Iterator[Figure]:
    runs = [
        json.loads(in_fresh_process(_CONVERT, str(warm), str(raw), f"{lake}-{attempt}", by)) for attempt in range(3)
    ]
    middle = sorted(runs, key=lambda run: run["cpu"])[1]
    name = f"nuscenes, by {by}: {middle['scenarios']} scenarios"
    yield Figure(
        f"{name}, tables and maps included", middle["scenarios"] / middle["cpu"], "scenarios/s of CPU", ">= 10"
    )
    yield Figure(f"nuscenes, by {by}: peak memory of the converter", middle["peak_mb"], "MB", "<= 1500")


def _bytes(root: Path, recordings: Path) -> Iterator[Figure]:
    """Stored bytes of the ten scenes against their source pickles."""
    raw, lake = root / "ten", root / "lake-ten"
    pickles = read_pickles(recordings)
    write_recorded(raw, pickles)
    convert("nuscenes", str(raw), lake, split="mini")
    sizes = {
        table: sum(path.stat().st_size for path in (lake / table).rglob("*.parquet"))
        for table in ("tracks", "metadata", "maps")
    }
    scenes = (recordings / "scenarionet").glob("nuscenes_*/*.pkl")
    pickled = sum(path.stat().st_size for path in scenes if not path.name.startswith("dataset_"))
    own = sizes["tracks"] + sizes["metadata"]
    yield Figure("nuscenes: stored bytes over ScenarioNet's pickles, cities shared", own / pickled, "", "<= 0.1")
    whole = (own + sizes["maps"]) / pickled
    yield Figure("nuscenes: the same with the four cities, for ten scenes", whole, "", "<= 0.2")
    yield Figure("nuscenes: stored bytes per scenario", own / len(pickles) / 1000, "kB", "", "pickles 1,883 kB")
    yield from crop_loads("nuscenes", lake)
