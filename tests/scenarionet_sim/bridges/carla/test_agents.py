"""What agents of CARLA measure and answer, computed by hand in CARLA's axes; without CARLA's client."""

from __future__ import annotations

import math
from types import SimpleNamespace
from xml.etree import ElementTree as Xml

import numpy as np
import pytest

from scenarionet_data.errors import BadParameter, SourceError
from scenarionet_sim.bridges.carla.planner import action_of, opendrive_of
from scenarionet_sim.bridges.carla.sensors import AgentSensors, degrees_of
from scenarionet_sim.bridges.carla.stand_ins import CarlaDataProvider
from scenarionet_sim.drivers.code import PolicyCode, pinned_code, policy_name
from scenarionet_sim.planners.view import View
from scenarionet_sim.policies.replay import Replay
from scenarionet_sim.simulation.simulation import Simulation
from scenarionet_sim.worlds.world import World
from tests.fixtures.drives import Other, make_drive

AT = {"x": 0.0, "y": 0.0, "z": 1.0, "roll": 0.0, "pitch": 0.0, "yaw": 0.0}


@pytest.fixture
def view() -> View:
    world = World.from_scenario(make_drive("seen", others=(Other(20.0, vx=4.0),)))
    return View(world, Simulation([world], (Replay(),)).state, 0, world.ego)


def measured(view: View, kind: str, **settings: float) -> np.ndarray:
    ((_, found),) = AgentSensors([{"id": "it", "type": kind, **AT, **settings}], lambda: "<map/>").read(view)
    return found


def control(**told: float) -> SimpleNamespace:
    return SimpleNamespace(
        **{"steer": 0.0, "throttle": 0.0, "brake": 0.0, "hand_brake": False, "reverse": False} | told
    )


@pytest.mark.parametrize(
    ("told", "speed", "action"),
    [
        ({"throttle": 0.5}, 0.0, (0.0, 0.5)),
        ({"throttle": 0.5, "brake": 0.3}, 0.0, (0.0, -0.3)),
        ({"hand_brake": True, "throttle": 1.0}, 0.0, (0.0, -1.0)),
        ({"reverse": True, "throttle": 0.4}, 0.0, (0.0, -1.0)),
        ({"steer": 0.4}, 0.0, (-0.7, 0.0)),  # 28 of 40 degrees to the right
        ({"steer": -0.4}, 60.0 / 3.6, (0.56, 0.0)),  # a car at 60 km/h turns its wheels by 0.8 of that
        ({"steer": -1.0}, 0.0, (1.0, 0.0)),
    ],
)
def test_a_control_is_an_action(told, speed, action):
    assert action_of(control(**told), speed) == pytest.approx(action)


def test_what_is_no_control_is_a_sentence():
    with pytest.raises(BadParameter, match=r"expected a carla\.VehicleControl"):
        action_of(None, 0.0)
    with pytest.raises(BadParameter, match="expected finite numbers"):
        action_of(control(steer=math.nan), 0.0)


def test_a_degree_is_where_mercator_puts_it():
    """At 42 degrees north, 1000 m are 0.0120882 degrees to the east and 0.0089832 to the north."""
    assert degrees_of(0.0, 0.0) == pytest.approx((42.0, 2.0))
    lat, lon = degrees_of(1000.0, 1000.0)
    assert lon - 2.0 == pytest.approx(math.degrees(1000.0 / (6378137.0 * math.cos(math.radians(42.0)))), rel=1e-9)
    assert lat - 42.0 == pytest.approx(math.degrees(1000.0 / 6378137.0), rel=1e-3)


def test_gnss_is_at_its_mount_to_the_right(view):
    np.testing.assert_allclose(
        measured(view, "sensor.other.gnss", x=2.0, y=0.5), [*degrees_of(2.0, -0.5), 1.0], rtol=0, atol=1e-12
    )


