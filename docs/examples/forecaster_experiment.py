"""Which recordings teach a forecaster? Train on each source and on all of them, test on each, as UniTraj does.

    python docs/examples/forecaster_experiment.py lake page.md --commit $(git rev-parse --short HEAD)

Scenarios of each source are split into training and test; :class:`Experiment` has all settings. The rule for
checkpoints is the last epoch: nothing is chosen by looking at the test sets. Runs that are finished are not repeated,
so an interrupted experiment continues.
"""

from __future__ import annotations

from scenarionet_data.forecasts.forecaster import ForecasterConfig, measure, train  # first: says how to install torch

# isort: split
from dataclasses import asdict, dataclass, field
from pathlib import Path

import click
import numpy as np
import pyarrow as pa
import pyarrow.compute as pc
import pyarrow.parquet as pq
import torch

from scenarionet_data import Lake, Samples
from scenarionet_data.arrays.dtypes import Array
from scenarionet_data.forecasts.forecaster_scores import constant_velocity, kalman_filter
from scenarionet_data.learning.fitting import FitRun


@dataclass(frozen=True)
class Experiment:
    """Settings of the comparison.

    Attributes:
        sources: Names and SQL conditions over the view ``metadata``.
        seeds: One training run each.
        train_share: Share of the scenarios for training.
        resamples: Draws of the bootstrap.
        config: The forecaster.
    """

    sources: tuple[tuple[str, str], ...] = (
        ("nuscenes", "dataset = 'nuscenes' OR scenario_id LIKE '%nuscenes%'"),
        ("waymo", "dataset = 'waymo' OR scenario_id LIKE '%waymo%'"),
        ("generated", "dataset = 'pg'"),
    )
    seeds: tuple[int, ...] = (0, 1, 2)
    train_share: float = 0.5
    resamples: int = 2000
    config: ForecasterConfig = field(default_factory=lambda: ForecasterConfig(epochs=8))


def run_experiment(lake: Lake, experiment: Experiment) -> pa.Table:
    """Train and test; return one row per training set, seed, test set and target with min_ade and min_fde [m].

    Constant velocity and a Kalman filter have rows of their own, with the seed -1.
    """
    training, tests = make_databases(lake, experiment)
    config = experiment.config
    tested = {name: config.samples(lake, database, is_training=False) for name, database in tests.items()}
    parts = []
    for name, predictor in (("constant velocity", constant_velocity(config)), ("Kalman filter", kalman_filter(config))):
        parts += [_rows(name, -1, test, samples, *measure(predictor, samples)) for test, samples in tested.items()]
    for name, database in training.items():
        for seed in experiment.seeds:
            model = train(FitRun(lake, database, f"forecaster-{name}-seed{seed}", seed), config)
            click.echo(f"trained on {name}, seed {seed}")
            parts += [
                _rows(name, seed, test, samples, *measure(model.modes, samples)) for test, samples in tested.items()
            ]
    return pa.concat_tables(parts)


def make_databases(lake: Lake, experiment: Experiment) -> tuple[dict[str, str], dict[str, str]]:
    """Save and return the databases for training and for tests by source; ``all`` joins the former.

    Raises:
        BadParameter: The lake has no scenarios of a source.
    """
    saved = set(lake.databases)
    shares = {"train": experiment.train_share, "test": 1.0 - experiment.train_share}
    sources = [name for name, _ in experiment.sources]
    for source, condition in experiment.sources:
        if f"forecast_{source}_train" not in saved:
            lake.filter(condition, name=f"forecast_{source}")
            lake.split(f"forecast_{source}", shares, seed=0)
    names = [f"forecast_{source}_train" for source in sources]
    if "forecast_all_train" not in saved:
        lake.merge(*names, name="forecast_all_train")
    training = dict(zip((*sources, "all"), (*names, "forecast_all_train"), strict=True))
    return training, {source: f"forecast_{source}_test" for source in sources}


def _rows(name: str, seed: int, test: str, samples: Samples, mean: Array, end: Array) -> pa.Table:
    keys = [samples.key(number) for number in range(len(samples))]
    columns = {
        "trained_on": pa.array([name] * len(keys)),
        "seed": pa.array([seed] * len(keys), pa.int32()),
        "test": pa.array([test] * len(keys)),
        "scenario_id": pa.array([key.scenario_id for key in keys]),
        "track_id": pa.array([key.track_ids[0] for key in keys]),
        "timestep": pa.array([key.timestep for key in keys], pa.int32()),
        "min_ade": pa.array(mean, pa.float64(), from_pandas=True),
        "min_fde": pa.array(end, pa.float64(), from_pandas=True),
    }
    return pa.table(columns)


