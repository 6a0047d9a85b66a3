"""Write scenarios as CommonRoad 2020a, with the recorded ego as a solution beside them."""

from __future__ import annotations

import hashlib
import re
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from typing import ClassVar
from xml.sax.saxutils import quoteattr

import numpy as np

from scenarionet_data.arrays.dtypes import Array, Float64
from scenarionet_data.errors import InvalidScenario
from scenarionet_data.interchange.base import Losses
from scenarionet_data.interchange.commonroad.layout import MOVING, SOLUTION, STANDING, WAITING
from scenarionet_data.interchange.commonroad.map_writer import write_map
from scenarionet_data.interchange.lanelets import make_lanelets
from scenarionet_data.interchange.numbering import number_ids
from scenarionet_data.scenario.description import ScenarioDescription
from scenarionet_data.scenario.vocabulary import ObjectType

_STILL = 1e-3  # [m] objects that never move farther are obstacles that stand
_LATERAL = 1e-3  # [m/s]
_WHEELBASE = 2.579  # [m] of CommonRoad's BMW 320i, with which the solution says that the ego drives
_EGO_SIZE = (4.508, 1.610)  # [m] its length and width
_STATE = (
    "<position><point><x>%.5f</x><y>%.5f</y></point></position><orientation><exact>%.6f</exact></orientation>"
    "<time><exact>%d</exact></time><velocity><exact>%.5f</exact></velocity>"
)
_SOLVED = (
    "<stState><x>%.5f</x><y>%.5f</y><steeringAngle>%.6f</steeringAngle><velocity>%.5f</velocity>"
    "<orientation>%.6f</orientation><yawRate>%.6f</yawRate><slipAngle>%.6f</slipAngle><time>%d</time></stState>"
)


@dataclass(frozen=True)
class CommonRoadWriter:
    """Writes one scenario a file, in the scenario frame, and beside it how the ego drove.

    Attributes:
        solution: Write the recorded ego as a solution.
    """

    name: ClassVar[str] = "commonroad"
    solution: bool = True

    def write(self, scenario: ScenarioDescription, stem: str, losses: Losses) -> Mapping[str, bytes]:
        """Return the files of a scenario; see :class:`~scenarionet_data.interchange.base.FormatWriter`."""
        if scenario.map is None:
            raise InvalidScenario(scenario.id, "map", "expected a map, which CommonRoad demands, found none")
        lanelets = make_lanelets(scenario.map, losses)
        if not lanelets:
            raise InvalidScenario(scenario.id, "map", "expected lanes, which CommonRoad demands, found none")
        rows = np.flatnonzero(scenario.tracks.valid.any(axis=1)).tolist()
        ego = scenario.ego_index
        named: dict[str, Iterable[str]] = {
            "map features": [scenario.map.ids[lanelet.row] for lanelet in lanelets],
            "objects": [scenario.tracks.ids[row] for row in rows],
            "traffic lights": scenario.lights.ids,
        }
        numbers, free = number_ids(named, losses, first=1)
        number_of = dict(zip(rows, numbers["objects"], strict=True))
        words = re.sub(r"[^A-Za-z0-9]", "", scenario.dataset).capitalize()
        words += hashlib.blake2b(scenario.id.encode(), digest_size=6).hexdigest()
        # As CommonRoad wants it: country, map, and the numbers of the map, the configuration and the prediction.
        benchmark = f"ZAM_{words}-1_1_T-1"
        lines = [*_header(scenario, benchmark), *write_map(scenario, lanelets, numbers, free, losses)]
        standing = [row for row in rows if row != ego and _stands(scenario, row)]
        for row in sorted(rows, key=lambda row: row not in standing):
            lines += _obstacle(scenario, row, number_of[row], row in standing) if row != ego else []
        lines += _problem(scenario, number_of[ego])
        lines.append("</commonRoad>\n")
        _report(scenario, rows, standing, self.solution, losses)
        files = {f"{stem}.xml": "\n".join(lines).encode()}
        if self.solution:
            files[f"{stem}{SOLUTION}"] = _solution(scenario, number_of[ego], benchmark)
        return files


def _header(scenario: ScenarioDescription, benchmark: str) -> list[str]:
    x, y, _ = scenario.origin.tolist()
    return [
        '<?xml version="1.0" encoding="UTF-8"?>',
        f'<commonRoad commonRoadVersion="2020a" benchmarkID="{benchmark}" date="1970-01-01" author="scenarionet-lake" '
        f'affiliation="" source={quoteattr(scenario.id)} timeStepSize="{scenario.dt:.9f}">',
        "<location><geoNameId>-999</geoNameId><gpsLatitude>999</gpsLatitude><gpsLongitude>999</gpsLongitude>"
        "<geoTransformation><geoReference/><additionalTransformation>"
        f"<xTranslation>{x:.5f}</xTranslation><yTranslation>{y:.5f}</yTranslation>"
        "<zRotation>0</zRotation><scaling>1</scaling>"
        "</additionalTransformation></geoTransformation></location>",
        "<scenarioTags/>",
    ]


