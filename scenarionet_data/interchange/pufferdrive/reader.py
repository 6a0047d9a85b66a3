"""Read PufferDrive's binary maps."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import ClassVar

import numpy as np

from scenarionet_data.errors import BadParameter, CorruptSource
from scenarionet_data.ingest.defects import Defects
from scenarionet_data.ingest.options import Options, option
from scenarionet_data.ingest.shard import Shard
from scenarionet_data.interchange.gpudrive.layout import FEATURE_OF_TYPE, OBJECT_NAMES
from scenarionet_data.interchange.pufferdrive.layout import OBJECT_TYPES, ROAD_TYPES, Entity, decode
from scenarionet_data.interchange.scene_files import FileScene, SceneFiles, SceneObject, SceneRoad

_OBJECTS = {OBJECT_TYPES[name]: kind for kind, name in OBJECT_NAMES.items()}
_ROADS = {ROAD_TYPES[name]: kind for name, kind in FEATURE_OF_TYPE.items()}


@dataclass(frozen=True)
class PufferDriveOptions(Options):
    """The layout."""

    layout: int = option(0, "2: PufferDrive 2.0, 1: pufferlib 3.0; 0: the one that the file can be read in.")

    def __post_init__(self) -> None:
        if self.layout not in (0, 1, 2):
            raise BadParameter(f"layout={self.layout}: PufferDrive has the layouts 1 and 2; 0 takes the one that fits")


class PufferDrive(SceneFiles):
    """PufferDrive's maps; in layout 1, objects and roads have no ids, and the ego is not known."""

    name: ClassVar[str] = "pufferdrive"
    licence: ClassVar[str] = "that of the recordings; of Waymo's: non-commercial, no redistribution"
    raw: ClassVar[str] = "a folder of PufferDrive's maps (*.bin)"
    Options = PufferDriveOptions
    pattern: ClassVar[str] = "*.bin"

    def scene(self, path: Path, shard: Shard, defects: Defects) -> FileScene:  # noqa: ARG002
        """Read a file."""
        try:
            content = path.read_bytes()
        except OSError as error:
            raise CorruptSource(f"{path}: cannot be read ({error.strerror}); copy it again") from error
        layout = shard.options_as(PufferDriveOptions).layout
        try:
            puffer_map = decode(content, layout or 2, str(path))
        except CorruptSource:
            if layout:
                raise
            puffer_map = decode(content, 1, str(path))
        rows = range(len(puffer_map.objects))
        return FileScene(
            [_object(each) for each in puffer_map.objects],
            [SceneRoad(str(each.id), _ROADS[each.kind], each.position.astype(np.float64)) for each in puffer_map.roads],
            ego=puffer_map.ego if puffer_map.ego in rows else None,
            predicted=[(row, 0) for row in puffer_map.predicted if row in rows],
        )


def _object(entity: Entity) -> SceneObject:
    if entity.velocity is None or entity.heading is None or entity.valid is None:
        raise TypeError("an object without states")
    width, length, height = entity.size
    return SceneObject(
        str(entity.id),
        _OBJECTS[entity.kind],
        entity.position.astype(np.float64),
        entity.velocity[:, :2].astype(np.float64),
        entity.heading.astype(np.float64),
        entity.valid,
        (length, width, height),
        {"mark_as_expert": entity.is_expert, "goal_position": list(entity.goal)},
    )
