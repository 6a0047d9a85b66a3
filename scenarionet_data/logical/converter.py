"""Concrete scenarios of a logical one as a dataset: RAW is its file, or the name of one of the library."""

from __future__ import annotations

import dataclasses
import hashlib
import json
from collections.abc import Iterator
from dataclasses import dataclass
from functools import lru_cache
from typing import ClassVar, Literal

import numpy as np

from scenarionet_data.building import MapBuilder, make_tracks
from scenarionet_data.converters.base import Budgets, Converter
from scenarionet_data.errors import BadParameter, InvalidScenario
from scenarionet_data.ingest.options import Options, option
from scenarionet_data.ingest.shard import RawItem, Shard
from scenarionet_data.logical.description import LogicalScenario, RoadSpec, parse_logical, read_logical
from scenarionet_data.logical.motion import Motions, move
from scenarionet_data.logical.roads import draw_road
from scenarionet_data.scenario.description import (
    Lights,
    MapFeatures,
    ScenarioDescription,
    Source,
    make_scenario_id,
)
from scenarionet_data.variations.limits import ACCELERATION, JERK, check_limits

BLOCK = 256  # scenarios per shard
_parse = lru_cache(maxsize=8)(parse_logical)
_ORIGIN = np.zeros(3)  # the frame of the road, which all concrete scenarios share


@dataclass(frozen=True)
class LogicalOptions(Options):
    """Which concrete scenarios are made."""

    number: int = option(1000, "number of scenarios")
    seed: int = option(0, "seed of the random numbers")
    method: Literal["random", "sobol", "latin", "grid"] = option(
        "random", "how values are drawn; grid: every combination of given values"
    )
    text: str = option("", "the file, which replaces RAW's")
    rows: str = option("", "JSON of the parameters by name of scenario, instead of drawn ones")


_Record = tuple[RawItem, LogicalScenario, Motions, int]
"""An item, and its row in the motions of a shard."""


class Logical(Converter[_Record]):
    """Concrete scenarios of a logical one."""

    name: ClassVar[str] = "logical"
    version: ClassVar[str] = "1"
    release: ClassVar[str] = "v"
    licence: ClassVar[str] = "Apache-2.0 (generated)"
    raw: ClassVar[str] = "a logical scenario, *.toml, or its name in the library (cut_in, cut_out, deceleration, ...)"
    Options = LogicalOptions
    budgets: ClassVar[Budgets] = Budgets(velocity_median=0.05, velocity_p99=0.5)

    def shards(self, raw: str, split: str, version: str, options: LogicalOptions) -> Iterator[Shard]:
        """Draw the parameters and list blocks of scenarios."""
        logical = parse_logical(options.text, "logical") if options.text else read_logical(raw)
        if options.rows:
            named: dict[str, list[float]] = _named_rows(options.rows, len(logical.parameters))
        else:
            drawn = logical.draw(options.number, options.seed, options.method).tolist()
            named = {f"{logical.name}-{k:06d}": row for k, row in enumerate(drawn)}
        names, group = list(named), next(iter(named)) if options.rows else logical.name
        options = LogicalOptions(
            seed=options.seed, method=options.method, text=logical.text, max_bad_rows=options.max_bad_rows
        )
        # What is wrong in the file is one error and not one of each scenario.
        move(logical, np.array([named[names[0]]]))
        for first in range(0, len(names), BLOCK):
            items = tuple(RawItem(each, json.dumps(named[each])) for each in names[first : first + BLOCK])
            yield Shard(self.name, version, split, f"{group}-{first:07d}", "", items, options)

    def files(self, shard: Shard) -> Iterator[list[str]]:  # noqa: ARG002
        """Nothing: the file is part of the options."""
        yield []

    def maps(self, raw: str, version: str, options: LogicalOptions) -> Iterator[Shard]:
        """The road, which all scenarios share."""
        shard = next(iter(self.shards(raw, "", version, options)))
        logical = _parsed(shard)
        item = RawItem(logical.name, hashlib.blake2b(repr(logical.road).encode(), digest_size=8).hexdigest())
        yield Shard(self.name, version, "", map_id(logical), "", (item,), shard.options)

    def map_features(self, shard: Shard) -> MapBuilder:
        """Draw the road."""
        return draw_road(parse_logical(shard.options_as(LogicalOptions).text, shard.items[0].name).road).features

    def records(self, shard: Shard) -> Iterator[_Record]:
        """Move the road users of all scenarios of a shard at once."""
        logical = _parsed(shard)
        rows = np.array([json.loads(item.fingerprint) for item in shard.items])
        motions = move(logical, rows)
        return ((item, logical, motions, k) for k, item in enumerate(shard.items))

    def scenario(self, shard: Shard, record: _Record) -> ScenarioDescription:
        """Make a scenario, and check that it can be."""
        item, logical, motions, k = record
        values = dict(zip((each.name for each in logical.parameters), json.loads(item.fingerprint), strict=True))
        scenario = concrete(logical, motions, k, make_scenario_id(shard.dataset, shard.version, item.name), values)
        check_limits(None, scenario, -1 - np.arange(len(scenario.tracks)), ACCELERATION, JERK)
        return dataclasses.replace(scenario, split=shard.split)


