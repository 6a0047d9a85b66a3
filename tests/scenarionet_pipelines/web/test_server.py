"""Responses and refused requests of the server, at the byte level: browsers would not send some of them."""

from __future__ import annotations

import http.client
import json
import socket
from contextlib import contextmanager
from urllib.parse import quote, urlsplit

import psutil
import pytest

from scenarionet_data import Lake
from scenarionet_data.errors import BadParameter
from scenarionet_pipelines.web.question_workers import Limits
from scenarionet_pipelines.web.server import Server
from tests.fixtures.lakes import write_lake
from tests.fixtures.pages import HOSTILE, serving
from tests.fixtures.scenarios import make_scenario
from tests.fixtures.waiting import HANGS_AFTER, until

pytestmark = pytest.mark.integration


def request(address, path, method="GET", body=None, **headers):
    """Status, headers and body; the path is sent unmodified."""
    place = urlsplit(address)
    connection = http.client.HTTPConnection(place.hostname, place.port, timeout=HANGS_AFTER)
    given = {name.replace("_", "-"): value for name, value in headers.items()}
    try:
        connection.request(method, path, None if body is None else json.dumps(body), given)
        response = connection.getresponse()
        return response.status, response.headers, response.read()
    finally:
        connection.close()


def said(answer):
    return answer[0], json.loads(answer[2])


def test_every_response_restricts_the_page_to_this_server(served):
    for path in ("/", "/static/main.js", "/api/about", "/nowhere", "/api/rows?where=1%2B"):
        _, headers, _ = request(served, path)
        assert headers["content-security-policy"].startswith("default-src 'self';")
        assert headers["x-content-type-options"] == "nosniff"
        assert "access-control-allow-origin" not in headers


def test_page_references_no_other_host(served):
    _, _, page = request(served, "/")
    assert b"http:" not in page
    assert b"https:" not in page


@pytest.mark.parametrize(
    "path",
    [
        "/static/../app.py",
        "/static/../../../../../../etc/passwd",
        "/static/%2e%2e/app.py",
        "/static/..%2f..%2fcli/__init__.py",
        "/static//etc/passwd",
        "/static/%5c..%5capp.py",
        "/../etc/passwd",
    ],
)
def test_paths_outside_the_folder_are_not_found(served, path):
    status, _, body = request(served, path)
    assert status in (404, 405)
    assert b"root:" not in body
    assert b"import" not in body


NOBODY = ["../../etc/passwd", "made/v1/../../x", HOSTILE + "x", "", "\0", "made/v1/nobody"]


@pytest.mark.parametrize("scenario_id", NOBODY)
@pytest.mark.parametrize("what", ["scene", "thumbnail", "facts"])
def test_unknown_ids(served, what, scenario_id):
    status, answer = said(request(served, f"/api/{what}?id={quote(scenario_id, safe='')}"))
    assert status == 404
    assert "no " in answer["error"]


def test_scenario_with_a_hostile_name_is_served(served, lake):
    (scenario_id,) = lake.sql("SELECT scenario_id FROM metadata WHERE city LIKE '<%'")["scenario_id"]
    assert "<" not in scenario_id
    for what in ("scene", "thumbnail", "facts"):
        assert request(served, f"/api/{what}?id={quote(scenario_id, safe='')}")[0] == 200


def test_foreign_host_header_is_refused(served):
    """DNS rebinding: another page's host name resolves to this machine."""
    for host in ("evil.example", "localhost.evil.example", "127.0.0.1.evil.example", "", "a b", "[::1"):
        assert request(served, "/api/about", Host=host)[0] in (400, 403), host
    port = urlsplit(served).port
    for host in (f"localhost:{port}", f"127.0.0.1:{port}", f"[::1]:{port}"):
        assert request(served, "/api/about", Host=host)[0] == 200


