"""Run by MetaDrive's own interpreter: what its vehicles are capable of, as JSON.

usage: python vehicles.py

Each vehicle drives on an empty, wide and straight road, without lateral limits. Nothing of this project is imported.
"""

from __future__ import annotations

import json
import logging
import math
import sys

MANOEUVRES = {
    "full throttle from rest": (0.0, (0.0, 1.0), 20),
    "coasting": (15.0, (0.0, 0.0), 20),
    "full brake": (15.0, (0.0, -1.0), 10),
    "full lock": (10.0, (1.0, 0.0), 40),
    "full brake at rest": (0.0, (0.0, -1.0), 30),
}
"""Speed at the beginning [m/s], steering and throttle, number of steps of 0.1 s."""


def measure(kind: str) -> dict[str, float]:
    """Return the speed along the heading at the end of each manoeuvre [m/s]."""
    from metadrive.envs import MetaDriveEnv

    config = {
        "map": "SSSS", "traffic_density": 0.0, "horizon": 10_000, "log_level": logging.CRITICAL,
        "out_of_road_done": False, "crash_vehicle_done": False, "crash_object_done": False,
        "vehicle_config": {"vehicle_model": kind, "enable_reverse": False},
    }  # fmt: skip
    found = {}
    env = MetaDriveEnv(config)
    for name, (speed, action, steps) in MANOEUVRES.items():
        env.reset(seed=0)
        vehicle = env.agent
        vehicle.set_velocity([math.cos(vehicle.heading_theta), math.sin(vehicle.heading_theta)], speed)
        for _ in range(steps):
            env.step(list(action))
        ahead = math.cos(vehicle.heading_theta), math.sin(vehicle.heading_theta)
        found[name] = vehicle.velocity[0] * ahead[0] + vehicle.velocity[1] * ahead[1]
    env.close()
    return found


if __name__ == "__main__":
    sys.stdout.write(f"RESULT{json.dumps({kind: measure(kind) for kind in ('static_default', 'xl')})}\n")
