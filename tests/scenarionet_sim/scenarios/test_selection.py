"""Selection and prefetching of the scenarios of an environment."""

from __future__ import annotations

import pickle
import threading
from dataclasses import replace

import numpy as np
import pytest

from scenarionet_data import VariationSpace
from scenarionet_data.errors import (
    BadParameter,
    DatabaseNotFound,
    InvalidScenario,
    LakeError,
    NoSuchSnapshot,
    QueryError,
    ScenarioNotFound,
    UnsafeSql,
)
from scenarionet_data.variations import variations_of
from scenarionet_sim import ScenarioNetEnv
from scenarionet_sim.scenarios.sampling import Curriculum, CurriculumSampler, Sequential
from scenarionet_sim.scenarios.selection import Scenarios
from scenarionet_sim.scenarios.stream import ScenarioStream
from tests.fixtures.drives import Other, make_drive
from tests.fixtures.lakes import write_lake
from tests.fixtures.scenarios import make_scenario


@pytest.fixture(scope="module")
def lake(tmp_path_factory):
    scenarios = [make_scenario(seed, num_objects=1 + seed) for seed in range(9)]
    made = write_lake(tmp_path_factory.mktemp("lake"), scenarios)
    made.filter("num_objects >= 4", name="many")
    return made


def scenarios(lake, *args, **options):
    return Scenarios(str(lake.root), *args, **options)


def series(selection, count):
    loader, sampler = selection.open()
    sampler.restart(0)
    return [loader.scenario_ids[sampler.draw()] for _ in range(count)]


def ids(*seeds):
    return [f"made/v1/s{seed:06d}" for seed in seeds]


def test_lake_database_list_and_condition_as_source(lake):
    assert series(scenarios(lake), 10) == ids(*range(9), 0)
    database = lake.database("many").scenario_ids
    assert series(scenarios(lake, "many"), len(database)) == database
    assert series(scenarios(lake, ids(5, 2)), 3) == ids(5, 2, 5)
    where = "source_scenario_id >= 's000006' -- the last"
    assert series(scenarios(lake, where=where), 3) == ids(6, 7, 8)
    both = series(scenarios(lake, "many", where=where), 3)
    assert set(both) == set(database) & set(ids(6, 7, 8))


def test_random_order_draws_all(lake):
    drawn = series(scenarios(lake, order="random"), 18)
    assert sorted(drawn[:9]) == sorted(drawn[9:]) == ids(*range(9))
    assert drawn[:9] != ids(*range(9))


def test_weights_come_from_the_database_or_an_expression(lake):
    assert set(series(scenarios(lake, "many", order="weighted"), 100)) == set(lake.database("many").scenario_ids)
    only = scenarios(lake, order="weighted", weight="CASE WHEN source_scenario_id = 's000003' THEN 1 ELSE 0 END")
    assert set(series(only, 20)) == set(ids(3))


def test_curriculum_sorts_by_difficulty(lake):
    loader, course = scenarios(lake, curriculum=Curriculum(levels=3)).open()
    assert isinstance(course, CurriculumSampler)
    facts = lake.sql("SELECT scenario_id, difficulty FROM metadata").rows()
    difficulty = [dict(facts)[scenario_id] for scenario_id in loader.scenario_ids]
    assert difficulty == sorted(difficulty)
    loader, _ = scenarios(lake, curriculum=Curriculum(levels=2, by="-num_objects")).open()
    rising = dict(lake.sql("SELECT scenario_id, num_objects FROM metadata").rows())
    assert [rising[i] for i in loader.scenario_ids] == sorted(rising.values(), reverse=True)


@pytest.mark.parametrize("curriculum", [None, Curriculum(levels=2)])
def test_workers_share_without_overlap(lake, curriculum):
    parts = []
    for worker in range(3):
        loader, _ = scenarios(lake, curriculum=curriculum, worker=worker, num_workers=3).open()
        parts.append(loader.scenario_ids)
    assert sorted(name for part in parts for name in part) == ids(*range(9))
    assert [len(part) for part in parts] == [3, 3, 3]


def test_specification_is_picklable_and_takes_paths_and_lists(lake):
    selection = Scenarios(lake.root, ids(1, 2), order="random")
    assert pickle.loads(pickle.dumps(selection)) == selection
    assert hash(selection) == hash(Scenarios(str(lake.root), tuple(ids(1, 2)), order="random"))


@pytest.mark.parametrize(
    ("options", "error", "message"),
    [
        ({"database": "nothing"}, DatabaseNotFound, "many"),
        ({"database": ("made/v1/x",)}, ScenarioNotFound, "made/v1/x"),
        ({"database": ()}, BadParameter, "is empty"),
        ({"where": "num_objects > 1000"}, BadParameter, "none of 9 .* satisfies 'num_objects > 1000'"),
        ({"where": "num_object > 1"}, QueryError, "num_object"),
        ({"where": "true) UNION SELECT (1"}, UnsafeSql, "one condition"),
        ({"order": "weighted", "weight": "-1"}, BadParameter, "weights"),
        ({"worker": 9, "num_workers": 10}, BadParameter, "at most 9 workers"),
        ({"curriculum": Curriculum(levels=10)}, BadParameter, "10 levels of 9 scenarios"),
    ],
)
def test_unusable_selections_are_refused(lake, options, error, message):
    with pytest.raises(error, match=message):
        Scenarios(str(lake.root), **options).open()


@pytest.mark.parametrize(
    "options",
    [
        {"order": "alphabetic"},
        {"worker": 2, "num_workers": 2},
        {"worker": -1},
        {"weight": "num_objects"},
        {"curriculum": Curriculum(), "order": "random"},
    ],
)
def test_contradicting_arguments(options):
    with pytest.raises(BadParameter):
        Scenarios("lake", **options)


