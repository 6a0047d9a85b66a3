"""The kinematic bicycle in torch: gradients of motion and reward with respect to actions and initial states.

The law is that of :mod:`.bicycle_kernels`, substep by substep, and equal to it within rounding. It is smooth but for
its limits (friction circle, speed, angle and rate of the wheels), where it has the gradient of one side. Of the reward,
progress and smoothness have gradients; the penalties of contacts and of the end only jump, so :func:`clearance` tells
how far a vehicle is from a contact.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from typing import cast

import torch
from torch import Tensor

from scenarionet_data.errors import BadParameter
from scenarionet_sim.arrays.log import ARC, HEADING, VX, VY
from scenarionet_sim.backends.base import CONTROL_STEP, Drive
from scenarionet_sim.backends.kinematic import Kinematic
from scenarionet_sim.task.task import Reward


@dataclass(frozen=True)
class DifferentiableVehicle:
    """Vehicles of the same capabilities and size.

    Attributes:
        backend: Their capabilities, those of one ``Drive``.
        length: Of the box [m].
        dt: Time from one action to the next [s].
    """

    backend: Kinematic = field(default_factory=Kinematic)
    length: float = 4.6
    dt: float = CONTROL_STEP

    def __post_init__(self) -> None:
        if not isinstance(self.backend.drive, Drive):
            raise BadParameter(f"drive={self.backend.drive!r}; expected a Drive, as the vehicles are all the same")

    @property
    def _drive(self) -> Drive:
        return cast(Drive, self.backend.drive)

    def rollout(self, motion: Tensor, actions: Tensor) -> Tensor:
        """Return the motion (..., T + 1, 7) that follows from actions, the first wheels straight.

        Args:
            motion: (..., 7) x, y, z [m], heading [rad], vx, vy [m/s], yaw rate [rad/s].
            actions: (..., T, 2) see :meth:`drive`.
        """
        motions, angle = [motion], torch.zeros_like(motion[..., 0])
        for action in actions.unbind(-2):  # each state depends on the one before
            motion, angle = self.drive(motion, angle, action)
            motions.append(motion)
        return torch.stack(motions, -2)

    def drive(self, motion: Tensor, angle: Tensor, action: Tensor) -> tuple[Tensor, Tensor]:
        """Return motion and angle of the front wheels after one control step; see ``bicycle_kernels``.

        Args:
            motion: (..., 7) as for :meth:`rollout`.
            angle: (...) of the front wheels [rad].
            action: (..., 2) in [-1, 1] steering (positive left) and throttle.
        """
        drive, grip, h = self._drive, self.backend.grip, self.dt / self.backend.substeps
        wheelbase, reach = drive.wheelbase * max(self.length, 1.0), drive.steering_rate * h
        wanted, throttle = drive.max_steer * action[..., 0], action[..., 1]
        x, y, z, heading, vx, vy, turn = motion.unbind(-1)
        cos, sin = torch.cos(heading), torch.sin(heading)
        forward, left = cos * vx + sin * vy, cos * vy - sin * vx
        speed = torch.copysign(_norm(vx, vy), forward)
        moves = forward != 0.0
        slip = torch.where(moves, torch.atan(left / torch.where(moves, forward, 1.0)), 0.0)
        for _ in range(self.backend.substeps):
            angle = torch.minimum(torch.maximum(wanted, angle - reach), angle + reach)
            steered = torch.atan(torch.tan(angle) / 2.0)
            sharpest = torch.tan(angle) * torch.cos(steered) / wheelbase
            push = self._push(speed, throttle, h)
            swing = speed * sharpest * h + steered - slip
            bend = torch.abs(swing * speed) / h
            asked = _norm(push, bend)
            slides = asked > grip
            share = grip / torch.where(slides, asked, grip)
            sliding = (slip + share * swing) / torch.where(slides, 1.0 + 2.0 * speed * h / wheelbase, 1.0)
            curvature = torch.where(slides, 2.0 * torch.sin(sliding) / wheelbase, sharpest)
            across = (torch.abs(angle) - torch.abs(torch.atan(curvature * wheelbase))).clamp(min=0.0)
            lost = torch.copysign(0.5 * share * bend * torch.sin(across), speed)
            push, slip = torch.where(slides, share * push - lost, push), torch.where(slides, sliding, steered)
            resisting = (drive.drag * speed * speed + drive.rolling) * h
            speed = speed + push * h - torch.copysign(torch.minimum(resisting, torch.abs(speed)), speed)
            turn = speed * curvature
            course = heading + turn * h / 2.0 + slip
            x, y = x + speed * torch.cos(course) * h, y + speed * torch.sin(course) * h
            heading = heading + turn * h
        vx, vy = speed * torch.cos(heading + slip), speed * torch.sin(heading + slip)
        turns = torch.floor((heading.detach() + math.pi) / (2.0 * math.pi))
        return torch.stack((x, y, z, heading - 2.0 * math.pi * turns, vx, vy, turn), -1), angle

    def _push(self, speed: Tensor, throttle: Tensor, h: float) -> Tensor:
        """Return the acceleration that engine or brakes ask for [m/s²]."""
        drive = self._drive
        engine = torch.minimum(drive.acceleration * throttle, (drive.max_speed - speed) / h).clamp(min=0.0)
        braked = -torch.copysign(torch.minimum(-drive.braking * throttle, torch.abs(speed) / h), speed)
        backwards = torch.maximum(drive.acceleration * throttle, (-drive.reverse - speed) / h).clamp(max=0.0)
        has_reverse = (speed <= 0.0) & (drive.reverse > 0.0)
        return torch.where(throttle >= 0.0, engine, torch.where(has_reverse, backwards, braked))


def step_rewards(motions: Tensor, actions: Tensor, path: Tensor, reward: Reward) -> Tensor:
    """Return what each step is rewarded for progress and smoothness (..., T), while the agent drives on its route.

    Args:
        motions: (..., T + 1, 7) see :meth:`DifferentiableVehicle.rollout`.
        actions: (..., T, 2).
        path: (P, 5) the route, see ``worlds.paths.Paths.path``; of at least two points, and not near itself again.
        reward: The weights.
    """
    arc = arc_along(motions[..., :2], path)
    speed = _norm(motions[..., 1:, VX], motions[..., 1:, VY])
    is_fast = speed >= reward.slow
    smoothness = (1.0 / torch.where(is_fast, speed, 1.0) - torch.abs(actions[..., 0])).clamp(max=0.0)
    progress = reward.displacement * (arc[..., 1:] - arc[..., :-1])
    return progress + reward.smoothness * torch.where(is_fast, smoothness, 0.0)


def arc_along(points: Tensor, path: Tensor) -> Tensor:
    """Return the arc length (...) [m] of the point of a path (P, 5) nearest to each point (..., 2) [m].

    As ``worlds.path_kernels.nearest``, which searches near the last location only: beyond the ends the path goes on.
    """
    start, step = path[:-1, :2], path[1:, :2] - path[:-1, :2]
    length = _norm(step[:, 0], step[:, 1]).clamp(min=1e-9)
    away = points[..., None, :] - start
    along = (away * step).sum(-1) / length
    apart = (away * away).sum(-1) - along * along + (along - along.clamp(min=torch.zeros_like(length), max=length)) ** 2
    k = apart.detach().argmin(-1, keepdim=True)
    last, found = len(length) - 1, along.gather(-1, k)
    low = torch.where(k == 0, -torch.inf, 0.0)
    high = torch.where(k == last, torch.inf, length[k])
    return (path[:-1, ARC][k] + torch.minimum(torch.maximum(found, low), high))[..., 0]


def clearance(motion: Tensor, size: Tensor, others: Tensor, other_size: Tensor) -> Tensor:
    """Return how far boxes are apart along the best of their axes (...) [m]; below 0 they overlap.

    The smallest distance of the boxes is that, or more where corners are nearest (separating axes: Gottschalk 1996).

    Args:
        motion, others: (..., 7) of either box.
        size, other_size: (..., 2 or more) length and width [m].
    """
    dx, dy = others[..., 0] - motion[..., 0], others[..., 1] - motion[..., 1]
    turned = others[..., HEADING] - motion[..., HEADING]
    c, s = torch.abs(torch.cos(turned)), torch.abs(torch.sin(turned))
    gaps = []
    for box, (length, width), (far_length, far_width) in (
        (motion, size[..., :2].unbind(-1), other_size[..., :2].unbind(-1)),
        (others, other_size[..., :2].unbind(-1), size[..., :2].unbind(-1)),
    ):
        cos, sin = torch.cos(box[..., HEADING]), torch.sin(box[..., HEADING])
        gaps.append(torch.abs(cos * dx + sin * dy) - 0.5 * (length + c * far_length + s * far_width))
        gaps.append(torch.abs(cos * dy - sin * dx) - 0.5 * (width + s * far_length + c * far_width))
    return torch.stack(gaps).amax(0)


def _norm(x: Tensor, y: Tensor) -> Tensor:
    """Return the length of vectors, with a gradient of 0 at length 0."""
    square = x * x + y * y
    return torch.where(square > 0.0, torch.sqrt(torch.where(square > 0.0, square, 1.0)), 0.0)
