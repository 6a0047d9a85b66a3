"""Poses in frames of other poses, and what is near them: what learns to drive sees nothing else."""

from __future__ import annotations

import torch
from torch import Tensor, nn

X, Y, HEADING = range(3)
"""Columns of a pose [m], [m], [rad]."""

_METRES, _LENGTH, _WIDTH = 20.0, 5.0, 2.0  # scales of inputs


def relative(frames: Tensor, poses: Tensor) -> Tensor:
    """Return x, y and heading of poses in frames, both (..., 3 or more); the heading in [-pi, pi)."""
    cos, sin = frames[..., HEADING].cos(), frames[..., HEADING].sin()
    dx, dy = poses[..., X] - frames[..., X], poses[..., Y] - frames[..., Y]
    turn = torch.remainder(poses[..., HEADING] - frames[..., HEADING] + torch.pi, 2 * torch.pi) - torch.pi
    return torch.stack([cos * dx + sin * dy, cos * dy - sin * dx, turn], dim=-1)


def composed(frames: Tensor, poses: Tensor) -> Tensor:
    """Return poses (..., 3) that are given in frames (..., 3) in the frame of these, the inverse of `relative`."""
    cos, sin = frames[..., HEADING].cos(), frames[..., HEADING].sin()
    x = frames[..., X] + cos * poses[..., X] - sin * poses[..., Y]
    y = frames[..., Y] + sin * poses[..., X] + cos * poses[..., Y]
    turn = torch.remainder(frames[..., HEADING] + poses[..., HEADING] + torch.pi, 2 * torch.pi) - torch.pi
    return torch.stack([x, y, turn], dim=-1)


def place(frames: Tensor, found: Tensor) -> Tensor:
    """Return (Q, k, 6) scaled positions, far and near, and directions of poses (Q, k, 3 or more) in frames (Q, ...)."""
    x, y, turn = relative(frames[..., None, :], found).unbind(dim=-1)
    near = (x / _LENGTH).tanh(), (y / _WIDTH).tanh()
    return torch.stack([x / _METRES, y / _METRES, *near, turn.cos(), turn.sin()], dim=-1)


def two_layers(size: int, out: int, hidden: int | None = None) -> nn.Sequential:
    """Return a network with one hidden layer, by default as wide as the last one."""
    hidden = hidden or out
    return nn.Sequential(nn.Linear(size, hidden), nn.ReLU(), nn.Linear(hidden, out))
