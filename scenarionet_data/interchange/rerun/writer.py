"""Write scenarios as rerun's recordings (.rrd).

Entities: ``map/LAYER`` and ``paths`` once, ``objects``, ``lights``, ``ego`` and ``camera/NAME`` on the timeline
``time``, which counts from the first timestep. Rerun gives chunks and rows random ids, so files of equal scenarios
differ in these (``rerun rrd compare`` finds them equal).
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from typing import ClassVar

import numpy as np
import rerun
from rerun.chunk import Chunk

from scenarionet_data.arrays.dtypes import Float32, Int64, UInt8
from scenarionet_data.interchange.base import CameraFiles, Losses
from scenarionet_data.interchange.viewing import LAYERS, LIGHT_HEIGHT, LIGHTS, ViewedScene, draw, quaternions
from scenarionet_data.scenario.description import ScenarioDescription
from scenarionet_data.scenario.vocabulary import LightColor

_APPLICATION = "scenarionet"


@dataclass(frozen=True)
class RerunWriter:
    """Writes one recording a scenario.

    Attributes:
        paths: Draw the path of every object, too.
    """

    name: ClassVar[str] = "rerun"

    paths: bool = True

    def write(
        self, scenario: ScenarioDescription, stem: str, losses: Losses, pictures: CameraFiles | None = None
    ) -> Mapping[str, bytes]:
        """Return the file of a scenario; see :class:`~scenarionet_data.interchange.base.FormatWriter`."""
        scene = draw(scenario, losses)
        time = _times(scene.nanoseconds)
        chunks = [*_map(scene), *([_paths(scene)] if self.paths else ()), *_motion(scene, time)]
        chunks += [
            Chunk.from_columns(
                f"camera/{camera}",
                [time],
                rerun.EncodedImage.columns(blob=list(images), media_type=["image/jpeg"] * len(images)),
            )
            for camera, images in (pictures or {}).items()
        ]
        recording = rerun.RecordingStream(_APPLICATION, recording_id=scenario.id, send_properties=False)
        stream = rerun.binary_stream(recording)
        recording.send_chunks(chunks)
        content = stream.read()
        recording.disconnect()
        return {f"{stem}.rrd": content or b""}


def _map(scene: ViewedScene) -> list[Chunk]:
    return [
        _lines(f"map/{layer}", lines, np.tile(np.array(LAYERS[layer], np.uint8), (len(lines), 1)), 0.08)
        for layer, lines in scene.layers.items()
    ]


def _paths(scene: ViewedScene) -> Chunk:
    lines = [scene.path(row) for row in range(len(scene.names))]
    return _lines("paths", lines, scene.colors, 0.05)


def _lines(entity: str, lines: list[Float32], colors: UInt8, radius: float) -> Chunk:
    """Lines that do not move."""
    columns = rerun.LineStrips3D.columns(strips=lines, colors=colors, radii=[radius] * len(lines))
    return Chunk.from_columns(entity, [], columns.partition([len(lines)]))


def _motion(scene: ViewedScene, time: rerun.TimeColumn) -> Iterator[Chunk]:
    """Boxes, lights and the frame of the ego; timesteps without an object have an empty list."""
    valid = scene.valid.T
    rows = np.nonzero(valid)[1]
    boxes = rerun.Boxes3D.columns(
        centers=scene.position.transpose(1, 0, 2)[valid],
        half_sizes=scene.size.transpose(1, 0, 2)[valid] / 2,
        quaternions=quaternions(scene.heading.T[valid]).astype(np.float32),
        colors=scene.colors[rows],
        labels=[scene.names[row] for row in rows.tolist()],
        show_labels=[False] * len(rows),
    )
    yield Chunk.from_columns("objects", [time], boxes.partition(valid.sum(axis=1)))
    if len(scene.lights):
        seen = scene.light_seen.T
        lights = np.nonzero(seen)[1]
        colors = np.array([LIGHTS[LightColor(code)] for code in range(len(LIGHTS))], np.uint8)
        points = rerun.Points3D.columns(
            positions=scene.lights[lights] + np.array([0, 0, LIGHT_HEIGHT], np.float32),
            colors=colors[scene.light_colors.T[seen]],
            radii=[0.4] * len(lights),
        )
        yield Chunk.from_columns("lights", [time], points.partition(seen.sum(axis=1)))
    steps = np.flatnonzero(scene.valid[scene.ego])
    frame = rerun.Transform3D.columns(
        translation=scene.position[scene.ego, steps],
        quaternion=quaternions(scene.heading[scene.ego, steps]).astype(np.float32),
    )
    yield Chunk.from_columns("ego", [_times(scene.nanoseconds[steps])], frame)


def _times(nanoseconds: Int64) -> rerun.TimeColumn:
    return rerun.TimeColumn("time", duration=nanoseconds.astype("timedelta64[ns]"))
