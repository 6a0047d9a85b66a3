"""Driver models with known limits, by which UN Regulation 157 says what a careful driver can avoid.

Each answers in every timestep how the ego accelerates, from the road users ahead in the frame of its route. Sources:
UN Regulation 157 (ALKS), annex 3; Mattas et al., "Driver models for the definition of safety requirements of automated
vehicles in international regulations" (2022); Shalev-Shwartz et al., "On a formal model of safe and scalable
self-driving cars" (2017). Parameters and the order of decisions are those of esmini's controllers (ALKS_R157SM,
MPL-2.0), with which the tests compare; where it errs, the source holds: see the guide.
"""

from __future__ import annotations

import math
from abc import ABC, abstractmethod
from collections.abc import Sequence
from dataclasses import dataclass
from typing import ClassVar

GRAVITY = 9.81
_TINY = 1e-6


@dataclass(frozen=True)
class Ahead:
    """A road user ahead of the ego, in the frame of its route.

    Attributes:
        id: Its track.
        is_pedestrian: Whether it walks.
        gap: From bumper to bumper along the route [m]; 0 if beside.
        aside: Between the sides across the route [m]; 0 if they overlap.
        lane: Lanes to the left of the ego's; 0 if in the same.
        lateral: Offset of its centre from the route, to the left [m].
        offset: Offset of its centre from its lane's, to the left [m].
        speed: Along the route [m/s].
        closing: How much faster the ego is along the route [m/s].
        nearing: Speed across the route towards the ego [m/s].
        acceleration: Along the route [m/s^2].
        covers: Whether its width is within the ego's or covers it, to 0.1 m.
    """

    id: str
    is_pedestrian: bool
    gap: float
    aside: float
    lane: int
    lateral: float
    offset: float
    speed: float
    closing: float
    nearing: float
    acceleration: float
    covers: bool

    @property
    def time_to_collision(self) -> float:
        """[s], infinite if the ego is not faster."""
        return self.gap / self.closing if self.closing > 0 else math.inf


def covers(lateral: float, half_width: float, own: float, tolerance: float = 0.1) -> bool:
    """Whether an object's width is within the ego's, or the ego's within the object's.

    Args:
        lateral: Offset of its centre from the ego's [m].
        half_width, own: Half widths across the route, of the object and of the ego [m].
        tolerance: [m].
    """
    low, high = lateral - half_width, lateral + half_width
    is_within = low > -own - tolerance and high < own + tolerance
    return is_within or (low < -own + tolerance and high > own - tolerance)


class SafetyModel(ABC):
    """Keeps its speed until it must brake.

    Attributes:
        reaction: Time until it brakes [s].
        deceleration: Largest [m/s^2].
        range: How far it sees [m].
        jerk: Largest of braking [m/s^3].
    """

    reaction: ClassVar[float] = 0.75
    deceleration: ClassVar[float] = 0.774 * GRAVITY
    range: ClassVar[float] = 100.0
    jerk: ClassVar[float] = 12.65

    def __init__(self) -> None:
        self.acceleration = 0.0
        self._is_critical = False
        self._waits = 0.0

    def step(self, speed: float, ahead: Sequence[Ahead], dt: float) -> float:
        """Return the acceleration in the next ``dt`` seconds [m/s^2].

        Args:
            speed: Of the ego [m/s].
            ahead: What is ahead, in any lane.
            dt: [s].
        """
        seen = [each for each in ahead if each.is_pedestrian or abs(each.lane) < 2]
        threats = [each for each in seen if self.threatens(each, speed)]
        nearest = min(threats, key=lambda each: each.gap, default=None)
        was_critical, self._is_critical = self._is_critical, False
        if nearest is not None and nearest.closing > 0 and nearest.gap > 0:
            self._is_critical = self.must_brake(nearest, speed)
        if not self._is_critical:
            self.acceleration = 0.0
        elif self._is_critical and not was_critical:
            self._waits = self.reaction
        if self._is_critical and self._waits > 0:
            self._waits -= dt
            self.acceleration = min(self.acceleration, 0.0)
        elif self._is_critical:
            self.acceleration = max(self.acceleration - self.jerk * dt, -self.deceleration, -self.wanted)
        return self.acceleration

    wanted: float = math.inf
    """Deceleration that is enough [m/s^2]."""

    @abstractmethod
    def threatens(self, other: Ahead, speed: float) -> bool:
        """Whether a road user is in the ego's lane, or comes into it."""

    @abstractmethod
    def must_brake(self, other: Ahead, speed: float) -> bool:
        """Whether the ego must brake for the nearest of them, which is slower."""


