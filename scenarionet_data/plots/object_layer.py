"""Artists of objects: boxes with headings, trails, the ego's route, traffic lights."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import numpy.typing as npt
from matplotlib.artist import Artist
from matplotlib.collections import PolyCollection
from matplotlib.colors import to_rgba

from scenarionet_data.arrays.dtypes import Bool, Float64, IntP
from scenarionet_data.arrays.geometry import box_corners
from scenarionet_data.arrays.ragged import Ragged
from scenarionet_data.plots.artists import Marks, Pieces, Strokes
from scenarionet_data.plots.palette import EGO, INK, LIGHTS, ROUTE, WHITE, object_color
from scenarionet_data.plots.scene import Moment, Scene
from scenarionet_data.scenario.vocabulary import LIGHT_COLORS, LightColor

LEAST_SIDE = 0.8
"""Minimum side of a drawn box [m], so that pedestrians and cones are visible."""


def moving(scene: Scene, moments: Sequence[Moment]) -> list[Artist]:
    """Return all artists of objects for the last of the moments."""
    now = moments[-1]
    return [*route(scene), *trails(scene, moments), *boxes(scene, now), *lights(scene, now.timestep)]


def route(scene: Scene, broader: float = 1.0) -> list[Artist]:
    """Return the ego's recorded route as a band below the objects; ``broader`` scales its width."""
    line = Ragged.from_flat([len(scene.route)], scene.route)
    return [Strokes(line, EGO, ROUTE * broader, least=2.0 * broader, alpha=0.35, joinstyle="round", zorder=5)]


def trails(scene: Scene, past: Sequence[Moment]) -> list[Artist]:
    """Return the past positions of objects as fading trails.

    Args:
        scene: The scene.
        past: Its moments up to the current one, in order.
    """
    if len(past) < 2:
        return []
    step, row, pieces = _pieces(
        np.stack([moment.position for moment in past]), np.stack([moment.present for moment in past])
    )
    colors = _colors(scene)[row]
    colors[:, 3] = 0.6 * (step + 1) / len(past)
    return [Pieces(pieces, 0.35, colors=colors, zorder=6)]


def trajectories(scene: Scene, values: npt.NDArray[np.floating]) -> Pieces:
    """Return the recorded trajectories of all objects, coloured by a value, the ego's on top.

    Args:
        scene: The scene.
        values: (T, N) value at each timestep.

    Returns:
        Lines; the caller sets ``norm`` and ``cmap``.
    """
    step, row, pieces = _pieces(scene.position, scene.present)
    order = np.argsort(row == scene.ego, kind="stable")  # the ego last, on top
    step, row, pieces = step[order], row[order], pieces[order]
    lines = Pieces(pieces, 0.6, least=1.2, zorder=6)
    lines.set_array(values[step + 1, row])
    return lines


def boxes(scene: Scene, moment: Moment, least_ego: float = 0.0) -> list[Artist]:
    """Return boxes of the present objects in the colours of their types, with arrows for headings; the ego is on top.

    Args:
        scene: The scene.
        moment: Object states.
        least_ego: Minimum length of the ego [m], so that it stays visible in small pictures.
    """
    artists: list[Artist] = []
    is_ego = np.arange(scene.num_objects) == scene.ego
    colors = _colors(scene)
    for rows, order in ((np.flatnonzero(moment.present & ~is_ego), 7), (np.flatnonzero(moment.present & is_ego), 8)):
        length, width = np.maximum(scene.size[rows, :2], LEAST_SIDE).T
        if order == 8 and len(rows):
            enlarged = max(1.0, least_ego / float(length[0]))
            length, width = length * enlarged, width * enlarged
        corners = box_corners(moment.position[rows], moment.heading[rows], length, width)
        artists.append(
            PolyCollection(list(corners), facecolor=colors[rows], edgecolor=WHITE, linewidth=0.5, zorder=order)
        )
        arrows = list(heading_arrows(corners[length > 1.2]))
        artists.append(PolyCollection(arrows, facecolor=WHITE, alpha=0.75, linewidth=0, zorder=order))
    return artists


def lights(scene: Scene, timestep: int) -> list[Artist]:
    """Return traffic lights at their stop points; colour and shape show the state."""
    if not len(scene.light_state):
        return []
    shown = LIGHT_COLORS[scene.lights_at(timestep)]
    artists: list[Artist] = []
    for color, (fill, shape) in LIGHTS.items():
        places = scene.light_stop[(shown == color) & ~np.isnan(scene.light_stop[:, 0])]
        artists.append(Marks(places, fill, shape, INK, zorder=9 if color != LightColor.UNKNOWN else 8.5))
    return artists


def heading_arrows(corners: Float64) -> Float64:
    """Return triangles (N, 3, 2) in the front third of boxes (N, 4, 2), whose corners start at the front left."""
    front_left, back_left, back_right, front_right = np.moveaxis(corners, 1, 0)
    tip = (front_left + front_right) / 2
    ahead, side = tip - (back_left + back_right) / 2, front_left - front_right
    middle = tip - 0.35 * ahead
    return np.stack([tip - 0.08 * ahead, middle + 0.34 * side, middle - 0.34 * side], axis=1)


def _pieces(position: npt.NDArray[np.floating], present: Bool) -> tuple[IntP, IntP, Float64]:
    """Timesteps, rows and segments (K, 2, 2) of trajectories (T, N, 2) between valid positions of moving objects."""
    is_piece = present[1:] & present[:-1] & (np.hypot(*np.moveaxis(np.diff(position, axis=0), -1, 0)) > 0.01)
    step, row = np.nonzero(is_piece)
    return step, row, np.stack([position[step, row], position[step + 1, row]], axis=1)


def _colors(scene: Scene) -> Float64:
    """RGBA colour of every object, (N, 4)."""
    colors = np.array([to_rgba(object_color(int(kind))) for kind in scene.object_type]).reshape(-1, 4)
    colors[scene.ego] = to_rgba(EGO)
    return colors
