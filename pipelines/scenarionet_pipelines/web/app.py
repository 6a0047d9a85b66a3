"""What the server answers: the page itself, and the questions its scripts ask."""

from __future__ import annotations

import asyncio
import json
import re
import secrets
from dataclasses import asdict
from pathlib import Path

from starlette.applications import Starlette
from starlette.concurrency import run_in_threadpool
from starlette.middleware import Middleware
from starlette.requests import Request
from starlette.responses import FileResponse, JSONResponse, Response
from starlette.routing import Mount, Route
from starlette.staticfiles import StaticFiles

from scenarionet_data import Lake, version
from scenarionet_data.errors import (
    BadParameter,
    DatabaseNotFound,
    LakeError,
    QueryError,
    ScenarioNetError,
    ScenarioNotFound,
)
from scenarionet_pipelines.cli.advice import one_line
from scenarionet_pipelines.web.guards import Guard
from scenarionet_pipelines.web.picture import PICTURE
from scenarionet_pipelines.web.rows import MOST_ROWS, Column, Question, columns, page, plain
from scenarionet_pipelines.web.scenes import Latest, Scenes

STATIC = Path(__file__).with_name("static")

_PLACE = re.compile(r"\bcharacter (\d+)")
_MOST_PARTS = 8
_LOOK_EVERY = 0.2
"""Seconds between looks whether the answer is still waited for."""

_THUMBNAIL_SIDES = range(32, 513)
_KEEP = {"cache-control": "private, max-age=86400, immutable"}
"""For what belongs to a snapshot, whose number the page names in the address."""
_ASK_AGAIN = {"cache-control": "no-store"}


class Browser:
    """A lake and what is known about it, behind one method an address.

    Args:
        lake: The lake.
        is_writable: Whether databases may be saved.
        secret: What the page brings along when it saves one.
    """

    def __init__(self, lake: Lake, *, is_writable: bool, secret: str) -> None:
        self.lake = lake
        self.is_writable = is_writable
        self._secret = secret
        self._columns: dict[str, Column] = {column.name: column for column in columns(lake)}
        self._count = len(lake)
        self._scenes = Scenes(lake)
        self._parts: Latest[Lake] = Latest(_MOST_PARTS)
        self._turn = asyncio.Lock()  # the lake answers one question at a time: who interrupts, interrupts their own

    async def index(self, request: Request) -> Response:  # noqa: ARG002
        """The page."""
        return FileResponse(STATIC / "index.html", headers=_ASK_AGAIN)

    def about(self, request: Request) -> Response:  # noqa: ARG002
        """The lake, its columns and databases, and the colours that pictures have."""
        return JSONResponse(
            {
                "name": self.lake.name,
                "path": str(self.lake.root),
                "snapshot": self.lake.snapshot.number,
                "software": version.name_and_version(),
                "scenarios": self._count,
                "columns": [asdict(column) for column in self._columns.values()],
                "databases": self.lake.databases,
                "picture": PICTURE,
                "isWritable": self.is_writable,
                "secret": self._secret if self.is_writable else None,
            },
            headers=_ASK_AGAIN,
        )

    async def rows(self, request: Request) -> Response:
        """A page of the table; nobody goes on looking for one that is not waited for any more."""
        asked = request.query_params
        wanted = tuple(name for name in asked.get("columns", "").split(",") if name)
        question = Question(
            where=asked.get("where", "").strip() or "true",
            sort=asked.get("sort", "scenario_id"),
            is_falling=asked.get("order") == "falling",
            first=_number(asked.get("first", "0"), range(2**31)),
            count=_number(asked.get("count", "50"), range(1, MOST_ROWS + 1)),
            columns=wanted,
        )
        async with self._turn:
            part = await run_in_threadpool(self._part, asked.get("database", ""))
            asking = asyncio.ensure_future(run_in_threadpool(page, part, question, self._columns))
            while not (await asyncio.wait([asking], timeout=_LOOK_EVERY))[0]:
                if await request.is_disconnected():
                    part.interrupt()
            found = asking.result()
        self._scenes.expect([row["scenario_id"] for row in found.rows])
        return JSONResponse(asdict(found), headers=_ASK_AGAIN)

    def facts(self, request: Request) -> Response:
        """What is known about one scenario."""
        found = self._scenes.facts(_id(request))
        return JSONResponse({name: plain(value) for name, value in found.items()}, headers=_ASK_AGAIN)

    def scene(self, request: Request) -> Response:
        """One scenario, packed."""
        return Response(self._scenes.packed(_id(request)), media_type="application/octet-stream", headers=_KEEP)

    def thumbnail(self, request: Request) -> Response:
        """A small picture of one scenario."""
        asked = request.query_params
        width = _number(asked.get("width", "256"), _THUMBNAIL_SIDES)
        height = _number(asked.get("height", "160"), _THUMBNAIL_SIDES)
        return Response(self._scenes.thumbnail(_id(request), (width, height)), media_type="image/png", headers=_KEEP)

    async def save(self, request: Request) -> Response:
        """Save what the filter shows as a database."""
        if not self.is_writable:
            return JSONResponse({"error": "this server only reads; start it with --write to save databases"}, 403)
        name, where, parent = _texts(await request.body(), "name", "where", "database")
        async with self._turn:
            made = await run_in_threadpool(
                self.lake.filter, where.strip() or "true", name=name, database=parent or None
            )
        return JSONResponse({"reference": made.reference, "count": len(made), "databases": self.lake.databases})

    def _part(self, database: str) -> Lake:
        """The lake, or its part that belongs to a database."""
        if not database:
            return self.lake
        reference = self.lake.database(database).reference  # of a name, the newest version
        return self._parts.get_or(reference, lambda: self.lake.restrict_to(reference))