def test_reading_by_foreign_pages_is_refused(served):
    """Browsers say where a request comes from; a link to the page is followed, an image or frame of it is not."""
    paths = ("/api/rows", "/api/camera?id=x", "/api/thumbnail?id=x", "/static/main.js", "/")
    for path in paths:
        for site in ("cross-site", "same-site"):
            status, answer = said(request(served, path, Sec_Fetch_Site=site, Sec_Fetch_Dest="image"))
            assert (status, answer["error"]) == (403, "only this server's own page may read")
    assert request(served, "/?scenario=x", Sec_Fetch_Site="cross-site", Sec_Fetch_Dest="document")[0] == 200
    assert request(served, "/api/rows", Sec_Fetch_Site="cross-site", Sec_Fetch_Dest="document")[0] == 403
    for site in ("same-origin", "none"):
        assert request(served, "/api/rows", Sec_Fetch_Site=site, Sec_Fetch_Dest="empty")[0] == 200


def test_filter_errors_have_a_position(served):
    status, answer = said(request(served, "/api/rows?where=" + quote("num_objects > 1 AND ego_dist > 3")))
    assert (status, answer["character"]) == (400, 21)
    assert "similar: ego_distance" in answer["error"]
    status, answer = said(request(served, "/api/rows?where=" + quote("num_objects > > 1 )")))
    assert (status, answer["character"]) == (400, 15)


def test_sizes_and_offsets_are_limited(served):
    for question in ("count=0", "count=201", "first=-1", "count=x", "sort=nothing", "columns=a"):
        assert request(served, f"/api/rows?{question}")[0] == 400, question
    for path in ("thumbnail?width=100000&id=x", "thumbnail?height=1&id=x"):
        assert request(served, f"/api/{path}")[0] == 400, path
    assert request(served, "/api/rows?database=nobody")[0] == 404


def test_database_shows_only_its_members(served, lake):
    _, answer = said(request(served, "/api/rows?database=several"))
    assert answer["total"] == len(lake.database("several"))


UNENDING = "levenshtein(repeat('a', 1000000), repeat('b', 1000000)) > 0"
"""A condition within which DuckDB does not check for interrupts."""


def ask(address, where):
    return said(request(address, f"/api/rows?where={quote(where)}"))


@contextmanager
def asking(address, where):
    """Ask a question whose answer nothing waits for; afterwards its client has disconnected."""
    place = urlsplit(address)
    with socket.create_connection((place.hostname, place.port)) as client:
        client.sendall(f"GET /api/rows?where={quote(where)} HTTP/1.1\r\nHost: localhost\r\n\r\n".encode())
        yield client


def busy_workers():
    """Question workers that have used three seconds of processor time, more than an ordinary question needs."""
    return [child for child in psutil.Process().children() if child.cpu_times().user > 3.0]


def test_unending_question_is_stopped_at_the_time_limit(lake):
    with serving(lake, limits=Limits(seconds=1.0)) as address:
        status, answer = ask(address, UNENDING)
        assert status == 400
        assert answer["error"].startswith("the question took more than 1 s and was stopped; make the condition simpler")
        assert request(address, "/api/about")[0] == 200


@pytest.mark.long
def test_unending_question_blocks_no_other(lake):
    with serving(lake, limits=Limits(seconds=HANGS_AFTER)) as address:
        with asking(address, UNENDING) as first, asking(address, UNENDING) as second:
            until(lambda: len(busy_workers()) == 2, "both are being answered")
            assert ask(address, "true")[1]["total"] == 59
            for client in (first, second):
                client.setblocking(False)
                with pytest.raises(BlockingIOError):
                    client.recv(1)
        until(lambda: not busy_workers(), "abandoned questions are stopped")
        assert ask(address, "true")[1]["total"] == 59


@pytest.mark.long
@pytest.mark.parametrize(
    "where",
    [
        "length(repeat('a', 4000000000)) > 0",
        "list_sum(range(1000000000)) > 0",
    ],
)
def test_question_that_needs_too_much_memory_is_stopped(lake, where):
    with serving(lake, limits=Limits(seconds=HANGS_AFTER, memory=10**8)) as address:
        status, answer = ask(address, where)
        assert status == 400
        assert "emory" in answer["error"]
        assert ask(address, "true")[1]["total"] == 59


