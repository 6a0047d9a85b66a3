"""Embeddings in a lake: vectors as a user column, the nearest scenarios, near-duplicates, and mistakes."""

from __future__ import annotations

import numpy as np
import pyarrow as pa
import pytest

from scenarionet_data import Lake
from scenarionet_data.databases import user_columns
from scenarionet_data.embeddings import features
from scenarionet_data.embeddings.embed import embed
from scenarionet_data.errors import BadParameter, QueryError, ScenarioNotFound, UserColumnExists
from tests.fixtures.lakes import write_lake
from tests.fixtures.near_duplicates import planted
from tests.fixtures.scenarios import make_scenario


@pytest.fixture(scope="module")
def scenarios():
    small = {"num_steps": 81, "num_lanes": 2, "num_lights": 0}
    return [make_scenario(number, num_objects=3 + number, **small) for number in range(12)]


@pytest.fixture
def lake(tmp_path, scenarios):
    made = write_lake(tmp_path / "lake", scenarios)
    made.embed("v")
    return Lake(made.root)


def distances(scenarios, number):
    """By numpy, of the nearest first."""
    vectors = np.array([features.vector(each) for each in scenarios])
    away = np.linalg.norm(vectors - vectors[number], axis=1)
    return [(scenarios[other].id, away[other]) for other in np.argsort(away) if other != number]


def test_column_has_vectors_and_the_hash_of_the_model(lake, scenarios):
    record = user_columns.read(lake.files, "v", 1)
    assert record.source == f"embedding by features {features.standard().digest}"
    assert record.count == len(scenarios)
    rows = lake.arrow("SELECT v FROM metadata WHERE scenario_id = $id", {"id": scenarios[3].id})
    np.testing.assert_array_equal(rows["v"][0].as_py(), features.vector(scenarios[3]))


def test_nearest_scenarios_are_those_of_numpy(lake, scenarios):
    wanted = distances(scenarios, 5)
    found = lake.similar(scenarios[5].id, 4)
    assert found["scenario_id"].to_list() == [name for name, _ in wanted[:4]]
    np.testing.assert_allclose(found["distance"], [away for _, away in wanted[:4]], rtol=1e-5)
    assert len(lake.similar(scenarios[5].id, 100, by="v")) == len(scenarios) - 1
    few = [name for name, _ in wanted[-2:]]
    lake.filter(name="few", ids=few)
    assert lake.similar(scenarios[5].id, 1, database="few")["scenario_id"].to_list() == few[:1]


def test_distance_in_sql_orders_a_database(lake, scenarios):
    wanted = distances(scenarios, 2)
    found = lake.sql(f"SELECT scenario_id, distance_to(v, '{scenarios[2].id}') AS distance FROM metadata")
    found = dict(found.iter_rows())
    assert [found[name] for name, _ in wanted] == pytest.approx([away for _, away in wanted], rel=1e-5)
    near = lake.filter(name="near", order_by=f"distance_to(v, '{scenarios[2].id}')", limit=4)
    assert near.scenario_ids == [scenarios[2].id, *(name for name, _ in wanted[:3])]
    assert near.lineage.user_columns == ["v@1"]
    with pytest.raises(QueryError, match="no vector of scenario nobody"):
        lake.sql("SELECT distance_to(v, 'nobody') FROM metadata")


def test_mistakes_are_sentences(lake, scenarios, tmp_path):
    plain = write_lake(tmp_path / "plain", scenarios[:1])
    with pytest.raises(BadParameter, match=r"which embedding\? there is none yet: scenarionet db embed"):
        plain.similar(scenarios[0].id)
    with pytest.raises(ScenarioNotFound):
        lake.similar("nobody")
    with pytest.raises(BadParameter, match="k: wanted a whole number of 1 or more, found 0"):
        lake.similar(scenarios[0].id, 0)
    with pytest.raises(UserColumnExists):
        lake.embed("v")
    with pytest.raises(
        BadParameter, match=r"no model 'resnet'.*there is features, and each run of this lake .*: none yet"
    ):
        lake.embed("w", model="resnet")
    lake.tag("score", {scenarios[0].id: 1.0})
    lake.embed("w", lake.filter(name="two", ids=[scenarios[0].id, scenarios[1].id]))
    later = Lake(lake.root)
    with pytest.raises(BadParameter, match="'score' is a user column, but of type double; there are v, w"):
        later.similar(scenarios[0].id, by="score")
    with pytest.raises(BadParameter, match=r"which embedding\? there are v, w"):
        later.similar(scenarios[0].id)
    with pytest.raises(BadParameter, match="has no vector in w"):
        later.similar(scenarios[4].id, by="w")
    later.filter(name="all")
    with pytest.raises(BadParameter, match="10 of 12 scenarios have no vector in w"):
        later.overlap("two", "all", embedding="w")
    with pytest.raises(BadParameter, match="give kinds, or an embedding"):
        later.overlap("two", "all", kinds=["same_log"], embedding="v")


def test_lake_with_one_scenario(tmp_path, scenarios):
    write_lake(tmp_path / "one", scenarios[:1]).embed("v")
    one = Lake(tmp_path / "one")
    assert len(one.similar(scenarios[0].id)) == 0
    one.filter(name="a")
    one.filter(name="b")
    (found,) = one.overlap("a", "b", embedding="v")
    assert (found.num_first, found.num_second, found.examples) == (0, 0, ())


def test_vectors_that_are_not_finite_are_refused(lake, scenarios):
    class Broken:
        source = "broken 0"

        def vectors(self, lake, loader):
            return (np.array([1.0, np.nan], np.float32) for _ in loader)

    with pytest.raises(BadParameter, match="the model gives 1 of 2 numbers that are not finite; its weights"):
        embed(lake, "broken", Broken())
    assert "broken" not in Lake(lake.root).user_columns


def test_empty_lake_has_nothing_to_embed(tmp_path, scenarios):
    lake = write_lake(tmp_path / "lake", scenarios[:1])
    with pytest.raises(BadParameter, match="there are no scenarios to embed"):
        lake.embed("v", lake.filter("false", name="none", allow_empty=True))


def test_vectors_are_stored_for_a_fast_search(lake):
    stored = pa.parquet.ParquetFile(lake.root / "layers/v/1.parquet").metadata.row_group(0)
    assert {stored.column(number).compression for number in range(stored.num_columns)} == {"UNCOMPRESSED"}


@pytest.mark.integration
def test_planted_near_duplicates_are_found(tmp_path):
    from scenarionet_data import convert

    convert("pg", "0:60", tmp_path / "pg")
    rng = np.random.default_rng(0)
    pairs = [planted(scenario, rng) for scenario in Lake(tmp_path / "pg").loader()]
    firsts, seconds = [first.id for first, _ in pairs], [second.id for _, second in pairs[:30]]
    unrelated = [first.id for first, _ in pairs[30:]]
    lake = write_lake(tmp_path / "lake", [each for pair in pairs for each in pair])
    lake.embed("v")
    lake = Lake(lake.root)
    lake.filter(name="first", ids=firsts[:30])
    lake.filter(name="second", ids=seconds + unrelated)
    (found,) = lake.overlap("first", "second", embedding="v")
    true = {(first.id, second.id) for first, second in pairs[:30]}
    hits = {(first, second) for _, first, second in found.examples}
    assert len(hits & true) >= 0.95 * len(true)
    assert len(hits & true) >= 0.9 * len(hits)
    assert found.num_first == len({first for first, _ in hits})
    assert [each.num_first for each in lake.overlap("first", "second") if each.kind == "near_duplicate"] == [0]
