"""OpenDRIVE as a map: shapes and lanes computed by hand, links, rules, and damage, which costs a road, not the map."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from scenarionet_data import Lake, convert
from scenarionet_data.converters.formats.map_files import read_map
from scenarionet_data.converters.formats.opendrive.reader import read_opendrive
from scenarionet_data.errors import CorruptSource, SourceNotFound
from scenarionet_data.interchange import writer_for
from scenarionet_data.interchange.base import Losses
from scenarionet_data.scenario.vocabulary import MapFeatureType, is_lane

LINE = "<line/>"
WIDTH = '<width sOffset="0" a="4" b="0" c="0" d="0"/>'


def lane(number: int, inner: str = WIDTH, kind: str = "driving", link: str = "", more: str = "") -> str:
    return f'<lane id="{number}" type="{kind}" {more}><link>{link}</link>{inner}</lane>'


def section(left: str = "", right: str = "", start: float = 0.0, center: str = "") -> str:
    middle = f'<center><lane id="0" type="none">{center}</lane></center>'
    return f'<laneSection s="{start}"><left>{left}</left>{middle}<right>{right}</right></laneSection>'


def road(
    name: str = "1", shape: str = LINE, sections: str = "", length: float = 100.0, x: float = 0.0, *,
    link: str = "", lanes: str = "", more: str = "", rule: str = "RHT", junction: str = "-1",
) -> str:  # fmt: skip
    return (
        f'<road id="{name}" length="{length}" junction="{junction}" rule="{rule}"><link>{link}</link><planView>'
        f'<geometry s="0" x="{x}" y="0" hdg="0" length="{length}">{shape}</geometry></planView>{more}'
        f"<lanes>{lanes}{sections or section(lane(1), lane(-1))}</lanes></road>"
    )


def write(folder: Path, *roads: str, more: str = "", doctype: str = "") -> Path:
    path = folder / "map.xodr"
    head = f'<?xml version="1.0"?>{doctype}<OpenDRIVE><header revMajor="1" revMinor="7"/>'
    path.write_text(f"{head}{''.join(roads)}{more}</OpenDRIVE>")
    return path


def features(path: Path):
    built = read_opendrive(path).build(np.zeros(3))
    return built, {name: row for row, name in enumerate(built.ids)}


# --- shapes -------------------------------------------------------------------------------------------------


def clothoid(s: np.ndarray, rate: float) -> np.ndarray:
    """Points of a curve whose curvature grows from 0, by a series of its integrals."""
    x = s - s**5 * rate**2 / 40 + s**9 * rate**4 / 3456
    y = s**3 * rate / 6 - s**7 * rate**3 / 336 + s**11 * rate**5 / 42240
    return np.stack([x, y], axis=1)


SHAPES = {
    LINE: lambda s: np.stack([s, 0 * s], axis=1),
    '<arc curvature="0.02"/>': lambda s: np.stack([50 * np.sin(s / 50), 50 - 50 * np.cos(s / 50)], axis=1),
    '<spiral curvStart="0" curvEnd="0.01"/>': lambda s: clothoid(s, 1e-4),
    '<paramPoly3 pRange="normalized" aU="0" bU="100" cU="0" dU="0" aV="0" bV="0" cV="0" dV="0"/>': lambda s: np.stack(
        [s, 0 * s], axis=1
    ),
    '<paramPoly3 pRange="arcLength" aU="0" bU="1" cU="0" dU="0" aV="0" bV="0" cV="0.001" dV="0"/>': None,
    '<poly3 a="0" b="0" c="0.001" d="0"/>': None,
}


@pytest.mark.parametrize("shape", SHAPES)
def test_reference_lines(tmp_path, shape):
    built, row = features(write(tmp_path, road(shape=shape, sections=section(right=lane(-1)))))
    left = built.polygon[row["1_0_-1"]][: len(built.polyline[row["1_0_-1"]])]
    if SHAPES[shape] is not None:
        expected = SHAPES[shape](np.linspace(0, 100, 2001))
    else:  # y = 0.001 x²
        expected = np.stack([x := np.linspace(0, 100, 2001), 0.001 * x**2], axis=1)
    away = np.hypot(*(left[:, None, :2] - expected).transpose(2, 0, 1)).min(axis=1)
    assert away.max() < 0.03
    line = built.polyline[row["1_0_-1"]]
    np.testing.assert_allclose(np.hypot(*(line - left)[:, :2].T), 2.0, atol=1e-3)


def test_widths_offsets_borders_heights_and_banks(tmp_path):
    taper = '<width sOffset="0" a="2" b="0.02" c="0" d="0"/>'
    border = '<border sOffset="0" a="-5" b="0" c="0" d="0"/>'
    more = '<elevationProfile><elevation s="0" a="1" b="0.1" c="0" d="0"/></elevationProfile>'
    more += '<lateralProfile><superelevation s="0" a="0.1" b="0" c="0" d="0"/></lateralProfile>'
    path = write(
        tmp_path,
        road("1", sections=section(right=lane(-1, taper) + lane(-2)), lanes='<laneOffset s="0" a="1"/>'),
        road("2", sections=section(right=lane(-1, border)), more=more, x=200.0),
    )  # fmt: skip
    built, row = features(path)
    np.testing.assert_allclose(built.polyline[row["1_0_-1"]][[0, -1], 1], [0.0, -1.0], atol=1e-3)
    np.testing.assert_allclose(built.polyline[row["1_0_-2"]][[0, -1], 1], [-3.0, -5.0], atol=1e-3)
    np.testing.assert_allclose(built.width[row["1_0_-1"]][[0, -1], 0], [1.0, 2.0], atol=1e-3)
    line = built.polyline[row["2_0_-1"]]
    np.testing.assert_allclose(line[[0, -1], 1], -2.5, atol=1e-3)
    np.testing.assert_allclose(line[[0, -1], 2], [1 - 2.5 * np.sin(0.1), 11 - 2.5 * np.sin(0.1)], atol=1e-3)


@pytest.mark.parametrize(("rule", "ahead"), [("RHT", "1_0_-1"), ("LHT", "1_0_1")])
def test_side_of_traffic(tmp_path, rule, ahead):
    built, row = features(write(tmp_path, road(sections=section(lane(2) + lane(1), lane(-1) + lane(-2)), rule=rule)))
    line = built.polyline[row[ahead]]
    assert line[0, 0] < line[-1, 0]
    side = 2.0 if rule == "LHT" else -2.0
    np.testing.assert_allclose(line[:, 1], side, atol=1e-3)
    inner, outer = row[ahead], row[ahead[:-1] + "2"]
    nearer = ("left", "right") if rule == "RHT" else ("right", "left")
    assert list(getattr(built, f"{nearer[0]}_neighbors")[outer]) == [ahead]
    assert list(getattr(built, f"{nearer[1]}_neighbors")[inner]) == [built.ids[outer]]
    for name in row:  # outlines begin on the left side, in driving direction
        line, outline = built.polyline[row[name]], built.polygon[row[name]]
        ahead_vector, aside = line[-1] - line[0], outline[0] - line[0]
        assert ahead_vector[0] * aside[1] - ahead_vector[1] * aside[0] > 0


# --- links --------------------------------------------------------------------------------------------------


def links(built) -> set[tuple[str, str]]:
    assert {(name, other) for name, others in zip(built.ids, built.exit_lanes, strict=True) for other in others} == {
        (other, name) for name, others in zip(built.ids, built.entry_lanes, strict=True) for other in others
    }
    return {(name, other) for name, others in zip(built.ids, built.exit_lanes, strict=True) for other in others}


def test_links_of_sections_roads_and_junctions(tmp_path):
    after, before = '<successor id="-1"/>', '<predecessor id="-1"/>'
    back = '<successor id="1"/>', '<predecessor id="1"/>'
    first = section(lane(1, link=back[0]), lane(-1, link=after)) + section(
        lane(1, link=back[1]), lane(-1, link=before), start=50.0
    )
    crossing = section(right=lane(-1, link=before + '<successor id="1"/>'))  # ends where road 3 ends, too
    path = write(
        tmp_path,
        road("1", sections=first, link='<successor elementType="junction" elementId="9"/>'),
        road("2", sections=crossing, x=100.0, junction="9", length=20.0,
             link='<predecessor elementType="road" elementId="1" contactPoint="end"/>'
                  '<successor elementType="road" elementId="3" contactPoint="end"/>'),
        road("3", x=220.0, link='<successor elementType="junction" elementId="9"/>'),
        more='<junction id="9"><connection id="0" incomingRoad="1" connectingRoad="2" contactPoint="start">'
             '<laneLink from="-1" to="-1"/></connection></junction>',
    )  # fmt: skip
    built, row = features(path)
    assert links(built) == {
        ("1_0_-1", "1_1_-1"), ("1_1_1", "1_0_1"), ("1_1_-1", "2_0_-1"), ("2_0_-1", "3_0_1"),
    }  # fmt: skip
    assert built.is_intersection[row["2_0_-1"]] == 1 and built.is_intersection[row["1_0_-1"]] == 0


def test_marks_signals_limits_and_crosswalks(tmp_path):
    mark = '<roadMark sOffset="0" type="broken" color="white"/><roadMark sOffset="40" type="solid" color="yellow"/>'
    speed = '<speed sOffset="0" max="50" unit="km/h"/>'
    more = (
        '<signals><signal id="5" s="90" t="-5" dynamic="yes" orientation="+" type="1000001"/>'
        '<signal id="6" s="95" t="-2" dynamic="no" orientation="+" type="294"/>'
        '<signal id="7" s="5" t="5" dynamic="no" orientation="-" type="206"/></signals>'
        '<objects><object id="8" type="crosswalk" s="50" t="0"><outline><cornerLocal u="-2" v="-4"/>'
        '<cornerLocal u="2" v="-4"/><cornerLocal u="2" v="4"/></outline></object></objects>'
    )
    built, row = features(
        write(tmp_path, road(sections=section(lane(1), lane(-1, WIDTH + speed), center=mark), more=more))
    )
    assert built.speed_limit[row["1_0_-1"]] == pytest.approx(50 / 3.6) and np.isnan(built.speed_limit[row["1_0_1"]])
    lines = list(built.left_boundaries[row["1_0_-1"]])
    assert lines == list(built.left_boundaries[row["1_0_1"]]) and len(lines) == 2
    assert [built.feature_type[row[name]] for name in lines] == [
        MapFeatureType.ROAD_LINE_BROKEN_SINGLE_WHITE, MapFeatureType.ROAD_LINE_SOLID_SINGLE_YELLOW,
    ]  # fmt: skip
    np.testing.assert_allclose(built.polyline[row[lines[1]]][[0, -1], 0], [40, 100], atol=1e-3)
    for name, kind, lanes in (
        ("signal-1-0", MapFeatureType.TRAFFIC_LIGHT, ["1_0_-1"]),
        ("signal-1-1", MapFeatureType.STOP_LINE, ["1_0_-1"]),
        ("signal-1-2", MapFeatureType.STOP_SIGN, ["1_0_1"]),
    ):
        assert built.feature_type[row[name]] == kind and list(built.controlled_lanes[row[name]]) == lanes
    np.testing.assert_allclose(built.polyline[row["signal-1-1"]][:, 1], [-4, 0], atol=1e-3)
    np.testing.assert_allclose(built.polygon[row["crosswalk-1-0"]][:, :2], [[48, -4], [52, -4], [52, 4]], atol=1e-3)


def test_maps_that_are_exported_come_back(tmp_path):
    """Lanes, within a centimetre, and links, through the short connections that the writer lays between lanes."""
    convert("pg", "3:5", tmp_path / "lake")
    for scenario in Lake(tmp_path / "lake").loader():
        (content,) = writer_for("opendrive").write(scenario, "map", Losses()).values()
        path = tmp_path / "map.xodr"
        path.write_bytes(content)
        built = read_opendrive(path).build(scenario.origin)
        lanes = [scenario.map.polyline[row] for row in np.flatnonzero(is_lane(scenario.map.feature_type))]
        whole = [row for row in np.flatnonzero(is_lane(built.feature_type)) if not built.is_intersection[row]]
        assert len(whole) == len(lanes)
        for line in lanes:
            middle = line[len(line) // 2]
            away = [np.hypot(*(_dense(built.polyline[row]) - middle[:2]).T).min() for row in whole]
            assert min(away) < 0.1


def _dense(line: np.ndarray) -> np.ndarray:
    along = np.append(0.0, np.cumsum(np.hypot(*np.diff(line[:, :2], axis=0).T)))
    at = np.linspace(0, along[-1], max(int(along[-1] * 20), 2))
    return np.stack([np.interp(at, along, line[:, axis]) for axis in (0, 1)], axis=1)


# --- damage -------------------------------------------------------------------------------------------------

BAD_ROADS = {
    "no number": road("2", shape='<arc curvature="sharp"/>'),
    "nan": road("2", shape='<arc curvature="nan"/>'),
    "infinite": road("2", sections=section(right=lane(-1, '<width sOffset="0" a="inf"/>'))),
    "no shape": road("2", shape=""),
    "no length": road("2", length=0.0),
    "too long": road("2", length=1e7),
    "far away": road("2", x=1e12),
    "no sections": road("2", sections="<laneSection/>"),
    "sections in one place": road("2", sections=section(right=lane(-1)) + section(right=lane(-1), start=500.0)),
    "a million lanes": road("2", sections=section(right="".join(lane(-n) for n in range(1, 1200)))),
    "a long geometry": road("2").replace('hdg="0" length="100.0"', 'hdg="0" length="1e7"'),
    "lane 0 on a side": road("2", sections=section(right=lane(0))),
    "a lane on the other side": road("2", sections=section(right=lane(1))),
    "a lane twice": road("2", sections=section(right=lane(-1) + lane(-1))),
    "id twice": road("1"),
    "no id": road(""),
    "no lane number": road("2", sections=section(right='<lane id="right" type="driving"/>')),
}


@pytest.mark.parametrize("bad", BAD_ROADS.values(), ids=BAD_ROADS)
def test_a_bad_road_costs_itself(tmp_path, bad):
    built = read_opendrive(write(tmp_path, road("1"), bad))
    (defect,) = built.defects
    assert (defect.table, defect.field, defect.count) == ("maps", "road", 1)
    assert "expected" in defect.reason and "found" in defect.reason
    assert {"1_0_1", "1_0_-1"} <= set(built.build(np.zeros(3)).ids)


@pytest.mark.parametrize(
    "link",
    [
        '<successor elementType="road" elementId="77" contactPoint="start"/>',
        '<successor elementType="road" elementId="" contactPoint="somewhere"/>',
        "<successor/>",
    ],
)
def test_missing_references_are_told(tmp_path, link):
    inner = section(right=lane(-1, link='<successor id="-1"/><predecessor id="x"/>'))
    built = read_opendrive(
        write(tmp_path, road("1", sections=inner, link=link),
              more='<junction id="3"><connection incomingRoad="1" connectingRoad="8"/></junction>')
    )  # fmt: skip
    assert all(defect.field == "link" for defect in built.defects) and built.defects


def test_cyclic_links_end(tmp_path):
    link = '<predecessor elementType="road" elementId="1" contactPoint="end"/>'
    link += '<successor elementType="road" elementId="1" contactPoint="start"/>'
    inner = section(right=lane(-1, link='<predecessor id="-1"/><successor id="-1"/>'))
    built, _ = features(write(tmp_path, road(sections=inner, link=link)))
    assert links(built) == set()  # a lane that follows itself is none


DOCTYPES = {
    "bomb": "<!DOCTYPE OpenDRIVE [<!ENTITY a 'aaaa'><!ENTITY b '&a;&a;&a;&a;'>]>",
    "external": "<!DOCTYPE OpenDRIVE [<!ENTITY a SYSTEM 'file:///etc/passwd'>]>",
    "remote": "<!DOCTYPE OpenDRIVE SYSTEM 'http://localhost/a.dtd'>",
}


@pytest.mark.parametrize("doctype", DOCTYPES.values(), ids=DOCTYPES)
def test_entities_are_refused(tmp_path, doctype):
    with pytest.raises(CorruptSource, match="document type"):
        read_opendrive(write(tmp_path, road(), doctype=doctype))


def test_what_is_no_map_is_a_sentence(tmp_path):
    path = write(tmp_path, road())
    content = path.read_bytes()
    for cut in range(0, len(content), 60):
        path.write_bytes(content[:cut])
        with pytest.raises(CorruptSource, match="expected"):
            read_opendrive(path)
    write(tmp_path, road(sections=section(right=lane(-1, kind="sidewalk"))))
    with pytest.raises(CorruptSource, match="expected lanes"):
        read_opendrive(path)
    with pytest.raises(SourceNotFound, match="no such map"):
        read_map(tmp_path / "no.xodr")
    path.write_text("<OpenDRIVE><header><userData code='origin' value='1 2'/></header></OpenDRIVE>")
    with pytest.raises(CorruptSource, match="three numbers"):
        read_opendrive(path)