@pytest.mark.parametrize(
    ("body", "status", "says"),
    [
        (b"[" * 100_000, 400, "expected a JSON object with the strings name, where, database, run, in UTF-8"),
        (b'{"name": "\\ud800", "where": "true", "database": "", "run": ""}', 400, "in UTF-8"),
        (b'{"name": "\xff", "where": "true", "database": "", "run": ""}', 400, "in UTF-8"),
        (b" " * 1_000_001, 413, "larger than 1 MB"),
        ([b" " * 500_001] * 2, 413, "larger than 1 MB"),
    ],
    ids=["deep", "surrogate", "not UTF-8", "large", "large in chunks"],
)
def test_unreadable_bodies_are_refused(lake, monkeypatch, body, status, says):
    monkeypatch.setattr("secrets.token_urlsafe", lambda: "known")
    with serving(lake, is_writable=True) as address:
        place = urlsplit(address)
        connection = http.client.HTTPConnection(place.hostname, place.port, timeout=HANGS_AFTER)
        own = {"Origin": address, "X-Scenarionet-Secret": "known"}
        connection.request("POST", "/api/databases", body, own, encode_chunked=isinstance(body, list))
        response = connection.getresponse()
        assert response.status == status
        assert says in json.loads(response.read())["error"]
        connection.close()
        assert request(address, "/api/about")[0] == 200


SAVED = {"name": "mine", "where": "num_objects > 5", "database": "several", "run": ""}


def test_nothing_is_saved_without_write(served, lake):
    assert said(request(served, "/api/about"))[1]["secret"] is None
    assert request(served, "/api/databases", "POST", SAVED)[0] == 403
    assert request(served, "/api/databases", "POST", SAVED, Origin=served, x_scenarionet_secret="None")[0] == 403
    assert lake.databases == ["several"]


def test_correct_secret_is_refused_without_write(lake, monkeypatch):
    monkeypatch.setattr("secrets.token_urlsafe", lambda: "known")
    with serving(lake) as address:
        right = {"Origin": address, "x_scenarionet_secret": "known"}
        status, answer = said(request(address, "/api/databases", "POST", SAVED, **right))
    assert status == 403
    assert "--write" in answer["error"]
    assert lake.databases == ["several"]


def test_saving_requires_same_origin_and_secret(tmp_path):
    lake = write_lake(tmp_path / "lake", [make_scenario(seed) for seed in range(6)])
    lake.filter(name="several")
    with serving(lake, is_writable=True) as address:
        secret = said(request(address, "/api/about"))[1]["secret"]
        post = ("/api/databases", "POST")
        own = {"Origin": address, "x_scenarionet_secret": secret}
        assert request(address, *post, SAVED)[0] == 403
        assert request(address, *post, SAVED, Origin="http://evil.example", x_scenarionet_secret=secret)[0] == 403
        assert request(address, *post, SAVED, Origin="null", x_scenarionet_secret=secret)[0] == 403
        assert request(address, *post, SAVED, Origin=address, x_scenarionet_secret="guessed")[0] == 403
        assert request(address, "/api/databases", "DELETE", **own)[0] == 405
        assert lake.databases == ["several"]
        status, answer = said(request(address, *post, SAVED, **own))
        assert (status, answer["reference"]) == (200, "mine@1")
        assert answer["databases"] == ["mine", "several"]
        assert Lake(lake.root).database("mine").lineage.parents == ["several@1"]
        for wrong in (SAVED, SAVED | {"name": "../out"}, SAVED | {"name": "b", "where": "true; DROP VIEW metadata"}):
            status, answer = said(request(address, *post, wrong, **own))
            assert status in (400, 409)
            assert answer["error"]
        for wrong in ([], {"name": 3}, {"name": "b"}, "text"):
            assert request(address, *post, wrong, **own)[0] == 400
        assert lake.databases == ["mine", "several"]


@pytest.mark.long
def test_port_in_use_is_an_error(lake):
    with socket.socket() as taken:
        taken.bind(("127.0.0.1", 0))
        taken.listen()
        with pytest.raises(BadParameter, match="choose another port"):
            Server(lake, port=taken.getsockname()[1])
