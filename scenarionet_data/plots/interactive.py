"""A scenario to explore: zoom, pan, a slider over time, and what things are under the pointer. Needs plotly."""

from __future__ import annotations

from html import escape
from typing import TYPE_CHECKING, Any

import numpy as np

from scenarionet_data.arrays.dtypes import Array, Float64
from scenarionet_data.arrays.geometry import box_corners
from scenarionet_data.arrays.ragged import Ragged
from scenarionet_data.errors import MissingDependency
from scenarionet_data.plots.map_layer import painted, stripes
from scenarionet_data.plots.object_layer import heading_arrows
from scenarionet_data.plots.palette import EDGE, EGO, GROUND, INK, LIGHTS, NAMES, OBJECTS, OTHER, ROAD, WHITE, YELLOW
from scenarionet_data.plots.scene import Scene
from scenarionet_data.scenario.description import MapFeatures, ScenarioDescription
from scenarionet_data.scenario.vocabulary import (
    AREAS_TO_DRIVE_ON,
    LIGHT_COLORS,
    LightColor,
    LightState,
    MapFeatureType,
    ObjectType,
    is_lane,
    is_road_edge,
)

if TYPE_CHECKING:
    from plotly.graph_objects import Figure

_MOST_FRAMES = 60
"""Of the slider; longer scenarios are shown at every second, third, ... timestep."""

_SYMBOLS = {"s": "square", "^": "triangle-up", "o": "circle", "D": "diamond"}
"""plotly's words for matplotlib's shapes."""

_MOST_CORNERS = 60
"""Points of an outline or a line; a map in the page is text."""


