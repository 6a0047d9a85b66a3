"""Write scenarios as MCAP with Foxglove's schemas, which Foxglove and rerun open.

Topics: ``/map`` and ``/paths`` once, ``/objects``, ``/lights`` and ``/tf`` (``map`` to ``ego``) for each timestep, and
``/camera/NAME`` for pictures. Times count from the first timestep. Schemas: https://docs.foxglove.dev/docs/visualization
"""

from __future__ import annotations

import io
import json
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import ClassVar

import foxglove
import numpy as np
from foxglove.channels import CompressedImageChannel, FrameTransformChannel, SceneUpdateChannel
from foxglove.messages import (
    Color,
    CompressedImage,
    CubePrimitive,
    FrameTransform,
    KeyValuePair,
    LinePrimitive,
    LinePrimitiveLineType,
    Point3,
    Pose,
    Quaternion,
    SceneEntity,
    SceneEntityDeletion,
    SceneEntityDeletionType,
    SceneUpdate,
    SpherePrimitive,
    Timestamp,
    Vector3,
)

from scenarionet_data.arrays.dtypes import Float32
from scenarionet_data.interchange.base import CameraFiles, Losses
from scenarionet_data.interchange.viewing import LAYERS, LIGHT_HEIGHT, LIGHTS, ViewedScene, draw, quaternions
from scenarionet_data.scenario.description import ScenarioDescription
from scenarionet_data.scenario.vocabulary import LightColor

_FRAME = "map"
_LIGHT_SIZE = Vector3(x=0.8, y=0.8, z=0.8)
_UNTURNED = Quaternion(x=0.0, y=0.0, z=0.0, w=1.0)
LAYOUT = "foxglove-layout.json"


@dataclass(frozen=True)
class McapWriter:
    """Writes one MCAP file a scenario, and a layout for Foxglove.

    Attributes:
        paths: Draw the path of every object, too.
    """

    name: ClassVar[str] = "mcap"

    paths: bool = True

    def write(
        self, scenario: ScenarioDescription, stem: str, losses: Losses, pictures: CameraFiles | None = None
    ) -> Mapping[str, bytes]:
        """Return the files of a scenario; see :class:`~scenarionet_data.interchange.base.FormatWriter`."""
        scene, output, context = draw(scenario, losses), io.BytesIO(), foxglove.Context()
        options = foxglove.mcap.MCAPWriteOptions(compression_threads=0)
        with foxglove.open_mcap(output, context=context, writer_options=options) as file:
            file.write_metadata("scenario", _metadata(scenario))
            SceneUpdateChannel("/map", context=context).log(SceneUpdate(entities=_map(scene)), log_time=0)
            if self.paths:
                SceneUpdateChannel("/paths", context=context).log(SceneUpdate(entities=_paths(scene)), log_time=0)
            _log_motion(scene, context)
            for camera, images in (pictures or {}).items():
                channel = CompressedImageChannel(f"/camera/{camera}", context=context)
                for nanoseconds, image in zip(scene.nanoseconds.tolist(), images, strict=True):
                    message = CompressedImage(timestamp=_stamp(nanoseconds), frame_id=camera, data=image, format="jpeg")
                    channel.log(message, log_time=nanoseconds)
        layout = json.dumps(_layout(tuple(pictures or ())), indent=1).encode() + b"\n"
        return {f"{stem}.mcap": output.getvalue(), LAYOUT: layout}


def _log_motion(scene: ViewedScene, context: foxglove.Context) -> None:
    """Log boxes, lights and the frame of the ego at each timestep."""
    objects, lights = SceneUpdateChannel("/objects", context=context), SceneUpdateChannel("/lights", context=context)
    frames = FrameTransformChannel("/tf", context=context)
    colors = [_color(color) for color in scene.colors.tolist()]
    centers, sizes = scene.position.astype(np.float64).tolist(), scene.size.astype(np.float64)
    is_new = np.any(np.diff(sizes, axis=1, prepend=-1.0) != 0.0, axis=2).tolist()
    boxes = [Vector3() for _ in scene.names]
    turns = quaternions(scene.heading)[..., 2:].tolist()
    ids = [[KeyValuePair(key="object", value=name)] for name in scene.names]

    def pose(row: int, timestep: int) -> tuple[Vector3, Quaternion]:
        (x, y, z), (turn, w) = centers[row][timestep], turns[row][timestep]
        return Vector3(x=x, y=y, z=z), Quaternion(x=0.0, y=0.0, z=turn, w=w)

    for timestep, nanoseconds in enumerate(scene.nanoseconds.tolist()):
        stamp = _stamp(nanoseconds)
        entities = []
        for row in scene.objects_at(timestep).tolist():
            position, orientation = pose(row, timestep)
            if is_new[row][timestep]:
                length, width, height = sizes[row, timestep].tolist()
                boxes[row] = Vector3(x=length, y=width, z=height)
            cube = CubePrimitive(
                pose=Pose(position=position, orientation=orientation), size=boxes[row], color=colors[row]
            )
            entities.append(
                SceneEntity(timestamp=stamp, frame_id=_FRAME, id=scene.names[row], metadata=ids[row], cubes=[cube])
            )
        objects.log(_replacing(stamp, entities), log_time=nanoseconds)
        if scene.valid[scene.ego, timestep]:
            translation, rotation = pose(scene.ego, timestep)
            frame = FrameTransform(
                timestamp=stamp, parent_frame_id=_FRAME, child_frame_id="ego", translation=translation,
                rotation=rotation,
            )  # fmt: skip
            frames.log(frame, log_time=nanoseconds)
        if len(scene.lights):
            lights.log(_replacing(stamp, _lights(scene, timestep, stamp)), log_time=nanoseconds)


