"""Rendering of a report as a single HTML page with embedded pictures, without scripts or network access."""

from __future__ import annotations

from itertools import starmap
from pathlib import Path

import scenarionet_pipelines.web
from scenarionet_data import version
from scenarionet_data.plots.palette import EGO, NAMES, OBJECTS, OTHER
from scenarionet_data.storage.files.places import local_path
from scenarionet_pipelines.messages import count
from scenarionet_pipelines.report.contents import PICTURE_SIZE, DatabaseSection, ReportContents, ScenarioPicture
from scenarionet_pipelines.report.markup import Markup, joined, picture, tag
from scenarionet_pipelines.report.tables import comparison, missing, number, scorecard, summary

_POLICY = "default-src 'none'; style-src 'unsafe-inline'; img-src data:"
"""Content security policy: the page loads nothing from elsewhere."""

_STATISTICS = "Mean, standard deviation and range over scenarios; shares for ratios."

_GROUPS = {
    "typical": "Closest to the median over all measures.",
    "extreme": "Extreme in at least one measure.",
    "random": "Random sample with a fixed seed.",
}


def write(contents: ReportContents, path: str | Path) -> None:
    """Write a report atomically.

    Args:
        contents: Data of the report.
        path: The HTML file.
    """
    whole, file = render(contents).encode(), local_path(path, "a report")
    unfinished = file.with_name(f".unfinished.{file.name}")
    try:
        unfinished.write_bytes(whole)
        unfinished.replace(file)
    finally:
        unfinished.unlink(missing_ok=True)


def render(contents: ReportContents) -> str:
    """Return the page as HTML."""
    title = f"{contents.name}: a report"
    sections = {
        "overview": _overview(contents),
        "comparison": _comparison(contents),
        "distributions": _distributions(contents),
        "quality": _quality(contents),
        "scenarios": _scenarios(contents),
    }
    shown = {name: section for name, section in sections.items() if section}
    links = (tag("a", name.capitalize(), href=f"#{name}") for name in shown)
    lead = f"Snapshot {contents.snapshot}, committed {contents.created_at[:16].replace('T', ' ')} UTC."
    databases = [section.name for section in contents.sections if section.origin]
    lead += f" Databases: {', '.join(databases)}." if databases else ""
    return page(
        title,
        tag("header", tag("h1", contents.name), tag("p", lead, class_="lead")),
        tag("nav", *links, aria_label="Sections"),
        tag("main", *shown.values()),
        tag("footer", f"Made by {version.name_and_version()}, `scenarionet report`. This page needs no network."),
    )


def page(title: str, *parts: Markup) -> str:
    """Return a page with the style of reports as HTML, with the parts of its body."""
    base = Path(scenarionet_pipelines.web.__file__).with_name("static") / "base.css"
    style = base.read_text("utf-8") + Path(__file__).with_name("report.css").read_text("utf-8")
    head = tag(
        "head",
        tag("meta", charset="utf-8"),
        tag("meta", http_equiv="Content-Security-Policy", content=_POLICY),
        tag("meta", name="viewport", content="width=device-width, initial-scale=1"),
        tag("meta", name="color-scheme", content="light dark"),
        tag("title", title),
        tag("style", Markup(style)),
    )
    return f"<!doctype html>\n{tag('html', head, tag('body', *parts), lang='en')}\n"


def _section(name: str, title: str, *children: str | None) -> Markup:
    return tag("section", tag("h2", title, id=f"{name}-title"), *children, id=name, aria_labelledby=f"{name}-title")


