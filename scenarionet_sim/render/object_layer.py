"""What moves in a picture: boxes with headings, trails, the ego's route, lights."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import numpy.typing as npt
from matplotlib.artist import Artist
from matplotlib.collections import LineCollection, PolyCollection
from matplotlib.colors import to_rgba
from matplotlib.lines import Line2D

from scenarionet_data.geometry import box_corners
from scenarionet_data.vocabulary import LIGHT_COLORS, LightColor
from scenarionet_sim.render.moment import Moment
from scenarionet_sim.render.palette import EGO, INK, LIGHTS, ROUTE, WHITE, object_color
from scenarionet_sim.worlds.world import World

Points = npt.NDArray[np.float64]

_LEAST = 0.8
"""Shortest side of a drawn box [m]: pedestrians and cones would hardly be seen."""


def moving(world: World, moments: Sequence[Moment], points_per_metre: float) -> list[Artist]:
    """Everything of this file, for the last of the moments."""
    now = moments[-1]
    artists = route(world, points_per_metre) + trails(world, moments, points_per_metre)
    return artists + boxes(world, now, points_per_metre) + lights(world, now.timestep, points_per_metre)


def route(world: World, points_per_metre: float) -> list[Artist]:
    """The way the ego's recording drives, as a band under everything that moves."""
    first, end = world.paths.path_offsets[world.ego : world.ego + 2]
    points = world.paths.path_points[first:end]
    width = ROUTE * points_per_metre
    return [Line2D(*points.T, color=EGO, alpha=0.35, linewidth=width, solid_capstyle="round", zorder=5)]


def trails(world: World, past: Sequence[Moment], points_per_metre: float) -> list[Artist]:
    """Where objects have been, fading with time.

    Args:
        world: The world.
        past: Its moments up to now, the latest last.
        points_per_metre: How long a metre is on paper [1/72 inch].
    """
    if len(past) < 2:
        return []
    position = np.stack([moment.position for moment in past])
    present = np.stack([moment.present for moment in past])
    is_piece = present[1:] & present[:-1] & (np.hypot(*np.moveaxis(np.diff(position, axis=0), -1, 0)) > 0.01)
    step, row = np.nonzero(is_piece)
    colors = np.array([to_rgba(_color(world, n)) for n in range(world.num_objects)])[row]
    colors[:, 3] = 0.6 * (step + 1) / len(past)
    pieces = np.stack([position[step, row], position[step + 1, row]], axis=1)
    width = max(0.35 * points_per_metre, 0.8)
    return [LineCollection(list(pieces), colors=colors, linewidths=width, capstyle="butt", zorder=6)]


def boxes(world: World, moment: Moment, points_per_metre: float) -> list[Artist]:
    """Everything that is present as a box in its kind's colour, with a light arrow to its front; the ego on top."""
    artists: list[Artist] = []
    is_ego = np.arange(world.num_objects) == world.ego
    edge = min(max(0.12 * points_per_metre, 0.3), 1.0)
    for rows, order in ((np.flatnonzero(moment.present & ~is_ego), 7), (np.flatnonzero(moment.present & is_ego), 8)):
        length, width = np.maximum(world.size[rows, :2], _LEAST).T
        corners = box_corners(moment.position[rows], moment.heading[rows], length, width)
        colors = [_color(world, int(row)) for row in rows]
        artists.append(PolyCollection(list(corners), facecolor=colors, edgecolor=WHITE, linewidth=edge, zorder=order))
        arrows = list(_arrows(corners[length > 1.2]))
        artists.append(PolyCollection(arrows, facecolor=WHITE, alpha=0.75, linewidth=0, zorder=order))
    return artists


def _arrows(corners: Points) -> Points:
    """(N, 3, 2) triangles that fill the front third of boxes (N, 4, 2), corners from the front left."""
    front_left, back_left, back_right, front_right = np.moveaxis(corners, 1, 0)
    tip = (front_left + front_right) / 2
    ahead, side = tip - (back_left + back_right) / 2, front_left - front_right
    middle = tip - 0.35 * ahead
    return np.stack([tip - 0.08 * ahead, middle + 0.34 * side, middle - 0.34 * side], axis=1)


def lights(world: World, timestep: int, points_per_metre: float) -> list[Artist]:
    """Traffic lights at their stop points: a colour and a shape for what they show."""
    if not len(world.light_state):
        return []
    shown = LIGHT_COLORS[world.light_state[:, min(timestep, world.num_steps - 1)]]
    side = min(max(1.6 * points_per_metre, 3.5), 9.0)
    artists: list[Artist] = []
    for color, (fill, shape) in LIGHTS.items():
        x, y = world.light_stop[(shown == color) & ~np.isnan(world.light_stop[:, 0])].T
        artists.append(marker(x, y, fill, shape, side, zorder=9 if color != LightColor.UNKNOWN else 8.5))
    return artists


def marker(x: npt.ArrayLike, y: npt.ArrayLike, fill: str, shape: str, side: float, zorder: float = 9) -> Line2D:
    """Marks of one colour and shape at places, ``side`` points large."""
    return Line2D(
        np.asarray(x), np.asarray(y), linestyle="", marker=shape, markersize=side, markerfacecolor=fill,
        markeredgecolor=INK, markeredgewidth=0.6, zorder=zorder,
    )  # fmt: skip


def _color(world: World, row: int) -> str:
    return EGO if row == world.ego else object_color(int(world.object_type[row]))
