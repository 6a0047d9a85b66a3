"""Drop what cannot be read in a pickle, one track, state, light or map feature at a time."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any, TypeVar

import numpy as np

from scenarionet_data.arrays.dtypes import Float64
from scenarionet_data.building import bridge_gaps
from scenarionet_data.building.plausible import find_bad_rows, find_middle
from scenarionet_data.converters.scenarionet.tracks import States
from scenarionet_data.errors import InvalidScenario
from scenarionet_data.ingest.defects import Defects

UNREADABLE = (ArithmeticError, AttributeError, LookupError, RecursionError, TypeError, ValueError, InvalidScenario)
"""Errors raised for a field that is missing, or of the wrong type, shape or value, anywhere in third-party data."""

Built = TypeVar("Built")


def build_usable(
    table: str, members: Mapping[Any, Any], build: Callable[[Mapping[Any, Any]], Built], where: str, defects: Defects
) -> tuple[Mapping[Any, Any], Built]:
    """Build one part of a scenario from those of its members that can be read.

    Args:
        table: ``"tracks"``, ``"lights"`` or ``"maps"``.
        members: By id.
        build: Builds the part; raises an error if a member cannot be read.
        where: Name of the pickle.
        defects: Takes what is dropped.

    Returns:
        The members that can be read, and what was built from them.
    """
    try:
        return members, build(members)
    except UNREADABLE:
        kept = {}
        for key, member in members.items():
            try:
                build({key: member})
                kept[key] = member
            except UNREADABLE as error:
                defects.drop(table, where, _locations(table, key, member), *explain(error))
        return kept, build(kept)


def explain(error: Exception) -> tuple[str, str]:
    """Field and reason of an error, in the words of this project."""
    if isinstance(error, InvalidScenario):
        return error.field.rpartition("]")[2].lstrip(".") or error.field, error.reason
    return "form", f"expected ScenarioNet's form, found a value that does not have it ({type(error).__name__})"


def _locations(table: str, key: Any, member: Any) -> list[str]:
    """A location for each row that a member would have had: the valid timesteps of a track."""
    if table != "tracks":
        return [str(key)]
    try:
        steps = np.flatnonzero(np.asarray(member["state"]["valid"]).reshape(-1) > 0.5).tolist()
    except UNREADABLE:
        steps = []
    return [_location(key, step) for step in steps or [0]]


def _location(track_id: Any, step: int) -> str:
    return f"track {track_id} at step {step}"


def drop_bad_states(states: States, ids: list[str], ego: int, times: Float64, where: str, defects: Defects) -> None:
    """Mark the states that cannot be as not valid, and interpolate the ego's, in place.

    Args:
        states: Of all tracks.
        ids: (N,) of the tracks.
        ego: Row of the ego.
        times: (T,) [s].
        where: Name of the pickle.
        defects: Takes what is dropped.
    """
    rows, steps = np.nonzero(states.valid)
    was_valid = states.valid[ego].copy()
    reference = find_middle(states.position[ego][states.valid[ego]][:, :2])
    position, heading = states.position[rows, steps], states.heading[rows, steps]
    for bad in find_bad_rows(position, heading, states.velocity[rows, steps], states.size[rows, steps], reference):
        found = list(zip(rows[bad.mask].tolist(), steps[bad.mask].tolist(), strict=True))
        defects.drop("tracks", where, [_location(ids[row], step) for row, step in found], bad.field, bad.reason)
        states.valid[rows[bad.mask], steps[bad.mask]] = False
    own = (states.position[ego], states.velocity[ego], states.size[ego], states.heading[ego, :, None])
    bridged, filled = bridge_gaps(times, states.valid[ego], np.concatenate(own, axis=1), angle=8)
    filled &= was_valid
    for values, part in zip(own, np.split(bridged, (3, 5, 8), axis=1), strict=True):
        values[filled] = part[filled]
    states.valid[ego, filled], states.is_interpolated[ego, filled] = True, True
    reason = "expected usable states of the ego, found others, which are interpolated"
    defects.assume(
        "tracks", where, [_location(ids[ego], step) for step in np.flatnonzero(filled).tolist()], "state", reason
    )
