"""Run by an interpreter with torch: UniTraj's own preprocessing of pickles, without MetaDrive, h5py and caches.

usage: python unitraj_reference.py CHECKOUT CONFIG ARRAYS.npz PICKLE..., where CONFIG is JSON
"""

from __future__ import annotations

import json
import pickle
import sys
import types
from collections.abc import Iterator
from importlib.abc import Loader, MetaPathFinder
from importlib.machinery import ModuleSpec
from pathlib import Path
from typing import Any

import numpy as np

ABSENT = ("metadrive", "scenarionet", "h5py", "tqdm", "unitraj.utils", "scipy", "matplotlib", "hydra", "omegaconf")


class Stand(MetaPathFinder, Loader):
    """Modules that UniTraj imports and this program does not use."""

    def find_spec(self, name: str, path: Any, target: Any = None) -> ModuleSpec | None:
        return ModuleSpec(name, self, is_package=True) if name.startswith(ABSENT) else None

    def create_module(self, spec: ModuleSpec) -> types.ModuleType:
        return Anything(spec.name)

    def exec_module(self, module: types.ModuleType) -> None:
        pass


class Anything(types.ModuleType):
    def __getattr__(self, name: str) -> Any:
        if name.startswith("__"):
            raise AttributeError(name)
        return {"MetaDriveType": TYPES, "interp1d": interp1d}.get(name, NOTHING)


class Nothing:
    """Accepts any call, also as a decorator."""

    def __call__(self, *_: Any, **__: Any) -> Any:
        return self


NOTHING = Nothing()


def interp1d(x: Any, y: Any, kind: str) -> Any:
    return lambda at: np.interp(at, x, y)


OTHER_NAMES = {"BOUNDARY_LINE": "ROAD_EDGE_BOUNDARY", "BOUNDARY_MEDIAN": "ROAD_EDGE_MEDIAN"}


class Types:
    """MetaDrive's names of types; release 0.4.3."""

    def __getattr__(self, name: str) -> str:
        if name in OTHER_NAMES:
            return OTHER_NAMES[name]
        return f"ROAD_{name}" if name.startswith("LINE_") else name


TYPES = Types()


class Config(dict):
    def __getattr__(self, name: str) -> Any:
        return self[name]


def samples(checkout: str, config: Config, paths: list[str]) -> Iterator[tuple[str, dict[str, Any]]]:
    sys.meta_path.insert(0, Stand())
    for package in ("unitraj", "unitraj.datasets"):  # without their __init__, which imports all models' datasets
        sys.modules[package] = types.ModuleType(package)
        sys.modules[package].__path__ = [f"{checkout}/{package.replace('.', '/')}"]
    from unitraj.datasets.base_dataset import BaseDataset

    dataset = BaseDataset.__new__(BaseDataset)
    dataset.config, dataset.starting_frame = config, 0
    for path in paths:
        scenario = pickle.loads(Path(path).read_bytes())
        for feature in scenario["map_features"].values():  # some pickles have lists, which UniTraj rejects
            lines = {name: np.array(feature[name]) for name in ("polyline", "polygon") if name in feature}
            feature.update(lines)
        found = dataset.process(dataset.preprocess(scenario))
        for sample in found or ():
            yield f"{Path(path).name}|{sample['center_objects_id']}", sample


if __name__ == "__main__":
    checkout, config, out, *paths = sys.argv[1:]
    arrays = {}
    for name, sample in samples(checkout, Config(json.loads(config)), paths):
        for key, value in sample.items():
            if isinstance(value, np.ndarray | np.generic) and np.asarray(value).dtype.kind in "biuf":
                arrays[f"{name}|{key}"] = value
    np.savez(out, **arrays)
