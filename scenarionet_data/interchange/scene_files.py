"""From files of one scenario each to scenarios: the step that the readers of such formats share.

For the training simulators, the opposite way is ``scenes``.
"""

from __future__ import annotations

from abc import abstractmethod
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import ClassVar

import numpy as np

from scenarionet_data.arrays.dtypes import Bool, Float64, UInt8
from scenarionet_data.building import MapBuilder, make_origin, make_tracks
from scenarionet_data.building.plausible import find_bad_geometry, find_bad_rows, find_middle
from scenarionet_data.converters.base import Budgets, Converter, find_files
from scenarionet_data.errors import CorruptSource, InvalidScenario
from scenarionet_data.ingest.defects import Defects
from scenarionet_data.ingest.shard import RawItem, Shard, bucket, fingerprint
from scenarionet_data.interchange.gpudrive.layout import HISTORY
from scenarionet_data.scenario.description import Lights, ScenarioDescription, Source, make_scenario_id, strings
from scenarionet_data.scenario.vocabulary import MapFeatureType, ObjectType, Provenance

DT = 0.1
_AREAS = (MapFeatureType.CROSSWALK, MapFeatureType.SPEED_BUMP, MapFeatureType.DRIVEWAY)


@dataclass(frozen=True, eq=False)
class SceneObject:
    """An object over T timesteps, in the source frame.

    Attributes:
        id: Its id.
        kind: Its type.
        position: (T, 3) [m]. velocity: (T, 2) [m/s]. heading: (T,) [rad]. valid: (T,).
        size: Length, width, height [m].
        extras: What only the format has, as ``mark_as_expert`` and ``goal_position``, which the writers write again.
        is_size_assumed, is_velocity_estimated: Whether the file does not have these.
    """

    id: str
    kind: ObjectType
    position: Float64
    velocity: Float64
    heading: Float64
    valid: Bool
    size: tuple[float, float, float]
    extras: Mapping[str, object] = field(default_factory=dict)
    is_size_assumed: bool = False
    is_velocity_estimated: bool = False


@dataclass(frozen=True, eq=False)
class SceneRoad:
    """A map feature: id, type, and points (P, 3) [m]."""

    id: str
    kind: MapFeatureType
    points: Float64


@dataclass(frozen=True, eq=False)
class SceneLight:
    """A light of a lane: states (T,) and stop point (3,) [m]; without an id, that of its lane."""

    lane: str
    state: UInt8
    stop_point: Float64
    id: str = ""


