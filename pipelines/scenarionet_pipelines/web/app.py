"""Routes of the server: the page and the JSON, binary and image requests of its scripts."""

from __future__ import annotations

import asyncio
import json
import re
import secrets
from dataclasses import asdict
from functools import partial
from pathlib import Path

from starlette.applications import Starlette
from starlette.concurrency import run_in_threadpool
from starlette.middleware import Middleware
from starlette.requests import ClientDisconnect, Request
from starlette.responses import FileResponse, JSONResponse, Response, StreamingResponse
from starlette.routing import Mount, Route
from starlette.staticfiles import StaticFiles

from scenarionet_data import Lake, errors, version
from scenarionet_pipelines.messages import one_line, shorten
from scenarionet_pipelines.web import choices, clips
from scenarionet_pipelines.web.camera_views import SIZES, VIEWS, CameraView
from scenarionet_pipelines.web.guards import BodyTooLarge, Guard
from scenarionet_pipelines.web.picture import DARK_PICTURE, PICTURE
from scenarionet_pipelines.web.question_workers import QuestionWorkers
from scenarionet_pipelines.web.questions import TIMELINE_EVENTS, OpenLake
from scenarionet_pipelines.web.rows import MAX_ROWS, PageQuery, plain
from scenarionet_pipelines.web.scenes import ScenarioCache

STATIC = Path(__file__).with_name("static")

_POSITION = re.compile(r"\bcharacter (\d+)")
_MAX_DIGITS = 10
_MAX_RUNS = 3
_THUMBNAIL_SIDES = range(32, 513)
_IMMUTABLE = {"cache-control": "private, max-age=86400, immutable"}
"""For content of a snapshot, whose number is part of the address."""
_NO_STORE = {"cache-control": "no-store"}

_READING = (
    "about", "rows", "facts", "scene", "thumbnail", "histogram", "events", "moments", "similar", "runs", "run", "clip",
    "camera",
)  # fmt: skip
"""Requests below ``/api`` that change nothing."""


