"""Read OpenSCENARIO: esmini plays a file, and what its objects do is the scenario.

esmini (https://github.com/esmini/esmini) is a program of its own, found by the environment variable
``SCENARIONET_ESMINI`` or on the path. A file of parameter distributions becomes a scenario for each of its
permutations, ``NAME_1_of_4`` and on. Positions are those of esmini's log (``--csv_logger``) at steps of 0.1 s.
"""

from __future__ import annotations

import csv
import os
import re
import shutil
import subprocess
import tempfile
from collections import defaultdict
from collections.abc import Iterator
from dataclasses import dataclass, replace
from pathlib import Path
from typing import ClassVar
from xml.etree.ElementTree import Element

import numpy as np

from scenarionet_data.arrays.dtypes import Float64
from scenarionet_data.building.plausible import find_dead_ends
from scenarionet_data.converters.formats.opendrive.reader import read_opendrive
from scenarionet_data.converters.formats.xml_files import read_xml
from scenarionet_data.errors import BadParameter, CorruptSource, MissingDependency
from scenarionet_data.ingest.defects import Defects
from scenarionet_data.ingest.options import Options, option
from scenarionet_data.ingest.shard import RawItem, Shard
from scenarionet_data.interchange.openscenario.writer import PREFIX
from scenarionet_data.interchange.scene_files import DT, FileScene, SceneFiles, SceneObject
from scenarionet_data.scenario.vocabulary import ObjectType

PLAYER = "SCENARIONET_ESMINI"
"""Environment variable with the path of esmini."""
_ROOT = "OpenSCENARIO"
_PATIENCE = 120.0
"""Seconds that esmini may take for a file."""
_RESTS = 0.1
"""Speed [m/s] below which an object may rest when it appears."""
_PERMUTATION = re.compile(r"(.*)_(\d+)_of_(\d+)\.xosc")
_VALUES = ("bb_x", "bb_length", "bb_width", "bb_height", "World_Position_X", "World_Position_Y", "World_Position_Z",
           "Vel_X", "Vel_Y", "World_Heading_Angle")  # fmt: skip
_CATEGORIES = {"bicycle": ObjectType.CYCLIST, "motorbike": ObjectType.CYCLIST, "pedestrian": ObjectType.PEDESTRIAN,
               "wheelchair": ObjectType.PEDESTRIAN, "animal": ObjectType.OTHER, "barrier": ObjectType.TRAFFIC_BARRIER,
               "building": ObjectType.BUILDING}  # fmt: skip
"""Types of OpenSCENARIO's categories; other vehicles are vehicles, other miscellaneous objects traffic objects."""


@dataclass(frozen=True)
class OpenScenarioOptions(Options):
    """How long a scenario may be."""

    longest: float = option(120.0, "Later states are left out [s]; some files never end.")

    def __post_init__(self) -> None:
        if not self.longest > 0.0:
            raise BadParameter(f"longest: expected a time above 0 s, found {self.longest!r}")


class OpenScenario(SceneFiles):
    """OpenSCENARIO files that esmini plays."""

    name: ClassVar[str] = "openscenario"
    licence: ClassVar[str] = "that of the files"
    raw: ClassVar[str] = "a folder of OpenSCENARIO files (*.xosc) that esmini plays, with their OpenDRIVE maps"
    pattern: ClassVar[str] = "*.xosc"
    listed: ClassVar[tuple[str, ...]] = ("*.xosc",)
    Options = OpenScenarioOptions

    def shards(self, raw: str, split: str, version: str, options: object) -> Iterator[Shard]:
        """List files other than catalogs."""
        for shard in super().shards(raw, split, version, options):
            items = tuple(item for item in shard.items if not _is_catalog(Path(shard.root, item.name)))
            if items:
                yield replace(shard, items=items)

    def inputs(self, path: Path) -> list[Path]:
        """Return a file with its map, or the scenario of a file of distributions."""
        return [path, *(each for each in _references(path) if each.is_file())]

    def files(self, shard: Shard) -> Iterator[list[str]]:
        """The files, then what they name, within the raw folder."""
        root, waiting = Path(shard.root).resolve(), [Path(shard.root, item.name) for item in shard.items]
        while waiting:
            inside = [
                each.resolve().relative_to(root).as_posix() for each in waiting if each.resolve().is_relative_to(root)
            ]
            yield inside
            waiting = [named for each in inside if each.endswith(".xosc") and "*" not in each
                       for named in _references(root / each)]  # fmt: skip

    def records(self, shard: Shard) -> Iterator[RawItem]:
        """Yield the files, and of a file of distributions its permutations."""
        for item in shard.items:
            for number in range(count := _permutations(Path(shard.root, item.name))):
                ending = f"_{number + 1}_of_{count}.xosc" if count > 1 else ".xosc"
                yield replace(item, name=item.name.removesuffix(".xosc") + ending)

    def scene(self, path: Path, shard: Shard, defects: Defects) -> FileScene:
        """Play a file, or one of its permutations."""
        told = None if path.is_file() else _PERMUTATION.fullmatch(path.name)
        file = path if told is None else path.with_name(f"{told[1]}.xosc")
        rows = _play(file, 0 if told is None else int(told[2]) - 1)
        story = _story(file)
        map_path = _map_of(story)
        shift = _origin(map_path)
        objects = _objects(
            rows, _types(story), shift, shard.options_as(OpenScenarioOptions).longest, path.name, defects
        )
        named = [each.id.lower() for each in objects]
        ego = named.index("ego") if "ego" in named else 0
        return FileScene(objects, (), ego=ego, current=0, features=read_opendrive(map_path))


