"""The encoder of a trained forecaster as a model that embeds scenarios; needs torch."""

from __future__ import annotations

from scenarionet_data.forecasts.forecaster import load  # first: says how to install torch

# isort: split
import warnings
from collections.abc import Iterator

import numpy as np
import torch

from scenarionet_data.arrays.dtypes import Float32
from scenarionet_data.learning.fitting import weights_digest
from scenarionet_data.loader import ScenarioLoader
from scenarionet_data.query.lake_view import LakeView
from scenarionet_data.samples.choices import Targets
from scenarionet_data.samples.dataset import Samples
from scenarionet_data.samples.selection import SamplesWarning
from scenarionet_data.samples.training import collate

_SCENARIOS = 64  # whose samples are made at a time
_BATCH = 256


class EncoderModel:
    """What a forecaster's encoder says of the ego, averaged over the moments of a scenario at which it predicts.

    Args:
        lake: The lake with the training run.
        run: Name of the run.

    Raises:
        LakeError: The run cannot be loaded, see :func:`scenarionet_data.forecasts.forecaster.load`.
    """

    def __init__(self, lake: LakeView, run: str) -> None:
        self._model, self._config = load(lake, run)
        self._model.eval()
        self.source = f"the encoder of run {run} {weights_digest(self._model)}"

    def vectors(self, lake: LakeView, loader: ScenarioLoader) -> Iterator[Float32 | None]:
        """Yield the vector of each scenario; None if it is shorter than history and future of the forecaster."""
        ids = loader.scenario_ids
        for first in range(0, len(ids), _SCENARIOS):
            yield from self._some(lake, ids[first : first + _SCENARIOS])

    @torch.no_grad()
    def _some(self, lake: LakeView, ids: list[str]) -> Iterator[Float32 | None]:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", SamplesWarning)  # of scenarios that are too short: they have no vector
            samples = Samples(
                lake,
                ids,
                window=self._config.window,
                agents=self._config.nearby_agents,
                polylines=self._config.nearby_polylines,
                targets=Targets("ego"),
            )
        sums: dict[str, Float32] = {}
        counts: dict[str, int] = {}
        for first in range(0, len(samples), _BATCH):
            numbers = range(first, min(first + _BATCH, len(samples)))
            found = self._model.encode(collate(samples.batch(numbers)))[0][:, 0].numpy()
            for number, vector in zip(numbers, found, strict=True):
                key = samples.key(number).scenario_id
                sums[key] = sums.get(key, np.zeros_like(vector)) + vector
                counts[key] = counts.get(key, 0) + 1
        return iter([sums[each] / np.float32(counts[each]) if each in sums else None for each in ids])
