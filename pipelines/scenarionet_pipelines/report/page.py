"""A report as one HTML page that needs nothing else: no network, no script, pictures inside, light or dark."""

from __future__ import annotations

import base64
from itertools import starmap
from pathlib import Path

import scenarionet_pipelines.web
from scenarionet_data import version
from scenarionet_data.plots.palette import EGO, NAMES, OBJECTS, OTHER
from scenarionet_pipelines.report.charts import histogram, likeliest
from scenarionet_pipelines.report.contents import PICTURE, Contents, Part, Picture
from scenarionet_pipelines.report.markup import Markup, joined, tag
from scenarionet_pipelines.report.measures import Spread
from scenarionet_pipelines.report.tables import comparison, missing, number, plural, scorecard, summary

_POLICY = "default-src 'none'; style-src 'unsafe-inline'; img-src data:"
"""What the page may load: nothing but what it holds itself."""

_STATISTICS = "Over the scenarios: means, standard deviations and ranges; shares for ratios."

_GROUPS = {
    "typical": "Closest to the median in all measures together.",
    "extreme": "Each the most of something.",
    "random": "Drawn by chance; the same each time the report is made.",
}


def write(contents: Contents, path: str | Path) -> None:
    """Write a report; nothing is left of one that could not be written whole.

    Args:
        contents: What it shows.
        path: Where to.
    """
    whole, file = render(contents).encode(), Path(path)
    unfinished = file.with_name(f".unfinished.{file.name}")
    try:
        unfinished.write_bytes(whole)
        unfinished.replace(file)
    finally:
        unfinished.unlink(missing_ok=True)


def render(contents: Contents) -> str:
    """The page's text."""
    title = f"{contents.name}: a report"
    head = tag(
        "head",
        tag("meta", charset="utf-8"),
        tag("meta", http_equiv="Content-Security-Policy", content=_POLICY),
        tag("meta", name="viewport", content="width=device-width, initial-scale=1"),
        tag("meta", name="color-scheme", content="light dark"),
        tag("title", title),
        tag("style", Markup(_style())),
    )
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
    return f"<!doctype html>\n{tag('html', head, body, lang='en')}\n"


def _style() -> str:
    base = Path(scenarionet_pipelines.web.__file__).with_name("static") / "base.css"
    return base.read_text("utf-8") + Path(__file__).with_name("report.css").read_text("utf-8")


def _header(contents: Contents) -> Markup:
    when = contents.created_at[:16].replace("T", " ")
    lead = f"Snapshot {contents.snapshot}, committed {when} UTC."
    databases = [part.name for part in contents.parts if part.made]
    if databases:
        lead += f" Looked at: {', '.join(databases)}."
    return tag("header", tag("h1", contents.name), tag("p", lead, class_="lead"))


def _footer() -> Markup:
    return tag("footer", f"Made by {version.name_and_version()}, `scenarionet report`. Opens without a network.")


def _section(name: str, title: str, *children: str | None) -> Markup:
    return tag("section", tag("h2", title, id=f"{name}-title"), *children, id=name, aria_labelledby=f"{name}-title")


def _overview(contents: Contents) -> Markup:
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
        f"{plural(contents.quarantined, 'scenario')} in quarantine: `scenarionet sql LAKE quarantine_reasons` says why."
        if contents.quarantined
        else None
    )
    table = summary(rows) if rows else tag("p", "There are no scenarios in this lake yet.", class_="note")
    return _section(
        "overview", "Overview", tag("ul", *cards, class_="facts"), tag("h3", "What it holds"), table,
        tag("p", rejected, class_="note") if rejected else None,
    )  # fmt: skip


def _comparison(contents: Contents) -> Markup | None:
    statistics = [part.statistics for part in contents.parts]
    if not any(each.measures for each in statistics):
        return None
    made = [part for part in contents.parts if part.made]
    how = tag("dl", *(joined(tag("dt", part.name), tag("dd", part.made)) for part in made)) if made else None
    lacking = missing(contents.parts)
    return _section(
        "comparison", "Comparison", tag("p", _STATISTICS, class_="note"),
        comparison(statistics), tag("h3", "How they were made") if how else None, how,
        tag("h3", "Missing values") if lacking else None, lacking,
    )  # fmt: skip


def _distributions(contents: Contents) -> Markup | None:
    known = [spread for spread in contents.spreads if spread.is_known]
    drawn = [spread for spread in known if not spread.is_flat]
    if not known:
        return None
    same = ", ".join(f"{spread.title.lower()} {likeliest(spread)}" for spread in known if spread.is_flat)
    note = "Share of scenarios in each bin; the outer bins hold the outliers, too."
    note += f" The same everywhere: {same}." if same else ""
    names = [group.name for group in known[0].groups]
    legend = tag("ul", *starmap(_swatch, enumerate(names)), class_="legend") if len(names) > 1 else None
    return _section(
        "distributions", "Distributions", tag("p", note, class_="note"),
        legend, tag("div", *map(_chart, drawn), class_="charts"),
    )  # fmt: skip


def _swatch(place: int, name: str) -> Markup:
    return tag("li", tag("span", class_=f"swatch series-{place % 8 + 1}"), name)


def _chart(spread: Spread) -> Markup:
    unit = tag("span", f" [{spread.unit}]", class_="unit") if spread.unit else None
    lacking = tag("small", f"{plural(spread.missing, 'scenario')} without") if spread.missing else None
    return tag("figure", tag("figcaption", spread.title, unit), histogram(spread), lacking, class_="chart")


def _quality(contents: Contents) -> Markup | None:
    cards = [
        joined(_part_title(contents, part), scorecard(part.scorecard)) for part in contents.parts if part.scorecard
    ]
    note = tag("p", "Which scenarios break which rule; docs/guides/checks.md explains the rules.", class_="note")
    return _section("quality", "Quality", note, *cards) if cards else None


def _scenarios(contents: Contents) -> Markup | None:
    shown = [part for part in contents.parts if part.pictures]
    galleries = [joined(_part_title(contents, part), *starmap(_gallery, part.pictures.items())) for part in shown]
    return _section("scenarios", "Scenarios", _key(), *galleries) if galleries else None


def _part_title(contents: Contents, part: Part) -> Markup | None:
    return tag("h3", part.name) if len(contents.parts) > 1 else None


def _key() -> Markup:
    """What the colours in pictures mean."""
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


def _gallery(group: str, pictures: list[Picture]) -> Markup | None:
    if not pictures:
        return None
    title = joined(tag("h3", group.capitalize()), tag("p", _GROUPS[group], class_="note"))
    return joined(title, tag("div", *map(_figure, pictures), class_="pictures"))


def _figure(picture: Picture) -> Markup:
    data = base64.b64encode(picture.png).decode()
    facts = picture.facts
    words = (
        f"{number(facts['ego_distance'])} m in {number(facts['duration'])} s, {plural(facts['num_objects'], 'object')}"
    )
    image = tag(
        "img", src=f"data:image/png;base64,{data}", alt=f"Scenario {picture.scenario_id} from above",
        width=PICTURE[0], height=PICTURE[1],
    )  # fmt: skip
    why = tag("span", picture.why, class_="why") if picture.why else None
    return tag("figure", image, tag("figcaption", why, picture.scenario_id, tag("span", words)))
