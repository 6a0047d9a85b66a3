"""Recorded scenarios of several datasets are drawn; no images are stored."""

from __future__ import annotations

import io
import os
from itertools import islice
from pathlib import Path

import numpy as np
import pytest
from matplotlib.colors import to_rgb
from PIL import Image

from scenarionet_data import converters, plots
from scenarionet_data.plots.palette import EGO, GROUND, ROAD

RECORDINGS = os.environ.get("SCENARIONET_TEST_DATA")
pytestmark = [
    pytest.mark.long,
    pytest.mark.skipif(not RECORDINGS, reason="real recordings: set SCENARIONET_TEST_DATA to their folder"),
]


def scenarios(dataset, place):
    """The first twelve."""
    converter = converters.get(dataset)
    raw = Path(RECORDINGS or "") / place
    if not raw.exists():
        pytest.skip(f"no {place} among the recordings")
    options = converter.Options(**({"has_map": False} if dataset == "argoverse1" else {}))  # a separate download
    shards = converter.shards(str(raw), "val", converter.release, options)
    records = ((shard, record) for shard in shards for record in converter.records(shard))
    return [converter.scenario(shard, record) for shard, record in islice(records, 12)]


def num_pixels(content, color):
    with Image.open(io.BytesIO(content)) as file:
        picture = np.asarray(file.convert("RGB")).astype(int)
    return int((np.abs(picture - np.array(to_rgb(color)) * 255).max(axis=2) <= 4).sum())


@pytest.mark.parametrize(
    ("dataset", "place", "has_map"),
    [
        ("waymo", "waymo/training", True),
        ("argoverse2", "argoverse2/motion-forecasting/val", True),
        ("argoverse1", "argoverse1/forecasting/train", False),
        ("scenarionet", "scenarionet", True),
    ],
)
def test_recordings_are_drawn(dataset, place, has_map):
    """Every thumbnail shows road, ground and the ego; every kind of figure is made of the first scenario."""
    found = scenarios(dataset, place)
    for scenario in found:
        content = plots.thumbnail(scenario)
        assert num_pixels(content, EGO) >= 8, scenario.id
        assert num_pixels(content, GROUND) > 100, scenario.id
        assert (num_pixels(content, ROAD) > 500) == has_map, scenario.id
    first = found[0]
    for color_by in (None, "time", "speed"):
        plots.scenario_figure(first, view="all", color_by=color_by).savefig(io.BytesIO())
    plots.draw_profiles(first).savefig(io.BytesIO())
    plots.small_multiples(found[:6]).savefig(io.BytesIO())
