"""Make the pictures of cameras in the documentation: ``python docs/make_camera_pictures.py``.

All scenes are generated; pictures are written to ``docs/pictures``.
"""

from __future__ import annotations

import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
from PIL import Image

from scenarionet_data import converters
from scenarionet_data.arrays.dtypes import UInt8
from scenarionet_data.building import MapBuilder, make_tracks
from scenarionet_data.scenario.description import ScenarioDescription
from scenarionet_data.scenario.vocabulary import MapFeatureType, ObjectType
from scenarionet_sim.cameras.classes import class_colors
from scenarionet_sim.cameras.weather import DAY, DUSK, OVERCAST, RAIN, Weather
from scenarionet_sim.policies.replay import Replay
from scenarionet_sim.sensors.camera import Camera, Mount
from scenarionet_sim.sensors.camera_presets import CHASE, COCKPIT, camera_ring
from scenarionet_sim.simulation.simulation import Simulation
from scenarionet_sim.worlds.world import World

FOLDER = Path(__file__).parent / "pictures"
WIDTH, HEIGHT = 960, 540


def generated(seed: int, **options: object) -> ScenarioDescription:
    """Return a scenario of the generator."""
    converter = converters.get("pg")
    chosen = converter.Options(**options)
    (shard,) = converter.shards(f"{seed}:{seed + 1}", "train", converter.release, chosen)
    scenario: ScenarioDescription = converter.scenario(shard, seed)
    return scenario


def crossing() -> ScenarioDescription:
    """Return a street with a crosswalk, pedestrians on it, cyclists and waiting cars."""
    base = generated(1, blocks="straight=1", min_lanes=1, max_lanes=1, construction=0.0, density=0.0)
    builder = MapBuilder()
    kind = MapFeatureType
    for y, way in ((0.0, 1), (3.6, -1)):
        builder.add(
            f"lane{y}", kind.LANE_SURFACE_STREET, polyline=[[-60.0 * way, y], [120.0 * way, y]], width=(1.8, 1.8)
        )
    builder.add("middle", kind.ROAD_LINE_SOLID_DOUBLE_YELLOW, polyline=[[-60.0, 1.8], [13.0, 1.8]])
    builder.add("middle2", kind.ROAD_LINE_BROKEN_SINGLE_YELLOW, polyline=[[19.5, 1.8], [120.0, 1.8]])
    builder.add("stop", kind.STOP_LINE, polyline=[[12.2, -1.7], [12.2, 1.7]])
    builder.add("stop2", kind.STOP_LINE, polyline=[[20.3, 1.9], [20.3, 5.3]])
    builder.add("walk", kind.CROSSWALK, polygon=[[13.6, -1.8], [18.0, -1.8], [18.0, 5.4], [13.6, 5.4]])
    vehicle, walker, cyclist = ObjectType.VEHICLE, ObjectType.PEDESTRIAN, ObjectType.CYCLIST
    objects = [
        (vehicle, 0.0, 0.0, 0.0, (4.7, 1.9, 1.5)), (vehicle, 25.5, 3.6, np.pi, (4.6, 1.9, 1.55)),
        (vehicle, 33.0, 3.6, np.pi, (5.6, 2.0, 2.1)), (vehicle, 46.0, 0.0, 0.0, (4.5, 1.85, 1.5)),
        (vehicle, 60.0, 3.6, np.pi, (12.0, 2.5, 3.2)), (walker, 15.3, 1.2, np.pi / 2, (0.6, 0.6, 1.75)),
        (walker, 16.6, 3.4, np.pi / 2, (0.6, 0.6, 1.62)), (walker, 15.8, -2.9, np.pi / 2, (0.6, 0.6, 1.8)),
        (walker, 14.9, 6.4, -np.pi / 2, (0.6, 0.6, 1.7)), (walker, 14.4, -0.5, np.pi / 2, (0.5, 0.5, 1.25)),
        (cyclist, 22.0, -1.1, 0.0, (1.8, 0.6, 1.75)), (walker, 27.0, -3.3, 0.0, (0.6, 0.6, 1.75)),
    ]  # fmt: skip
    steps = base.num_timesteps
    position = np.array([[(x, y, 0.0)] * steps for _, x, y, _, _ in objects])
    tracks = make_tracks(
        [f"t{row}" for row in range(len(objects))],
        [thing for thing, *_ in objects],
        position,
        np.array([[heading] * steps for *_, heading, _ in objects]),
        np.zeros((len(objects), steps, 2)),
        np.array([size for *_, size in objects]),
        np.ones((len(objects), steps), np.bool_),
        origin=np.zeros(3),
    )
    made = builder.build(np.zeros(3), has_z=False)
    lights = type(base.lights).empty(steps)
    return replace(base, tracks=tracks, ego_id="t0", map=made, lights=lights, origin=np.zeros(3))


