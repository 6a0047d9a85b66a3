"""``scenarionet forecast score``: score predicted trajectories, or rollouts for the Waymo Open Sim Agents Challenge."""

from __future__ import annotations

from dataclasses import asdict
from tempfile import TemporaryDirectory
from typing import TYPE_CHECKING, Any

import click

from scenarionet_data.errors import needing
from scenarionet_pipelines.cli.output import count, table
from scenarionet_pipelines.cli.verb import Choosing, Distributed, LakeVerb, argument, option
from scenarionet_pipelines.messages import one_line

if TYPE_CHECKING:
    from scenarionet_sim.metrics.wosac import Score


class ScoreVerb(LakeVerb, Choosing, Distributed):
    """Score predicted trajectories, or rollouts of simulated agents, against the recordings.

    PREDICTIONS is a Parquet file with a row per target and mode (schemas/predictions.toml); the scores are those of
    Argoverse, nuScenes and the Waymo Open Motion challenge.

    --model scores a forecaster that `forecast fit` trained, beside constant velocity, a Kalman filter and six constant
    velocities, on all moving road users of --database.

    Rollouts are scored as the Waymo Open Sim Agents Challenge does. Beside the submission stand the ceiling, the score
    of the recordings themselves, and the floor, the score of constant velocity, on the same scenarios. The lake needs
    the scenarios of the submission. Of other recordings than Waymo's, the history and the 8 s after it are scored, for
    all objects; these are no scores of the challenge.
    """

    examples = (
        "scenarionet forecast score lake predictions.parquet --by has_intersection -o scores.parquet",
        "scenarionet forecast score lake predictions.parquet --event cut_in",
        "scenarionet forecast score lake --model driven_train-forecaster-seed0 --database driven_val",
        "scenarionet forecast score lake --rollouts submission.tar.gz",
        "scenarionet forecast score lake --rollouts submission.binproto --configuration sim-agents-2024 --json",
        "scenarionet forecast score lake --run all-constant-noisy-wosac -o submission.binproto",
    )
    predictions: str | None = argument()
    by: str | None = option(
        "Of predictions: group them by an expression over the scores and `metadata`. [default: object_type]",
        metavar="SQL",
    )
    event: str | None = option("Of predictions: group them by whether it happens, for example cut_in.", metavar="EVENT")
    model: str | None = option("Score the forecaster of this training run, on --database.", metavar="RUN")
    database: str | None = option("With --model: database that is predicted.", metavar="DATABASE")
    rollouts: str | None = option(
        "Score a submission: a binary SimAgentsChallengeSubmission, a folder of them, or a .tar.gz archive.",
        metavar="PATH",
    )
    run_name: str | None = option(
        "Score this run of `sim --episode wosac --rollouts 32` instead.", "--run", metavar="NAME"
    )
    output: str | None = option(
        "Write the scores of each target, or the rollouts of --run.", "-o", "--output", metavar="FILE"
    )
    receipt: str | None = option(
        "Write a receipt for `runs verify`: what was scored and every number; of --run with -o.", metavar="FILE"
    )
    configuration: str = option(
        "Weights and bins of the challenge.",
        choices=("sim-agents-2025", "sim-agents-2024", "scenario-generation-2025"),
        default="sim-agents-2025",
    )
    right_lanes: bool = option(
        "Look for the lane of a vehicle correctly, unlike the owner's code; red lights count differently."
    )

    def run(self) -> bool:
        kinds = (self.predictions, self.model, self.rollouts, self.run_name)
        if sum(each is not None for each in kinds) != 1 or (
            self.output and (self.rollouts is not None or self.model is not None)
        ):
            raise click.UsageError(
                "give one of PREDICTIONS, --model, --rollouts and --run; -o belongs to the first and the last"
            )
        if self.receipt and self.run_name and not self.output:
            raise click.UsageError("--receipt of --run needs -o, as it is about the rollouts that are written")
        if (self.model is None) != (self.database is None):
            raise click.UsageError("--model and --database belong together")
        if self.model is None and (self.order_by or self.limit):
            raise click.UsageError("--order-by and --limit choose scenarios of --database, which belongs to --model")
        if self.model is not None and self.database is not None:
            self.score_model(self.model, self.saved(self.database))
            return True
        if self.by and self.event:
            raise click.UsageError("give one of --by and --event")
        if self.predictions is None:
            return self.score_rollouts()
        self.score_predictions(self.predictions)
        return True

    def score_model(self, model: str, database: str) -> None:
        """Score a trained forecaster and predictors that learn nothing, and print a row for each."""
        with needing("a forecaster needs torch", "learn"):
            from scenarionet_data.forecasts.forecaster_scores import score_forecaster
        found = score_forecaster(self.open(), model, database)
        self.write_receipt("model", found, {"run": model, "database": database}, database)
        head = ("predictor", "modes", "minADE [m]", "minFDE [m]", "miss rate", "targets")
        self.say(
            {"scores": [asdict(each) for each in found]}, table([tuple(vars(each).values()) for each in found], head)
        )

    def score_predictions(self, predictions: str) -> None:
        """Score a file of predictions, print means, and write the scores of each target to a Parquet file."""
        import pyarrow.parquet as pq

        from scenarionet_data.forecasts import fan_of_velocities, read_predictions, score, summary

        listed = read_predictions(predictions)
        scores, by = score(self.lake, listed), self.by or "object_type"
        means = summary(self.lake, scores, by, event=self.event).to_pylist()
        fan = score(self.lake, fan_of_velocities(self.lake, listed))
        floor = summary(self.lake, fan, by, event=self.event).to_pylist()
        if self.output is not None:
            pq.write_table(scores.table, self.output)
        self.write_receipt("predictions", scores, {"file": predictions})
        precision: list[dict[str, Any]] = [
            {"object_type": kind, "seconds": seconds, "kind": name, "value": value}
            for (kind, seconds, name), value in scores.precision.items()
        ]
        measured = [name for name in (means[0] if means else ()) if any(row[name] is not None for row in means)]
        beside = [*means, *(row | {"by": f"six constant velocities, {row['by']}"} for row in floor)]
        rows = [(name, *(row[name] for row in beside)) for name in measured[1:]]
        lines = table(rows, ("", *(row["by"] for row in beside)))
        lines += ["{kind} of {object_type} at {seconds:g} s: {value:.4g}".format(**each) for each in precision]
        self.say({"by": means, "floor": floor, "precision": precision, "findings": scores.findings}, lines)
        found = scores.findings.items()
        self.complain(f"{count(n, 'prediction')} {reason}, for example {example}" for reason, (n, example) in found)

    def write_receipt(self, kind: str, found: Any, told: dict[str, Any], database: str | None = None) -> None:
        """Write the receipt of a score, if one is asked for; see ``score_receipt``."""
        if self.receipt:
            from scenarionet_data import Lake
            from scenarionet_sim.evaluation.score_receipts import score_receipt

            lake = Lake(self.lake)
            ids = lake.database(database).scenario_ids if database else None
            score_receipt(lake, kind, found, told, ids).write(self.receipt)

    def score_rollouts(self) -> bool:
        """Score a submission, or the rollouts of a run; return whether every scenario could be scored."""
        from scenarionet_data.execution.executors import executor_for
        from scenarionet_sim.evaluation.intervals import mean_interval
        from scenarionet_sim.metrics.wosac import rollouts_of_run, score_submission, write_submission

        with self.execution() as execution, self.progress("score") as progress, TemporaryDirectory() as folder:
            submission = self.rollouts or self.output or f"{folder}/submission.binproto"
            if self.run_name is not None:
                write_submission(submission, rollouts_of_run(self.open(), self.run_name))
            report = score_submission(
                self.lake,
                submission,
                self.configuration,
                official=not self.right_lanes,
                executor=execution.executor or executor_for(self.num_workers),
                on_progress=progress.update,
            )
            settings = {"configuration": self.configuration, "official": not self.right_lanes}
            self.write_receipt("submission", report, {"file": submission, **settings})
        columns = [numbers(each) for each in (report.submitted, report.ceiling, report.floor)]
        rows = [(name, *(column[name] for column in columns)) for name in columns[0]]
        lines = table(rows, ("", "submission", "recording", "constant velocity"))
        above = mean_interval(report.above_floor)
        lines.append(
            f"{count(len(report.above_floor), 'scenario')} scored; realism above constant velocity by {above} (95 %)"
        )
        self.say(asdict(report) | {"note": report.note, "above_floor": report.above_floor}, lines)
        self.complain(f"could not be scored: {each}: {one_line(reason)}" for each, reason in report.broken)
        self.complain([] if report.note is None else [f"note: {report.note}"])
        return not report.broken


def numbers(score: Score) -> dict[str, float]:
    """Return every number of a score by its name in the table."""
    return {
        "realism meta-metric": score.realism,
        **score.groups,
        **{f"likelihood of {name}": value for name, value in score.likelihoods.items()},
        "ADE [m]": score.ade,
        "minADE [m]": score.min_ade,
        **{f"simulated {name} rate": value for name, value in score.rates.items()},
    }
