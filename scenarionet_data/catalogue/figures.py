"""Figures of a catalogue: each is one SELECT over its tables ``disturbances`` and ``exposure``."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

from scenarionet_data.catalogue.gathering import Catalogue
from scenarionet_data.operations.moments import inlined
from scenarionet_data.operations.rates import poisson_rate
from scenarionet_data.query.lake_view import LakeView
from scenarionet_data.query.named_sql import CATALOGUE, DISTURBANCES

FIGURES = ("rates", "cells", "parameters", "coverage", "saturation", "extremes")
"""Names of the figures, files of ``sql/catalogue``, in their order."""


@dataclass(frozen=True)
class Figure:
    """A figure of a catalogue.

    Attributes:
        doc: What it says.
        sql: The SELECT that it is the result of.
        rows: Its rows; rates have intervals beside.
    """

    doc: str
    sql: str
    rows: list[dict[str, Any]]


def figure_sql(name: str) -> str:
    """Return the SELECT of a figure, with the names of the definitions written into it."""
    text = CATALOGUE.load(name).text
    return text.replace("$definitions", str(DISTURBANCES.names()))


def compute_figures(view: LakeView, catalogue: Catalogue) -> dict[str, Figure]:
    """Return all figures of a catalogue by name.

    Rates get ``per_1000_km`` and ``per_hour``, each with the ends of the exact 95 % interval of a Poisson process.

    Args:
        view: Any view of the lake; its connection runs the SELECTs.
        catalogue: The tables.
    """
    given = {"disturbances": catalogue.disturbances, "exposure": catalogue.exposure}
    found = {}
    for name in FIGURES:
        rows = view.arrow(figure_sql(name), tables=given).to_pylist()
        found[name] = Figure(CATALOGUE.load(name).doc, figure_sql(name), rows)
    for row in found["rates"].rows:
        for unit, exposure in (("per_1000_km", row["km"] / 1000), ("per_hour", row["hours"])):
            rate = poisson_rate(row["occurrences"], exposure) if exposure > 0 else (None, None, None)
            row |= dict(zip((unit, f"{unit}_low", f"{unit}_high"), rate, strict=True))
    return found


def definition_texts() -> dict[str, str]:
    """Return each definition with its description, as it runs."""
    texts = {}
    for name in DISTURBANCES.names():
        found = DISTURBANCES.load(name)
        texts[name] = f"-- {found.doc}\n{inlined(found, {})}\n"
    return texts