def _overview(contents: ReportContents) -> Markup:
    rows = contents.summary
    facts = {
        "scenarios": sum(row["scenarios"] for row in rows),
        "hours": round(sum(row["hours"] for row in rows), 2),
        "objects": sum(row["total_objects"] for row in rows),
        "object states": sum(row["total_states"] for row in rows),
        "datasets": len({row["dataset"] for row in rows}),
        "cities": contents.cities,
    }
    cards = (tag("li", tag("strong", number(value)), tag("span", name)) for name, value in facts.items())
    rejected = (
        f"{count(contents.quarantined, 'scenario')} in quarantine; reasons: `scenarionet sql LAKE quarantine_reasons`."
        if contents.quarantined
        else None
    )
    table = summary(rows) if rows else tag("p", "This lake has no scenarios yet.", class_="note")
    return _section(
        "overview", "Overview", tag("ul", *cards, class_="facts"), tag("h3", "Content"), table,
        tag("p", rejected, class_="note") if rejected else None,
    )  # fmt: skip


def _comparison(contents: ReportContents) -> Markup | None:
    statistics = [section.statistics for section in contents.sections]
    if not any(each.measures for each in statistics):
        return None
    made = [section for section in contents.sections if section.origin]
    how = tag("dl", *(joined(tag("dt", section.name), tag("dd", section.origin)) for section in made)) if made else None
    lacking = missing(contents.sections)
    return _section(
        "comparison", "Comparison", tag("p", _STATISTICS, class_="note"),
        comparison(statistics), tag("h3", "Origin of the databases") if how else None, how,
        tag("h3", "Missing values") if lacking else None, lacking,
    )  # fmt: skip


def _distributions(contents: ReportContents) -> Markup | None:
    if not contents.distributions and not contents.constants:
        return None
    same = ", ".join(f"{title.lower()} {number(value)}" for title, value in contents.constants.items())
    note = "Share of scenarios in each bin; the outer bins include outliers." + (f" Constant: {same}." if same else "")
    charts = (
        tag("figure", tag("figcaption", title), picture(png, f"{title}: shares of scenarios"), class_="chart")
        for title, png in contents.distributions.items()
    )
    return _section(
        "distributions", "Distributions", tag("p", note, class_="note"), tag("div", *charts, class_="charts")
    )


def _quality(contents: ReportContents) -> Markup | None:
    cards = [
        joined(_section_title(contents, section), scorecard(section.scorecard))
        for section in contents.sections
        if section.scorecard
    ]
    note = tag("p", "Violations of the quality rules; docs/guides/checks.md explains the rules.", class_="note")
    return _section("quality", "Quality", note, *cards) if cards else None


def _scenarios(contents: ReportContents) -> Markup | None:
    colors = {"ego": EGO, **{name: OBJECTS[kind] for kind, name in NAMES.items()}, "other": OTHER}
    key = (
        tag(
            "li",
            tag("svg", tag("rect", width=12, height=12, rx=2, fill=color), viewBox="0 0 12 12", aria_hidden="true"),
            name,
        )
        for name, color in colors.items()
    )
    galleries = [
        joined(_section_title(contents, section), *starmap(_gallery, section.pictures.items()))
        for section in contents.sections
        if section.pictures
    ]
    return _section("scenarios", "Scenarios", tag("ul", *key, class_="key"), *galleries) if galleries else None


def _section_title(contents: ReportContents, section: DatabaseSection) -> Markup | None:
    return tag("h3", section.name) if len(contents.sections) > 1 else None


def _gallery(group: str, pictures: list[ScenarioPicture]) -> Markup | None:
    if not pictures:
        return None
    figures = []
    for shown in pictures:
        facts = shown.facts
        distance, duration = number(facts["ego_distance"]), number(facts["duration"])
        words = f"{distance} m in {duration} s, {count(facts['num_objects'], 'object')}"
        image = picture(shown.png, f"Scenario {shown.scenario_id} from above", PICTURE_SIZE)
        why = tag("span", shown.reason, class_="why") if shown.reason else None
        figures.append(tag("figure", image, tag("figcaption", why, shown.scenario_id, tag("span", words))))
    title = joined(tag("h3", group.capitalize()), tag("p", _GROUPS[group], class_="note"))
    return joined(title, tag("div", *figures, class_="pictures"))