def test_path_without_lake(tmp_path):
    with pytest.raises(NoSuchSnapshot, match="scenarionet convert"):
        Scenarios(str(tmp_path)).open()


# --- streams ----------------------------------------------------------------------------------------------


class Source:
    """Ten scenarios that count their loads, some of which fail."""

    def __init__(self, broken=()):
        self.loaded, self.broken, self.threads = [], set(broken), set()

    def load(self, index):
        self.loaded.append(index)
        self.threads.add(threading.current_thread())
        if index in self.broken:
            raise LakeError(f"scenario {index} is damaged")
        return index

    def stream(self, **options):
        return ScenarioStream(
            [f"s{i}" for i in range(10)], self.load, lambda scenario: scenario * 10, Sequential(10), **options
        )


def play(stream):
    """Return the index of the next scenario, and the prepared scenario, as an environment takes them."""
    index = stream.draw()
    prepared = stream.get(index)
    stream.load_ahead()
    return index, prepared


@pytest.mark.parametrize("prefetch", [0, 1, 3])
def test_series_does_not_depend_on_prefetching(prefetch):
    stream = Source().stream(prefetch=prefetch)
    assert [play(stream) for _ in range(12)] == [(i % 10, i % 10 * 10) for i in range(12)]
    stream.restart(0)
    assert play(stream) == (0, 0)
    stream.close()


def test_next_scenario_is_prefetched():
    source = Source()
    stream = source.stream(prefetch=1)
    play(stream)
    stream.get(1)
    assert source.loaded == [0, 1]
    assert threading.main_thread() not in source.threads
    stream.close()
    here = Source()
    play(here.stream(prefetch=0))
    assert here.threads == {threading.main_thread()}


def test_cache_is_bounded():
    source = Source()
    stream = source.stream(prefetch=0, cache_size=3)
    for index in (0, 1, 2, 0, 1, 2):
        stream.get(index)
    assert source.loaded == [0, 1, 2]
    stream.get(3)  # 0 is evicted
    stream.get(1)
    stream.get(0)
    assert source.loaded == [0, 1, 2, 3, 0]


@pytest.mark.parametrize("prefetch", [0, 1])
def test_damaged_scenario_raises_only_its_own_error(prefetch):
    source = Source(broken=[1])
    stream = source.stream(prefetch=prefetch)
    assert play(stream) == (0, 0)
    with pytest.raises(LakeError, match="scenario 1 is damaged"):
        play(stream)
    assert play(stream) == (2, 20)
    source.broken.clear()
    assert stream.get(1) == 10
    stream.close()


def test_closed_stream_has_no_thread_and_can_continue():
    stream = Source().stream(prefetch=2)
    play(stream)
    before = threading.active_count()
    stream.close()
    assert threading.active_count() == before - 1
    stream.close()
    stream.restart(0)
    assert play(stream) == (0, 0)
    stream.close()


def test_indices_of_scenarios():
    stream = Source().stream()
    assert stream.index("s4") == 4
    with pytest.raises(ScenarioNotFound, match="not among the 10"):
        stream.index("x")
    with pytest.raises(BadParameter, match="cache_size=0"):
        Source().stream(cache_size=0)


def test_streams_of_scenarios(lake):
    loader, sampler = replace(scenarios(lake, "many"), order="random").open()
    stream = ScenarioStream(
        loader.scenario_ids, loader.__getitem__, lambda scenario: scenario.id, sampler, prefetch=2, cache_size=4
    )
    drawn = [play(stream) for _ in range(20)]
    assert [loader.scenario_ids[index] for index, _ in drawn] == [name for _, name in drawn]
    assert len(np.unique([index for index, _ in drawn])) == len(loader)
    stream.close()


def test_variations_are_drawn_as_they_are_played(tmp_path):
    """Each episode plays another one; what cannot be is replaced, and the same seed gives the same ones."""
    drives = [replace(make_drive(name, others=(Other(20.0, vx=8.0),)), current_timestep=10) for name in ("a", "b")]
    lake = write_lake(tmp_path / "lake", drives)
    space = VariationSpace({"t1.gap": "-20:10", "ego.speed": "0.9:1.1"}, number=40, seed=3)
    selection = scenarios(lake, variations=space)
    first, second = drives[0].id, drives[1].id
    assert series(selection, 4) == [f"{first}@000000", f"{second}@000000", f"{first}@000001", f"{second}@000001"]
    made, _ = pickle.loads(pickle.dumps(selection)).open()
    stored = list(variations_of(drives[0], space))
    impossible = [k for k, each in enumerate(stored) if isinstance(each, InvalidScenario)]
    assert impossible
    for number, each in enumerate(stored):
        variation = made[2 * number]
        assert variation.id == f"{first}@{number:06d}" and variation.extras["parent"] == first
        if number not in impossible:
            assert variation.extras == each.extras
    assert len({made[2 * number].extras["parameters"]["t1.gap"] for number in range(40)}) == 40
    shares = [scenarios(lake, variations=space, worker=worker, num_workers=2).open()[0] for worker in range(2)]
    assert sorted(shares[0].scenario_ids + shares[1].scenario_ids) == sorted(made.scenario_ids)
    environment = ScenarioNetEnv(scenarios=replace(selection, order="random"))
    played, again = ([environment.reset(seed=seed)[1]["scenario_id"] for seed in (5, None, None)] for _ in range(2))
    environment.close()
    assert played == again and len(set(played)) == 3
    with pytest.raises(InvalidScenario, match="contact"):
        scenarios(lake, variations=VariationSpace({"t1.gap": -20}, number=2)).open()[0][0]
