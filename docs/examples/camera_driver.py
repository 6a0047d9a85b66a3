"""A driver on a camera alone, cloned from drives of the Intelligent Driver Model; beside a blind driver and the model.

    python docs/examples/camera_driver.py lake train val

The network sees two consecutive pictures and estimates where the model's path lies, its own speed, and the speed that
the model has a second later; steering and throttle follow from these. The blind driver does the same with the training
means. All three drive the scenarios of the second database, which are not trained on, among traffic that reacts.
"""

from __future__ import annotations

from driving_pictures import (  # first: says how to install torch
    AHEAD,
    CAMERA,
    DrivePictures,
    PictureNetwork,
    collect,
    fit,
)

# isort: split
from time import process_time

import click
import numpy as np
import torch
from idm_ego import evaluate

from scenarionet_data import Lake, ScenarioLoader
from scenarionet_data.arrays.dtypes import Array, Float32
from scenarionet_sim import EgoState, External, Idm, Replay, Scenarios, VectorConfig
from scenarionet_sim.backends.base import Drive
from scenarionet_sim.learning.testing import ActionMode, drive_each
from scenarionet_sim.policies.objects import other_vehicles
from scenarionet_sim.sensors.base import Sensor
from scenarionet_sim.worlds.world import STEP

_CAR = Drive()
_WHEELBASE = _CAR.wheelbase * 4.5
"""Of a car of usual length [m]."""

_STOPPING = 14
"""Steps in which full brakes stop a car at 11 m/s."""


def plan(pictures: DrivePictures) -> Float32:
    """Return what the driver estimates (N, 3): side of the path's point [m], speed and wanted speed [m/s]."""
    return np.stack([pictures.side, pictures.speed, pictures.wanted], axis=1)


def controls(plans: Float32) -> Float32:
    """Return steering and throttle (B, 2) for plans (B, 3): pure pursuit, and the speed wanted in a second."""
    side, speed, wanted = plans.T
    angle = np.arctan(2.0 * _WHEELBASE * side / (AHEAD**2 + side**2))
    push = wanted - speed
    throttle = push / np.where(push > 0.0, _CAR.acceleration, _CAR.braking)
    found: Float32 = np.stack([angle / _CAR.max_steer, throttle], axis=1).clip(-1.0, 1.0).astype(np.float32)
    return found


class CameraDriver:
    """Drives worlds by the pictures of one timestep ago and now, from the beginning of their episodes.

    Pictures of this size show little of one's own speed. It stops first, so that its speed is known, and counts from
    then on what its pedals do: odometry with an update at zero velocity.

    Args:
        network: Estimates plans from two pictures.
    """

    def __init__(self, network: PictureNetwork) -> None:
        self._network, self._steps = network, 0
        self._before: Array = np.zeros((0, 0), np.uint8)
        self._speed: Float32 = np.zeros(0, np.float32)

    def __call__(self, observations: Float32) -> Float32:
        """Return steering and throttle (B, 2) for flat pictures (B, height * width * 3)."""
        now: Array = observations.astype(np.uint8)
        before = self._before if self._steps else now
        views = np.stack([before, now], axis=1).reshape(len(now), 2, *CAMERA.shape)
        with torch.no_grad():
            side, speed, wanted = self._network(torch.from_numpy(views)).numpy().T
        is_stopping = self._steps < _STOPPING
        speed = speed if is_stopping else self._speed
        found = controls(np.stack([side, speed, 0.0 * wanted if is_stopping else wanted], axis=1))
        push = found[:, 1] * np.where(found[:, 1] > 0.0, _CAR.acceleration, _CAR.braking)
        self._speed = np.zeros_like(speed) if is_stopping else np.maximum(speed + STEP * push, 0.0, dtype=np.float32)
        self._before, self._steps = now, self._steps + 1
        return found


def success_rate(mode: ActionMode, lake: Lake, database: str, sensor: Sensor = CAMERA) -> float:
    """Return the share of scenarios in which a driver arrives, each in a world of its own, among reacting traffic."""
    policies, worlds = (Replay(), Idm(objects=other_vehicles), External()), len(lake.database(database).scenario_ids)
    config = VectorConfig(Scenarios(lake, database), policies=policies, sensors=(sensor,), cache_size=worlds)
    return float(drive_each(config, mode, worlds).take()["success"])


@click.command(help=__doc__)
@click.argument("lake")
@click.argument("train")
@click.argument("test")
@click.option("--passes", default=15, show_default=True, help="Passes over the pictures.")
@click.option("--every", default=12, show_default=True, help="Steps between two moments of a scenario.")
@click.option("--seed", default=0, show_default=True)
def main(lake: str, train: str, test: str, passes: int, every: int, seed: int) -> None:
    """Train, and print how often each driver arrives."""
    torch.set_num_threads(1)
    began, opened = process_time(), Lake(lake)
    loader = ScenarioLoader(opened, opened.database(train))
    seen = collect(loader, range(len(loader)), every, seed)
    network = fit(seen.views, plan(seen), passes, seed)
    click.echo(f"{len(seen):,} moments of {len(loader)} scenarios, {process_time() - began:.0f} s")
    blind = controls(network.mean.numpy()[None])
    click.echo(f"camera {success_rate(CameraDriver(network), opened, test):.0%}")
    rate = success_rate(lambda rows: blind.repeat(len(rows), axis=0), opened, test, EgoState())
    click.echo(f"blind  {rate:.0%}")
    idm = evaluate(Scenarios(opened, test))
    click.echo(f"IDM    {idm['success'] / idm['episodes']:.0%}, {process_time() - began:.0f} s in all")


if __name__ == "__main__":
    main()
