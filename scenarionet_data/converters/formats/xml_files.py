"""Parse XML files of unknown origin: no entities, so that none can explode or read another file."""

from __future__ import annotations

from math import nan
from pathlib import Path
from xml.etree import ElementTree
from xml.parsers import expat

from scenarionet_data.errors import CorruptSource


def read_xml(path: Path, root: str) -> ElementTree.Element:
    """Read a file.

    Args:
        path: The file.
        root: Name of its outermost element.

    Raises:
        CorruptSource: Missing, no XML, with a document type (only these define entities), or with another root.
    """
    guard = expat.ParserCreate()
    guard.StartDoctypeDeclHandler = _refuse_doctype
    try:
        data = path.read_bytes()
        guard.Parse(data, True)
        element = ElementTree.fromstring(data)  # noqa: S314  # it has no document type
    except (OSError, expat.ExpatError, ElementTree.ParseError, ValueError, LookupError) as error:
        raise CorruptSource(f"{path}: expected XML with the root <{root}> ({error}); download it again") from error
    if element.tag != root:
        raise CorruptSource(f"{path}: expected XML with the root <{root}>, found <{element.tag[:64]}>")
    return element


def to_number(text: object) -> float:
    """Return the number that a text is; NaN for anything else."""
    try:
        return float(text or "nan") if isinstance(text, str | bytes) else nan
    except ValueError:
        return nan


def _refuse_doctype(name: str, *_: object) -> None:
    raise ValueError(f"found the document type {name[:64]!r}, which is not read")
