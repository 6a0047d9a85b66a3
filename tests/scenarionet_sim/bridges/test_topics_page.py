"""The tables of topics on the page about stacks are those of the code; run this file to write them."""

from __future__ import annotations

from pathlib import Path

from scenarionet_sim.bridges.ros_topics import ANSWERS, TOPICS

PAGE = Path(__file__).parents[3] / "docs/guides/stacks.md"
BEGIN, END = "<!-- topics -->\n", "<!-- /topics -->\n"


def tables() -> str:
    """Both tables."""
    lines = ["", "| to the stack | type (Jazzy) | with | content |", "| --- | --- | --- | --- |"]
    for name, topic in TOPICS.items():
        needs = f"`+{topic.needs}`" if topic.needs else ""
        once = ", where a scenario begins" if topic.is_once else ""
        lines.append(f"| `/{name}` | `{topic.kind}` | {needs} | {topic.content}{once} |")
    lines += ["", "| from the stack, one of | type | content |", "| --- | --- | --- |"]
    lines += [f"| `/{name}` | `{topic.kind}` | {topic.content} |" for name, topic in ANSWERS.items()]
    return "\n".join(lines) + "\n\n"


def with_tables(page: str) -> str:
    """The page with the tables."""
    before, rest = page.split(BEGIN)
    return before + BEGIN + tables() + END + rest.split(END)[1]


def test_the_page_has_the_tables_of_the_code() -> None:
    page = PAGE.read_text("utf-8")
    assert page == with_tables(page), f"run python {Path(__file__).name}"


if __name__ == "__main__":
    PAGE.write_text(with_tables(PAGE.read_text("utf-8")), "utf-8")
