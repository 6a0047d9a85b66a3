"""Cameras against analytic planes, boxes, outlines and motions."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from scenarionet_data.building import MapBuilder
from scenarionet_data.errors import BadParameter
from scenarionet_data.scenario.vocabulary import MapFeatureType
from scenarionet_sim.cameras.classes import CITYSCAPES, CLASS_COLORS, METADRIVE, SemanticClass
from scenarionet_sim.cameras.draw.lens import project
from scenarionet_sim.cameras.drawing import scaled_down
from scenarionet_sim.cameras.formats import to_nv12
from scenarionet_sim.cameras.lenses import lens_of, rays_of
from scenarionet_sim.cameras.terrain import Terrain
from scenarionet_sim.roads.heights import Heights
from scenarionet_sim.sensors.camera import Camera, Mount
from scenarionet_sim.sensors.camera_presets import camera_ring
from tests.fixtures.drives import Other, make_drive
from tests.fixtures.simulations import simulate
from tests.scenarionet_sim.sensors.conformance import SensorConformance, simulation  # noqa: F401

BARE = Camera(width=96, height=64, fov=1.3, mount=Mount(1.0, 0.2, 1.6, 0.15, -0.12, 0.05), has_scenery=False,
              are_boxes=True, channels=("depth", "semantic", "instance", "normals", "flow"))  # fmt: skip


class TestCamera(SensorConformance):
    sensor = Camera(width=32, height=20, noise=2.0)


@pytest.fixture(scope="module")
def drive():
    """The ego and four boxes around it, all at different velocities."""
    others = (Other(14.0, 1.0, vx=6.0), Other(22.0, -3.0, vx=3.0, vy=1.0), Other(9.0, 4.5, vx=8.0), Other(-9.0, 0.5))
    return simulate(make_drive(speed=8.0, others=others), steps=3)


def seen(camera, drive, row=0):
    frames = camera.frames(drive.batch, drive.state, np.array([[0, row]], np.int32))
    return {name: values[0] for name, values in frames.items()}


def rays(camera, drive, row=0):
    """Eye (3,) and directions (H, W, 3) in the scenario's frame, whose length along the optical axis is 1."""
    mount, state = camera.mount, drive.state
    heading = state.heading[0, row]
    cos, sin = np.cos(heading), np.sin(heading)
    eye = np.array([*state.position[0, row] + [cos * mount.x - sin * mount.y, sin * mount.x + cos * mount.y], mount.z])
    yaw, pitch = heading + mount.yaw, mount.pitch
    ahead = np.array([np.cos(pitch) * np.cos(yaw), np.cos(pitch) * np.sin(yaw), np.sin(pitch)])
    level = np.array([np.sin(yaw), -np.cos(yaw), 0.0])
    below = np.cross(ahead, level)
    right = np.cos(mount.roll) * level + np.sin(mount.roll) * below
    down = np.cos(mount.roll) * below - np.sin(mount.roll) * level
    fx, fy, cx, cy = camera.matrix
    u = (np.arange(camera.width) + 0.5 - cx) / fx
    v = (np.arange(camera.height) + 0.5 - cy) / fy
    return eye, u[None, :, None] * right + v[:, None, None] * down + ahead, (right, down, ahead)


def oracle(camera, drive, row=0):
    """Depth and instance by slabs in three dimensions and the plane of the ground."""
    eye, way, _ = rays(camera, drive, row)
    with np.errstate(divide="ignore"):
        best = np.where(way[..., 2] < 0, -eye[2] / way[..., 2], np.inf)
    best[best * np.linalg.norm(way, axis=-1) > camera.range] = np.inf
    instance = np.full(best.shape, -1)
    state = drive.state
    for n in np.flatnonzero(state.present[0]):
        if n == row:
            continue
        cos, sin = np.cos(state.heading[0, n]), np.sin(state.heading[0, n])
        turn = np.array([[cos, sin, 0], [-sin, cos, 0], [0, 0, 1]])
        half = state.size[0, n] / 2
        start, along = turn @ (eye - [*state.position[0, n], half[2]]), way @ turn.T
        with np.errstate(divide="ignore", invalid="ignore"):
            first, second = (-half - start) / along, (half - start) / along
        enter, leave = np.minimum(first, second).max(axis=-1), np.maximum(first, second).min(axis=-1)
        hit = (enter <= leave) & (enter > 0) & (enter < best)
        best[hit], instance[hit] = enter[hit], n
    best[np.isinf(best)] = camera.range
    return best, instance