def seen(scenario: ScenarioDescription, step: int, camera: Camera) -> dict[str, UInt8]:
    """Return what the ego's camera sees at a timestep."""
    simulation = Simulation([World.from_scenario(scenario)], (Replay(),))
    simulation.reset(0, start=0)
    for _ in range(step):
        simulation.step()
    agents = np.array([[0, simulation.batch.ego[0]]], np.int32)
    frames = camera.frames(simulation.batch, simulation.state, agents)
    return {name: values[0] for name, values in frames.items()}


def view(mount: Mount, weather: Weather, **settings: object) -> Camera:
    """Return a camera of the size of the gallery's pictures."""
    own = "outside" if mount.x < -1 else "inside" if mount == COCKPIT else "hidden"
    plain: dict[str, object] = {"fov": 1.2, "supersampling": 2, "vignette": 0.15, "own": own}
    return Camera(WIDTH, HEIGHT, mount=mount, weather=weather, **(plain | settings))  # type: ignore[arg-type]


def ring(scenario: ScenarioDescription, step: int) -> UInt8:
    """Return the pictures of six cameras around the ego in two rows, with the classes of the front below."""
    small = Camera(width=320, height=180, supersampling=2, weather=DAY)
    pictures = [seen(scenario, step, camera)["rgb"] for camera in camera_ring(small)]
    front, right, left, back, back_left, back_right = pictures
    classes = [
        class_colors(seen(scenario, step, replace(camera, channels=("semantic",)))["semantic"])
        for camera in (camera_ring(small)[place] for place in (2, 0, 1))
    ]
    rows = [[left, front, right], [back_left, back, back_right], classes]
    return np.concatenate([np.concatenate(row, axis=1) for row in rows])


def pictures() -> dict[str, UInt8]:
    """Return all pictures by name."""
    driver = Mount(x=0.5, z=1.5, pitch=-0.03)
    street = generated(3)
    lights = generated(
        16, blocks="intersection=1", lights=1.0, num_blocks=1, max_lanes=2, construction=0.0, density=1.0
    )
    roundabout = generated(4, blocks="roundabout=1", num_blocks=1, construction=0.0, density=3.0)
    highway = generated(
        7, blocks="straight=1 curve=1", min_lanes=3, max_lanes=4, density=2.5, oncoming=2.0, construction=0.0
    )
    works = generated(5, blocks="straight=1", construction=1.0, min_lanes=2, density=1.0)
    return {
        "camera_day": seen(street, 20, view(Mount(), DAY))["rgb"],
        "camera_dusk": seen(highway, 60, view(Mount(x=-9.5, z=3.6, pitch=-0.16), DUSK))["rgb"],
        "camera_rain": seen(street, 45, view(driver, RAIN))["rgb"],
        "camera_junction": seen(lights, 36, view(Mount(), OVERCAST))["rgb"],
        "camera_crosswalk": seen(crossing(), 0, view(Mount(), DAY))["rgb"],
        "camera_construction": seen(works, 74, view(CHASE, DAY))["rgb"],
        "camera_roundabout": seen(roundabout, 60, view(Mount(x=-6.0, z=17.0, pitch=-0.42), DAY, fov=1.35))["rgb"],
        "camera_highway": seen(highway, 30, view(Mount(), DAY))["rgb"],
        "camera_cockpit": seen(lights, 40, view(COCKPIT, DAY, fov=1.4))["rgb"],
        "camera_ring": ring(street, 20),
    }


if __name__ == "__main__":
    target = Path(sys.argv[1]) if len(sys.argv) > 1 else FOLDER
    for name, picture in pictures().items():
        Image.fromarray(picture).save(target / f"{name}.webp", quality=82, method=6)