class Rss(SafetyModel):
    """Responsibility-sensitive safety: brakes where the longitudinal and the lateral distance are both unsafe.

    Attributes:
        acceleration_while_reacting: What it may do until it brakes [m/s^2].
        lateral: Lateral acceleration and deceleration of the other one [m/s^2].
        margin: Lateral distance that remains [m].
    """

    acceleration_while_reacting, lateral, margin = 3.0, 1.0, 0.3

    def threatens(self, other: Ahead, speed: float) -> bool:
        """Whether the lateral distance is unsafe."""
        del speed
        if other.lane == 0 or other.aside < _TINY:
            return True
        return other.aside < lateral_distance(abs(other.nearing), self.reaction, self.lateral, self.margin)

    def must_brake(self, other: Ahead, speed: float) -> bool:
        """Whether the longitudinal distance is unsafe."""
        braking = self.deceleration
        return other.gap < longitudinal_distance(
            speed, other.speed, self.reaction, self.acceleration_while_reacting, braking, braking
        )


def longitudinal_distance(
    speed: float, ahead: float, reaction: float, acceleration: float, least_braking: float, most_braking: float
) -> float:
    """Return the safe distance of RSS behind a vehicle that brakes (definition 1) [m].

    Args:
        speed, ahead: Of the vehicle and of the one ahead [m/s].
        reaction: [s], in which it may accelerate by ``acceleration`` [m/s^2].
        least_braking: Of the vehicle, after that [m/s^2].
        most_braking: Of the one ahead [m/s^2].
    """
    after = speed + reaction * acceleration
    distance = speed * reaction + 0.5 * acceleration * reaction**2 + after**2 / (2.0 * least_braking)
    return max(distance - ahead**2 / (2.0 * most_braking), 0.0)


def lateral_distance(nearing: float, reaction: float, acceleration: float, margin: float) -> float:
    """Return the safe lateral distance of RSS to one that comes nearer (definition 6) [m]."""
    after = nearing + acceleration * reaction
    return margin + 0.5 * (nearing + after) * reaction + after**2 / (2.0 * acceleration)


