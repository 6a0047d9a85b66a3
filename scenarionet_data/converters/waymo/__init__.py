"""Waymo Open Motion Dataset: TFRecord files of ``waymo.open_dataset.Scenario`` messages, 91 steps or 20 s each.

Neither TensorFlow nor a protobuf runtime is needed. The frame is Waymo's, with an arbitrary origin in every scenario.
``wire`` decodes messages to arrays; this module maps them to the lake's vocabulary.
"""

from __future__ import annotations

import hashlib
import re
from collections.abc import Iterable, Iterator, Sequence
from functools import partial
from pathlib import Path

import numpy as np

from scenarionet_data.arrays.dtypes import Float64
from scenarionet_data.building import make_origin, make_tracks
from scenarionet_data.converters.base import Converter, find_files
from scenarionet_data.converters.formats.protowire import DamagedMessage, Messages
from scenarionet_data.converters.formats.tfrecord import TfRecord, read_records
from scenarionet_data.converters.waymo.cleaning import UsableTracks, find_bad_features, usable_lights, usable_tracks
from scenarionet_data.converters.waymo.map_features import map_features
from scenarionet_data.converters.waymo.wire import WireLights, WireScenario, WireTracks, decode
from scenarionet_data.errors import CorruptSource, InvalidScenario, SourceNotFound
from scenarionet_data.ingest.defects import Defects
from scenarionet_data.ingest.input_properties import is_local
from scenarionet_data.ingest.options import Options
from scenarionet_data.ingest.passed_over import PassedOver
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

EXAMPLE = "training.tfrecord-00000-of-01000"

_SIDECARS = (".gstmp", ".crc", ".crc32c", ".md5", ".sha256", ".json", ".idx", ".index")
"""Endings of files beside recordings: unfinished downloads of gsutil, checksums, descriptions and indices."""

_OTHER_PARTS = frozenset({"tf_example", "tf_examples", "lidar", "lidar_and_camera", "occupancy_flow_challenge"})
"""Folders of the dataset with other formats: the same scenarios as tf.Example, and sensor data."""

_UNUSED_FIELDS = {12: "lidar (compressed_frame_laser_data)", 13: "camera tokens (frame_camera_tokens)"}
"""Fields of a Scenario message that are not read."""


def shard_name(item: str) -> str:
    """Return ``item`` if it is a valid file name, else a cleaned name with a hash.

    Example:
        >>> shard_name("training.tfrecord-00000-of-01000"), shard_name("a b/c.tfrecord")
        ('training.tfrecord-00000-of-01000', 'a_b_c.tfrecord-8663cf28')
    """
    clean = re.sub(r"[^A-Za-z0-9._-]", "_", item)
    if clean == item:
        return item
    return f"{clean}-{hashlib.blake2b(item.encode(), digest_size=4).hexdigest()}"


def unused_fields(path: Path) -> Iterator[PassedOver]:
    """Sensor data in the first record of a file; reading all records would take as long as the conversion."""
    try:
        record = next(iter(read_records(path)))
        numbers = Messages.of(record.payload).fields().number
    except (CorruptSource, DamagedMessage, OSError):  # reported by the conversion
        return
    for number, what in _UNUSED_FIELDS.items():
        count = int(np.count_nonzero(numbers == number))
        if count:
            yield PassedOver(f"{what} in the first scenario of {path.name}", count, "sensor data is not stored")


def scenario_files(raw: str, split: str) -> list[Path]:
    """Find the files of scenarios, also below a folder with other parts of the dataset.

    Raises:
        SourceNotFound: None.
    """
    root, what = Path(raw), f"files like {EXAMPLE} (the dataset's `scenario` format)"
    found = find_files(raw, "*.tfrecord*", what, split, _SIDECARS)
    chosen = [path for path in found if path == root or not _is_other_part(path.relative_to(root))]
    if not chosen:
        raise SourceNotFound(f"{raw}: {found[0]} belongs to another part of the dataset; give the folder with {what}")
    return chosen


def _is_other_part(path: Path) -> bool:
    """Whether a file below RAW is of the dataset's other formats, by the names that the owner gives them."""
    return not _OTHER_PARTS.isdisjoint(path.parts[:-1]) or "tfexample" in path.name


_OBJECT_TYPES = np.array(
    [ObjectType.UNSET, ObjectType.VEHICLE, ObjectType.PEDESTRIAN, ObjectType.CYCLIST, ObjectType.OTHER], np.uint8
)
"""``ObjectType`` by Track.ObjectType 0 to 4."""


