"""Annotations of a picture: scale bar, time, colour bar and legend."""

from __future__ import annotations

from typing import Literal

import numpy as np
from matplotlib.artist import Artist
from matplotlib.axes import Axes
from matplotlib.cm import ScalarMappable
from matplotlib.lines import Line2D
from matplotlib.patches import Patch
from matplotlib.patheffects import AbstractPathEffect, withStroke
from matplotlib.text import Text
from mpl_toolkits.axes_grid1.inset_locator import inset_axes

from scenarionet_data.plots.artists import Marks
from scenarionet_data.plots.palette import EGO, INK, LIGHTS, NAMES, OTHER, ROUTE, WHITE, object_color
from scenarionet_data.plots.scene import Moment, Scene
from scenarionet_data.scenario.vocabulary import LIGHT_COLORS, LightColor, ObjectType

_HALO: list[AbstractPathEffect] = [withStroke(linewidth=2.5, foreground=WHITE)]
_LIGHT_NAMES = {
    LightColor.RED: "red light",
    LightColor.YELLOW: "yellow light",
    LightColor.GREEN: "green light",
    LightColor.UNKNOWN: "light, state unknown",
}
_BARS = (5, 10, 20, 50, 100, 200, 500, 1000)  # [m]


def scale_bar(axes: Axes) -> list[Artist]:
    """Scale bar of a round length in the lower left corner, at most a fifth of the picture wide."""
    (left, right), (bottom, top) = axes.get_xlim(), axes.get_ylim()
    length = max((bar for bar in _BARS if bar <= 0.2 * (right - left)), default=_BARS[0])
    margin = 0.03 * min(right - left, top - bottom)
    x, y = left + margin, bottom + margin
    bar = Line2D([x, x + length], [y, y], color=INK, linewidth=2, solid_capstyle="butt", zorder=20)
    bar.set_path_effects(_HALO)
    return [bar, _text(x, y + 0.4 * margin, f"{length} m", "bottom", axes)]


def time(axes: Axes, seconds: float) -> list[Artist]:
    """Time since the start of the recording, in the upper left corner."""
    (left, right), (bottom, top) = axes.get_xlim(), axes.get_ylim()
    margin = 0.03 * min(right - left, top - bottom)
    return [_text(left + margin, top - margin, f"{seconds:.1f} s", "top", axes)]


def _text(x: float, y: float, words: str, anchor: Literal["bottom", "top"], axes: Axes) -> Text:
    return Text(
        x, y, words, color=INK, fontsize=9, verticalalignment=anchor, zorder=20, path_effects=_HALO,
        transform=axes.transData,
    )  # fmt: skip


def color_bar(axes: Axes, mappable: ScalarMappable, words: str) -> None:
    """Add a colour bar with a label in the upper right corner."""
    plate = inset_axes(axes, width="34%", height=0.45, loc="upper right", borderpad=0.4)
    plate.set(xticks=[], yticks=[], facecolor=(1.0, 1.0, 1.0, 0.85), zorder=20)
    plate.spines[:].set_visible(False)
    place = plate.inset_axes((0.06, 0.72, 0.88, 0.18))
    bar = axes.figure.colorbar(mappable, cax=place, orientation="horizontal")
    bar.set_label(words, fontsize=8, labelpad=1)
    bar.outline.set_visible(False)
    place.tick_params(labelsize=7, length=2, pad=1)
    place.grid(visible=False)


def legend(axes: Axes, scene: Scene, moment: Moment) -> None:
    """Add a legend of the visible colours in the lower right corner."""
    band = Line2D([], [], color=EGO, alpha=0.35, linewidth=5 * ROUTE, solid_capstyle="butt", label="its route")
    handles: list[Artist] = [Patch(color=EGO, label="ego"), band]
    present = moment.present.copy()
    present[scene.ego] = False
    types = {ObjectType(code) for code in scene.object_type[present]}
    handles += [Patch(color=object_color(kind), label=name) for kind, name in NAMES.items() if kind in types]
    if types - NAMES.keys():
        handles.append(Patch(color=OTHER, label="object"))
    shown = LIGHT_COLORS[scene.lights_at(moment.timestep)]
    is_placed = ~np.isnan(scene.light_stop[:, 0])
    for color in (LightColor.RED, LightColor.YELLOW, LightColor.GREEN, LightColor.UNKNOWN):
        if (is_placed & (shown == color)).any():
            handles.append(Marks([], *LIGHTS[color], INK, least=6, label=_LIGHT_NAMES[color]))
    box = axes.legend(handles=handles, loc="lower right", fontsize=8, framealpha=0.9, edgecolor="none", borderpad=0.6)
    box.set_zorder(20)
