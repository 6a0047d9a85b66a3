"""Kept moments as what is varied: scenario, window and roles of each, from the view ``moments``."""

from __future__ import annotations

import hashlib
import warnings
from collections.abc import Mapping
from dataclasses import asdict, dataclass, replace

import numpy as np

from scenarionet_data.building import cut_steps
from scenarionet_data.errors import BadParameter, InvalidScenario
from scenarionet_data.query.lake_view import LakeView
from scenarionet_data.scenario.description import ScenarioDescription
from scenarionet_data.storage.kept_moments import FOLDER

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
    check_kept(view, name)
    rows = view.sql(f"SELECT {columns} FROM moments WHERE name = $name ORDER BY ALL", {"name": name}).rows()
    found: dict[str, list[MomentWindow]] = {}
    for scenario_id, *values in rows:
        found.setdefault(scenario_id, []).append(MomentWindow(*values))
    return found


class PartialMomentsWarning(UserWarning):
    """Moments of a definition are not known for all scenarios of the lake."""


def check_kept(view: LakeView, name: str) -> None:
    """Raise if no moments are kept under a name, and warn of definitions that were mined over a part of the lake.

    Raises:
        BadParameter: The message lists the names.
    """
    if name not in view.files.folders(FOLDER):
        raise BadParameter(
            f"{MOMENTS}{name}: no moments are kept under this name, scenarionet mine --name keeps some; "
            f"there are: {', '.join(view.files.folders(FOLDER)) or 'none yet'}"
        )
    rows = view.arrow(_COVERAGE, {"name": name}).to_pylist()
    partial = [f"{row['definition']} over {row['mined']:,}" for row in rows if row["mined"] < row["scenarios"]]
    if partial:
        warnings.warn(
            PartialMomentsWarning(
                f"moments {name!r} do not cover the lake: of {rows[0]['scenarios']:,} scenarios were mined "
                f"{', '.join(partial)}; scenarionet mine LAKE --name {name} mines the others"
            ),
            stacklevel=3,
        )


_COVERAGE = """
    SELECT
        definition,
        count(DISTINCT scenario_id) AS mined,
        (SELECT count(*) FROM metadata_rows WHERE dataset NOT IN ('moment', 'variation')) AS scenarios
    FROM moments_rows SEMI JOIN metadata_rows USING (scenario_id, content_hash)
    WHERE name = $name
    GROUP BY definition
    ORDER BY definition
"""


def seen_from(scenario: ScenarioDescription, moment: MomentWindow, role: str) -> ScenarioDescription:
    """Return the scenario with the road user of a role as its ego.

    Raises:
        InvalidScenario: Nobody has the role, or who has it is not there all the time of the moment.
    """
    track = moment.roles.get(role)
    if track is None:
        raise InvalidScenario(scenario.id, "moment", f"nobody is the {role} of {moment.definition}")
    there = scenario.tracks.valid[scenario.tracks.index(track), moment.first : moment.last + 1]
    if not there.all():
        step = moment.first + int(there.argmin())
        reason = f"track {track}, the {role} of {moment.definition}, is not there at timestep {step}"
        raise InvalidScenario(scenario.id, "moment", reason)
    return replace(scenario, ego_id=track)


def cut_out(scenario: ScenarioDescription, moment: MomentWindow, margin: float) -> ScenarioDescription:
    """Return the scenario from some seconds before a moment until as long after it; it is now when that begins.

    Road users that are not there are left out. It does not begin before the ego was there without interruption.

    Args:
        scenario: The scenario.
        moment: One of its moments.
        margin: [s].

    Raises:
        InvalidScenario: The ego is not there when the moment begins, or only one timestep would be left.
    """
    time, is_there = scenario.timestamps, scenario.tracks.valid[scenario.ego_index]
    if not is_there[moment.first]:
        reason = f"the ego is not there at timestep {moment.first}, when {moment.definition} begins"
        raise InvalidScenario(scenario.id, "moment", reason)
    since = 1 + int(np.flatnonzero(~is_there[: moment.first]).max(initial=-1))
    first = max(since, int(np.searchsorted(time, time[moment.first] - margin - 1e-6)))
    steps = slice(first, int(np.searchsorted(time, time[moment.last] + margin + 1e-6, side="right")))
    if steps.stop - steps.start < 2:
        reason = f"{moment.definition} lasts for one timestep, {moment.first}; keep time around it with a margin"
        raise InvalidScenario(scenario.id, "moment", reason)
    return replace(cut_steps(scenario, steps), current_timestep=moment.first - first)
