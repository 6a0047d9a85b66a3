"""Moments of scenarios as tensors: lane vectors and vehicles around the ego."""

from __future__ import annotations

from scenarionet_data.samples.training import collate  # first: says how to install torch

# isort: split
import warnings
from dataclasses import dataclass
from typing import NamedTuple

import torch
from torch import Tensor

from scenarionet_data.errors import BadParameter
from scenarionet_data.generation.frames import HEADING, X, Y, relative
from scenarionet_data.learning.fitting import FitConfig
from scenarionet_data.query.lake_view import LakeView
from scenarionet_data.samples.choices import Agents, Polylines, Targets, TimeWindow
from scenarionet_data.samples.dataset import Sample, Samples
from scenarionet_data.samples.selection import SamplesWarning
from scenarionet_data.scenario.vocabulary import MapFeatureType, ObjectType

SPEED, LENGTH, WIDTH = range(3, 6)
"""Columns of vehicles after their pose; lane vectors have a pose and their length."""

LANES = (MapFeatureType.LANE_UNKNOWN, MapFeatureType.LANE_SURFACE_STREET, MapFeatureType.LANE_FREEWAY)
"""Map features on which vehicles are placed."""

_PIECES = 2048  # of all map features, of which lanes are kept
_LARGEST_OFFSET = 3.0  # between a vehicle and its lane vector, beyond the ends and to the side [m]


@dataclass(frozen=True)
class TrafficConfig(FitConfig):
    """What a moment shows, by which networks traffic is made, and how they are trained.

    Attributes:
        crop: Side of the square around the ego in which vehicles are placed [m].
        stride: Time between the moments of a scenario [s]: ten moments in 20 s.
        future, dt: Motion that is predicted at once, in timesteps [s].
        spacing: Length of a lane vector [m].
        lanes, vehicles: Largest numbers of a moment, nearest first.
        min_vehicles: Moments with fewer vehicles in the crop are left out.
        queries: Lane vectors of a moment that training looks at: those with vehicles, and some of the others.
        near_lanes, near_cars: Neighbours that a feature sees.
        components, modes: Of the mixtures of attributes; motions of a vehicle.
        noise: Standard deviation of start positions in training [m]; of headings a tenth [rad], of speeds once [m/s].
    """

    kind = "traffic model"
    command = "scenarionet traffic learn"
    clip = 5.0

    crop: float = 120.0
    stride: float = 2.0
    future: float = 1.9
    dt: float = 0.1
    spacing: float = 5.0
    lanes: int = 320
    vehicles: int = 40
    min_vehicles: int = 8
    queries: int = 96
    near_lanes: int = 12
    near_cars: int = 6
    components: int = 8
    modes: int = 6
    rate: float = 2e-3
    decay: float = 1e-3
    noise: float = 0.2

    def samples(self, lake: LakeView, scenarios: str | list[str], *, moments: bool = True) -> Samples:
        """Return the moments of scenarios, or only their own current timesteps, with as much of the map as there is."""
        window = TimeWindow(0.0, self.future, self.dt, stride=self.stride) if moments else TimeWindow(0.0, 0.0, self.dt)
        radius = 0.75 * self.crop if moments else 3.0 * self.crop
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", SamplesWarning)  # of scenarios that give none: the callers say it
            return Samples(
                lake,
                scenarios,
                window=window,
                agents=Agents(self.vehicles, radius, (ObjectType.VEHICLE,)),
                polylines=Polylines(_PIECES, points=2, spacing=self.spacing, radius=radius),
                targets=Targets("ego"),
                perspective="scene",
            )

    @property
    def num_future(self) -> int:
        """Timesteps of a predicted motion."""
        return round(self.future / self.dt)


class TrafficMoments(NamedTuple):
    """B moments, each in the frame of the ego then: metres, radians, seconds.

    Attributes:
        lanes: (B, L, 4) middle x, y, heading and length of lane vectors; ``lane_ok`` (B, L).
        cars: (B, A, 6) x, y, heading, speed, length, width; the ego first; ``car_ok`` (B, A).
        path: (B, A, F, 2) positions to come; ``path_ok`` (B, A, F).
        cell: (B, A) lane vector of each vehicle; -1 for none, or one beyond the crop.
    """

    lanes: Tensor
    lane_ok: Tensor
    cars: Tensor
    car_ok: Tensor
    path: Tensor
    path_ok: Tensor
    cell: Tensor

    def take(self, rows: Tensor) -> TrafficMoments:
        """The moments at ``rows``."""
        return TrafficMoments(*(values[rows] for values in self))


