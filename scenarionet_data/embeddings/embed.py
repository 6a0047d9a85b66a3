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
from scenarionet_data.errors import BadParameter, needing
from scenarionet_data.execution.progress import Progress
from scenarionet_data.loader import ScenarioLoader
from scenarionet_data.operations.tagging import Tagging
from scenarionet_data.query.lake_view import LakeView
from scenarionet_data.storage import evaluation_runs


class Model(Protocol):
    """A model that embeds scenarios."""

    @property
    def source(self) -> str:
        """Its name, and a hash of all that its vectors depend on."""

    def vectors(self, lake: LakeView, loader: ScenarioLoader) -> Iterator[Float32 | None]:
        """Yield the vector (d,) float32 of each scenario in order, None for one that it cannot embed."""


class FeatureModel:
    """The vector of :mod:`scenarionet_data.embeddings.features`."""

    source = f"features {features.standard().digest}"

    def vectors(self, lake: LakeView, loader: ScenarioLoader) -> Iterator[Float32 | None]:  # noqa: ARG002
        """Yield the features (64,) of each scenario."""
        return map(features.vector, loader)


def find_model(lake: LakeView, name: str) -> Model:
    """Return a model: ``features``, or the encoder of the forecaster that a run of the lake has trained.

    Raises:
        BadParameter: The lake has no such run.
        LakeError: The run is not of a forecaster, of another layout, or damaged.
        MissingDependency: It is a run, and torch is not installed.
    """
    if name == "features":
        return FeatureModel()
    runs = evaluation_runs.names(lake.files)
    if name not in runs:
        raise BadParameter(
            f"{lake.root}: no model {name!r} that embeds scenarios; there is features, and each run of this lake that "
            f"trained a forecaster: {', '.join(runs) or 'none yet'}"
        )
    with needing("the encoder of a forecaster needs torch", "learn"):
        from scenarionet_data.embeddings.encoder import EncoderModel
    return EncoderModel(lake, name)


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
    rows, known = [], []
    for number, (scenario_id, vector) in enumerate(zip(ids, model.vectors(lake, loader), strict=True), 1):
        if on_progress is not None:
            on_progress(number, len(ids), number)
        if vector is None:
            continue
        if not np.isfinite(vector).all():
            raise BadParameter(
                f"{scenario_id}: the model gives {int((~np.isfinite(vector)).sum())} of {len(vector)} numbers that are "
                "not finite; its weights or the scenario are damaged: train it again, or scenarionet maintain check"
            )
        rows.append(np.asarray(vector, np.float32))
        known.append(scenario_id)
    if not rows:
        raise BadParameter(f"the model can embed none of {len(ids)} scenarios: they are too short for it")
    values = pa.FixedSizeListArray.from_arrays(pa.array(np.concatenate(rows)), len(rows[0]))
    table = pa.table({"scenario_id": pa.array(known, pa.string()), name: values})
    return lake.tag(name, table, source=f"embedding by {model.source}", replace=replace)
