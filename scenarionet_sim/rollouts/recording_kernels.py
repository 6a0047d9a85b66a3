"""Recording of episodes: the moments of the worlds of W slots, one after another."""

from __future__ import annotations

from typing import NamedTuple

from scenarionet_data.arrays.dtypes import Bool, Float64, Int64, IntP, UInt8
from scenarionet_data.compiled.decorators import kernel
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
        status: (W,) how the episode ended, 0 until then.
        completion: (W,) completed share of the agent's route.
    """

    motion: Float64
    present: Bool
    contacts: Bool
    arc: Float64
    last: Int64
    end_step: Int64
    status: UInt8
    completion: Float64


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
    """Append the current moment of some slots, which have one agent each: the ego.

    Args:
        slots: (K,) the slots.
        place: See ``Recorded``.
        now: The state.
        route: (W, N, 2) location of the agents on their paths.
        contacts: (W, N) objects that they touch.
        result: Results of the step.
        episodes: With room for the moment.
    """
    for k in range(len(slots)):
        w = slots[k]
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
