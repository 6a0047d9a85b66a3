"""``scenarionet forecast score``: score predicted trajectories, or rollouts for the Waymo Open Sim Agents Challenge."""

from __future__ import annotations

from dataclasses import asdict
from tempfile import TemporaryDirectory
from typing import TYPE_CHECKING

import click

from scenarionet_pipelines.cli import forecast_scores
from scenarionet_pipelines.cli.advice import one_line
from scenarionet_pipelines.cli.execution import executor_from_options
from scenarionet_pipelines.cli.group import verb
from scenarionet_pipelines.cli.output import count, print_json, print_table
from scenarionet_pipelines.cli.parameters import (
    cluster_option,
    json_option,
    lake_argument,
    quiet_option,
    workers_option,
)
from scenarionet_pipelines.cli.progress import ProgressDisplay

if TYPE_CHECKING:
    from scenarionet_sim.metrics.wosac import Score, SubmissionReport

_MAX_EXAMPLES = 5


@verb(
    "score",
    "scenarionet forecast score lake predictions.parquet --by has_intersection -o scores.parquet",
    "scenarionet forecast score lake predictions.parquet --event cut_in",
    "scenarionet forecast score lake --rollouts submission.tar.gz",
    "scenarionet forecast score lake --rollouts submission.binproto --configuration sim-agents-2024 --json",
    "scenarionet forecast score lake --run all-constant-noisy-constant-noisy-kinematic-wosac -o submission.binproto",
)
@lake_argument
@click.argument("predictions", required=False, type=click.Path(dir_okay=False))
@click.option(
    "--by",
    metavar="SQL",
    help="Of predictions: group them by an expression over the scores and `metadata`. [default: object_type]",
)
@click.option("--event", metavar="EVENT", help="Of predictions: group them by whether it happens, for example cut_in.")
@click.option(
    "--rollouts",
    metavar="PATH",
    help="Score a submission: a binary SimAgentsChallengeSubmission, a folder of them, or a .tar.gz archive.",
)
@click.option("--run", metavar="NAME", help="Score this run of `sim --episode wosac --rollouts 32` instead.")
@click.option("-o", "--output", metavar="FILE", help="Write the scores of each target, or the rollouts of --run.")
@click.option(
    "--configuration",
    type=click.Choice(["sim-agents-2025", "sim-agents-2024", "scenario-generation-2025"]),
    default="sim-agents-2025",
    show_default=True,
    help="Weights and bins of the challenge.",
)
@click.option(
    "--right-lanes",
    is_flag=True,
    help="Look for the lane of a vehicle correctly, unlike the owner's code; red lights count differently.",
)
@workers_option
@cluster_option
@json_option
@quiet_option
def command(
    lake: str,
    predictions: str | None,
    by: str | None,
    event: str | None,
    rollouts: str | None,
    run: str | None,
    output: str | None,
    configuration: str,
    right_lanes: bool,
    workers: int | None,
    cluster: str | None,
    as_json: bool,
    quiet: bool,
) -> None:
    """Score predicted trajectories, or rollouts of simulated agents, against the recordings.

    PREDICTIONS is a Parquet file with a row per target and mode (schemas/predictions.toml); the scores are those of
    Argoverse, nuScenes and the Waymo Open Motion challenge.

    Rollouts are scored as the Waymo Open Sim Agents Challenge does. Beside the submission stand the ceiling, the score
    of the recordings themselves, and the floor, the score of constant velocity, on the same scenarios. The lake needs
    the Waymo scenarios of the submission.
    """
    from scenarionet_data import Lake
    from scenarionet_data.execution.executors import executor_for
    from scenarionet_pipelines.machine import default_workers
    from scenarionet_sim.metrics.wosac import rollouts_of_run, score_submission, write_submission

    if sum(each is not None for each in (predictions, rollouts, run)) != 1 or (output and rollouts is not None):
        raise click.UsageError("give one of PREDICTIONS, --rollouts and --run; -o belongs to the first and the last")
    if by and event:
        raise click.UsageError("give one of --by and --event")
    if predictions is not None:
        forecast_scores.show(lake, predictions, by or "object_type", event, output, as_json)
        return
    with (
        executor_from_options(cluster, workers, quiet=quiet) as execution,
        ProgressDisplay("score", is_quiet=quiet) as progress,
        TemporaryDirectory() as folder,
    ):
        submission = rollouts or output or f"{folder}/submission.binproto"
        if run is not None:
            write_submission(submission, rollouts_of_run(Lake(lake), run))
        report = score_submission(
            lake,
            submission,
            configuration,
            official=not right_lanes,
            executor=execution.executor or executor_for(workers or default_workers()),
            on_progress=progress.update,
        )
    _print(report, as_json)
    click.get_current_context().exit(1 if report.broken else 0)


def _print(report: SubmissionReport, as_json: bool) -> None:
    if as_json:
        print_json(asdict(report))
        return
    columns = [_values(each) for each in (report.submitted, report.ceiling, report.floor)]
    rows = [(name, *(column[name] for column in columns)) for name in columns[0]]
    print_table(rows, ("", "submission", "recording", "constant velocity"))
    for scenario_id, reason in report.broken[:_MAX_EXAMPLES]:
        click.echo(f"could not be scored: {scenario_id}: {one_line(reason)}", err=True)
    click.echo(f"{count(len(report.scenarios) - len(report.broken), 'scenario')} scored")


def _values(score: Score) -> dict[str, float]:
    """Every number of a score by its name in the table."""
    likelihoods = {f"likelihood of {name}": value for name, value in score.likelihoods.items()}
    rates = {f"simulated {name} rate": value for name, value in score.rates.items()}
    return {
        "realism meta-metric": score.realism,
        **score.groups,
        **likelihoods,
        "ADE [m]": score.ade,
        "minADE [m]": score.min_ade,
        **rates,
    }
