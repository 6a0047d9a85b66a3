"""openpilot over msgq and VisionIPC: one clock for its cameras, sensors and car, and its commands."""

from __future__ import annotations

import math
import os
import time
from collections.abc import Collection
from dataclasses import replace
from typing import Any

import numpy as np

from scenarionet_data.arrays.dtypes import UInt8
from scenarionet_data.errors import SourceError
from scenarionet_sim.arrays.log import HEADING
from scenarionet_sim.bridges.commands import Command, Push
from scenarionet_sim.bridges.link import NS, StackMoment
from scenarionet_sim.bridges.openpilot.car import DBC, STEER_RATIO, can_frames
from scenarionet_sim.bridges.openpilot.checkout import Messaging
from scenarionet_sim.bridges.openpilot.messages import (
    ANSWER,
    HEIGHT,
    PER_FRAME,
    ROAD,
    SAMPLES,
    SENT,
    STREAMS,
    WIDE,
    WIDTH,
    contents,
)
from scenarionet_sim.bridges.sensing import StackSensors, nv12
from scenarionet_sim.planners.view import EgoView, View
from scenarionet_sim.worlds.state import State

_SAMPLE = round(NS / SAMPLES)  # [ns]
_BUFFERS = 5  # of each stream, as openpilot's camera daemon has


class OpenpilotTransport:
    """openpilot's services; see :class:`~scenarionet_sim.bridges.link.Transport`.

    Stamps are of this machine's monotonic clock where a scenario begins, and then of the simulation's: openpilot
    refuses frames from before its own start, and sensors that are not of the time of the frames.

    Args:
        options: Empty: openpilot gets both cameras.
    """

    def __init__(self, options: Collection[str] = ()) -> None:
        del options
        prefix = os.environ.get("OPENPILOT_PREFIX")
        self.where = f"msgq on {ANSWER}" + (f" with the prefix {prefix}" if prefix else "")
        self._messaging = Messaging(SENT, ANSWER)
        self._packer = self._messaging.can_packer(DBC)
        self._server: Any = self._messaging.vision_server("camerad")
        for stream in STREAMS.values():
            self._server.create_buffers(stream, _BUFFERS, WIDTH, HEIGHT)
        self._server.start_listener()
        self._epoch = time.time_ns() - time.monotonic_ns()
        self._stamp = self._began = self._frame = self._sample = 0
        self._is_driven = False
        self._before: State | None = None

    def begin(self, moment: StackMoment, until: float) -> int:
        """Press the button that engages until openpilot drives; its clock runs on, and the scene stands."""
        view = moment.view
        self._sensors = StackSensors(dict(zip(STREAMS, (ROAD, WIDE), strict=True)))
        self._before, self._is_driven = None, False
        self._began = max(moment.stamp, self._stamp + _SAMPLE, time.monotonic_ns())
        self._stamp = max(self._stamp, self._began - PER_FRAME * _SAMPLE)
        frames, ego = self._look(view), replace(view.ego, speed=0.0, acceleration=0.0, yaw_rate=0.0)
        stamp, is_pressed = self._began, False
        while not self._is_driven:
            now = time.monotonic()
            if now > until:
                raise SourceError(
                    f"openpilot does not engage over {self.where}; is it running, with SIMULATION=1 and "
                    "FINGERPRINT=HONDA_CIVIC_2022?"
                )
            is_pressed = not is_pressed
            for number in reversed(range(PER_FRAME)):
                self._publish(ego, stamp - number * _SAMPLE, frames if not number else {}, is_pressed=is_pressed)
            self._stamp = stamp
            stamp += PER_FRAME * _SAMPLE
            while not self._is_driven and self._receive(now + PER_FRAME / SAMPLES) is not None:
                pass
        return stamp

    def send(self, moment: StackMoment) -> None:
        """Publish the samples since the moment before, evenly until the moment is over in real time."""
        span = moment.stamp - self._stamp
        if not span:
            return  # sent again; stamps only rise, and what has driven before is there
        view, last = moment.view, max(1, round(span / _SAMPLE))
        for number in range(1, last + 1):
            now = between(view, self._before, number / last)
            left = last - number
            frames = self._look(now) if left % PER_FRAME == 0 else {}
            if moment.until:
                time.sleep(max(moment.until - (left + 1) / SAMPLES - time.monotonic(), 0.0))
            ego = replace(now.ego, acceleration=view.ego.acceleration)
            self._publish(ego, self._stamp + span * number // last, frames, is_pressed=False)
        self._stamp = moment.stamp
        self._before = replace(view.state, motion=view.state.motion.copy(), present=view.state.present.copy())

    def take(self, until: float) -> tuple[int, Command] | None:
        """Return the oldest command that comes in time.

        One that was made since the latest moment answers it: openpilot does not say what its commands answer.
        """
        received = self._receive(until)
        if received is not None and not self._is_driven:
            raise SourceError("openpilot has disengaged; nobody else drives")
        return received

    def close(self) -> None:
        """Let go of queues and buffers."""
        self._messaging.close()
        self._server = None

    def _receive(self, until: float) -> tuple[int, Command] | None:
        """The oldest command, whether or not openpilot drives; those from before the scenario are left out."""
        while True:
            if (received := self._messaging.receive()) is not None:
                stamp, control = received
                if stamp >= self._began or self._before is not None:
                    self._is_driven, told = control["enabled"], control["actuators"]
                    steering = math.radians(told["steeringAngleDeg"]) / STEER_RATIO
                    return min(stamp, self._stamp), Push(steering, told["accel"])
            if time.monotonic() > until:
                return None

    def _look(self, view: View) -> dict[str, UInt8]:
        return {name: nv12(picture) for name, picture in self._sensors.look(view).items()}

    def _publish(self, ego: EgoView, stamp: int, frames: dict[str, UInt8], *, is_pressed: bool) -> None:
        """Send what is due at a sample, and frames last."""
        can = can_frames(self._packer, ego, is_driven=self._is_driven, is_pressed=is_pressed)
        unix = (stamp + self._epoch) // 1_000_000
        made = dict(contents(ego, stamp, unix, self._frame)) | {"can": can}
        for name, service in SENT.items():
            is_due = name in frames if name in STREAMS else self._sample % service.every == 0
            if is_due:
                self._messaging.send(name, stamp, made[name])
        for name, picture in frames.items():
            self._server.send(STREAMS[name], picture, self._frame, stamp, stamp)
        self._sample += 1
        self._frame += bool(frames)


def between(view: View, before: State | None, share: float) -> View:
    """Return a moment between two: objects that are present in both have moved by a share of their way.

    Args:
        view: The later moment.
        before: The state of the earlier one; None if there is none.
        share: 0 for the earlier moment, 1 for the later one.
    """
    if before is None or share == 1.0:
        return view
    now = view.state
    way = now.motion - before.motion
    way[..., HEADING] = (way[..., HEADING] + np.pi) % (2.0 * np.pi) - np.pi
    way[~(now.present & before.present)] = 0.0
    motion = now.motion - (1.0 - share) * way
    return View(view.world, replace(now, motion=motion), view.slot, view.row)
