"""Procedural generation (PG) as a dataset: RAW is a range of seeds, each of which generates a scenario.

The generator is ``scenarionet_data.procedural``; this module converts its episodes to scenarios.
"""

from __future__ import annotations

import re
from collections import defaultdict
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, ClassVar

import numpy as np

from scenarionet_data.arrays.dtypes import Float64
from scenarionet_data.building import MapBuilder, make_origin, make_tracks
from scenarionet_data.converters.base import Budgets, Converter
from scenarionet_data.converters.cities import CityMap
from scenarionet_data.converters.formats.map_files import read_map
from scenarionet_data.errors import BadParameter, SourceNotFound
from scenarionet_data.ingest.listing import cached_by_file
from scenarionet_data.ingest.options import Options, option
from scenarionet_data.ingest.passed_over import PassedOver
from scenarionet_data.ingest.shard import RawItem, Shard, fingerprint
from scenarionet_data.procedural.drawn_map import DrawnMap
from scenarionet_data.procedural.generate import Episode, generate
from scenarionet_data.procedural.options import VERSIONS, GeneratorOptions
from scenarionet_data.procedural.population import boxes
from scenarionet_data.procedural.right_of_way import CAUTION, GO, STOP
from scenarionet_data.procedural.roadmap import RoadMap
from scenarionet_data.scenario.description import (
    Lights,
    ScenarioDescription,
    Source,
    Tracks,
    make_scenario_id,
    strings,
)
from scenarionet_data.scenario.vocabulary import LightState, MapFeatureType, ObjectType, Provenance

BLOCK = 64  # seeds per shard
HISTORY = 10  # timesteps before the current one, as in Waymo
_MARGIN = 200.0
"""Margin of a given map around the ego's path [m]."""
_RANGE = re.compile(r"(?:(\d+):)?(\d+)")
_MAX_SEED = 10**10
_TYPES = {"pedestrian": ObjectType.PEDESTRIAN, "cyclist": ObjectType.CYCLIST}
_LIGHT_STATES = {
    GO: LightState.TRAFFIC_LIGHT_GREEN,
    CAUTION: LightState.TRAFFIC_LIGHT_YELLOW,
    STOP: LightState.TRAFFIC_LIGHT_RED,
}


@dataclass(frozen=True)
class ProceduralOptions(GeneratorOptions, Options):
    """Parameters of maps and traffic."""

    map: str = option(
        "", "Map to drive on instead of generated ones: *.xodr, *.geojson, *.osm (Lanelet2).", is_path=True
    )