class FuzzySafety(SafetyModel):
    """The fuzzy safety model of the Joint Research Centre: brakes as hard as the distance is unsafe, proactively.

    Attributes:
        comfortable, hard: Decelerations of the ego between which it chooses [m/s^2].
        leading: Deceleration of the one ahead that it expects [m/s^2].
        standstill, margin: Distances that remain [m].
    """

    range = 46.0
    comfortable, hard, leading, standstill, margin = 4.0, 6.0, 7.0, 2.0, 2.0

    def threatens(self, other: Ahead, speed: float) -> bool:
        """Whether it reaches the ego's path before the ego has passed, by their present speeds."""
        if other.lane == 0:
            return True
        if other.nearing <= 0:
            return False
        return other.aside / other.nearing <= other.gap / max(_TINY, speed - other.speed) + 0.1

    def must_brake(self, other: Ahead, speed: float) -> bool:
        """Whether one of the two safety metrics is above 0."""
        critical = self.critical_metric(other.gap, speed, other.speed)
        proactive = self.proactive_metric(other.gap - self.standstill, speed, other.speed)
        if critical > _TINY:
            self.wanted = critical * (self.hard - self.comfortable) + self.comfortable
        else:
            self.wanted = proactive * self.comfortable
        return critical + proactive >= _TINY

    def proactive_metric(self, gap: float, speed: float, ahead: float) -> float:
        """PFS: how unsafe the distance is if the one ahead brakes."""
        rest = speed * self.reaction - ahead**2 / (2.0 * self.leading)
        safe = rest + speed**2 / (2.0 * self.comfortable) + self.margin
        return _share(gap, safe, rest + speed**2 / (2.0 * self.hard))

    def critical_metric(self, gap: float, speed: float, ahead: float) -> float:
        """CFS: how unsafe the distance is if the one ahead goes on at its speed."""
        if speed <= ahead:
            return 0.0
        braking = max(self.acceleration, -self.comfortable)
        then = speed + self.reaction * braking
        if then < ahead:
            return float(gap < (speed - ahead) ** 2 / abs(2.0 * self.acceleration))
        rest = (speed + 0.5 * braking * self.reaction - ahead) * self.reaction
        safe, unsafe = (rest + (then - ahead) ** 2 / (2.0 * each) for each in (self.comfortable, self.hard))
        return _share(gap, safe, unsafe)


def _share(gap: float, safe: float, unsafe: float) -> float:
    """How far a gap is from safe (0) to unsafe (1)."""
    return float(gap <= safe) if safe <= unsafe else min(max((safe - gap) / (safe - unsafe), 0.0), 1.0)


