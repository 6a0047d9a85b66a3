"""What pictures look like: where masts stand, and what sets the own vehicle and people apart."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import shapely

from scenarionet_data.scenario.vocabulary import ObjectType
from scenarionet_sim.cameras.draw import codes
from scenarionet_sim.cameras.draw.columns import NUM_POSE
from scenarionet_sim.cameras.draw.facades import BAYS, FIRST_U, FIRST_V, FOUNDATION, PER_U, PER_V, lay_out_wall
from scenarionet_sim.cameras.draw.structures import Item
from scenarionet_sim.cameras.surroundings import fixtures
from scenarionet_sim.cameras.terrain import Terrain
from scenarionet_sim.cameras.weather import NIGHT
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


def test_walls_have_whole_windows():
    box = np.array([30.0, -4.0, -FOUNDATION, 0.7, 17.3, 10.1, 13.0])
    turn = np.cos(box[3]), np.sin(box[3])
    item, pose = Item(-1, box, 0, turn, 0, 0, -1, (0.0, 0.0, 0.0), False, 1.0), np.zeros(NUM_POSE)
    pose[:3] = 2.0, 3.0, 1.5
    for normal, along, width in ((turn, (-turn[1], turn[0]), 10.1), ((turn[1], -turn[0]), turn, 17.3)):
        colors = np.zeros(12, np.float32)
        colors[9:11] = normal
        lay_out_wall.py_func(item, pose, 400.0, colors)
        for side in (-0.5, 0.5):
            away = box[:2] + side * width * np.array(along) - pose[:2]
            corner = colors[FIRST_U] + (normal[0] * away[1] - normal[1] * away[0]) * colors[PER_U]
            assert abs(corner - (0.5 + side) * colors[BAYS]) < 1e-4
        assert abs(width / colors[BAYS] - 3.2) < 1.0
        assert abs(colors[FIRST_V] - 1.5 * colors[PER_V]) < 1e-5  # storeys begin at the ground


def test_people_step_as_they_walk_and_stand_still_otherwise():
    def outline(drive):
        camera = replace(ABOVE, mount=Mount(0.0, -4.0, 1.0, yaw=np.pi / 2))
        return seen(camera, drive)["instance"] == 1

    for speed in (0.0, 1.4):
        walker = Other(0.0, 0.0, vx=speed, type=ObjectType.PEDESTRIAN)
        drive = simulate(make_drive(others=(walker,), speed=0.001), steps=0)
        drive.state.position[0, 0] = 0.0, 0.0
        drive.state.heading[0, 0] = 0.0
        first = outline(drive)
        drive.state.timestep[:] += 3
        assert first[120:].any()
        assert np.array_equal(outline(drive), first) == (speed == 0.0)


def test_headlights_light_the_ground_and_the_vehicle_ahead():
    def levels(camera, *present):
        drive.state.present[0] = present
        frame = seen(camera, drive)
        return frame["rgb"].astype(float).mean(axis=-1), frame["instance"]

    drive = simulate(make_drive(others=(Other(-40.0, 3.5, vx=8.0), Other(14.0, 0.0, vx=8.0))), steps=0)
    drive.state.object_type[0, 2] = 0  # has no lamps
    alone, _ = levels(replace(ABOVE, weather=NIGHT, mount=replace(ABOVE.mount, x=14.0)), True, False, False)
    ahead, beside = alone[60:140, 95:105].mean(), alone[60:140, 20:30].mean()
    assert ahead > 3.0 * beside
    front = Camera(128, 72, channels=("rgb", "instance"), weather=NIGHT, mount=Mount(-12.0, 0.0, 1.5))
    lit, instance = levels(front, True, False, True)
    drive.state.object_type[0, 0] = 0
    dark, _ = levels(front, True, False, True)
    is_ahead = instance == 2
    assert is_ahead.sum() > 30
    assert lit[is_ahead].mean() > 1.5 * dark[is_ahead].mean()
