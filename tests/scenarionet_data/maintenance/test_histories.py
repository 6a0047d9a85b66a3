"""Random histories of one lake against a model: no sequence of operations changes any scenario."""

from __future__ import annotations

import shutil
import tempfile
import warnings
from pathlib import Path

import pytest
from hypothesis import settings
from hypothesis import strategies as st
from hypothesis.stateful import Bundle, RuleBasedStateMachine, consumes, invariant, rule, run_state_machine_as_test

from scenarionet_data import Lake, ScenarioLoader
from scenarionet_data.maintenance import compact, fsck, plan_compaction, vacuum
from scenarionet_data.query.members import StaleDatabaseWarning
from scenarionet_data.scenario.content_hash import content_hash
from scenarionet_data.storage.files.local import LocalLakeFiles
from scenarionet_data.storage.snapshots import commit as commits
from scenarionet_data.storage.snapshots import metadata_files
from scenarionet_data.storage.snapshots import snapshot as snapshots
from tests.fixtures.made import MadeOptions, write_raw
from tests.fixtures.scenarios import make_scenario
from tests.scenarionet_data.maintenance.conftest import SMALL, age, check_whole, convert_to

SEEDS = st.lists(st.integers(0, 30), min_size=1, max_size=4, unique=True)
OBJECTS = st.sampled_from([1, 2])


class Maintained(RuleBasedStateMachine):
    """The model: seed and number of objects of every recording, and the members of every database."""

    databases = Bundle("databases")

    def __init__(self):
        super().__init__()
        self.folder = Path(tempfile.mkdtemp())
        self.raw, self.root = self.folder / "raw", self.folder / "lake"
        self.held = {}  # recording to {scenario id: content hash}
        self.saved = {}  # database to {scenario id: content hash}
        self.hashes = {}
        self.convert(list(range(100, 104)), 2)

    def teardown(self):
        check_whole(self.root)
        shutil.rmtree(self.folder)

    def hash_of(self, seed, num_objects):
        if (seed, num_objects) not in self.hashes:
            scenario = make_scenario(seed, num_objects=num_objects, **SMALL)
            self.hashes[seed, num_objects] = scenario.id, content_hash(scenario)
        return self.hashes[seed, num_objects]

    @property
    def model(self):
        return {scenario_id: held for each in self.held.values() for scenario_id, held in each.items()}

    @rule(seeds=SEEDS, num_objects=OBJECTS)
    def convert(self, seeds, num_objects):
        """Each seed is one recording; recordings already in the lake are replaced if the options differ."""
        write_raw(self.raw, {f"s{seed}": [seed] for seed in seeds})
        for path in self.raw.iterdir():
            if path.stem not in {f"s{seed}" for seed in seeds}:
                path.unlink()
        convert_to(self.raw, self.root, options=MadeOptions(num_objects=num_objects), replace=True)
        for seed in seeds:
            self.held[seed] = dict([self.hash_of(seed, num_objects)])

    @rule(profile=st.sampled_from(["training", "analytics"]))
    def compact(self, profile):
        compact(self.root, profile)
        assert plan_compaction(self.root, profile) == []

    @rule(keep_last=st.integers(1, 3), days=st.sampled_from([0, 2]))
    def vacuum(self, keep_last, days):
        age(self.root, days)
        done = vacuum(self.root, keep_last=keep_last)
        assert not set(done.expired) & set(snapshots.numbers(LocalLakeFiles(self.root)))
        if days:
            assert [note for note in fsck(self.root).notes if "no snapshot" in note.text] == []

    @rule(target=databases, digit=st.integers(0, 9))
    def filter(self, digit):
        name = f"d{len(self.saved)}"
        Lake(self.root).filter(f"scenario_id LIKE '%{digit}'", name=name, allow_empty=True)
        self.saved[name] = {i: found for i, found in self.model.items() if i.endswith(str(digit))}
        return name

    @rule(name=consumes(databases))
    def drop(self, name):
        Lake(self.root).drop(name)

    @rule(name=databases)
    def load(self, name):
        """Each scenario loads exactly as it was converted."""
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", StaleDatabaseWarning)
            found = {scenario.id: content_hash(scenario) for scenario in ScenarioLoader(self.root, name)}
        assert found == self.saved[name]

    @rule()
    def consolidate(self):
        commits.consolidate(LocalLakeFiles(self.root))

    @invariant()
    def the_lake_is_the_model(self):
        lake = Lake(self.root)
        assert dict(lake.sql("SELECT scenario_id, content_hash FROM metadata").rows()) == self.model
        counted = lake.sql("SELECT count(*) AS rows, count(DISTINCT scenario_id) AS n FROM tracks").row(0)
        assert counted == (lake.sql("SELECT sum(tracks_num_rows) FROM metadata").item(), len(self.model))


def run_histories(examples, steps):
    run_state_machine_as_test(
        Maintained, settings=settings(max_examples=examples, stateful_step_count=steps, deadline=None)
    )


@pytest.fixture
def few(monkeypatch):
    """Merge metadata files after only a few shards."""
    monkeypatch.setattr(metadata_files, "MAX_METADATA_FILES", 4)
    monkeypatch.setattr(metadata_files, "MERGED_FILES", 2)


@pytest.mark.long
def test_short_random_histories(few):
    run_histories(2, 8)


@pytest.mark.long
def test_long_random_histories(few):
    run_histories(25, 20)
