"""Rendering of a report as a single HTML page with embedded pictures, without scripts or network access."""

from __future__ import annotations

import base64
from itertools import starmap
from pathlib import Path

import scenarionet_pipelines.web
from scenarionet_data import version
from scenarionet_data.plots.palette import EGO, NAMES, OBJECTS, OTHER
from scenarionet_data.storage.files.places import local_path
from scenarionet_pipelines.report.charts import histogram, likeliest
from scenarionet_pipelines.report.contents import PICTURE_SIZE, DatabaseSection, ReportContents, ScenarioPicture
from scenarionet_pipelines.report.markup import Markup, joined, tag
from scenarionet_pipelines.report.measures import MeasureDistribution
from scenarionet_pipelines.report.tables import comparison, missing, number, plural, scorecard, summary

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
    body = tag(
        "body", _header(contents), tag("nav", *links, aria_label="Sections"), tag("main", *shown.values()), _footer()
    )
    return f"<!doctype html>\n{tag('html', page_head(title), body, lang='en')}\n"


def page_head(title: str) -> Markup:
    """Head of a page with the style of reports."""
    return tag(
        "head",
        tag("meta", charset="utf-8"),
        tag("meta", http_equiv="Content-Security-Policy", content=_POLICY),
        tag("meta", name="viewport", content="width=device-width, initial-scale=1"),
        tag("meta", name="color-scheme", content="light dark"),
        tag("title", title),
        tag("style", Markup(_style())),
    )


def _style() -> str:
    base = Path(scenarionet_pipelines.web.__file__).with_name("static") / "base.css"
    return base.read_text("utf-8") + Path(__file__).with_name("report.css").read_text("utf-8")


def _header(contents: ReportContents) -> Markup:
    when = contents.created_at[:16].replace("T", " ")
    lead = f"Snapshot {contents.snapshot}, committed {when} UTC."
    databases = [section.name for section in contents.sections if section.origin]
    if databases:
        lead += f" Databases: {', '.join(databases)}."
    return tag("header", tag("h1", contents.name), tag("p", lead, class_="lead"))


def _footer() -> Markup:
    return tag("footer", f"Made by {version.name_and_version()}, `scenarionet report`. This page needs no network.")


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
        f"{plural(contents.quarantined, 'scenario')} in quarantine; reasons: `scenarionet sql LAKE quarantine_reasons`."
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
    known = [spread for spread in contents.distributions if spread.is_known]
    drawn = [spread for spread in known if not spread.is_flat]
    if not known:
        return None
    same = ", ".join(f"{spread.title.lower()} {likeliest(spread)}" for spread in known if spread.is_flat)
    note = "Share of scenarios in each bin; the outer bins include outliers."
    note += f" Constant: {same}." if same else ""
    names = [group.name for group in known[0].groups]
    legend = tag("ul", *starmap(_swatch, enumerate(names)), class_="legend") if len(names) > 1 else None
    return _section(
        "distributions", "Distributions", tag("p", note, class_="note"),
        legend, tag("div", *map(_chart, drawn), class_="charts"),
    )  # fmt: skip


def _swatch(place: int, name: str) -> Markup:
    return tag("li", tag("span", class_=f"swatch series-{place % 8 + 1}"), name)


def _chart(spread: MeasureDistribution) -> Markup:
    unit = tag("span", f" [{spread.unit}]", class_="unit") if spread.unit else None
    lacking = tag("small", f"{plural(spread.missing, 'scenario')} without") if spread.missing else None
    return tag("figure", tag("figcaption", spread.title, unit), histogram(spread), lacking, class_="chart")


def _quality(contents: ReportContents) -> Markup | None:
    cards = [
        joined(_section_title(contents, section), scorecard(section.scorecard))
        for section in contents.sections
        if section.scorecard
    ]
    note = tag("p", "Violations of the quality rules; docs/guides/checks.md explains the rules.", class_="note")
    return _section("quality", "Quality", note, *cards) if cards else None


def _scenarios(contents: ReportContents) -> Markup | None:
    shown = [section for section in contents.sections if section.pictures]
    galleries = [
        joined(_section_title(contents, section), *starmap(_gallery, section.pictures.items())) for section in shown
    ]
    return _section("scenarios", "Scenarios", _key(), *galleries) if galleries else None


def _section_title(contents: ReportContents, section: DatabaseSection) -> Markup | None:
    return tag("h3", section.name) if len(contents.sections) > 1 else None


def _key() -> Markup:
    """Legend of the colours in pictures."""
    colors = {"ego": EGO, **{name: OBJECTS[kind] for kind, name in NAMES.items()}, "other": OTHER}
    items = (
        tag(
            "li",
            tag("svg", tag("rect", width=12, height=12, rx=2, fill=color), viewBox="0 0 12 12", aria_hidden="true"),
            name,
        )
        for name, color in colors.items()
    )
    return tag("ul", *items, class_="key")


def _gallery(group: str, pictures: list[ScenarioPicture]) -> Markup | None:
    if not pictures:
        return None
    title = joined(tag("h3", group.capitalize()), tag("p", _GROUPS[group], class_="note"))
    return joined(title, tag("div", *map(_figure, pictures), class_="pictures"))


def _figure(picture: ScenarioPicture) -> Markup:
    data = base64.b64encode(picture.png).decode()
    facts = picture.facts
    words = (
        f"{number(facts['ego_distance'])} m in {number(facts['duration'])} s, {plural(facts['num_objects'], 'object')}"
    )
    image = tag(
        "img", src=f"data:image/png;base64,{data}", alt=f"Scenario {picture.scenario_id} from above",
        width=PICTURE_SIZE[0], height=PICTURE_SIZE[1],
    )  # fmt: skip
    why = tag("span", picture.reason, class_="why") if picture.reason else None
    return tag("figure", image, tag("figcaption", why, picture.scenario_id, tag("span", words)))
