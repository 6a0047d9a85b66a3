"""All meshes as the kernels of cameras take them, with those that stand for them from far away."""

from __future__ import annotations

from functools import lru_cache

import numpy as np

from scenarionet_data.arrays.dtypes import Float32
from scenarionet_sim.cameras.draw import codes as at
from scenarionet_sim.cameras.draw import columns
from scenarionet_sim.cameras.draw.structures import Meshes
from scenarionet_sim.cameras.draw.vertices import LIMBS
from scenarionet_sim.cameras.meshes import far_vehicles, people, things, vehicles
from scenarionet_sim.cameras.meshes.materials import MATERIAL_COLORS, PAINTS
from scenarionet_sim.cameras.shapes import Shape, box, joined, tube, with_normals

_CREASE = 0.75
"""Edges sharper than this [rad] are seen as edges; others are smooth."""

_LANES = 8
"""Meshes have a multiple of so many vertices, the last one again and again, as the processor places several at once."""


def _sources() -> dict[int, tuple[list[Shape], tuple[float, float, float]]]:
    """Return the shapes of each mesh, and a typical length, width and height."""
    whole = [box((-0.5, -0.5, 0.0), (0.5, 0.5, 1.0), at.BODY)]
    pole = [tube((0.0, 0.0, 0.0), (0.0, 0.0, 1.0), ((0.5, 0.5), (0.35, 0.35)), at.METAL, 8)]
    return {
        at.BOX: (whole, (1.0, 1.0, 1.0)),
        at.CAR: (vehicles.car(), (4.6, 1.9, 1.55)),
        at.VAN: (vehicles.van(), (5.4, 2.0, 2.0)),
        at.TRUCK: (vehicles.truck(), (8.0, 2.5, 3.2)),
        at.BUS: (vehicles.bus(), (12.0, 2.5, 3.2)),
        at.PEDESTRIAN: (people.person(), (0.6, 0.6, 1.75)),
        at.CYCLIST: (people.cyclist(), (1.8, 0.6, 1.75)),
        at.CONE: (things.cone(), (0.4, 0.4, 0.8)),
        at.BARRIER: (things.barrier(), (2.0, 0.5, 1.0)),
        at.LIGHT_HEAD: (things.light_head(), (0.35, 0.35, 1.0)),
        at.POLE: (pole, (0.2, 0.2, 6.0)),
        at.TREE: (things.tree(), (5.0, 5.0, 8.0)),
        at.CONIFER: (things.conifer(), (4.0, 4.0, 9.0)),
        at.BUILDING: (things.building(), (15.0, 15.0, 12.0)),
        at.SIGN: (things.sign(), (0.3, 0.7, 2.9)),
        at.DECK: (vehicles.interior(), (4.6, 1.9, 1.55)),
        at.CAR_FAR: (far_vehicles.far_car(), (4.6, 1.9, 1.55)),
        at.TRUCK_FAR: (far_vehicles.far_truck(), (8.0, 2.5, 3.2)),
        at.PERSON_FAR: (people.far_person(), (0.6, 0.6, 1.75)),
        at.BLOCK: ([things.open_box(at.BODY)], (1.0, 1.0, 1.0)),
        at.WALLS: ([things.open_box(at.FACADE)], (15.0, 15.0, 12.0)),
        at.LIGHT_FAR: (things.far_light_head(), (0.35, 0.35, 1.0)),
        at.CAR_MIDDLE: (far_vehicles.middle_car(), (4.6, 1.9, 1.55)),
        at.VAN_MIDDLE: (far_vehicles.middle_van(), (5.4, 2.0, 2.0)),
        at.TREE_MIDDLE: (things.middle_tree(), (5.0, 5.0, 8.0)),
        at.TREE_FAR: (things.far_tree(), (5.0, 5.0, 8.0)),
        at.TREE_TINY: (things.tiny_tree(6), (5.0, 5.0, 8.0)),
        at.TREE_DOT: (things.tiny_tree(4), (5.0, 5.0, 8.0)),
        at.CONIFER_MIDDLE: (things.middle_conifer(), (4.0, 4.0, 9.0)),
        at.CONIFER_FAR: (things.far_conifer(), (4.0, 4.0, 9.0)),
        at.CONIFER_TINY: (things.tiny_conifer(), (4.0, 4.0, 9.0)),
        at.POLE_FAR: (things.far_pole(0.42), (0.2, 0.2, 6.0)),
        at.LAMP: (things.street_lamp(), (2.6, 2.6, 7.5)),
        at.LAMP_FAR: (things.far_pole(0.027), (2.6, 2.6, 7.5)),
        at.SPECK: ([things.open_box(at.BODY)], (1.0, 1.0, 1.0)),
    }


