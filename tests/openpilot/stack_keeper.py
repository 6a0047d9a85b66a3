"""A lane keeper with nothing of ours: comma's msgq and VisionIPC, pycapnp, opendbc, numpy, and a checkout's schema.

It stays half a lane to the right of the yellow line, in frames of the wide camera, and holds the speed that it first
had, by the wheels. A word on its command line is a fault.
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
HALF_LANE = 1.75  # [m]
YELLOW = 25  # V over U of the line, in the shade, too; grey has none

capnp.remove_import_hook()
schemas = capnp.SchemaParser()
log = schemas.load(str(Path(os.environ["OPENPILOT"], "log.capnp")))
control = msgq.pub_sock("carControl")
can = msgq.sub_sock("can", timeout=0)
parser = CANParser("honda_bosch_radarless_generated", [("WHEEL_SPEEDS", 100), ("POWERTRAIN_DATA", 100)], 0)


def frames() -> Iterator[tuple[int, np.ndarray]]:
    """Stamps [ns] and chroma (H / 2, W / 2, 2) of frames as they come."""
    client = VisionIpcClient("camerad", WIDE, False)
    client.connect(True)
    while True:
        buffer = client.recv(50)
        if buffer is not None:
            width, height = buffer.width, buffer.height
            chroma = np.frombuffer(buffer.data, np.uint8)[width * height : width * height * 3 // 2]
            yield client.timestamp_eof, chroma.reshape(height // 2, width // 2, 2).astype(np.int16)


def line(chroma: np.ndarray, distance: float) -> float:
    """How far to the left the nearest yellow line is, at a distance ahead [m]; NaN where none is."""
    row = round(chroma.shape[0] / 2 + FOCAL / 2 * HEIGHT / distance)
    seen = chroma[row - 1 : row + 2]
    columns = np.flatnonzero((seen[..., 1] - seen[..., 0]).max(axis=0) > YELLOW)
    left = (chroma.shape[1] / 2 - columns) * distance / (FOCAL / 2)
    left = left[(left > -1.0) & (left < 8.0)]
    return float(left.min()) if len(left) else math.nan


wanted, count = math.nan, 0
for stamp, chroma in frames():
    for content in msgq.drain_sock_raw(can):
        with log.Event.from_bytes(content) as event:
            parser.update([(event.logMonoTime, [(each.address, each.dat, each.src) for each in event.can])])
    wheels = parser.vl["WHEEL_SPEEDS"]
    speed = sum(wheels[f"WHEEL_SPEED_{wheel}"] for wheel in ("FL", "FR", "RL", "RR")) / 4 / 3.6
    is_driving = bool(parser.vl["POWERTRAIN_DATA"]["ACC_STATUS"])
    if not is_driving:
        wanted, count = math.nan, 0
    elif math.isnan(wanted):
        wanted = speed
    count += is_driving
    ahead = {distance: line(chroma, distance) - HALF_LANE for distance in (6.0, 7.0, 8.0, 9.0, 10.0)}
    bends = [2.0 * left / (distance**2 + left**2) for distance, left in ahead.items() if not math.isnan(left)]
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
