"""Score submissions against the recordings in a lake, with the ceiling and the floor of their scenarios."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

from scenarionet_data.errors import BadParameter, ScenarioNetError, SourceError
from scenarionet_data.execution.executors import Executor, run_serially
from scenarionet_data.execution.progress import Progress
from scenarionet_data.lake.lake import Lake
from scenarionet_sim.metrics.wosac.scoring import (
    CONFIGURATIONS,
    Score,
    challenge_steps,
    constant_velocity_rollouts,
    is_generation,
    log_rollouts,
    mean_score,
    score,
)
from scenarionet_sim.metrics.wosac.submission import ScenarioRollouts, count_scenarios, read_submission

NUM_ROLLOUTS = 32
"""Rollouts of each scenario that the challenge asks for."""


@dataclass(frozen=True)
class ScoredScenario:
    """Scores of one scenario.

    Attributes:
        scenario_id: Its id in the lake; that of the source if the lake does not have it.
        submitted: Score of the submission; None if it cannot be scored.
        ceiling: Score of the recording itself. It is below 1, because values are compared by histograms, and because
            objects that are no longer observed stay where they are.
        floor: Score of constant velocity.
        error: Why it cannot be scored.
        num_rollouts: Rollouts of the scenario; the challenge asks for 32.
    """

    scenario_id: str
    submitted: Score | None = None
    ceiling: Score | None = None
    floor: Score | None = None
    error: str | None = None
    num_rollouts: int = NUM_ROLLOUTS


@dataclass(frozen=True)
class SubmissionReport:
    """Scores of a submission.

    Attributes:
        scenarios: Every scenario, in the order of the submission.
        submitted, ceiling, floor: Means over the scenarios that could be scored.
    """

    scenarios: tuple[ScoredScenario, ...]
    submitted: Score
    ceiling: Score
    floor: Score

    @property
    def broken(self) -> tuple[tuple[str, str], ...]:
        """Scenario and reason of those that could not be scored."""
        return tuple((each.scenario_id, each.error) for each in self.scenarios if each.error is not None)

    @property
    def above_floor(self) -> list[float]:
        """How much higher the realism of each scenario is than that of constant velocity."""
        return [each.submitted.realism - each.floor.realism for each in self.scenarios if each.submitted and each.floor]

    @property
    def note(self) -> str | None:
        """Why the scores are none of the challenge; None if they are."""
        others = [each for each in self.scenarios if each.num_rollouts != NUM_ROLLOUTS]
        if not others:
            return None
        return (
            f"{len(others)} of {len(self.scenarios)} scenarios have other than {NUM_ROLLOUTS} rollouts, for example "
            f"{others[0].scenario_id} {others[0].num_rollouts}: these are no scores of the challenge, and with fewer "
            "rollouts they come out differently"
        )


@dataclass(frozen=True, eq=False)
class _Job:
    """One scenario to score; picklable."""

    lake: str
    number: int
    rollouts: ScenarioRollouts
    configuration: str
    official: bool


def score_submission(
    lake: str | Path,
    rollouts: str | Path,
    configuration: str = "sim-agents-2025",
    *,
    official: bool = True,
    executor: Executor = run_serially,
    on_progress: Progress | None = None,
) -> SubmissionReport:
    """Score every scenario of a submission.

    Args:
        lake: The lake with the recordings, its folder or URL.
        rollouts: The submission: a file, a folder of files, or an archive, see :func:`read_submission`.
        configuration: A name of CONFIGURATIONS.
        official: Reproduce the owner's choice of the nearest lane.
        executor: Where scenarios are scored.
        on_progress: Called after each scenario.

    Raises:
        BadParameter: No such configuration.
        SourceError: The submission cannot be read, or none of its scenarios can be scored.
    """
    if configuration not in CONFIGURATIONS:
        raise BadParameter(f"no configuration {configuration!r}; choose one of {', '.join(CONFIGURATIONS)}")
    done: dict[int, ScoredScenario] = {}
    total = count_scenarios(rollouts)
    jobs = (
        _Job(str(lake), number, each, configuration, official) for number, each in enumerate(read_submission(rollouts))
    )
    for number, scored in executor(jobs, _score):
        done[number] = scored
        if on_progress:
            on_progress(len(done), total, len(done))
    scenarios = tuple(done[number] for number in sorted(done))
    whole = [each for each in scenarios if each.submitted and each.ceiling and each.floor]
    if not whole:
        raise SourceError(f"{rollouts}: no scenario can be scored; the first: {scenarios[0].error}")
    submitted, ceiling, floor = (
        mean_score([getattr(each, name) for each in whole]) for name in ("submitted", "ceiling", "floor")
    )
    return SubmissionReport(scenarios, submitted, ceiling, floor)


def _score(job: _Job) -> tuple[int, ScoredScenario]:
    """Score one scenario; on a worker."""
    source_id = job.rollouts.scenario_id
    try:
        lake = Lake(job.lake)
        found = lake.sql(
            """
            SELECT scenario_id
            FROM metadata
            WHERE CASE dataset WHEN 'waymo' THEN source_scenario_id ELSE scenario_id END = $id
            """,
            {"id": source_id},
        ).to_dicts()
        if not found:
            reason = f"the lake has no scenario {source_id}; convert the recordings that hold it"
            return job.number, ScoredScenario(source_id, error=reason)
        scenario = challenge_steps(lake.loader([found[0]["scenario_id"]])[0])
        configuration = CONFIGURATIONS[job.configuration]
        submitted = score(scenario, job.rollouts, configuration, official=job.official)
        generated = is_generation(configuration)
        ceiling, floor = (
            score(
                scenario,
                make(scenario, len(job.rollouts.position), generated=generated),
                configuration,
                official=job.official,
            )
            for make in (log_rollouts, constant_velocity_rollouts)
        )
        return job.number, ScoredScenario(
            scenario.id, submitted, ceiling, floor, num_rollouts=len(job.rollouts.position)
        )
    except ScenarioNetError as error:
        return job.number, ScoredScenario(source_id, error=str(error))
