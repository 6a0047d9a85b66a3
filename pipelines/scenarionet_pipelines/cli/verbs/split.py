"""``scenarionet split``: split a database into parts such as train and val."""

from __future__ import annotations

from scenarionet_data.errors import BadParameter
from scenarionet_pipelines.cli.output import count
from scenarionet_pipelines.cli.parameters import pairs
from scenarionet_pipelines.cli.verb import ALLOW_EMPTY, NEW_VERSION, OPTIONAL_DATABASE, Choosing, LakeVerb, option


class SplitVerb(LakeVerb, Choosing):
    """Split a database, or the whole lake, into disjoint parts such as train and val.

    Together the parts contain every scenario. With fractions alone, a hash of the scenario id and the seed decides the
    part: the split is the same on every machine, and a scenario keeps its part as the lake grows. --by source_log keeps
    the scenarios of one recording together; a split that separates them causes a warning. --stratify and --along sort
    all scenarios and meet the fractions exactly. --levels makes a curriculum along the column difficulty.
    """

    examples = (
        "scenarionet split lake busy --fractions train=0.9 val=0.1",
        "scenarionet split lake --fractions train=0.8 val=0.1 test=0.1 --seed 7 --by source_log --strict",
        "scenarionet split lake busy --fractions train=0.8 val=0.2 --stratify city",
        "scenarionet split lake busy --fractions past=0.8 recent=0.2 --along date",
        "scenarionet split lake busy --levels 10",
        "scenarionet split lake --each city",
    )
    database: str | None = OPTIONAL_DATABASE
    fractions: tuple[str, ...] = option("Parts and their fractions, which add up to 1.", metavar="PART=FRACTION ...")
    levels: int | None = option("Instead of fractions: N parts of equal size, from easy to difficult.", metavar="N")
    each: str | None = option("Instead of fractions: one part for each value of this column.", metavar="COLUMN")
    seed: int = option("Seed of the random numbers.", default=0)
    by: str = option("Keep scenarios with equal values in one part.", default="scenario_id", metavar="COLUMN")
    stratify: str | None = option("Keep the proportions of this column's values in every part.", metavar="COLUMN")
    along: str | None = option("Split in the order of this column, for example by date.", metavar="COLUMN")
    name: str | None = option("Name the parts NAME_PART. [default: DATABASE]", metavar="NAME")
    strict: bool = option("Fail if scenarios of one source log are in several parts.")
    replace: bool = NEW_VERSION
    allow_empty: bool = ALLOW_EMPTY

    @classmethod
    def reworded(cls, words: list[str]) -> list[str]:
        """Repeat ``--fractions`` before each of several words that follow it."""
        repeated: list[str] = []
        is_open = False
        for word in words:
            if is_open and not word.startswith("-"):
                repeated += ["--fractions", word]
            else:
                is_open = word == "--fractions"
                repeated += [] if is_open else [word]
        return repeated

    def run(self) -> None:
        lake, wanted, database = self.open(), {}, self.selection(self.database)
        for part, word in pairs(self.fractions, "--fractions").items():
            try:
                wanted[part] = float(word)
            except ValueError as error:
                raise BadParameter(f"--fractions {part} expects a number such as 0.9, found {word!r}") from error
        made = lake.split(**self.given(lake.split) | {"database": database, "fractions": wanted or None})
        total = max(1, sum(map(len, made.values())))
        self.say(
            {part: {"reference": db.reference, "count": len(db)} for part, db in made.items()},
            [f"{db.reference}: {count(len(db), 'scenario')} ({len(db) / total:.1%})" for db in made.values()],
        )
