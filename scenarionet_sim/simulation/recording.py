"""Recording of episodes: the moments of the worlds of W slots, one after another."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from scenarionet_data.arrays.dtypes import Bool, Float64, Int64, IntP, UInt8
from scenarionet_data.compiled.decorators import device_function, kernel
from scenarionet_sim.arrays.structures import EGO, NUM_OBJECTS, StateArrays
from scenarionet_sim.task.scoring_kernels import COMPLETION, StepResult


class EpisodeArrays(NamedTuple):
    """Recorded episodes of W slots: up to M moments of up to N objects.

    Attributes:
        motion: (W, M, N, 7) as in ``StateArrays``.
        present, contacts: (W, M, N) present objects, and those that the agent touches.
        arc: (W, M) arc length of the agent on its path [m].
        last: (W,) the last recorded moment.
        end_step: (W,) the first moment with a status, or the last one.
        num_scored: (W,) steps that metrics look at.
        status: (W,) how the episode ended, 0 until then.
        completion: (W,) completed share of the agent's route.
        waits: (W,) whether the episode goes on after these steps until it has a status.
        is_over: (W,) whether all of it is recorded.
    """

    motion: Float64
    present: Bool
    contacts: Bool
    arc: Float64
    last: Int64
    end_step: Int64
    num_scored: Int64
    status: UInt8
    completion: Float64
    waits: Bool
    is_over: Bool

    @classmethod
    def of(cls, num_slots: int, num_moments: int, num_objects: int) -> EpisodeArrays:
        """Return room for episodes; moments that are not written to take no memory."""
        last, end_step, num_scored = np.zeros((3, num_slots), np.int64)
        present, contacts = np.empty((2, num_slots, num_moments, num_objects), np.bool_)
        waits, is_over = np.ones((2, num_slots), np.bool_)
        return cls(
            np.empty((num_slots, num_moments, num_objects, 7)), present, contacts, np.empty((num_slots, num_moments)),
            last, end_step, num_scored, np.zeros(num_slots, np.uint8), np.zeros(num_slots), waits, is_over,
        )  # fmt: skip


NOT_RECORDED = EpisodeArrays.of(0, 0, 0)


@kernel(allocates=False)
def record_moments(
    slots: IntP,
    place: Int64,
    now: StateArrays,
    route: Float64,
    contacts: Bool,
    result: StepResult,
    episodes: EpisodeArrays,
) -> None:
    """Append the current moment of some slots (K,); see :func:`record_moment`."""
    for k in range(len(slots)):
        record_moment(slots[k], place, now, route, contacts, result, episodes)


@device_function
def record_moment(
    w: int,
    place: Int64,
    now: StateArrays,
    route: Float64,
    contacts: Bool,
    result: StepResult,
    episodes: EpisodeArrays,
) -> None:
    """Append the current moment of a slot, which has one agent: the ego.

    Args:
        w: The slot.
        place: See ``Recorded``.
        now: The state.
        route: (W, N, 2) location of the agents on their paths.
        contacts: (W, N) objects that they touch.
        result: Results of the step.
        episodes: With room for the moment.
    """
    m = episodes.last[w] + 1
    episodes.last[w] = m
    for n in range(place[w, NUM_OBJECTS]):
        for column in range(now.motion.shape[2]):
            episodes.motion[w, m, n, column] = now.motion[w, n, column]
        episodes.present[w, m, n], episodes.contacts[w, m, n] = now.present[w, n], contacts[w, n]
    episodes.arc[w, m] = route[w, place[w, EGO], 0]
    episodes.completion[w] = result.numbers[COMPLETION, w]
    if m and not episodes.status[w]:
        episodes.status[w], episodes.end_step[w] = result.status[w], m
    is_decided = episodes.status[w] != 0 or not episodes.waits[w]
    episodes.is_over[w] = m >= episodes.num_scored[w] and is_decided
