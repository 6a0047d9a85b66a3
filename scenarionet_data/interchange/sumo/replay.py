"""Replay recorded objects in SUMO, each where it was: ``python replay.py NAME`` beside NAME.sumocfg.

Needs ``pip install eclipse-sumo libsumo traci``. ``--gui`` shows it; ``--output FILE`` writes SUMO's own FCD output.
"""

from __future__ import annotations

import argparse
import importlib
from pathlib import Path
from typing import Any
from xml.etree import ElementTree

_ANYWHERE = 2  # where the recording is, on a lane or not


def replay(stem: Path, arguments: list[str], *, gui: bool = False) -> float:
    """Replay a scenario; return how far any object was from where it was recorded, at most [m].

    Args:
        stem: Path of the files without their ending.
        arguments: Further ones for SUMO.
        gui: Show it.
    """
    sumo: Any = importlib.import_module("traci" if gui else "libsumo")
    config = ElementTree.parse(f"{stem}.sumocfg").getroot()  # noqa: S314  # written by the exporter
    inputs = {each.tag: str(stem.with_name(each.get("value", ""))) for each in config.iterfind("input/*")}
    step = config.find("time/step-length")
    sumo.start(
        [
            "sumo-gui" if gui else "sumo", "-n", inputs["net-file"], "-a", inputs["additional-files"],
            "--step-length", "0.1" if step is None else step.get("value", "0.1"), "--collision.action", "none",
            "--time-to-teleport", "-1", "--no-step-log", "--no-warnings", "--xml-validation", "never", *arguments,
        ]
    )  # fmt: skip
    there, farthest = set[str](), 0.0
    for timestep in ElementTree.parse(f"{stem}.fcd.xml").getroot():  # noqa: S314
        seen = {each.get("id", ""): each.attrib for each in timestep}
        for name in sorted(there - set(seen)):
            sumo.vehicle.remove(name)
        for name, state in seen.items():
            if name not in there:
                sumo.vehicle.add(name, "", typeID=state["type"])
                sumo.vehicle.setSpeedMode(name, 0)
                sumo.vehicle.setLaneChangeMode(name, 0)
            place = float(state["x"]), float(state["y"]), float(state["angle"])
            sumo.vehicle.moveToXY(name, "", -1, *place, keepRoute=_ANYWHERE)
        there = set(seen)
        sumo.simulationStep()  # in which objects are moved
        for name, state in seen.items():
            x, y = sumo.vehicle.getPosition(name)
            farthest = max(farthest, abs(x - float(state["x"])), abs(y - float(state["y"])))
    sumo.close()
    return farthest


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("name", help="name of the scenario's files without their ending")
    parser.add_argument("--gui", action="store_true", help="show it")
    parser.add_argument("--output", help="file of SUMO's own FCD output")
    given = parser.parse_args()
    options = ["--fcd-output", given.output] if given.output else []
    print(f"{replay(Path(given.name), options, gui=given.gui):.4f} m off at most")  # noqa: T201
