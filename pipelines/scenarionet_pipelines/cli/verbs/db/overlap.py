"""``scenarionet db overlap``: detect leakage between databases."""

from __future__ import annotations

from dataclasses import asdict

from scenarionet_pipelines.cli.output import print_json, print_table
from scenarionet_pipelines.cli.verb import DATABASES, LakeVerb, option


class OverlapVerb(LakeVerb):
    """Detect leakage between databases such as train and test, pair by pair.

    The rules are SQL files in sql/overlaps: the same scenario, the same content under another id, scenarios from the
    same recording, scenarios that overlap in time, and scenarios with the same ego trajectory. The last one reads
    tracks.
    """

    examples = (
        "scenarionet db overlap lake busy_train busy_val",
        "scenarionet db overlap lake train val test --only same_log --strict",
    )
    databases: tuple[str, ...] = DATABASES
    only: tuple[str, ...] = option("Apply only this rule; repeatable.", metavar="RULE")
    strict: bool = option("Exit with code 1 if anything is shared.")

    def run(self) -> bool:
        from scenarionet_data import Lake

        found = Lake(self.lake).overlap(*self.databases, kinds=self.only or None)
        is_clean = not any(each.examples for each in found)
        if self.as_json:
            print_json({"overlaps": [asdict(each) for each in found], "is_clean": is_clean})
        else:
            rows = [
                (f"{each.first} / {each.second}", each.kind, each.num_first, each.num_second, example(each.examples))
                for each in found
            ]
            print_table(rows, ("databases", "rule", "of the first", "of the second", "for example"))
        return is_clean or not self.strict


def example(examples: tuple[tuple[str, str, str], ...]) -> str:
    """Return the first example: the shared key and, unless it is the key itself, a scenario of each database."""
    if not examples:
        return "-"
    key, *ids = examples[0]
    return ": ".join([key, " / ".join(ids)]) if {key} != {*ids} else key