def explore(scenario: ScenarioDescription, height: int = 600) -> Figure:
    """A scenario as an interactive figure.

    Args:
        scenario: What is drawn.
        height: [pixel].

    Returns:
        plotly's figure: a notebook shows it, ``write_html`` makes a page of it.

    Raises:
        MissingDependency: plotly is not installed.
    """
    try:
        from plotly import graph_objects
    except ImportError as error:
        raise MissingDependency("interactive views need plotly; install scenarionet-lake[notebooks]") from error
    scene = Scene.of(scenario)
    stride = -(-scene.num_steps // _MOST_FRAMES)
    steps = np.arange(0, scene.num_steps, stride)
    still = _map_traces(scene, scenario.map)
    moving = [_object_traces(scene, int(step)) for step in steps]
    first = int(np.abs(steps - scene.current_timestep).argmin())
    places = list(range(len(still), len(still) + len(moving[first])))
    return graph_objects.Figure(
        data=[*still, *moving[first]],
        frames=[
            {"name": f"{step * scene.dt:.1f}", "data": traces, "traces": places}
            for step, traces in zip(steps, moving, strict=True)
        ],
        layout=_layout(scene, [f"{step * scene.dt:.1f}" for step in steps], first, stride, height),
    )


def _map_traces(scene: Scene, features: MapFeatures | None) -> list[dict[str, Any]]:
    shapes = scene.map
    is_road = is_lane(shapes.area_type) | np.isin(shapes.area_type, AREAS_TO_DRIVE_ON)
    is_edge = is_road_edge(shapes.line_type)
    white, yellow = painted(shapes)
    traces = [
        _areas("road", shapes.areas.take(np.flatnonzero(is_road)), ROAD),
        _areas("crosswalks", stripes(shapes), WHITE),
        _lines("white lines", white, WHITE),
        _lines("yellow lines", yellow, YELLOW),
        _lines("edges", shapes.lines.take(np.flatnonzero(is_edge)), EDGE),
    ]
    return [trace for trace in traces if trace["x"]] + _lane_marks(features)


def _lane_marks(features: MapFeatures | None) -> list[dict[str, Any]]:
    """A small mark in the middle of every lane, which says what it is."""
    if features is None:
        return []
    lanes = features.polyline
    rows = np.flatnonzero(is_lane(features.types) & (lanes.lengths > 0))
    middle = lanes.values[(lanes.offsets[rows] + lanes.offsets[rows + 1]) // 2, :2]
    words = [
        f"lane {escape(features.ids[row])}<br>{MapFeatureType(features.types[row]).name}"
        + (f"<br>{3.6 * features.speed_limit[row]:.0f} km/h" if np.isfinite(features.speed_limit[row]) else "")
        for row in rows
    ]
    x, y = _rounded(middle).T.tolist()
    return [
        {
            "type": "scatter", "mode": "markers", "name": "lanes", "x": x, "y": y, "hovertext": words,
            "hoverinfo": "text", "marker": {"size": 5, "color": EDGE, "opacity": 0.35},
        }
    ]  # fmt: skip


def _object_traces(scene: Scene, timestep: int) -> list[dict[str, Any]]:
    """A trace a kind, of boxes and of what they say, always the same kinds."""
    moment = scene.moment(timestep)
    is_ego = np.arange(scene.num_objects) == scene.ego
    kinds = [("ego", is_ego, EGO)]
    kinds += [(NAMES[kind], ~is_ego & (scene.object_type == kind), OBJECTS[kind]) for kind in NAMES]
    is_named = np.isin(scene.object_type, [int(kind) for kind in NAMES])
    kinds.append(("object", ~is_ego & ~is_named, OTHER))
    traces = []
    for name, is_kind, color in kinds:
        if not (is_kind[None] & scene.present).any():
            continue
        rows = np.flatnonzero(is_kind & moment.present)
        length, width = np.maximum(scene.size[rows, :2], 0.8).T
        corners = box_corners(moment.position[rows], moment.heading[rows], length, width)
        words = [
            f"{escape(str(scene.track_ids[row]))}<br>{ObjectType(scene.object_type[row]).name}"
            f"<br>{scene.speed[timestep, row]:.1f} m/s"
            for row in rows
        ]
        x, y = _rounded(moment.position[rows]).T.tolist()
        boxes = Ragged.from_flat(np.full(len(rows), 4), corners.reshape(-1, 2))
        arrows = Ragged.from_flat(np.full(len(rows), 3), heading_arrows(corners).reshape(-1, 2))
        marks = {"type": "scatter", "mode": "markers", "x": x, "y": y, "hovertext": words, "hoverinfo": "text"}
        traces.append(_areas(name, boxes, color) | {"showlegend": True, "legendgroup": name})
        traces.append(
            marks | {"name": name, "showlegend": False, "legendgroup": name, "marker": {"size": 8, "color": color}}
        )
        traces.append(_areas(name, arrows, WHITE) | {"legendgroup": name})
    return [*traces, *_light_traces(scene, timestep)]


def _light_traces(scene: Scene, timestep: int) -> list[dict[str, Any]]:
    """A mark at every light's stop point, its colour and shape what it shows; it says the state."""
    rows = np.flatnonzero(~np.isnan(scene.light_stop[:, 0]))
    if not len(rows):
        return []
    states = scene.lights_at(timestep)[rows]
    fills, shapes = zip(*(LIGHTS[LightColor(color)] for color in LIGHT_COLORS[states]), strict=True)
    x, y = _rounded(scene.light_stop[rows]).T.tolist()
    marker = {"size": 9, "color": fills, "symbol": [_SYMBOLS[shape] for shape in shapes]}
    return [
        {
            "type": "scatter", "mode": "markers", "name": "lights", "x": x, "y": y, "hoverinfo": "text",
            "hovertext": [f"light: {LightState(state).name}" for state in states],
            "marker": marker | {"line": {"width": 1, "color": INK}},
        }
    ]  # fmt: skip


def _areas(name: str, outlines: Ragged, color: str) -> dict[str, Any]:
    x, y = _apart(outlines, is_closed=True)
    return {
        "type": "scatter", "mode": "lines", "fill": "toself", "fillcolor": color, "name": name, "x": x, "y": y,
        "line": {"width": 0.5, "color": color}, "hoverinfo": "skip", "showlegend": False,
    }  # fmt: skip


def _lines(name: str, lines: Ragged, color: str) -> dict[str, Any]:
    x, y = _apart(lines, is_closed=False)
    return {
        "type": "scatter", "mode": "lines", "name": name, "x": x, "y": y, "line": {"width": 1, "color": color},
        "hoverinfo": "skip", "showlegend": False,
    }  # fmt: skip


def _apart(lines: Ragged, *, is_closed: bool) -> tuple[list[float | None], list[float | None]]:
    """X and y of all lines one after the other, None between them."""
    x: list[float | None] = []
    y: list[float | None] = []
    for line in lines:
        if not len(line):
            continue
        kept = line[np.unique(np.linspace(0, len(line) - 1, min(len(line), _MOST_CORNERS)).round().astype(int))]
        points = _rounded(np.concatenate([kept, kept[:1]]) if is_closed else kept)
        x += [*points[:, 0].tolist(), None]
        y += [*points[:, 1].tolist(), None]
    return x, y


def _rounded(points: Array) -> Float64:
    return np.asarray(points, np.float64).reshape(-1, 2).round(2)


def _buttons(seconds: float) -> dict[str, Any]:
    """Play at the recorded speed, and pause."""
    timing = {"duration": round(1000 * seconds), "redraw": True}
    play = {"frame": timing, "fromcurrent": True, "transition": {"duration": 0}}
    pause = {"frame": {"duration": 0, "redraw": False}, "mode": "immediate"}
    return {
        "type": "buttons", "direction": "left", "x": 1.0, "xanchor": "right", "y": 1.0, "yanchor": "bottom",
        "pad": {"b": 4},
        "buttons": [
            {"label": "play", "method": "animate", "args": [None, play]},
            {"label": "pause", "method": "animate", "args": [[None], pause]},
        ],
    }  # fmt: skip


def _layout(scene: Scene, times: list[str], first: int, stride: int, height: int) -> dict[str, Any]:
    def steps() -> list[dict[str, Any]]:
        still = {"mode": "immediate", "frame": {"duration": 0, "redraw": True}, "transition": {"duration": 0}}
        return [{"label": time, "method": "animate", "args": [[time], still]} for time in times]

    spread = np.concatenate([scene.route, scene.route]) if len(scene.route) else np.zeros((1, 2))
    (left, bottom), (right, top) = spread.min(axis=0) - 40.0, spread.max(axis=0) + 40.0
    axis = {"showgrid": False, "zeroline": False, "ticksuffix": " m"}
    return {
        "height": height,
        "title": {"text": escape(scene.scenario_id), "font": {"size": 14}},
        "plot_bgcolor": GROUND,
        "font": {"color": INK},
        "margin": {"l": 50, "r": 10, "t": 40, "b": 30},
        "dragmode": "pan",
        "hovermode": "closest",
        "xaxis": axis | {"range": [float(left), float(right)]},
        "yaxis": axis | {"range": [float(bottom), float(top)], "scaleanchor": "x"},
        "updatemenus": [_buttons(scene.dt * stride)],
        "sliders": [{"active": first, "currentvalue": {"prefix": "time ", "suffix": " s"}, "steps": steps()}],
    }
