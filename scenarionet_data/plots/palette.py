"""Colours and sizes of all pictures, in figures and in the browser, distinguishable with colour vision deficiency.

Source: M. Okabe, K. Ito, "Color universal design", 2008. Lights also differ in shape.
"""

from __future__ import annotations

from scenarionet_data.scenario.vocabulary import LightColor, ObjectType

GROUND = "#e8eae5"
ROAD = "#b9bfc7"
ARROW = "#cdd2d8"
EDGE = "#4d545c"
WHITE = "#ffffff"
YELLOW = "#f2b600"
INK = "#22262a"

EGO = "#d55e00"
OBJECTS = {
    ObjectType.VEHICLE: "#0072b2",
    ObjectType.PEDESTRIAN: "#cc79a7",
    ObjectType.CYCLIST: "#009e73",
}
OTHER = "#8a6d00"
"""Cones, barriers and other obstacles."""

NAMES = {ObjectType.VEHICLE: "vehicle", ObjectType.PEDESTRIAN: "pedestrian", ObjectType.CYCLIST: "cyclist"}

LIGHTS = {
    LightColor.RED: ("#d03020", "s"),
    LightColor.YELLOW: ("#f0e442", "^"),
    LightColor.GREEN: ("#00a070", "o"),
    LightColor.UNKNOWN: ("#999999", "D"),
}
"""Colour and shape of a light."""

MEANINGFUL = (EGO, *OBJECTS.values(), OTHER, WHITE, YELLOW, INK, *(fill for fill, _ in LIGHTS.values()))
"""Colours that a picture with a reduced palette must keep."""

LINE = 0.15
"""Width of painted lines [m], and half the distance between the two of a double line."""

STOP_LINE = 0.4
"""Width of a stop line [m]."""

DASH, GAP = 3.0, 4.5
"""Length of the dashes and gaps of a broken line [m]."""

ARROW_EVERY = 30.0
"""Distance between the direction arrows of a lane [m]."""

STRIPE = 0.5
"""Width of a crosswalk's stripes, and of the gaps between them [m]."""

ROUTE = 1.2
"""Width of the ego's route [m]."""


SERIES = ("#0072b2", "#e69f00", "#009e73", "#cc79a7", "#56b4e9", "#d55e00", "#8a6d00", "#000000")
"""Colours of datasets, databases and tracks, in this order."""

COLORMAP = "viridis"
"""Colour map of numbers: brightness increases with the value, also readable in grey."""


def object_color(object_type: int) -> str:
    """Return the colour of an object other than the ego."""
    return OBJECTS.get(ObjectType(object_type), OTHER)
