"""A verb of the command line is a class: its fields are arguments and options, its docstring is the help.

A field is declared once, as ``seed: int = option("Seed of the random numbers.", default=0)``. Its annotation says the
rest: ``bool`` is a flag, ``tuple`` may be repeated, and a type without ``None`` and without a default is required.
"""

from __future__ import annotations

import re
import types
from collections.abc import Callable, Iterable, Mapping
from contextlib import AbstractContextManager
from dataclasses import dataclass, field
from inspect import signature
from itertools import islice
from typing import TYPE_CHECKING, Any, ClassVar, TypeVar, Union, get_args, get_origin, get_type_hints

import click

from scenarionet_pipelines.cli.deprecated import current_options
from scenarionet_pipelines.cli.output import print_json
from scenarionet_pipelines.cli.parameters import FiniteRange

if TYPE_CHECKING:
    from scenarionet_data import Database, Lake
    from scenarionet_data.query.lake_view import LakeView
    from scenarionet_pipelines.cli.execution import Execution
    from scenarionet_pipelines.cli.progress import ProgressDisplay


@dataclass(frozen=True)
class Parameter:
    """Declaration of an argument or option; see :func:`argument` and :func:`option`.

    Attributes:
        kind: Class of the parameter.
        spellings: Its spellings; without any, the name of the field.
        settings: Further settings of click.
    """

    kind: type[click.Parameter]
    spellings: tuple[str, ...] = ()
    settings: dict[str, Any] = field(default_factory=dict)

    def declared(self, name: str, hint: Any) -> click.Parameter:
        """Return the parameter of click for a field.

        Args:
            name: Name of the field.
            hint: Its type.
        """
        is_union = get_origin(hint) in (Union, types.UnionType)
        (wanted, *_) = get_args(hint) if is_union else (hint,)
        is_tuple, default = get_origin(wanted) is tuple, self.settings.get("default")
        settings = dict(self.settings)
        if self.kind is click.Argument:
            is_required = settings.setdefault("required", not is_union)
            settings.update({"nargs": -1} if is_tuple else {})
            if "metavar" not in settings and not is_required:
                settings["metavar"] = f"[{name.upper()}]"
            return click.Argument([name], **settings)
        if wanted is bool:
            settings.setdefault("is_flag", True)
        else:
            settings.setdefault("type", str if is_tuple else wanted)
            settings.setdefault("show_default", default is not None)
            settings["required"] = default is None and not is_union and ("nargs" in settings or not is_tuple)
        spellings = self.spellings or ("--" + name.replace("_", "-"),)
        return click.Option([*spellings, name], multiple=is_tuple and "nargs" not in settings, **settings)


def argument(metavar: str | None = None, **settings: Any) -> Any:
    """Declare an argument as a field of a verb."""
    return Parameter(click.Argument, (), settings | ({} if metavar is None else {"metavar": metavar}))


def option(text: str, *spellings: str, choices: tuple[str, ...] = (), **settings: Any) -> Any:
    """Declare an option as a field of a verb.

    Args:
        text: The help.
        spellings: Spellings other than the name of the field.
        choices: The values that it may have.
        settings: Further settings of click, for example ``default`` and ``metavar``.
    """
    kind = {"type": click.Choice(choices)} if choices else {}
    return Parameter(click.Option, spellings, {"help": text} | kind | settings)


DatabaseName = TypeVar("DatabaseName", str, "str | None")
"""Name of a database, or None for the whole lake where it may be left out."""

OPTIONAL_DATABASE = argument("[DATABASE]")
DATABASES = argument("DATABASE...")
OPTIONAL_DATABASES = argument("[DATABASE]...", required=False)
DATABASE = option("Search this database instead of the whole lake.", metavar="DATABASE")
NEW_VERSION = option("Save a new version if a database of that name exists.")
PARAMETERS = option("Value of a parameter; repeatable.", "-p", "--parameter", metavar="NAME=VALUE")
SNAPSHOT = option("Read this snapshot instead of the newest.", type=click.IntRange(0), metavar="N")
ALLOW_EMPTY = option("Save the database even if it has no scenarios.")
REPLACE = option("Overwrite existing output.")
ORDER_BY = option("Order the scenarios by this, as 'difficulty DESC'; unknown values come last.", metavar="EXPR")
EGO = option(
    "Of moments: who is the ego, the recording's or who has a role.", choices=("ego", "actor", "other"), default="ego"
)
MARGIN = option("Of moments: time kept before and after each [s].", type=FiniteRange(0.0), default=2.0)
LIMIT = option("Keep the first N scenarios.", type=click.IntRange(1), metavar="N")


class Verb:
    """A verb; its subclass ``TagVerb`` in ``verbs/db/tag.py`` is ``scenarionet db tag``.

    Attributes:
        examples: Complete command lines, shown by ``--help``; a test parses each.
    """

    examples: ClassVar[tuple[str, ...]] = ()
    as_json: bool = option("Print one JSON object.", "--json")

    def run(self) -> bool | None:
        """Do it and print the result; return False for a problem with data, exit code 1."""
        raise NotImplementedError

    def given(self, function: Callable[..., Any]) -> dict[str, Any]:
        """Return the values of the arguments and options that a function has parameters of the same name for."""
        names = signature(function).parameters
        return {name: value for name, value in vars(self).items() if name in names}

    def say(self, content: Mapping[str, Any], text: str | Iterable[str]) -> None:
        """Print the result: one JSON object with ``--json``, otherwise a line or lines of text."""
        if self.as_json:
            print_json(content)
        else:
            for line in [text] if isinstance(text, str) else text:
                click.echo(line)

    def complain(self, problems: Iterable[str], limit: int | None = 5) -> None:
        """Print the first problems on standard error, at most ``limit``; ``--json`` has all of them in the object."""
        for problem in islice(problems, 0 if self.as_json else limit):
            click.echo(problem, err=True)

    @classmethod
    def reworded(cls, words: list[str]) -> list[str]:
        """Return words as typed in the form that click parses."""
        return words