def _named_rows(text: str, count: int) -> dict[str, list[float]]:
    try:
        named = json.loads(text)
        if np.array(list(named.values()), np.float64).shape == (len(named), count) and named:
            return dict(named)
    except (ValueError, TypeError, AttributeError):
        named = None
    raise BadParameter(f'rows={text[:60]!r}; wanted {{"NAME-0": [...], ...}} with {count} numbers each')


def _parsed(shard: Shard) -> LogicalScenario:
    return _parse(shard.options_as(LogicalOptions).text, shard.items[0].name.rpartition("-")[0])


def map_id(logical: LogicalScenario) -> str:
    """Return the key of the road, which depends on nothing else."""
    return f"road-{hashlib.blake2b(repr(logical.road).encode(), digest_size=6).hexdigest()}"


def concrete(
    logical: LogicalScenario, motions: Motions, row: int, scenario_id: str, values: dict[str, float]
) -> ScenarioDescription:
    """Return one of the concrete scenarios whose motions were computed.

    Args:
        logical: The logical scenario.
        motions: Of some concrete ones.
        row: Which of them.
        scenario_id: Its id.
        values: Its parameters.

    Raises:
        InvalidScenario: The ego leaves its route, or a speed is below 0.
    """
    if motions.backwards[row].any():
        actor = logical.actors[int(motions.backwards[row].argmax())].id
        raise InvalidScenario(scenario_id, "speed", f"wanted speeds from 0 on, found one below of {actor} at the start")
    valid = motions.valid[row]
    if not valid[0].all():
        step = int(valid[0].argmin())
        raise InvalidScenario(
            scenario_id, "route", f"the ego is beyond its route at timestep {step}; lengthen the road"
        )
    steps = valid.shape[1]
    dataset, version, _ = scenario_id.split("/")
    features, crop = _built_road(logical.road)
    return ScenarioDescription(
        id=scenario_id,
        dataset=dataset,
        version=version,
        split="test",
        timestamps=np.arange(steps, dtype=np.float64) * logical.dt,
        dt=logical.dt,
        current_timestep=min(round(1.0 / logical.dt), steps - 1),
        ego_id="ego",
        origin=_ORIGIN,
        has_z=False,
        source=Source(scenario_id.rpartition("/")[2], logical.name, Logical.licence, city="logical", crs="road"),
        tracks=make_tracks(
            [each.id for each in logical.actors],
            [each.object_type for each in logical.actors],
            np.concatenate([motions.position[row], np.zeros((*valid.shape, 1))], axis=-1),
            motions.heading[row],
            motions.velocity[row],
            motions.size[row],
            valid,
            origin=_ORIGIN,
        ),
        lights=Lights.empty(steps),
        map=features,
        map_id=map_id(logical),
        map_crop=crop,
        extras={"parent": f"logical/{logical.name}", "parameters": values},
    )


@lru_cache(maxsize=4)
def _built_road(spec: RoadSpec) -> tuple[MapFeatures, tuple[float, float, float, float]]:
    """Features of a road, and the window around all of it."""
    features = draw_road(spec).features
    low, high = np.nanmin(features.bounds[:, :2], axis=0) - 1.0, np.nanmax(features.bounds[:, 2:], axis=0) + 1.0
    return features.build(_ORIGIN, has_z=False), (*low.tolist(), *high.tolist())
