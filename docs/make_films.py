"""Make the films of the documentation: ``python docs/make_films.py``.

All scenes are generated; films are animated WebP files in ``docs/films``.
"""

from __future__ import annotations

import sys
from collections.abc import Iterable, Iterator
from pathlib import Path

import numpy as np
from make_camera_pictures import generated
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from PIL import Image, ImageDraw, ImageFont

from scenarionet_data.arrays.dtypes import Float64, UInt8
from scenarionet_data.plots import Scene, TopDown, Window
from scenarionet_data.plots.drawing import until
from scenarionet_data.plots.palette import EGO, INK
from scenarionet_data.scenario.description import ScenarioDescription
from scenarionet_sim import World
from scenarionet_sim.cameras.weather import DAY, DUSK, OVERCAST, RAIN, Weather
from scenarionet_sim.render.space import Film, recorded_moments

FOLDER = Path(__file__).parent / "films"
RATE = 10
"""Frames per second; scenarios have ten timesteps per second."""

HEIGHT, CAMERA, ABOVE, CURVE, CAPTION = 270, 480, 270, 210, 22
"""Height and widths of the three parts of a frame, and the height of their captions [pixel]."""


def speed_curve(speeds: Float64, step: int) -> UInt8:
    """Draw speeds [m/s] over time up to a timestep."""
    figure = Figure(figsize=(CURVE / 100, HEIGHT / 100), dpi=100)
    canvas = FigureCanvasAgg(figure)
    axes = figure.add_axes((0.17, 0.12, 0.78, 0.84))
    time = np.arange(len(speeds)) / RATE
    axes.plot(time, speeds, color="#d8dde2", linewidth=1.5)
    axes.plot(time[: step + 1], speeds[: step + 1], color=EGO, linewidth=2)
    axes.plot(time[step], speeds[step], "o", color=EGO, markersize=6)
    axes.set(xlim=(0, time[-1]), ylim=(0, 5 * np.ceil(speeds.max() / 5 + 0.1)))
    axes.tick_params(labelsize=7, colors=INK, length=2)
    axes.spines[["top", "right"]].set_visible(False)
    canvas.draw()
    return np.asarray(canvas.buffer_rgba())[..., :3].copy()


def captions(*parts: tuple[str, int]) -> UInt8:
    """Draw a row of captions, each of a width [pixel]."""
    row = Image.new("RGB", (sum(width for _, width in parts), CAPTION), "#ffffff")
    left = 0
    for text, width in parts:
        ImageDraw.Draw(row).text((left + 8, 4), text, INK, ImageFont.load_default(13))
        left += width
    return np.asarray(row)


def side_by_side(scenario: ScenarioDescription, view: str, first: int, last: int) -> Iterator[UInt8]:
    """Yield what a camera sees, the view from above and the speed of the ego, for some timesteps."""
    world, scene = World.from_scenario(scenario), Scene.of(scenario)
    moments, above = scene.moments(), TopDown(scene, Window(0.0, 0.0, 70.0, 70.0), ABOVE)
    seen = Film(view, CAMERA, HEIGHT, supersampling=3).frames(world, moments[first : last + 1])
    speeds = scene.speed[first:last, scene.ego].astype(np.float64)
    text = captions(("camera", CAMERA), ("from above", ABOVE), ("speed [m/s]", CURVE))
    for step, picture in zip(range(first, last), seen, strict=False):
        parts = picture, above.frame(until(moments, step)), speed_curve(speeds, step - first)
        yield np.concatenate([text, np.concatenate(parts, axis=1)])


def driven(scenario: ScenarioDescription, view: str, first: int, last: int, weather: Weather = DAY) -> Iterator[UInt8]:
    """Yield a view in space of some timesteps."""
    world = World.from_scenario(scenario)
    film = Film(view, 560, 316, weather, supersampling=3)
    yield from film.frames(world, recorded_moments(world)[first:last])


def films() -> dict[str, Iterator[UInt8]]:
    """Return the frames of all films by name."""
    turning = generated(
        16, blocks="intersection=1", lights=1.0, num_blocks=1, max_lanes=2, construction=0.0, density=1.0
    )
    highway = generated(
        7, blocks="straight=1 curve=1", min_lanes=3, max_lanes=4, density=2.5, oncoming=2.0, construction=0.0
    )
    roundabout = generated(4, blocks="roundabout=1", num_blocks=1, construction=0.0, density=3.0)
    weathers = (DAY, OVERCAST, RAIN, DUSK)
    return {
        "overview": chained(side_by_side(turning, "chase", 20, 65), side_by_side(highway, "chase", 30, 70)),
        "junction": driven(turning, "camera", 15, 70),
        "roundabout": driven(roundabout, "orbit", 50, 110),
        "weather": chained(*(driven(highway, "chase", 20 * k, 20 * k + 18, weathers[k]) for k in range(4))),
    }


def chained(*parts: Iterable[UInt8]) -> Iterator[UInt8]:
    """Yield the frames of all parts."""
    for part in parts:
        yield from part


def write(path: Path, frames: Iterable[UInt8], quality: int) -> None:
    """Write an animated WebP file that repeats without end."""
    first, *others = (Image.fromarray(frame) for frame in frames)
    first.save(
        path, save_all=True, append_images=others, duration=1000 // RATE, loop=0, quality=quality, method=4, kmin=0
    )


if __name__ == "__main__":
    target = Path(sys.argv[1]) if len(sys.argv) > 1 else FOLDER
    target.mkdir(exist_ok=True)
    for name, frames in films().items():
        write(target / f"{name}.webp", frames, quality=45)
