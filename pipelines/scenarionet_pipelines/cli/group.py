"""Groups of verbs: lazy loading, help, errors as one line."""

from __future__ import annotations

import difflib
import errno
import importlib
import warnings
from collections.abc import Mapping
from functools import cache
from typing import Any

import click

from scenarionet_data.errors import (
    DatabaseNotFound,
    LakeError,
    QueryError,
    ScenarioNetError,
    SourceNotFound,
    UserColumnNotFound,
)
from scenarionet_pipelines.cli import address_space
from scenarionet_pipelines.cli.deprecated import MOVED, current_verb
from scenarionet_pipelines.cli.interrupt import Interrupted, interruptible, received
from scenarionet_pipelines.cli.verb import VerbCommand
from scenarionet_pipelines.messages import one_line
from scenarionet_pipelines.verb_tree import GROUPS

_USAGE_ERRORS = (QueryError, SourceNotFound, DatabaseNotFound, UserColumnNotFound)
"""Usage errors (exit code 2); all other errors concern data (exit code 1)."""
_EXPLAINED = (ScenarioNetError, click.ClickException, click.Abort, SystemExit)


@cache
def find_verb(name: str) -> VerbCommand:
    """Import a verb by its name, with its group: ``db tag`` is ``TagVerb`` in ``verbs/db`` or ``verbs/db/tag.py``."""
    *group, word = name.split()
    place, kind = ".".join(("scenarionet_pipelines.cli.verbs", *group)), f"{word.title()}Verb"
    module = importlib.import_module(place)
    if not hasattr(module, kind):
        module = importlib.import_module(f"{place}.{word}")
    return VerbCommand(word, getattr(module, kind))


class Verbs(click.Group):
    """Verbs by section, each imported on use from ``verbs/``, or from the folder of the group there."""

    def __init__(self, *args: Any, sections: Mapping[str, tuple[str, ...]], folder: str = "", **kwargs: Any) -> None:
        super().__init__(*args, **kwargs)
        self._sections = sections
        self._folder = folder

    def list_commands(self, ctx: click.Context) -> list[str]:  # noqa: ARG002
        """Names of all verbs, in the order of the help."""
        return [name for names in self._sections.values() for name in names]

    def get_command(self, ctx: click.Context, name: str) -> click.Command | None:
        """Import the verb of that name."""
        if name not in self.list_commands(ctx):
            return None
        return find_verb(f"{self._folder} {name}".strip())

    def resolve_command(self, ctx: click.Context, args: list[str]) -> Any:
        """Resolve a verb; an unknown one is an error that names similar verbs."""
        known = self.list_commands(ctx)
        if args and args[0] not in known and not args[0].startswith("-"):
            near = difflib.get_close_matches(args[0], [*known, *MOVED], n=3) or known
            ctx.fail(f"no verb {args[0]!r}; did you mean {', '.join(' '.join(MOVED.get(n, (n,))) for n in near)}?")
        return super().resolve_command(ctx, args)

    def format_commands(self, ctx: click.Context, formatter: click.HelpFormatter) -> None:
        """Write the verbs by section, each with the first sentence of its help."""
        for title, names in self._sections.items():
            verbs = [(name, self.get_command(ctx, name)) for name in names]
            with formatter.section(title):
                formatter.write_dl([(name, found.get_short_help_str(90)) for name, found in verbs if found])


class CommandLine(Verbs):
    """The verbs without a group, and the groups; prints errors as one line with an exit code."""

    def list_commands(self, ctx: click.Context) -> list[str]:
        """Names of all verbs without a group, and of the groups."""
        return [*super().list_commands(ctx), *GROUPS]

    def get_command(self, ctx: click.Context, name: str) -> click.Command | None:
        """Return a group, or import a verb."""
        if name not in GROUPS:
            return super().get_command(ctx, name)
        doc, verbs = GROUPS[name]
        return Verbs(name, sections={"Verbs": verbs}, folder=name, help=doc, no_args_is_help=True)

    def resolve_command(self, ctx: click.Context, args: list[str]) -> Any:
        """Resolve a verb or a group; verbs that moved into a group are found there."""
        return super().resolve_command(ctx, current_verb(args))

    def format_commands(self, ctx: click.Context, formatter: click.HelpFormatter) -> None:
        """Write the verbs, then the groups with the names of their verbs."""
        super().format_commands(ctx, formatter)
        with formatter.section("More, in groups (scenarionet GROUP --help)"):
            formatter.write_dl([(name, f"{doc} [{', '.join(verbs)}]") for name, (doc, verbs) in GROUPS.items()])

    def invoke(self, ctx: click.Context) -> Any:
        """Run a verb; a signal or an error of the project becomes one line on standard error and an exit code."""
        scarcity = address_space.reserve_less_if_limited()
        if scarcity:
            click.echo(f"warning: memory may not suffice: {scarcity}", err=True)
        with warnings.catch_warnings():
            warnings.showwarning = lambda message, *_: click.echo(f"warning: {one_line(message)}", err=True)
            try:
                with interruptible():
                    return super().invoke(ctx)
            except (Interrupted, click.exceptions.Exit):
                raise
            except BaseException as error:
                if isinstance(error, KeyboardInterrupt) or received():  # errors after a signal are its consequences
                    raise Interrupted("stopped before the end") from error
                if isinstance(error, MemoryError) or (scarcity and not isinstance(error, _EXPLAINED)):
                    cause = f": {scarcity}" if scarcity else ""
                    error = LakeError(f"out of memory{cause}; take fewer scenarios or workers, or a larger machine")
                is_explained = (
                    isinstance(error, (ScenarioNetError, OSError)) and getattr(error, "errno", 0) != errno.EPIPE
                )
                if ctx.params["debug"] or not is_explained:
                    raise
                click.echo(f"error: {one_line(error)}", err=True)
                ctx.exit(2 if isinstance(error, _USAGE_ERRORS) else 1)