def _is_catalog(path: Path) -> bool:
    try:
        return read_xml(path, _ROOT).find("Catalog") is not None
    except CorruptSource:  # is said when it is converted
        return False


def _references(path: Path) -> list[Path]:
    """What a file names: map, scenario of distributions, patterns of catalogs; nothing if it is damaged."""
    try:
        root = read_xml(path, _ROOT)
    except CorruptSource:
        return []
    files = [*root.iterfind("RoadNetwork/LogicFile"), *root.iterfind("ParameterValueDistribution/ScenarioFile")]
    folders = root.iterfind("CatalogLocations/*/Directory")
    return [
        *(path.parent / each.get("filepath", "") for each in files),
        *(path.parent / each.get("path", "") / "*.xosc" for each in folders),
    ]


def _permutations(path: Path) -> int:
    """Number of scenarios of a file; 1 if it cannot be played, which is said when it is converted."""
    try:
        if read_xml(path, _ROOT).find("ParameterValueDistribution") is None:
            return 1
        with tempfile.TemporaryDirectory() as folder:
            _run(path, 0, Path(folder))
            found = [re.fullmatch(r"log_1_of_(\d+)\.csv", each.name) for each in Path(folder).iterdir()]
            return next((int(each[1]) for each in found if each), 1)
    except CorruptSource:
        return 1


def _run(path: Path, permutation: int, folder: Path) -> str:
    """Let esmini play a file; its logs are in the folder. Returns what it said."""
    player = os.environ.get(PLAYER) or shutil.which("esmini")
    if player is None or not Path(player).is_file():
        raise MissingDependency(
            "OpenSCENARIO needs the program esmini to play it", "",
            f"download it from https://github.com/esmini/esmini/releases and set {PLAYER} to it",
        )  # fmt: skip
    words = [str(Path(player).resolve()), "--osc", str(path.resolve()), "--headless", "--fixed_timestep", str(DT),
             "--traj_filter", "0", "--csv_logger", "log.csv", "--param_permutation", str(permutation)]  # fmt: skip
    try:
        done = subprocess.run(words, cwd=folder, capture_output=True, timeout=_PATIENCE, check=False)  # noqa: S603
    except subprocess.TimeoutExpired as error:
        raise CorruptSource(f"{path}: expected an end, esmini still plays it after {_PATIENCE:g} s") from error
    return done.stdout.decode("utf-8", "replace")


def _play(path: Path, permutation: int) -> list[list[str]]:
    """Return the rows of esmini's log of a file."""
    read_xml(path, _ROOT)
    with tempfile.TemporaryDirectory() as folder:
        said = _run(path, permutation, Path(folder))
        logs = sorted(Path(folder).glob("log*.csv"))
        text = logs[0].read_text("utf-8", "replace") if logs else ""
    rows = [[each.strip() for each in row] for row in csv.reader(text.splitlines())]
    if not any(row and row[0] == "0" for row in rows):
        errors = [line for line in said.splitlines() if "error" in line.lower()] or said.splitlines()
        reason = re.sub(r"^\[.*?\]\s*(\[\w+\])?\s*", "", errors[-1])[:300] if errors else "it said nothing"
        raise CorruptSource(f"{path}: esmini does not play it: {reason}")
    return rows


def _story(path: Path) -> tuple[Path, Element]:
    """The scenario of a file: itself, or the one that a file of distributions names."""
    root = read_xml(path, _ROOT)
    named = root.find("ParameterValueDistribution/ScenarioFile")
    if named is None:
        return path, root
    return _story(path.parent / named.get("filepath", ""))


