"""Mistakes in Python: the obvious meaning, or one sentence with what is wanted, as on the command line."""

from __future__ import annotations

import math
import subprocess
import sys

import numpy as np
import pytest

from scenarionet_data import (
    Agents,
    Augmentation,
    Budgets,
    Lake,
    Lights,
    MapBuilder,
    Polylines,
    SampleLayout,
    Samples,
    ScenarioLoader,
    Shuffling,
    Targets,
    TimeWindow,
    VariationSpace,
    bucket,
    convert,
    fingerprint,
    fsck,
    make_origin,
    make_scenario_id,
    make_scorecard,
    make_tracks,
    plots,
    resample,
    upgrade,
    vacuum,
    vary,
    verify_pack,
)  # isort: skip
from scenarionet_data.errors import BadParameter, QueryError, ScenarioNotFound
from scenarionet_data.forecasts import make_predictions, score, summary, write_predictions
from scenarionet_data.operations.moments import event, relation
from tests.fixtures.lakes import write_lake
from tests.fixtures.scenarios import make_scenario, renamed
from tests.fixtures.waiting import HANGS_AFTER

WINDOW = (0.4, 1.2)


@pytest.fixture(scope="module")
def lake(tmp_path_factory):
    return write_lake(tmp_path_factory.mktemp("mistakes") / "lake", [make_scenario(k, num_steps=31) for k in range(3)])


def tracks_of(object_type=(0,), **others):
    """Tracks of one object over three timesteps."""
    states = {"position": np.zeros((1, 3, 3)), "heading": np.zeros((1, 3)), "velocity": np.zeros((1, 3, 2))}
    size, valid = np.ones((1, 3)), np.ones((1, 3), np.bool_)
    return make_tracks(["a"], object_type, **{**states, **others}, size=size, valid=valid, origin=np.zeros(3))


def test_obvious_meanings(lake):
    loader = ScenarioLoader(lake)
    name = loader.scenario_ids[2]
    assert loader[name].id == lake.select()[name].id == loader[np.int64(2)].id == name
    assert len(loader.tracks(name)) == len(loader[name].tracks)
    assert [each.id for each in loader[[2, 0]]] == [each.id for each in loader.batch([2, loader.scenario_ids[0]])]
    assert Samples(lake, window=WINDOW, targets="moving").choices.window == TimeWindow(0.4, 1.2)
    assert Samples(lake, window=WINDOW, targets="moving").choices.targets == Targets("moving")