def test_depth_and_instances_match_boxes_and_plane(drive):
    found = seen(BARE, drive)
    depth, instance = oracle(BARE, drive)
    same = found["instance"] == instance
    assert len(np.unique(instance)) >= 4
    assert (~same).mean() < 2e-3  # rays through an edge
    np.testing.assert_allclose(found["depth"][same], depth[same], atol=1e-3)


def test_flow_is_the_projected_motion(drive):
    found, state = seen(BARE, drive), drive.state
    eye, way, axes = rays(BARE, drive)
    depth, instance = oracle(BARE, drive)
    dt, me = BARE.flow_time, state.motion[0, 0]

    def turned(vectors, angle):
        cos, sin = np.cos(angle), np.sin(angle)
        return vectors @ np.array([[cos, sin, 0], [-sin, cos, 0], [0, 0, 1]])

    points = eye + depth[..., None] * way
    for n in np.unique(instance[instance >= 0]):
        body, here = state.motion[0, n], instance == n
        middle = np.array([body[0], body[1], 0.0])
        points[here] = middle + turned(points[here] - middle, body[6] * dt) + [body[4] * dt, body[5] * dt, 0.0]
    pivot, move = np.array([me[0], me[1], 0.0]), np.array([me[4], me[5], 0.0]) * dt
    later = pivot + move + turned(eye - pivot, me[6] * dt)
    x, y, z = np.moveaxis((points - later) @ turned(np.array(axes), me[6] * dt).T, -1, 0)
    fx, fy, cx, cy = BARE.matrix
    expected = np.stack([fx * x / z + cx, fy * y / z + cy], axis=-1)
    expected -= np.stack(np.meshgrid(np.arange(BARE.width) + 0.5, np.arange(BARE.height) + 0.5), axis=-1)
    is_near = (found["instance"] == instance) & (depth < 200)
    assert np.abs(expected[is_near]).max() > 1
    np.testing.assert_allclose(found["flow"][is_near], expected[is_near], atol=0.02)


def test_edges_of_road_are_those_of_the_map(drive):
    """The road of this drive is the strip -1.75 < y < 5.25, with sidewalks of 2.4 m."""
    semantic = seen(BARE, drive)["semantic"]
    eye, way, _ = rays(BARE, drive)
    with np.errstate(divide="ignore", invalid="ignore"):
        distance = np.where(way[..., 2] < 0, -eye[2] / way[..., 2], np.nan)
    y = eye[1] + distance * way[..., 1]
    step = np.abs(np.gradient(y, axis=0)) + np.abs(np.gradient(y, axis=1))
    near = (distance < 40) & ~np.isin(semantic, [SemanticClass.CAR, SemanticClass.SKY])
    inside = np.minimum(y + 1.75, 5.25 - y)
    road = near & (inside > step)
    walk = near & (inside < -step - 0.16) & (inside > step - 2.4)
    grass = near & (inside < -step - 2.4)
    assert min(road.sum(), walk.sum(), grass.sum()) > 20
    assert set(np.unique(semantic[road])) == {SemanticClass.ROAD}
    assert set(np.unique(semantic[walk])) == {SemanticClass.SIDEWALK}
    assert set(np.unique(semantic[grass])) == {SemanticClass.TERRAIN}


def test_normals_are_unit_vectors_of_faces(drive):
    found = seen(BARE, drive)
    ground = found["semantic"] == SemanticClass.ROAD
    np.testing.assert_allclose(found["normals"][ground], [[0, 0, 1]] * ground.sum(), atol=1e-6)
    car = found["instance"] == 1
    ahead = -np.array([np.cos(drive.state.heading[0, 1]), np.sin(drive.state.heading[0, 1]), 0])
    assert (np.abs(found["normals"][car] - ahead).max(axis=1) < 1e-5).any()
    assert (found["normals"][found["semantic"] == SemanticClass.SKY] == 0).all()


