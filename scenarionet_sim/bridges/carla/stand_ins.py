"""Modules that agents import where CARLA's scenario runner is not: its clock, and a world that is refused."""

from __future__ import annotations

import datetime
import sys
from enum import IntEnum
from importlib.util import find_spec
from types import ModuleType
from typing import Any, NoReturn

from scenarionet_data.errors import SourceError

_ROAD_OPTIONS = {
    "VOID": -1, "LEFT": 1, "RIGHT": 2, "STRAIGHT": 3, "LANEFOLLOW": 4, "CHANGELANELEFT": 5, "CHANGELANERIGHT": 6,
}  # fmt: skip


class GameTime:
    """The scenario runner's clock, which the planner sets.

    Attributes:
        frame: Number of the moment, from 1.
        time: Of the episode [s].
    """

    frame, time = 0, 0.0

    @classmethod
    def get_frame(cls) -> int:
        """Return the number of the moment."""
        return cls.frame

    @classmethod
    def get_time(cls) -> float:
        """Return the time of the episode [s]."""
        return cls.time

    @staticmethod
    def get_wallclocktime() -> datetime.datetime:
        """Return the time on the wall."""
        return datetime.datetime.now()


class _Refusing(type):
    def __getattr__(cls, name: str) -> NoReturn:
        if name.startswith("__"):
            raise AttributeError(name)
        raise SourceError(
            f"the agent asks CARLA's world ({cls.__name__}.{name}), which is not there: agents drive here by their "
            "sensors, the route and the map alone"
        )

    def __call__(cls, *_: Any, **__: Any) -> NoReturn:
        cls.__getattr__("new")


class CarlaDataProvider(metaclass=_Refusing):
    """The scenario runner's access to the world: the map, and nothing else.

    Attributes:
        road_map: Makes the ``carla.Map`` of the scenario.
    """

    road_map: Any = None

    @classmethod
    def get_map(cls) -> Any:
        """Return the map of the scenario."""
        return cls.road_map()


def stand_in() -> None:
    """Put the modules in place, and take CARLA's client away.

    Raises:
        ModuleNotFoundError: CARLA's client is not installed.
    """
    import carla

    carla.Client = _Refusing("Client", (), {})
    classes: dict[str, Any] = {
        "srunner.scenariomanager.timer": GameTime,
        "srunner.scenariomanager.carla_data_provider": CarlaDataProvider,
    }
    if find_spec("agents") is None:  # of CARLA's own folder PythonAPI/carla
        classes["agents.navigation.local_planner"] = IntEnum("RoadOption", _ROAD_OPTIONS)
        classes["agents.navigation.global_route_planner"] = _Refusing("GlobalRoutePlanner", (), {})
    for name, kind in classes.items():
        parts = name.split(".")
        for depth in range(1, len(parts) + 1):
            module = sys.modules.setdefault(".".join(parts[:depth]), ModuleType(".".join(parts[:depth])))
            module.__path__ = []
        setattr(sys.modules[name], kind.__name__, kind)
