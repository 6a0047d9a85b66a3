"""Checks of the installed packages, this machine, and a lake on a local disk."""

from __future__ import annotations

import importlib
import os
import platform
import re
import tomllib
from collections.abc import Iterator
from importlib import metadata
from pathlib import Path
from typing import Literal

from scenarionet_data import converters
from scenarionet_data.errors import ScenarioNetError
from scenarionet_data.version import PACKAGE
from scenarionet_pipelines import machine
from scenarionet_pipelines.doctor.finding import Finding

_REQUIREMENT = re.compile(r"([A-Za-z0-9._-]+)(?:\[[^\]]*\])?\s*([^;]*)(?:;(.*))?")
_ENOUGH_DISK = 10 * 10**9
_PROJECT = Path(__file__).parents[3] / "pyproject.toml"
"""Exists in a checkout only."""


def examine_installation() -> Iterator[Finding]:
    """Check Python, the required and optional packages, and the converters."""
    yield from _python()
    yield from _packages()
    yield from _converters()


def _python() -> Iterator[Finding]:
    is_new = tuple(map(int, platform.python_version_tuple()[:2])) >= (3, 11)
    found = f"{platform.python_version()} on {platform.system()} {platform.machine()}"
    remedy = "" if is_new else "install Python 3.11 or newer"
    yield Finding("python", "version", "ok" if is_new else "bad", found, remedy)


# --- packages -------------------------------------------------------------------------------------------------


def _packages() -> Iterator[Finding]:
    for text in _requirements():
        name, wanted, marker = _parse(text)
        extra = re.search(r"extra == ['\"](\w+)['\"]", marker)
        python = re.search(r"python_version == ['\"]([\d.]+)['\"]", marker)
        if python and not platform.python_version().startswith(python.group(1) + "."):
            yield Finding("packages", name, "missing", f"not available for this Python, only for {python.group(1)}")
        else:
            yield _package(name, wanted, extra.group(1) if extra else None)


def _package(name: str, wanted: str, extra: str | None) -> Finding:
    absent: Literal["missing", "bad"] = "missing" if extra else "bad"
    if extra:
        remedy = f"pip install -e '.[{extra}]'" if _PROJECT.exists() else f"pip install '{PACKAGE}[{extra}]'"
    else:
        remedy = f"pip install '{name}{wanted}'"
    try:
        version = metadata.version(name)
        if not extra:  # a required package must also be importable
            importlib.import_module(name.replace("-", "_"))
    except metadata.PackageNotFoundError:
        return Finding("packages", name, absent, "not installed", remedy)
    except (ImportError, OSError) as error:
        return Finding("packages", name, "bad", f"does not load: {error}", remedy)
    if not is_within(version, wanted):
        return Finding("packages", name, absent, f"{version}, wanted {wanted}", remedy)
    return Finding("packages", name, "ok", version)


def _requirements() -> list[str]:
    """Requirements of the installed distribution, or of ``pyproject.toml`` in a checkout that is not installed."""
    try:
        return metadata.requires(PACKAGE) or []
    except metadata.PackageNotFoundError:
        project = tomllib.loads(_PROJECT.read_text("utf-8"))["project"]
        extras = project["optional-dependencies"].items()
        return [*project["dependencies"], *(_with_extra(text, extra) for extra, texts in extras for text in texts)]


def _with_extra(text: str, extra: str) -> str:
    return f"{text}{' and' if ';' in text else ';'} extra == '{extra}'"


def _parse(requirement: str) -> tuple[str, str, str]:
    """Split a requirement into name, version bounds and marker."""
    found = _REQUIREMENT.match(requirement)
    name, wanted, marker = found.groups() if found else (requirement, "", "")
    return name, wanted.strip(), marker or ""


def is_within(version: str, wanted: str) -> bool:
    """Return whether a version satisfies bounds such as ``>=19,<27``.

    Example:
        >>> is_within("26.0.1", ">=19,<27"), is_within("27.0", ">=19,<27")
        (True, False)
    """
    for bound in filter(None, (text.strip() for text in wanted.split(","))):
        operator, limit = bound.rstrip("0123456789."), _numbers(bound)
        there = _numbers(version)
        if (operator == ">=" and there < limit) or (operator == "<" and there >= limit):
            return False
    return True


def _numbers(version: str) -> tuple[int, ...]:
    found = re.search(r"\d+(\.\d+)*", version)
    return tuple(map(int, found.group().split("."))) if found else ()


# --- converters, machine, lake --------------------------------------------------------------------------------


def _converters() -> Iterator[Finding]:
    for name in converters.names():
        try:
            found = converters.get(name)
        except Exception as error:  # a third-party plug-in can fail in any way
            text = f"does not load: {type(error).__name__}: {error}"
            yield Finding("converters", name, "bad", text, "update or uninstall the package that provides it")
        else:
            yield Finding("converters", name, "ok", f"version {found.version} for {found.release}")


def examine_machine(folder: str) -> Iterator[Finding]:
    """Check cores, memory, and the free disk space of a folder."""
    free = machine.free_disk(folder)
    yield Finding("machine", "cores", "ok", f"{machine.num_cores()}")
    yield Finding("machine", "memory", "ok", f"{machine.memory() / 2**30:.1f} GiB")
    yield Finding("machine", "workers", "ok", f"{machine.default_workers()} by default (--workers)")
    is_enough = free >= _ENOUGH_DISK
    remedy = "" if is_enough else "free disk space: the training split of Waymo needs more than 1 TB"
    yield Finding("machine", "kernels", "ok", "compiled on first use; `scenarionet compile` compiles all in advance")
    yield Finding("machine", "free disk", "ok" if is_enough else "missing", f"{free / 1e9:,.1f} GB", remedy)


def examine_lake(root: str) -> Iterator[Finding]:
    """Check that a lake on a local disk can be read and written."""
    from scenarionet_data import Lake

    path = Path(os.path.realpath(root))
    if not (path / "snapshots").is_dir():
        yield Finding("lake", root, "missing", "not a lake yet", f"scenarionet convert DATASET RAW {root}")
    else:
        try:
            lake = Lake(root)
            yield Finding("lake", root, "ok", f"snapshot {lake.snapshot.number}, {len(lake):,} scenarios")
        except (ScenarioNetError, OSError) as error:
            yield Finding(
                "lake",
                root,
                "bad",
                f"cannot be read: {error}",
                "restore it from a backup, or convert again into a new lake",
            )
    place = path
    while not place.exists():
        place = place.parent
    is_open = place.is_dir() and os.access(place, os.R_OK | os.W_OK | os.X_OK)
    found = f"{place} is writable" if is_open else f"{place} is not writable"
    yield Finding("lake", "writing", "ok" if is_open else "bad", found, "" if is_open else "change its permissions")
