"""Colours and sizes for the browser player, the same as in thumbnails and videos."""

from __future__ import annotations

from scenarionet_data.plots import palette
from scenarionet_data.scenario.vocabulary import ObjectType, names

RUNS = ("#8f4fe0", "#0091b0", "#dc2f5a")
"""Colours of runs beside the recording, with a contrast of 3:1 to the page in light and dark mode."""

PICTURE = {
    "ground": palette.GROUND,
    "sky": "#dfe8f0",
    "road": palette.ROAD,
    "arrow": palette.ARROW,
    "edge": palette.EDGE,
    "white": palette.WHITE,
    "yellow": palette.YELLOW,
    "ink": palette.INK,
    "ego": palette.EGO,
    "objects": {name: palette.object_color(code) for code, name in enumerate(names(ObjectType))},
    "lights": {color.name: {"fill": fill, "shape": shape} for color, (fill, shape) in palette.LIGHTS.items()},
    "lineWidth": palette.LINE,
    "stopLineWidth": palette.STOP_LINE,
    "dashes": [palette.DASH, palette.GAP],
    "stripes": [palette.STRIPE, palette.STRIPE],
    "arrowEvery": palette.ARROW_EVERY,
    "routeWidth": palette.ROUTE,
    "runs": RUNS,
}
"""Colours in hexadecimal notation, objects by type, lights by colour with their shape; sizes in metres."""

DARK_PICTURE = PICTURE | {
    "ground": "#14181c",
    "sky": "#1f2730",
    "road": "#2b323a",
    "arrow": "#46505a",
    "edge": "#98a2ad",
}
"""The same for a page in dark mode: objects, lines and lights keep their colours."""
