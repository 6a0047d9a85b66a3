"""Embed scenarios: a model's vector of each as a user column."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Protocol

import numpy as np
import pyarrow as pa

from scenarionet_data.arrays.dtypes import Float32
from scenarionet_data.databases.record import DatabaseRecord
from scenarionet_data.databases.user_columns import UserColumn
from scenarionet_data.embeddings import features
from scenarionet_data.errors import BadParameter
from scenarionet_data.execution.progress import Progress
from scenarionet_data.loader import ScenarioLoader
from scenarionet_data.operations.tagging import Tagging


class Model(Protocol):
    """A model that embeds scenarios."""

    @property
    def source(self) -> str:
        """Its name, and a hash of all that its vectors depend on."""

    def vectors(self, loader: ScenarioLoader) -> Iterator[Float32]:
        """Yield the vector (d,) float32 of each scenario in order."""


class FeatureModel:
    """The vector of :mod:`scenarionet_data.embeddings.features`."""

    source = f"features {features.standard().digest}"

    def vectors(self, loader: ScenarioLoader) -> Iterator[Float32]:
        """Yield the features (64,) of each scenario."""
        return map(features.vector, loader)


def find_model(name: str) -> Model:
    """Return a model by name.

    Raises:
        BadParameter: There is none.
    """
    if name != "features":
        raise BadParameter(f"no model {name!r} that embeds scenarios; there is features")
    return FeatureModel()


def embed(
    lake: Tagging,
    name: str,
    model: Model,
    database: DatabaseRecord | str | None = None,
    *,
    replace: bool = False,
    on_progress: Progress | None = None,
) -> UserColumn:
    """Write a user column with the vectors of a model; see :meth:`Lake.embed <scenarionet_data.Lake.embed>`.

    Raises:
        BadParameter: There are no scenarios, or a vector is not finite.
    """
    loader = ScenarioLoader(lake, database)
    ids = list(loader.scenario_ids)
    if not ids:
        raise BadParameter(f"{lake.root}: there are no scenarios to embed; convert some, or name another database")
    rows = []
    for scenario_id, vector in zip(ids, model.vectors(loader), strict=True):
        if not np.isfinite(vector).all():
            raise BadParameter(
                f"{scenario_id}: the model gives {int((~np.isfinite(vector)).sum())} of {len(vector)} numbers that are "
                "not finite; its weights or the scenario are damaged: train it again, or scenarionet maintain check"
            )
        rows.append(np.asarray(vector, np.float32))
        if on_progress is not None:
            on_progress(len(rows), len(ids), len(rows))
    values = pa.FixedSizeListArray.from_arrays(pa.array(np.concatenate(rows)), len(rows[0]))
    table = pa.table({"scenario_id": pa.array(ids, pa.string()), name: values})
    return lake.tag(name, table, source=f"embedding by {model.source}", replace=replace)
