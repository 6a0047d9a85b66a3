"""A lane keeper with nothing of ours: comma's msgq and VisionIPC, pycapnp, opendbc, numpy, and a checkout's schema.

It holds the distance to the kerb that it first saw, in frames of the wide camera, and the speed that it first had, by the
wheels. A word on its command line is a fault.
"""

import math
import os
import sys
from collections.abc import Iterator
from pathlib import Path

import capnp
import msgq
import numpy as np
from msgq.visionipc import VisionIpcClient
from opendbc.can.parser import CANParser

FAULT = sys.argv[1] if len(sys.argv) > 1 else ""
FAULT_AFTER = 15  # frames of a drive
WIDE, FOCAL, HEIGHT = 2, 567.0, 1.22
STEER_RATIO, WHEELBASE = 15.38, 2.7
LIGHT = 165  # luma of a kerb in the sun

capnp.remove_import_hook()
schemas = capnp.SchemaParser()
log = schemas.load(str(Path(os.environ["OPENPILOT"], "log.capnp")))
control = msgq.pub_sock("carControl")
can = msgq.sub_sock("can", timeout=0)
parser = CANParser("honda_bosch_radarless_generated", [("WHEEL_SPEEDS", 100), ("POWERTRAIN_DATA", 100)], 0)


def frames() -> Iterator[tuple[int, np.ndarray]]:
    """Stamps [ns] and luma (H, W) of frames as they come."""
    client = VisionIpcClient("camerad", WIDE, False)
    client.connect(True)
    while True:
        buffer = client.recv(50)
        if buffer is not None:
            width, height = buffer.width, buffer.height
            yield client.timestamp_eof, np.frombuffer(buffer.data, np.uint8)[: width * height].reshape(height, width)


def kerb(luma: np.ndarray, distance: float) -> float:
    """How far to the right the kerb is, at a distance ahead [m]; NaN where nothing is light."""
    row = round(luma.shape[0] / 2 + FOCAL * HEIGHT / distance)
    right = luma[row - 1 : row + 2, luma.shape[1] // 2 :].mean(axis=0)
    light = np.convolve(right > LIGHT, np.ones(6), "valid") == 6  # noise and dashes are narrower
    return float(np.argmax(light)) * distance / FOCAL if light.any() else math.nan


held: dict[float, float] = {}
wanted, count = math.nan, 0
for stamp, luma in frames():
    for content in msgq.drain_sock_raw(can):
        with log.Event.from_bytes(content) as event:
            parser.update([(event.logMonoTime, [(each.address, each.dat, each.src) for each in event.can])])
    wheels = parser.vl["WHEEL_SPEEDS"]
    speed = sum(wheels[f"WHEEL_SPEED_{wheel}"] for wheel in ("FL", "FR", "RL", "RR")) / 4 / 3.6
    is_driving = bool(parser.vl["POWERTRAIN_DATA"]["ACC_STATUS"])
    if not is_driving:
        wanted, count = math.nan, 0
        held = {distance: kerb(luma, distance) for distance in (8.0, 10.0, 12.0, 14.0)}
    elif math.isnan(wanted):
        wanted = speed
    count += is_driving
    aside = [(kerb(luma, distance) - there, distance) for distance, there in held.items()]
    bends = [-2.0 * right / distance**2 for right, distance in aside if abs(right) < 3.0]
    bend = float(np.median(bends)) if bends else 0.0
    event = log.Event.new_message(logMonoTime=stamp, valid=True)
    told = event.init("carControl")
    told.enabled = told.latActive = told.longActive = True
    told.actuators.steeringAngleDeg = STEER_RATIO * math.degrees(math.atan(WHEELBASE * bend))
    slow = min(wanted, math.sqrt(2.5 / max(abs(bend), 1e-3)))
    told.actuators.accel = 0.0 if math.isnan(wanted) else min(max(2.0 * (slow - speed), -4.0), 2.0)
    content = event.to_bytes()
    if count > FAULT_AFTER and FAULT:
        if FAULT == "dies":
            break
        if FAULT == "silent":
            continue
        if FAULT == "nan":
            told.actuators.accel = math.nan
        if FAULT == "old":
            event.logMonoTime = 1
        if FAULT == "disengages":
            told.enabled = False
        content = event.to_bytes()
        if FAULT == "half":
            content = content[: len(content) // 2]
        if FAULT == "flood":
            event.logMonoTime = 1
            for _ in range(3000):
                control.send(event.to_bytes())
    control.send(content)
