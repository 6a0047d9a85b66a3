"""Motions of half a second as tokens: the words of a model of traffic, chosen from recorded motions.

Tokens are recorded motions none of which is near another (k-disks, Philion et al. 2024,
https://arxiv.org/abs/2312.04535): one is drawn, all motions within a radius are dropped, and so on. Two motions are as
far apart as the corners of a box are on average that ends them.
"""

from __future__ import annotations

import torch
from torch import Tensor

from scenarionet_data.generation.frames import relative

STEPS, STEP = 5, 0.1
"""Timesteps of a token, and their length [s]."""

KINDS = ("VEHICLE", "PEDESTRIAN", "CYCLIST")
"""Road users that have tokens, by their number: names of ``ObjectType``."""

BOXES = torch.tensor([[4.8, 2.0], [1.0, 1.0], [2.0, 1.0]])
"""Length and width of the box that measures distances, by kind [m]."""


def corners(poses: Tensor, box: Tensor) -> Tensor:
    """Return the corners (..., 4, 2) of boxes, length and width (..., 2), at poses (..., 3) [m]."""
    half = torch.tensor([[0.5, 0.5], [0.5, -0.5], [-0.5, -0.5], [-0.5, 0.5]], device=poses.device)
    x, y = (half * box[..., None, :]).unbind(dim=-1)
    cos, sin = poses[..., 2:].cos(), poses[..., 2:].sin()
    return torch.stack([poses[..., :1] + cos * x - sin * y, poses[..., 1:2] + sin * x + cos * y], dim=-1)


def apart(first: Tensor, second: Tensor) -> Tensor:
    """Return how far corners (..., 4, 2) are from others on average (...) [m]."""
    return (first - second).square().sum(dim=-1).sqrt().mean(dim=-1)


def choose_tokens(paths: Tensor, box: Tensor, number: int, radius: float, generator: torch.Generator) -> Tensor:
    """Return at most ``number`` paths, whose ends are further than ``radius`` apart; fewer if all others are near them.

    Args:
        paths: (M, STEPS, 3) motions, each in the frame of its beginning.
        box: (2,) length and width [m].
        number: Largest number of tokens.
        radius: Of a disk [m].
        generator: Draws the order in which motions are looked at.
    """
    left = paths[torch.randperm(len(paths), generator=generator).to(paths.device)]
    ends = corners(left[:, -1], box)
    chosen: list[Tensor] = []
    while len(left) and len(chosen) < number:
        chosen.append(left[0])
        is_far = apart(ends, ends[:1]) > radius
        left, ends = left[is_far], ends[is_far]
    return torch.stack(chosen) if chosen else paths[:0]


def motions(poses: Tensor, valid: Tensor) -> Tensor:
    """Return all motions (M, STEPS, 3) of objects in the frames of their beginnings.

    Args:
        poses: (A, T, 3) at every timestep.
        valid: (A, T).
    """
    whole = valid.unfold(1, STEPS + 1, 1).all(dim=-1)
    parts = poses.unfold(1, STEPS + 1, 1)[whole].transpose(1, 2)
    return relative(parts[:, :1], parts[:, 1:])