@dataclass(frozen=True, eq=False)
class FileScene:
    """What a file holds.

    Attributes:
        ego: Row of the ego; None if the file does not say.
        predicted: Rows of the tracks to predict, with their difficulties.
        interesting: Ids of objects of interest.
        dt: Timestep [s].
        current: Current timestep.
        features: A map that was built already, in place of ``roads``.
    """

    objects: Sequence[SceneObject]
    roads: Sequence[SceneRoad]
    lights: Sequence[SceneLight] = ()
    ego: int | None = None
    predicted: Sequence[tuple[int, int]] = ()
    interesting: Sequence[str] = field(default_factory=tuple)
    dt: float = DT
    current: int = HISTORY
    features: MapBuilder | None = None

    def usable_objects(self, file: str, defects: Defects, scenario_id: str) -> list[SceneObject]:
        """Return objects with an id of their own, a size, and as many states as most."""
        counts = [len(each.valid) for each in self.objects]
        usual, kept, seen = max(counts, key=counts.count, default=0), [], set[str]()
        for row, each in enumerate(self.objects):
            is_sized = all(0.0 < side <= 200.0 for side in each.size)
            for fits, name, expected, found in (
                (len(each.valid) == usual, "position", f"{usual} states", str(len(each.valid))),
                (each.id not in seen, "id", "an id of its own", each.id[:64]),
                (is_sized or row == self.ego, "size", "a size above 0 and up to 200 m", str(each.size)),
            ):
                if not fits:
                    places = [f"{step} of {each.id[:64]}" for step in np.flatnonzero(each.valid)] or [each.id[:64]]
                    defects.drop("tracks", file, places, name, f"expected {expected}, found {found}")
                    break
            else:
                kept.append(each)
                seen.add(each.id)
        if not kept or not usual:
            raise InvalidScenario(scenario_id, "tracks", "expected objects that can be used, found none")
        return kept

    def find_ego(self, objects: list[SceneObject], file: str, defects: Defects, scenario_id: str) -> int:
        """Return the row of the ego in ``objects``: that of the file, or the vehicle that is seen longest."""
        told = self.objects[self.ego] if self.ego is not None and 0 <= self.ego < len(self.objects) else None
        for row, each in enumerate(objects):
            if each is told:
                return row
        seen = [int(each.valid.sum()) * (each.kind == ObjectType.VEHICLE) for each in objects]
        if not max(seen):
            raise InvalidScenario(scenario_id, "ego_id", "expected an ego or a vehicle, found none")
        defects.assume(
            "tracks",
            file,
            ["the whole file"],
            "ego",
            "expected the row of the ego, found none: the vehicle seen longest",
        )
        return int(np.argmax(seen))

    def build_map(self, file: str, defects: Defects) -> MapBuilder:
        """Return the roads that can be used."""
        if self.features is not None:
            return self.features
        builder, seen = MapBuilder(), set[str]()
        middle = find_middle(np.concatenate([np.zeros((0, 3)), *(road.points for road in self.roads)]))
        for number, road in enumerate(self.roads):
            fewest = 3 if road.kind in _AREAS else 1
            reason = find_bad_geometry(road.points, middle) if len(road.points) >= fewest else (
                f"expected {fewest} points or more, found {len(road.points)}"
            )  # fmt: skip
            if reason:
                defects.drop("maps", file, [road.id[:64]], "geometry", reason)
                continue
            key = road.id if road.id not in seen else f"{road.id}-{number}"
            if key != road.id:
                defects.assume("maps", file, [road.id[:64]], "id", "expected an id of its own, found it twice")
            seen.add(key)
            is_area = road.kind in _AREAS
            builder.add(
                key, road.kind, polyline=None if is_area else road.points, polygon=road.points if is_area else None
            )
        return builder

    def build_lights(self, num_steps: int, origin: Float64, has_z: bool, lanes: set[str]) -> Lights:
        """Return the lights with a state for each timestep; ``lanes`` are those of the map."""
        found = [light for light in self.lights if len(light.state) == num_steps]
        if not found:
            return Lights.empty(num_steps)
        lane_ids = strings(light.lane for light in found)
        stops = np.stack([light.stop_point for light in found]) - origin
        stops[:, 2] *= has_z
        return Lights(
            ids=strings(light.id or light.lane for light in found),
            lane_ids=lane_ids,
            stop_point=stops.astype(np.float32),
            state=np.stack([light.state for light in found]),
            is_lane_in_map=np.array([lane in lanes for lane in lane_ids], np.bool_),
            provenance=np.full(len(found), Provenance.OBSERVED, np.uint8),
        )


