"""Print the table of the vehicles of ``Kinematic``, ``Fleet``, ``Bullet`` and MetaDrive 0.4.3 in five manoeuvres.

usage: .venv/bin/python -m tests.metadrive.compare_vehicles   (after tests/metadrive/make_environment.sh)
"""

from __future__ import annotations

import json
import subprocess
import sys
from pathlib import Path

import numpy as np

from scenarionet_sim.backends.base import Backend
from scenarionet_sim.backends.bullet import Bullet
from scenarionet_sim.backends.fleet import Fleet
from scenarionet_sim.backends.kinematic import Kinematic
from tests.metadrive.vehicles import MANOEUVRES
from tests.scenarionet_sim.backends.conformance import make_stage, make_state, roll

CAR, LORRY = (4.5, 1.85, 1.5), (10.0, 2.5, 3.5)
HEADINGS = {
    "full throttle from rest": "2 s full throttle from 0",
    "coasting": "2 s coasting from 15",
    "full brake": "1 s full brake from 15",
    "full lock": "4 s full lock from 10",
    "full brake at rest": "3 s full brake from 0",
}


def measure(backend: Backend, size: tuple[float, float, float]) -> dict[str, float]:
    """Return the speed along the heading at the end of each manoeuvre [m/s]."""
    found = {}
    for name, (speed, action, steps) in MANOEUVRES.items():
        session, state = backend.open(make_stage()), make_state(speed=speed)
        state.size[:] = size
        session.reset(0, state)
        *_, heading, vx, vy, _ = roll(session, state, action, steps)[-1, 0]
        found[name] = float(np.cos(heading) * vx + np.sin(heading) * vy)
        session.close()
    return found


def measure_metadrive() -> dict[str, dict[str, float]]:
    """Return the same of MetaDrive's vehicles, by their names."""
    root = Path(__file__).parents[2]
    command = [str(root / ".venv-metadrive" / "bin" / "python"), str(Path(__file__).with_name("vehicles.py"))]
    done = subprocess.run(command, capture_output=True, text=True, check=True)
    found: dict[str, dict[str, float]] = json.loads(done.stdout.rpartition("RESULT")[2])
    return found


def main() -> None:
    """Print the table."""
    theirs = measure_metadrive()
    rows = {
        "`Kinematic()`, car": measure(Kinematic(), CAR),
        "`Bullet()`, car": measure(Bullet(), CAR),
        "MetaDrive `static_default`": theirs["static_default"],
        "`Kinematic(Fleet())`, car": measure(Kinematic(Fleet()), CAR),
        "`Kinematic(Fleet())`, lorry": measure(Kinematic(Fleet()), LORRY),
        "MetaDrive `xl`": theirs["xl"],
    }
    lines = [f"| speed afterwards [m/s] | {' | '.join(HEADINGS.values())} |", "| --- " * (len(HEADINGS) + 1) + "|"]
    lines += [f"| {name} | {' | '.join(f'{row[key]:.1f}' for key in HEADINGS)} |" for name, row in rows.items()]
    sys.stdout.write("\n".join(lines) + "\n")


if __name__ == "__main__":
    main()
