"""``scenarionet runs regress``: is a new policy no worse than an old one?"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import asdict, fields
from typing import TYPE_CHECKING

import click

from scenarionet_pipelines.cli.interrupt import keeping
from scenarionet_pipelines.cli.output import count, table
from scenarionet_pipelines.cli.parameters import look_in_current_folder
from scenarionet_pipelines.cli.verb import Choosing, DatabaseVerb, Progressing, option

if TYPE_CHECKING:
    from scenarionet_sim.regression.judgement import MeasuredChange
    from scenarionet_sim.regression.regress import RegressionReport

_FEW = 3
_LISTED = 5
"""Scenarios of a kind of failures that are listed."""


class RegressVerb(DatabaseVerb, Choosing, Progressing):
    """Simulate an old and a new policy on the same scenarios with the same seeds, and judge the new one.

    Policies are those of `scenarionet sim`. One measure decides, chosen before: --primary. The others are corrected for
    their number and listed if they differ. What the lake has of a deterministic policy, with the same code on the same
    scenario, is not simulated again.

    Exits with 0 if the new policy is better, or no worse: the whole 95 % interval is above -MARGIN, or no scenario
    differs; with 1 if it is significantly worse, and with 2 if there are too few scenarios to tell, or for a mistake in
    the command.
    """

    examples = (
        "scenarionet runs regress lake cut_ins --policy git:main:my_planner:Planner my_planner:Planner",
        "scenarionet runs regress lake cut_ins --policy my_planner:Planner@v1 my_planner:Planner@v2 --json",
        "scenarionet runs regress lake val --policy idm-planner lane-graph --primary success --margin 0.05",
    )
    policy: tuple[str, str] = option("The old policy, and the new one.", nargs=2, metavar="OLD NEW")
    primary: str = option("The measure that decides.", default="nuplan_score", metavar="MEASURE")
    margin: float = option("What of it may be lost, for `no worse`.", default=0.02)
    level: float = option("Probability of a false alarm.", default=0.05)
    old_python: str = option(
        "Interpreter of the old policy, or its requirements (.txt).", default="", show_default=False, metavar="FILE"
    )
    new_python: str = option(
        "Interpreter of the new policy, or its requirements (.txt).", default="", show_default=False, metavar="FILE"
    )
    traffic: str = option("Policy of the others, as of `scenarionet sim`.", default="replay", metavar="NAME")
    backend: str = option("Vehicle dynamics: kinematic or bullet.", default="kinematic", metavar="NAME")
    tracker: str = option("What follows the trajectories of a planner.", choices=("lqr", "perfect"), default="lqr")
    route: str = option("Route of the ego, as of `scenarionet sim`.", choices=("log", "lanes"), default="log")
    episode: str = option("What to drive.", choices=("log", "nuplan", "wosac"), default="log")
    rollouts: int = option("Rollouts of each scenario.", type=click.IntRange(1), default=1, metavar="N")
    seed: int = option("Seed of stochastic policies, the same for both.", default=0)
    fresh: bool = option("Simulate everything again.")
    folder: str | None = option(
        "Write the smallest scenario of each new failure, and a test for pytest.", "-o", "--output", metavar="FOLDER"
    )
    most: int = option("Failures that are reduced.", type=click.IntRange(1), default=50, metavar="N")
    workers: int = option("Number of processes.", default=1, type=click.IntRange(1), metavar="N")

    def run(self) -> bool:
        from scenarionet_sim.regression.regress import RegressionPlan, regress

        for each in self.policy:
            look_in_current_folder(each)
        given = {each.name: getattr(self, each.name) for each in fields(RegressionPlan) if hasattr(self, each.name)}
        plan = RegressionPlan(*self.policy, **given)
        with self.progress(f"regress {self.database}", "part") as progress, keeping(lambda: "finished parts are kept"):
            found = regress(
                self.open(),
                self.saved(self.database),
                plan,
                workers=self.workers,
                fresh=self.fresh,
                folder=self.folder,
                most=self.most,
                on_progress=progress.update,
            )
        judgement = found.judgement
        self.say(asdict(found) | {"sentence": judgement.sentence()}, regression_lines(found))
        if judgement.verdict == "undecided":
            click.get_current_context().exit(2)
        return judgement.verdict != "worse"


def regression_lines(found: RegressionReport) -> Iterator[str]:
    """Yield how the policies were simulated, what differs, the kinds of failures and the verdict."""
    judgement = found.judgement
    for name, policy in (("old", found.old), ("new", found.new)):
        counts = f"{policy.simulated:,} simulated, {policy.reused:,} known before"
        yield f"{name}: {policy.policy}, {policy.determinism}: {counts} (runs {', '.join(policy.runs)})"
    rows = [_row(judgement.primary, "decides")]
    rows += [_row(each, word) for each in judgement.others if (word := each.significantly(judgement.level))]
    yield from table(rows, ["", "old", "new", "change [95 %]", "p", ""])
    for cluster in judgement.clusters:
        yield f"{count(len(cluster.failures), 'new failure')}: {cluster.kind} ({cluster.speed})"
        for each in cluster.failures[:_LISTED]:
            yield f"  {each.scenario_id} {each.change:+.3f} {each.error}".rstrip()
    if any(judgement.broken):
        yield "could not be simulated: {:,} with the old policy, {:,} with the new one".format(*judgement.broken)
    if found.reproductions:
        sizes = sorted(each.road_users for each in found.reproductions)
        exact = sum(each.is_exact for each in found.reproductions)
        few = sum(size <= _FEW for size in sizes)
        yield (
            f"{count(len(sizes), 'failure')} reduced: {few:,} to at most {_FEW} road users, {sizes[-1]} at most; "
            f"{exact:,} fail again bit by bit"
        )
    yield from found.notes
    yield judgement.sentence()


def _row(each: MeasuredChange, word: str) -> tuple[str, ...]:
    change = f"{each.change:+.4f} [{each.low:+.4f}, {each.high:+.4f}]"
    return each.measure, f"{each.old:.4f}", f"{each.new:.4f}", change, f"{each.p_value:.2g}", word