@dataclass(frozen=True)
class Mean:
    """A mean with its 95 % interval, over scenarios and seeds that are drawn with replacement.

    Attributes:
        value, low, high: [m].
        scenarios, targets: How many it is of.
    """

    value: float
    low: float
    high: float
    scenarios: int
    targets: int


def interval(rows: pa.Table, column: str, resamples: int) -> Mean:
    """Return the mean of a column; targets of a scenario are drawn together, as they are not independent."""
    values = rows[column].to_numpy()
    _, scenario = np.unique(rows["scenario_id"].to_numpy(zero_copy_only=False), return_inverse=True)
    _, seed = np.unique(rows["seed"].to_numpy(), return_inverse=True)
    known = np.isfinite(values)
    shape = (seed.max() + 1, scenario.max() + 1)
    sums, counts = np.zeros(shape), np.zeros(shape)
    np.add.at(sums, (seed[known], scenario[known]), values[known])
    np.add.at(counts, (seed[known], scenario[known]), 1)
    rng = np.random.default_rng(0)
    means = np.empty(resamples)
    for draw in range(resamples):
        seeds, scenarios = rng.integers(shape[0], size=shape[0]), rng.integers(shape[1], size=shape[1])
        chosen = np.ix_(seeds, scenarios)
        means[draw] = sums[chosen].sum() / max(counts[chosen].sum(), 1)
    low, high = np.quantile(means, [0.025, 0.975])
    targets = int(known.sum()) // shape[0]
    return Mean(float(sums.sum() / counts.sum()), float(low), float(high), shape[1], targets)


def write_page(path: Path, rows: pa.Table, experiment: Experiment, commit: str) -> None:
    """Write the table with intervals, settings and what it can say, as Markdown."""
    sources = [name for name, _ in experiment.sources]
    header = " | ".join(f"{source}: minADE [m] | minFDE [m]" for source in sources)
    table = ["| trained on | " + header + " |", "| --- |" + " --- |" * (2 * len(sources))]
    sizes: dict[str, Mean] = {}
    for name in dict.fromkeys(rows["trained_on"].to_pylist()):
        cells = []
        for source in sources:
            found = rows.filter((pc.field("trained_on") == name) & (pc.field("test") == source))
            for column in ("min_ade", "min_fde"):
                sizes[source] = mean = interval(found, column, experiment.resamples)
                cells.append(f"{mean.value:.2f} ({mean.low:.2f}-{mean.high:.2f})")
        table.append(f"| {name} | " + " | ".join(cells) + " |")
    tested = "; ".join(f"{name}: {size.scenarios} scenarios, {size.targets:,} targets" for name, size in sizes.items())
    settings = {key: value for key, value in asdict(experiment).items() if key != "config"} | asdict(experiment.config)
    lines = [
        "# Which recordings teach a forecaster?",
        "",
        f"Settings, seeds and the rule for checkpoints (the last epoch) were committed in `{commit}` before the run.",
        f"Distances of the closest of {experiment.config.modes} trajectories from the recorded one; constant",
        "velocity and the Kalman filter have one trajectory. In brackets: 95 % intervals by bootstrap over scenarios",
        "and seeds.",
        "",
        *table,
        "",
        f"Test sets: {tested}. So few scenarios say little about a dataset: compare rows only where",
        "their intervals are apart, and none of them with figures that were published for whole datasets.",
        "",
        "## Settings",
        "",
        "| setting | value |",
        "| --- | --- |",
        *(f"| `{key}` | {value} |" for key, value in settings.items()),
        "",
    ]
    path.write_text("\n".join(lines), "utf-8")


@click.command()
@click.argument("lake")
@click.argument("page", type=click.Path(path_type=Path))
@click.option("--commit", required=True, help="Commit that has the settings; the page names it.")
def main(lake: str, page: Path, commit: str) -> None:
    """Run the experiment on LAKE; write PAGE, and the rows beside it as Parquet."""
    torch.set_num_threads(1)
    experiment = Experiment()
    rows = run_experiment(Lake(lake), experiment)
    pq.write_table(rows, page.with_suffix(".parquet"))
    write_page(page, rows, experiment, commit)
    click.echo(f"written: {page}")


if __name__ == "__main__":
    main()
