"""Roads in the browser cover the same share of a picture as in ``render``."""

from __future__ import annotations

from dataclasses import replace
from itertools import islice
from urllib.parse import urlencode

import numpy as np
import pytest
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.colors import to_rgb
from matplotlib.figure import Figure

from scenarionet_data import Lake, ScenarioLoader
from scenarionet_data.building import MapBuilder
from scenarionet_data.conversion import convert
from scenarionet_data.plots.map_layer import map_artists
from scenarionet_data.plots.palette import GROUND, ROAD
from scenarionet_data.plots.shapes import MapShapes
from scenarionet_data.scenario.description import Lights
from scenarionet_data.scenario.vocabulary import MapFeatureType
from tests.fixtures import datasets
from tests.fixtures.lakes import write_lake
from tests.fixtures.pages import serving, visiting
from tests.fixtures.scenarios import make_scenario

pytestmark = pytest.mark.integration

SIDE, PIXELS = 160.0, 800
"""Side of the square that is compared [m], and of its picture [pixel]."""

_ROAD_SHARE = """async ([id, x, y, side, pixels, road, ground]) => {
  const { unpack } = await import("/static/scene.js");
  const { MapLayer } = await import("/static/map_layer.js");
  const { getBytes, getJson } = await import("/static/server.js");
  const { picture, snapshot } = await getJson("/api/about");
  const scene = unpack(await getBytes("/api/scene", { id, snapshot }));
  const layer = new MapLayer(scene, picture, { roads: true });
  const ratio = 1;
  layer.draw({ x, y, scale: pixels / side, width: pixels, height: pixels }, ratio);
  const { width, height } = layer.canvas;
  const context = layer.canvas.getContext("2d");
  const { data } = context.getImageData((width - pixels) / 2, (height - pixels) / 2, pixels, pixels);
  let count = 0;
  for (let k = 0; k < data.length; k += 4) {
    const apart = (color) => [0, 1, 2].reduce((sum, c) => sum + Math.abs(data[k + c] - color[c]), 0);
    if (apart(road) < apart(ground)) count += 1;
  }
  return count / (data.length / 4);
}"""

_COLORS = [np.array(to_rgb(color)) * 255 for color in (ROAD, GROUND)]


def place(scenario):
    """Return the position of the ego at the current timestep, or where it is first valid [m]."""
    tracks, ego = scenario.tracks, scenario.ego_index
    step = scenario.current_timestep
    step = step if tracks.valid[ego, step] else int(np.argmax(tracks.valid[ego]))
    return tracks.position[ego, step, :2].tolist()


def share_in_browser(page, scenario):
    x, y = place(scenario)
    return page.evaluate(_ROAD_SHARE, [scenario.id, x, y, SIDE, PIXELS, *(color.tolist() for color in _COLORS)])


def share_in_render(scenario):
    """Draw the road surfaces as ``render`` does."""
    figure = Figure(figsize=(PIXELS / 100, PIXELS / 100), dpi=100, facecolor=GROUND)
    canvas = FigureCanvasAgg(figure)
    axes = figure.add_axes((0.0, 0.0, 1.0, 1.0))
    axes.set_axis_off()
    x, y = place(scenario)
    axes.set(xlim=(x - SIDE / 2, x + SIDE / 2), ylim=(y - SIDE / 2, y + SIDE / 2))
    surfaces = map_artists(MapShapes.from_map(scenario.map))[0]
    surfaces.set_snap(False)  # the browser does not move edges to pixel borders either
    axes.add_artist(surfaces)
    canvas.draw()
    picture = np.asarray(canvas.buffer_rgba())[..., :3].astype(float)
    road, ground = (np.abs(picture - color).sum(axis=2) for color in _COLORS)
    return float((road < ground).mean())


def check_shares(browser, lake, most=3):
    """Compare the shares of the first scenarios; the tolerance is 2 % of the share in ``render``."""
    scenarios = list(islice(ScenarioLoader(lake), most))
    shares = {}
    with serving(lake) as address, visiting(browser, f"{address}/?{urlencode({'scenario': scenarios[0].id})}") as page:
        page.wait_for_selector("#player canvas")
        for scenario in scenarios:
            shares[scenario.id] = share_in_browser(page, scenario), share_in_render(scenario)
    assert max(wanted for _, wanted in shares.values()) > 0.01, "there are roads"
    assert shares == {name: (pytest.approx(wanted, rel=0.02), wanted) for name, (_, wanted) in shares.items()}


def test_overlapping_outlines_of_opposite_orientation_stay_road(browser, tmp_path):
    """Two equal squares, one clockwise and one counter-clockwise, and a third that overlaps half of them."""
    scenario = make_scenario(1)
    origin = np.array([*place(scenario), 0.0])
    square = np.array([[-30, -30, 0], [30, -30, 0], [30, 30, 0], [-30, 30, 0]], float)
    builder, lights = MapBuilder(), Lights.empty(scenario.num_timesteps)
    for name, outline in (("a", square), ("b", square[::-1]), ("c", square[::-1] + np.array([30, 0, 0]))):
        builder.add(name, MapFeatureType.DRIVABLE_AREA, polygon=origin + outline)
    lake = write_lake(tmp_path / "lake", [replace(scenario, map=builder.build(origin), lights=lights)])
    check_shares(browser, lake)
    assert share_in_render(ScenarioLoader(lake)[0]) == pytest.approx(90 * 60 / SIDE**2, rel=0.02)


@pytest.mark.long
@pytest.mark.parametrize("dataset", sorted(datasets.WRITERS))
def test_every_dataset_has_the_same_roads_as_render(browser, tmp_path, dataset):
    write, split = datasets.WRITERS[dataset]
    raw = str(write(tmp_path / "raw"))
    convert(dataset, raw, tmp_path / "lake", split=split, workers=1)
    check_shares(browser, Lake(tmp_path / "lake"))