def make_scenes(sample: Sample, config: TrafficConfig) -> TrafficMoments:
    """Return the moments of a batch of samples, see :meth:`TrafficConfig.samples`."""
    batch = collate(sample)
    ends = batch["polylines"]
    is_lane = batch["polylines_valid"].all(dim=2) & torch.isin(batch["polyline_type"], torch.tensor(LANES))
    order = torch.argsort(~is_lane, dim=1, stable=True)[:, : config.lanes]
    step = ends[:, :, 1, :2] - ends[:, :, 0, :2]
    middle = ends[:, :, :, :2].mean(dim=2)
    lanes = torch.cat([middle, torch.atan2(step[..., 1:], step[..., :1]), step.norm(dim=-1, keepdim=True)], dim=-1)
    lanes = lanes.gather(1, order[..., None].expand(-1, -1, 4))
    lane_ok = is_lane.gather(1, order)
    x, y, heading, vx, vy = batch["history"][:, :, -1].unbind(dim=-1)
    speed = (vx * heading.cos() + vy * heading.sin()).clamp(min=0.0)
    cars = torch.stack([x, y, heading, speed, *batch["agent_size"][..., :2].unbind(dim=-1)], dim=-1)
    car_ok = batch["history_valid"][:, :, -1]
    cell = _cells(lanes, lane_ok & is_inside(lanes, config), cars, car_ok)
    return TrafficMoments(lanes, lane_ok, cars, car_ok, batch["future"][..., :2], batch["future_valid"], cell)


def is_inside(poses: Tensor, config: TrafficConfig) -> Tensor:
    """Whether poses (..., 2 or more) are in the crop."""
    return poses[..., :2].abs().amax(dim=-1) <= config.crop / 2


def _cells(lanes: Tensor, is_open: Tensor, cars: Tensor, car_ok: Tensor) -> Tensor:
    """(B, A) lane vector under each vehicle, of those in about its direction the nearest; -1 for none."""
    place = relative(lanes[:, None], cars[:, :, None])
    beyond = (place[..., X].abs() - lanes[:, None, :, 3] / 2).clamp(min=0.0)
    away = torch.hypot(beyond, place[..., Y])
    fits = (away <= _LARGEST_OFFSET) & (place[..., HEADING].abs() < torch.pi / 2) & is_open[:, None]
    cost = (away + 2.0 * place[..., HEADING].abs()).masked_fill(~fits, torch.inf)
    least, cell = cost.min(dim=2)
    return cell.masked_fill(~torch.isfinite(least) | ~car_ok, -1)


def read_moments(
    lake: LakeView, database: str, config: TrafficConfig, chunk: int = 128
) -> tuple[TrafficMoments, list[str]]:
    """Return all moments of a database that show enough vehicles, and the scenario of each.

    Raises:
        BadParameter: There is none.
    """
    samples = config.samples(lake, database)
    parts, ids = [], []
    for first in range(0, len(samples), chunk):
        numbers = range(first, min(first + chunk, len(samples)))
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", SamplesWarning)  # the ego is not there at every moment
            batch = samples.batch(numbers)
        scenes = make_scenes(batch, config)
        enough = (scenes.cell >= 0).sum(dim=1) >= config.min_vehicles
        rows = torch.nonzero(enough & torch.from_numpy(batch["has_centre"])).squeeze(1)
        parts.append(scenes.take(rows))
        ids += [samples.key(numbers[row]).scenario_id for row in rows.tolist()]
    if not ids:
        raise BadParameter(
            f"{database}: no moment of its scenarios shows {config.min_vehicles} vehicles on lanes within "
            f"{config.crop / 2:g} m of the ego ({len(samples)} moments with a map and {config.future:g} s to come); "
            "give another database, or a smaller min_vehicles",
        )
    return TrafficMoments(*(torch.cat(each) for each in zip(*parts, strict=True))), ids
