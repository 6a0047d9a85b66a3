"""Classes of the semantic channel: their colours, and their numbers in Cityscapes and MetaDrive."""

from __future__ import annotations

from enum import IntEnum

import numpy as np

from scenarionet_data.arrays.dtypes import UInt8
from scenarionet_sim.cameras.draw import codes


class SemanticClass(IntEnum):
    """Classes of the semantic channel."""

    SKY = codes.SKY
    ROAD = codes.ROADWAY
    LANE_LINE = codes.LANE_PAINT
    CROSSWALK = codes.CROSSING
    SIDEWALK = codes.PAVEMENT
    TERRAIN = codes.TERRAIN
    BUILDING = codes.BUILDING_CLASS
    VEGETATION = codes.VEGETATION
    POLE = codes.POLE_CLASS
    TRAFFIC_LIGHT = codes.TRAFFIC_LIGHT
    CAR = codes.CAR_CLASS
    TRUCK = codes.TRUCK_CLASS
    BUS = codes.BUS_CLASS
    PEDESTRIAN = codes.PERSON
    CYCLIST = codes.RIDER
    TRAFFIC_CONE = codes.CONE_CLASS
    BARRIER = codes.FENCE
    OTHER = codes.OBJECT_CLASS
    TRAFFIC_SIGN = codes.SIGN_CLASS
    OWN_VEHICLE = codes.OWN_VEHICLE


_C = SemanticClass

CITYSCAPES = {
    _C.SKY: 23, _C.ROAD: 7, _C.LANE_LINE: 7, _C.CROSSWALK: 7, _C.SIDEWALK: 8, _C.TERRAIN: 22, _C.BUILDING: 11,
    _C.VEGETATION: 21, _C.POLE: 17, _C.TRAFFIC_LIGHT: 19, _C.CAR: 26, _C.TRUCK: 27, _C.BUS: 28, _C.PEDESTRIAN: 24,
    _C.CYCLIST: 25, _C.TRAFFIC_CONE: 5, _C.BARRIER: 13, _C.OTHER: 5, _C.TRAFFIC_SIGN: 20, _C.OWN_VEHICLE: 1,
}  # fmt: skip
"""Ids of Cityscapes (``labels.py`` of its scripts); cones and other objects are ``dynamic``."""

CLASS_COLORS = {
    _C.SKY: (70, 130, 180), _C.ROAD: (128, 64, 128), _C.LANE_LINE: (255, 255, 255), _C.CROSSWALK: (55, 176, 189),
    _C.SIDEWALK: (244, 35, 232), _C.TERRAIN: (152, 251, 152), _C.BUILDING: (70, 70, 70), _C.VEGETATION: (107, 142, 35),
    _C.POLE: (153, 153, 153), _C.TRAFFIC_LIGHT: (250, 170, 30), _C.CAR: (0, 0, 142), _C.TRUCK: (0, 0, 70),
    _C.BUS: (0, 60, 100), _C.PEDESTRIAN: (220, 20, 60), _C.CYCLIST: (255, 0, 0), _C.TRAFFIC_CONE: (111, 74, 0),
    _C.BARRIER: (190, 153, 153), _C.OTHER: (81, 0, 81), _C.TRAFFIC_SIGN: (220, 220, 0), _C.OWN_VEHICLE: (30, 30, 30),
}  # fmt: skip
"""RGB of each class: those of Cityscapes, and of MetaDrive for lane lines and crosswalks."""

METADRIVE = {
    _C.SKY: "SKY", _C.ROAD: "ROAD", _C.LANE_LINE: "LANE_LINE", _C.CROSSWALK: "CROSSWALK", _C.SIDEWALK: "SIDEWALK",
    _C.TERRAIN: "TERRAIN", _C.BUILDING: "UNLABELED", _C.VEGETATION: "UNLABELED", _C.POLE: "UNLABELED",
    _C.TRAFFIC_LIGHT: "TRAFFIC_LIGHT", _C.CAR: "CAR", _C.TRUCK: "TRUCK", _C.BUS: "BUS", _C.PEDESTRIAN: "PEDESTRIAN",
    _C.CYCLIST: "BIKE", _C.TRAFFIC_CONE: "UNLABELED", _C.BARRIER: "FENCE", _C.OTHER: "UNLABELED",
    _C.TRAFFIC_SIGN: "TRAFFIC_SIGN", _C.OWN_VEHICLE: "CAR",
}  # fmt: skip
"""Names in MetaDrive's ``Semantics``, whose pictures show classes by colour."""


def class_colors(semantic: UInt8) -> UInt8:
    """Return a picture of classes (...) in colour (..., 3)."""
    table: UInt8 = np.array([CLASS_COLORS[member] for member in SemanticClass], np.uint8)
    return table[semantic]
