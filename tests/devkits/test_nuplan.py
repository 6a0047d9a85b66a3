"""The nuPlan converter agrees with what GDAL reads from the same ``map.gpkg``."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from pyproj import Transformer

from scenarionet_data.converters.nuplan.map_features import read_city
from scenarionet_data.scenario.description import MapFeatures
from tests.devkits.environments import read_with
from tests.fixtures import nuplan as fixture
from tests.fixtures import nuplan_drive as drives

pytestmark = pytest.mark.devkits
_UTM = Transformer.from_crs("epsg:4326", "epsg:32611", always_xy=True)


@pytest.fixture(scope="module", params=["invented", "recorded"])
def read(request: pytest.FixtureRequest, tmp_path_factory: pytest.TempPathFactory) -> tuple[MapFeatures, Any]:
    """A city's features in its UTM zone, with GDAL's reading of its file."""
    drive = drives.invented()
    if request.param == "recorded":
        folder = request.getfixturevalue("recordings") / "nuplan" / "recorded" / "262a4b7a1f2c5ab6"
        drive = drives.recorded(folder)
    raw = fixture.write_raw(tmp_path_factory.mktemp("nuplan"), [drive])
    (path,) = Path(raw).rglob("map.gpkg")
    origin = np.array([*drive.rear[0, :2].round(), 0.0])
    features = read_city(path, path.parent).features.build(origin, has_z=False)
    return (features, origin), read_with("readers", "nuplan_reads.py", path)


def _points(layer: Any, row: int) -> np.ndarray[Any, Any]:
    return np.column_stack(_UTM.transform(*np.array(layer["points"][row]).T))


def test_gdal_reads_the_layers_as_geographic(read: Any) -> None:
    _, layers = read
    assert layers["meta"]["kind"] is None
    assert {layers[name]["crs"] for name in ("lanes_polygons", "baseline_paths")} == {"EPSG:4326"}


def test_centrelines(read: Any) -> None:
    (features, origin), layers = read
    rows = {name: row for row, name in enumerate(features.ids)}
    paths = layers["baseline_paths"]
    assert paths["fids"]
    for row, (lane, connector) in enumerate(
        zip(paths["fields"]["lane_fid"], paths["fields"]["lane_connector_fid"], strict=True)
    ):
        name = str(int(float(connector if lane is None else lane)))
        line = features.polyline[rows[name]][:, :2] + origin[:2]
        np.testing.assert_allclose(line, _points(paths, row), atol=0.02)


@pytest.mark.parametrize("layer", ["lanes_polygons", "crosswalks", "walkways", "stop_polygons", "road_segments"])
def test_outlines(read: Any, layer: str) -> None:
    (features, origin), layers = read
    known = {tuple(np.round(area[:, :2].mean(axis=0) + origin[:2], 1)) for area in features.polygon if len(area)}
    assert layers[layer]["fids"]
    for row in range(len(layers[layer]["fids"])):
        x, y = _points(layers[layer], row)[:-1].mean(axis=0)
        assert any(abs(x - a) < 0.2 and abs(y - b) < 0.2 for a, b in known)
