"""Kept moments as what is varied: scenario, window and roles of each, from the view ``moments``."""

from __future__ import annotations

import hashlib
from collections.abc import Mapping
from dataclasses import asdict, dataclass, replace
from typing import Any

import numpy as np

from scenarionet_data.errors import BadParameter, InvalidScenario
from scenarionet_data.query.lake_view import LakeView
from scenarionet_data.scenario.description import ScenarioDescription, Tracks

MOMENTS = "moments:"
"""Prefix of the name of kept moments where scenarios are wanted."""

ALL = 1e6
"""Margin around a moment that keeps the whole scenario [s]."""

ROLES = ("actor", "other")
"""Targets that a moment names: the object that acts, and the other one."""


@dataclass(frozen=True)
class MomentWindow:
    """A kept moment.

    Attributes:
        definition: What happened.
        first, last: Timesteps.
        actor, other: Tracks; empty where there is none.
    """

    definition: str
    first: int
    last: int
    actor: str = ""
    other: str = ""

    @property
    def key(self) -> str:
        """What tells the moments of a scenario apart, also when more are mined."""
        text = repr(tuple(asdict(self).values()))
        return hashlib.blake2b(text.encode(), digest_size=5).hexdigest()

    @property
    def roles(self) -> Mapping[str, str]:
        """Tracks by role."""
        return {role: track for role, track in zip(ROLES, (self.actor, self.other), strict=True) if track}


def read_windows(view: LakeView, name: str) -> dict[str, list[MomentWindow]]:
    """Return the moments that are kept under a name, by scenario.

    Raises:
        BadParameter: There are none.
    """
    columns = "scenario_id, definition, first_timestep, last_timestep, coalesce(track_id, ''), coalesce(other_id, '')"
    rows = view.sql(f"SELECT {columns} FROM moments WHERE name = $name ORDER BY ALL", {"name": name}).rows()
    if not rows:
        kept = view.sql("SELECT DISTINCT name FROM moments ORDER BY 1")["name"]
        raise BadParameter(
            f"{MOMENTS}{name}: no moments are kept under this name, scenarionet mine --name keeps some; "
            f"there are: {', '.join(kept) or 'none yet'}"
        )
    found: dict[str, list[MomentWindow]] = {}
    for scenario_id, *values in rows:
        found.setdefault(scenario_id, []).append(MomentWindow(*values))
    return found


def cut_out(scenario: ScenarioDescription, moment: MomentWindow, margin: float) -> ScenarioDescription:
    """Return the scenario from some seconds before a moment until as long after it; it is now when that begins.

    Road users that are not there are left out.

    Args:
        scenario: The scenario.
        moment: One of its moments.
        margin: [s].

    Raises:
        InvalidScenario: The ego is not there when the moment begins.
    """
    time, ego = scenario.timestamps, scenario.ego_index
    if not scenario.tracks.valid[ego, moment.first]:
        reason = f"the ego is not there at timestep {moment.first}, when {moment.definition} begins"
        raise InvalidScenario(scenario.id, "moment", reason)
    first = int(np.searchsorted(time, time[moment.first] - margin - 1e-6))
    steps = slice(first, int(np.searchsorted(time, time[moment.last] + margin + 1e-6, side="right")))
    kept = np.flatnonzero(scenario.tracks.valid[:, steps].any(axis=1))
    arrays: dict[str, Any] = {name: getattr(scenario.tracks, name)[kept] for name in Tracks.__dataclass_fields__}
    arrays |= {name: each[:, steps] for name, each in arrays.items() if each.ndim > 1}
    tracks = Tracks(**arrays)
    ids = set(tracks.ids)
    return replace(
        scenario,
        timestamps=time[steps] - time[first],
        current_timestep=moment.first - first,
        tracks=tracks,
        lights=replace(scenario.lights, state=scenario.lights.state[:, steps]),
        objects_of_interest=tuple(each for each in scenario.objects_of_interest if each in ids),
        tracks_to_predict=tuple(each for each in scenario.tracks_to_predict if each[0] in ids),
    )
