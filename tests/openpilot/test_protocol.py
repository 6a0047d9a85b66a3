"""What openpilot gets, read by comma's msgq and VisionIPC and opendbc's parser from the real queues."""

from __future__ import annotations

import math
import os
import time
from collections.abc import Iterator
from dataclasses import replace
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from scenarionet_data.errors import SourceError
from scenarionet_sim.bridges.link import NS, StackMoment
from scenarionet_sim.bridges.openpilot.car import CAN, DBC, steering_wheel
from scenarionet_sim.bridges.openpilot.messages import HEIGHT, SENT, STREAMS, WIDTH
from scenarionet_sim.bridges.openpilot.transport import OpenpilotTransport
from scenarionet_sim.planners.view import View
from scenarionet_sim.policies.replay import Replay
from scenarionet_sim.simulation.simulation import Simulation
from scenarionet_sim.worlds.world import World
from tests.fixtures.drives import make_drive
from tests.openpilot.conftest import needs_openpilot

pytestmark = [pytest.mark.openpilot, needs_openpilot]

MOMENTS = 5
SPEED = 10.03


class Peer:
    """The other side, in this process: reads every queue, and says what openpilot would."""

    def __init__(self) -> None:
        import capnp
        import msgq

        self.parser = capnp.SchemaParser()
        self.event = self.parser.load(str(Path(os.environ["OPENPILOT"], "log.capnp"))).Event
        self.control = msgq.pub_sock("carControl")
        self.sockets = {name: msgq.sub_sock(name, timeout=0) for name in SENT}
        self.drain = msgq.drain_sock_raw
        self.read: dict[str, list[Any]] = {name: [] for name in SENT}
        self.frames: dict[str, list[tuple[int, int, bytes]]] = {name: [] for name in STREAMS}

    def connect(self) -> None:
        from msgq.visionipc import VisionIpcClient

        self.clients = {name: VisionIpcClient("camerad", stream, False) for name, stream in STREAMS.items()}
        assert all(client.connect(True) for client in self.clients.values())

    def collect(self) -> None:
        for name, socket in self.sockets.items():
            for content in self.drain(socket):
                with self.event.from_bytes(content) as event:
                    self.read[name].append((event.logMonoTime, event.to_dict()[name]))
        for name, client in self.clients.items():
            while (buffer := client.recv(1)) is not None:
                self.frames[name].append((client.frame_id, client.timestamp_eof, bytes(buffer.data)))

    def say(self, stamp: int, *, accel: float = 0.0, degrees: float = 0.0, enabled: bool = True) -> None:
        event = self.event.new_message(logMonoTime=stamp, valid=True)
        control = event.init("carControl")
        control.enabled, control.actuators.accel, control.actuators.steeringAngleDeg = enabled, accel, degrees
        self.control.send(event.to_bytes())


@pytest.fixture(scope="module")
def driven(queues: None) -> Iterator[tuple[Peer, OpenpilotTransport, list[tuple[int, View]]]]:
    """A drive of a few moments; what was sent, and the moments by stamp."""
    transport = OpenpilotTransport()
    peer = Peer()
    peer.connect()
    world = World.from_scenario(make_drive(speed=SPEED))
    simulation = Simulation([world], (Replay(),))
    transport.take(time.monotonic())  # finds that there is a publisher
    peer.say(2**62)
    stamp, moments = 0, []
    for number in range(MOMENTS):
        view = View(world, simulation.state, 0, world.ego, speed_before=SPEED - 0.2)
        moment = StackMoment(view, stamp, not number)
        if not number:
            stamp = transport.begin(moment, time.monotonic() + 10.0)
        transport.send(replace(moment, stamp=stamp))
        peer.collect()
        moments.append((stamp, view.ego))
        stamp += round(0.1 * NS)
        simulation.step()
    yield peer, transport, moments
    transport.close()


def test_every_service_has_its_rate_and_stamps_that_rise(driven: Any) -> None:
    peer, _, moments = driven
    first, last = moments[0][0], moments[-1][0]
    for name, service in SENT.items():
        stamps = [stamp for stamp, _ in peer.read[name]]
        assert (np.diff(stamps) > 0).all(), name
        inside = [stamp for stamp in stamps if first < stamp <= last]
        wanted = (last - first) / NS * 100 / service.every
        assert abs(len(inside) - wanted) <= 1, name
    assert abs(first - time.monotonic_ns()) < 60 * NS  # not from zero