def _replacing(stamp: Timestamp, entities: list[SceneEntity]) -> SceneUpdate:
    """An update that takes everything away that its topic showed before, as objects vanish."""
    return SceneUpdate(
        deletions=[SceneEntityDeletion(timestamp=stamp, type=SceneEntityDeletionType.All)], entities=entities
    )


def _lights(scene: ViewedScene, timestep: int, stamp: Timestamp) -> list[SceneEntity]:
    shown = np.flatnonzero(scene.light_seen[:, timestep]).tolist()
    return [
        SceneEntity(
            timestamp=stamp, frame_id=_FRAME, id=f"{scene.light_names[row]} {row}",
            spheres=[
                SpherePrimitive(
                    pose=Pose(
                        position=Vector3(
                            **dict(zip("xyz", (scene.lights[row] + [0, 0, LIGHT_HEIGHT]).tolist(), strict=True))
                        ),
                        orientation=_UNTURNED,
                    ),
                    size=_LIGHT_SIZE, color=_color(LIGHTS[LightColor(scene.light_colors[row, timestep])]),
                )
            ],
        )
        for row in shown
    ]  # fmt: skip


def _map(scene: ViewedScene) -> list[SceneEntity]:
    return [
        _line_entity(layer, [_line(points, LAYERS[layer], 0.15) for points in lines])
        for layer, lines in scene.layers.items()
    ]


def _paths(scene: ViewedScene) -> list[SceneEntity]:
    return [
        _line_entity(name, [_line(scene.path(row), scene.colors[row].tolist(), 0.1)])
        for row, name in enumerate(scene.names)
    ]


def _line_entity(name: str, lines: list[LinePrimitive]) -> SceneEntity:
    return SceneEntity(timestamp=_stamp(0), frame_id=_FRAME, id=name, lines=lines)


def _line(points: Float32, color: Sequence[int], thickness: float) -> LinePrimitive:
    return LinePrimitive(
        type=LinePrimitiveLineType.LineStrip, thickness=thickness, color=_color(color),
        points=[Point3(x=x, y=y, z=z) for x, y, z in points.astype(np.float64).tolist()],
    )  # fmt: skip


def _color(color: Sequence[int]) -> Color:
    red, green, blue, alpha = (value / 255 for value in color)
    return Color(r=red, g=green, b=blue, a=alpha)


def _stamp(nanoseconds: int) -> Timestamp:
    return Timestamp(sec=nanoseconds // 1_000_000_000, nsec=nanoseconds % 1_000_000_000)


def _metadata(scenario: ScenarioDescription) -> dict[str, str]:
    return {
        "scenario_id": scenario.id,
        "dataset": scenario.dataset,
        "ego_id": scenario.ego_id,
        "current_timestep": str(scenario.current_timestep),
        "origin": " ".join(f"{value:.17g}" for value in scenario.origin),
    }


def _layout(cameras: tuple[str, ...]) -> dict[str, object]:
    """A layout of Foxglove: the scene that follows the ego, and each camera beside it."""
    topics = {f"/{name}": {"visible": True} for name in ("map", "paths", "objects", "lights")}
    panels: dict[str, object] = {"3D!scene": {"followTf": "ego", "followMode": "follow-position", "topics": topics}}
    shown: object = "3D!scene"
    for camera in cameras:
        panels[f"Image!{camera}"] = {"imageMode": {"imageTopic": f"/camera/{camera}"}}
        shown = {"direction": "row", "first": shown, "second": f"Image!{camera}", "splitPercentage": 60}
    return {"configById": panels, "globalVariables": {}, "userNodes": {}, "layout": shown}