def _stands(scenario: ScenarioDescription, row: int) -> bool:
    """Whether an object is no road user, and stands in one place all the time."""
    tracks = scenario.tracks
    if ObjectType(tracks.object_type[row]) in MOVING or not tracks.valid[row].all():
        return False
    moved = np.abs(tracks.position[row] - tracks.position[row, 0]).max()
    turned = np.abs(tracks.heading[row] - tracks.heading[row, 0]).max()
    return bool(max(moved, turned) < _STILL and np.abs(tracks.velocity[row]).max() < _STILL)


def _obstacle(scenario: ScenarioDescription, row: int, number: int, stands: bool) -> list[str]:
    tracks = scenario.tracks
    kind, states = ObjectType(tracks.object_type[row]), _states(scenario, row)
    length, width, _ = tracks.size[row, int(np.argmax(tracks.valid[row]))].tolist()
    shape = f"<shape><rectangle><length>{length:.4f}</length><width>{width:.4f}</width></rectangle></shape>"
    if stands:
        return [
            f'<staticObstacle id="{number}"><type>{STANDING.get(kind, "unknown")}</type>{shape}',
            f"<initialState>{states[0]}</initialState></staticObstacle>",
        ]
    return [
        f'<dynamicObstacle id="{number}"><type>{MOVING.get(kind, "unknown")}</type>{shape}',
        f"<initialState>{states[0]}</initialState><trajectory>",
        *(f"<state>{state}</state>" for state in states[1:]),
        "</trajectory></dynamicObstacle>",
    ]


def _states(scenario: ScenarioDescription, row: int) -> list[str]:
    """States from the first timestep to the last in which an object is seen, and to the second at least.

    It waits far away while it is not seen: of states with gaps, CommonRoad's tools would take later ones as the next.
    """
    tracks = scenario.tracks
    last = max(int(np.flatnonzero(tracks.valid[row])[-1]), 1)
    forward, lateral = (each.tolist() for each in _in_own_frame(scenario, row))
    has_lateral = np.abs(lateral).max() > _LATERAL
    places, headings = tracks.position[row].tolist(), tracks.heading[row].tolist()
    is_seen = [*tracks.valid[row].tolist(), False]
    states = []
    for step in range(last + 1):
        if is_seen[step]:
            text = _STATE % (places[step][0], places[step][1], headings[step], step, forward[step])
            sideways = lateral[step]
        else:
            text, sideways = _STATE % (*WAITING, 0.0, step, 0.0), 0.0
        states.append(f"{text}<velocityY><exact>{sideways:.5f}</exact></velocityY>" if has_lateral else text)
    return states


def _in_own_frame(scenario: ScenarioDescription, row: int) -> tuple[Float64, Float64]:
    """Velocity of an object ahead and to its left (T,) [m/s]."""
    velocity = scenario.tracks.velocity[row].astype(np.float64)
    cos, sin = np.cos(scenario.tracks.heading[row]), np.sin(scenario.tracks.heading[row])
    return velocity[:, 0] * cos + velocity[:, 1] * sin, velocity[:, 1] * cos - velocity[:, 0] * sin


def _problem(scenario: ScenarioDescription, number: int) -> list[str]:
    """The ego's first state, and where it is last seen as its goal."""
    tracks, row = scenario.tracks, scenario.ego_index
    seen = np.flatnonzero(tracks.valid[row])
    first, last = int(seen[0]), int(seen[-1])
    x, y, _ = tracks.position[row, first].tolist()
    goal_x, goal_y, _ = tracks.position[row, last].tolist()
    length, width, _ = tracks.size[row, last].tolist()
    forward, lateral = (float(each[first]) for each in _in_own_frame(scenario, row))
    slip = np.arctan2(lateral, forward) if abs(lateral) > _LATERAL else 0.0
    yaw_rate = float(_yaw_rates(scenario, seen)[0])
    speed = float(np.hypot(forward, lateral)) if slip else forward
    start = _STATE % (x, y, tracks.heading[row, first], 0, speed)
    ends = max(scenario.num_timesteps - 1, 1)
    return [
        f'<planningProblem id="{number}"><initialState>{start}<yawRate><exact>{yaw_rate:.6f}</exact></yawRate>'
        f"<slipAngle><exact>{slip:.6f}</exact></slipAngle></initialState>",
        f"<goalState><time><intervalStart>{min(last, ends)}</intervalStart><intervalEnd>{ends}</intervalEnd></time>"
        f"<position><rectangle><length>{length:.4f}</length><width>{width:.4f}</width>"
        f"<orientation>{tracks.heading[row, last]:.6f}</orientation>"
        f"<center><x>{goal_x:.5f}</x><y>{goal_y:.5f}</y></center></rectangle></position></goalState></planningProblem>",
    ]


