"""The car that openpilot drives: a Honda Civic of 2022, as in openpilot's own simulator, by its CAN messages."""

from __future__ import annotations

import math
from typing import Any, NamedTuple

from scenarionet_sim.backends.base import Drive
from scenarionet_sim.planners.view import EgoView

DBC = "honda_bosch_radarless_generated"
"""The car's messages, which opendbc generates."""

STEER_RATIO = 15.38
"""Angle of the steering wheel over that of the front wheels: opendbc's of this car."""

SET_BUTTON = 3
"""The button that engages, of ``opendbc.car.honda.values.CruiseButtons``."""

_KPH = 3.6
_MOVES = 1.0  # [m/s] from which the car says that its wheels move


class Bus(NamedTuple):
    """Where a message is sent, and what is in it, for the documentation."""

    number: int
    content: str


CAN = {
    "ENGINE_DATA": Bus(0, "speed [km/h]"),
    "WHEEL_SPEEDS": Bus(0, "speed of each wheel [km/h]"),
    "CAR_SPEED": Bus(0, "speed [km/h]"),
    "STANDSTILL": Bus(0, "whether the wheels move"),
    "STEERING_SENSORS": Bus(0, "angle of the steering wheel, positive to the left [degrees]"),
    "SCM_BUTTONS": Bus(0, "the button that engages, pressed and let go until openpilot drives"),
    "SCM_FEEDBACK": Bus(0, "the main switch is on"),
    "POWERTRAIN_DATA": Bus(0, "whether openpilot drives; no pedal is pressed"),
    "GEARBOX_AUTO": Bus(0, "D"),
    "SEATBELT_STATUS": Bus(0, "latched"),
    "GAS_PEDAL_2": Bus(0, "zero"),
    "STEER_STATUS": Bus(0, "zero: no hand at the wheel"),
    "STEER_MOTOR_TORQUE": Bus(0, "zero"),
    "VSA_STATUS": Bus(0, "zero"),
    "EPB_STATUS": Bus(0, "zero"),
    "DOORS_STATUS": Bus(0, "zero: closed"),
    "CRUISE": Bus(0, "zero"),
    "CRUISE_FAULT_STATUS": Bus(0, "zero"),
    "STEERING_CONTROL": Bus(2, "zero, of the camera that openpilot replaces"),
    "ACC_HUD": Bus(2, "zero"),
    "LKAS_HUD": Bus(2, "zero"),
}
"""What the car says, 100 times a second."""


def can_frames(packer: Any, ego: EgoView, *, is_driven: bool, is_pressed: bool) -> list[dict[str, Any]]:
    """Return the frames of a moment as rows of ``can``.

    Args:
        packer: opendbc's ``CANPacker`` of DBC, which counts the messages.
        ego: The vehicle.
        is_driven: Whether openpilot drives.
        is_pressed: Whether the button that engages is pressed.
    """
    speed = _KPH * abs(ego.speed)
    values: dict[str, dict[str, float]] = {
        "ENGINE_DATA": {"XMISSION_SPEED": speed},
        "WHEEL_SPEEDS": {f"WHEEL_SPEED_{wheel}": speed for wheel in ("FL", "FR", "RL", "RR")},
        "CAR_SPEED": {"CAR_SPEED": speed},
        "STANDSTILL": {"WHEELS_MOVING": abs(ego.speed) >= _MOVES},
        "STEERING_SENSORS": {"STEER_ANGLE": steering_wheel(ego)},
        "SCM_BUTTONS": {"CRUISE_BUTTONS": SET_BUTTON * is_pressed},
        "SCM_FEEDBACK": {"MAIN_ON": 1},
        "POWERTRAIN_DATA": {"ACC_STATUS": is_driven},
        "GEARBOX_AUTO": {"GEAR_SHIFTER": 4},
        "SEATBELT_STATUS": {"SEATBELT_DRIVER_LATCHED": 1},
    }
    made = (packer.make_can_msg(name, bus.number, values.get(name, {})) for name, bus in CAN.items())
    return [{"address": address, "dat": content, "src": bus} for address, content, bus in made]


def steering_wheel(ego: EgoView) -> float:
    """Return the angle of the steering wheel that the vehicle's motion tells, positive to the left [degrees]."""
    if abs(ego.speed) < _MOVES:
        return 0.0
    return STEER_RATIO * math.degrees(math.atan(Drive().wheelbase * ego.length * ego.yaw_rate / ego.speed))
