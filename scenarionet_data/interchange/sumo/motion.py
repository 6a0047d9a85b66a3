"""Write the objects of a scenario as SUMO's types and as its FCD output."""

from __future__ import annotations

import re
from collections.abc import Mapping

import numpy as np

from scenarionet_data.interchange.base import Losses
from scenarionet_data.scenario.description import ScenarioDescription
from scenarionet_data.scenario.vocabulary import ObjectType

CLASSES = {ObjectType.VEHICLE: "passenger", ObjectType.CYCLIST: "bicycle", ObjectType.PEDESTRIAN: "pedestrian"}
"""SUMO's classes of objects; others are left out."""
_LATERAL = 1e-3  # [m/s]


def name_objects(scenario: ScenarioDescription, losses: Losses) -> dict[int, str]:
    """Return the id of each object that SUMO can hold, by row: its own, but for characters that SUMO forbids."""
    tracks = scenario.tracks
    is_held = np.isin(tracks.object_type, list(CLASSES)) & tracks.valid.any(axis=1)
    losses.leave_out("objects that are no vehicles, pedestrians or cyclists, or never seen", int((~is_held).sum()))
    names, used = {}, set[str]()
    for row in np.flatnonzero(is_held).tolist():
        name = re.sub(r"[^A-Za-z0-9._-]", "_", str(tracks.ids[row])) or "_"
        while name in used:
            name += "_"
        used.add(name)
        names[row] = name
        losses.leave_out("ids of objects with characters that SUMO does not allow", int(name != tracks.ids[row]))
    return names


def write_types(scenario: ScenarioDescription, names: Mapping[int, str], losses: Losses) -> bytes:
    """Return a type for each object, as its size is that of its type."""
    tracks, lines = scenario.tracks, ['<?xml version="1.0" encoding="UTF-8"?>', "<additional>"]
    for row, name in names.items():
        sizes = tracks.size[row, tracks.valid[row]]
        length, width, height = sizes[0].tolist()
        change = float(np.abs(sizes - sizes[0]).max())
        losses.approximate("objects whose size changes", int(change > 0.01), change, "m")
        kind = CLASSES[ObjectType(tracks.object_type[row])]
        lines.append(
            f'<vType id="type-{name}" vClass="{kind}" length="{length:.4f}" width="{width:.4f}" height="{height:.4f}"/>'
        )
    return "\n".join([*lines, "</additional>\n"]).encode()


def write_motion(scenario: ScenarioDescription, names: Mapping[int, str], losses: Losses) -> bytes:
    """Return the recorded states as SUMO writes them: the middle of the front, degrees clockwise from the north.

    Pedestrians are vehicles of their class, as SUMO's persons make way for each other when they are moved.
    """
    tracks = scenario.tracks
    rows = list(names)
    heading = tracks.heading[rows].astype(np.float64)
    ahead = 0.5 * tracks.size[rows, :, 0].astype(np.float64)
    front = tracks.position[rows].astype(np.float64)
    front[..., 0] += ahead * np.cos(heading)
    front[..., 1] += ahead * np.sin(heading)
    velocity = tracks.velocity[rows].astype(np.float64)
    speed = velocity[..., 0] * np.cos(heading) + velocity[..., 1] * np.sin(heading)
    lateral = np.abs(velocity[..., 1] * np.cos(heading) - velocity[..., 0] * np.sin(heading))
    count = int((lateral > _LATERAL).sum())
    losses.approximate("velocities, which are ahead", count, float(lateral.max(initial=0.0)), "m/s")
    angle = (90.0 - np.degrees(heading)) % 360.0
    table = np.concatenate([front, angle[..., None], speed[..., None]], axis=2).transpose(1, 0, 2).tolist()
    lines = ['<?xml version="1.0" encoding="UTF-8"?>', "<fcd-export>"]
    for step, time in enumerate(scenario.timestamps.tolist()):
        lines.append(f'<timestep time="{time:.3f}">')
        for place in np.flatnonzero(tracks.valid[rows, step]).tolist():
            x, y, z, degrees, fast = table[step][place]
            name = names[rows[place]]
            lines.append(
                f'<vehicle id="{name}" x="{x:.4f}" y="{y:.4f}" z="{z:.4f}" angle="{degrees:.4f}" '
                f'type="type-{name}" speed="{fast:.4f}"/>'
            )
        lines.append("</timestep>")
    return "\n".join([*lines, "</fcd-export>\n"]).encode()
