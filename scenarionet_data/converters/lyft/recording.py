"""Read Lyft's recordings scene by scene: a zarr folder of four tables linked by ranges of rows.

    scenes               frame_index_interval, host, start_time, end_time [ns]
    frames               timestamp [ns], agent_index_interval, traffic_light_faces_index_interval, ego pose
    agents               centroid, extent, yaw, velocity, track_id, label_probabilities
    traffic_light_faces  face_id, traffic_light_id, traffic_light_face_status

Format version 1 has no lights and narrower numbers. Ranges are half open and count from the start of the whole table.
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np

from scenarionet_data.arrays.dtypes import Array, Bool, Float64, Int64
from scenarionet_data.converters.formats.zarr2 import ChunkedTable, read_attributes
from scenarionet_data.errors import CorruptSource, InvalidScenario

_Field = tuple[tuple[int, ...] | None, str]
"""Shape, None for any, and kinds of dtype."""
_INTEGER, _REAL, _TEXT = "iu", "f", "U"
_FIELDS: dict[str, dict[str, _Field]] = {
    "scenes": {
        "frame_index_interval": ((2,), _INTEGER),
        "host": ((), _TEXT),
        "start_time": ((), _INTEGER),
        "end_time": ((), _INTEGER),
    },
    "frames": {
        "timestamp": ((), _INTEGER),
        "agent_index_interval": ((2,), _INTEGER),
        "ego_translation": ((3,), _REAL),
        "ego_rotation": ((3, 3), _REAL),
    },
    "agents": {
        "centroid": ((2,), _REAL),
        "extent": ((3,), _REAL),
        "yaw": ((), _REAL),
        "velocity": ((2,), _REAL),
        "track_id": ((), _INTEGER),
        "label_probabilities": (None, _REAL),
    },
    "traffic_light_faces": {
        "face_id": ((), _TEXT),
        "traffic_light_id": ((), _TEXT),
        "traffic_light_face_status": ((3,), _REAL),
    },
}
TABLES = frozenset(_FIELDS)
"""Names of the tables."""
_LIGHTS = "traffic_light_faces_index_interval"
_RANGES = {"agents": "agent_index_interval", "traffic_light_faces": _LIGHTS}
"""Column of the frames with their range of rows, by table."""

LABELS = tuple(
    """PERCEPTION_LABEL_NOT_SET PERCEPTION_LABEL_UNKNOWN PERCEPTION_LABEL_DONTCARE PERCEPTION_LABEL_CAR
    PERCEPTION_LABEL_VAN PERCEPTION_LABEL_TRAM PERCEPTION_LABEL_BUS PERCEPTION_LABEL_TRUCK
    PERCEPTION_LABEL_EMERGENCY_VEHICLE PERCEPTION_LABEL_OTHER_VEHICLE PERCEPTION_LABEL_BICYCLE
    PERCEPTION_LABEL_MOTORCYCLE PERCEPTION_LABEL_CYCLIST PERCEPTION_LABEL_MOTORCYCLIST PERCEPTION_LABEL_PEDESTRIAN
    PERCEPTION_LABEL_ANIMAL AVRESEARCH_LABEL_DONTCARE""".split()  # noqa: SIM905
)
"""Labels of ``label_probabilities`` if a recording does not list them (``l5kit/data/labels.py``)."""


@dataclass(frozen=True)
class LyftScene:
    """One row of the scenes.

    Attributes:
        index: The row.
        name: Host and start: identifies the scene in all recordings that contain it.
        first, last: Frames ``first`` to ``last - 1``.
        start: Start in the scene's record [ns]; timestamps of frames may deviate by seconds.
        host: The recording vehicle.
    """

    index: int
    name: str
    first: int
    last: int
    start: int
    host: str

    @property
    def date(self) -> str:
        """Date of the start, in UTC."""
        return str(np.datetime64(self.start, "ns").astype("datetime64[D]"))


@dataclass(frozen=True, eq=False)
class LyftContent:
    """Rows of consecutive frames: T frames, R agents, K faces.

    Attributes:
        first: Row of the first frame.
        times: (T,) int64 [ns].
        ego: (T, 3) x, y [m], yaw [rad].
        frame, faces_frame: (R,) and (K,) frame of each row, from 0.
        agents, faces: (R,) and (K,) records.
        agents_row, faces_row: (R,) and (K,) row of each record in its table.
    """

    first: int
    times: Int64
    ego: Float64
    frame: Int64
    agents: Array
    agents_row: Int64
    faces_frame: Int64
    faces: Array
    faces_row: Int64


class LyftRecording:
    """An open zarr folder.

    Attributes:
        path: The folder.
        labels: Labels of ``label_probabilities``.
        scenes: All scenes.

    Raises:
        CorruptSource: A table is missing or not of this dataset.
    """

    def __init__(self, path: Path) -> None:
        self.path = path
        attributes = read_attributes(path)
        labels = attributes.get("labels", LABELS)
        if not isinstance(labels, list | tuple) or not all(isinstance(label, str) for label in labels):
            raise CorruptSource(
                f"{path}/.zattrs: labels: expected a list of names, found {labels!r}; download it again"
            )
        self.labels = tuple(labels)
        self._tables = {name: _table(path, name) for name in ("scenes", "frames", "agents")}
        self._has_lights = _LIGHTS in (self._tables["frames"].dtype.names or ())
        if self._has_lights:
            self._tables["traffic_light_faces"] = _table(path, "traffic_light_faces")
        shape = self._tables["agents"].dtype["label_probabilities"].shape
        if shape != (len(self.labels),):
            raise CorruptSource(f"{path}: expected a probability for each of {len(self.labels)} labels, found {shape}")
        table = self._tables["scenes"]
        rows = table.rows(0, len(table))
        if not is_text(rows["host"]).all():
            raise CorruptSource(f"{path / 'scenes'}: expected host to be text; download it again")
        self.scenes = []
        for index, row in enumerate(rows):
            start, host = int(row["start_time"]), str(row["host"])
            first, last = row["frame_index_interval"].tolist()
            self.scenes.append(LyftScene(index, f"{host}-{start}", first, last, start, host))

    @property
    def num_frames(self) -> int:
        """Number of frames in all scenes."""
        return len(self._tables["frames"])

    def frame_files(self, scene: LyftScene) -> list[Path]:
        """Files with the frames of a scene; none if its frames do not exist."""
        is_sound = 0 <= scene.first <= scene.last <= self.num_frames
        return self._tables["frames"].chunk_files(scene.first, scene.last) if is_sound else []

    def read(self, first: int, last: int, where: str) -> LyftContent:
        """Read frames ``first`` to ``last - 1``.

        Args:
            first, last: Rows of the frames.
            where: Name of the scenario in errors.

        Raises:
            InvalidScenario: A range of rows is out of bounds.
            CorruptSource: A chunk is missing or damaged.
        """
        frames = self._frames(first, last, where)
        frame, agents, agents_row = self._parts("agents", frames, where)
        faces_frame, faces, faces_row = np.zeros(0, np.int64), np.zeros(0), np.zeros(0, np.int64)
        if self._has_lights:
            faces_frame, faces, faces_row = self._parts("traffic_light_faces", frames, where)
        turn = frames["ego_rotation"].astype(np.float64)
        yaw = np.arctan2(turn[:, 1, 0], turn[:, 0, 0])
        return LyftContent(
            first=first,
            times=frames["timestamp"].astype(np.int64),
            ego=np.column_stack([frames["ego_translation"][:, :2], yaw]),
            frame=frame,
            agents=agents,
            agents_row=agents_row,
            faces_frame=faces_frame,
            faces=faces,
            faces_row=faces_row,
        )

    def content_files(self, first: int, last: int, where: str) -> list[Path]:
        """Files that :meth:`read` reads in addition to those with the frames; raises the same errors."""
        frames = self._frames(first, last, where)
        names = [name for name in _RANGES if name in self._tables]
        return [
            path for name in names for path in self._tables[name].chunk_files(*self._range(name, frames, where)[1:])
        ]

    def _frames(self, first: int, last: int, where: str) -> Array:
        if not 0 <= first < last <= self.num_frames:
            wanted = f"expected frames within 0 to {self.num_frames}"
            raise InvalidScenario(where, "frame_index_interval", f"{wanted}, found {first} ... {last}")
        return self._tables["frames"].rows(first, last)

    def _parts(self, name: str, frames: Array, where: str) -> tuple[Int64, Array, Int64]:
        """The frame of each row of consecutive frames in a table, the row, and its number."""
        lengths, first, last = self._range(name, frames, where)
        return np.repeat(np.arange(len(lengths)), lengths), self._tables[name].rows(first, last), np.arange(first, last)

    def _range(self, name: str, frames: Array, where: str) -> tuple[Int64, int, int]:
        """Number of rows of each consecutive frame in a table, the first row, and the one after the last."""
        table, ranges = self._tables[name], frames[_RANGES[name]].astype(np.int64)
        first, last = int(ranges[0, 0]), int(ranges[-1, 1])
        lengths = np.diff(ranges, axis=1)[:, 0]
        is_run = (ranges[1:, 0] == ranges[:-1, 1]).all() and (lengths >= 0).all()
        if not (is_run and 0 <= first <= last <= len(table)):
            place = int(np.append(~((ranges[1:, 0] == ranges[:-1, 1]) & (lengths[1:] >= 0)), True).argmax())
            wanted = f"expected consecutive ranges of rows within 0 to {len(table)}"
            found = f"found {first} ... {last}, with {ranges[place : place + 2].tolist()} from frame {place} on"
            raise InvalidScenario(where, f"frames.{name}", f"{wanted}, {found}")
        return lengths, first, last


def _table(path: Path, name: str) -> ChunkedTable:
    table = ChunkedTable(path / name)
    for field, (shape, kinds) in _FIELDS[name].items():
        names = table.dtype.names or ()
        if field not in names:
            raise CorruptSource(
                f"{path / name}: expected a field {field}, found {list(names)}; is this a Lyft recording?"
            )
        found = table.dtype[field]
        if found.base.kind not in kinds or shape not in (None, found.shape):
            wanted = {"iu": "integers", "f": "real numbers", "U": "text"}[kinds]
            wanted += "" if shape in (None, ()) else f" of shape {shape}"
            raise CorruptSource(
                f"{path / name}: field {field}: expected {wanted}, found {found}; is this a Lyft recording?"
            )
    return table


def is_text(words: Array) -> Bool:
    """Whether each of some words (K,) of a record is text: damaged ones contain numbers that are not characters."""
    codes = np.ascontiguousarray(words).view(np.uint32).reshape(len(words), -1)
    is_control = (codes > 0) & (codes < 0x20)  # 0 is padding
    is_character: Array = ~is_control & (codes < 0xD800) | ((codes > 0xDFFF) & (codes < 0x110000))
    known: Bool = np.logical_and.reduce(is_character, axis=1)
    return known
