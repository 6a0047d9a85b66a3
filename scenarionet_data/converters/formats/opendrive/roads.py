"""Roads, lane sections and lanes of OpenDRIVE as lines in the plane."""

from __future__ import annotations

from dataclasses import dataclass
from xml.etree.ElementTree import Element

import numpy as np
import shapely

from scenarionet_data.arrays.dtypes import Float64, IntP
from scenarionet_data.converters.formats.opendrive.curves import Cubics, ReferenceLine, number

TOLERANCE = 0.004
"""Distance of a lane's lines from the exact ones [m]."""
_MOST_LANES = 1000
"""Lanes of a section, beyond which a file is damaged."""
_BEFORE = 1e-6
"""How far before its end a section is evaluated there [m]: at the end, the next one begins."""


@dataclass(frozen=True, eq=False)
class RoadLane:
    """A lane of a section.

    Attributes:
        key: Road, number of the section, and lane.
        element: Its element.
        is_along: Whether it is driven along the road.
        borders: (2, n) inner and outer border [m], to the left of the reference line.
    """

    key: tuple[str, int, int]
    element: Element
    is_along: bool
    borders: Float64

    @property
    def id(self) -> str:
        """Id of the lane in a map."""
        return "_".join(map(str, self.key))


@dataclass(frozen=True, eq=False)
class LaneSection:
    """A lane section at n stations of its road.

    Attributes:
        start: Its station [m].
        stations: (n,) [m].
        kept: Stations that lines with ``TOLERANCE`` need.
        points: (n, 2) [m] of the reference line. normals: (n, 2) to its left.
        offset: (n,) [m] of the lane 0. height: (n,) [m]. bank: (n,) sine of the superelevation.
        center: Element of the lane 0; None without one.
        lanes: Lanes by their number.
    """

    start: float
    stations: Float64
    kept: IntP
    points: Float64
    normals: Float64
    offset: Float64
    height: Float64
    bank: Float64
    center: Element | None
    lanes: dict[int, RoadLane]

    def line(self, aside: Float64, rows: IntP | None = None) -> Float64:
        """Return points (k, 3) [m] of a line (n,) [m] left of the reference line, at the kept stations or ``rows``."""
        rows = self.kept if rows is None else rows
        across = self.points + aside[:, None] * self.normals
        return np.column_stack([across, self.height + aside * self.bank])[rows]


@dataclass(frozen=True, eq=False)
class MapRoad:
    """A road: its id, element, reference line and sections."""

    id: str
    element: Element
    reference: ReferenceLine
    sections: list[LaneSection]

    @property
    def junction(self) -> str | None:
        """Id of the junction that it crosses."""
        junction = self.element.get("junction", "-1")
        return None if junction == "-1" else junction

    def section_at(self, station: float) -> LaneSection:
        """Return the section of a station."""
        return next((each for each in reversed(self.sections) if each.start <= station + _BEFORE), self.sections[0])


def read_road(element: Element) -> MapRoad:
    """Read a road.

    Raises:
        ValueError: It has values that cannot be; the message says which.
    """
    name = element.get("id", "")
    sections = sorted(element.findall("lanes/laneSection"), key=lambda each: number(each, "s"))
    if not sections:
        raise ValueError("expected lane sections, found none")
    starts = [number(each, "s") for each in sections]
    marks = [
        start + number(each, "sOffset", 0.0)
        for start, section in zip(starts, sections, strict=True)
        for tag in ("roadMark", "width")
        for each in section.iter(tag)
    ]
    offsets = Cubics.read(element.findall("lanes/laneOffset"), "s")
    reference = ReferenceLine.read(element, [*starts, *marks, *offsets.starts])
    heights = Cubics.read(element.findall("elevationProfile/elevation"), "s")
    banks = Cubics.read(element.findall("lateralProfile/superelevation"), "s")
    is_left_hand = element.get("rule") == "LHT"
    ends = [*starts[1:], float(reference.stations[-1])]
    found = []
    for place, (section, start, end) in enumerate(zip(sections, starts, ends, strict=True)):
        rows = np.flatnonzero((reference.stations >= start - _BEFORE) & (reference.stations <= end + _BEFORE))
        if len(rows) < 2:
            raise ValueError(f"<laneSection>, s: expected sections one after the other, found {start:g} and {end:g}")
        stations = reference.stations[rows]
        at = np.clip(stations, start, max(end - _BEFORE, start))
        heading = reference.headings[rows]
        offset = offsets.at(at)
        lanes: dict[int, RoadLane] = {}
        for side in ("left", "right"):
            border = offset
            elements = section.findall(f"{side}/lane")
            sign = 1.0 if side == "left" else -1.0
            listed = {int(number(each, "id")): each for each in elements if sign * number(each, "id") >= 1.0}
            if len(listed) != len(elements) or len(listed) > _MOST_LANES:
                expected = f"up to {_MOST_LANES} lanes with numbers of their own, on the {side} side"
                raise ValueError(f"<laneSection>: expected {expected}, found {len(listed):,} of {len(elements):,}")
            for lane_id in sorted(listed, key=abs):
                lane = listed[lane_id]
                widths, borders = lane.findall("width"), lane.findall("border")
                if widths or not borders:
                    outer = border + sign * np.maximum(Cubics.read(widths, "sOffset", start).at(at), 0.0)
                else:
                    outer = Cubics.read(borders, "sOffset", start).at(at) + offset
                is_along = ((lane_id < 0) != is_left_hand) != (lane.get("direction") == "reversed")
                lanes[lane_id] = RoadLane((name, place, lane_id), lane, is_along, np.stack([border, outer]))
                border = outer
        made = LaneSection(
            start,
            stations,
            np.arange(len(rows)),
            reference.points[rows],
            np.stack([-np.sin(heading), np.cos(heading)], axis=1),
            offset,
            heights.at(at),
            np.sin(banks.at(at)),
            section.find("center/lane"),
            lanes,
        )
        found.append(_thinned(made))
    return MapRoad(name, element, reference, found)


def _thinned(section: LaneSection) -> LaneSection:
    """Keep the stations that the borders of lanes and heights need, so that neighbours have the same ones."""
    kept = np.zeros(len(section.stations), np.bool_)
    kept[[0, -1]] = True
    lines = [
        section.line(each)[:, :2] for each in (section.offset, *(b for x in section.lanes.values() for b in x.borders))
    ]
    for line in [*lines, np.column_stack([section.stations, section.height])]:
        thin = shapely.get_coordinates(shapely.simplify(shapely.linestrings(line), TOLERANCE, preserve_topology=False))
        kept |= np.isin(line @ np.array([1.0, 1j]), thin @ np.array([1.0, 1j]))
    elements = [lane.element for lane in section.lanes.values()]
    marks = [mark for each in (*elements, section.center) if each is not None for mark in each.iter("roadMark")]
    starts = [number(mark, "sOffset", 0.0) for mark in marks]
    kept[np.searchsorted(section.stations, [section.start + each for each in starts]).clip(max=len(kept) - 1)] = True
    return LaneSection(**{**vars(section), "kept": np.flatnonzero(kept)})
