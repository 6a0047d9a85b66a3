"""What the cameras of these tests see, and how alike pictures are."""

from __future__ import annotations

import numpy as np

from scenarionet_sim.sensors.camera import Mount
from tests.fixtures.drives import Other, make_drive
from tests.fixtures.simulations import generated, simulate

ALL = ("rgb", "depth", "semantic", "instance", "normals", "flow")
MOUNT = Mount(1.0, 0.2, 1.6, 0.15, -0.12, 0.05)
OTHERS = (Other(14.0, 1.0, vx=6.0), Other(22.0, 3.5, vx=3.0), Other(9.0, -4.5, vx=1.0), Other(-6.0, 0.5))


def street():
    """The ego, four vehicles and a red light."""
    return simulate(make_drive(speed=8.0, others=OTHERS, red=True), steps=3)


def street_and_junction():
    """Two worlds: the street, and a generated junction with a dozen vehicles."""
    return simulate(make_drive(speed=8.0, others=OTHERS, red=True), generated(3), steps=3)


def share_alike(first, second):
    """Share of pixels in which no value differs by more than one level, a millimetre, or a hundredth of a pixel."""
    tolerance = {"u": 1.0, "i": 0.0, "f": 1e-2}[first.dtype.kind]
    close = np.isclose(first.astype(np.float64), second.astype(np.float64), rtol=0.0, atol=tolerance, equal_nan=True)
    return close.reshape(*close.shape[:3], -1).all(axis=-1).mean()
