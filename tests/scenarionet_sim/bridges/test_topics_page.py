"""The tables of topics on the pages about stacks are those of the code; run this file to write them."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

import pytest

from scenarionet_sim.bridges import autoware_topics, ros_topics
from scenarionet_sim.bridges.openpilot.car import CAN
from scenarionet_sim.bridges.openpilot.messages import ANSWER, SAMPLES, SENT
from scenarionet_sim.bridges.ros_topics import Topic

PAGES = Path(__file__).parents[3] / "docs/guides"
BEGIN, END = "<!-- topics -->\n", "<!-- /topics -->\n"


def listed(head: str, topics: Mapping[str, Topic]) -> list[str]:
    """A table of topics."""
    lines = ["", f"| {head} | type | with | content |", "| --- | --- | --- | --- |"]
    for name, topic in topics.items():
        needs = f"`+{topic.needs}`" if topic.needs else ""
        once = ", where a scenario begins" if topic.is_once else ""
        lines.append(f"| `/{name}` | `{topic.kind}` | {needs} | {topic.content}{once} |")
    return lines


def told(head: str, rows: Mapping[str, tuple[object, str]]) -> list[str]:
    """A table of what openpilot gets."""
    lines = [f"| `{name}` | {number} | {content} |" for name, (number, content) in rows.items()]
    return ["", f"| {head} | content |", "| --- | --- | --- |", *lines]


def served(head: str, services: Mapping[str, str]) -> list[str]:
    """A table of services."""
    rows = [f"| `/{name}` | `{kind}` |" for name, kind in services.items()]
    return ["", f"| {head} | type |", "| --- | --- |", *rows]


TABLES = {
    "stacks.md": [
        *listed("to the stack", ros_topics.TOPICS),
        *listed("from the stack, one of", ros_topics.ANSWERS),
    ],
    "autoware.md": [
        *listed("to Autoware", autoware_topics.TOPICS),
        *listed("from Autoware", autoware_topics.ANSWERS),
        *served("service of the vehicle", autoware_topics.SERVED),
        *served("service of Autoware, called in this order", autoware_topics.CALLED),
    ],
    "openpilot.md": [
        *told("service | Hz", {name: (SAMPLES // each.every, each.content) for name, each in SENT.items()}),
        *told("message on CAN | bus", CAN),
        *told("from openpilot | Hz", {ANSWER: ("any", "whether it is `enabled`, `accel` and `steeringAngleDeg`")}),
    ],
}


def with_tables(name: str) -> str:
    """A page with its tables."""
    before, rest = (PAGES / name).read_text("utf-8").split(BEGIN)
    return before + BEGIN + "\n".join(TABLES[name]) + "\n\n" + END + rest.split(END)[1]


@pytest.mark.parametrize("name", TABLES)
def test_the_page_has_the_tables_of_the_code(name: str) -> None:
    assert (PAGES / name).read_text("utf-8") == with_tables(name), f"run python {Path(__file__).name}"


if __name__ == "__main__":
    for page in TABLES:
        (PAGES / page).write_text(with_tables(page), "utf-8")
