"""Hatchling's build backend, with machine code of the kernels in wheels that it builds for this processor.

``pip install`` of an address or a checkout builds such a wheel, in about a minute and a half, so that first uses need
not compile. Where that fails, and with ``-C machine-code=no``, the wheel has none. What ``make build`` put there stays.
"""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
import tomllib
from contextlib import suppress
from pathlib import Path
from typing import Any

from hatchling import build as hatchling
from hatchling.build import *  # noqa: F403 - the other hooks

_LONGEST = 1_200  # [s]
_CODE = Path("scenarionet_data/compiled/machine_code")  # backends run in the folder of pyproject.toml


def _is_to_compile(settings: dict[str, Any] | None) -> bool:
    return (settings or {}).get("machine-code") != "no" and not _CODE.exists()


def get_requires_for_build_wheel(config_settings: dict[str, Any] | None = None) -> list[str]:
    """Return what compiling needs: what is installed with the wheel anyway, and packages of environments."""
    needs: list[str] = hatchling.get_requires_for_build_wheel(config_settings)
    if not _is_to_compile(config_settings):
        return needs
    project = tomllib.loads(Path("pyproject.toml").read_text("utf-8"))["project"]
    sim = [need for need in project["optional-dependencies"]["sim"] if not need.startswith("pybullet")]
    return [*needs, *project["dependencies"], *sim]


def build_wheel(
    wheel_directory: str, config_settings: dict[str, Any] | None = None, metadata_directory: str | None = None
) -> str:
    """Compile, if there is no machine code yet; build a wheel, and return its name."""
    is_made_here = _is_to_compile(config_settings)
    try:
        if is_made_here:
            path = os.pathsep.join(filter(None, (".", "pipelines", os.environ.get("PYTHONPATH"))))
            with suppress(OSError, subprocess.SubprocessError):
                words = [sys.executable, "-m", "scenarionet_pipelines.compiling"]
                subprocess.run(words, env=os.environ | {"PYTHONPATH": path}, check=True, timeout=_LONGEST)  # noqa: S603
        name: str = hatchling.build_wheel(wheel_directory, config_settings, metadata_directory)
        return name
    finally:
        if is_made_here:
            shutil.rmtree(_CODE, ignore_errors=True)
