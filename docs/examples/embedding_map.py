"""A map of datasets: t-SNE of an embedding, and two numbers that say how far datasets are apart.

    python docs/examples/embedding_map.py lake v map.png

The settings are those of ScenarioNet's paper: PCA first, perplexity 30, early exaggeration 12. The numbers are computed
from the vectors, not from the picture: the share of a scenario's ten nearest that are of its own dataset, and how often
a linear model names the dataset of scenarios that it has not seen, each beside what chance would give.
"""

from __future__ import annotations

from pathlib import Path

import click
import matplotlib.pyplot as plt
import numpy as np
from sklearn.decomposition import PCA
from sklearn.linear_model import LogisticRegression
from sklearn.manifold import TSNE
from sklearn.model_selection import cross_val_score
from sklearn.neighbors import NearestNeighbors

from scenarionet_data import Lake


@click.command()
@click.argument("lake")
@click.argument("name")
@click.argument("picture", type=click.Path(path_type=Path))
@click.option("--by", default="dataset", show_default=True, help="SQL expression over metadata that names the group.")
@click.option("--most", default=600, show_default=True, help="Scenarios of a group, drawn by a hash of their ids.")
@click.option("--least", default=10, show_default=True, help="Groups of fewer scenarios are left out.")
def main(lake: str, name: str, picture: Path, by: str, most: int, least: int) -> None:
    """Draw the embedding NAME of LAKE into PICTURE, and print how far apart the groups are."""
    rows = Lake(lake).sql(
        f"SELECT {name} AS vector, ({by})::VARCHAR AS kind FROM metadata WHERE {name} IS NOT NULL AND kind IS NOT NULL "
        f"QUALIFY count(*) OVER (PARTITION BY kind) >= {least} "
        f"AND row_number() OVER (PARTITION BY kind ORDER BY md5(scenario_id)) <= {most} ORDER BY md5(scenario_id)"
    )
    vectors, kinds = np.array(rows["vector"].to_list(), np.float32), rows["kind"].to_numpy()
    names, counts = np.unique(kinds, return_counts=True)
    if len(names) < 2:
        raise click.ClickException(f"found {len(names)} groups of {least} scenarios or more; two are needed")
    _, nearest = NearestNeighbors(n_neighbors=11).fit(vectors).kneighbors(vectors)
    own = (kinds[nearest[:, 1:]] == kinds[:, None]).mean(axis=1)
    probe = LogisticRegression(max_iter=2000, class_weight="balanced")
    named = cross_val_score(probe, vectors, kinds, cv=5, scoring="balanced_accuracy")
    click.echo(f"{len(kinds):,} scenarios: " + ", ".join(f"{n} {c}" for n, c in zip(names, counts, strict=True)))
    for kind, count in zip(names, counts, strict=True):
        click.echo(
            f"  {kind}: {own[kinds == kind].mean():.3f} of ten nearest of its own, chance {count / len(kinds):.3f}"
        )
    mean = np.mean([own[kinds == kind].mean() for kind in names])
    click.echo(f"purity {mean:.3f}, mean of the groups, chance {1 / len(names):.3f}")
    click.echo(f"linear probe {named.mean():.3f} +- {named.std():.3f} of five folds, chance {1 / len(names):.3f}")
    reduced = PCA(min(50, vectors.shape[1]), random_state=0).fit_transform(vectors)
    places = TSNE(perplexity=30, early_exaggeration=12, init="pca", random_state=0).fit_transform(reduced)
    _, axes = plt.subplots(figsize=(6, 6), layout="constrained")
    for kind in names:
        axes.scatter(places[kinds == kind, 0], places[kinds == kind, 1], s=6, label=kind, alpha=0.7, linewidths=0)
    axes.set(xticks=[], yticks=[])
    axes.legend(markerscale=3, frameon=False)
    plt.savefig(picture, dpi=100)


if __name__ == "__main__":
    main()