class LakeRoutes:
    """Request handlers for one lake, one method per route.

    Args:
        lake: The lake.
        workers: Answer the questions that contain SQL.
        is_writable: Whether databases may be saved.
        secret: Token that the page sends along with requests that save.
    """

    def __init__(self, lake: Lake, workers: QuestionWorkers, *, is_writable: bool, secret: str) -> None:
        self.lake = lake
        self._workers = workers
        self.is_writable = is_writable
        self._secret = secret
        self._count = len(lake)
        self._scenarios = ScenarioCache(lake)
        self._camera = asyncio.Semaphore(1)

    async def index(self, request: Request) -> Response:  # noqa: ARG002
        """Serve the page, and prepare for its first question."""
        self._workers.start_spare()
        return FileResponse(STATIC / "index.html", headers=_NO_STORE)

    def about(self, request: Request) -> Response:  # noqa: ARG002
        """Describe the lake: its columns and databases, and the colours of pictures."""
        return JSONResponse(
            {
                "name": self.lake.name,
                "path": str(self.lake.root),
                "snapshot": self.lake.snapshot.number,
                "software": version.name_and_version(),
                "scenarios": self._count,
                "columns": [asdict(column) for column in self._workers.columns.values()],
                "databases": self.lake.databases,
                "runs": choices.runs(self.lake),
                "moments": choices.moments(self.lake),
                "picture": PICTURE,
                "darkPicture": DARK_PICTURE,
                "events": TIMELINE_EVENTS,
                "clips": clips.KINDS,
                "cameras": {"views": VIEWS, "widths": list(dict(SIZES))},
                "isWritable": self.is_writable,
                "secret": self._secret if self.is_writable else None,
            },
            headers=_NO_STORE,
        )

    async def rows(self, request: Request) -> Response:
        """Return one page of the table; the question is stopped if the client disconnects."""
        parameters = request.query_params
        wanted = tuple(name for name in parameters.get("columns", "").split(",") if name)
        query = PageQuery(
            where=parameters.get("where", "").strip() or "true",
            sort=parameters.get("sort", "scenario_id"),
            is_falling=parameters.get("order") == "falling",
            first=_number(parameters.get("first", "0"), range(2**31)),
            count=_number(parameters.get("count", "50"), range(1, MAX_ROWS + 1)),
            columns=wanted,
            source=choices.source(parameters.get("run", "")),
        )
        question = partial(OpenLake.rows, query=query, database=parameters.get("database", ""))
        page = await self._workers.ask(question, request.is_disconnected)
        self._scenarios.expect([row["scenario_id"] for row in page.rows])
        return JSONResponse(asdict(page), headers=_NO_STORE)

    async def histogram(self, request: Request) -> Response:
        """Return the counts of a column's values in bins."""
        parameters = request.query_params
        where = parameters.get("where", "").strip() or "true"
        column, database, run = (parameters.get(name, "") for name in ("column", "database", "run"))
        question = partial(OpenLake.histogram, column=column, where=where, database=database, run=run)
        found = await self._workers.ask(question, request.is_disconnected)
        return JSONResponse(asdict(found), headers=_NO_STORE)

    async def events(self, request: Request) -> Response:
        """Return the occurrences of an event in a scenario, in seconds."""
        question = partial(OpenLake.events, scenario_id=_id(request), event=request.query_params.get("event", ""))
        return JSONResponse(await self._workers.ask(question, request.is_disconnected), headers=_NO_STORE)

    async def moments(self, request: Request) -> Response:
        """Return the kept moments of a scenario."""
        question = partial(OpenLake.moments, scenario_id=_id(request))
        return JSONResponse(await self._workers.ask(question, request.is_disconnected), headers=_NO_STORE)

    async def similar(self, request: Request) -> Response:
        """Return the scenarios that are nearest to one by an embedding."""
        question = partial(OpenLake.similar, scenario_id=_id(request))
        return JSONResponse(await self._workers.ask(question, request.is_disconnected), headers=_NO_STORE)

    def facts(self, request: Request) -> Response:
        """Return the metadata of one scenario."""
        found = self._scenarios.facts(_id(request))
        return JSONResponse({name: plain(value) for name, value in found.items()}, headers=_NO_STORE)

    def scene(self, request: Request) -> Response:
        """Return one scenario in the binary format of ``packing``."""
        return Response(self._scenarios.packed(_id(request)), media_type="application/octet-stream", headers=_IMMUTABLE)

    def runs(self, request: Request) -> Response:
        """Return the runs that simulated a scenario, with outcome and metrics."""
        return JSONResponse(self._scenarios.runs(_id(request)), headers=_NO_STORE)

    def run(self, request: Request) -> Response:
        """Return a rollout in the binary format of ``packing``."""
        run, rollout = _rollout(request.query_params.get("run", ""))
        packed = self._scenarios.packed_run(_id(request), run, rollout)
        return Response(packed, media_type="application/octet-stream", headers=_NO_STORE)

    def clip(self, request: Request) -> Response:
        """Send a clip of a scenario and runs of it, after its progress."""
        parameters = request.query_params
        kind = parameters.get("kind", "gif")
        if kind not in clips.KINDS:
            raise errors.BadParameter(
                f"no clips of kind {shorten(kind, 40)!r} here; there are {', '.join(clips.KINDS)}"
            )
        runs = [_rollout(text) for text in parameters.get("runs", "").split(",") if text]
        if len(runs) > _MAX_RUNS:
            raise errors.BadParameter(f"a clip shows at most {_MAX_RUNS} runs, found {len(runs)}")
        content = self._scenarios.clip(_id(request), runs, kind)
        return StreamingResponse(content, media_type="application/octet-stream", headers=_NO_STORE)

    async def camera(self, request: Request) -> Response:
        """Return what the camera of an object sees; one picture is drawn at a time, and none that nobody waits for."""
        parameters = request.query_params
        run, rollout = _rollout(parameters.get("run", ""))
        view = CameraView(
            parameters.get("object", ""),
            parameters.get("view", VIEWS[0]),
            _number(parameters.get("step", "0"), range(10**6)),
            _number(parameters.get("width", "480"), range(10**4)),
        )
        async with self._camera:
            if await request.is_disconnected():
                raise ClientDisconnect
            content = await run_in_threadpool(self._scenarios.seen, _id(request), run, rollout, view)
        return Response(content, media_type="image/webp", headers=_NO_STORE if run else _IMMUTABLE)

    def thumbnail(self, request: Request) -> Response:
        """Return a small PNG picture of one scenario."""
        parameters = request.query_params
        width = _number(parameters.get("width", "256"), _THUMBNAIL_SIDES)
        height = _number(parameters.get("height", "160"), _THUMBNAIL_SIDES)
        return Response(
            self._scenarios.thumbnail(_id(request), (width, height)), media_type="image/png", headers=_IMMUTABLE
        )

    async def save(self, request: Request) -> Response:
        """Save the scenarios that match the filter as a database."""
        if not self.is_writable:
            return JSONResponse({"error": "the server is read-only; start it with --write to save databases"}, 403)
        name, where, parent, run = _texts(await request.body(), "name", "where", "database", "run")
        question = partial(OpenLake.save, name=name, where=where.strip() or "true", database=parent, run=run)
        reference, size = await self._workers.ask(question, request.is_disconnected)
        return JSONResponse({"reference": reference, "count": size, "databases": self.lake.databases})


