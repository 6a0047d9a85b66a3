"""Write the definitions of Autoware's messages, from checkouts of autoware_msgs and autoware_adapi_msgs."""

from __future__ import annotations

import sys
from pathlib import Path

HEAD = """\
# Fields of messages and services of autoware_msgs 1.12.0 and autoware_adapi_msgs 1.9.2, without comments and constants.
# Copyright The Autoware Foundation, Apache License 2.0. Written by tests/ros/autoware_definitions.py.
"""
WANTED = {
    "autoware_control_msgs": ("Lateral", "Longitudinal", "Control"),
    "autoware_perception_msgs": (
        "ObjectClassification",
        "PredictedPath",
        "PredictedObjectKinematics",
        "Shape",
        "PredictedObject",
        "PredictedObjects",
        "TrafficLightElement",
        "PredictedTrafficLightState",
        "TrafficLightGroup",
        "TrafficLightGroupArray",
    ),
    "autoware_vehicle_msgs": (
        "ControlModeReport",
        "Engage",
        "GearCommand",
        "GearReport",
        "HazardLightsCommand",
        "HazardLightsReport",
        "SteeringReport",
        "TurnIndicatorsCommand",
        "TurnIndicatorsReport",
        "VelocityReport",
        "ControlModeCommand",
    ),
    "autoware_adapi_v1_msgs": (
        "ResponseStatus",
        "RouteOption",
        "RouteState",
        "OperationModeState",
        "ClearRoute",
        "SetRoutePoints",
        "ChangeOperationMode",
    ),
}


def definitions(*checkouts: Path) -> str:
    """All wanted messages; of a service the request and the reply."""
    blocks = []
    for package, names in WANTED.items():
        for name in names:
            (file,) = (path for root in checkouts for path in (root / package).rglob(f"{name}.[ms][sr][gv]"))
            kind, text = file.suffix.removeprefix("."), file.read_text("utf-8")
            for part, lines in zip(
                ("_Request", "_Response") if kind == "srv" else ("",), text.split("---"), strict=True
            ):
                fields = [" ".join(line.partition("#")[0].split()) for line in lines.splitlines()]
                kept = [line for line in fields if line and "=" not in line.replace("<=", "")]
                blocks.append("\n".join([f"{package}/{kind}/{name}{part}", *kept]))
    return HEAD + "\n".join(f"\n{block}" for block in blocks) + "\n"


if __name__ == "__main__":
    sys.stdout.write(definitions(*map(Path, sys.argv[1:])))
