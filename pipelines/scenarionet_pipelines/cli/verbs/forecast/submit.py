"""``scenarionet forecast submit``: write predictions as a submission to a forecasting challenge."""

from __future__ import annotations

import click

from scenarionet_pipelines.cli.output import count
from scenarionet_pipelines.cli.verb import LakeVerb, argument, option


class SubmitVerb(LakeVerb):
    """Write predictions as a submission to the motion forecasting challenge of Argoverse 2 or Waymo.

    PREDICTIONS is a Parquet file, one row per target and mode (schemas/predictions.toml). Positions are moved from the
    frames of the lake to those of the dataset.
    """

    examples = (
        "scenarionet forecast submit lake predictions.parquet submission.parquet --format argoverse2",
        "scenarionet forecast submit lake predictions.parquet submission.binproto --format waymo "
        "--account me@example.org --method constant-velocity --num-parameters 0K",
    )
    predictions: str = argument()
    output: str = argument()
    kind: str = option("Challenge to submit to.", "--format", choices=("argoverse2", "waymo"))
    account: str = option("Waymo: e-mail address that is registered.", default="")
    method: str = option("Waymo: short unique name of the method.", default="")
    num_parameters: str = option("Waymo: number of parameters of the model, for example 2M.", default="")
    authors: tuple[str, ...] = option("Waymo: author of the method; may be repeated.", "--author")
    affiliation: str = option("Waymo: affiliation of the authors.", default="")
    description: str = option("Waymo: description of the method.", default="")
    link: str = option("Waymo: link that describes the method.", default="")
    uses_lidar: bool = option("Waymo: the model uses lidar data.")
    uses_camera: bool = option("Waymo: the model uses camera data.")
    uses_public_pretraining: bool = option("Waymo: a public language or vision model was used.")

    def run(self) -> None:
        from scenarionet_data.forecasts import WaymoEntry, read_predictions, write_argoverse2, write_waymo

        missing = [name for name, text in (("--account", self.account), ("--method", self.method)) if not text]
        missing += [] if self.num_parameters else ["--num-parameters"]
        if self.kind == "waymo" and missing:
            raise click.UsageError(f"a submission to Waymo needs {', '.join(missing)}")
        found = read_predictions(self.predictions)
        if self.kind == "argoverse2":
            write_argoverse2(self.lake, found, self.output)
        else:
            write_waymo(self.lake, found, self.output, WaymoEntry(**self.given(WaymoEntry)))
        self.say({"path": self.output, "targets": len(found)}, f"wrote {count(len(found), 'target')} to {self.output}")
