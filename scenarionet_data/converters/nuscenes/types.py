"""Vocabulary of nuScenes mapped to the lake's: categories, painted lines, locations, vehicles, splits.

Names from nuScenes' documentation and code (``docs/schema_nuscenes.md``, ``docs/instructions_nuscenes.md``,
``nuscenes/utils/splits.py``); and from Lyft's perception dataset, which has the same format.
"""

from __future__ import annotations

import re
from typing import NamedTuple

from scenarionet_data.scenario.vocabulary import MapFeatureType, ObjectType

_GROUPS = {
    ObjectType.VEHICLE: """vehicle.bus.bendy vehicle.bus.rigid vehicle.car vehicle.construction
        vehicle.emergency.ambulance vehicle.emergency.police vehicle.trailer vehicle.truck
        bus car emergency_vehicle other_vehicle truck""",
    ObjectType.PEDESTRIAN: """human.pedestrian.adult human.pedestrian.child human.pedestrian.construction_worker
        human.pedestrian.personal_mobility human.pedestrian.police_officer human.pedestrian.stroller
        human.pedestrian.wheelchair pedestrian""",
    ObjectType.CYCLIST: "vehicle.bicycle vehicle.motorcycle bicycle motorcycle",
    ObjectType.TRAFFIC_CONE: "movable_object.trafficcone",
    ObjectType.TRAFFIC_BARRIER: "movable_object.barrier",
    ObjectType.OTHER: """animal movable_object.debris movable_object.pushable_pullable
        static_object.bicycle_rack""",
}
CATEGORIES = {word: kind for kind, words in _GROUPS.items() for word in words.split()}
"""The 23 categories of nuScenes (with dots, except ``animal``) and Lyft's 9."""

EGO = "ego"
EGO_CATEGORY = "vehicle.ego"
"""Category of the recording vehicle in nuScenes-lidarseg."""


class EgoVehicle(NamedTuple):
    """A recording vehicle.

    Attributes:
        size: Length, width, height [m].
        ahead: Distance from the rear axle, the reference point of ``ego_pose``, to the centre of the box [m].
    """

    size: tuple[float, float, float]
    ahead: float


RENAULT_ZOE = EgoVehicle((4.084, 1.730, 1.562), 1.385)
"""nuScenes' vehicle by the manufacturer's data: half its length less the 0.657 m behind the rear axle."""
FORD_FUSION = EgoVehicle((4.87, 1.85, 1.8), 1.34)
"""Lyft's vehicle: size from Lyft's later dataset; the same model as Argoverse's, with the same overhangs."""

PLACES = ("boston-seaport", "singapore-hollandvillage", "singapore-onenorth", "singapore-queenstown")
"""Locations of nuScenes, with a map expansion each; Lyft's only location, Palo Alto, has none."""

LINES = {
    "SINGLE_SOLID_WHITE": MapFeatureType.ROAD_LINE_SOLID_SINGLE_WHITE,
    "DOUBLE_SOLID_WHITE": MapFeatureType.ROAD_LINE_SOLID_DOUBLE_WHITE,
    "SINGLE_SOLID_YELLOW": MapFeatureType.ROAD_LINE_SOLID_SINGLE_YELLOW,
    "DOUBLE_SOLID_YELLOW": MapFeatureType.ROAD_LINE_SOLID_DOUBLE_YELLOW,
    "DOUBLE_DASHED_WHITE": MapFeatureType.ROAD_LINE_BROKEN_SINGLE_WHITE,
    "SINGLE_ZIGZAG_WHITE": MapFeatureType.ROAD_LINE_SOLID_SINGLE_WHITE,
    "NIL": MapFeatureType.UNKNOWN_LINE,
}
"""Types of divider segments. ``NIL``: the map has no painted line between the lanes."""
INEXACT_LINES = frozenset({"DOUBLE_DASHED_WHITE", "SINGLE_ZIGZAG_WHITE", "NIL"})
"""Types with a different feature type: their line keeps the name in extras ``segment_type``."""
UNTYPED_DIVIDER = MapFeatureType.ROAD_LINE_SOLID_SINGLE_YELLOW
"""Assumed type of a road divider (between opposite directions) without types from lanes; flagged."""

_SCENE = re.compile(r"scene-(\d{4})")
_VAL = (
    *range(12, 19), *range(35, 41), *range(92, 111), *range(267, 279), *range(329, 333), *range(344, 347),
    *range(519, 525), *range(552, 566), *range(625, 639), *range(770, 786), *range(793, 803), *range(904, 932),
    *range(962, 975), *range(1059, 1074), 3, 221,
)  # fmt: skip
"""Numbers of the validation scenes; some are unused."""
_MINI_VAL = (103, 916)
_LAST_OF_TRAIN_VAL = 300
"""The prediction challenge reserves the first 200 training scenes, up to this number, as ``train_val``."""

RELEASES = {
    "v1.0-trainval": ("train", "val", "train_val"),
    "v1.0-test": ("test",),
    "v1.0-mini": ("mini", "mini_train", "mini_val"),
}
"""Splits of each release of nuScenes."""


def is_in_split(scene: str, split: str, is_challenge: bool = False) -> bool:
    """Whether a scene is in one of nuScenes' splits; scenes of other datasets are in any.

    Args:
        scene: Its name.
        split: One of ``RELEASES``.
        is_challenge: Whether ``train`` is the prediction challenge's, which excludes ``train_val``.

    Example:
        >>> is_in_split("scene-0003", "train"), is_in_split("scene-0003", "val")
        (False, True)
    """
    found = _SCENE.fullmatch(scene)
    number = int(found[1]) if found else 0
    if not found or split in ("test", "mini"):
        return True
    if split.startswith("mini_"):
        return (number in _MINI_VAL) == (split == "mini_val")
    if split == "val" or number in _VAL:
        return split == "val" and number in _VAL
    is_train_val = number <= _LAST_OF_TRAIN_VAL
    return is_train_val if split == "train_val" else split == "train" and not (is_challenge and is_train_val)
