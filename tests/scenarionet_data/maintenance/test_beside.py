"""Concurrent processes: one reads, one converts and replaces, one compacts and vacuums; nothing is lost."""

from __future__ import annotations

import subprocess
import sys

import pytest

from scenarionet_data import Lake
from tests.fixtures.made import write_raw
from tests.fixtures.waiting import HANGS_AFTER
from tests.scenarionet_data.maintenance.conftest import check_whole, convert_to

SETUP = """
import sys, time, random
from pathlib import Path
from scenarionet_data import Lake, ScenarioLoader, convert
from scenarionet_data.scenario.content_hash import content_hash
from scenarionet_data.errors import NoSuchSnapshot
from scenarionet_data.maintenance import compact, fsck, vacuum
from scenarionet_data.storage.write import layouts
from tests.fixtures import made
from tests.fixtures.made import NAME, MadeOptions, write_raw
from tests.fixtures.scenarios import make_scenario
layouts.LAYOUTS["analytics"] = layouts.Layout("analytics", 3, 8)
small = {"num_steps": 3, "num_lanes": 2, "num_lights": 1}
made.make_scenario = lambda seed, **how: make_scenario(seed, **how, **small)
root, raw, end = Path(sys.argv[1]), Path(sys.argv[2]), time.monotonic() + float(sys.argv[3])
rounds = 0
"""

READ = """
while time.monotonic() < end or rounds < 2:
    try:
        lake = Lake(root)
        stored = dict(lake.sql("SELECT scenario_id, content_hash FROM metadata").rows())
        rows, scenarios = lake.sql("SELECT count(*), count(DISTINCT scenario_id) FROM tracks").row(0)
        assert (rows, scenarios) == (2 * len(stored), len(stored)), (rows, scenarios, len(stored))
        loader = ScenarioLoader(lake)
        for index in random.sample(range(len(loader)), 3):
            scenario = loader[index]
            assert content_hash(scenario) == stored[scenario.id]
        rounds += 1
    except NoSuchSnapshot as error:
        assert "has expired while it was read" in str(error), error
print(rounds)
"""

CONVERT = """
seed = 1000
while time.monotonic() < end or rounds < 2:
    seed += 1
    name = f"w{seed % 7}"
    write_raw(raw, {name: [seed], "s1": [10, 5000 + seed]})
    report = convert(NAME, str(raw), root, options=MadeOptions(num_objects=2), check=False, replace=True)
    assert report.is_clean, report.failed
    rounds += 1
print(rounds)
"""

MAINTAIN = """
while time.monotonic() < end or rounds < 2:
    done = compact(root, random.choice(["training", "analytics"]))
    assert not done.failed, done.failed
    vacuum(root, keep_last=random.randint(1, 2))
    rounds += 1
print(rounds)
"""


@pytest.mark.long
def test_concurrent_reading_converting_and_maintenance(tmp_path):
    raw = write_raw(tmp_path / "raw", {f"s{k}": [10 * k, 10 * k + 1] for k in range(5)})
    root = convert_to(raw, tmp_path / "lake")
    code = [(name, SETUP + each) for name, each in (("read", READ), ("convert", CONVERT), ("maintain", MAINTAIN))]
    jobs = [
        (name, subprocess.Popen([sys.executable, "-c", each, str(root), str(raw), "12"], text=True,
                                stdout=subprocess.PIPE, stderr=subprocess.PIPE))
        for name, each in code
    ]  # fmt: skip
    for name, job in jobs:
        out, err = job.communicate(timeout=HANGS_AFTER)
        assert job.returncode == 0, name + err
        assert int(out) >= 2, name
    check_whole(root)
    recorded = {f"made/v1/s{int(line):06d}" for path in raw.iterdir() for line in path.read_text().split()}
    assert set(Lake(root).sql("SELECT scenario_id FROM metadata")["scenario_id"]) == recorded