def _yaw_rates(scenario: ScenarioDescription, seen: Array) -> Float64:
    """Yaw rate [rad/s] of the ego at the timesteps in which it is seen."""
    if len(seen) < 2:
        return np.zeros(len(seen))
    heading = np.unwrap(scenario.tracks.heading[scenario.ego_index, seen].astype(np.float64))
    rates: Float64 = np.gradient(heading, scenario.timestamps[seen])
    return rates


def _solution(scenario: ScenarioDescription, number: int, benchmark: str) -> bytes:
    """The recorded ego as the solution of its planning problem, by a single-track model."""
    tracks, row = scenario.tracks, scenario.ego_index
    seen = np.flatnonzero(tracks.valid[row])
    yaw_rates = _yaw_rates(scenario, seen)
    forward, lateral = (each[seen] for each in _in_own_frame(scenario, row))
    has_slip = np.abs(lateral) > _LATERAL
    slip = np.where(has_slip, np.arctan2(lateral, forward), 0.0)
    speed = np.where(has_slip, np.hypot(forward, lateral), forward)
    steering = np.arctan(_WHEELBASE * yaw_rates / np.where(np.abs(speed) > 0.1, speed, np.inf)).clip(-1.066, 1.066)
    lines = [
        '<?xml version="1.0" encoding="UTF-8"?>',
        f'<CommonRoadSolution benchmark_id="ST2:TR1:{benchmark}:2020a" date="1970-01-01T00:00:00">',
        f'<stTrajectory planningProblem="{number}">',
    ]
    for place, step in enumerate(seen.tolist()):
        x, y, _ = tracks.position[row, step].tolist()
        heading = tracks.heading[row, step]
        lines.append(_SOLVED % (x, y, steering[place], speed[place], heading, yaw_rates[place], slip[place], step))
    return "\n".join([*lines, "</stTrajectory>", "</CommonRoadSolution>\n"]).encode()


def _report(
    scenario: ScenarioDescription, rows: list[int], standing: list[int], has_solution: bool, losses: Losses
) -> None:
    """Count what the file does not hold of the tracks."""
    tracks, ego = scenario.tracks, scenario.ego_index
    others = [row for row in rows if row != ego]
    losses.leave_out("objects that are never seen", len(tracks) - len(rows))
    losses.leave_out("heights of objects", len(rows))
    losses.leave_out("heights of positions, as the format's maps are flat", int(scenario.has_z))
    steps = np.arange(scenario.num_timesteps) * scenario.dt
    late = float(np.abs(scenario.timestamps - steps).max())
    losses.approximate("times of timesteps, which are evenly spaced", int(late > 1e-3), late, "s")
    losses.leave_out("current timesteps, as planning begins with the first", int(scenario.current_timestep != 0))
    first = tracks.size[np.arange(len(tracks)), np.argmax(tracks.valid, axis=1)]
    changes = np.abs(np.where(tracks.valid[..., None], tracks.size - first[:, None], 0.0))[..., :2].max(axis=(1, 2))
    changes[ego] = 0.0
    losses.approximate("objects whose size changes", int((changes > 0.01).sum()), float(changes.max(initial=0.0)), "m")
    different = np.abs(first[ego, :2] - _EGO_SIZE).max()
    losses.approximate("sizes of egos, which are those of a BMW 320i", int(different > 0.01), float(different), "m")
    types = tracks.object_type[others]
    held = np.isin(types, list(MOVING)) | (types == ObjectType.OTHER)
    held |= np.isin(others, standing) & np.isin(types, list(STANDING))
    losses.leave_out("types of objects that CommonRoad does not have", int((~held).sum()))
    losses.leave_out("types of egos, which are vehicles", int(tracks.object_type[ego] != ObjectType.VEHICLE))
    losses.leave_out("objects of interest", len(scenario.objects_of_interest))
    losses.leave_out("tracks to predict", len(scenario.tracks_to_predict))
    is_late = not tracks.valid[ego, 0]
    losses.leave_out("times at which egos appear, as planning begins with the first timestep", int(is_late))
    if not has_solution:
        losses.leave_out("paths of egos", 1)
