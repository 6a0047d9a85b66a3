"""What pictures look like: where masts stand, and what sets the own vehicle and people apart."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import shapely

from scenarionet_data.scenario.vocabulary import ObjectType
from scenarionet_sim.cameras.draw import codes
from scenarionet_sim.cameras.surroundings import fixtures
from scenarionet_sim.cameras.terrain import Terrain
from scenarionet_sim.sensors.camera import Camera, Mount
from scenarionet_sim.worlds.world import World
from tests.fixtures.drives import Other, make_drive
from tests.fixtures.simulations import simulate

ABOVE = Camera(200, 200, fov=1.2, mount=Mount(0.0, 0.0, 30.0, pitch=-np.pi / 2), channels=("rgb", "instance"),
               own="outside", has_scenery=False)  # fmt: skip


def seen(camera, drive):
    return {name: values[0] for name, values in camera.frames(drive.batch, drive.state, drive.agents[:1]).items()}


def test_masts_stand_beside_the_road_and_away_from_people():
    walker = Other(20.0, -3.0, vx=0.1, type=ObjectType.PEDESTRIAN)
    world = World.from_scenario(make_drive(red=True, others=(walker,)))
    terrain = Terrain.of(world.roads, has_sidewalks=True)
    places, kinds = fixtures(world, terrain, 0, has_scenery=False)
    feet = places[(kinds[:, 0] == codes.POLE)][:, :2].astype(float)
    assert len(feet) == 1
    assert terrain.road.distance(shapely.points(feet[0])) > 0.3
    assert np.hypot(*(world.log_position[world.log_valid].astype(float) - feet[0]).T).min() > 1.2


def test_only_the_own_vehicle_is_orange():
    places = [(x, y) for y in (-12.0, -8.0, -4.0, 4.0, 8.0, 12.0) for x in (-12.0, -6.0, 0.0, 6.0, 12.0)]
    frame = seen(ABOVE, simulate(make_drive(others=tuple(Other(*place, vx=10.0) for place in places)), steps=0))
    rgb = frame["rgb"].astype(int)
    for row in range(len(places) + 1):
        red, green, blue = np.percentile(rgb[frame["instance"] == row], 75, axis=0)
        is_orange = red > green + 25 and green > blue + 40
        assert is_orange == (row == 0), (row, red, green, blue)


def test_shadows_of_people_are_small_and_soft():
    walker = Other(0.0, 6.0, vx=0.01, type=ObjectType.PEDESTRIAN)
    drive = simulate(make_drive(others=(walker,), speed=0.01), steps=0)
    drive.state.size[0, 1] = 1.0, 1.0, 1.7
    dull = replace(ABOVE.weather, clouds=1.0)
    camera = replace(ABOVE, mount=replace(ABOVE.mount, y=6.0), fov=0.1, weather=dull)
    lit = seen(camera, drive)
    drive.state.present[0, 1] = False
    share = lit["rgb"].mean(axis=-1) / seen(camera, drive)["rgb"].mean(axis=-1)
    is_ground = lit["instance"] == -1
    assert (share[is_ground] < 0.95).any()
    per_pixel = ABOVE.mount.z / camera.matrix[0]
    dark = np.argwhere((share < 0.97) & is_ground) - 99.5
    assert np.hypot(*dark.T).max() * per_pixel < 0.65  # not the tile of 1 m with its corners at 0.7 m
    steps = np.abs(np.diff(share, axis=1))[is_ground[:, 1:] & is_ground[:, :-1]]
    assert steps.max() < 0.12
