"""Pictures of drives for networks: the Intelligent Driver Model drives, a camera looks from beside its path.

Shared by the examples ``lane_pose`` and ``camera_driver``. The camera is moved to the side and turned at random, as in
Bojarski et al. (2016), *End to End Learning for Self-Driving Cars*: a network then sees places that the driver avoids,
with the way back from there.
"""

from __future__ import annotations

import scenarionet_data.samples.training  # noqa: F401 - first: says how to install torch

# isort: split
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, fields, replace

import numpy as np
import torch
from torch import Tensor, nn

from scenarionet_data import ScenarioLoader
from scenarionet_data.arrays.dtypes import Array, Float32, Float64, Int32
from scenarionet_sim import Camera, Idm, Mount, Replay, Simulation, World, ego
from scenarionet_sim.policies.objects import other_vehicles

CAMERA = Camera(width=84, height=48, fov=1.4, mount=Mount(x=1.2, z=1.5, pitch=-0.25), has_scenery=False)
"""Looks down: the lowest row shows the road 2 m ahead. Without scenery, which takes longer to place than to draw."""

AHEAD = 8.0
"""Distance along the path of the point that a driver steers to [m]."""

LARGEST_OFFSET, LARGEST_TURN = 1.5, 0.25
"""Places of the camera: uniformly to both sides of the path [m], and about its direction [rad]."""

_WORLDS, _LATER = 32, 10
"""Worlds that step together; steps (a second) after which the driver's speed is what it wants now."""


@dataclass(frozen=True, eq=False)
class DrivePictures:
    """N moments of drives.

    Attributes:
        views: (N, 2, height, width, 3) uint8, one timestep ago and now.
        offset: (N,) float32 distance of the camera's vehicle from the path, positive to its left [m].
        turn: (N,) float32 its heading relative to the path's, counter-clockwise [rad].
        side: (N,) float32 how far to its left the point of the path ``AHEAD`` is [m], or the path's end.
        speed, wanted: (N,) float32 the driver's speed now, and a second later [m/s].
        scenario: (N,) int32 number of the scenario.
    """

    views: Array
    offset: Float32
    turn: Float32
    side: Float32
    speed: Float32
    wanted: Float32
    scenario: Int32

    def __len__(self) -> int:
        return len(self.views)


def collect(loader: ScenarioLoader, numbers: Sequence[int], every: int, seed: int = 0) -> DrivePictures:
    """Drive scenarios with the Intelligent Driver Model and take pictures.

    Args:
        loader: Scenarios of a lake.
        numbers: Which of them.
        every: Steps between two moments of a scenario, at least 2.
        seed: Seed of the camera's places.
    """
    rng, parts = np.random.default_rng(seed), list[DrivePictures]()
    for first in range(0, len(numbers), _WORLDS):
        parts += _drive(loader, np.asarray(numbers[first : first + _WORLDS]), every, rng)
    joined = {part.name: np.concatenate([getattr(each, part.name) for each in parts]) for part in fields(DrivePictures)}
    return DrivePictures(**joined)


def _drive(loader: ScenarioLoader, numbers: Array, every: int, rng: np.random.Generator) -> Iterator[DrivePictures]:
    """Drive some scenarios side by side to their ends; yield the pictures of one step after another."""
    worlds = [World.from_scenario(loader[number]) for number in numbers.tolist()]
    simulation = Simulation(worlds, (Replay(), Idm(objects=other_vehicles), Idm(objects=ego)), has_passengers=True)
    slots, rows = simulation.agents.T
    ends = np.array([world.num_steps for world in worlds])
    speeds, waiting = list[Float64](), list[tuple[int, Array, DrivePictures]]()
    places, before = np.zeros((2, len(worlds))), np.empty((len(worlds), *CAMERA.shape), np.uint8)
    for step in range(ends.max()):  # each depends on the one before
        simulation.step()
        state, here = simulation.state, np.flatnonzero(simulation.state.present[slots, rows] & (step < ends))
        speeds.append(np.hypot(*state.velocity[slots, rows].T))
        if step % every == every - 2:
            places = rng.uniform(-1.0, 1.0, (2, len(worlds))) * [[LARGEST_OFFSET], [LARGEST_TURN]]
            before[here] = _look(simulation, here, places)
        if step % every == every - 1:
            views = np.stack([before[here], _look(simulation, here, places)], axis=1)
            sides = np.array([_side(simulation, slot, *places[:, slot]) for slot in here.tolist()])
            labels = np.stack([*places[:, here], sides, speeds[-1][here]]).astype(np.float32)
            offset, turn, side, speed = labels
            made = DrivePictures(views, offset, turn, side, speed, wanted=speed, scenario=numbers[here])
            waiting.append((step, here, made))
    simulation.close()
    for step, here, made in waiting:
        if step + _LATER < len(speeds):
            yield replace(made, wanted=speeds[step + _LATER][here].astype(np.float32))


