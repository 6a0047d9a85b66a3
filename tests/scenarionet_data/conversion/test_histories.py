"""Random histories of one lake: files come and go, converters and options change, runs stop early.

Ids stay unique, no scenario still among the recordings is lost, a refusal changes nothing, and snapshots are immutable.
"""

from __future__ import annotations

import random

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from scenarionet_data import Lake, ScenarioLoader, convert
from scenarionet_data.errors import DuplicateScenario
from scenarionet_data.storage.snapshots import metadata_files
from tests.fixtures import made
from tests.fixtures.made import BUCKETED, NAME, Made, MadeOptions
from tests.fixtures.scenarios import make_scenario


class History:
    """A folder of recordings, the lake converted from it, and the expected content."""

    def __init__(self, folder, seed):
        self.random = random.Random(seed)
        self.raw, self.root = folder / "raw", folder / "lake"
        self.raw.mkdir()
        self.converter = self.random.choice([NAME, BUCKETED])
        self.files = {}  # name to seeds and whether it is corrupt
        self.next_seed = 0
        self.counts = {}  # snapshot to scenarios

    def seeds(self, count):
        self.next_seed += count
        return list(range(self.next_seed - count, self.next_seed))

    def move_on(self):
        """Apply a random change to the recordings."""
        act = self.random.choice(["add", "add", "change", "break", "mend", "remove"])
        name = self.random.choice(sorted(self.files) or [""])
        if act == "add" or not name:
            self.files[f"f{self.next_seed}"] = (self.seeds(self.random.randint(1, 3)), False)
        elif act == "change":
            self.files[name] = (self.seeds(1), False)
        elif act == "remove" and len(self.files) > 1:
            del self.files[name]
        elif act in ("break", "mend"):
            self.files[name] = (self.files[name][0], act == "break")

    def write(self):
        for path in self.raw.iterdir():
            path.unlink()
        for name, (seeds, is_corrupt) in self.files.items():
            lines = [str(seed) for seed in seeds] + ["0 corrupt"] * is_corrupt
            (self.raw / f"{name}.made").write_text("\n".join(lines))

    def recorded(self):
        return {f"made/v1/s{seed:06d}" for seeds, _ in self.files.values() for seed in seeds}

    def ids(self):
        if not (self.root / "snapshots").is_dir():
            return []
        return Lake(self.root).sql("SELECT scenario_id FROM metadata")["scenario_id"].to_list()

    def step(self):
        for _ in range(self.random.randint(1, 4)):
            self.move_on()
        self.write()
        if self.random.random() < 0.15:
            Made.version = str(int(Made.version) + 1)
        limit = self.random.choice([None, None, None, None, self.random.randint(1, 4)])
        replaces = self.random.random() < 0.4
        options = MadeOptions(num_objects=self.random.choice([2, 2, 2, 3]))
        before = self.ids()
        how = {"replace": replaces, "reconvert_stale": self.random.random() < 0.2, "limit": limit, "options": options}
        try:
            report = convert(self.converter, str(self.raw), self.root, split="train", **how)
        except DuplicateScenario:
            assert self.ids() == before
            return
        self.check(before, report, limit)

    def check(self, before, report, limit):
        after = self.ids()
        assert len(set(after)) == len(after)
        if limit is None:
            assert set(before) & self.recorded() <= set(after)
            if report.is_clean:
                assert self.recorded() <= set(after)
        if after:
            lake = Lake(self.root)
            for scenario in ScenarioLoader(lake):
                scenario.validate()
            assert lake.sql("SELECT sum(num_scenarios) FROM shards").item() == len(after)
            for number, count in self.counts.items():
                assert len(Lake(self.root, snapshot=number)) == count
            self.counts[lake.snapshot.number] = len(after)


@pytest.mark.long
@given(seed=st.integers(0, 10**6), steps=st.integers(2, 8))
@settings(max_examples=40)
def test_no_history_loses_or_duplicates_a_scenario(seed, steps, tmp_path_factory):
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(metadata_files, "MAX_METADATA_FILES", 3)
        patch.setattr(metadata_files, "MERGED_FILES", 2)
        patch.setattr(Made, "version", "1")
        small = {"num_steps": 2, "num_lanes": 0, "num_lights": 0}
        patch.setattr(made, "make_scenario", lambda seed, **how: make_scenario(seed, **how, **small))
        history = History(tmp_path_factory.mktemp("history"), seed)
        for _ in range(steps):
            history.step()