@pytest.mark.parametrize(
    ("wrong", "message"),
    [
        (lambda lake, samples: ScenarioLoader(lake)["made/v1/x"], "none of 3 scenarios is 'made/v1/x'; ids look like"),
        (lambda lake, samples: ScenarioLoader(lake)[1.5], "expected the index of a scenario, 0 ... 2, or its id; 1.5"),
        (lambda lake, samples: lake.select("false")[0], "scenario 0 of 0: the selection is empty"),
        (lambda lake, samples: samples.batch([]), "expected whole numbers of samples, at least one"),
        (lambda lake, samples: samples.batch([1.5]), r"expected whole numbers of samples.* found \[1.5\]"),
        (lambda lake, samples: samples.batch(3), "expected whole numbers of samples"),
        (lambda lake, samples: samples["x"], "expected whole numbers of samples"),
        (lambda lake, samples: samples.batch([0], epoch=-1), "epoch: expected a whole number of 0 or more, found -1"),
        (lambda lake, samples: Samples(lake, [])[0], "sample 0 of 0: `findings` says why"),
        (
            lambda lake, samples: Samples(lake, window=3.0),
            r"window: expected TimeWindow, such as TimeWindow\(h",
        ),
        (lambda lake, samples: Samples(lake, window=(1,) * 7), "window: expected TimeWindow"),
        (lambda lake, samples: Samples(lake, agents=8), "agents: expected Agents, such as Agents"),
        (lambda lake, samples: Samples(lake, targets="all"), "which: expected default or recorded or ego"),
        (lambda lake, samples: Samples(lake, layout="unitraj"), "layout: expected FORECASTING, UNITRAJ or a function"),
        (lambda lake, samples: TimeWindow(history=math.inf), "history: expected a multiple of 0.1 s, found inf"),
        (lambda lake, samples: TimeWindow(dt=math.inf), "dt: expected a timestep above 0 s, found inf"),
        (lambda lake, samples: TimeWindow(stride=math.inf), "stride: expected a time above 0 s, or None, found inf"),
        (lambda lake, samples: TimeWindow(longest_gap=math.nan), "longest_gap: expected 0 s or more, found nan"),
        (lambda lake, samples: Agents(count=1.5), "count: expected at least 1 agent, found 1.5"),
        (lambda lake, samples: Agents(radius=-1), "radius: expected a distance above 0 m, found -1"),
        (lambda lake, samples: Agents(types=("VEHICLE",)), "types: expected ObjectTypes: .*VEHICLE"),
        (lambda lake, samples: Polylines(spacing=math.inf), "spacing: expected a distance above 0 m, found inf"),
        (lambda lake, samples: Targets(limit=-1), "limit: expected at least 1 target, or None, found -1"),
        (lambda lake, samples: Augmentation(seed=-1), "seed: expected a whole number of 0 or more, found -1"),
        (lambda lake, samples: Augmentation(noise=math.inf), "noise: expected 0 m or more, found inf"),
        (lambda lake, samples: Shuffling(seed=-1), "seed: expected a whole number of 0 or more, found -1"),
        (lambda lake, samples: Shuffling(block=1.5), "block, buffer: expected at least 1 sample, found 1.5 and 8192"),
        (lambda lake, samples: lake.sample(name="s", n=1.5), "n: wanted a whole number of 1 or more, found 1.5"),
        (lambda lake, samples: lake.sample(name="s", n=-1), "n: wanted a whole number of 1 or more, found -1"),
        (lambda lake, samples: lake.sample(name="s", n=1, seed="x"), "seed: wanted a whole number, found 'x'"),
        (lambda lake, samples: lake.sample(name="s", fraction="0.5"), "fraction: wanted a number above 0 and up to 1"),
        (lambda lake, samples: lake.split({"a": math.inf}), "each with a fraction above 0"),
        (lambda lake, samples: lake.split({"a": "x"}), "each with a fraction above 0"),
        (lambda lake, samples: lake.split(levels="3"), "levels: wanted a whole number of 1 or more, found '3'"),
        (lambda lake, samples: lake.select(None), "wanted SQL as text, found None"),
        (lambda lake, samples: lake.select("true", parameters=[1]), "parameters: wanted values by name"),
        (lambda lake, samples: lake.select("dataset = made"), "a text is written in quotes, 'made'"),
        (lambda lake, samples: lake.sql("FROM metadata WHERE dataset = made"), "a text is written in quotes, 'made'"),
        (lambda lake, samples: lake.select("dataset IN (made, pg)"), "a text is written in quotes, 'made'"),
        (lambda lake, samples: lake.database(3), "wanted a database or its name, found 3"),
        (lambda lake, samples: Lake(lake.root, snapshot="1"), "snapshot: wanted a number or None, found '1'"),
        (lambda lake, samples: ScenarioLoader(lake).batch(3), r"expected indices or ids.* such as \[0, 1\], found 3"),
        (lambda lake, samples: ScenarioLoader(lake).batch("made"), "expected indices or ids of scenarios"),
        (lambda lake, samples: ScenarioLoader(lake).batch_tracks(None), "expected indices or ids of scenarios"),
        (lambda lake, samples: ScenarioLoader(lake)["a":"b"], "expected a slice of indices, such as 0:8"),
        (lambda lake, samples: ScenarioLoader(None), "expected a lake, its path or its URL, found None"),
        (lambda lake, samples: ScenarioLoader(lake, 3), "expected a database, its name, or scenario ids, found 3"),
        (lambda lake, samples: lake.restrict_to([3]), r"expected a database, its name, or scenario ids, found \[3\]"),
        (lambda lake, samples: Lake(b"lake"), "expected a lake, its path or its URL, found b'lake'"),
        (lambda lake, samples: Lake(lake.root, user_columns=["a"]), "user_columns: wanted versions by name"),
        (lambda lake, samples: fsck(None), "expected a lake, its path or its URL"),
        (lambda lake, samples: verify_pack(None), "expected a path, found None; give the folder or tar of a pack"),
        (lambda lake, samples: lake.sql("SELECT $a", [1]), "parameters: wanted values by name"),
        (lambda lake, samples: lake.named_query(None), "None"),
        (lambda lake, samples: lake.named_query("summary", [1]), "parameters: wanted values by name"),
        (lambda lake, samples: lake.mine("cut_in", 3), "parameters: wanted values by name"),
        (lambda lake, samples: lake.mine("cut_in", database=3), "expected a database, its name, or scenario ids"),
        (lambda lake, samples: lake.moments("cut_in"), "expected moments, such as following"),
        (lambda lake, samples: lake.filter(name=3), "3 is no database name"),
        (lambda lake, samples: lake.drop(3), "expected a database or its name, found 3"),
        (lambda lake, samples: lake.checkout(None), "expected a database or its name, found None"),
        (lambda lake, samples: lake.rebase(None), "expected a database or its name, found None"),
        (lambda lake, samples: lake.split({1: 0.5, 2: 0.5}), "fractions: wanted those of parts by name"),
        (lambda lake, samples: lake.overlap("a", "b", kinds=3), "kinds: wanted a list of rules, found 3"),
        (lambda lake, samples: lake.publish("new", "hive"), "catalog='hive'; choose from"),
        (lambda lake, samples: lake.export(None, None), "expected a path, found None"),
        (lambda lake, samples: lake.add(None), r"scenarios: expected several, such as \[scenario\], found None"),
        (lambda lake, samples: lake.add([1]), "scenarios: expected ScenarioDescriptions, found 1"),
        (lambda lake, samples: lake.history("x"), "last: wanted a whole number of 1 or more, found 'x'"),
        (lambda lake, samples: TimeWindow("a"), "history: expected a number, found 'a'"),
        (lambda lake, samples: TimeWindow(stride="a"), "stride: expected a number, found 'a'"),
        (lambda lake, samples: Agents(radius="x"), "radius: expected a number, found 'x'"),
        (lambda lake, samples: Agents(types=3), "types: expected a tuple of ObjectTypes, found 3"),
        (lambda lake, samples: Targets(which="where", where=3), "where: expected SQL as text, found 3"),
        (lambda lake, samples: Augmentation(rotation="x"), "rotation: expected a number, found 'x'"),
        (lambda lake, samples: convert("pg", "0:1", lake, workers="2"), "workers: wanted 1 or more, found '2'"),
        (lambda lake, samples: convert("pg", "0:1", lake, split=3), "split: wanted a text, found 3"),
        (lambda lake, samples: convert("pg", "0:1", lake, workers=-1), "workers: wanted 1 or more, found -1"),
        (lambda lake, samples: convert("pg", "0:1", lake, limit=0), "limit: wanted 1 or more, found 0"),
        (lambda lake, samples: convert("pg", "0:1", lake, options="x"), r"options: wanted \w+ or values by name"),
        (
            lambda lake, samples: ScenarioLoader(lake)[True],
            "expected the index of a scenario, 0 ... 2, or its id; True",
        ),
        (lambda lake, samples: make_scorecard(None), r"expected the report of run_checks\(lake\), found None"),
        (lambda lake, samples: lake.describe(3), "scenario_id: wanted a text, found 3"),
        (lambda lake, samples: lake.tag("fast", 3), "wanted a table, or a value by scenario id, found 3"),
        (lambda lake, samples: lake.tag("fast", {"a": object()}), "wanted values of one type by scenario id"),
        (lambda lake, samples: lake.tag(3, {}), "3 is not a valid name of a user column"),
        (lambda lake, samples: lake.tag_event("fast", 3), "events: wanted names, or parameters by name, found 3"),
        (lambda lake, samples: lake.tag_from_file("fast", None), "expected a path, found None"),
        (lambda lake, samples: lake.filter(filters=3, name="x"), "filters: wanted names, or parameters by name"),
        (lambda lake, samples: vacuum(lake, keep_last="x"), "keep_last='x'; keep at least the newest snapshot"),
        (lambda lake, samples: vacuum(lake, older_than="x"), "older_than='x'; expected a time of 0 s or more"),
        (lambda lake, samples: fsck(lake, workers="x"), "workers: wanted 1 or more, found 'x'"),
        (lambda lake, samples: upgrade(lake, workers="x"), "workers: wanted 1 or more, found 'x'"),
        (lambda lake, samples: SampleLayout(None), "make=None; expected a function of scenarios and choices"),
        (lambda lake, samples: VariationSpace(None), "parameters None: a variation changes something"),
        (lambda lake, samples: VariationSpace({"ego.speed": 1.1}, number="x"), "number='x'; expected a whole number"),
        (lambda lake, samples: VariationSpace({"ego.speed": 1.1}, jerk="x"), "jerk='x'; expected a finite number"),
        (lambda lake, samples: vary(lake, "made/v1/s000001", 3, name="v"), "space: wanted VariationSpace"),
        (lambda lake, samples: resample(None), "expected a scenario, such as .*; found None"),
        (lambda lake, samples: resample(lake.loader()[0], "x"), "dt: expected a timestep above 0 s.* found 'x'"),
        (lambda lake, samples: resample(lake.loader()[0], 10**30), "dt: expected a timestep above 0 s and up to 10000"),
        (lambda lake, samples: Targets(np.array([1, 2])), r"which: expected .*, found array\(\[1, 2\]\)"),
        (lambda lake, samples: Samples(lake, perspective=np.array([1, 2])), "perspective: expected agent or scene"),
        (lambda lake, samples: lake.sql("SELECT 1", np.array([1, 2])), "parameters: wanted values by name"),
        (lambda lake, samples: plots.scenario_figure(None), "expected a scenario, such as .*; found"),
        (lambda lake, samples: plots.scenario_figure(lake.loader()[0], "x"), "no timestep 'x'; there are 0 to 30"),
        (lambda lake, samples: plots.thumbnail(lake.loader()[0], timestep=99), "no timestep 99; there are 0 to 30"),
        (lambda lake, samples: plots.thumbnail(lake.loader()[0], 0), "size: expected width and height .*, found 0"),
        (lambda lake, samples: plots.animate(None), "expected a scenario, such as .*; found None"),
        (lambda lake, samples: plots.small_multiples(3), "scenarios: expected several, such as .*, found 3"),
        (lambda lake, samples: plots.small_multiples([3], columns=0), "columns: expected a whole number of 1 or more"),
        (lambda lake, samples: plots.draw_profiles(None), "expected a scenario, such as .*; found None"),
        (lambda lake, samples: plots.draw_profiles(lake.loader()[0], 3), "track_ids: expected ids of tracks, found 3"),
        (lambda lake, samples: plots.draw_comparison(3), "statistics: expected the result of lake.compare, found 3"),
        (lambda lake, samples: plots.draw_distributions(lake, 3), "columns: expected several.*, found 3"),
        (lambda lake, samples: plots.draw_distributions(lake, bins="x"), "bins: expected a whole number of 1 or more"),
        (lambda lake, samples: plots.Drawing(size="x"), "size='x'; expected a whole number"),
        (lambda lake, samples: plots.Drawing(speed=0), "speed=0; expected a number above 0"),
        (lambda lake, samples: plots.Drawing().save(None, None), "expected a path, found None"),
        (lambda lake, samples: plots.write_figure(None, None), "expected a path, found None"),
        (lambda lake, samples: plots.TopDown(plots.Scene.of(lake.loader()[0]), "x"), "window='x'; expected a Window"),
        (lambda lake, samples: plots.write_figure("x.png", None), "figure=None; expected one of matplotlib"),
        (lambda lake, samples: plots.scenario_figure(lake.loader()[0], size="x"), "size='x'; expected a whole number"),
        (lambda lake, samples: lake.filter(name="s", replace="y"), "replace='y'; expected True or False"),
        (lambda lake, samples: lake.drop("s", force="y"), "force='y'; expected True or False"),
        (lambda lake, samples: lake.export(None, "o", replace="y"), "replace='y'; expected True or False"),
        (lambda lake, samples: lake.export(None, "o", executor="y"), r"executor='y'; expected .* ProcessExecutor\(2\)"),
        (lambda lake, samples: lake.add(lake.loader()[:1], check="y"), "check='y'; expected True or False"),
        (lambda lake, samples: make_scenario_id(None, "1", "x"), "None in an id; expected texts"),
        (lambda lake, samples: make_scenario_id("pg", "1", 3), "3 in an id; expected texts"),
        (
            lambda lake, samples: make_scenario_id("pg", "1", "x", [1]),
            r"\[1\] in an id; .* as start a text",
        ),
        (lambda lake, samples: fingerprint(None), "paths=None; expected several Paths"),
        (lambda lake, samples: fingerprint("x"), "path='x'; expected a Path"),
        (lambda lake, samples: bucket(None), "items: expected RawItems, found None"),
        (lambda lake, samples: bucket([1]), "items: expected RawItems, found 1"),
        (lambda lake, samples: bucket([], size=0), "size=0; expected a whole number of 1 or more"),
        (lambda lake, samples: Budgets("x"), "velocity_median='x'; expected a finite number"),
        (lambda lake, samples: Agents(types=()), "types: expected a tuple of ObjectTypes"),
        (lambda lake, samples: Lights.empty("x"), "num_timesteps='x'; expected a whole number"),
        (lambda lake, samples: lake.keep_moments("a", None), "no moments are kept under the name 'a'"),
        (lambda lake, samples: lake.keep_moments("a", {"x": "cut_in"}), "expected moments.*found 'cut_in'"),
        (lambda lake, samples: lake.keep_moments("a", {3: event("cut_in")}), "3 is no name of moments"),
        (lambda lake, samples: relation("following") & 3, r"steps=3; expected steps, .* on the right of &"),
        (lambda lake, samples: relation("following") | None, r"steps=None; expected steps, .* on the right of \|"),
        (lambda lake, samples: relation("following") & event("cut_in"), "& combines steps, .* use overlaps"),
        (lambda lake, samples: event("cut_in").during(None), "expected moments, such as following"),
        (lambda lake, samples: event("cut_in").before("x", within=1.0), "expected moments, such as following"),
        (lambda lake, samples: relation("has_velocity", {"min_velocity": math.nan}), "wants float, found nan"),
        (lambda lake, samples: VariationSpace({3: 1.1}), "name=3; expected a text such as 'ego.speed'"),
        (
            lambda lake, samples: vary(lake, None, VariationSpace({"ego.speed": 1.1}), name=None),
            "name=None; expected a",
        ),
        (lambda lake, samples: make_tracks([], [], *[np.zeros((1, 3))] * 4, None, origin=0), r"valid: .* shape \(1,\)"),
        (lambda lake, samples: tracks_of(position=np.zeros((1, 3, 2))), r"shape \(1, 3, 3\), found \(1, 3, 2\)"),
        (lambda lake, samples: tracks_of(object_type=["car"]), r"object_type=\['car'\]; expected codes, such as"),
        (lambda lake, samples: make_origin(None, None, True), r"position: expected the ego's \(timesteps, 3\)"),
        (lambda lake, samples: make_origin(np.zeros((1, 3, 3)), np.ones(3), True), r"found shape \(1, 3, 3\)"),
        (lambda lake, samples: MapBuilder().add("a", "LANE"), "feature_type='LANE'; expected one such as MapFea"),
        (lambda lake, samples: make_predictions(None, None, None, None, None), "0 keys, modes .*; expected a key of"),
        (
            lambda lake, samples: make_predictions([], np.zeros((0, 3, 2)), np.zeros((0, 1)), np.zeros((0, 4)), 0.1),
            r"modes \(0, 3, 2\), .*; expected a key of each sample, \(samples, modes, steps, 2\)",
        ),
        (lambda lake, samples: write_predictions("x.parquet", []), "rows: expected at least one table"),
        (lambda lake, samples: write_predictions("x.parquet", [1]), "rows: expected at least one table"),
        (lambda lake, samples: score(lake, None), "predictions=None; expected predictions or their file"),
        (lambda lake, samples: score(lake, [1]), "prediction=1; expected what read_predictions returns"),
        (lambda lake, samples: summary(lake, "x"), r"scores='x'; expected what score\(lake, predictions\) returns"),
    ],
)
def test_a_mistake_is_a_sentence(wrong, message, lake):
    samples = Samples(lake, window=WINDOW, targets="moving")
    with pytest.raises((BadParameter, QueryError, ScenarioNotFound, IndexError), match=message) as caught:
        wrong(lake, samples)
    assert len(str(caught.value)) < 400


