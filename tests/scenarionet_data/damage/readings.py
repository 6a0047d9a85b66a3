"""Ways in which a program reads a lake, in this process."""

from __future__ import annotations

import hashlib
import shutil
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

import numpy as np

from scenarionet_data import Lake, ScenarioLoader
from scenarionet_data.export import export
from scenarionet_data.packs.packing import pack
from scenarionet_data.plots import Drawing, Scene
from scenarionet_sim.evaluation.evaluation import evaluate
from tests.scenarionet_data.damage.lakes import Content

_TABLES = (
    "metadata", "tracks", "lights", "maps", "shards", "quarantine", "defects", "results", "rollouts", "observations",
    "training",
)  # fmt: skip
_FEW = 2
"""Scenarios that are exported, packed, simulated or drawn."""


def digest(scenario: Any) -> str:
    """Digest of all of a scenario but the name of its source file, which nothing else in an older lake states."""
    found = hashlib.blake2b(digest_size=8)

    def add(value: Any) -> None:
        if hasattr(value, "__dataclass_fields__"):
            for name in value.__dataclass_fields__:
                if (type(value).__name__, name) != ("Source", "file"):
                    found.update(name.encode())
                    add(getattr(value, name))
        elif isinstance(value, np.ndarray):
            found.update(repr((value.dtype, value.shape)).encode())
            found.update(repr(value.tolist()).encode() if value.dtype == object else value.tobytes())
        else:
            found.update(repr(value).encode())

    add(scenario)
    return found.hexdigest()


def loaded(root: Path) -> dict[str, str]:
    """Digest of every scenario of a lake by id."""
    return {scenario.id: digest(scenario) for scenario in ScenarioLoader(root)}


def _load(root: Path, name: str, content: Content, out: Path) -> None:
    loader = ScenarioLoader(root, _database(name, content))
    loader.batch(range(min(len(loader), 8)))


def _sql(root: Path, name: str, content: Content, out: Path) -> None:
    folder, kind, *_ = name.split("/")
    if folder == "layers":
        Lake(root).sql(f"SELECT {kind} FROM metadata")
        return
    parts = name.split("/")
    table = {"snapshots": "shards", "results": parts[2] if len(parts) > 3 else "results"}.get(folder, folder)
    Lake(root).sql(f"SELECT * FROM {table if table in _TABLES else 'metadata'}")


def _export(root: Path, name: str, content: Content, out: Path) -> None:
    loader = ScenarioLoader(root, _database(name, content))
    export((loader[index] for index in range(min(_FEW, len(loader)))), out / "pickles")


def _pack(root: Path, name: str, content: Content, out: Path) -> None:
    pack(Lake(root), _database(name, content), out / "pack")


def _simulate(root: Path, name: str, content: Content, out: Path) -> None:
    run = root / "results" / "again"
    try:
        ids = Lake(root).database(_database(name, content)).scenario_ids[:_FEW]
        evaluate(root, ids, policy="replay", name="again")
    finally:
        shutil.rmtree(run, ignore_errors=True)


def _render(root: Path, name: str, content: Content, out: Path) -> None:
    loader = ScenarioLoader(root, _database(name, content))
    for index in range(min(1, len(loader))):
        scene = Scene.of(loader[index])
        Drawing(size=64).save(out / "drawn.png", scene, scene.moments(), 0)


def _database(name: str, content: Content) -> str:
    """The database that a file belongs to, else one with every scenario."""
    folder, kind, *_ = name.split("/")
    return kind if folder == "databases" else content.database


READINGS: Mapping[str, Callable[[Path, str, Content, Path], None]] = {
    "load": _load, "sql": _sql, "export": _export, "pack": _pack, "sim": _simulate, "render": _render,
}  # fmt: skip
"""Read a lake so that a file of the given name is read, if the way reads such files at all."""

SHARES = {"load": 34, "sql": 36, "export": 12, "pack": 6, "sim": 6, "render": 6}
"""How often each way is tried, in percent: the last ones cost most."""
