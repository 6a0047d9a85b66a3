"""Multi-agent learning: every vehicle is an agent; reinforcement by displacement against imitation from states."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

from scenarionet_data import Lake
from scenarionet_sim.evaluation.recording import record
from scenarionet_sim.learning.config import PpoConfig, Td3Config, make_learner_config
from scenarionet_sim.learning.experiments.comparison import Claim, Comparison, PublishedFigure, TrainingArm
from scenarionet_sim.learning.experiments.cross_dataset import PUBLISHED_SOURCES, READING_NOTE, prepare

ALGORITHMS = ("ippo", "td3", "copo", "gail", "airl")
EXPERTS = "multi-agent-experts"
"""Run with the experts' observations."""

SMALL = {"steps": 245_760, "worlds": 16, "seats": 24}
"""Settings of the small form, on top of each algorithm's own."""

EVERY = 100
"""About as many steps of a world are between two checkpoints of the small form."""

PAPER = {"steps": 1_000_000}
"""A million steps of agents, as in CoPO's code, with the published settings; not run for this page."""


THE_PAPER = (
    "IPPO, TD3, CoPO, GAIL and AIRL for a million steps on recordings of Waymo (its Table 3, with these six columns). "
    f"{READING_NOTE}"
)


def prepare_experts(lake: str | Path, workers: int = 1) -> Lake:
    """Make the databases of the small form, and record what their vehicles observe; what exists is kept."""
    opened = prepare(lake, workers)
    record(opened, "standin_train", name=EXPERTS, workers=workers)
    return opened


def multi_agent(size: str = "small", prefix: str = "standin") -> Comparison:
    """Return the experiment.

    Args:
        size: ``small``, or ``paper`` for a machine with the datasets.
        prefix: Prefix of the databases ``_train``, ``_val`` and ``_test``.
    """
    arms = []
    for algorithm in ALGORITHMS:
        config = make_learner_config(algorithm, size, SMALL if size == "small" else PAPER)
        if size == "small" and isinstance(config, PpoConfig | Td3Config):
            config = replace(config, checkpoint_every=round(EVERY / config.horizon))
        experts = EXPERTS if config.needs_experts else None
        arms.append(TrainingArm(algorithm, algorithm, config, f"{prefix}_train", f"{prefix}_val", experts))
    test = f"{prefix}_test"
    above = [("copo", "ippo"), ("ippo", "gail"), ("ippo", "airl"), ("copo", "gail"), ("copo", "airl")]
    names = {name: name.upper() for name in ALGORITHMS} | {"copo": "CoPO"}
    claims = []
    for better, worse in above:
        if {better, worse} <= {*ALGORITHMS}:
            why = "Coordination helps" if worse == "ippo" else "Displacement rewards beat adversarial ones"
            claims.append(Claim(f"{why}: {names[better]} succeeds more often than {names[worse]}", better, worse, test))
    results = {"success": 0.579, "route_completion": 0.740}
    published = tuple(
        PublishedFigure("ippo", test, name, value, "Table 3, PPO on Waymo") for name, value in results.items()
    )
    return Comparison(
        "multi-agent", size, tuple(arms), (0, 1, 2), {test: "test"}, tuple(claims),
        ("success", "out_of_road", "timeout", "route_completion", "cost", "distance_to_log"),
        {"train": f"{prefix}_train", "test": test}, THE_PAPER, published,
        {"Waymo": PUBLISHED_SOURCES["Waymo"]},
    )  # fmt: skip
