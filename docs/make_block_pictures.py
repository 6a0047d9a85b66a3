"""Draw every block of generated roads with its traffic into one picture: ``python docs/make_block_pictures.py``."""

from __future__ import annotations

import sys
from pathlib import Path

import numpy as np

from scenarionet_data.converters.pg import Procedural, ProceduralOptions
from scenarionet_data.plots import small_multiples
from scenarionet_data.procedural.options import LETTERS
from scenarionet_data.scenario.description import ScenarioDescription
from scenarionet_data.scenario.vocabulary import is_lane

FOLDER = Path(__file__).parent / "pictures"
LANES = {"B": 1, "P": 1, "Y": 3}
"""Most lanes of blocks that need fewer or more than two."""
AFTER = {"y": "Y", "f": "F"}
"""Blocks that end lanes, after those that open them."""


def of_block(letter: str) -> ScenarioDescription:
    """Generate a scenario in which the block with a letter follows the first road."""
    options = ProceduralOptions(
        sequence=AFTER.get(letter, "") + letter, max_lanes=LANES.get(letter, 2), construction=0.0
    )
    (shard,) = Procedural().shards("4:5", "", "v2", options)
    return Procedural().scenario(shard, 4)


def amid(scenario: ScenarioDescription) -> int:
    """Return the timestep at which the ego is nearest to the middle of the last block."""
    last = f"{len(scenario.extras['blocks']) - 1}."
    rows = [row for row, name in enumerate(scenario.map.ids) if name.startswith(last)]
    lanes = [scenario.map.polyline[row] for row in rows if is_lane(scenario.map.feature_type)[row]]
    points = np.concatenate(lanes)[:, :2]
    middle = (points.min(axis=0) + points.max(axis=0)) / 2.0
    return int(np.hypot(*(scenario.tracks.position[0, :, :2] - middle).T).argmin())


if __name__ == "__main__":
    scenarios = [of_block(letter) for letter in LETTERS]
    titles = [f"{letter}  {name.replace('_', ' ')}" for letter, name in LETTERS.items()]
    figure = small_multiples(
        scenarios, titles, timesteps=[amid(each) for each in scenarios], columns=5, side=2.2, width=130.0
    )
    target = Path(sys.argv[1]) if len(sys.argv) > 1 else FOLDER
    figure.savefig(target / "blocks.webp", dpi=110)
