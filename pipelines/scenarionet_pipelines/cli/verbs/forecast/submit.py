"""``scenarionet forecast submit``: write predictions as a submission to a forecasting challenge."""

from __future__ import annotations

import click

from scenarionet_pipelines.cli.group import verb
from scenarionet_pipelines.cli.output import count, print_json
from scenarionet_pipelines.cli.parameters import json_option, lake_argument


@verb(
    "submit",
    "scenarionet forecast submit lake predictions.parquet submission.parquet --format argoverse2",
    "scenarionet forecast submit lake predictions.parquet submission.binproto --format waymo --account me@example.org "
    "--method constant-velocity --num-parameters 0K",
)
@lake_argument
@click.argument("predictions", type=click.Path(dir_okay=False))
@click.argument("output", type=click.Path(dir_okay=False))
@click.option(
    "--format", "kind", type=click.Choice(["argoverse2", "waymo"]), required=True, help="Challenge to submit to."
)
@click.option("--account", default="", help="Waymo: e-mail address that is registered.")
@click.option("--method", default="", help="Waymo: short unique name of the method.")
@click.option("--num-parameters", default="", help="Waymo: number of parameters of the model, for example 2M.")
@click.option("--author", "authors", multiple=True, help="Waymo: author of the method; may be repeated.")
@click.option("--affiliation", default="", help="Waymo: affiliation of the authors.")
@click.option("--description", default="", help="Waymo: description of the method.")
@click.option("--link", default="", help="Waymo: link that describes the method.")
@click.option("--uses-lidar", is_flag=True, help="Waymo: the model uses lidar data.")
@click.option("--uses-camera", is_flag=True, help="Waymo: the model uses camera data.")
@click.option("--uses-public-pretraining", is_flag=True, help="Waymo: a public language or vision model was used.")
@json_option
def command(
    lake: str,
    predictions: str,
    output: str,
    kind: str,
    account: str,
    method: str,
    num_parameters: str,
    authors: tuple[str, ...],
    affiliation: str,
    description: str,
    link: str,
    uses_lidar: bool,
    uses_camera: bool,
    uses_public_pretraining: bool,
    as_json: bool,
) -> None:
    """Write predictions as a submission to the motion forecasting challenge of Argoverse 2 or Waymo.

    PREDICTIONS is a Parquet file, one row per target and mode (schemas/predictions.toml). Positions are moved from the
    frames of the lake to those of the dataset.
    """
    from scenarionet_data.forecasts import WaymoEntry, read_predictions, write_argoverse2, write_waymo

    missing = [name for name, text in (("--account", account), ("--method", method)) if not text]
    missing += [] if num_parameters else ["--num-parameters"]
    if kind == "waymo" and missing:
        raise click.UsageError(f"a submission to Waymo needs {', '.join(missing)}")
    found = read_predictions(predictions)
    if kind == "argoverse2":
        write_argoverse2(lake, found, output)
    else:
        entry = WaymoEntry(
            account,
            method,
            num_parameters,
            authors=authors,
            affiliation=affiliation,
            description=description,
            link=link,
            uses_lidar=uses_lidar,
            uses_camera=uses_camera,
            uses_public_pretraining=uses_public_pretraining,
        )
        write_waymo(lake, found, output, entry)
    if as_json:
        print_json({"path": output, "targets": len(found)})
    else:
        click.echo(f"wrote {count(len(found), 'target')} to {output}")
