"""What moves in a picture: boxes with headings, trails, the ego's route, lights."""

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
from scenarionet_data.plots.moment import Moment
from scenarionet_data.plots.palette import EGO, INK, LIGHTS, ROUTE, WHITE, object_color
from scenarionet_data.plots.scene import Scene
from scenarionet_data.scenario.vocabulary import LIGHT_COLORS, LightColor

LEAST_SIDE = 0.8
"""Shortest side of a drawn box [m]: pedestrians and cones would hardly be seen."""


def moving(scene: Scene, moments: Sequence[Moment]) -> list[Artist]:
    """Everything of this file, for the last of the moments."""
    now = moments[-1]
    return [*route(scene), *trails(scene, moments), *boxes(scene, now), *lights(scene, now.timestep)]


def route(scene: Scene, broader: float = 1.0) -> list[Artist]:
    """The way the ego's recording drives, as a band under everything that moves; so many times as broad."""
    line = Ragged.from_flat([len(scene.route)], scene.route)
    return [Strokes(line, EGO, ROUTE * broader, least=2.0 * broader, alpha=0.35, joinstyle="round", zorder=5)]


def trails(scene: Scene, past: Sequence[Moment]) -> list[Artist]:
    """Where objects have been, fading with time.

    Args:
        scene: The scene.
        past: Its moments up to now, the latest last.
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
    """Everything that is recorded of everybody's way, the ego's on top, coloured by a number.

    Args:
        scene: The scene.
        values: (T, N) the number at each timestep.

    Returns:
        Lines whose ``norm`` and ``cmap`` are for the caller to set.
    """
    step, row, pieces = _pieces(scene.position, scene.present)
    order = np.argsort(row == scene.ego, kind="stable")  # the ego's last, on top
    step, row, pieces = step[order], row[order], pieces[order]
    lines = Pieces(pieces, 0.6, least=1.2, zorder=6)
    lines.set_array(values[step + 1, row])
    return lines


def boxes(scene: Scene, moment: Moment, least_ego: float = 0.0) -> list[Artist]:
    """Everything that is present as a box in its kind's colour, with a light arrow to its front; the ego on top.

    Args:
        scene: The scene.
        moment: When.
        least_ego: The ego is at least so long [m]; in a small picture it would be lost.
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
    """Traffic lights at their stop points: a colour and a shape for what they show."""
    if not len(scene.light_state):
        return []
    shown = LIGHT_COLORS[scene.lights_at(timestep)]
    artists: list[Artist] = []
    for color, (fill, shape) in LIGHTS.items():
        places = scene.light_stop[(shown == color) & ~np.isnan(scene.light_stop[:, 0])]
        artists.append(Marks(places, fill, shape, INK, zorder=9 if color != LightColor.UNKNOWN else 8.5))
    return artists


def heading_arrows(corners: Float64) -> Float64:
    """(N, 3, 2) triangles that fill the front third of boxes (N, 4, 2), corners from the front left."""
    front_left, back_left, back_right, front_right = np.moveaxis(corners, 1, 0)
    tip = (front_left + front_right) / 2
    ahead, side = tip - (back_left + back_right) / 2, front_left - front_right
    middle = tip - 0.35 * ahead
    return np.stack([tip - 0.08 * ahead, middle + 0.34 * side, middle - 0.34 * side], axis=1)


def _pieces(position: npt.NDArray[np.floating], present: Bool) -> tuple[IntP, IntP, Float64]:
    """Steps, rows and pieces (K, 2, 2) of the ways (T, N, 2) of what moves, where it is present on both ends."""
    is_piece = present[1:] & present[:-1] & (np.hypot(*np.moveaxis(np.diff(position, axis=0), -1, 0)) > 0.01)
    step, row = np.nonzero(is_piece)
    return step, row, np.stack([position[step, row], position[step + 1, row]], axis=1)


def _colors(scene: Scene) -> Float64:
    """(N, 4) RGBA of every object."""
    colors = np.array([to_rgba(object_color(int(kind))) for kind in scene.object_type]).reshape(-1, 4)
    colors[scene.ego] = to_rgba(EGO)
    return colors
