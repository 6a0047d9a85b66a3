"""The connection to a driving stack: one clock, lockstep or real time, and what happens if it does not answer."""

from __future__ import annotations

import math
import time
from dataclasses import dataclass, field, replace
from typing import Protocol

from scenarionet_data.arrays.dtypes import Array
from scenarionet_data.errors import SourceError
from scenarionet_sim.bridges.commands import Command, drive
from scenarionet_sim.bridges.inbox import ROOM
from scenarionet_sim.planners.base import Action, Trajectory
from scenarionet_sim.planners.view import View

LIMIT = 10.0
"""Longest wait for an answer [s]."""

AGAIN = 0.5
"""A moment without an answer is sent again after this time [s]: stacks start late, and are restarted."""

GONE = 0.2
"""Longest wait for a stack that did not answer the moment before [s]."""

SILENT = 2.0
"""Longest time that a vehicle in real time drives by its last command [s]."""

NS = 1e9


@dataclass(frozen=True, eq=False)
class StackMoment:
    """What a stack is sent.

    Attributes:
        view: The moment, in the scenario's frame.
        stamp: Its time on the stack's clock [ns].
        is_first: Whether a scenario begins.
        seen: What the sensors see, by name of the sensor.
        is_ready: Whether the stack drives; before, the clock runs and the scene stands.
        until: When it is over on the wall clock [s, monotonic]; 0 in lockstep.
    """

    view: View
    stamp: int
    is_first: bool
    seen: dict[str, Array] = field(default_factory=dict)
    is_ready: bool = True
    until: float = 0.0


class Transport(Protocol):
    """Speaks to stacks of one kind: makes messages of moments, and commands of messages.

    Attributes:
        where: What it speaks, on which topics and where, for errors.
    """

    where: str

    def begin(self, moment: StackMoment, until: float) -> int:
        """Make the stack ready for a scenario, and return the stamp [ns] of its first moment, now or later.

        Raises:
            SourceError: It is not ready at ``until`` [s, monotonic].
        """
        ...

    def send(self, moment: StackMoment) -> None:
        """Send a moment."""
        ...

    def take(self, until: float) -> tuple[int, Command] | None:
        """Return stamp [ns] and command of the oldest answer; None if none comes before ``until`` [s, monotonic].

        Raises:
            SourceError: What came is no answer, or the stack has hung up.
        """
        ...

    def close(self) -> None:
        """Let go of ports and threads."""
        ...


class Link:
    """The connection of this process to a stack.

    A stack that leaves a moment without an answer costs ``limit`` once: until it answers again, later scenarios wait
    only GONE, and ``limit`` if a late answer shows that it lives.

    Args:
        transport: Speaks to it.
        limit: Longest wait for an answer [s].
        is_realtime: Whether the simulation keeps to the wall clock, and drives by the newest command.

    Attributes:
        stamp: Of the latest moment [ns]; it only rises, as nodes refuse messages from before their last one.
        num_late: Moments of real time that came late, as the simulation was slower than the clock.
    """

    def __init__(self, transport: Transport, limit: float = LIMIT, *, is_realtime: bool = False) -> None:
        self.transport, self.limit, self.is_realtime = transport, limit, is_realtime
        self.stamp = self.num_late = 0
        self._unanswered: int | None = None
        self._began = 0
        self._due = self._heard = 0.0
        self._held: tuple[int, Command] | None = None

    def ask(self, view: View, seen: dict[str, Array], *, is_first: bool) -> Action | Trajectory:
        """Send a moment and return what the stack tells the vehicle to do.

        Raises:
            SourceError: No answer comes in time, or one is no message.
            BadParameter: A number is not finite, or a plan is no trajectory.
        """
        self.stamp += round(view.dt * NS)
        moment = StackMoment(view, self.stamp, is_first, seen)
        if is_first:
            self._held = None
            self.stamp = self._began = self.transport.begin(moment, time.monotonic() + self.limit)
            if self.stamp > moment.stamp:
                self._unanswered = None  # it has got ready
            moment = replace(moment, stamp=self.stamp)
        if self._held is None or not self.is_realtime:
            self._held = self.stamp, self._answer(moment)
            self._due = self._heard = time.monotonic()
        else:
            self._keep_pace(moment)
        stamp, command = self._held
        return drive(command, view, (self.stamp - stamp) / NS)

    def _answer(self, moment: StackMoment) -> Command:
        """Wait for the answer with the stamp of a moment."""
        started, others = time.monotonic(), 0
        end = started + (self.limit if self._unanswered is None else min(GONE, self.limit))
        while (now := time.monotonic()) < end:
            self.transport.send(moment)
            until = min(now + AGAIN, end)
            while (received := self.transport.take(until)) is not None:
                stamp, command = received
                if stamp == self.stamp:
                    self._unanswered = None
                    return command
                others += 1
                if self._unanswered is not None and self._unanswered <= stamp < self.stamp:
                    end = started + self.limit
                if time.monotonic() >= end:
                    break
        before = self._unanswered
        self._unanswered = before or self.stamp
        raise SourceError(
            f"the stack did not answer the moment {self.stamp / NS:g} s within {end - started:.3g} s over "
            f"{self.transport.where}"
            + (f", nor any since {before / NS:g} s" if before else "")
            + (
                f"; {others} messages had other stamps: answer with that of the moment"
                if others
                else "; is it running?"
            )
        )

    def _keep_pace(self, moment: StackMoment) -> None:
        """Send a moment, wait until its timestep is over on the wall clock, and keep the newest command until then."""
        dt = moment.view.dt
        self._due += dt
        self.transport.send(replace(moment, until=self._due))
        for _ in range(ROOM):
            received = self.transport.take(self._due)
            if received is None:
                break
            if self._began <= received[0] <= self.stamp:
                self._held, self._heard = received, time.monotonic()
        time.sleep(max(self._due - time.monotonic(), 0.0))  # after a flood
        now = time.monotonic()
        if now - self._heard > min(SILENT, self.limit):
            self._unanswered = self.stamp
            raise SourceError(
                f"the stack sent no command for {now - self._heard:.3g} s over {self.transport.where}; is it running?"
            )
        if now > self._due + dt:
            self.num_late += math.floor((now - self._due) / dt)
            self._due = now
