"""A lake of straight drives for every environment."""

from __future__ import annotations

from importlib.util import find_spec
from pathlib import Path
from types import SimpleNamespace

import pytest

from scenarionet_data.scenario.vocabulary import ObjectType
from scenarionet_sim.backends.bullet import Bullet
from scenarionet_sim.scenarios.selection import Scenarios
from tests.fixtures.drives import Other, make_drive
from tests.fixtures.lakes import write_lake

CONE = Other(20.0, type=ObjectType.TRAFFIC_CONE)
WALKER = Other(20.0, -4.0, vy=2.0, type=ObjectType.PEDESTRIAN)


@pytest.fixture(scope="session")
def drives(tmp_path_factory) -> Path:
    """Six scenarios; in the order of their ids: cone, crowd, empty, parked, wall, walker."""
    crowd = tuple(Other(6.0 * k - 30.0, 3.5, vx=6.0 + k % 3, first=3 * (k % 4)) for k in range(12))
    scenarios = [
        make_drive("cone", others=(CONE,)),
        make_drive("crowd", others=crowd),
        make_drive("empty"),
        make_drive("parked", speed=0.0, others=(Other(8.0), Other(30.0, 3.5, vx=5.0))),
        make_drive("wall", others=(Other(25.0),)),
        make_drive("walker", others=(WALKER,)),
    ]
    return write_lake(tmp_path_factory.mktemp("drives"), scenarios).root


@pytest.fixture
def only(drives):
    """``only("wall", ...)``: these scenarios of the lake, in this order."""
    return lambda *names, **options: Scenarios(drives, [f"made/v1/{name}" for name in names], **options)


def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    """Skip what is parametrized by Bullet where Python has no wheel of pybullet."""
    if find_spec("pybullet"):
        return
    for item in items:
        values = getattr(item, "callspec", SimpleNamespace(params={})).params.values()
        if any(value == "bullet" or isinstance(value, Bullet) for value in values if isinstance(value, (str, Bullet))):
            item.add_marker(pytest.mark.skip(reason="pybullet has a wheel for CPython 3.11 only"))
