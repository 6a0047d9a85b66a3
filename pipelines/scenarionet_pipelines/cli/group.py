"""How verbs are found, explained, and reported on when they fail."""

from __future__ import annotations

import difflib
import errno
import importlib
import warnings
from collections.abc import Callable, Mapping
from typing import Any

import click

from scenarionet_data.errors import (
    DatabaseNotFound,
    QueryError,
    ScenarioNetError,
    SourceNotFound,
    UserColumnNotFound,
)
from scenarionet_pipelines.cli.interrupt import Interrupted

_USAGE = (QueryError, SourceNotFound, DatabaseNotFound, UserColumnNotFound)
"""What the user typed is at fault (exit code 2); every other error is about data (exit code 1)."""


class Verb(click.Command):
    """A command with examples, which its help prints and a test parses."""

    def __init__(self, *args: Any, examples: tuple[str, ...] = (), **kwargs: Any) -> None:
        super().__init__(*args, **kwargs)
        self.examples = examples

    def format_epilog(self, ctx: click.Context, formatter: click.HelpFormatter) -> None:  # noqa: ARG002
        """Write the examples."""
        with formatter.section("Examples"):
            for example in self.examples:
                formatter.write(f"  {example}\n")


def verb(name: str, *examples: str, cls: type[Verb] = Verb) -> Callable[[Callable[..., Any]], Verb]:
    """Make a function a verb.

    Args:
        name: What is typed.
        examples: Whole command lines.
        cls: The verb's class.
    """
    return click.command(name, cls=cls, examples=examples, no_args_is_help=False)


class Verbs(click.Group):
    """The group of all verbs: loads each from its file, and turns errors into one line and an exit code."""

    def __init__(self, *args: Any, sections: Mapping[str, tuple[str, ...]], **kwargs: Any) -> None:
        super().__init__(*args, **kwargs)
        self._sections = sections

    def list_commands(self, ctx: click.Context) -> list[str]:  # noqa: ARG002
        """Names of all verbs."""
        return [name for names in self._sections.values() for name in names]

    def get_command(self, ctx: click.Context, name: str) -> click.Command | None:
        """The verb of that name, from its file."""
        if name not in self.list_commands(ctx):
            return None
        command: click.Command = importlib.import_module(f"scenarionet_pipelines.cli.verbs.{name}").command
        return command

    def resolve_command(self, ctx: click.Context, args: list[str]) -> Any:
        """Like click's, with the nearest verbs when there is none of that name."""
        if args and args[0] not in self.list_commands(ctx) and not args[0].startswith("-"):
            near = difflib.get_close_matches(args[0], self.list_commands(ctx), n=3) or self.list_commands(ctx)
            ctx.fail(f"no verb {args[0]!r}; did you mean {', '.join(near)}?")
        return super().resolve_command(ctx, args)

    def format_commands(self, ctx: click.Context, formatter: click.HelpFormatter) -> None:
        """Write the verbs by section, each with its first sentence."""
        for title, names in self._sections.items():
            verbs = [(name, self.get_command(ctx, name)) for name in names]
            with formatter.section(title):
                formatter.write_dl([(name, found.get_short_help_str(90)) for name, found in verbs if found])

    def invoke(self, ctx: click.Context) -> Any:
        """Run a verb; whatever goes wrong on purpose becomes one line on standard error."""
        with warnings.catch_warnings():
            warnings.showwarning = _show_warning  # type: ignore[assignment]  # the other parameters are of no use
            try:
                return super().invoke(ctx)
            except KeyboardInterrupt as error:
                raise Interrupted("stopped before the end") from error
            except (ScenarioNetError, OSError) as error:
                if ctx.params["debug"] or getattr(error, "errno", None) == errno.EPIPE:
                    raise
                click.echo(f"error: {one_line(error)}{_remedy(error)}", err=True)
                ctx.exit(2 if isinstance(error, _USAGE) else 1)


def one_line(error: BaseException | str) -> str:
    """An error's message in one line, without the excerpt of the query that DuckDB appends."""
    lines = str(error).splitlines()
    end = next((number for number, line in enumerate(lines) if line.startswith("LINE ")), len(lines))
    return " ".join(" ".join(lines[:end]).split())


def _remedy(message: BaseException | str) -> str:
    """Return the remedy on the command line, where the message advises in Python."""
    remedy = getattr(message, "cli_remedy", "")
    return f" (on the command line: {remedy})" if remedy else ""


def _show_warning(message: Warning | str, category: type[Warning], *rest: Any) -> None:  # noqa: ARG001
    click.echo(f"warning: {message}{_remedy(message)}", err=True)