class SceneFiles(Converter[RawItem]):
    """One scenario a file, 64 files a shard; subclasses read a file.

    Class attributes:
        pattern: Glob of the files.
        sidecars: Endings of files that match it and hold no scenario.
    """

    version: ClassVar[str] = "1"
    release: ClassVar[str] = "v1"
    budgets: ClassVar[Budgets] = Budgets()
    pattern: ClassVar[str]
    sidecars: ClassVar[tuple[str, ...]] = ()

    @abstractmethod
    def scene(self, path: Path, shard: Shard, defects: Defects) -> FileScene:
        """Read a file.

        Raises:
            CorruptSource: It cannot be read.
        """

    def inputs(self, path: Path) -> list[Path]:
        """Return a file with those beside it that belong to its scenario."""
        return [path]

    def shards(self, raw: str, split: str, version: str, options: object) -> Iterator[Shard]:
        """List buckets of files."""
        root = Path(raw) if Path(raw).is_dir() else Path(raw).parent
        files = find_files(raw, self.pattern, self.raw, split, self.sidecars)
        items = [RawItem(path.relative_to(root).as_posix(), fingerprint(self.inputs(path))) for path in files]
        for name, members in bucket(items).items():
            yield Shard(self.name, version, split, name, str(root), members, options)  # type: ignore[arg-type]

    def records(self, shard: Shard) -> Iterator[RawItem]:
        """Yield the files."""
        yield from shard.items

    def scenario(self, shard: Shard, record: RawItem) -> ScenarioDescription:
        """Read one file."""
        name, defects = record.name.rpartition(".")[0], Defects()
        scenario_id = make_scenario_id(shard.dataset, shard.version, name)
        try:
            scene = self.scene(Path(shard.root, record.name), shard, defects)
        except CorruptSource as error:  # of this file: continue with the other files
            raise InvalidScenario(scenario_id, "source", str(error)) from error
        objects = scene.usable_objects(record.name, defects, scenario_id)
        ego = scene.find_ego(objects, record.name, defects, scenario_id)
        position, velocity, heading, valid = _states(objects, ego, record.name, defects)
        if not valid[ego].any():
            raise InvalidScenario(scenario_id, "ego_id", "expected an ego with a usable state, found none")
        steps = np.flatnonzero(valid[ego])
        later = steps[steps >= min(scene.current, valid.shape[1] - 1)]
        has_z = bool(position[valid][:, 2].any())
        origin = make_origin(position[ego], valid[ego], has_z=has_z)
        roads = scene.build_map(record.name, defects).build(origin, has_z)
        ids = [each.id for each in objects]
        places = {id(each): place for place, each in enumerate(objects)}
        predicted = [(places.get(id(scene.objects[row])), level) for row, level in scene.predicted]
        return ScenarioDescription(
            id=scenario_id,
            dataset=shard.dataset,
            version=shard.version,
            split=shard.split,
            timestamps=np.arange(valid.shape[1], dtype=np.float64) * scene.dt,
            dt=scene.dt,
            current_timestep=int(later[0] if len(later) else steps[-1]),
            ego_id=ids[ego],
            origin=origin,
            has_z=has_z,
            source=Source(name, record.name, self.licence),
            tracks=make_tracks(
                ids,
                [each.kind for each in objects],
                position,
                heading,
                velocity,
                np.array([each.size for each in objects]),
                valid,
                origin=origin,
                extras=[each.extras for each in objects],
                is_size_assumed=[each.is_size_assumed for each in objects],
                is_velocity_estimated=[each.is_velocity_estimated for each in objects],
            ),
            lights=scene.build_lights(valid.shape[1], origin, has_z, set(roads.ids)),
            map=roads if len(roads) else None,
            objects_of_interest=tuple(dict.fromkeys(each for each in scene.interesting if each in ids)),
            tracks_to_predict=tuple({ids[row]: level for row, level in predicted if row is not None}.items()),
            defects=defects.found(),
        )


def _states(
    objects: list[SceneObject], ego: int, file: str, defects: Defects
) -> tuple[Float64, Float64, Float64, Bool]:
    """Positions, velocities, headings and validity (N, T); states that cannot be are not valid."""
    position, velocity, heading, valid = (
        np.stack([getattr(each, name) for each in objects]) for name in ("position", "velocity", "heading", "valid")
    )
    row, step = np.nonzero(valid)
    middle = find_middle(position[ego, valid[ego], :2])
    for fault in find_bad_rows(position[row, step], heading[row, step], velocity[row, step], None, middle):
        places = [f"{step[each]} of {objects[row[each]].id[:64]}" for each in np.flatnonzero(fault.mask)]
        defects.drop("tracks", file, places, fault.field, fault.reason)
        valid[row[fault.mask], step[fault.mask]] = False
    return position, velocity, heading, valid