def make_app(
    lake: Lake, workers: QuestionWorkers, *, is_writable: bool = False, names: frozenset[str] = frozenset()
) -> Starlette:
    """Create the web application.

    Args:
        lake: The lake to show.
        workers: Answer the questions that contain SQL.
        is_writable: Whether the page may save databases.
        names: Host names of this machine that requests may use, besides ``localhost`` and IP addresses.
    """
    secret = secrets.token_urlsafe()
    routes = LakeRoutes(lake, workers, is_writable=is_writable, secret=secret)
    return Starlette(
        routes=[
            Route("/", routes.index),
            *(Route(f"/api/{name}", getattr(routes, name)) for name in _READING),
            Route("/api/databases", routes.save, methods=["POST"]),
            Mount("/static", StaticFiles(directory=STATIC)),
        ],
        middleware=[Middleware(Guard, names=names, secret=secret)],
        exception_handlers={
            errors.ScenarioNetError: _error_response,
            OSError: _error_response,
            ClientDisconnect: lambda request, error: Response(status_code=408),  # noqa: ARG005  # to nobody
        },
    )


_STATUS: tuple[tuple[type[Exception], int], ...] = (
    (BodyTooLarge, 413),
    (errors.ScenarioNotFound, 404),
    (errors.DatabaseNotFound, 404),
    (errors.QueryError, 400),
    (errors.LakeError, 409),
)


def _error_response(request: Request, error: Exception) -> Response:  # noqa: ARG001
    """Return an error as JSON: the message and, for a condition, the position of the offending character."""
    text = one_line(error)
    status = next((number for kind, number in _STATUS if isinstance(error, kind)), 500)
    position = _POSITION.search(text)
    return JSONResponse({"error": text, "character": int(position.group(1)) if position else None}, status)


def _id(request: Request) -> str:
    return request.query_params.get("id", "")


def _rollout(text: str) -> tuple[str, int]:
    """Name and number of a rollout, written ``name`` or ``name:number``."""
    name, _, number = text.partition(":")
    return name, _number(number or "0", range(10**6))


def _texts(body: bytes, *names: str) -> list[str]:
    """Read the named values of a JSON object, all of which have to be strings that UTF-8 can encode."""
    try:
        given = json.loads(body)
        json.dumps(given, ensure_ascii=False).encode()
    except (ValueError, RecursionError):  # lone surrogates are a ValueError, too
        given = None
    found = [given.get(name) for name in names] if isinstance(given, dict) else []
    texts = [each for each in found if isinstance(each, str)]
    if len(texts) != len(names):
        raise errors.BadParameter(f"expected a JSON object with the strings {', '.join(names)}, in UTF-8")
    return texts


def _number(text: str, allowed: range) -> int:
    if not text.isdecimal() or len(text) > _MAX_DIGITS or int(text) not in allowed:
        raise errors.BadParameter(f"expected a number from {allowed[0]} to {allowed[-1]}, found {shorten(text, 40)!r}")
    return int(text)