class Procedural(Converter[int]):
    """Procedurally generated roads and traffic."""

    name: ClassVar[str] = "pg"
    version: ClassVar[str] = "1"
    release: ClassVar[str] = "v2"
    licence: ClassVar[str] = "Apache-2.0 (generated)"
    raw: ClassVar[str] = "a range of seeds FIRST:END (END excluded), or their number"
    Options = ProceduralOptions
    budgets: ClassVar[Budgets] = Budgets(velocity_median=0.02, velocity_p99=0.2, heading_p99=0.02)

    def shards(self, raw: str, split: str, version: str, options: ProceduralOptions) -> Iterator[Shard]:
        """List aligned blocks of 64 seeds, so that a longer range only changes the last shard and adds new ones.

        Shards of version v1 do not name the generator's version, which they had before it was an option.

        Raises:
            BadParameter: Scenarios of version v1 with other traffic, or options out of range.
        """
        options.check()
        if version == self.release and options.version:
            version = options.version
        if version == VERSIONS[0] and options.version not in ("", version):
            raise BadParameter(
                f"version: {options.version} for scenarios of version {version}; give them another --version"
            )
        options = replace(options, version="" if version == VERSIONS[0] else options.version or VERSIONS[-1])
        if options.left_hand and options.map:
            raise BadParameter("left_hand: a given map has its own side; leave out map or left_hand")
        seeds, place, mark = parse_seeds(raw), "", "seed"
        if options.map:
            path = Path(options.map)
            if not path.is_file():
                raise SourceNotFound(f"{path}: no such map")
            place, mark = f"{path.stem}-", fingerprint([path])
        for first in range(seeds.start // BLOCK * BLOCK, seeds.stop, BLOCK):
            block = range(max(first, seeds.start), min(first + BLOCK, seeds.stop))
            yield Shard(
                dataset=self.name,
                version=version,
                split=split,
                name=re.sub(r"[^A-Za-z0-9._-]", "-", place) + f"seeds-{first:010d}-{first + BLOCK - 1:010d}",
                root="",
                items=tuple(RawItem(f"{place}{seed}", mark) for seed in block),
                options=options,
            )

    def records(self, shard: Shard) -> Iterator[int]:
        """Yield the seeds."""
        for item in shard.items:
            yield int(item.name.rpartition("-")[2])

    def passed_over(
        self,
        raw: str,  # noqa: ARG002
        split: str,  # noqa: ARG002
        options: Any,  # noqa: ARG002
        shards: Sequence[Shard],  # noqa: ARG002
    ) -> Iterable[PassedOver]:
        """Nothing: seeds are no files."""
        return ()

    def maps(self, raw: str, version: str, options: ProceduralOptions) -> Iterator[Shard]:  # noqa: ARG002
        """The map, if traffic drives on a given one."""
        if options.map:
            path, drive = Path(options.map), next(self.shards("1", "", version, options))
            item = RawItem(path.name, fingerprint([path]))
            yield Shard(self.name, drive.version, "", path.stem, str(path.parent), (item,), drive.options)

    def map_features(self, shard: Shard) -> MapBuilder:
        """Read the map."""
        return _read_place(Path(shard.options_as(ProceduralOptions).map))[0].features

    def scenario(self, shard: Shard, record: int) -> ScenarioDescription:
        """Generate the scenario of a seed."""
        options = shard.options_as(ProceduralOptions)
        options = replace(options, version=options.version or shard.version)
        if not options.map:
            episode = generate(record, options)
            return describe(mirrored(episode) if options.left_hand else episode, record, shard, options.dt)
        city, drawn = _read_place(Path(options.map))
        episode, name = generate(record, options, drawn), Path(options.map).stem
        scenario = describe(episode, record, shard, options.dt)
        path = episode.motion[0, episode.valid[0], :2]
        roads, crop = city.around(path, _MARGIN, scenario.origin)
        source = Source(f"{name}-{record}", name, "that of the map", city=name, crs=f"map {name}")
        scenario_id = make_scenario_id(shard.dataset, shard.version, f"{name}-{record}")
        return replace(scenario, id=scenario_id, source=source, map=roads, map_id=name, map_crop=crop)


@cached_by_file(2)
def _read_place(path: Path) -> tuple[CityMap, DrawnMap]:
    city = CityMap(read_map(path))
    origin = np.append(np.nanmean(city.bounds.reshape(-1, 2, 2), axis=(0, 1)), 0.0)
    return city, DrawnMap.of(city.features.build(origin), origin)


def parse_seeds(raw: str) -> range:
    """Parse RAW as a range of seeds.

    Raises:
        SourceNotFound: Not a range of seeds, or an empty one.

    Example:
        >>> parse_seeds("64:200"), parse_seeds("10")
        (range(64, 200), range(0, 10))
    """
    match = _RANGE.fullmatch(str(raw).strip())
    if match is None:
        raise SourceNotFound(f"{raw}: not a range of seeds; give FIRST:END such as 0:200, or a number such as 200")
    seeds = range(int(match[1] or 0), int(match[2]))
    if not seeds or seeds.stop > _MAX_SEED:
        raise SourceNotFound(f"{raw}: no seeds from {seeds.start} to {seeds.stop}; give an END larger than FIRST")
    return seeds


def mirrored(episode: Episode) -> Episode:
    """Return an episode with left and right exchanged; its lanes are still those of the graph."""
    motion, road_map = episode.motion * np.array([1.0, -1.0, -1.0, 1.0]), episode.road_map
    obstacles = [each._replace(y=-each.y, heading=-each.heading) for each in episode.obstacles]
    return replace(episode, motion=motion, obstacles=obstacles, road_map=replace(road_map, is_mirrored=True))


def describe(episode: Episode, seed: int, shard: Shard, dt: float) -> ScenarioDescription:
    """Convert an episode to a scenario."""
    steps = episode.valid.shape[1]
    position = np.concatenate([episode.motion[0, :, :2], np.zeros((steps, 1))], axis=1)
    origin = make_origin(position, episode.valid[0], has_z=False)
    return ScenarioDescription(
        id=make_scenario_id(shard.dataset, shard.version, str(seed)),
        dataset=shard.dataset,
        version=shard.version,
        split=shard.split,
        timestamps=np.arange(steps, dtype=np.float64) * dt,
        dt=dt,
        current_timestep=min(HISTORY, steps - 1),
        ego_id="ego",
        origin=origin,
        has_z=False,
        source=Source(str(seed), str(seed), Procedural.licence, city="pg", crs="pg"),
        tracks=_tracks(episode, origin),
        lights=_lights(episode, origin),
        map=map_features(episode.road_map).build(origin, has_z=False),
        extras={"seed": seed, "blocks": [block.name for block in episode.road_map.blocks]},
    )


def _tracks(episode: Episode, origin: Float64) -> Tracks:
    """Build the tracks: vehicles first, then static objects."""
    moving, steps = episode.valid.shape
    poses, sizes = boxes(episode.obstacles)
    standing = np.zeros((len(poses), steps, 4))
    standing[..., :3] = poses[:, None]
    motion = np.concatenate([episode.motion, standing])
    position = np.concatenate([motion[..., :2], np.zeros((*motion.shape[:2], 1))], axis=-1)
    direction = np.stack([np.cos(motion[..., 2]), np.sin(motion[..., 2])], axis=-1)
    ids, types, words = ["ego"], [ObjectType.VEHICLE], list[str | None](episode.population.kinds)
    for row in range(1, moving):
        types.append(_TYPES.get(episode.population.kinds[row], ObjectType.VEHICLE))
        ids.append(f"{'p' if types[row] == ObjectType.PEDESTRIAN else 'v'}{row}")
    for row, obstacle in enumerate(episode.obstacles):
        ids.append(f"o{row}")
        types.append(obstacle.type)
        words.append(obstacle.word)
    return make_tracks(
        ids,
        types,
        position,
        motion[..., 2],
        motion[..., 3:] * direction,
        np.concatenate([episode.population.size, sizes]),
        np.concatenate([episode.valid, np.ones((len(poses), steps), np.bool_)]),
        origin=origin,
        source_type=words,
    )


def _lights(episode: Episode, origin: Float64) -> Lights:
    """Build one light for each lane across a signalised intersection."""
    signal = episode.graph.lanes.signal
    controlled = np.flatnonzero(signal >= 0)
    lanes, names, stops = episode.road_map.lanes, list[str](), []
    for row in controlled.tolist():
        start = lanes[row].path.start
        names.append(lanes[row].id)
        stops.append((start.x, -start.y if episode.road_map.is_mirrored else start.y, 0.0))
    ids, stop_point = strings(names), np.array(stops, dtype=np.float64).reshape(-1, 3) - origin
    table = np.zeros(max(_LIGHT_STATES) + 1, dtype=np.uint8)
    table[list(_LIGHT_STATES)] = list(_LIGHT_STATES.values())
    return Lights(
        ids=ids,
        lane_ids=ids,
        stop_point=stop_point.astype(np.float32),
        state=table[episode.lights[signal[controlled]]],
        is_lane_in_map=np.ones(len(ids), dtype=np.bool_),
        provenance=np.full(len(ids), Provenance.OBSERVED, dtype=np.uint8),
    )


def map_features(road_map: RoadMap) -> MapBuilder:
    """Collect lanes, lines and areas, block by block."""
    builder, half = MapBuilder(), road_map.road.lane_width / 2.0
    entries, exits = defaultdict[str, list[str]](list), defaultdict[str, list[str]](list)
    for before, after in road_map.links:
        exits[before].append(after)
        entries[after].append(before)
    side = np.array([1.0, -1.0 if road_map.is_mirrored else 1.0])
    for block in road_map.blocks:
        for lane in block.lanes:
            neighbors = [lane.left] if lane.left else [], [lane.right] if lane.right else []
            boundaries = lane.left_boundaries, lane.right_boundaries
            if road_map.is_mirrored:
                neighbors, boundaries = neighbors[::-1], boundaries[::-1]
            builder.add(
                lane.id,
                MapFeatureType.LANE_SURFACE_STREET,
                polyline=lane.samples[0] * side,
                polygon=lane.outline(half) * side,
                speed_limit=lane.speed_limit or road_map.road.speed_limit,
                width=(half, half),
                entry_lanes=entries[lane.id],
                exit_lanes=exits[lane.id],
                left_neighbors=neighbors[0],
                right_neighbors=neighbors[1],
                left_boundaries=boundaries[0],
                right_boundaries=boundaries[1],
                is_intersection=lane.is_intersection,
            )
        for line in block.lines:
            builder.add(line.id, line.type, polyline=line.points * side, controlled_lanes=line.controlled_lanes)
        for area in block.areas:
            builder.add(area.id, area.type, polygon=area.outline * side, controlled_lanes=area.controlled_lanes)
    return builder
