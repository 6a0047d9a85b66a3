"""Waymo Open Motion Dataset: TFRecord files of ``waymo.open_dataset.Scenario`` messages, 91 steps or 20 s each.

Neither TensorFlow nor a protobuf runtime is needed. The frame is Waymo's, with an arbitrary origin in every scenario.
``wire`` decodes messages to arrays; this module maps them to the lake's vocabulary.
"""

from __future__ import annotations

import hashlib
import re
from collections.abc import Iterator
from functools import partial
from pathlib import Path

import numpy as np

from scenarionet_data.arrays.dtypes import Float64
from scenarionet_data.building import make_origin, make_tracks
from scenarionet_data.converters.base import Converter, find_files
from scenarionet_data.converters.formats.tfrecord import TfRecord, read_records
from scenarionet_data.converters.waymo.map_features import map_features
from scenarionet_data.converters.waymo.wire import WireLights, WireScenario, WireTracks, decode
from scenarionet_data.errors import InvalidScenario
from scenarionet_data.ingest.options import Options
from scenarionet_data.ingest.shard import RawItem, Shard, fingerprint
from scenarionet_data.scenario.description import (
    Lights,
    MapFeatures,
    ScenarioDescription,
    Source,
    Tracks,
    make_scenario_id,
    strings,
)
from scenarionet_data.scenario.vocabulary import LightState, ObjectType, Provenance

_EXAMPLE = "training.tfrecord-00000-of-01000"

_SIDECARS = (".gstmp", ".crc", ".crc32c", ".md5", ".sha256", ".json", ".idx", ".index")
"""Endings of files beside recordings: unfinished downloads of gsutil, checksums, descriptions and indices."""

_OBJECT_TYPES = np.array(
    [ObjectType.UNSET, ObjectType.VEHICLE, ObjectType.PEDESTRIAN, ObjectType.CYCLIST, ObjectType.OTHER], np.uint8
)
"""``ObjectType`` by Track.ObjectType 0 to 4."""

_LIGHT_STATES = np.array(
    [
        LightState.LANE_STATE_UNKNOWN,
        LightState.LANE_STATE_ARROW_STOP,
        LightState.LANE_STATE_ARROW_CAUTION,
        LightState.LANE_STATE_ARROW_GO,
        LightState.LANE_STATE_STOP,
        LightState.LANE_STATE_CAUTION,
        LightState.LANE_STATE_GO,
        LightState.LANE_STATE_FLASHING_STOP,
        LightState.LANE_STATE_FLASHING_CAUTION,
    ],
    np.uint8,
)
"""``LightState`` by TrafficSignalLaneState.State 0 to 8."""


