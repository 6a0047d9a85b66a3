"""The lock file of the development environment agrees with the project's requirements."""

from __future__ import annotations

import re
import tomllib
from collections.abc import Iterator
from pathlib import Path

from packaging.requirements import Requirement
from packaging.utils import canonicalize_name

ROOT = Path(__file__).parents[1]
PROJECT = tomllib.loads((ROOT / "pyproject.toml").read_text("utf-8"))["project"]
LOCK = (ROOT / ".ci" / "requirements.lock").read_text("utf-8")
_PIN = re.compile(
    r"(?P<name>[\w.-]+)(?:\[[\w,.-]+\])?==(?P<version>\S+)(?: ; [^\\]+?)?(?: \\\n    --hash=sha256:[0-9a-f]{64})+"
)


def required(extras: set[str]) -> Iterator[Requirement]:
    """Requirements of the project with some extras, and of the extras that these name."""
    for text in [*PROJECT["dependencies"], *(text for e in extras for text in PROJECT["optional-dependencies"][e])]:
        requirement = Requirement(text)
        if requirement.name == PROJECT["name"]:
            yield from required(requirement.extras)
        else:
            yield requirement


def pins() -> dict[str, list[str]]:
    """Versions by package; several for several versions of Python."""
    found: dict[str, list[str]] = {}
    for pin in _PIN.finditer(LOCK):
        found.setdefault(canonicalize_name(pin["name"]), []).append(pin["version"])
    return found


def test_every_requirement_is_pinned_within_its_bounds():
    pinned = pins()
    wrong = [
        f"{requirement} is pinned to {pinned.get(canonicalize_name(requirement.name), 'nothing')}; run `make lock`"
        for requirement in required({"dev"})
        if not (versions := pinned.get(canonicalize_name(requirement.name)))
        or not all(requirement.specifier.contains(version) for version in versions)
    ]
    assert wrong == []
    assert PROJECT["name"] not in pinned


def test_every_line_is_a_pin_with_hashes():
    """No address of an index, no path, nothing without a hash; comments say what needs a package."""
    left = _PIN.sub("", LOCK)
    assert [line for line in left.splitlines() if line and not re.fullmatch(r"    # .*", line)] == []
    assert "://" not in LOCK
    assert len(pins()) > 100
