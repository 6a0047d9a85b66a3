"""Checks of the installed packages, this machine, and a lake on a local disk."""

from __future__ import annotations

import importlib
import os
import platform
import re
import sys
import tomllib
from collections.abc import Iterator
from dataclasses import dataclass
from importlib import metadata
from importlib.machinery import PathFinder
from pathlib import Path
from typing import Literal

from scenarionet_data import converters
from scenarionet_data.errors import ScenarioNetError
from scenarionet_data.version import PACKAGE
from scenarionet_pipelines import machine
from scenarionet_pipelines.doctor.finding import Finding

_REQUIREMENT = re.compile(r"([A-Za-z0-9._-]+)(?:\[[^\]]*\])?\s*([^;]*)(?:;(.*))?")
_ENOUGH_DISK = 10 * 10**9
EXTRAS = {
    "sim": "the simulator",
    "plots": "pictures and reports",
    "video": "videos (mp4)",
    "web": "scenarionet browse",
    "notebooks": "the notebooks",
    "lyft": "recordings of Lyft",
    "nuplan": "recordings of nuPlan",
    "remote": "lakes and recordings in object stores",
    "cluster": "Dask clusters",
    "ssh": "Dask clusters over SSH",
    "slurm": "Dask clusters on Slurm",
    "kubernetes": "Dask clusters on Kubernetes",
    "learn": "training (torch)",
    "cuda": "cameras on a graphics card",
    "iceberg": "publishing lakes as Iceberg tables",
    "ducklake": "publishing lakes as DuckLakes",
    "viewers": "exports for Foxglove and rerun",
    "ros": "driving stacks over ROS 2, bags of ROS",
    "driver": "drivers in other processes, in any language",
    "vary": "variations drawn evenly, or from distributions",
}
"""The extras for users and what they are for; the others are for the development of this software."""

_PROJECT = Path(__file__).parents[3] / "pyproject.toml"
"""Exists in a checkout only."""


@dataclass(frozen=True)
class Requirement:
    """A required package.

    Attributes:
        name: The package.
        bounds: Bounds of its version.
        extra: The extra that requires it; empty if it is always required.
        python: The version of Python that it is required for, for example ``3.11.``; empty for any.
    """

    name: str
    bounds: str
    extra: str
    python: str


def examine_installation() -> Iterator[Finding]:
    """Check Python, the required and optional packages, and the converters."""
    is_new = tuple(map(int, platform.python_version_tuple()[:2])) >= (3, 11)
    found = f"{platform.python_version()} on {platform.system()} {platform.machine()}"
    remedy = "" if is_new else "install Python 3.11 or newer"
    yield Finding("python", "version", "ok" if is_new else "bad", found, remedy)
    requirements = [parse(text) for text in _requirements()]
    yield _together("required", [each for each in requirements if not each.extra])
    for extra in EXTRAS:
        yield _together(extra, [each for each in requirements if each.extra == extra and each.name != PACKAGE])
    loaded = []
    for name in converters.names():
        try:
            converters.get(name)
            loaded.append(name)
        except Exception as error:  # a third-party plug-in can fail in any way
            text = f"does not load: {type(error).__name__}: {error}"
            yield Finding("converters", name, "bad", text, "update or uninstall the package that provides it")
    if loaded:
        yield Finding("converters", "installed", "ok", ", ".join(loaded))


def _together(subject: str, requirements: list[Requirement]) -> Finding:
    """The finding about packages that are installed together."""
    is_extra = subject in EXTRAS
    purpose = f"for {EXTRAS[subject]}" if is_extra else f"{len(requirements)} packages"
    here = [each for each in requirements if platform.python_version().startswith(each.python)]
    elsewhere = [f"{each.name} needs Python {each.python.rstrip('.')}" for each in requirements if each not in here]
    problems = {each: problem for each in here if (problem := _problem(each))}
    if not problems and not elsewhere:
        return Finding("packages", subject, "ok", purpose)
    if is_extra:
        remedy = f"pip install -e '.[{subject}]'" if _PROJECT.exists() else f"pip install '{PACKAGE}[{subject}]'"
    else:
        remedy = "pip install " + " ".join(f"'{each.name}{each.bounds}'" for each in problems)
    state: Literal["missing", "bad"] = "missing" if is_extra or not problems else "bad"
    found = f"{purpose}: {', '.join([*problems.values(), *elsewhere])}"
    return Finding("packages", subject, state, found, remedy if problems else "")