def _look(simulation: Simulation, slots: Array, places: Float64) -> Array:
    """Return pictures (A, height, width, 3) from where the egos of some worlds would be at their places."""
    agents, state = simulation.agents[slots], replace(simulation.state, motion=simulation.state.motion.copy())
    of_agents, (offset, turn) = tuple(agents.T), places[:, slots]
    heading = state.heading[of_agents]
    state.position[of_agents] += offset[:, None] * np.stack([-np.sin(heading), np.cos(heading)], axis=1)
    state.heading[of_agents] += turn
    return CAMERA.frames(simulation.batch, state, agents)["rgb"]


def _side(simulation: Simulation, slot: int, offset: float, turn: float) -> float:
    """Return how far to the left of an ego, moved and turned, the point of its path ``AHEAD`` is [m]."""
    world, row = simulation.batch.worlds[slot], simulation.agents[slot, 1]
    path = world.paths.path[slice(*world.paths.path_offsets[row : row + 2])]
    arc = simulation.route[slot, row, 0] + AHEAD
    point = np.array([np.interp(arc, path[:, -1], path[:, axis]) for axis in range(2)])
    x, y = point - simulation.state.position[slot, row]
    heading = simulation.state.heading[slot, row]
    forward, left = np.cos(heading) * x + np.sin(heading) * y, np.cos(heading) * y - np.sin(heading) * x - offset
    return float(np.cos(turn) * left - np.sin(turn) * forward)


class PictureNetwork(nn.Module):
    """Three convolutions and two dense layers; knows the mean and deviation of what it estimates.

    Args:
        moments: Pictures that are seen together.
        targets: (N, K) what it will estimate.
    """

    def __init__(self, moments: int, targets: Tensor) -> None:
        super().__init__()
        self.register_buffer("mean", targets.mean(dim=0))
        self.register_buffer("deviation", targets.std(dim=0))
        self.layers = nn.Sequential(
            nn.Conv2d(3 * moments, 16, 5, 2), nn.ReLU(), nn.Conv2d(16, 32, 3, 2), nn.ReLU(),
            nn.Conv2d(32, 32, 3, 2), nn.ReLU(), nn.Flatten(), nn.LazyLinear(128), nn.ReLU(),
            nn.Linear(128, targets.shape[1]),
        )  # fmt: skip

    def forward(self, views: Tensor) -> Tensor:
        """Return estimates (B, K) for pictures (B, moments, height, width, 3) of bytes."""
        seen = views.permute(0, 1, 4, 2, 3).flatten(1, 2).float() / 255.0 - 0.5
        found: Tensor = self.layers(seen) * self.deviation + self.mean
        return found


def fit(views: Array, targets: Float32, passes: int, seed: int = 0) -> PictureNetwork:
    """Return a network that estimates targets (N, K) from pictures (N, moments, height, width, 3).

    Adam with minibatches of 64 and a rate that falls to 0 along a cosine.
    """
    torch.manual_seed(seed)
    seen, wanted = torch.from_numpy(np.ascontiguousarray(views)), torch.from_numpy(targets)
    network = PictureNetwork(views.shape[1], wanted)
    network(seen[:1])  # makes the lazy layer
    order = [rows for _ in range(passes) for rows in torch.randperm(len(seen)).split(64)]
    adam = torch.optim.Adam(network.parameters(), 1e-3, fused=True)
    falling = torch.optim.lr_scheduler.CosineAnnealingLR(adam, len(order))
    for rows in order:
        loss = ((network(seen[rows]) - wanted[rows]) / network.deviation).square().mean()
        adam.zero_grad()
        loss.backward()
        adam.step()
        falling.step()
    network.eval()
    return network
