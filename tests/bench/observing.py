"""Neighbours and road segments as states, beside PufferDrive's environment in C, in turns within one run.

``SCENARIONET_PUFFERDRIVE`` names the folder of its ``drive.h`` (commit ee8996fa, of October 2025). It is compiled
without its pictures, on one core, and plays the same scenarios from the maps that the export writes.
"""

from __future__ import annotations

import os
import statistics
import subprocess
import tempfile
import time
from collections.abc import Iterator
from pathlib import Path

import numpy as np

from scenarionet_data import ScenarioLoader
from scenarionet_data.conversion import convert
from scenarionet_data.interchange.base import Losses
from scenarionet_data.interchange.pufferdrive.writer import PufferDriveWriter
from scenarionet_sim.environments.config import MultiAgentConfig
from scenarionet_sim.environments.flat import FlatEnv
from scenarionet_sim.scenarios.selection import Scenarios
from scenarionet_sim.sensors.state import EgoState
from scenarionet_sim.sensors.surrounding import RoadSegments, Surrounding
from tests.bench.measure import Figure

_SENSORS = EgoState(), Surrounding(objects=63), RoadSegments(segments=200)
_STEPS, _TURNS = 91, 7


def figures(recordings: Path | None) -> Iterator[Figure]:
    """Agent-steps per second of processor time on two recorded Waymo scenes, and the medians of the ratios."""
    if recordings is None:
        return
    with tempfile.TemporaryDirectory() as name:
        folder, lake = Path(name), Path(name) / "lake"
        convert("waymo", str(recordings / "waymo"), lake)
        convert("scenarionet", str(recordings / "scenarionet"), lake)
        peer = _compiled(folder)
        for scenario in ScenarioLoader(lake):
            if not scenario.id.endswith(("637f20cafde22ff8", "8a346109094cd5aa")):
                continue
            (written,) = PufferDriveWriter(layout=1).write(scenario, "map", Losses()).values()
            (folder / "map.bin").write_bytes(written)
            for worlds in (8, 64):
                envs = FlatEnv(
                    worlds, MultiAgentConfig(Scenarios(lake, [scenario.id]), sensors=_SENSORS), 64, threads=1
                )
                envs.reset(seed=0)
                ours, theirs = [], []
                for _ in range(_TURNS):
                    ours.append(_rate(envs))
                    theirs.append(_peer_rate(peer, folder / "map.bin", worlds) if peer else float("nan"))
                envs.close()
                title = f"observing: {scenario.id[-16:]}, {worlds} worlds"
                yield Figure(f"{title}, 63 neighbours and 200 road segments", statistics.median(ours), "agent-steps/s")
                if peer:
                    yield Figure(f"{title}, PufferDrive", statistics.median(theirs), "agent-steps/s")
                    ratio = statistics.median(a / b for a, b in zip(ours, theirs, strict=True))
                    yield Figure(f"{title}, times PufferDrive", ratio, "", ">= 1")


def _rate(envs: FlatEnv) -> float:
    actions, number, started = np.zeros((len(envs.masks), 2)), 0, time.process_time()
    for _ in range(_STEPS):
        envs.step(actions)
        number += int(envs.masks.sum())
    return number / (time.process_time() - started)


def _compiled(folder: Path) -> Path | None:
    """Return the program, if PufferDrive is there; what follows the step in its source draws pictures."""
    source = os.environ.get("SCENARIONET_PUFFERDRIVE")
    if source is None:
        return None
    text = (Path(source) / "drive.h").read_text().split("\nconst Color ")[0]
    kept = [line for line in text.splitlines() if not line.startswith(('#include "ray', '#include "rlgl'))]
    (folder / "drive_without_pictures.h").write_text("\n".join(kept))
    program = Path(__file__).with_suffix(".c")
    command = ["gcc", "-O3", "-march=native", "-w", "-I", str(folder), "-I", source, str(program), "-o", "peer", "-lm"]
    subprocess.run(command, cwd=folder, check=True)
    return folder / "peer"


def _peer_rate(peer: Path, puffer_map: Path, worlds: int) -> float:
    words = [str(peer), str(puffer_map), str(worlds), str(_STEPS)]
    return float(subprocess.run(words, capture_output=True, text=True, check=True).stdout)
