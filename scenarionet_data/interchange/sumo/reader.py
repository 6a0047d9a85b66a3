"""Read SUMO's FCD output over its net: one scenario a file ``NAME.fcd.xml``.

The net is that of ``NAME.sumocfg``, ``NAME.net.xml``, or the only ``*.net.xml`` beside it; sizes are those of the types
in ``NAME.add.xml`` and ``NAME.rou.xml``.
"""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Iterator
from pathlib import Path
from typing import ClassVar
from xml.etree.ElementTree import Element

import numpy as np

from scenarionet_data.arrays.dtypes import Float64
from scenarionet_data.converters.formats.xml_files import read_xml, to_number
from scenarionet_data.errors import CorruptSource
from scenarionet_data.ingest.defects import Defects
from scenarionet_data.ingest.shard import Shard
from scenarionet_data.interchange.scene_files import FileScene, SceneFiles, SceneLight, SceneObject
from scenarionet_data.interchange.sumo.net_reader import read_lights, read_net
from scenarionet_data.scenario.vocabulary import ObjectType

_ENDING = ".fcd.xml"
_LONGEST = 100_000
"""Timesteps of a scenario."""
_SIZES = {"bicycle": (1.6, 0.65, 1.7), "pedestrian": (0.215, 0.478, 1.719), "motorcycle": (2.2, 0.9, 1.5),
          "truck": (7.1, 2.4, 2.4), "trailer": (16.5, 2.55, 4.0), "bus": (12.0, 2.5, 3.4)}  # fmt: skip
"""SUMO's defaults of length, width and height [m]."""
_CAR = (5.0, 1.8, 1.5)
_KINDS = {"bicycle": ObjectType.CYCLIST, "pedestrian": ObjectType.PEDESTRIAN}


class Sumo(SceneFiles):
    """SUMO's FCD output."""

    name: ClassVar[str] = "sumo"
    licence: ClassVar[str] = "that of the simulated scenario"
    raw: ClassVar[str] = "a folder of SUMO's FCD output (NAME.fcd.xml) with its nets (NAME.net.xml)"
    pattern: ClassVar[str] = f"*{_ENDING}"

    def inputs(self, path: Path) -> list[Path]:
        """Return the motion with its net and types."""
        return [path, *self._types(path), *([net] if (net := self._net(path)) else [])]

    def files(self, shard: Shard) -> Iterator[list[str]]:
        """The motion, nets and what else belongs to it."""
        names = []
        for item in shard.items:
            base = item.name.removesuffix(_ENDING)
            folder = base.rpartition("/")[0]
            names += [item.name, *(f"{base}{ending}" for ending in (".sumocfg", ".add.xml", ".rou.xml"))]
            names.append(f"{folder}/*.net.xml" if folder else "*.net.xml")
        yield names

    def scene(self, path: Path, shard: Shard, defects: Defects) -> FileScene:  # noqa: ARG002
        """Read a file."""
        root = read_xml(path, "fcd-export")
        times = np.array([to_number(step.get("time")) for step in root.findall("timestep")])
        steps = np.diff(times)
        dt = round(float(np.median(steps)), 6) if len(steps) else 1.0
        if not 0 < len(times) <= _LONGEST or not np.isfinite(times).all() or not 1e-3 <= dt <= 60.0:
            raise CorruptSource(f"{path}: expected 1 to {_LONGEST:,} timesteps with times, found {len(times):,}")
        if len(steps) and np.abs(steps - dt).max() > 0.01 * dt + 2e-3:
            raise CorruptSource(f"{path}: expected evenly spaced timesteps of {dt:g} s, found others")
        net_path = self._net(path)
        if net_path is None:
            raise CorruptSource(f"{path}: expected its net beside it ({path.name.removesuffix(_ENDING)}.net.xml)")
        net = read_xml(net_path, "net")
        location = net.find("location")
        moved = [to_number(each) for each in (location.get("netOffset", "") if location is not None else "").split(",")]
        shift = np.array([-moved[0], -moved[1], 0.0]) if len(moved) == 2 and np.isfinite(moved).all() else np.zeros(3)
        types = {
            kind.get("id", ""): kind
            for each in self._types(path)
            for kind in read_xml(each, "additional" if each.name.endswith(".add.xml") else "routes").iter("vType")
        }
        states: dict[str, dict[int, Element]] = defaultdict(dict)
        for step, timestep in enumerate(root.findall("timestep")):
            for element in timestep:
                states[element.get("id", "")].setdefault(step, element)
        objects = [_object(name, each, len(times), types, shift) for name, each in states.items()]
        builder, ends = read_net(net, shift, net_path.name, defects)
        states_of = read_lights(net, times)
        lights = [SceneLight(lane, state, ends[lane]) for lane, state in states_of.items() if lane in ends]
        return FileScene(objects, (), lights, dt=dt, features=builder)

    @staticmethod
    def _net(path: Path) -> Path | None:
        base = path.name.removesuffix(_ENDING)
        config = path.with_name(f"{base}.sumocfg")
        try:
            named = read_xml(config, "configuration").find("input/net-file")
        except CorruptSource:  # none, or of no use
            named = None
        names = [Path(named.get("value", "")).name] if named is not None else []
        for name in (*names, f"{base}.net.xml"):
            if name and path.with_name(name).is_file():
                return path.with_name(name)
        others = sorted(path.parent.glob("*.net.xml"))
        return others[0] if len(others) == 1 else None

    @staticmethod
    def _types(path: Path) -> list[Path]:
        base = path.name.removesuffix(_ENDING)
        return [each for ending in ("add", "rou") if (each := path.with_name(f"{base}.{ending}.xml")).is_file()]


def _object(
    name: str, states: dict[int, Element], num_steps: int, types: dict[str, Element], shift: Float64
) -> SceneObject:
    """An object over all timesteps; its place is that of its box, not of its front."""
    first = next(iter(states.values()))
    kind = types.get(first.get("type", ""))
    word = "pedestrian" if first.tag == "person" else "passenger" if kind is None else kind.get("vClass", "passenger")
    default = _SIZES.get(word, _CAR)
    told = [np.nan if kind is None else to_number(kind.get(side)) for side in ("length", "width", "height")]
    length, width, height = np.where(np.isnan(told), default, told).tolist()
    steps = list(states)
    keys = {"x": None, "y": None, "z": "0", "angle": None, "speed": None}
    rows = np.array([[to_number(each.get(key, unset)) for key, unset in keys.items()] for each in states.values()])
    heading = np.radians(90.0 - rows[:, 3])
    ahead = np.column_stack([np.cos(heading), np.sin(heading)])
    position, velocity = np.zeros((num_steps, 3)), np.zeros((num_steps, 2))
    position[steps] = rows[:, :3] + shift
    position[steps, :2] -= ahead * (0.0 if first.tag == "person" else 0.5 * length)
    velocity[steps] = ahead * rows[:, 4:]
    headings, valid = np.zeros(num_steps), np.zeros(num_steps, np.bool_)
    headings[steps], valid[steps] = heading, True
    return SceneObject(
        name, _KINDS.get(word, ObjectType.VEHICLE), position, velocity, headings, valid, (length, width, height),
        is_size_assumed=bool(np.isnan(told[:2]).any()),
    )  # fmt: skip
