"""Variations made, and concrete cut-ins of 10 s with five vehicles simulated and scored, per second of one core."""

from __future__ import annotations

import tempfile
import time
from collections.abc import Iterator
from pathlib import Path

from scenarionet_data import Lake, convert
from scenarionet_data.logical.description import LIBRARY
from scenarionet_data.variations import VariationSpace, vary
from scenarionet_sim.evaluation.evaluation import plan_evaluation
from scenarionet_sim.evaluation.parts import EvaluationJob, simulate
from scenarionet_sim.rollouts.parts import parts_of
from tests.bench.measure import Figure

_NUMBER = 256
_OTHERS = """
[[actors]]
id = "behind"
speed = "ego_speed"
gap = -30

[[actors]]
id = "ahead"
speed = "ego_speed"
gap = 60

[[actors]]
id = "beside"
speed = "ego_speed"
offset = 3.5
gap = -20
"""


def figures() -> Iterator[Figure]:
    """Rates by processor time, with warm kernels."""
    with tempfile.TemporaryDirectory() as folder:
        lake, file = Path(folder) / "lake", Path(folder) / "cut_in.toml"
        file.write_text((LIBRARY / "cut_in.toml").read_text("utf-8").replace("at = 60", "at = 100") + _OTHERS)
        convert("logical", str(file), lake, options={"number": _NUMBER})
        for policy in ("idm", "careful-human"):
            evaluation = plan_evaluation(lake, None, policy, traffic="idm")
            first, *jobs = (
                EvaluationJob(evaluation, part, None, has_trajectories=False) for part in parts_of(len(Lake(lake)), 32)
            )
            simulate(first)
            started, count = time.process_time(), sum(len(simulate(job)[0]) for job in jobs)
            rate = count / (time.process_time() - started)
            yield Figure(f"vary: cut-ins of {policy} simulated and scored", rate, "1/s per core", ">= 1500")
        parent = Lake(lake).sql("SELECT min(scenario_id) FROM metadata").item()
        space = VariationSpace({"ego.speed": "0.99:1.01", "cutter.delay": "-0.2:0.2"}, 50)
        vary(lake, parent, space, name="warm")
        started = time.process_time()
        made = vary(lake, parent, VariationSpace(space.parameters, 1000), name="v").converted
        yield Figure("vary: variations made and stored", made / (time.process_time() - started), "1/s per core")