class Waymo(Converter[TfRecord]):
    """One shard per file; a record is one scenario, in file order."""

    name = "waymo"
    version = "2"
    release = "v1.2"
    licence = "Waymo Dataset License Agreement for Non-Commercial Use"
    raw = f"a folder with files like {EXAMPLE} (the dataset's `scenario` format), or one of them"

    def shards(self, raw: str, split: str, version: str, options: Options) -> Iterator[Shard]:
        """List one shard per TFRecord file."""
        root = Path(raw)
        folder = root.parent if root.is_file() else root
        for path in scenario_files(raw, split):
            item = RawItem(path.relative_to(folder).as_posix(), fingerprint([path]))
            yield Shard(
                dataset=self.name,
                version=version,
                split=split,
                name=shard_name(item.name),
                root=str(folder),
                items=(item,),
                options=options,
            )

    def passed_over(self, raw: str, split: str, options: Options, shards: Sequence[Shard]) -> Iterable[PassedOver]:
        """Files that hold no scenarios, and the sensor data in those that do."""
        yield from super().passed_over(raw, split, options, shards)
        path = next((path for shard in shards for path in shard.paths if is_local(path)), None)
        yield from unused_fields(path) if path else ()

    def records(self, shard: Shard) -> Iterator[TfRecord]:
        """Yield the file's records."""
        for path in shard.paths:
            yield from read_records(path)

    def scenario(self, shard: Shard, record: TfRecord) -> ScenarioDescription:
        """Convert one message to a scenario."""
        file = shard.items[0].name
        where = f"{file}@{record.offset}"
        if record.damage:
            remedy = "download the file again and convert it with replace=True (on the command line: --replace)"
            raise InvalidScenario(where, "record", f"expected an intact record, found {record.damage}; {remedy}")
        message = decode(record.payload, where, partial(make_scenario_id, self.name, shard.version))
        # Overflow of float32 becomes infinity, which validation reports.
        with np.errstate(over="ignore", invalid="ignore"):
            return self._describe(shard, file, message)

    def _describe(self, shard: Shard, file: str, message: WireScenario) -> ScenarioDescription:
        scenario_id = make_scenario_id(self.name, shard.version, message.scenario_id)
        defects = Defects()
        usable = usable_tracks(message, file, scenario_id, defects)
        tracks, ego = usable.tracks, usable.ego
        origin = make_origin(tracks.center[ego], tracks.valid[ego], has_z=True)
        features = map_features(message.map, find_bad_features(message.map, file, defects), origin)
        unknown = ["features"] * message.map.num_unknown
        defects.drop("maps", file, unknown, "feature_data", "expected a kind that map.proto of v1.2 has, found another")
        if features is None:
            defects.assume_empty_map(file)
        lights = usable_lights(message.lights, len(message.timestamps), origin, file, defects)
        is_there = np.isin(message.objects_of_interest, tracks.ids)
        lost = [f"track {name}" for name in message.objects_of_interest[~is_there]]
        defects.assume("tracks", file, lost, "objects_of_interest", _TARGETS)
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
            tracks=_tracks(usable, origin),
            lights=_lights(lights, len(message.timestamps), features, origin),
            map=features,
            objects_of_interest=tuple(str(name) for name in message.objects_of_interest[is_there]),
            tracks_to_predict=_tracks_to_predict(message, tracks, file, defects),
            extras={"num_unknown_map_features": message.map.num_unknown} if message.map.num_unknown else {},
            defects=defects.found(),
        )


def _tracks(usable: UsableTracks, origin: Float64) -> Tracks:
    tracks = usable.tracks
    return make_tracks(
        ids=tracks.ids.tolist(),
        object_type=np.where(tracks.is_type_known, _OBJECT_TYPES[tracks.types], ObjectType.OTHER),
        position=tracks.center,
        heading=tracks.heading,
        velocity=tracks.velocity,
        size=tracks.size,
        valid=tracks.valid,
        origin=origin,
        is_type_assumed=~tracks.is_type_known,
        is_interpolated=usable.is_interpolated,
    )


def _lights(lights: WireLights, num_timesteps: int, features: MapFeatures | None, origin: Float64) -> Lights:
    """Build one light per lane, in order of appearance, at its first stop point."""
    lanes, first, row = np.unique(lights.lane, return_index=True, return_inverse=True)
    order = np.argsort(first)
    rank = np.argsort(order)
    state = np.full((len(lanes), num_timesteps), LightState.ABSENT, np.uint8)
    state[rank[row], lights.step] = lights.state + LightState.LANE_STATE_UNKNOWN  # Waymo's order
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


_TARGETS = "expected tracks of the scenario, found others, which are left out"


def _tracks_to_predict(
    message: WireScenario, tracks: WireTracks, file: str, defects: Defects
) -> tuple[tuple[str, int], ...]:
    names = dict(zip(tracks.row.tolist(), tracks.ids.tolist(), strict=True))
    wanted = message.tracks_to_predict.tolist()
    lost = [f"track_index {row}" for row, _ in wanted if row not in names]
    defects.assume("tracks", file, lost, "tracks_to_predict", _TARGETS)
    return tuple((str(names[row]), difficulty) for row, difficulty in wanted if row in names)
