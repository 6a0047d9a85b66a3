"""``scenarionet runs add``: bring back what another simulator did."""

from __future__ import annotations

from dataclasses import asdict

from scenarionet_pipelines.cli.output import count
from scenarionet_pipelines.cli.verb import LakeVerb, Progressing, argument, option

_NAMED = 5
"""Scenarios of the other simulator that are listed if the lake does not have them."""


class AddVerb(LakeVerb, Progressing):
    """Add what another simulator did with exported scenarios as a run.

    OUTPUT is a lake with its converted output. For SUMO: `scenarionet export LAKE busy_val scenes --format sumo`, run
    it with `--fcd-output scenes/SCENE.fcd.xml`, `scenarionet convert sumo scenes OUTPUT`; likewise commonroad and
    table. Its motion takes the place of the recording in the scenario that was exported, is replayed, and measured as
    runs of `scenarionet sim` are: compare, render, browse and query it like them.

    A scenario is found by the name of its file, which begins with the id, -- for each slash, as `scenarionet export`
    names it; objects by their ids. Objects that are not in the output move as recorded.

    The same command continues after an interruption.
    """

    examples = (
        "scenarionet runs add lake from_sumo --name sumo",
        "scenarionet runs add lake from_sumo --name sumo_15s --episode nuplan",
    )
    output: str = argument("OUTPUT", required=True)
    name: str = option("Name of the run.", metavar="NAME", required=True)
    episode: str = option("The whole recording, or the first 15 s.", choices=("log", "nuplan"), default="log")

    def run(self) -> bool:
        from scenarionet_sim.evaluation.adding import add_run

        with self.progress(f"add {self.name}", "part") as progress:
            added = add_run(self.open(), self.output, self.name, episode=self.episode, on_progress=progress.update)
        lines = [f"{self.name}: {count(added.scenarios - len(added.broken), 'scenario')} measured"]
        if added.unknown_objects:
            lines.append(f"{count(added.unknown_objects, 'object')} without a recording left out")
        if added.unknown_scenarios:
            names = ", ".join(added.unknown_scenarios[:_NAMED])
            lines.append(f"{count(len(added.unknown_scenarios), 'scenario')} not of this lake left out: {names}")
        lines += [f"not measured: {scenario_id}: {reason}" for scenario_id, reason in added.broken]
        self.say(asdict(added), lines)
        return not added.broken