def test_a_column_on_the_right_is_no_text(lake):
    with pytest.raises(QueryError) as caught:
        lake.select("speed > 3")
    assert "in quotes" not in str(caught.value)


@pytest.mark.parametrize("state", [None, {}, [1], {"epoch": "a", "done": 0}, {"epoch": -1, "done": 0}])
def test_garbage_is_no_state_of_a_stream(lake, state):
    training = pytest.importorskip("scenarionet_data.samples.training")
    stream = training.SampleStream(Samples(lake, window=WINDOW, targets="moving"), 2)
    with pytest.raises(BadParameter, match="expected what state_dict returned"):
        stream.load_state_dict(state)
    stream.load_state_dict({"epoch": 1, "done": 1})
    assert stream.state_dict() == {"epoch": 1, "done": 1}


def test_the_last_part_of_an_id_finds_a_scenario(tmp_path):
    made = [renamed(make_scenario(1, num_steps=6), name) for name in ("9", "19", "90", "91")]
    lake = write_lake(tmp_path / "lake", made)
    assert lake.describe("9")["scenario_id"] == "made/v1/9"
    assert lake.describe("v1/19")["scenario_id"] == "made/v1/19"
    with pytest.raises(ScenarioNotFound, match="did you mean made/v1/19, made/v1/9, made/v1/90"):
        lake.describe("v1")


def test_a_query_without_enough_memory_says_what_to_do(lake):
    small = Lake(lake.root, max_memory=1_000_000)
    with pytest.raises(QueryError, match=r"Out of Memory Error.*; select fewer rows and columns") as caught:
        small.sql("SELECT list(range) FROM range(10_000_000)")
    assert "\n" not in str(caught.value)


@pytest.mark.skipif(sys.platform != "linux", reason="other systems do not limit the address space")
def test_a_command_without_enough_address_space_says_how_much_it_needs(lake):
    command = f"ulimit -v 700000; {sys.executable} -m scenarionet_pipelines.cli show {lake.root} 0"
    done = subprocess.run(["sh", "-c", command], capture_output=True, text=True, timeout=HANGS_AFTER)
    assert "warning: memory may not suffice: `ulimit -v` allows 0.7 GB" in done.stderr
    assert "verbs need 1.6 GB" in done.stderr
    assert "Traceback" not in done.stderr
