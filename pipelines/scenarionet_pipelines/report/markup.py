"""HTML elements as strings. Text is always escaped, so that names of scenarios cannot become markup."""

from __future__ import annotations

from base64 import b64encode
from html import escape


class Markup(str):
    """A string that is markup and is not escaped again."""

    __slots__ = ()


def tag(name: str, /, *children: str | None, **attributes: str | int | float | None) -> Markup:
    """Build an element.

    Args:
        name: Name of the element.
        *children: Text, which is escaped, or markup; None is skipped.
        **attributes: Attributes; ``class_`` stands for class, ``data_x`` for data-x, None is skipped.

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
    """Concatenate texts and elements."""
    return Markup("".join(child if isinstance(child, Markup) else escape(child) for child in children if child))


def picture(png: bytes, text: str, size: tuple[int | None, int | None] = (None, None)) -> Markup:
    """Build an image of a PNG file, with a text for those who cannot see it, and its width and height [pixel]."""
    source = f"data:image/png;base64,{b64encode(png).decode()}"
    return tag("img", src=source, alt=text, width=size[0], height=size[1])


_EMPTY = ("img", "meta", "link", "br", "hr")
