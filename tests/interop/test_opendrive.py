"""OpenDRIVE files in the tools of others: ASAM's schema and checker, SUMO's netconvert, CARLA's client."""

from __future__ import annotations

import os
import re
import subprocess
from pathlib import Path
from xml.etree import ElementTree as Xml

import pytest

from scenarionet_data import Lake, ScenarioLoader, convert
from scenarionet_data.interchange import writer_for
from scenarionet_data.interchange.files import write_files

ROOT = Path(__file__).parents[2]
TOOLS = ROOT / ".venv-interop" / "tools" / "bin"
CHECKER = ROOT / ".venv-interop" / "qc" / "bin" / "qc_opendrive"
SOURCES = {
    "scenarionet": "scenarionet",
    "waymo": "waymo/training",
    "argoverse2": "argoverse2/motion-forecasting/val",
}

pytestmark = pytest.mark.interop


@pytest.fixture(scope="module")
def maps(tmp_path_factory) -> list[Path]:
    """Maps of generated scenarios, and of recorded ones where there are any."""
    if not TOOLS.exists():
        pytest.fail("no .venv-interop: run `make test-interop`")
    folder = tmp_path_factory.mktemp("opendrive")
    convert("pg", "0:40", folder / "lake")
    data = os.environ.get("SCENARIONET_TEST_DATA")
    for name, raw in SOURCES.items() if data else ():
        convert(name, Path(data) / raw, folder / "lake")
    with_lanes = Lake(folder / "lake").select("num_map_features > 0")
    write_files(ScenarioLoader(folder / "lake", with_lanes), folder / "maps", writer_for("opendrive"))
    return sorted((folder / "maps").glob("*.xodr"))


def run(*command: object, **more: object) -> str:
    done = subprocess.run([str(word) for word in command], capture_output=True, text=True, check=False, **more)
    assert done.returncode == 0, done.stdout + done.stderr
    return done.stdout


def test_schema(maps):
    data = os.environ.get("SCENARIONET_TEST_DATA")
    if not data:
        pytest.skip("ASAM's schemas: set SCENARIONET_TEST_DATA to the folder with exchange/schema")
    schema = Path(data) / "exchange/schema/OpenDRIVE_1.7/localSchema/opendrive_17_core.xsd"
    assert run(TOOLS / "python", ROOT / "tests/interop/validates.py", schema, *maps) == ""


def test_netconvert_keeps_lanes_and_links(maps, tmp_path):
    different = []
    for path in maps:
        net = tmp_path / "net.xml"
        run(
            TOOLS / "netconvert", "--opendrive", path, "-o", net, "--opendrive.import-all-lanes", "true",
            "--opendrive.min-width", "0.1", "--geometry.remove", "false", "--no-turnarounds", "true", "--no-warnings",
        )  # fmt: skip
        written, read = Xml.parse(path).getroot(), Xml.parse(net).getroot()
        roads = [road for road in written.findall("road") if road.get("junction") == "-1"]
        lanes = sum(len(road.findall(".//right/lane")) for road in roads)
        going_on = [road for road in roads if road.find("link/successor[@elementType='road']") is not None]
        links = len(written.findall("junction/connection")) + sum(
            len(road.findall(".//right/lane")) for road in going_on
        )
        edges = sum(len(edge.findall("lane")) for edge in read.findall("edge") if edge.get("function") is None)
        connections = sum(not entry.get("from", "").startswith(":") for entry in read.findall("connection"))
        if (lanes, links) != (edges, connections):
            different.append((path.name, lanes, edges, links, connections))
    assert different == []


def test_carla_opens_every_map(maps):
    assert int(run(TOOLS / "python", ROOT / "tests/interop/opens_in_carla.py", *maps).split()[-1]) == len(maps)


def test_asam_finds_no_error(maps, tmp_path):
    found = {}
    for path in maps:
        (tmp_path / "config.xml").write_text(
            f'<Config><Param name="InputFile" value="{path}"/><CheckerBundle application="xodrBundle">'
            f'<Param name="resultFile" value="{tmp_path}/result.xqar"/></CheckerBundle></Config>'
        )
        run(CHECKER, "-c", tmp_path / "config.xml", cwd=tmp_path)
        errors = re.findall(r'level="1" ruleUID="([^"]*)"', (tmp_path / "result.xqar").read_text())
        if errors:
            found[path.name] = errors
    assert found == {}