class Waymo(Converter[TfRecord]):
    """One shard per file; a record is one scenario, in file order."""

    name = "waymo"
    version = "1"
    release = "v1.2"
    licence = "Waymo Dataset License Agreement for Non-Commercial Use"
    raw = f"a folder with files like {_EXAMPLE} (the dataset's `scenario` format), or one of them"

    def shards(self, raw: str, split: str, version: str, options: Options) -> Iterator[Shard]:
        """List one shard per TFRecord file."""
        root = Path(raw)
        folder = root.parent if root.is_file() else root
        what = f"files like {_EXAMPLE} (the dataset's `scenario` format)"
        for path in find_files(raw, "*.tfrecord*", what, split, _SIDECARS):
            item = RawItem(path.relative_to(folder).as_posix(), fingerprint([path]))
            yield Shard(
                dataset=self.name,
                version=version,
                split=split,
                name=_shard_name(item.name),
                root=str(folder),
                items=(item,),
                options=options,
            )

    def records(self, shard: Shard) -> Iterator[TfRecord]:
        """Yield the file's records."""
        for path in shard.paths:
            yield from read_records(path)

    def scenario(self, shard: Shard, record: TfRecord) -> ScenarioDescription:
        """Convert one message to a scenario."""
        file = shard.items[0].name
        where = f"{file}@{record.offset}"
        if not record.is_intact:
            raise InvalidScenario(where, "record", "wrong checksum: the record is damaged; download the file again")
        message = decode(record.payload, where, partial(make_scenario_id, self.name, shard.version))
        # Overflow of float32 becomes infinity, which validation reports.
        with np.errstate(over="ignore", invalid="ignore"):
            return self._describe(shard, file, message)

    def _describe(self, shard: Shard, file: str, message: WireScenario) -> ScenarioDescription:
        scenario_id = make_scenario_id(self.name, shard.version, message.scenario_id)
        ego = message.sdc_track_index
        tracks = message.tracks
        if not 0 <= ego < len(tracks.ids):
            wanted = f"expected a track, 0 to {len(tracks.ids) - 1}"
            raise InvalidScenario(scenario_id, "sdc_track_index", f"{wanted}, found {ego if ego >= 0 else 'none'}")
        origin = make_origin(tracks.center[ego], tracks.valid[ego], has_z=True)
        features = map_features(message.map, origin)
        return ScenarioDescription(
            id=scenario_id,
            dataset=self.name,
            version=shard.version,
            split=shard.split,
            timestamps=message.timestamps - message.timestamps[0],
            dt=0.1,
            current_timestep=message.current_time_index,
            ego_id=str(tracks.ids[ego]),
            origin=origin,
            has_z=True,
            source=Source(scenario_id=message.scenario_id, file=file, licence=self.licence),
            tracks=_tracks(tracks, origin),
            lights=_lights(message.lights, len(message.timestamps), features, origin),
            map=features,
            objects_of_interest=tuple(str(i) for i in message.objects_of_interest.tolist()),
            tracks_to_predict=_tracks_to_predict(message, scenario_id),
            extras={"num_unknown_map_features": message.map.num_unknown} if message.map.num_unknown else {},
        )


def _shard_name(item: str) -> str:
    """Return ``item`` if it is a valid file name, else a cleaned name with a hash.

    Example:
        >>> _shard_name("training.tfrecord-00000-of-01000"), _shard_name("a b/c.tfrecord")
        ('training.tfrecord-00000-of-01000', 'a_b_c.tfrecord-8663cf28')
    """
    clean = re.sub(r"[^A-Za-z0-9._-]", "_", item)
    if clean == item:
        return item
    return f"{clean}-{hashlib.blake2b(item.encode(), digest_size=4).hexdigest()}"


def _tracks(tracks: WireTracks, origin: Float64) -> Tracks:
    return make_tracks(
        ids=tracks.ids.tolist(),
        object_type=_OBJECT_TYPES[tracks.types],
        position=tracks.center,
        heading=tracks.heading,
        velocity=tracks.velocity,
        size=tracks.size,
        valid=tracks.valid,
        origin=origin,
    )


def _lights(lights: WireLights, num_timesteps: int, features: MapFeatures | None, origin: Float64) -> Lights:
    """Build one light per lane, in order of appearance, at its first stop point."""
    lanes, first, row = np.unique(lights.lane, return_index=True, return_inverse=True)
    order = np.argsort(first)
    rank = np.argsort(order)
    state = np.full((len(lanes), num_timesteps), LightState.ABSENT, np.uint8)
    state[rank[row], lights.step] = _LIGHT_STATES[lights.state]
    ids = strings(lanes[order].tolist())
    known = set() if features is None else set(features.ids)
    return Lights(
        ids=ids,
        lane_ids=ids,
        stop_point=(lights.stop_point[first[order]] - origin).astype(np.float32),
        state=state,
        is_lane_in_map=np.array([lane in known for lane in ids], dtype=np.bool_),
        provenance=np.full(len(ids), Provenance.OBSERVED, np.uint8),
    )


def _tracks_to_predict(message: WireScenario, scenario_id: str) -> tuple[tuple[str, int], ...]:
    ids = message.tracks.ids.tolist()
    chosen = []
    for index, difficulty in message.tracks_to_predict.tolist():
        if not 0 <= index < len(ids):
            raise InvalidScenario(scenario_id, "tracks_to_predict", f"expected 0 ... {len(ids) - 1}, found {index}")
        chosen.append((str(ids[index]), difficulty))
    return tuple(chosen)
