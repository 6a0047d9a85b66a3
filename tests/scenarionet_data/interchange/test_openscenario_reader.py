"""What is read beside esmini itself: its log, the types of objects, and what is said without it."""

from __future__ import annotations

import csv
from xml.etree import ElementTree as Xml

import numpy as np
import pytest

from scenarionet_data import convert
from scenarionet_data.ingest.defects import Defects
from scenarionet_data.interchange.openscenario import reader
from scenarionet_data.scenario.vocabulary import ObjectType

TITLES = "Entity_Name [-],bb_x [m],bb_length [m],bb_width [m],bb_height [m],World_Position_X [m],World_Position_Y [m],\
World_Position_Z [m],Vel_X [m/s],Vel_Y [m/s],World_Heading_Angle [rad],collision_ids"
CAR, TRUCK = "1.5,4.0,2.0,1.4", "0.0,9.0,2.5,3.0"
LOG = f"""esmini GIT REV: v3
Number of Vehicles: 2
Index [-],TimeStamp [s],{",".join(f"#1 {title}" for title in TITLES.split(","))}
0,0.0,Ego,{CAR},10.0,5.0,0.5,0.0,8.0,1.5707963,
1,0.1,Ego,{CAR},10.0,5.8,0.5,0.0,8.0,1.5707963,,object-7,{TRUCK},30.0,0.0,0.0,-3.0,0.0,3.1415927,
2,0.2,object-7,{TRUCK},29.7,0.0,0.0,-3.0,0.0,3.1415927,
3,0.3,object-7,{TRUCK},29.4,0.0,0.0,-3.0,0.0,3.1415927,
"""


def objects_of(log: str, longest: float = 60.0, defects: Defects | None = None):
    rows = [[each.strip() for each in row] for row in csv.reader(log.splitlines())]
    types = {"Ego": ObjectType.VEHICLE, "object-7": ObjectType.CYCLIST}
    shift = np.array([100.0, 200.0, 0.0])
    return reader._objects(rows, types, shift, longest, "a.xosc", defects or Defects())


def test_positions_are_the_middles_of_boxes_in_the_frame_of_the_source():
    ego, other = objects_of(LOG)
    assert (ego.id, ego.kind, ego.size) == ("Ego", ObjectType.VEHICLE, (4.0, 2.0, 1.4))
    assert (other.id, other.kind) == ("7", ObjectType.CYCLIST)
    np.testing.assert_array_equal(ego.valid, [True, True, False, False])
    np.testing.assert_array_equal(other.valid, [False, True, True, True])
    # The box's middle is 1.5 m ahead of the reference point, along +y; half its height above the ground.
    np.testing.assert_allclose(ego.position[:2], [[110.0, 206.5, 1.2], [110.0, 207.3, 1.2]], atol=1e-6)
    np.testing.assert_allclose(other.position[3], [129.4, 200.0, 1.5], atol=1e-6)
    np.testing.assert_allclose(other.velocity[2], [-3.0, 0.0])
    assert abs(abs(other.heading[1]) - np.pi) < 1e-6


def test_an_object_appears_with_the_velocity_of_its_next_state():
    appears = LOG.replace("30.0,0.0,0.0,-3.0,0.0,3.1415927", "30.0,0.0,0.0,0.0,0.0,3.1415927")
    ego, other = objects_of(appears)
    np.testing.assert_allclose(other.velocity[1], [-3.0, 0.0])
    assert (ego.is_velocity_estimated, other.is_velocity_estimated) == (False, True)


def test_later_states_are_left_out_and_listed():
    defects = Defects()
    ego, other = objects_of(LOG, longest=0.2, defects=defects)
    assert len(ego.valid) == len(other.valid) == 3
    assert [(found.field, found.reason) for found in defects.found()] == [
        ("time", "expected at most 0.2 s, found more")
    ]


def test_types_are_those_of_categories_also_in_catalogs(tmp_path):
    (tmp_path / "catalogs").mkdir()
    (tmp_path / "catalogs" / "people.xosc").write_text(
        '<OpenSCENARIO><Catalog name="people"><Pedestrian name="adult" pedestrianCategory="pedestrian"/></Catalog>'
        "</OpenSCENARIO>"
    )
    root = Xml.fromstring(
        """<OpenSCENARIO><CatalogLocations><PedestrianCatalog><Directory path="catalogs"/></PedestrianCatalog>
        </CatalogLocations><Entities>
        <ScenarioObject name="walker"><CatalogReference catalogName="people" entryName="adult"/></ScenarioObject>
        <ScenarioObject name="bike"><Vehicle vehicleCategory="bicycle"/></ScenarioObject>
        <ScenarioObject name="van"><Vehicle vehicleCategory="van"/></ScenarioObject>
        <ScenarioObject name="wall"><MiscObject miscObjectCategory="barrier"/></ScenarioObject>
        <ScenarioObject name="box"><MiscObject miscObjectCategory="obstacle"/></ScenarioObject>
        <ScenarioObject name="lost"><CatalogReference catalogName="none" entryName="none"/></ScenarioObject>
        </Entities></OpenSCENARIO>"""
    )
    kinds = reader._types((tmp_path / "story.xosc", root))
    assert {name: kind.name for name, kind in kinds.items()} == {
        "walker": "PEDESTRIAN", "bike": "CYCLIST", "van": "VEHICLE", "wall": "TRAFFIC_BARRIER", "box": "TRAFFIC_OBJECT",
        "lost": "VEHICLE",
    }  # fmt: skip


@pytest.mark.parametrize("player", ["", "/nowhere/esmini"])
def test_without_esmini_the_remedy_is_said(tmp_path, monkeypatch, player):
    monkeypatch.setenv(reader.PLAYER, player)
    monkeypatch.setenv("PATH", "")
    (tmp_path / "raw").mkdir()
    (tmp_path / "raw" / "a.xosc").write_text("<OpenSCENARIO><RoadNetwork/></OpenSCENARIO>")
    report = convert("openscenario", str(tmp_path / "raw"), tmp_path / "lake")
    ((_, reason),) = report.failed
    assert "needs the program esmini" in reason and reader.PLAYER in reason
