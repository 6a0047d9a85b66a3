"""``scenarionet db overlap``: detect leakage between databases."""

from __future__ import annotations

from dataclasses import asdict

import click

from scenarionet_pipelines.cli.group import verb
from scenarionet_pipelines.cli.output import print_json, print_table
from scenarionet_pipelines.cli.parameters import databases_argument, json_option, lake_argument


@verb(
    "overlap",
    "scenarionet db overlap lake busy_train busy_val",
    "scenarionet db overlap lake train val test --only same_log --strict",
)
@lake_argument
@databases_argument
@click.option("--only", multiple=True, metavar="RULE", help="Apply only this rule; repeatable.")
@click.option("--strict", is_flag=True, help="Exit with code 1 if anything is shared.")
@json_option
def command(lake: str, databases: tuple[str, ...], only: tuple[str, ...], strict: bool, as_json: bool) -> None:
    """Detect leakage between databases such as train and test, pair by pair.

    The rules are SQL files in sql/overlaps: the same scenario, the same content under another id, scenarios from the
    same recording, scenarios that overlap in time, and scenarios with the same ego trajectory. The last one reads
    tracks.
    """
    from scenarionet_data import Lake

    found = Lake(lake).overlap(*databases, kinds=only or None)
    is_clean = not any(each.examples for each in found)
    if as_json:
        print_json({"overlaps": [asdict(each) for each in found], "is_clean": is_clean})
    else:
        rows = [
            (f"{each.first} / {each.second}", each.kind, each.num_first, each.num_second, _example(each.examples))
            for each in found
        ]
        print_table(rows, ("databases", "rule", "of the first", "of the second", "for example"))
    click.get_current_context().exit(1 if strict and not is_clean else 0)


def _example(examples: tuple[tuple[str, str, str], ...]) -> str:
    """The first example: the shared key and, unless it is the key itself, a scenario of each database."""
    if not examples:
        return "-"
    key, *ids = examples[0]
    return ": ".join([key, " / ".join(ids)]) if {key} != {*ids} else key
