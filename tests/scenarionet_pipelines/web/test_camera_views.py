"""Pictures of cameras on objects, as the server sends them: what they show, and how much work they may be."""

from __future__ import annotations

import socket
import threading
import time
from io import BytesIO
from urllib.parse import urlencode, urlsplit

import numpy as np
import pytest
from PIL import Image

from scenarionet_pipelines.web.scenes import ScenarioCache
from scenarionet_sim import World
from scenarionet_sim.render.space import Film, recorded_moments
from tests.fixtures.pages import serving
from tests.fixtures.waiting import until
from tests.scenarionet_pipelines.web.test_runs import ask
from tests.scenarionet_pipelines.web.test_server import request, said

pytestmark = pytest.mark.integration

PARKED = "made/v1/parked"


def picture(address, **parameters):
    status, headers, body = ask(address, "camera", id=PARKED, **parameters)
    assert (status, headers["content-type"]) == (200, "image/webp"), body
    return np.asarray(Image.open(BytesIO(body)).convert("RGB")).astype(int)


def test_picture_is_that_of_a_camera_on_the_object(driven, address):
    """WebP changes colours by a few levels; another object's or moment's picture differs by far more."""
    world = World.from_scenario(driven.loader([PARKED])[0])
    for name, view, step in (("t0", "camera", 10), ("t2", "chase", 20)):
        row = world.track_ids.tolist().index(name)
        wanted = next(Film(view, 480, 270).frames(world, recorded_moments(world)[step : step + 2], row)).astype(int)
        shown = picture(address, object=name, view=view, step=step)
        assert shown.shape == (270, 480, 3)
        assert np.abs(shown - wanted).mean() < 4
        assert np.abs(picture(address, object=name, view=view, step=step + 10) - wanted).mean() > 8
    behind = picture(address, object="t0", view="chase", step=20)
    assert np.abs(behind - picture(address, object="t2", view="chase", step=20)).mean() > 8
    assert picture(address, object="t0", width=960).shape == (540, 960, 3)


def test_picture_of_a_run_shows_what_the_run_drove(address):
    """The ego of the run stops at the parked car 25 m ahead, through which the recorded one drives."""
    recorded, simulated = (picture(address, object="t0", step=40, run=run) for run in ("", "idm"))
    assert np.abs(recorded - simulated).mean() > 8


@pytest.mark.parametrize(
    ("given", "says"),
    [
        ({"object": "nobody"}, "'nobody' is not there"),
        ({"object": "t0", "step": 10_000}, "is not there at timestep 10000"),
        ({"object": "t0", "step": -1}, "expected a number"),
        ({"object": "t0", "view": "cockpit"}, "there are chase, camera"),
        ({"object": "t0", "width": 8000}, "480 or 960 pixels wide"),
        ({"object": "t0", "run": "nothing"}, "no rollout"),
    ],
)
def test_pictures_that_cannot_be_drawn_are_an_error(address, given, says):
    status, answer = said(ask(address, "camera", id=PARKED, **given))
    assert status == 400
    assert says in answer["error"]


def test_unknown_scenario_is_not_found(address):
    assert ask(address, "camera", id="made/v1/nobody", object="t0")[0] == 404


def test_one_picture_is_drawn_at_a_time_and_none_that_nobody_waits_for(driven, monkeypatch):
    drawn, under_way, goes_on = [], [], threading.Event()

    def seen(self, scenario_id, run, rollout, view):
        under_way.append(view.step)
        assert len(under_way) == 1
        goes_on.wait()
        drawn.append(under_way.pop())
        return b""

    monkeypatch.setattr(ScenarioCache, "seen", seen)
    with serving(driven) as address:
        place = urlsplit(address)
        target = lambda step: f"/api/camera?{urlencode({'id': PARKED, 'object': 't0', 'step': step})}"  # noqa: E731
        first = threading.Thread(target=request, args=(address, target(0)))
        first.start()
        until(lambda: under_way, "the first picture is being drawn")
        with socket.create_connection((place.hostname, place.port)) as client:
            client.sendall(f"GET {target(1)} HTTP/1.1\r\nHost: {place.netloc}\r\n\r\n".encode())
            time.sleep(0.3)
        second = threading.Thread(target=request, args=(address, target(2)))
        second.start()
        time.sleep(0.3)
        assert under_way == [0]
        goes_on.set()
        first.join()
        second.join()
    assert drawn == [0, 2]