def make_app(lake: Lake, *, is_writable: bool = False, names: frozenset[str] = frozenset()) -> Starlette:
    """The server's answers.

    Args:
        lake: What is shown.
        is_writable: Whether the page may save databases.
        names: Host names of this machine that the page may be asked for by.
    """
    secret = secrets.token_urlsafe()
    browser = Browser(lake, is_writable=is_writable, secret=secret)
    return Starlette(
        routes=[
            Route("/", browser.index),
            Route("/api/about", browser.about),
            Route("/api/rows", browser.rows),
            Route("/api/facts", browser.facts),
            Route("/api/scene", browser.scene),
            Route("/api/thumbnail", browser.thumbnail),
            Route("/api/databases", browser.save, methods=["POST"]),
            Mount("/static", StaticFiles(directory=STATIC)),
        ],
        middleware=[Middleware(Guard, names=names, secret=secret)],
        exception_handlers={ScenarioNetError: _refused, OSError: _refused},
    )


_STATUS: tuple[tuple[type[Exception], int], ...] = (
    (ScenarioNotFound, 404),
    (DatabaseNotFound, 404),
    (QueryError, 400),
    (LakeError, 409),
)


def _refused(request: Request, error: Exception) -> Response:  # noqa: ARG001
    """An error as the page shows it: in words, with the character of the condition that is meant."""
    text = one_line(error)
    status = next((number for kind, number in _STATUS if isinstance(error, kind)), 500)
    place = _PLACE.search(text)
    return JSONResponse({"error": text, "character": int(place.group(1)) if place else None}, status)


def _id(request: Request) -> str:
    return request.query_params.get("id", "")


def _texts(body: bytes, *names: str) -> list[str]:
    """Values of a JSON object, all of them text."""
    try:
        given = json.loads(body)
    except ValueError:
        given = None
    found = [given.get(name) for name in names] if isinstance(given, dict) else []
    texts = [each for each in found if isinstance(each, str)]
    if len(texts) != len(names):
        raise BadParameter(f"wanted a JSON object with {', '.join(names)}, all of them text")
    return texts


def _number(text: str, allowed: range) -> int:
    if not text.isdecimal() or int(text) not in allowed:
        raise BadParameter(f"wanted a number from {allowed[0]} to {allowed[-1]}, found {text!r}")
    return int(text)
