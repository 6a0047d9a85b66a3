"""Draw roads with the traffic of a model that has learned from others: ``python docs/make_traffic_pictures.py``."""

from __future__ import annotations

import sys
from pathlib import Path
from tempfile import TemporaryDirectory

from scenarionet_data import Lake, ScenarioLoader, convert
from scenarionet_data.generation.snapshots import TrafficConfig
from scenarionet_data.generation.training import train
from scenarionet_data.generation.writing import generate
from scenarionet_data.learning.fitting import FitRun
from scenarionet_data.plots import small_multiples

FOLDER = Path(__file__).parent / "pictures"
CONFIG = TrafficConfig(epochs=6, min_vehicles=4)
SHOWN = 4

if __name__ == "__main__":
    with TemporaryDirectory() as folder:
        root = Path(folder) / "lake"
        convert("pg", "0:64", root, version="v2")
        lake = Lake(root)
        lake.filter("hash(scenario_id) % 8 <> 0", name="learned")
        lake.filter("hash(scenario_id) % 8 = 0", name="others", limit=SHOWN)
        train(FitRun(lake, "learned", "traffic"), CONFIG)
        generate(lake, "others", "traffic", name="made")
        lake = Lake(root)
        parents = list(ScenarioLoader(root, "others"))
        made = {
            each.extras["parent"]: each
            for each in ScenarioLoader(root, lake.filter("dataset = 'generated'", name="made"))
        }
        scenarios = [*parents, *(made[each.id] for each in parents)]
        titles = ["parent"] * SHOWN + ["generated"] * SHOWN
        figure = small_multiples(scenarios, titles, timesteps=[10] * 2 * SHOWN, columns=SHOWN, side=2.6, width=120.0)
        target = Path(sys.argv[1]) if len(sys.argv) > 1 else FOLDER
        figure.savefig(target / "traffic.webp", dpi=100)
