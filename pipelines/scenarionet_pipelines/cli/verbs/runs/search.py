"""``scenarionet runs search``: find the border at which a policy begins to fail."""

from __future__ import annotations

from dataclasses import asdict
from typing import Any

import click

from scenarionet_pipelines.cli.output import count
from scenarionet_pipelines.cli.parameters import look_in_current_folder, output_path, pairs
from scenarionet_pipelines.cli.verb import REPLACE, LakeVerb, argument, option


class SearchVerb(LakeVerb):
    """Find the border at which a policy begins to fail in a logical scenario.

    LOGICAL is a file or a name of the library: see the guide on logical scenarios. The box of its parameters is halved
    where outcomes differ, until the border is within --resolution of the middle of a cell; -p gives a parameter another
    range, or one value. A policy fails where it touches another road user during the recorded time, or by --fail-if.

    The scenarios are stored as version NAME of the dataset logical, those on either side of the border as the database
    NAME_border, and results as runs NAME-00, NAME-01, ... The lake is made if there is none. Run the same command
    again to continue after an interruption.
    """

    examples = (
        "scenarionet runs search lake cut_in --policy careful-human --name careful -p ego_speed=25 -p lateral_time=4",
        "scenarionet runs search lake cut_in --policy my_planner:Planner --name mine --monotone gap -o map.png",
        "scenarionet runs search lake cut_in --policy idm --name idm --fail-if 'nuplan_score < 0.5' --workers 4",
    )
    logical: str = argument("LOGICAL")
    policy: str = option("Policy of the ego, as of `scenarionet sim`.", metavar="NAME")
    name: str = option("Name of the search.", metavar="NAME")
    parameters: tuple[str, ...] = option(
        "Other values of a parameter; repeatable.", "-p", "--parameter", metavar="NAME=VALUES"
    )
    failure: str | None = option("Where the policy fails, over results, metadata.", "--fail-if", metavar="SQL")
    resolution: float = option("How exact the border is, as a share of each range.", default=0.02)
    monotone: tuple[str, ...] = option(
        "A parameter along which the outcome changes at most once; repeatable. Saves simulations.", metavar="NAME"
    )
    most: int = option("Scenarios that may be simulated before the last round.", default=5000, metavar="N")
    traffic: str = option("Policy of the others, as of `scenarionet sim`.", default="replay", metavar="NAME")
    tracker: str = option("What follows the trajectories of a planner.", choices=("lqr", "perfect"), default="lqr")
    seed: int = option("Seed of stochastic policies, and of the controls.", default=0)
    workers: int = option("Number of processes.", default=1, type=click.IntRange(1), metavar="N")
    file: str | None = option("Draw a map: .png, .pdf or .svg.", "-o", "--output", metavar="FILE")
    replace: bool = REPLACE

    def run(self) -> bool:
        from scenarionet_sim.borders.search import SearchSpace, search

        look_in_current_folder(self.policy)
        path = output_path(self.file, "a picture", replace=self.replace) if self.file else None
        settings: dict[str, Any] = {key: getattr(self, key) for key in (
            "logical", "policy", "resolution", "monotone", "most", "traffic", "tracker", "seed"
        )}  # fmt: skip
        settings |= {"failure": self.failure} if self.failure else {}
        space = SearchSpace(parameters=pairs(self.parameters, "-p"), **settings)

        def say_round(number: int, simulated: int) -> None:
            click.echo(f"round {number}: {count(simulated, 'scenario')} simulated", err=True)

        found = search(self.lake, space, name=self.name, workers=self.workers, on_round=say_round)
        if path is not None:
            from scenarionet_sim.borders.picture import save_map

            save_map(found, path)
        low, high = found.failing
        grid = (space.halvings[1] + 1) ** len(found.axes)
        lines = [
            f"{self.policy} fails in {low:.1%} to {high:.1%} of {', '.join(found.axes)}",
            f"the border is known to {found.resolution:.2%} of each range: "
            + (f"database {found.border}" if found.border else "there is none"),
            f"{count(found.simulated, 'scenario')} simulated of a grid of {grid:,}; {found.impossible:,} cannot be",
            f"{found.wrong} of {count(found.controls, 'control')} away from the border differ from what is predicted",
        ]
        lines += [f"wrote {self.file}"] if self.file else []
        if found.border and found.resolution > space.resolution:
            lines.append(
                f"--most {self.most} was reached before --resolution {self.resolution}: raise it, or fix values"
            )
        content = {key: value for key, value in asdict(found).items() if key not in ("regions", "shares")}
        self.say(content | {"failing": [low, high], "grid": grid}, lines)
        return True