def _problem(requirement: Requirement) -> str | None:
    """Return what is wrong with a package; None if it is as required."""
    name = requirement.name
    try:
        version = metadata.version(name)
        if not requirement.extra:  # a required package must also be importable
            importlib.import_module(name.replace("-", "_"))
    except metadata.PackageNotFoundError:
        return f"{name} is not installed"
    except (ImportError, OSError) as error:
        return f"{name} does not load: {error}"
    return None if is_within(version, requirement.bounds) else f"{name} is {version}, wanted {requirement.bounds}"


def _requirements() -> list[str]:
    """Requirements of the installed distribution, or of ``pyproject.toml`` in a checkout that is not installed."""
    try:
        return metadata.requires(PACKAGE) or []
    except metadata.PackageNotFoundError:
        project = tomllib.loads(_PROJECT.read_text("utf-8"))["project"]
        extras = [(text, extra) for extra, texts in project["optional-dependencies"].items() for text in texts]
        marked = (f"{text}{' and' if ';' in text else ';'} extra == '{extra}'" for text, extra in extras)
        return [*project["dependencies"], *marked]


def parse(text: str) -> Requirement:
    """Parse a requirement as package metadata have it.

    Example:
        >>> parse("pybullet<4,>=3.2.7; (python_version == '3.11') and extra == 'sim'")
        Requirement(name='pybullet', bounds='<4,>=3.2.7', extra='sim', python='3.11.')
    """
    found = _REQUIREMENT.match(text)
    name, bounds, marker = found.groups() if found else (text, "", "")
    extra = re.search(r"extra == ['\"](\w+)['\"]", marker or "")
    python = re.search(r"python_version == ['\"]([\d.]+)['\"]", marker or "")
    return Requirement(name, bounds.strip(), extra[1] if extra else "", f"{python[1]}." if python else "")


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


def examine_ros1() -> Finding:
    """Check rospy, which no extra can install."""
    from scenarionet_sim.bridges.rospy_wire import DEBIAN

    if PathFinder.find_spec("rospy", [*sys.path, DEBIAN]):
        return Finding("packages", "rospy", "ok", "for driving stacks over ROS 1")
    remedy = "apt-get install python3-rospy python3-rosmaster"
    return Finding("packages", "rospy", "missing", "for driving stacks over ROS 1: rospy is not installed", remedy)


def examine_openpilot() -> Iterator[Finding]:
    """Check the packages and the schema of a checkout of openpilot, where one is named."""
    from scenarionet_sim.bridges.openpilot.checkout import CHECKOUT, schema_folder

    if CHECKOUT not in os.environ:
        return
    lacking = [name for name in ("capnp", "msgq", "opendbc") if not PathFinder.find_spec(name)]
    try:
        found = f"for openpilot, by the schema in {schema_folder()}"
    except ScenarioNetError as error:
        found, lacking = f"for openpilot: {error}", [*lacking, CHECKOUT]
    remedy = f"install scenarionet-lake in openpilot's own environment, and name its checkout in {CHECKOUT}"
    if lacking:
        yield Finding("packages", "openpilot", "missing", f"{found}; missing: {', '.join(lacking)}", remedy)
    else:
        yield Finding("packages", "openpilot", "ok", found)


# --- machine, lake --------------------------------------------------------------------------------------------


def examine_machine(folder: str) -> Iterator[Finding]:
    """Check cores, memory, and the free disk space of a folder."""
    free = machine.free_disk(folder)
    workers = f"{machine.default_workers()} workers by default (--workers)"
    yield Finding("machine", "cores", "ok", f"{machine.num_cores()}: {workers}")
    yield Finding("machine", "memory", "ok", f"{machine.memory() / 2**30:.1f} GiB")
    is_enough = free >= _ENOUGH_DISK
    remedy = "" if is_enough else "free disk space: the training split of Waymo needs more than 1 TB"
    in_advance = "compiled on first use; `scenarionet maintain compile` compiles all in advance"
    yield Finding("machine", "kernels", "ok", in_advance)
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
            remedy = "restore it from a backup, or convert again into a new lake"
            yield Finding("lake", root, "bad", f"cannot be read: {error}", remedy)
    place = next(each for each in (path, *path.parents) if each.exists())
    is_open = place.is_dir() and os.access(place, os.R_OK | os.W_OK | os.X_OK)
    found = f"{place} is writable" if is_open else f"{place} is not writable"
    yield Finding("lake", "writing", "ok" if is_open else "bad", found, "" if is_open else "change its permissions")
