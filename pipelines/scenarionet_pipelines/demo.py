"""``make demo``: the main job from nothing to pickles, without a download, each step as one would type it."""

from __future__ import annotations

import shlex
import shutil
import sys
import time
from collections.abc import Callable
from pathlib import Path

import click

from scenarionet_pipelines.cli import cli
from scenarionet_pipelines.cli.interrupt import stop_cleanly
from scenarionet_pipelines.cli.output import duration, print_table

_MARK = ".made-by-demo"


def run(folder: str, num_scenarios: int = 200) -> None:
    """Generate scenarios, look at them, choose, split, load and export.

    Args:
        folder: Made anew; what an earlier demo left there is removed.
        num_scenarios: How many scenarios to generate.
    """
    _clear(Path(folder))
    began = time.monotonic()
    took = []
    for number, (title, step) in enumerate(_steps(f"{folder}/lake", f"{folder}/pickles", num_scenarios), start=1):
        click.secho(f"\n{number}. {title}", bold=True)
        started = time.monotonic()
        step()
        took.append((number, title, duration(time.monotonic() - started)))
    click.secho("\nDone", bold=True)
    print_table([*took, ("", "together", duration(time.monotonic() - began))])
    click.echo(f"Go on with: scenarionet sql {folder}/lake 'SELECT * FROM metadata LIMIT 3'")


def _steps(lake: str, pickles: str, num_scenarios: int) -> list[tuple[str, Callable[[], None]]]:
    """Titles and what to do."""
    where = "ego_distance > 10 AND num_objects > 5"
    kinds = "SELECT object_type, count(*) AS objects, max(max_speed) AS fastest FROM objects GROUP BY ALL"
    return [
        (
            f"Generate {num_scenarios} scenarios (the first time compiles the generator, half a minute)",
            _type("convert", "pg", f"0:{num_scenarios}", lake),
        ),
        ("See what the lake holds", _type("list", lake)),
        ("Ask a question", _type("sql", lake, kinds)),
        ("Choose the busy ones", _type("filter", lake, "--where", where, "--to", "busy")),
        ("Split them", _type("split", lake, "busy", "--fractions", "train=0.9", "val=0.1")),
        ("Load one", lambda: _load(lake)),
        ("Export pickles for MetaDrive", _type("export", lake, "busy_val", pickles, "--format", "scenarionet")),
    ]


def _clear(folder: Path) -> None:
    """Make the folder new; one that the demo did not make stays as it is."""
    if folder.exists() and not (folder / _MARK).exists():
        raise click.UsageError(f"{folder} is there and was not made by the demo; name another folder")
    shutil.rmtree(folder, ignore_errors=True)
    folder.mkdir(parents=True)
    (folder / _MARK).touch()


def _type(*words: str) -> Callable[[], None]:
    """A step that is a command line."""

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
    click.echo(">>> scenario.id, scenario.tracks.position.shape, scenario.map.types.shape")
    features = scenario.map.types.shape if scenario.map else None
    click.echo(f"{(scenario.id, scenario.tracks.position.shape, features)}")


@click.command()
@click.argument("folder", default="demo")
def main(folder: str) -> None:
    """Run the demo in FOLDER."""
    stop_cleanly()
    run(folder)


if __name__ == "__main__":
    main()
