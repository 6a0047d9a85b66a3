"""A small network estimates from one picture where it is in its lane: the offset from the centre, and the heading.

    python docs/examples/lane_pose.py lake train val

The centre of the lane is the path of the Intelligent Driver Model, so scenarios should have roads of one lane per
direction; see the tutorial "Learn from pictures". Scenarios of the second database are not trained on.
"""

from __future__ import annotations

from driving_pictures import DrivePictures, PictureNetwork, collect, fit  # first: says how to install torch

# isort: split
from dataclasses import dataclass
from time import process_time

import click
import numpy as np
import torch

from scenarionet_data import Lake, ScenarioLoader
from scenarionet_data.arrays.dtypes import Float32


@dataclass(frozen=True)
class PoseErrors:
    """Mean absolute errors on pictures that were not trained on, and those of always answering the training mean.

    Attributes:
        pictures, scenarios: How many there were.
        offset, heading: [m], [rad].
        offset_of_mean, heading_of_mean: [m], [rad].
    """

    pictures: int
    scenarios: int
    offset: float
    heading: float
    offset_of_mean: float
    heading_of_mean: float


def pose(pictures: DrivePictures) -> Float32:
    """Return the offset [m] and the heading relative to the lane's [rad] (N, 2)."""
    return np.stack([pictures.offset, pictures.turn], axis=1)


def errors(network: PictureNetwork, pictures: DrivePictures) -> PoseErrors:
    """Compare a network with the truth."""
    with torch.no_grad():
        found = torch.cat([network(part) for part in torch.from_numpy(pictures.views[:, 1:]).split(256)])
    truth = pose(pictures)
    missed, missed_by_mean = (np.abs(guess - truth).mean(axis=0) for guess in (found.numpy(), network.mean.numpy()))
    return PoseErrors(len(pictures), len(np.unique(pictures.scenario)), *map(float, (*missed, *missed_by_mean)))


@click.command(help=__doc__)
@click.argument("lake")
@click.argument("train")
@click.argument("test")
@click.option("--passes", default=15, show_default=True, help="Passes over the pictures.")
@click.option("--every", default=12, show_default=True, help="Steps between two pictures of a scenario.")
@click.option("--seed", default=0, show_default=True)
def main(lake: str, train: str, test: str, passes: int, every: int, seed: int) -> None:
    """Train, and print the errors."""
    torch.set_num_threads(1)
    began, opened = process_time(), Lake(lake)
    loaders = [ScenarioLoader(opened, opened.database(name)) for name in (train, test)]
    seen, held_out = (collect(loader, range(len(loader)), every, seed) for loader in loaders)
    click.echo(f"{len(seen):,} pictures of {len(loaders[0])} scenarios, {process_time() - began:.0f} s")
    network = fit(seen.views[:, 1:], pose(seen), passes, seed)
    found = errors(network, held_out)
    click.echo(f"held out: {found.pictures:,} pictures of {found.scenarios} scenarios, {process_time() - began:.0f} s")
    click.echo(f"offset  {found.offset:.3f} m   of the mean {found.offset_of_mean:.3f} m")
    click.echo(f"heading {found.heading:.4f} rad of the mean {found.heading_of_mean:.4f} rad")


if __name__ == "__main__":
    main()
