"""``scenarionet vary``: make variations of scenarios."""

from __future__ import annotations

import tomllib
from pathlib import Path
from typing import Any

import click

from scenarionet_data.errors import BadParameter
from scenarionet_pipelines.cli.conversion_report import report_content
from scenarionet_pipelines.cli.parameters import pairs
from scenarionet_pipelines.cli.verb import REPLACE, Choosing, Distributed, argument, option


class VaryVerb(Choosing, Distributed):
    """Make variations of a scenario, or of each scenario of a database, and store them in the lake.

    moments:NAME varies each of the moments that `scenarionet mine --name NAME` has kept.

    -p TARGET.CHANGE=VALUES varies one thing. TARGET is ego, nearest (the road user nearest to the ego), a track id, or
    of a moment actor or other. CHANGE is speed or pace (factors), start (seconds later), delay (growing smoothly), gap
    (metres further on), offset or drift (metres to the left), size (factor), replace (by 1 a car, 2 a lorry, 3 a
    cyclist, 4 a pedestrian), remove (1 does) or copy (a second one, so many seconds later); lights.start delays all
    lights. VALUES is a range 0.8:1.2, values 0,1 or a distribution of SciPy such as 'norm(0, 2)'.

    Variations are version NAME of the dataset variation; the same command makes the same ones, and goes on where
    it was interrupted. What is not plausible (acceleration, jerk, contact at the start) is quarantined and counted by
    reason, not clipped. The exit code is 1 if none is plausible.

    --file is a TOML file with the table [parameters], and number, seed, method, acceleration, jerk and margin (time
    kept around moments in seconds); options win.
    """

    examples = (
        "scenarionet vary lake waymo/v1.2/637f20cafde22ff8 --name faster -p ego.speed=0.9:1.1 -p nearest.gap=-5:5",
        "scenarionet vary lake cut_ins --name v --number 100 --method sobol -p 'nearest.speed=norm(1, 0.05)'",
        "scenarionet vary lake cut_ins --name v --file variation.toml --workers 2",
        "scenarionet vary lake moments:risky --name v --number 100 -p actor.delay=-1:1 -p actor.drift=-0.5:0.5",
    )
    lake: str = argument()
    scenarios: str = argument("SCENARIO|DATABASE|moments:NAME")
    name: str = option("Name of the variations.", metavar="NAME")
    parameters: tuple[str, ...] = option(
        "What to vary; repeatable.", "-p", "--parameter", metavar="TARGET.CHANGE=VALUES"
    )
    file: str | None = option("Parameters and settings in TOML.", metavar="FILE")
    number: int | None = option("Variations of each scenario. [default: 1000]", metavar="N")
    seed: int | None = option("Seed of the random numbers. [default: 0]", metavar="N")
    method: str | None = option("How values are drawn. [default: random]", choices=("random", "sobol", "latin"))
    replace: bool = REPLACE

    def run(self) -> bool:
        from scenarionet_data.variations import VariationSpace, vary
        from scenarionet_data.variations.moment_windows import MOMENTS

        if (self.order_by or self.limit) and self.scenarios.startswith(MOMENTS):
            raise click.UsageError(
                "--order-by and --limit are of databases; `filter --moments` saves the first moments"
            )
        settings = read_settings(self.file) if self.file else {}
        given = settings.pop("parameters", {}) | pairs(self.parameters, "-p")
        typed = {"number": self.number, "seed": self.seed, "method": self.method}
        settings |= {key: value for key, value in typed.items() if value is not None}
        with self.execution() as execution, self.progress(f"vary {self.scenarios}", "shard") as progress:
            report = vary(
                self.lake, self.chosen(self.scenarios) or (), VariationSpace(given, **settings), name=self.name,
                replace=self.replace, workers=self.num_workers, executor=execution.executor,
                on_progress=progress.update,
            )  # fmt: skip
        self.say(*report_content(report, self.lake))
        return not report.failed and (report.converted > 0 or not report.quarantined)


def read_settings(file: str) -> dict[str, Any]:
    """Read a TOML file of a variation.

    Raises:
        BadParameter: It is no such file, or has an unknown key.
    """
    try:
        found = tomllib.loads(Path(file).read_text("utf-8"))
    except (OSError, ValueError) as error:
        raise BadParameter(f"{file}: {error}; wanted a TOML file with a table [parameters]") from error
    kinds: dict[str, Any] = {"parameters": dict, "number": int, "seed": int, "method": str}
    kinds |= {"acceleration": float | int, "jerk": float | int, "margin": float | int}
    wrong = [key for key, value in found.items() if key not in kinds or not isinstance(value, kinds[key])]
    if wrong:
        raise BadParameter(f"{file}: {wrong[0]!r} = {found[wrong[0]]!r}; wanted {', '.join(kinds)}")
    return found
