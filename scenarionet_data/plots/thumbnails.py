"""Thumbnails for tables and pages, without annotations."""

from __future__ import annotations

import io

import numpy as np
from PIL import Image

from scenarionet_data.arrays.dtypes import is_count
from scenarionet_data.errors import BadParameter
from scenarionet_data.plots import object_layer
from scenarionet_data.plots.map_layer import map_artists
from scenarionet_data.plots.scene import Scene, Window
from scenarionet_data.plots.topdown import blank_axes
from scenarionet_data.scenario.description import ScenarioDescription

_LEAST_EGO = 9.0
"""Minimum length of the ego [pixel]."""


def thumbnail(
    scenario: ScenarioDescription | Scene, size: tuple[int, int] = (240, 180), timestep: int | None = None
) -> bytes:
    """Draw a small picture of the ego's route with all objects at one timestep.

    Args:
        scenario: The scenario.
        size: Width and height [pixel].
        timestep: Timestep to draw; the current timestep by default.

    Returns:
        A PNG file.

    Raises:
        BadParameter: It is no scenario, size or timestep.

    Example:
        Path("thumbnail.png").write_bytes(thumbnail(scenario, (320, 200)))
    """
    scene = Scene.of(scenario)
    if not (isinstance(size, tuple | list) and len(size) == 2 and all(is_count(side, 1) for side in size)):
        raise BadParameter(f"size: expected width and height [pixel], such as (240, 180), found {size!r}")
    width, height = size
    shown = Window.on_route(scene).shaped(width / height)
    axes, canvas = blank_axes(width, height)
    left, right, bottom, top = shown.corners
    axes.set(xlim=(left, right), ylim=(bottom, top))
    now = scene.moment(scene.timestep(timestep))
    boxes = object_layer.boxes(scene, now, least_ego=_LEAST_EGO * shown.width / width)
    for artist in (
        *map_artists(scene.map),
        *object_layer.route(scene),
        *boxes,
        *object_layer.lights(scene, now.timestep),
    ):
        axes.add_artist(artist)
    canvas.draw()  # type: ignore[no-untyped-call]
    file = io.BytesIO()
    pixels = np.asarray(canvas.buffer_rgba())  # type: ignore[no-untyped-call]
    Image.fromarray(pixels).convert("RGB").save(file, "png", compress_level=3)
    return file.getvalue()