def test_a_frame_has_the_stamp_of_a_sample_of_the_imu(driven: Any) -> None:
    peer, _, _ = driven
    imu = np.array([content["timestamp"] for _, content in peer.read["gyroscope"]])
    for name, frames in peer.frames.items():
        numbers, stamps = [number for number, *_ in frames], np.array([stamp for _, stamp, _ in frames])
        assert len(frames) > 2 * MOMENTS - 2
        assert (np.diff(numbers) == 1).all()
        assert (np.diff(stamps) > 0).all()
        assert np.abs(stamps[:, None] - imu).min(axis=1).max() <= 1_000_000
        states = {content["frameId"]: content["timestampEof"] for _, content in peer.read[name]}
        assert all(states[number] == stamp for number, stamp, _ in frames)


def test_frames_move_between_moments_and_are_not_grey(driven: Any) -> None:
    for frames in driven[0].frames.values():
        pictures = [np.frombuffer(content, np.uint8) for *_, content in frames[-4:]]
        assert all(len(picture) == WIDTH * HEIGHT * 3 // 2 for picture in pictures)
        assert all((one != other).mean() > 0.01 for one, other in pairwise(pictures))
        assert pictures[0][: WIDTH * HEIGHT].std() > 20


def test_can_decodes_to_what_was_sent(driven: Any) -> None:
    """By opendbc's parser, which checks counters and checksums."""
    from opendbc.can.parser import CANParser

    peer, _, moments = driven
    for bus in (0, 2):
        names = [name for name, each in CAN.items() if each.number == bus]
        parser = CANParser(DBC, [(name, 100) for name in names], bus)
        for stamp, rows in peer.read["can"]:
            seen = parser.update([(stamp, [(row["address"], row["dat"], row["src"]) for row in rows])])
            assert len(seen) == len(names)
            if bus == 0 and stamp >= moments[0][0]:
                for wheel in ("FL", "FR", "RL", "RR"):
                    assert abs(parser.vl["WHEEL_SPEEDS"][f"WHEEL_SPEED_{wheel}"] / 3.6 - SPEED) < 0.01
                assert abs(parser.vl["ENGINE_DATA"]["XMISSION_SPEED"] / 3.6 - SPEED) < 0.01
                assert parser.vl["POWERTRAIN_DATA"]["ACC_STATUS"] == 1
        assert parser.can_valid


def test_imu_and_gps_are_those_of_the_drive(driven: Any) -> None:
    peer, _, _ = driven
    stamp, last = peer.read["accelerometer"][-1]
    assert last["timestamp"] == stamp
    np.testing.assert_allclose(last["acceleration"]["v"], [9.81, 0.0, -2.0], atol=1e-3)  # -down, -right, -ahead
    _, gps = peer.read["gpsLocationExternal"][-1]
    np.testing.assert_allclose(gps["vNED"], [0.0, SPEED, 0.0], atol=1e-4)
    assert gps["bearingDeg"] == pytest.approx(90.0)
    assert gps["latitude"] == pytest.approx(42.0)
    assert gps["longitude"] > 2.0


def test_a_command_is_an_angle_of_the_front_wheels_and_an_acceleration(driven: Any) -> None:
    peer, transport, moments = driven
    stamp = moments[-1][0]
    peer.say(stamp, accel=1.5, degrees=15.38)
    answered, command = transport.take(time.monotonic() + 2.0)
    assert (answered, command.acceleration) == (stamp, pytest.approx(1.5))
    assert math.degrees(command.steering) == pytest.approx(1.0, abs=1e-5)
    peer.say(stamp + 7)  # openpilot's own clock
    assert transport.take(time.monotonic() + 2.0)[0] == stamp
    peer.say(1)
    assert transport.take(time.monotonic() + 2.0)[0] == 1
    assert transport.take(time.monotonic() + 0.01) is None
    peer.say(stamp, enabled=False)
    with pytest.raises(SourceError, match="disengaged"):
        transport.take(time.monotonic() + 2.0)


def test_a_second_camera_daemon_is_a_sentence(driven: Any) -> None:
    import msgq

    _, transport, moments = driven
    other = msgq.pub_sock("roadCameraState")
    view = View(*_world(), 0, 0)
    with pytest.raises(SourceError, match="another process publishes roadCameraState"):
        transport.send(StackMoment(view, moments[-1][0] + NS, False))
    del other


def test_the_wheel_turns_with_the_vehicle() -> None:
    view = View(*_world(), 0, 0)
    view.ego.yaw_rate = 0.2
    slope = math.tan(math.radians(steering_wheel(view.ego) / 15.38))
    assert slope * SPEED / (0.6 * view.ego.length) == pytest.approx(0.2, rel=1e-4)


def _world() -> tuple[World, Any]:
    world = World.from_scenario(make_drive(speed=SPEED))
    return world, Simulation([world], (Replay(),)).state