@pytest.mark.parametrize("lens", ["pinhole", "fisheye"])
def test_pictures_do_not_depend_on_threads(simulation, lens):  # noqa: F811
    camera = Camera(width=64, height=48, fov=1.5, lens=lens, channels=("rgb", "depth", "instance"))
    first, second = (
        replace(camera, threads=threads).frames(simulation.batch, simulation.state, simulation.agents[:7])
        for threads in (1, 3)
    )
    for name, values in first.items():
        np.testing.assert_array_equal(values, second[name])


@pytest.mark.parametrize(
    ("kind", "k"),
    [("pinhole", (-0.2, 0.05, 0.001, -0.002, 0.01)), ("fisheye", (0.05, -0.01, 0.002, 0.0)), ("fisheye", ())],
)
def test_rays_are_the_inverse_of_the_projection(kind, k):
    lens = lens_of(kind, (60.0, 62.0, 40.0, 30.0), k)
    table = rays_of(tuple(lens.tolist()), 80, 60)
    plain = getattr(project, "py_func", project)
    if hasattr(plain, "__globals__"):
        found = np.array([[plain(lens, *table[row, column]) for column in range(0, 80, 9)] for row in range(0, 60, 7)])
    columns, rows = np.meshgrid(np.arange(0, 80, 9) + 0.5, np.arange(0, 60, 7) + 0.5)
    np.testing.assert_allclose(found, np.stack([columns, rows], axis=-1), atol=1e-6)


def test_fisheye_and_distortion_agree_with_the_pinhole_on_distance(drive):
    """The distance of a point does not depend on the lens: compare where their rays are the same."""
    wide = replace(BARE, lens="fisheye", fov=2.6, channels=("depth", "instance"))
    found = seen(wide, drive)
    table = rays_of(tuple(lens_of("fisheye", wide.matrix, ()).tolist()), wide.width, wide.height)
    eye, _, axes = rays(BARE, drive)
    way = table @ np.array(axes)
    with np.errstate(divide="ignore"):
        ground = np.where(way[..., 2] < 0, -eye[2] / way[..., 2], wide.range)
    on_ground = (found["instance"] < 0) & (ground < wide.range)
    assert on_ground.sum() > 500
    np.testing.assert_allclose(found["depth"][on_ground], ground[on_ground], atol=1e-3)
    assert (found["instance"] >= 0).sum() > 20


def test_channels_share_one_observation(drive):
    camera = replace(BARE, channels=("rgb", "semantic"))
    assert camera.space().dtype == np.uint8
    assert camera.shape == (64, 96, 4)
    both = replace(BARE, channels=("rgb", "depth", "instance"))
    out = both.observe(drive.batch, drive.state, np.array([[0, 0]], np.int32), np.random.default_rng(0), both.empty(1))
    frames = both.frames(drive.batch, drive.state, np.array([[0, 0]], np.int32))
    for name, view in both.split(out).items():
        np.testing.assert_array_equal(view.squeeze(-1) if view.shape[-1] == 1 else view, frames[name])


def test_classes_are_complete():
    for table in (CITYSCAPES, CLASS_COLORS, METADRIVE):
        assert set(table) == set(SemanticClass)


