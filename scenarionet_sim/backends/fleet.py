"""Capabilities of vehicles by class and size.

Sources. Braking: what UN Regulation 13 requires of lorries and buses (5.0 m/s²); dry roads allow cars and motorcycles
8 m/s². Air drag rho c_d A / 2 m at 1.2 kg/m³: 0.3 x 2.2 m² / 1,500 kg for a car, 0.6 x 9 m² / 18 t for a lorry,
0.6 x 0.7 m² / 300 kg for a motorcycle, 0.4 m² / 85 kg for a bicycle. Rolling resistance 0.013 g, 0.007 g on the tyres
of lorries and 0.005 g on those of bicycles (Gillespie, Fundamentals of Vehicle Dynamics, 1992, chapter 4), and 0.3 m/s²
by an engine that is not fired. Friction circle of a lorry: its rollover threshold, 0.4 to 0.6 g (Gillespie, chapter 9).
Steering rate: 720 degrees a second at the wheel, as in NHTSA's fishhook manoeuvre, over a ratio of 16, or 20 for
lorries. Lock: a turning circle of 11 m between kerbs for a car, of 25 m between walls for a lorry (Directive
97/27/EC). The remaining values are typical ones.
"""

from __future__ import annotations

import math
import zlib
from dataclasses import astuple, dataclass, fields

import numpy as np

from scenarionet_data.arrays.dtypes import Array, Float64, UInt8
from scenarionet_data.errors import BadParameter
from scenarionet_data.scenario.settings import check_settings
from scenarionet_data.scenario.vocabulary import ObjectType
from scenarionet_sim.backends.base import Drive

CAR = Drive(
    math.radians(35.0), 3.5, 8.0, 50.0, 0.6, steering_rate=math.radians(45.0), drag=2.6e-4, rolling=0.43, reverse=8.0
)
LORRY = Drive(
    math.radians(40.0), 1.2, 5.0, 25.0, 0.55, steering_rate=math.radians(36.0), drag=1.8e-4, rolling=0.37, reverse=4.0
)
MOTORCYCLE = Drive(
    math.radians(35.0), 5.0, 8.0, 50.0, 0.65, steering_rate=math.radians(60.0), drag=8.4e-4, rolling=0.43, reverse=0.0
)
BICYCLE = Drive(
    math.radians(45.0), 1.0, 4.0, 12.0, 0.6, steering_rate=math.radians(90.0), drag=2.8e-3, rolling=0.05, reverse=0.0
)
PEDESTRIAN = Drive(
    math.radians(60.0), 2.0, 4.0, 3.0, 0.6, steering_rate=math.radians(180.0), drag=0.0, rolling=0.0, reverse=1.0
)

GRIP = (("car", 8.0), ("lorry", 5.5), ("motorcycle", 8.0), ("bicycle", 4.0), ("pedestrian", 4.0))
"""Friction circle of each class on a dry road [m/s²]; a lorry's is that at which it tips over (0.56 g)."""

_CAR_LENGTH, _LORRY_LENGTH = 5.5, 9.0  # [m] up to which a vehicle is a car, and from which it is a lorry or a bus
_NARROW = 1.2  # [m] up to which a vehicle is a motorcycle


@dataclass(frozen=True)
class Fleet:
    """Vehicles by class and size: cars, lorries and buses, motorcycles, bicycles, pedestrians.

    Between 5.5 m and 9 m of length a vehicle is partly a car and partly a lorry.

    Attributes:
        car, lorry, motorcycle, bicycle, pedestrian: Capabilities of each class.
        spread: Acceleration, braking, lock and grip of each vehicle are multiplied by random factors between 1 - spread
            and 1 + spread, others in each scenario and the same in all of its episodes.
        seed: Seed of the factors.
    """

    car: Drive = CAR
    lorry: Drive = LORRY
    motorcycle: Drive = MOTORCYCLE
    bicycle: Drive = BICYCLE
    pedestrian: Drive = PEDESTRIAN
    spread: float = 0.0
    seed: int = 0

    def __post_init__(self) -> None:
        check_settings(self)
        if not 0.0 <= self.spread < 1.0:
            raise BadParameter(f"spread={self.spread}; expected a share in [0, 1)")

    def numbers(self, object_type: UInt8, size: Array) -> Float64:
        """Return the numbers of ``Drive`` and the grip of N objects (N, 10), grip last.

        Args:
            object_type: (N,) codes of ``ObjectType``.
            size: (N, 3) length, width, height [m].
        """
        classes = np.array([(*astuple(getattr(self, name)), grip) for name, grip in GRIP])
        car, lorry, motorcycle, bicycle, pedestrian = classes
        share = np.clip((size[:, 0] - _CAR_LENGTH) / (_LORRY_LENGTH - _CAR_LENGTH), 0.0, 1.0)[:, None]
        found = (1.0 - share) * car + share * lorry
        found[(object_type == ObjectType.VEHICLE) & (size[:, 1] < _NARROW)] = motorcycle
        found[object_type == ObjectType.CYCLIST] = bicycle
        found[object_type == ObjectType.PEDESTRIAN] = pedestrian
        if self.spread:
            names = [each.name for each in fields(Drive)]
            varied = [*map(names.index, ("max_steer", "acceleration", "braking")), len(names)]
            rng = np.random.default_rng([self.seed, zlib.crc32(np.ascontiguousarray(size).tobytes())])
            found[:, varied] *= rng.uniform(1.0 - self.spread, 1.0 + self.spread, (len(found), len(varied)))
        return np.asarray(found)