_COARSER = {
    at.CAR: (at.CAR_MIDDLE, 60), at.VAN: (at.VAN_MIDDLE, 60), at.CAR_MIDDLE: (at.CAR_FAR, 24),
    at.VAN_MIDDLE: (at.CAR_FAR, 24), at.CAR_FAR: (at.BLOCK, 6), at.TRUCK: (at.TRUCK_FAR, 24),
    at.BUS: (at.TRUCK_FAR, 24), at.TRUCK_FAR: (at.BLOCK, 6), at.PEDESTRIAN: (at.PERSON_FAR, 24),
    at.CYCLIST: (at.PERSON_FAR, 24), at.PERSON_FAR: (at.BLOCK, 6), at.CONE: (at.BLOCK, 6), at.BARRIER: (at.BLOCK, 6),
    at.LIGHT_HEAD: (at.LIGHT_FAR, 24), at.POLE: (at.POLE_FAR, 60),
    at.LAMP: (at.LAMP_FAR, 36), at.SIGN: (at.LAMP_FAR, 6), at.BUILDING: (at.WALLS, 14),
    at.TREE: (at.TREE_MIDDLE, 70), at.TREE_MIDDLE: (at.TREE_FAR, 36), at.TREE_FAR: (at.TREE_TINY, 8),
    at.TREE_TINY: (at.TREE_DOT, 3), at.CONIFER: (at.CONIFER_MIDDLE, 70), at.CONIFER_MIDDLE: (at.CONIFER_FAR, 36),
    at.CONIFER_FAR: (at.CONIFER_TINY, 8), at.BLOCK: (at.SPECK, 3),
}  # fmt: skip
"""The next coarser mesh of each, and the radius on the screen [pixels] below which it is drawn instead."""


_ONE_SIDED = (at.TREE_FAR, at.TREE_TINY, at.TREE_DOT, at.CONIFER_FAR, at.CONIFER_TINY, at.POLE_FAR, at.LAMP_FAR)
"""Meshes that have only the side that faces the camera."""


_OUTLINES = {
    at.TREE_TINY: (0.32, 1.0, 0.41, 0.0, -0.75, 0.0), at.TREE_DOT: (0.32, 1.0, 0.41, 0.0, -0.75, 0.0),
    at.CONIFER_TINY: (0.12, 1.0, 0.19, 1.0, 0.0, 0.0), at.POLE_FAR: (0.0, 1.0, 0.42, 0.0, 0.0, 0.0),
    at.LAMP_FAR: (0.0, 1.0, 0.027, 0.0, 0.0, 0.0), at.SPECK: (0.0, 1.0, 0.5, 0.0, 0.0, 0.5),
}  # fmt: skip
"""See ``Meshes.outlines``."""


_GLOSSY = (at.BODY, at.GLASS, at.METAL)
"""Materials that mirror."""


@lru_cache
def library() -> Meshes:
    """Return all meshes as kernels take them."""
    sources = _sources()
    ranges = np.zeros((len(sources), 8), np.int32)
    joints: Float32 = np.full((len(sources), 8, 5), -1.0, np.float32)
    vertices, parts, corners, materials = [], [], [], []
    outlines: Float32 = np.zeros((len(sources), columns.NUM_OUTLINE), np.float32)
    for mesh, outline in _OUTLINES.items():
        outlines[mesh] = outline
    num_vertices = num_triangles = 0
    for mesh, (shapes, size) in sorted(sources.items()):
        points, triangles, material, part = joined(shapes)
        a, b, c = (points[triangles[:, k]] for k in range(3))
        kept = np.linalg.norm(np.cross((b - a) * size, (c - a) * size), axis=1) > 1e-9
        vertex, split, vertex_part = with_normals(points, triangles, part, size, _CREASE)
        filled = np.minimum(np.arange(-(-len(vertex) // _LANES) * _LANES), len(vertex) - 1)
        vertex, vertex_part = vertex[filled], vertex_part[filled]
        ranges[mesh] = (
            num_vertices, num_vertices + len(vertex), num_triangles, num_triangles + len(split),
            *_COARSER.get(mesh, (mesh, 0)), np.isin(material, _GLOSSY).any(), mesh in _ONE_SIDED,
        )  # fmt: skip
        for joint in np.unique(vertex_part[vertex_part > 0]).tolist():
            on_it = vertex[vertex_part == joint, :3]
            low, high = on_it.min(axis=0), on_it.max(axis=0)
            joints[mesh, joint - 1] = *(low + high) / 2, (high[0] - low[0]) / 2, (high[2] - low[2]) / 2
            if joint > LIMBS:  # they swing about their upper ends, and keep their length in boxes of typical shape
                joints[mesh, joint - 1, :3] = on_it[on_it[:, 2] > high[2] - 0.03].mean(axis=0)
                joints[mesh, joint - 1, 3:] = 1.0 / size[0], 1.0 / size[2]
        vertices.append(vertex)
        parts.append(vertex_part)
        corners.append(split + num_vertices)
        materials.append(material[kept])
        num_vertices, num_triangles = num_vertices + len(vertex), num_triangles + len(split)
    colors = [MATERIAL_COLORS[material] for material in sorted(MATERIAL_COLORS)]
    return Meshes(
        ranges, np.ascontiguousarray(np.concatenate(vertices).astype(np.float32).T), np.concatenate(parts),
        np.concatenate(corners).astype(np.int32), np.concatenate(materials), joints,
        np.array([*colors, *PAINTS], np.float32), outlines,
    )  # fmt: skip
