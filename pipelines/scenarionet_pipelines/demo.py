"""``make demo``: the whole workflow on generated scenarios, each step as a user would type it."""

from __future__ import annotations

import shlex
import shutil
import sys
import time
from collections.abc import Callable
from pathlib import Path

import click

from scenarionet_pipelines.cli import cli
from scenarionet_pipelines.cli.interrupt import handle_signals
from scenarionet_pipelines.cli.output import duration, print_table

_MARKER = ".made-by-demo"


def run(folder: str, num_scenarios: int = 200) -> None:
    """Generate, inspect, query, filter, split, load, draw and export scenarios.

    Args:
        folder: Output folder; the output of an earlier demo is removed.
        num_scenarios: Number of scenarios to generate.

    Raises:
        UsageError: The folder exists and was not created by the demo.
    """
    output = Path(folder)
    if output.exists() and not (output / _MARKER).exists():
        raise click.UsageError(f"{output} exists and was not made by the demo; choose another folder")
    shutil.rmtree(output, ignore_errors=True)
    output.mkdir(parents=True)
    (output / _MARKER).touch()

    lake, picture, pickles = f"{folder}/lake", f"{folder}/scenario.png", f"{folder}/pickles"
    objects = "SELECT object_type, count(*) AS objects, max(max_speed) AS fastest FROM objects GROUP BY ALL"
    busy = "ego_distance > 10 AND num_objects > 5"
    steps = [
        (f"Generate {num_scenarios} scenarios", _command("convert", "pg", f"0:{num_scenarios}", lake)),
        ("List what the lake contains", _command("list", lake)),
        ("Query it in SQL", _command("sql", lake, objects)),
        ("Filter the busy scenarios", _command("filter", lake, "--where", busy, "--name", "busy")),
        ("Split them", _command("split", lake, "busy", "--fractions", "train=0.9", "val=0.1")),
        ("Load one in Python", lambda: _load(lake)),
        ("Draw it", _command("render", lake, "pg/v2/0", "-o", picture)),
        ("Export pickles for MetaDrive", _command("export", lake, "busy_val", pickles)),
    ]
    started = time.monotonic()
    took = []
    for number, (title, step) in enumerate(steps, start=1):
        click.secho(f"\n{number}. {title}", bold=True)
        step_started = time.monotonic()
        step()
        took.append((number, title, duration(time.monotonic() - step_started)))
    click.secho("\nDone", bold=True)
    print_table([*took, ("", "total", duration(time.monotonic() - started))])
    click.echo(f"Picture: {picture}. Next: scenarionet sql {lake} 'SELECT * FROM metadata LIMIT 3'")


def _command(*words: str) -> Callable[[], None]:
    """A step that prints a command line and runs it; a failure ends the demo."""

    def step() -> None:
        click.echo(f"$ scenarionet {shlex.join(words)}")
        code = cli.main([*words], "scenarionet", standalone_mode=False)
        if code:
            sys.exit(code)

    return step


def _load(lake: str) -> None:
    from scenarionet_data import ScenarioLoader

    click.echo(f'>>> scenario = ScenarioLoader("{lake}", "busy_train")[0]')
    scenario = ScenarioLoader(lake, "busy_train")[0]
    click.echo(">>> scenario.id, scenario.tracks.position.shape, scenario.map.feature_type.shape")
    features = scenario.map.feature_type.shape if scenario.map else None
    click.echo(f"{(scenario.id, scenario.tracks.position.shape, features)}")


@click.command()
@click.argument("folder", default="demo")
def main(folder: str) -> None:
    """Run the demo; its output is written to FOLDER."""
    handle_signals()
    run(folder)


if __name__ == "__main__":
    main()
