"""Stochastic policies, for several rollouts of a scenario: parameters are drawn for each episode."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from scenarionet_data.arrays.dtypes import Bool
from scenarionet_sim.arrays.log import HEADING, VX, VY
from scenarionet_sim.policies.constant_velocity import ConstantVelocity
from scenarionet_sim.policies.idm import Idm
from scenarionet_sim.worlds.world import World


@dataclass(frozen=True)
class SampledIdm(Idm):
    """Like :class:`Idm`, with a driver of its own in each episode.

    Headway, acceleration, comfortable deceleration, gap at rest and lateral acceleration are uniform between a half
    and one and a half times the given values.
    """

    def sampled(self, rng: np.random.Generator) -> SampledIdm:
        """Return the policy of an episode."""
        names = "headway", "acceleration", "deceleration", "standstill", "lateral"
        return replace(self, **{name: getattr(self, name) * rng.uniform(0.5, 1.5) for name in names})


@dataclass(frozen=True)
class NoisyVelocity(ConstantVelocity):
    """Like :class:`ConstantVelocity`, with a speed and a direction that differ a little from the recorded ones.

    Attributes:
        speed: Standard deviation of the speed's factor, in logarithms.
        direction: Standard deviation of the direction [rad].
        seed: Seed of the episode's noise.
    """

    speed: float = 0.2
    direction: float = 0.03
    seed: int = 0

    def sampled(self, rng: np.random.Generator) -> NoisyVelocity:
        """Return the policy of an episode."""
        return replace(self, seed=int(rng.integers(2**32)))

    def prepare(self, world: World, driven: Bool) -> World:
        """Return the world with noisy velocities, which the objects keep from where they appear."""
        world = super().prepare(world, driven)
        rng, log = np.random.default_rng(self.seed), world.log.copy()
        factor = np.exp(self.speed * rng.standard_normal(world.num_objects)).astype(np.float32)
        turn = (self.direction * rng.standard_normal(world.num_objects)).astype(np.float32)
        vx, vy = (world.log[:, driven, column] * factor[driven] for column in (VX, VY))
        cos, sin = np.cos(turn[driven]), np.sin(turn[driven])
        log[:, driven, VX], log[:, driven, VY] = cos * vx - sin * vy, sin * vx + cos * vy
        log[:, driven, HEADING] += np.where(np.hypot(vx, vy) > 0.0, turn[driven], 0.0)
        return replace(world, log=log)