class LakeVerb(Verb):
    """A verb about a lake."""

    lake: str = argument()

    def open_view(self) -> LakeView:
        """Open the lake for queries only, without the modules of everything else that can be done with it."""
        from scenarionet_data.query.lake_view import LakeView

        return LakeView(self.lake, vars(self).get("snapshot"))

    def open(self) -> Lake:
        """Open the lake, at the snapshot that ``--snapshot`` names."""
        from scenarionet_data import Lake

        return Lake(self.lake, vars(self).get("snapshot"))


class DatabaseVerb(LakeVerb):
    """A verb about one database of a lake."""

    database: str = argument()


class Choosing(Verb):
    """A verb about the scenarios of a database, or the first of them in an order."""

    lake: str
    order_by: str | None = ORDER_BY
    limit: int | None = LIMIT

    def selection(self, database: str | None) -> Database | str | None:
        """Return the database, or a selection of its first scenarios where an order or a limit is given."""
        if self.order_by is None and self.limit is None:
            return database
        from scenarionet_data import Lake

        return Lake(self.lake).select(database=database, order_by=self.order_by, limit=self.limit)

    def chosen(self, database: str | None) -> list[str] | str | None:
        """Return the database, or the ids of its first scenarios where an order or a limit is given."""
        found = self.selection(database)
        return found if found is None or isinstance(found, str) else found.scenario_ids

    def saved(self, database: DatabaseName) -> DatabaseName:
        """Return the name of the database, or of one with its first scenarios, which is saved unless there is one."""
        first = self.selection(database)
        if first is None or isinstance(first, str):
            return database
        words = [self.source(database), *([] if self.order_by is None else ["by", self.order_by])]
        name = re.sub(r"[^A-Za-z0-9._]+", "-", " ".join(words)).strip("-")
        if name in first.view.databases and first.view.record(name).scenario_ids == first.scenario_ids:
            return name
        made = first.save(name, replace=True)
        click.echo(f"saved {made.reference}, {len(made):,} scenarios", err=True)
        return made.reference

    def source(self, name: str | None) -> str:
        """Return what a run over these scenarios of a database is called."""
        return (name or "all") + ("" if self.limit is None else f"-first{self.limit}")


class Saving(Verb):
    """A verb that saves a database."""

    name: str = option("Name of the new database.", metavar="NAME")
    replace: bool = NEW_VERSION


class CombinationVerb(LakeVerb, Saving):
    """A verb that combines databases into a new one."""

    databases: tuple[str, ...] = DATABASES
    allow_empty: bool = ALLOW_EMPTY

    def combined(self, operation: Callable[..., Database]) -> Database:
        """Return what an operation makes of the databases."""
        return operation(*self.databases, name=self.name, replace=self.replace, allow_empty=self.allow_empty)


class Progressing(Verb):
    """A verb that shows its progress."""

    quiet: bool = option("Do not print progress.")

    def progress(self, task: str, step: str = "scenario") -> ProgressDisplay:
        """Return the display of the progress of a task."""
        from scenarionet_pipelines.cli.progress import ProgressDisplay

        return ProgressDisplay(task, step, is_quiet=self.quiet)


class Distributed(Progressing):
    """A verb whose jobs run in processes or on a cluster."""

    workers: int | None = option(
        "Number of processes. [default: one per core and 2 GB of memory]", type=click.IntRange(1), metavar="N"
    )
    cluster: str | None = option(
        "Run on a Dask cluster: `local`, the name of a profile, a profile file, or a scheduler's tcp:// address.",
        metavar="NAME",
    )

    @property
    def num_workers(self) -> int:
        """Number of processes on this machine."""
        from scenarionet_pipelines import machine

        return self.workers or machine.default_workers()

    def execution(self) -> AbstractContextManager[Execution]:
        """Open the executor that the options select."""
        from scenarionet_pipelines.cli.execution import executor_from_options

        return executor_from_options(self.cluster, self.workers, quiet=self.quiet)


class VerbCommand(click.Command):
    """The command of a verb, whose help ends with examples."""

    def __init__(self, name: str, kind: type[Verb]) -> None:
        fields = [(key, each) for base in kind.__mro__ for key, each in vars(base).items()]
        declared = {key: each for key, each in reversed(fields) if isinstance(each, Parameter)}
        hints = get_type_hints(kind)
        arguments = [key for base in reversed(kind.__mro__) for key in vars(base) if key in declared]
        options = dict.fromkeys(key for key, each in fields if isinstance(each, Parameter))
        order = [key for key in dict.fromkeys(arguments) if declared[key].kind is click.Argument]
        order += [key for key in options if declared[key].kind is click.Option]
        params = [declared[key].declared(key, hints[key]) for key in order]
        super().__init__(name, params=params, help=kind.__doc__, callback=self.run)
        self.kind, self.examples = kind, kind.examples

    def run(self, **given: Any) -> None:
        """Run the verb with the parsed values."""
        verb = self.kind()
        vars(verb).update(given)
        click.get_current_context().exit(1 if verb.run() is False else 0)

    def parse_args(self, ctx: click.Context, args: list[str]) -> list[str]:
        """Parse the arguments; renamed options are accepted with a note."""
        return super().parse_args(ctx, current_options(self.name or "", self.kind.reworded(args)))

    def format_epilog(self, ctx: click.Context, formatter: click.HelpFormatter) -> None:  # noqa: ARG002
        """Write the examples."""
        with formatter.section("Examples"):
            for example in self.examples:
                formatter.write(f"  {example}\n")
