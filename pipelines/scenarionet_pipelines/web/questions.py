"""Questions of the page about the lake, and the worker process that answers them.

A process can be stopped at any time. A query of DuckDB cannot: it checks for interrupts between blocks of rows, so one
expression such as ``length(repeat('a', 4000000000))`` occupies it for minutes, with memory that its limit does not
count.
"""

from __future__ import annotations

import resource
import sys
import tempfile
from collections.abc import Callable, Mapping
from multiprocessing.connection import Connection
from pathlib import Path
from typing import Any, TypeAlias, TypeVar

from scenarionet_data import Lake
from scenarionet_data.embeddings.search import embeddings_of, similar
from scenarionet_data.errors import BadParameter, ScenarioNetError
from scenarionet_data.execution.worker import follow_parent
from scenarionet_data.query.named_sql import EVENTS
from scenarionet_data.query.statements import check_expression
from scenarionet_pipelines.web.choices import moments_of, source
from scenarionet_pipelines.web.histograms import Histogram, read_histogram
from scenarionet_pipelines.web.rows import Page, PageColumn, PageQuery, plain, read_page

TIMELINE_EVENTS = [name for name in EVENTS.names() if name not in ("closest_approach", "minimum_gap")]
"""Events of the time line; the others are a measurement of every object rather than something that happens."""

Learnt = TypeVar("Learnt")

_MAX_VIEWS = 8
_MOST_ALIKE = 12
_ROOM = 2**29
"""Memory of a question beside DuckDB's, for expressions and the rows of its answer [bytes]."""


class OpenLake:
    """A lake as a worker has opened it.

    Args:
        lake: The lake.
        columns: Its columns by name.
        memory: Memory of a question [bytes].
    """

    def __init__(self, lake: Lake, columns: Mapping[str, PageColumn], memory: int) -> None:
        self.lake = lake
        self.columns = columns
        self._memory = memory
        self._views: dict[str, Lake] = {}
        self._open(lake)

    def _restricted(self, database: str) -> Lake:
        """The lake, restricted to a database if one is named."""
        if not database:
            return self.lake
        reference = self.lake.database(database).reference  # a name alone means its newest version
        return self._view(reference, reference)

    def moments(self, scenario_id: str) -> list[dict[str, Any]]:
        """Return the kept moments of a scenario; see :func:`moments_of`."""
        return moments_of(self.lake, scenario_id)

    def rows(self, query: PageQuery, database: str) -> Page:
        """Return the rows of a page of the table, restricted to a database if one is named; see :func:`read_page`."""
        return read_page(self._restricted(database), query, self.columns)

    def histogram(self, column: str, where: str, database: str, run: str) -> Histogram:
        """Count the values of a numeric column; see :func:`read_histogram`."""
        return read_histogram(self._restricted(database), column, where, self.columns, source(run))

    def events(self, scenario_id: str, event: str) -> list[dict[str, Any]]:
        """Return track, other track, first and last timestep and value of each occurrence of one of TIMELINE_EVENTS."""
        if event not in TIMELINE_EVENTS:
            raise BadParameter(f"no event {event!r}; there are {', '.join(TIMELINE_EVENTS)}")
        found = self._view(f"scenario {scenario_id}", [scenario_id]).mine(event)
        names = "track_id", "other_id", "first_timestep", "last_timestep", "value"
        return [{name: plain(value) for name, value in row.items()} for row in found.select(names).to_dicts()]

    def similar(self, scenario_id: str) -> dict[str, Any]:
        """Return the nearest scenarios with their distances, by the first embedding of the lake if it has one."""
        known = embeddings_of(self.lake)
        found = similar(self.lake, scenario_id, _MOST_ALIKE, known[0], None).to_pylist() if known else []
        return {"by": known[0] if known else None, "similar": found}

    def save(self, name: str, where: str, database: str, run: str) -> tuple[str, int]:
        """Save the scenarios that satisfy a condition as a database; return its reference and number of scenarios."""
        check_expression(where)
        if run:
            where = f"scenario_id IN (SELECT scenario_id FROM {source(run)} WHERE ({where}\n))"
        created = self.lake.filter(where, name=name, database=database or None)
        return created.reference, len(created)

    def _view(self, key: str, scenarios: str | list[str]) -> Lake:
        if key not in self._views:
            if len(self._views) == _MAX_VIEWS:
                del self._views[next(iter(self._views))]
            self._views[key] = self._open(self.lake.restrict_to(scenarios))
        return self._views[key]

    def _open(self, lake: Lake) -> Lake:
        """Open the connection of a lake, and limit the memory that the process may have in addition from here on."""
        len(lake)
        if sys.platform == "linux":
            status = Path("/proc/self/status").read_text()
            used = 1024 * int(status.split("VmData:")[1].split()[0])
            _, hard = resource.getrlimit(resource.RLIMIT_DATA)
            resource.setrlimit(resource.RLIMIT_DATA, (used + self._memory + _ROOM, hard))
        return lake


Question: TypeAlias = Callable[[OpenLake], Learnt]
"""Something to find out about a lake: a method of :class:`OpenLake` with its arguments; picklable, as is the answer."""


def answer_questions(
    connection: Connection, lake: Lake, columns: Mapping[str, PageColumn], memory: int, folder: str
) -> None:
    """Answer the questions that arrive at a connection until it is closed; the target of a worker process.

    The first message is None: the lake is open. Any message may instead be an error, for the other end to raise.

    Args:
        connection: Questions arrive and answers leave here.
        lake: The lake.
        columns: Its columns by name.
        memory: Memory of a question [bytes].
        folder: Folder for temporary files; the other end removes it.
    """
    follow_parent()
    tempfile.tempdir = folder
    try:
        opened = OpenLake(lake, columns, memory)
    except (ScenarioNetError, OSError) as error:
        connection.send(error)
        return
    connection.send(None)
    while True:
        try:
            question: Question[Any] = connection.recv()
        except EOFError:
            return
        try:
            connection.send(question(opened))
        except (ScenarioNetError, OSError) as error:
            connection.send(error)
