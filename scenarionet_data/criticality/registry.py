"""The table of measures: each is a function of a scene, with what it means beside it."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import TypeAlias

from scenarionet_data.arrays.dtypes import Float64
from scenarionet_data.criticality.scene import Meeting

MeasureFunction: TypeAlias = Callable[[Meeting], Float64]


@dataclass(frozen=True)
class CriticalityMeasure:
    """A measure of criticality.

    Attributes:
        name: Its name, that of its column.
        doc: What it says.
        formula: How it is computed.
        unit: Of its values; "" without.
        source: The publication that defines it.
        worst: ``"min"`` or ``"max"``: which of several values is the critical one.
        function: Values (N, T) of a scene; infinite where there is no conflict.
    """

    name: str
    doc: str
    formula: str
    unit: str
    source: str
    worst: str
    function: MeasureFunction


MEASURES: dict[str, CriticalityMeasure] = {}
"""All measures by name."""


def measure(
    name: str, unit: str, worst: str, formula: str, source: str
) -> Callable[[MeasureFunction], MeasureFunction]:
    """Add a function to the table of measures; its docstring says what the measure is. Values are computed once."""

    def added(function: MeasureFunction) -> MeasureFunction:
        def once(scene: Meeting) -> Float64:
            if name not in scene.found:
                scene.found[name] = function(scene)
            return scene.found[name]

        doc = " ".join((function.__doc__ or "").split()).rstrip(".")
        MEASURES[name] = CriticalityMeasure(name, doc, formula, unit, source, worst, once)
        return once

    return added
