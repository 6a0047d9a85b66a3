"""The scenes of the worlds of a batch in flat arrays: each world built once, shared by all slots that play it."""

from __future__ import annotations

import operator
from dataclasses import dataclass
from weakref import WeakKeyDictionary

import numpy as np

from scenarionet_data.arrays.dtypes import Float32, Float64, Int32, Int64
from scenarionet_data.scenario.vocabulary import LIGHT_COLORS
from scenarionet_sim.cameras.draw.structures import GROUP, Ground, Solids
from scenarionet_sim.cameras.surroundings import fixtures
from scenarionet_sim.cameras.terrain import Terrain
from scenarionet_sim.worlds.blocks import Blocks
from scenarionet_sim.worlds.state import State
from scenarionet_sim.worlds.world import World
from scenarionet_sim.worlds.world_batch import WorldBatch

Scenery = tuple[bool, bool, int]
"""Whether roads have kerbs and sidewalks, whether there are buildings and trees, and the seed of these."""

_KEPT = 32
"""Scenes kept that no slot plays."""


@dataclass(frozen=True, eq=False)
class BuiltScene:
    """The scene of one world.

    Attributes:
        terrain: The ground.
        fixed, fixed_kind: Fixtures in groups, see ``cameras.draw.structures.Solids``.
    """

    terrain: Terrain
    fixed: Float32
    fixed_kind: Int32


_built: WeakKeyDictionary[World, dict[Scenery, BuiltScene]] = WeakKeyDictionary()
_stages: WeakKeyDictionary[WorldBatch, dict[Scenery, Stage]] = WeakKeyDictionary()


def scene_in(world: World, scenery: Scenery) -> BuiltScene:
    """Return the scene of a world, built at the first call."""
    scenes = _built.setdefault(world, {})
    if scenery not in scenes:
        has_sidewalks, has_scenery, seed = scenery
        terrain = Terrain.of(world.roads, has_sidewalks=has_sidewalks)
        fixed, kind = fixtures(world, terrain, seed, has_scenery=has_scenery)
        rest = -len(fixed) % GROUP  # of the last group, which is filled up with some out of sight
        nowhere = np.array([np.inf, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0], np.float32)
        fixed = np.concatenate([fixed, np.tile(nowhere, (rest, 1))]).reshape(-1, GROUP, 7).transpose(0, 2, 1)
        kind = np.concatenate([kind, np.zeros((rest, 4), np.int32)]).reshape(-1, GROUP, 4)
        scenes[scenery] = BuiltScene(terrain, fixed, kind)
    return scenes[scenery]


def stage_of(batch: WorldBatch, scenery: Scenery) -> Stage:
    """Return the stage of a batch, with the worlds that its slots play now."""
    stages = _stages.setdefault(batch, {})
    if scenery not in stages:
        stages[scenery] = Stage(scenery)
    stages[scenery].update(batch)
    return stages[scenery]


class Stage:
    """Scenes of several worlds in flat arrays.

    Args:
        scenery: What surrounds the roads.

    Attributes:
        kinds: The arrays of all worlds, by kind of block.
        ground: Ground of the slots as kernels take it.
    """

    def __init__(self, scenery: Scenery) -> None:
        self._scenery = scenery
        self.kinds = {
            "cells": Blocks({"corner": np.uint8, "cell_start": np.int64}),
            "strokes": Blocks({"strokes": (np.float32, 6), "stroke_kind": np.uint8}),
            "heights": Blocks({"heights": np.float32}),
            "fixed": Blocks({"fixed": (np.float32, 7, GROUP), "fixed_kind": (np.int32, GROUP, 4)}),
        }
        self._places: dict[World, tuple[dict[str, tuple[int, int]], Float64, Float64]] = {}
        self._slots: list[World] = []
        self._dt: Float64 = np.zeros(0)
        self._fixed_range: Int64 = np.zeros((0, 2), np.int64)

    def update(self, batch: WorldBatch) -> None:
        """Build the scenes of new worlds; drop those of worlds that were played long ago."""
        if len(self._slots) == len(batch.worlds) and all(map(operator.is_, self._slots, batch.worlds)):
            return
        self._slots = list(batch.worlds)
        for world in self._slots:
            self._places[world] = self._places.pop(world) if world in self._places else self._store(world)
        for world in list(self._places)[: -len(set(self._slots)) - _KEPT]:
            for kind, block in self._places.pop(world)[0].items():
                self.kinds[kind].remove(*block)
        places = [self._places[world] for world in self._slots]
        arrays = {name: array for kind in self.kinds.values() for name, array in kind.arrays.items()}
        self.ground = Ground(
            place=np.array([(blocks["cells"][0], blocks["heights"][0]) for blocks, _, _ in places], np.int64),
            frame=np.array([frame for _, frame, _ in places]),
            height_frame=np.array([frame for _, _, frame in places]),
            level=np.zeros(len(places)),
            **{name: arrays[name] for name in Ground._fields[4:]},
        )
        self._dt = np.array([world.dt for world in self._slots])
        self._fixed_range = np.array([blocks["fixed"] for blocks, _, _ in places], np.int64)

    def _store(self, world: World) -> tuple[dict[str, tuple[int, int]], Float64, Float64]:
        scene = scene_in(world, self._scenery)
        terrain, heights = scene.terrain, world.heights
        strokes = self.kinds["strokes"].put({"strokes": terrain.strokes, "stroke_kind": terrain.stroke_kind})
        corner = np.append(terrain.corner, np.uint8(0))  # as many rows as first strokes
        blocks = {
            "strokes": strokes,
            "cells": self.kinds["cells"].put({"corner": corner, "cell_start": terrain.cell_start + strokes[0]}),
            "heights": self.kinds["heights"].put(
                {"heights": np.zeros(0, np.float32) if heights is None else heights.values.ravel()}
            ),
            "fixed": self.kinds["fixed"].put({"fixed": scene.fixed, "fixed_kind": scene.fixed_kind}),
        }
        return blocks, terrain.frame, np.zeros(5) if heights is None else heights.frame

    def solids(self, batch: WorldBatch, state: State) -> Solids:
        """Return everything that stands on the ground, as kernels take it."""
        fixed = self.kinds["fixed"].arrays
        return Solids(
            state.motion, state.size, state.object_type, state.present, state.timestep, self._dt, batch.place,
            batch.recorded.log, batch.recorded.light_state, self._fixed_range, fixed["fixed"], fixed["fixed_kind"],
            LIGHT_COLORS,
        )  # fmt: skip
