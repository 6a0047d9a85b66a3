"""Print the scores of predicted trajectories."""

from __future__ import annotations

import click

from scenarionet_pipelines.cli.output import count, print_json, print_table


def show(lake: str, predictions: str, by: str, event: str | None, output: str | None, as_json: bool) -> None:
    """Score a file of predictions, print means, and write the scores of each target to a Parquet file."""
    import pyarrow.parquet as pq

    from scenarionet_data.forecasts import score, summary

    scores = score(lake, predictions)
    means = summary(lake, scores, by, event=event).to_pylist()
    if output is not None:
        pq.write_table(scores.table, output)
    if as_json:
        precision = [
            {"object_type": kind, "seconds": seconds, "kind": name, "value": value}
            for (kind, seconds, name), value in scores.precision.items()
        ]
        print_json({"by": means, "precision": precision, "findings": scores.findings})
        return
    measured = [name for name in (means[0] if means else ()) if any(row[name] is not None for row in means)]
    print_table([(name, *(row[name] for row in means)) for name in measured[1:]], ("", *(row["by"] for row in means)))
    for (kind, seconds, name), value in scores.precision.items():
        click.echo(f"{name} of {kind} at {seconds:g} s: {value:.4g}")
    for reason, (number, example) in scores.findings.items():
        click.echo(f"{count(number, 'prediction')} {reason}, for example {example}", err=True)
