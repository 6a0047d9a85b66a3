"""Scenarios from seeds: conformance, ranges, options, and statistics of 1,000 default scenarios."""

from __future__ import annotations

from dataclasses import fields

import numpy as np
import pytest

from scenarionet_data.converters.pg import Procedural, ProceduralOptions, parse_seeds
from scenarionet_data.errors import BadParameter, SourceNotFound
from scenarionet_data.scenario.vocabulary import ObjectType
from scenarionet_data.testing import ConverterConformance


class TestProcedural(ConverterConformance):
    converter = Procedural()
    damaged_glob = None

    @pytest.fixture(scope="class")
    @classmethod
    def raw(cls) -> str:
        return "0:6"


def shards(raw, **options):
    return list(Procedural().shards(raw, "train", "v1", ProceduralOptions(**options)))


def test_shards_are_aligned_blocks():
    names = [(shard.name, [item.name for item in shard.items]) for shard in shards("60:130")]
    assert [name for name, _ in names] == [
        "seeds-0000000000-0000000063",
        "seeds-0000000064-0000000127",
        "seeds-0000000128-0000000191",
    ]
    assert names[0][1] == ["60", "61", "62", "63"]
    assert len(names[1][1]) == 64
    assert names[2][1] == ["128", "129"]


def test_full_block_has_the_same_key_in_any_range():
    assert shards("128")[0].key("1") == shards("0:64")[0].key("1")
    assert shards("128")[0].key("1") != shards("128", density=3.0)[0].key("1")


def test_seed_does_not_depend_on_its_shard():
    converter = Procedural()
    alone = converter.scenario(shards("7:8")[0], 7)
    among = converter.scenario(shards("0:64")[0], 7)
    assert np.array_equal(alone.tracks.position, among.tracks.position)
    assert alone.id == "pg/v1/7"
    assert alone.extras["seed"] == 7
    assert alone.extras["blocks"][0] == "start"


@pytest.mark.parametrize("raw", ["", "data/pg", "5:5", "9:3", "-3", "1:2:3", "99999999999"])
def test_invalid_ranges_are_refused(raw):
    with pytest.raises(SourceNotFound, match="seeds"):
        parse_seeds(raw)


def test_invalid_options_are_refused_before_generation():
    with pytest.raises(BadParameter, match="density"):
        shards("3", density=-1.0)


def test_every_option_is_described():
    assert all(field.metadata["doc"] for field in fields(ProceduralOptions))


def figures(count):
    """Means over ``count`` seeds: ego track [m], vehicles, share with intersections, share with construction."""
    converter = Procedural()
    rows = []
    for shard in shards(str(count)):
        for seed in converter.records(shard):
            scenario = converter.scenario(shard, seed)
            path = scenario.tracks.position[scenario.ego_index, :, :2].astype(np.float64)
            types = scenario.tracks.object_type
            rows.append(
                (
                    np.hypot(*np.diff(path, axis=0).T).sum(),
                    (types == ObjectType.VEHICLE).sum(),
                    (scenario.map.is_intersection == 1).any() or len(scenario.lights) > 0,
                    np.isin(types, (ObjectType.TRAFFIC_CONE, ObjectType.TRAFFIC_BARRIER)).any(),
                )
            )
    return np.mean(rows, axis=0)


PAPER = np.array([226.07, 9.81, 0.36, 0.39])


@pytest.mark.long
def test_statistics_are_close_to_the_paper():
    np.testing.assert_allclose(figures(128), PAPER, rtol=0.35)


@pytest.mark.long
def test_statistics_of_a_thousand_scenarios_match_the_paper():
    np.testing.assert_allclose(figures(1000), PAPER, rtol=0.15)
