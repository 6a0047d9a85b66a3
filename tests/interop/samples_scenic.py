"""Sample a program of Scenic, simulate each scene here, and print what happened, in an environment with Scenic.

``python -m tests.interop.samples_scenic PROGRAM MAP NUMBER STEPS``
"""

from __future__ import annotations

import json
import random
import sys
import time
from itertools import pairwise

import numpy as np
import scenic
from scenic.domains.driving.roads import Network


def main(program: str, road: str, number: int, steps: int) -> dict[str, object]:
    """Return counts, the mean way of the ego [m], and the share of its states on the road."""
    random.seed(0)
    np.random.seed(0)  # noqa: NPY002 - Scenic draws from it
    params = {"map": road, "use2DMap": True}
    sampler = scenic.scenarioFromFile(program, model="scenarionet_sim.bridges.scenic.model", mode2D=True, params=params)
    simulator, network, started = sampler.getSimulator(), Network.fromFile(road), time.process_time()
    simulated, touching, ways, on_road = 0, 0, [], []
    for _ in range(number):
        scene, _ = sampler.generate(maxIterations=5000)
        simulation = simulator.simulate(scene, maxSteps=steps)
        if simulation is None:  # a requirement of the program was not met
            continue
        states = [state[0] for state in simulation.result.trajectory]
        simulated, touching = simulated + 1, touching + bool(simulation.touched)
        ways.append(sum((b - a).norm() for a, b in pairwise(states)))
        on_road += [network.drivableRegion.containsPoint(state) for state in states[::10]]
    return {
        "simulated": simulated, "touching": touching, "way": float(np.mean(ways)), "on_road": float(np.mean(on_road)),
        "seconds": time.process_time() - started,
    }  # fmt: skip


if __name__ == "__main__":
    print(json.dumps(main(sys.argv[1], sys.argv[2], int(sys.argv[3]), int(sys.argv[4]))))