class CarefulHuman(SafetyModel):
    """The competent and careful human driver of UN Regulation 157: perceives, reacts, brakes; with emergency braking.

    A cut-in is perceived where the other one has left its line by 0.375 m and then by 0.72 m more; a cut-out and a
    deceleration of more than 5 m/s^2 for 0.4 s. It brakes after 0.75 s, if the time to collision (cut-in) or the
    headway is then below 2 s. Emergency braking begins at a time to collision of 1.5 s to what is fully ahead.

    Attributes:
        wandering, perceived: Distances across the road [m].
        perceiving: Of cut-outs and decelerations [s].
        critical: Time to collision, and headway [s].
        rise: Time until the deceleration is full [s].
        emergency: Deceleration and time to collision of emergency braking [m/s^2], [s].
    """

    wandering, perceived, perceiving, critical, rise = 0.375, 0.72, 0.4, 2.0, 0.6
    emergency = (0.85 * GRAVITY, 1.5)

    def __init__(self) -> None:
        super().__init__()
        self._phase, self._kind, self._timer = "looks", "", 0.0
        self._focus: tuple[str, str] | None = None
        self._from: dict[str, tuple[float, float]] = {}
        self._seen_at = 0.0
        self._is_emergency = False

    def step(self, speed: float, ahead: Sequence[Ahead], dt: float) -> float:
        """Return the acceleration, see the base class."""
        seen = [each for each in ahead if each.is_pedestrian or abs(each.lane) < 2]
        focus, kind = self._look(seen)
        if focus is not None and kind and (focus.id, kind) != self._focus:
            self._kind = kind
        self._focus = None if focus is None else (focus.id, kind)
        self._perceive(focus, dt)
        if focus is None:
            self._phase, self._kind, self._is_critical = "looks", "", False
        elif speed > _TINY and focus.gap > 0:
            self.judge(focus, speed)
        if focus is not None and focus.covers and focus.time_to_collision < self.emergency[1]:
            self._is_emergency = True
        return self._brake(speed, dt)

    def threatens(self, other: Ahead, speed: float) -> bool:
        """Whether it is in the ego's lane, walks towards the ego, or comes from another lane."""
        del speed
        return self._kind_of(other) != "" or (other.lane == 0 and not other.is_pedestrian)

    def must_brake(self, other: Ahead, speed: float) -> bool:
        """Whether the situation is critical."""
        if self._kind == "cut-in":
            return other.time_to_collision < self.critical
        return other.gap < self.critical * speed

    def _kind_of(self, other: Ahead) -> str:
        """``cut-in``, ``cut-out``, ``braking``, or nothing of these."""
        if other.is_pedestrian:
            return "cut-in" if other.nearing > _TINY else ""
        if other.lane == 0:
            if abs(other.offset) > self.wandering and other.nearing < -_TINY:
                return "cut-out"
            return "braking" if other.acceleration < -5.0 + _TINY else ""
        start, threshold = self._from.get(other.id, (other.lateral, math.inf))
        return "cut-in" if abs(other.lateral - start) > threshold else ""

    def _look(self, seen: Sequence[Ahead]) -> tuple[Ahead | None, str]:
        """The road user that matters, and what it does; what a leaving vehicle reveals matters more than itself."""
        for each in seen:
            if each.nearing < _TINY:
                self._from.pop(each.id, None)
            elif each.id not in self._from:
                beyond = each.lateral * each.offset > 0
                drift = abs(each.offset)
                self._from[each.id] = each.lateral, max(0.0, self.wandering + (drift if beyond else -drift))
        threats = sorted((each for each in seen if self.threatens(each, 0.0)), key=lambda each: each.gap)
        if not threats:
            return None, ""
        first, kind = threats[0], self._kind_of(threats[0])
        revealed = [each for each in threats[1:] if each.lane == 0 and kind == "cut-out"]
        sooner = min(revealed, key=lambda each: each.time_to_collision, default=None)
        if sooner is not None and sooner.time_to_collision < first.time_to_collision:
            return sooner, "cut-out"
        return first, kind

    def _perceive(self, focus: Ahead | None, dt: float) -> None:
        if self._phase == "reacts":
            self._timer -= dt
        elif self._phase == "looks" and focus is not None and self._begins(focus):
            self._phase, self._timer, self._seen_at = "perceives", self.perceiving, focus.lateral
        elif self._phase == "perceives":
            self._timer -= dt
            is_moved = self._kind == "cut-in" and focus is not None and not focus.is_pedestrian
            if abs(focus.lateral - self._seen_at) > self.perceived if is_moved and focus else self._timer < _TINY:
                self._phase, self._timer = "reacts", self.reaction

    def _begins(self, focus: Ahead) -> bool:
        if self._kind == "cut-in":
            return focus.closing > _TINY if focus.is_pedestrian else self._kind_of(focus) == "cut-in" or focus.lane == 0
        if self._kind == "cut-out":
            return focus.closing > _TINY
        return self._kind == "braking" and focus.acceleration < -5.0

    def judge(self, focus: Ahead, speed: float) -> None:
        """Become critical after the reaction, or leave the situation where it is not, or no more."""
        if self.must_brake(focus, speed):
            self._is_critical |= self._phase == "reacts" and self._timer < _TINY
        elif self._phase == "reacts":
            self._phase, self._kind = "looks", ""
        elif self._is_critical and focus.gap > 2.0 + 2.0 * speed:
            self._is_critical = False
            if focus.closing < _TINY:
                self._phase, self._kind = "looks", ""

    def _brake(self, speed: float, dt: float) -> float:
        if not (self._is_critical or self._is_emergency):
            self.acceleration = 0.0
            return 0.0
        if self._phase == "reacts" and self._timer < _TINY:
            self._phase = "brakes"
        if speed < _TINY and (self._phase == "brakes" or self._is_emergency):
            self._phase, self._is_emergency = "looks", False
        if self._phase == "reacts":
            self.acceleration = min(self.acceleration, -0.4)  # the foot is off the pedal
        if self._phase == "brakes":
            self.acceleration -= dt * self.deceleration / self.rise
        if self._is_emergency:
            self.acceleration -= dt * self.emergency[0] / self.rise
        self.acceleration = max(self.acceleration, -(self.emergency[0] if self._is_emergency else self.deceleration))
        return self.acceleration