def _map_of(story: tuple[Path, Element]) -> Path:
    path, root = story
    named = root.find("RoadNetwork/LogicFile")
    if named is None:
        raise CorruptSource(f"{path}: expected a RoadNetwork with a LogicFile, found none")
    return path.parent / named.get("filepath", "")


def _origin(path: Path) -> Float64:
    """Offset to the frame of the source [m], which maps that the lake wrote have, and which reading them adds."""
    for each in read_xml(path, "OpenDRIVE").findall("header/userData"):
        if each.get("code") == "origin":
            return np.array(each.get("value", "").split(), np.float64)
    return np.zeros(3)


def _types(story: tuple[Path, Element]) -> dict[str, ObjectType]:
    """Types of the objects by name; catalogs are read where they lie."""
    path, root = story
    folders = [path.parent / each.get("path", "") for each in root.iterfind("CatalogLocations/*/Directory")]
    entries = {
        (catalog.get("name"), element.get("name")): element
        for folder in folders
        for file in sorted(folder.glob("*.xosc"))
        if (catalog := read_xml(file, _ROOT).find("Catalog")) is not None
        for element in catalog
    }
    found = {}
    for entity in root.iterfind("Entities/ScenarioObject"):
        reference = entity.find("CatalogReference")
        element = next((each for each in entity if each.tag in ("Vehicle", "Pedestrian", "MiscObject")), None)
        if reference is not None:
            element = entries.get((reference.get("catalogName"), reference.get("entryName")))
        found[entity.get("name", "")] = ObjectType.VEHICLE if element is None else _type(element)
    return found


def _type(element: Element) -> ObjectType:
    category = {"Vehicle": "vehicleCategory", "Pedestrian": "pedestrianCategory"}.get(element.tag, "miscObjectCategory")
    default = {"Vehicle": ObjectType.VEHICLE, "Pedestrian": ObjectType.PEDESTRIAN}
    return _CATEGORIES.get(element.get(category, ""), default.get(element.tag, ObjectType.TRAFFIC_OBJECT))


def _objects(
    rows: list[list[str]], types: dict[str, ObjectType], shift: Float64, longest: float, file: str, defects: Defects
) -> list[SceneObject]:
    """The objects of a log, whose rows have a block of columns for each object that there is.

    Positions become those of the middle of the box, which lies ``bb_x`` ahead of the reference point. The velocity of
    0 with which objects appear is replaced by that of the next state.
    """
    start = next(number for number, row in enumerate(rows) if row and row[0] == "0")
    names = [re.sub(r"^#1 |\s*\[.*", "", each) for each in rows[start - 1] if each.startswith("#1 ")]
    columns, width = [names.index(name) for name in _VALUES], len(names)
    last = start + round(longest / DT) + 1
    defects.drop("tracks", file, ["later"] * (len(rows) > last), "time", f"expected at most {longest:g} s, found more")
    steps = rows[start:last]
    states: dict[str, dict[int, list[float]]] = defaultdict(dict)
    for step, row in enumerate(steps):
        for first in range(2, len(row) - width + 1, width):
            block = row[first : first + width]
            states[block[0]][step] = [float(block[column]) for column in columns]
    made = []
    for name, values in states.items():
        seen, table = list(values), np.array(list(values.values()))
        position, velocity, heading = np.zeros((len(steps), 3)), np.zeros((len(steps), 2)), np.zeros(len(steps))
        valid = np.isin(np.arange(len(steps)), seen)
        heading[seen] = (table[:, 9] + np.pi) % (2.0 * np.pi) - np.pi
        ahead = table[:, :1] * np.column_stack([np.cos(table[:, 9]), np.sin(table[:, 9])])
        position[seen, :2] = table[:, 4:6] + ahead
        position[seen, 2] = table[:, 6] + 0.5 * table[0, 3]
        position[seen] += shift
        velocity[seen] = table[:, 7:9]
        _, ends, near = find_dead_ends(position[None], velocity[None], valid[None], np.arange(len(steps)) * DT, _RESTS)
        velocity[ends] = velocity[near]
        length, wide, high = table[0, 1:4].tolist()
        made.append(
            SceneObject(
                name.removeprefix(PREFIX), types.get(name, ObjectType.VEHICLE), position, velocity, heading, valid,
                (length, wide, high), is_velocity_estimated=bool(len(ends)),
            )
        )  # fmt: skip
    return made
