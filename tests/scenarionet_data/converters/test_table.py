"""Tables of your own: the same as converters of known datasets, units and frames, and the usual dirt, which is said."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pyarrow as pa
import pyarrow.csv
import pyarrow.parquet as pq
import pytest

from scenarionet_data import Lake, convert
from scenarionet_data.building.projection import to_utm
from scenarionet_data.converters.argoverse1 import Argoverse1
from scenarionet_data.converters.interaction import Interaction
from scenarionet_data.converters.table import TrackTable
from scenarionet_data.errors import BadParameter, CorruptSource, SourceNotFound
from scenarionet_data.scenario.vocabulary import ObjectType
from scenarionet_data.testing import ConverterConformance, differences
from tests.fixtures import argoverse1, interaction
from tests.fixtures.examples import blocks
from tests.fixtures.reading import scenarios
from tests.scenarionet_data.converters.formats import test_opendrive as opendrive

CONVERTER = TrackTable()
NAMES = ("track", "time", "type", "x", "y", "vx", "vy", "heading", "length", "width")
_, INTERACTION, ARGOVERSE = blocks("docs/guides/tables.md", "toml")


def rows_of_two(num_steps: int = 60) -> dict[str, list]:
    """A car that drives along x at 10 m/s, and a van along y at 5 m/s, every 0.1 s."""
    rows = {name: [] for name in NAMES}
    for step in range(num_steps):
        for values in (
            ("a", step / 10, "car", float(step), 2.0, 10.0, 0.0, 0.0, 4.5, 1.8),
            ("b", step / 10, "van", 30.0, 0.5 * step, 0.0, 5.0, np.pi / 2, 5.5, 2.0),
        ):
            for name, value in zip(NAMES, values, strict=True):
                rows[name].append(value)
    return rows


def write(folder: Path, rows: dict[str, list], name: str = "tracks.csv") -> Path:
    folder.mkdir(exist_ok=True, parents=True)
    table = pa.table(rows)
    if name.endswith(".parquet"):
        pq.write_table(table, folder / name)
    else:
        pyarrow.csv.write_csv(table, folder / name)
    return folder / name


def road_map(folder: Path, **changes) -> Path:
    """Two lanes along x, the second follows the first; a line, a crosswalk."""
    lane = {"type": "lane", "width": 4, "speed_limit": 13.9}
    features = [
        ("1", "LineString", [[-10, 2], [30, 2]], {**lane, "exit_lanes": [2]}),
        ("2", "LineString", [[30, 2], [70, 2]], {**lane, **changes}),
        ("3", "LineString", [[-10, 0, 0.0], [70, 0, 0.0]], {"type": "ROAD_LINE_SOLID_SINGLE_WHITE"}),
        ("4", "Polygon", [[[20, 0], [24, 0], [24, 4], [20, 4], [20, 0]]], {"type": "crosswalk"}),
    ]
    path = folder / "map.geojson"
    path.write_text(
        json.dumps(
            {
                "type": "FeatureCollection",
                "features": [
                    {"type": "Feature", "id": key, "properties": told,
                     "geometry": {"type": shape, "coordinates": points}}
                    for key, shape, points, told in features
                ],
            }
        )
    )  # fmt: skip
    return path


def columns(folder: Path, text: str) -> str:
    path = folder / "columns.toml"
    path.write_text(text)
    return str(path)


class TestTables(ConverterConformance):
    converter = CONVERTER
    damaged_glob = "*.csv"

    @pytest.fixture(scope="class")
    @classmethod
    def raw(cls, tmp_path_factory: pytest.TempPathFactory) -> Path:
        folder = tmp_path_factory.mktemp("raw")
        cls.options = {"map": str(road_map(tmp_path_factory.mktemp("map"))), "window": 3.0}
        write(folder, rows_of_two())
        write(folder, rows_of_two(200), "more.parquet")
        return folder

    def test_damaged_files_are_named(self, raw: Path, tmp_path_factory: pytest.TempPathFactory) -> None:
        """A CSV file cut in its rows is a shorter recording; without a usable row it is refused."""
        for name, data in (("t.csv", b""), ("t.csv", bytes(range(251)) * 9), ("t.parquet", b"PAR1")):
            path = tmp_path_factory.mktemp("damaged") / name
            path.write_bytes(data)
            with pytest.raises(CorruptSource):
                scenarios(CONVERTER, path)


# --- the worked examples --------------------------------------------------------------------------------


def test_interaction_as_a_table_equals_its_converter(tmp_path: Path) -> None:
    interaction.write_map(tmp_path)
    interaction.write_recording(tmp_path)
    expected = scenarios(Interaction(), tmp_path)
    found = scenarios(
        CONVERTER,
        next(tmp_path.rglob("*.csv")),
        map=str(next(tmp_path.rglob("*.osm"))),
        columns=columns(tmp_path, INTERACTION),
    )
    assert len(found) == len(expected) == 2
    different = {name.partition("[")[0] for pair in zip(found, expected, strict=True) for name in differences(*pair)}
    told = {"id", "dataset", "version", "source.scenario_id", "source.file", "source.licence", "source.log"}
    assert different == {f"scenario.{name}" for name in (*told, "source.city", "source.crs")}


def test_argoverse_as_a_table_equals_its_converter(tmp_path: Path) -> None:
    argoverse1.write_recordings(tmp_path / "train" / "data", num_files=2)
    expected = scenarios(Argoverse1(), tmp_path, has_map=False)
    ego = expected[0].ego_id
    told = {"columns": columns(tmp_path, ARGOVERSE), "ego": ego, "history": 1.9}
    found = scenarios(CONVERTER, tmp_path / "train", **told)
    assert len(found) == len(expected) == 2
    for one, other in zip(found, expected, strict=True):
        assert (one.ego_id, one.num_timesteps) == (other.ego_id, other.num_timesteps)
        assert [*one.tracks.ids] == [*other.tracks.ids]
        np.testing.assert_array_equal(one.timestamps, other.timestamps)
        for name in ("position", "velocity", "valid", "object_type", "source_type", "is_velocity_estimated"):
            assert np.array_equal(getattr(one.tracks, name), getattr(other.tracks, name)), name
        np.testing.assert_array_equal(one.tracks.heading, other.tracks.heading)


# --- units, frames, formats -----------------------------------------------------------------------------


def test_units_come_to_metres_and_radians(tmp_path: Path) -> None:
    rows, told = rows_of_two(), ""
    plain = scenarios(CONVERTER, write(tmp_path / "plain", rows))[0]
    for name, unit, factor in (
        ("time", "ms", 1e-3), ("x", "ft", 0.3048), ("y", "ft", 0.3048), ("vx", "km/h", 1 / 3.6), ("vy", "mph", 0.44704),
        ("length", "cm", 0.01), ("width", "in", 0.0254),
    ):  # fmt: skip
        rows[name] = [value / factor for value in rows[name]]
        told += f'{name} = {{column = "{name}", unit = "{unit}"}}\n'
    rows["heading"] = [90.0 - np.degrees(value) for value in rows["heading"]]
    told += 'heading = {column = "heading", unit = "compass"}\ntrack = "track"\ntype = "type"\n'
    found = scenarios(
        CONVERTER, write(tmp_path / "units", rows, "t.parquet"), columns=columns(tmp_path, "[columns]\n" + told)
    )
    for name in ("position", "velocity", "heading", "size"):
        np.testing.assert_allclose(getattr(found[0].tracks, name), getattr(plain.tracks, name), atol=1e-3)
    np.testing.assert_allclose(found[0].timestamps, plain.timestamps, atol=1e-6)


def test_degrees_become_metres_of_the_grid(tmp_path: Path) -> None:
    rows = rows_of_two()
    latitude, longitude = 50.0 + np.array(rows["y"]) / 111_229.0, 6.0 + np.array(rows["x"]) / 71_695.0
    expected = to_utm(latitude, longitude, 32) - to_utm(np.array([50.0]), np.array([6.0]), 32)
    rows["x"], rows["y"] = longitude.tolist(), latitude.tolist()
    told = "\n".join(f'{name} = "{name}"' for name in NAMES if name not in "xy")
    told += '\nx = {column = "x", unit = "deg"}\ny = {column = "y", unit = "deg"}\n'
    where = columns(tmp_path, f"[columns]\n{told}[frame]\norigin = [50.0, 6.0]\n")
    (scenario,) = scenarios(CONVERTER, write(tmp_path / "raw", rows), columns=where)
    places = scenario.tracks.position + scenario.origin
    np.testing.assert_allclose(places[0, :, :2], expected[::2], atol=1e-3)
    np.testing.assert_allclose(places[0, [0, -1], 0], [0, 59], atol=0.2)  # the grid is turned by 2.3 degrees here
    with pytest.raises(BadParameter, match=r"frame\.origin"):
        scenarios(CONVERTER, tmp_path / "raw" / "tracks.csv", columns=columns(tmp_path, f"[columns]\n{told}"))


def test_map_has_its_links_both_ways(tmp_path: Path) -> None:
    (scenario,) = scenarios(CONVERTER, write(tmp_path, rows_of_two()), map=str(road_map(tmp_path, left_neighbors=[9])))
    features = scenario.map
    assert [*features.ids] == ["1", "2", "3", "4"]
    assert list(features.exit_lanes[0]) == ["2"] and list(features.entry_lanes[1]) == ["1"]
    assert list(features.left_neighbors[1]) == ["9"]
    np.testing.assert_allclose(features.width[0], 2.0)
    np.testing.assert_allclose(features.polyline[1][:, :2] + scenario.origin[:2], [[30, 2], [70, 2]], atol=1e-3)
    assert len(features.polygon[3]) == 5 and features.speed_limit[0] == pytest.approx(13.9)


def test_map_as_opendrive(tmp_path: Path) -> None:
    path = opendrive.write(tmp_path, opendrive.road(x=-10.0))
    (scenario,) = scenarios(CONVERTER, write(tmp_path, rows_of_two()), map=str(path))
    assert [*scenario.map.ids] == ["1_0_1", "1_0_-1"]


def test_types_sizes_and_motion_are_assumed_and_flagged(tmp_path: Path) -> None:
    rows = rows_of_two()
    rows["type"] = ["Tram" if word == "van" else word for word in rows["type"]]
    for name in ("vx", "vy", "heading", "length", "width"):
        del rows[name]
    path = write(tmp_path, rows)
    (scenario,) = scenarios(CONVERTER, path)
    tracks = scenario.tracks
    assert [*tracks.object_type] == [ObjectType.VEHICLE, ObjectType.OTHER]
    assert [*tracks.is_type_assumed] == [False, True] and tracks.is_size_assumed.all()
    assert tracks.is_velocity_estimated.all()
    np.testing.assert_allclose(tracks.velocity[1, 30], [0.0, 5.0], atol=1e-3)
    np.testing.assert_allclose(tracks.heading[:, 30], [0.0, np.pi / 2], atol=1e-3)
    listed = "\n".join(f'{name} = "{name}"' for name in ("track", "time", "type", "x", "y"))
    told = f'[columns]\n{listed}\n[types]\ntram = "vehicle"\n[sizes]\ntram = [30.0, 2.6, 3.4]\n'
    (scenario,) = scenarios(CONVERTER, path, columns=columns(tmp_path, told))
    np.testing.assert_allclose(scenario.tracks.size[1, 0], [30.0, 2.6, 3.4])
    assert scenario.tracks.object_type[1] == ObjectType.VEHICLE and not scenario.tracks.is_type_assumed.any()


# --- dirt -----------------------------------------------------------------------------------------------


def dropped(scenario) -> dict[str, int]:
    return {each.field: each.count for each in scenario.defects if each.action == "dropped"}


def test_rows_that_cannot_be_used_are_dropped_and_told(tmp_path: Path) -> None:
    path = write(tmp_path, rows_of_two())
    (whole,) = scenarios(CONVERTER, path)
    lines = path.read_text().splitlines()
    cells = [line.split(",") for line in lines]
    cells[3][3] = '"about 2"'  # a at 0.1 s
    cells[5][3] = "nan"  # a at 0.2 s
    cells[7][1] = "noon"  # a at 0.3 s
    cells[9] = cells[9][:4]  # a at 0.4 s
    cells.append(cells[11])  # a at 0.5 s, twice
    del cells[13]  # a at 0.6 s
    rows = [cells[0], *cells[:0:-1]]  # times in reverse
    path.write_text("\n".join(",".join(row) for row in rows))
    (found,) = scenarios(CONVERTER, path)
    assert dropped(found) == {"row": 1, "time": 1, "position": 2, "timestep": 1}
    gaps = [each for each in found.defects if each.action == "assumed"]
    assert [(each.field, each.location) for each in gaps] == [("time", "track a")]
    row = found.tracks.index("a")
    assert np.flatnonzero(~found.tracks.valid[row]).tolist() == [1, 2, 3, 4, 6]
    valid = found.tracks.valid[row]
    places = found.tracks.position[row, valid] + found.origin
    np.testing.assert_array_equal(places, (whole.tracks.position[0] + whole.origin)[valid])


@pytest.mark.parametrize(
    ("change", "said"),
    [
        ({"heading": np.degrees}, r'heading is .* degrees or more off .* degrees \(unit = "deg"\)'),
        ({"heading": lambda h: 90.0 - np.degrees(h) + 360.0}, "compass"),
        ({"x": lambda x: x / 0.3048, "y": lambda y: y / 0.3048}, "that of x and y ft"),
        ({"vx": lambda v: v * 3.6, "vy": lambda v: v * 3.6}, "is their unit km/h"),
        ({"length": lambda size: size / 0.3048, "width": lambda size: size / 0.3048}, "the unit of length ft"),
        ({"x": lambda x: x / 71_695.0, "y": lambda y: y / 111_229.0}, r"may be degrees \(unit"),
        ({"y": lambda y: -y}, "right or down"),
        ({"x": lambda x: x + 500_000.0, "y": lambda y: y + 5_600_000.0}, "beside the map, .* east and .* north"),
    ],
)
def test_contradictions_are_said_and_not_converted(tmp_path: Path, change, said: str) -> None:
    rows = rows_of_two()
    rows |= {name: [float(how(value)) for value in rows[name]] for name, how in change.items()}
    if "right" in said:  # both drive along y
        rows = {name: values[1::2] for name, values in rows.items()}
    path, told = write(tmp_path, rows), {"map": str(road_map(tmp_path))}
    with pytest.raises(CorruptSource, match=said):
        scenarios(CONVERTER, path, **told)
    assert scenarios(CONVERTER, path, trust=True, **told)


def test_swapped_axes_are_said(tmp_path: Path) -> None:
    rows = rows_of_two()
    rows["x"], rows["y"] = rows["y"], rows["x"]
    with pytest.raises(CorruptSource, match="x and y may be swapped"):
        scenarios(CONVERTER, write(tmp_path, rows), map=str(road_map(tmp_path)))


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("[columns]\ntrack = 'track'", "found no time"),
        ("[colums]\n", "did you mean 'columns'"),
        ("[columns]\nspeeed = 'v'", "did you mean 'speed'"),
        ("[columns]\ntrack='track'\ntime='time'\nx={column='x', unit='yards'}\ny='y'", "expected the unit m or cm"),
        ("[columns]\ntrack='track'\ntime='time'\nx={column='x', unit='deg'}\ny='y'", "both in degrees or neither"),
        ("[types]\ntram = 'TRAIN'", "expected one of UNSET, VEHICLE"),
        ("[sizes]\ncar = [4]", "expected 3 numbers"),
        ("[time]\nstep = 0", "seconds above 0"),
        ("[map]\nunit = 'km'", "expected m or deg"),
        ("columns = 3", "expected a table"),
        ("[columns", "cannot be read as TOML"),
    ],
)
def test_mistakes_in_columns_are_named(tmp_path: Path, text: str, said: str) -> None:
    with pytest.raises(BadParameter, match=said):
        scenarios(CONVERTER, write(tmp_path, rows_of_two()), columns=columns(tmp_path, text))


def test_what_is_missing_is_named(tmp_path: Path) -> None:
    path = write(tmp_path, rows_of_two())
    for raw, options in ((tmp_path / "no", {}), (path, {"map": "no.geojson"}), (path, {"columns": "no.toml"})):
        with pytest.raises(SourceNotFound):
            scenarios(CONVERTER, raw, **options)
    del (rows := rows_of_two())["x"]
    with pytest.raises(CorruptSource, match="found no x among track, time"):
        scenarios(CONVERTER, write(tmp_path, rows))


def test_a_table_with_a_map_becomes_a_lake(tmp_path: Path) -> None:
    path = write(tmp_path / "raw", rows_of_two())
    report = convert("table", path, tmp_path / "lake", options={"map": str(road_map(tmp_path))})
    assert (report.converted, report.failed) == (1, [])
    (scenario,) = Lake(tmp_path / "lake").loader()
    assert len(scenario.map) == 4 and scenario.map_id == "map"