def from_nv12(picture):
    """Convert NV12 (..., 3 H / 2, W) to pictures (..., H, W, 3)."""
    rows, width = picture.shape[-2:]
    height = rows * 2 // 3
    luma = (picture[..., :height, :].astype(np.float32) - 16) * 255 / 219
    chroma = picture[..., height:, :].reshape(*picture.shape[:-2], height // 2, width // 2, 2).astype(np.float32) - 128
    u, v = (chroma[..., k].repeat(2, axis=-2).repeat(2, axis=-1) * 255 / 224 for k in (0, 1))
    rgb = np.stack([luma + 1.402 * v, luma - 0.344136 * u - 0.714136 * v, luma + 1.772 * u], axis=-1)
    return np.clip(np.rint(rgb), 0, 255).astype(np.uint8)


def test_nv12_round_trip():
    smooth = np.linspace(30, 220, 24).astype(np.uint8)
    rgb = np.stack(np.broadcast_arrays(smooth[:16, None], smooth[None], np.uint8(90)), axis=-1)[None]
    coded = to_nv12(rgb)
    assert coded.shape == (1, 24, 24)
    assert np.abs(from_nv12(coded).astype(int) - rgb).mean() < 4
    with pytest.raises(BadParameter, match="even"):
        to_nv12(rgb[:, :15])


@pytest.mark.parametrize(
    "wrong",
    [{"width": 0}, {"fov": 4.0}, {"channels": ("heat",)}, {"channels": ()}, {"lens": "mirror"}, {"supersampling": 0},
     {"intrinsics": (0.0, 1.0, 2.0, 2.0)}, {"noise": -1.0}],
)  # fmt: skip
def test_bad_cameras_are_refused(wrong):
    with pytest.raises(BadParameter):
        Camera(**wrong)


def test_camera_inside_a_box_sees_through_it(drive):
    """The faces of a box are not seen from behind."""
    ahead, heading = drive.state.motion[0, 1], drive.state.heading[0, 0]
    away = ahead[:2] - drive.state.position[0, 0]
    cos, sin = np.cos(heading), np.sin(heading)
    mount = Mount(cos * away[0] + sin * away[1], cos * away[1] - sin * away[0], 0.5)
    found = seen(replace(BARE, mount=mount, channels=("rgb", "depth", "instance", "semantic")), drive)
    np.testing.assert_allclose(rays(replace(BARE, mount=mount), drive)[0][:2], ahead[:2], atol=1e-6)
    assert 1 not in found["instance"]
    below = found["semantic"] == SemanticClass.ROAD
    assert below.any()
    assert found["depth"][below].min() < 3.0
    assert found["rgb"].std() > 5


def test_edges_of_a_curved_road_are_those_of_the_map():
    """Half a ring around (0, 22), from 20 to 24 m: classes are right farther than a pixel from its outline."""
    turn = np.linspace(-np.pi / 2, np.pi / 2, 721)
    circle = np.stack([np.cos(turn), np.sin(turn)], axis=1)
    middle = np.array([0.0, 22.0])
    outline = np.concatenate([24 * circle, 20 * circle[::-1]]) + middle
    builder = MapBuilder()
    builder.add("bend", MapFeatureType.LANE_SURFACE_STREET, polyline=22 * circle + middle, polygon=outline)
    curved = simulate(replace(make_drive(speed=1.0), map=builder.build(np.zeros(3), has_z=False)), steps=1)
    camera = replace(BARE, width=160, height=120, has_sidewalks=False, mount=Mount(1.0, 0.2, 1.6, 0.3, -0.2, 0.05))
    semantic = seen(camera, curved)["semantic"]
    eye, way, _ = rays(camera, curved)
    with np.errstate(divide="ignore", invalid="ignore"):
        distance = np.where(way[..., 2] < 0, -eye[2] / way[..., 2], np.nan)
    point = eye + distance[..., None] * way
    radius = np.hypot(point[..., 0], point[..., 1] - 22.0)
    step = np.abs(np.gradient(radius, axis=0)) + np.abs(np.gradient(radius, axis=1)) + 2e-3
    border = np.minimum(np.abs(radius - 20), np.abs(radius - 24))
    clear = (distance < 60) & (border > step) & (point[..., 0] > 1.0)
    on_road = clear & (radius > 20) & (radius < 24)
    assert min(on_road.sum(), (clear & ~on_road).sum()) > 300
    assert set(np.unique(semantic[on_road])) == {SemanticClass.ROAD}
    assert set(np.unique(semantic[clear & ~on_road])) == {SemanticClass.TERRAIN}


def test_ring_covers_all_directions(drive):
    ring = camera_ring(Camera(width=16, height=9, channels=("instance",), has_scenery=False))
    rows = np.unique([seen(camera, drive)["instance"] for camera in ring])
    assert len(ring) == 6
    assert set(rows) == {-1, 1, 2, 3, 4}


def test_broken_maps_give_pictures(drive):
    """Outlines that cross themselves or have no area, heights that are not numbers, lines of one point."""
    world = drive.batch.worlds[0]
    roads = world.roads
    bow = np.array([[0, 0], [9, 9], [9, 0], [0, 9]], np.float32)
    values = np.concatenate([bow, bow[:2], np.full((4, 2), np.nan, np.float32)])
    polygons = replace(roads.polygons, offsets=np.array([0, 4, 6, 10]), values=values)
    broken = replace(roads, polygons=polygons, polygon_type=np.array([1, 1, 48], np.uint8))
    terrain = Terrain.of(broken, has_sidewalks=True)
    assert terrain.road.area == pytest.approx(40.5, abs=0.5)


def test_heights_ignore_points_that_are_not_numbers():
    builder = MapBuilder()
    builder.add("lane", MapFeatureType.LANE_SURFACE_STREET, polyline=[[0.0, 0.0, 2.0], [40.0, 0.0, 4.0]], width=(2, 2))
    features = builder.build(np.zeros(3))
    heights = Heights.from_map(features, 3.0)
    np.testing.assert_allclose(heights.at(np.array([[0.0, 0.0], [40.0, 0.0]])), [2.0, 4.0], atol=0.3)
    features.polyline.values[0, 2] = np.nan
    assert np.isfinite(Heights.from_map(features, 3.0).values).all()
    features.polyline.values[:, 2] = np.inf
    assert Heights.from_map(features, 3.0) is None


@pytest.mark.parametrize("broken", ["no map", "crossing", "not a number"])
def test_broken_scenarios_give_pictures(broken):
    scenario = make_drive(others=(Other(12.0, 1.0),), has_map=broken != "no map")
    if broken != "no map":
        builder = MapBuilder()
        builder.add(
            "lane", MapFeatureType.LANE_SURFACE_STREET, width=(2, 2),
            polyline=[[0.0, 0.0, np.nan if broken == "not a number" else 0.0], [40.0, 0.0, 0.0]],
        )  # fmt: skip
        bow = [[5.0, 5.0], [15.0, 15.0], [15.0, 5.0], [5.0, 15.0]]
        builder.add("bow", MapFeatureType.CROSSWALK, polygon=bow)
        scenario = replace(scenario, map=builder.build(np.zeros(3), has_z=broken == "not a number"))
    found = seen(replace(BARE, channels=("rgb", "depth", "normals")), simulate(scenario, steps=1))
    assert all(np.isfinite(values).all() for values in found.values())
    assert found["rgb"].std() > 5


@pytest.mark.parametrize("name", ["fov", "range", "exposure", "vignette", "noise", "jitter", "flow_time"])
def test_numbers_that_are_none_are_refused(name):
    for number in (np.nan, np.inf):
        with pytest.raises(BadParameter, match=name):
            Camera(**{name: number})


@pytest.mark.parametrize(
    "fine", [{"supersampling": 4}, {"lens": "fisheye"}, {"channels": ("rgb", "depth", "instance", "normals", "flow")}]
)
def test_frames_beyond_the_memory_are_refused(fine, monkeypatch):
    monkeypatch.setattr("scenarionet_sim.sensors.camera._MEMORY", 4e9)
    Camera(width=8192, height=4096)
    with pytest.raises(BadParameter, match=r"8192 x 8192 pixels takes \d+\.\d GB, more than half of this machine's"):
        Camera(width=8192, height=8192, **fine)


@pytest.mark.parametrize("wrong", [{"intrinsics": (np.nan, 1.0, 2.0, 2.0)}, {"distortion": (0.1, np.nan)}])
def test_lenses_with_numbers_that_are_none_are_refused(wrong):
    with pytest.raises(BadParameter):
        Camera(**wrong)


@pytest.mark.parametrize("factor", [2, 3, 4])
def test_pixels_of_several_rays_have_their_mean_light(factor):
    fine = np.random.default_rng(0).integers(0, 256, (2, 2 * factor, 30 * factor, 3), np.uint8)
    blocks = fine.reshape(2, 2, factor, 30, factor, 3).astype(np.float64)
    np.testing.assert_array_equal(scaled_down(fine, factor), np.rint(np.sqrt((blocks**2).mean(axis=(2, 4)))))


@pytest.mark.parametrize("height", [np.nan, np.inf, -1e30])
def test_a_mount_that_is_not_a_number_is_refused(height):
    with pytest.raises(BadParameter, match=r"z=.*expected (a finite number|levels)"):
        Mount(z=height)
