"""The page of a catalogue: tables and pictures, with the SQL of every figure beside it."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pyarrow.compute as pc

from scenarionet_data import Lake, version
from scenarionet_data.catalogue import Catalogue, Figure
from scenarionet_data.catalogue.figures import definition_texts
from scenarionet_data.catalogue.gathering import PARAMETERS
from scenarionet_data.plots import new_figure, thumbnail
from scenarionet_data.plots.style import as_png, styled
from scenarionet_pipelines.report.contents import PICTURE_SIZE
from scenarionet_pipelines.report.markup import Markup, joined, picture, tag
from scenarionet_pipelines.report.page import page
from scenarionet_pipelines.report.tables import number, table

_TITLES = {
    "rates": "How often",
    "cells": "By road, ego and other vehicle",
    "parameters": "Parameters",
    "coverage": "Coverage and what is still unseen",
    "saturation": "New cells per 1,000 scenarios",
    "extremes": "The most urgent",
}
_UNITS = {"gap": "m", "revealed_gap": "m", "rate": "m/s²"}


def write(lake: Lake, catalogue: Catalogue, figures: dict[str, Figure], path: Path) -> None:
    """Write the page.

    Args:
        lake: The lake, for pictures.
        catalogue: What was found.
        figures: Its figures.
        path: The HTML file.
    """
    path.write_text(render(lake, catalogue, figures), "utf-8")


def render(lake: Lake, catalogue: Catalogue, figures: dict[str, Figure]) -> str:
    """Return the page as HTML."""
    title = f"{lake.name}: a catalogue of disturbances"
    pictures = {
        "parameters": distributions(catalogue),
        "saturation": saturation(figures["saturation"].rows),
        "extremes": extremes(lake, figures["extremes"].rows),
    }
    sections = [
        tag(
            "section",
            tag("h2", _TITLES[name]),
            tag("p", each.doc, class_="note"),
            pictures.get(name),
            result(name, each),
        )
        for name, each in figures.items()
    ]
    left_out = [[tag("td", reason), tag("td", number(n), class_="number")] for reason, n in catalogue.left_out.items()]
    note = tag("p", "What may have been a disturbance, and could not be judged.", class_="note")
    sections.append(
        tag("section", tag("h2", "Not counted"), note, table(["reason", "number#"], left_out, "Not counted"))
    )
    texts = [tag("details", tag("summary", name), tag("pre", text)) for name, text in definition_texts().items()]
    sections.append(tag("section", tag("h2", "Definitions"), *texts))
    return page(
        title,
        tag("header", tag("h1", title), tag("p", f"Snapshot {lake.snapshot.number}.", class_="lead")),
        tag("main", *sections),
        tag("footer", f"Made by {version.name_and_version()}, `scenarionet db catalogue`. This page needs no network."),
    )


def result(name: str, figure: Figure) -> Markup:
    """Table of a figure, and its SELECT."""
    heads = list(figure.rows[0]) if figure.rows else []
    is_number = {head: any(isinstance(row[head], int | float) for row in figure.rows) for head in heads}
    rows = [
        [
            tag("td", number(row[head]), class_="number") if is_number[head] else tag("td", row[head] or "-")
            for head in heads
        ]
        for row in figure.rows
    ]
    return joined(
        table([f"{head}#" if is_number[head] else head for head in heads], rows, _TITLES[name]),
        tag("details", tag("summary", "SQL"), tag("pre", figure.sql)),
    )


def distributions(catalogue: Catalogue) -> Markup:
    """A histogram of each parameter of each definition."""
    charts = []
    for definition in pc.unique(catalogue.disturbances["definition"]).to_pylist():
        mine = catalogue.disturbances.filter(pc.equal(catalogue.disturbances["definition"], definition))
        for name in PARAMETERS:
            values = mine[name].drop_null().to_numpy()
            if len(values) < 2:
                continue
            with styled():
                figure = new_figure(3.2, 2.2, layout="constrained")
                axes = figure.subplots()
                axes.hist(values, bins=int(np.clip(2 * np.cbrt(len(values)), 5, 40)))
                axes.set(xlabel=f"{name} [{_UNITS.get(name, 'm/s')}]", ylabel="occurrences")
            words = f"{definition}: {name}"
            charts.append(
                tag(
                    "figure", tag("figcaption", words), picture(as_png(figure), f"{words}, a histogram"), class_="chart"
                )
            )
    return tag("div", *charts, class_="charts")


def saturation(rows: list[dict[str, Any]]) -> Markup:
    """A line of new cells for each definition."""
    with styled():
        figure = new_figure(6.4, 2.6, layout="constrained")
        axes = figure.subplots()
        for definition in dict.fromkeys(row["definition"] for row in rows):
            mine = [row for row in rows if row["definition"] == definition]
            axes.plot(
                [row["tenth"] for row in mine], [row["new_per_1000"] for row in mine], marker="o", label=definition
            )
        axes.set(xlabel="tenth of the scenarios", ylabel="new cells per 1,000", ylim=(0, None))
        axes.legend(fontsize=8)
    return picture(as_png(figure), "New cells per 1,000 scenarios by tenths of the scenarios")


def extremes(lake: Lake, rows: list[dict[str, Any]]) -> Markup:
    """A picture of each when it begins."""
    loader, shown = lake.loader(sorted({row["scenario_id"] for row in rows})), []
    for row in rows:
        scenario = loader[loader.scenario_ids.index(row["scenario_id"])]
        words = f"{row['definition']} by {row['track_id']}, {row['time']:.2f} s"
        image = picture(thumbnail(scenario, PICTURE_SIZE, row["first_timestep"]), words, PICTURE_SIZE)
        shown.append(tag("figure", image, tag("figcaption", words, tag("span", row["scenario_id"]))))
    return tag("div", *shown, class_="pictures")