def test_imu_has_gravity_the_turn_to_the_right_and_the_bearing_from_north(view):
    view.ego.acceleration, view.ego.yaw_rate, view.ego.speed, view.ego.heading = 1.0, 0.2, 5.0, 0.3
    ahead, right, up, *rates, bearing = measured(view, "sensor.other.imu")
    assert (ahead, right, up, *rates) == pytest.approx((1.0, -1.0, 9.81, 0.0, 0.0, -0.2))
    assert bearing == pytest.approx(math.pi / 2 - 0.3)
    turned = measured(view, "sensor.other.imu", yaw=90.0)  # looks to the right
    assert turned[:2] == pytest.approx((-1.0, -1.0))
    assert turned[6] == pytest.approx(math.pi - 0.3)


def test_speedometer_and_map(view):
    assert measured(view, "sensor.speedometer") == {"speed": pytest.approx(10.0)}
    assert measured(view, "sensor.opendrive_map") == {"opendrive": "<map/>"}


def test_radar_sees_the_car_ahead_go_away(view):
    """Its rear is at 20 - 2.3 m, and it is 6 m/s slower."""
    found = measured(view, "sensor.other.radar", x=2.0, horizontal_fov=10.0, vertical_fov=4.0)
    on_car = found[np.abs(found[:, 1]) < math.radians(1.0)]
    assert on_car[:, 0].min() == pytest.approx(15.7, abs=0.3)
    assert on_car[0, 3] == pytest.approx(-6.0, abs=0.1)


def test_points_are_to_the_right_of_the_lidar_where_the_mirrored_ones_are_to_its_left():
    world = World.from_scenario(make_drive("seen", others=(Other(10.0, 3.5),)))
    view = View(world, Simulation([world], (Replay(),)).state, 0, world.ego)
    points = measured(view, "sensor.lidar.ray_cast", z=2.0)
    near = points[(np.abs(points[:, 0] - 10.0) < 2.0) & (points[:, 2] > -1.5) & (np.abs(points[:, 1]) < 5.0)]
    assert len(near) > 10
    assert near[:, 1].max() < -2.0


def test_a_picture_is_blue_green_red_and_opaque(view):
    picture = measured(view, "sensor.camera.rgb", width=32, height=16, fov=90)
    assert (picture.shape, picture.dtype) == ((16, 32, 4), np.uint8)
    assert (picture[..., 3] == 255).all()
    sky = picture[0].mean(axis=0)
    assert sky[0] > sky[2]


@pytest.mark.parametrize(
    ("spec", "reason"),
    [
        (
            {"id": "a", "type": "sensor.other.collision"},
            "of type 'sensor.other.collision'; there are sensor.camera.rgb",
        ),
        ({"id": "a", "type": "sensor.camera.rgb", **AT}, "lacks 'width'"),
    ],
)
def test_a_sensor_that_is_not_there_is_a_sentence(spec, reason):
    with pytest.raises(BadParameter, match=reason):
        AgentSensors([spec], str)


def test_the_map_has_the_lanes_with_their_widths_and_links(view):
    root = Xml.fromstring(opendrive_of(view.world.roads))
    widths = [float(each.get("a", "")) for each in root.iter("width")]
    assert widths == pytest.approx([3.5] * len(widths), abs=0.01)
    links = [each.get("elementType") for each in root.iter("successor") if each.get("elementType")]
    assert links.count("road") == 2


def test_the_world_is_refused_in_a_sentence():
    with pytest.raises(SourceError, match=r"asks CARLA's world \(CarlaDataProvider.get_world\)"):
        CarlaDataProvider.get_world()


def test_an_agent_is_pinned_by_the_path_of_its_file(tmp_path, monkeypatch):
    (tmp_path / "agent.py").write_text("")
    monkeypatch.chdir(tmp_path)
    policy = pinned_code("carla:agent.py:Mine")
    assert policy == f"carla:{tmp_path}/agent.py:Mine"
    assert policy_name(policy) == "agent.Mine"
    code = PolicyCode.of(policy)
    assert code is not None and (code.reference, code.folder) == ("agent:Mine", tmp_path)
    with pytest.raises(BadParameter, match=r"expected carla:folder/agent\.py:Class"):
        pinned_code("carla:agent:Mine")
