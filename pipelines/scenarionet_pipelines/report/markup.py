"""HTML from data. Text goes in as text: whatever a scenario is called, it cannot become markup."""

from __future__ import annotations

from html import escape


class Markup(str):
    """Text that is markup already."""

    __slots__ = ()


def tag(name: str, /, *children: str | None, **attributes: str | int | float | None) -> Markup:
    """An element.

    Args:
        name: Of the element.
        *children: Text, which is escaped, or markup; None is left out.
        **attributes: ``class_`` is class, ``data_x`` is data-x; None is left out.

    Example:
        >>> tag("td", "a < b", class_="number")
        '<td class="number">a &lt; b</td>'
    """
    given = "".join(
        f' {key.strip("_").replace("_", "-")}="{escape(str(value))}"'
        for key, value in attributes.items()
        if value is not None
    )
    inside = joined(*children)
    return Markup(f"<{name}{given}>{inside}</{name}>" if name not in _EMPTY else f"<{name}{given}>")


def joined(*children: str | None) -> Markup:
    """Texts and elements one after the other."""
    return Markup("".join(child if isinstance(child, Markup) else escape(child) for child in children if child))


_EMPTY = ("img", "meta", "link", "br", "hr")
