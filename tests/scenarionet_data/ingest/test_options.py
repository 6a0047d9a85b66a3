"""Converter options from a mapping: equal to keyword options; errors are readable."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Literal

import pytest

from scenarionet_data import convert
from scenarionet_data.errors import BadParameter
from scenarionet_data.ingest.options import Options


@dataclass(frozen=True)
class Typed(Options):
    removed = {"hertz": "set rate, in timesteps per second"}  # noqa: RUF012
    density: float = 1.0
    rate: int = 10
    kind: Literal["log", "scene"] = "scene"
    radius: float | None = None
    box: tuple[float, ...] = (1.0, 2.0)
    has_map: bool = True
    maps: str = field(default="", metadata={"is_path": True})


def test_values_become_fields():
    values = {"density": 15, "kind": "log", "radius": 3.0, "box": (1.0, 2, 3.0), "has_map": False, "maps": "m"}
    assert Typed.from_mapping(values) == Typed(**values)
    assert Typed.from_mapping({}) == Typed()
    assert Typed(maps="m").paths == {"maps": "m"}


@pytest.mark.parametrize(
    ("values", "message"),
    [
        ({"densty": 1}, "no option 'densty'; did you mean 'density'\\? options: max_bad_rows, density, rate"),
        ({"x": 1}, "no option 'x'; options: max_bad_rows, density"),
        ({"hertz": 2}, "option 'hertz' no longer exists; set rate, in timesteps per second"),
        ({"density": "dense"}, "option 'density': expected float, for example 1.0; found 'dense'"),
        ({"rate": 0.5}, "option 'rate': expected int, for example 10; found 0.5"),
        ({"rate": True}, "option 'rate': expected int"),
        ({"kind": "track"}, "expected Literal\\['log', 'scene'\\], for example 'scene'; found 'track'"),
        ({"radius": "3"}, "expected float | None"),
        ({"box": 1.0}, "option 'box': expected tuple"),
        ({"box": ("a",)}, "option 'box': expected tuple"),
        ({"has_map": 1}, "option 'has_map': expected bool"),
    ],
)
def test_unknown_names_and_wrong_types_are_refused(values, message):
    with pytest.raises(BadParameter, match=message):
        Typed.from_mapping(values)


def test_convert_takes_a_mapping(tmp_path):
    convert("pg", "0:1", tmp_path / "one", options={"density": 5.0})
    with pytest.raises(BadParameter, match="no option 'densty'; did you mean 'density'"):
        convert("pg", "0:1", tmp_path / "two", options={"densty": 5.0})
