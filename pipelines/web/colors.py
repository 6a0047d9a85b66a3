"""The colours of pictures, for the browser: the player shows what thumbnails and videos show."""

from __future__ import annotations

from scenarionet_data.vocabulary import ObjectType, names
from scenarionet_sim.render import palette

COLORS = {
    "ground": palette.GROUND,
    "road": palette.ROAD,
    "edge": palette.EDGE,
    "white": palette.WHITE,
    "yellow": palette.YELLOW,
    "ink": palette.INK,
    "ego": palette.EGO,
    "objects": {name: palette.object_color(code) for code, name in enumerate(names(ObjectType))},
    "lights": {color.name: {"fill": fill, "shape": shape} for color, (fill, shape) in palette.LIGHTS.items()},
}
"""Hexadecimal, by what is drawn; objects by type; lights by colour, with the shape that tells them apart."""
