"""Scores of predictions against the recordings of a lake, one row per target."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from itertools import compress
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow as pa

from scenarionet_data.building.resampling import resample
from scenarionet_data.forecasts.displacements import argoverse, drivable_area, nuscenes, off_road_rate
from scenarionet_data.forecasts.predictions import Prediction, read_predictions
from scenarionet_data.forecasts.waymo import AveragePrecision, WaymoChallenge, measure
from scenarionet_data.loader import ScenarioLoader
from scenarionet_data.operations.database_query import DatabaseQuery
from scenarionet_data.operations.filter import find_scenarios
from scenarionet_data.query.lake_view import LakeLike, open_view
from scenarionet_data.query.statements import check_expression, quoted
from scenarionet_data.scenario.description import ScenarioDescription
from scenarionet_data.scenario.settings import check_is
from scenarionet_data.scenario.vocabulary import ObjectType
from scenarionet_data.schema import tables
from scenarionet_data.storage.read.metadata_rows import ScenarioIndex

_WAYMO_DT = 0.5
"""Time between the positions that Waymo's challenges measure [s]."""
_NUSCENES_MODES = (1, 5, 10)
_MEASURED = ("min_ade", "min_fde", "miss", "overlap")
_TYPES = ("VEHICLE", "PEDESTRIAN", "CYCLIST")


FAN = (
    (1.0, 0.0),
    (0.8, 0.0),
    (1.2, 0.0),
    (0.5, 0.0),
    (1.0, np.radians(10.0)),
    (1.0, np.radians(-10.0)),
)
"""Factors of the speed, and turns to the left [rad]."""


@dataclass(frozen=True, eq=False)
class ForecastScores:
    """Scores of predictions.

    Attributes:
        table: One row per target, with the columns of ``schemas/scores.toml``.
        precision: Waymo's mean average precision by object type, horizon [s] and kind (``map``, ``soft_map``).
        findings: Number of predictions that could not be scored, or not wholly, and an example, by reason.
    """

    table: pa.Table
    precision: Mapping[tuple[str, float, str], float]
    findings: Mapping[str, tuple[int, str]]


def score(lake: LakeLike, predictions: Sequence[Prediction] | Path | str) -> ForecastScores:
    """Score predictions as Argoverse, nuScenes and Waymo define it.

    A score is null where the recording does not allow it: Argoverse and nuScenes need the whole future of the target,
    Waymo's horizons need its state at that time, and positions every 0.5 s; the off-road rate needs areas in the map.

    Args:
        lake: The lake, its path or its URL.
        predictions: Predictions, or a Parquet file of them, see ``schemas/predictions.toml``.

    Raises:
        BadParameter: The file does not hold predictions.
    """
    check_is("predictions", predictions, Iterable | Path, "predictions or their file")
    listed = read_predictions(predictions) if isinstance(predictions, str | Path) else list(predictions)
    scorer, by_scenario, known = _TargetScorer(), *_by_scenario(lake, listed)
    for each in listed:
        if each.scenario_id not in known:
            scorer.note("of scenarios that the lake does not have", each)
    for scenario in ScenarioLoader(lake, known):
        scorer.add(scenario, by_scenario[scenario.id])
    table = pa.Table.from_pylist(scorer.rows, schema=tables.load("scores").schema)
    return ForecastScores(table, dict(scorer.precision()), dict(scorer.findings))


def summary(lake: LakeLike, scores: ForecastScores, by: str = "object_type", *, event: str | None = None) -> pa.Table:
    """Mean scores by groups of targets.

    Args:
        lake: The lake with the scenarios.
        scores: The scores of targets.
        by: SQL expression over the columns of the scores and of the view ``metadata`` that names the group.
        event: Group them by whether this event happens in the scenario instead, such as ``"cut_in:max_gap=20"``.

    Raises:
        QueryError: ``by`` is not one expression, or DuckDB rejects it.
        UnknownEvent: No such event.
    """
    check_is("scores", scores, ForecastScores, "what score(lake, predictions) returns")
    check_expression(by)
    given = {"scores": scores.table}
    if event is not None:
        scenarios = DatabaseQuery.over(lake)
        given["happening"] = scenarios.selection(*find_scenarios(scenarios, events=[event])).members
        by = f"if(scenario_id IN (SELECT scenario_id FROM happening), {quoted(event)}, {quoted(f'without {event}')})"
    means = [column for column in tables.load("scores").columns if column.type == "float64" and column.name != "dt"]
    listed = ", ".join(f"avg({column.name}) AS {column.name}" for column in means)
    query = (
        f"SELECT ({by}\n)::VARCHAR AS by, count(*) AS targets, {listed} "
        "FROM scores JOIN metadata USING (scenario_id) GROUP BY 1 ORDER BY 1"
    )
    return open_view(lake).arrow(query, tables=given)


def fan_of_velocities(lake: LakeLike, predictions: Sequence[Prediction]) -> list[Prediction]:
    """Return the floor of predictions with several modes: six constant velocities for the same targets.

    The first has the recorded velocity; the others are slower, faster, or turned, see ``FAN``. A single constant
    velocity is no floor for the best of six.

    Args:
        lake: The lake with the scenarios.
        predictions: Those to compare with; targets that the lake does not have are left out.
    """
    by_scenario, known = _by_scenario(lake, predictions)
    factors, angles = np.array(FAN).T
    turns = np.array([[np.cos(angles), -np.sin(angles)], [np.sin(angles), np.cos(angles)]])
    found = []
    for scenario in ScenarioLoader(lake, known):
        for each in by_scenario[scenario.id]:
            if each.track_id not in scenario.tracks.ids or not 0 <= each.timestep < scenario.num_timesteps:
                continue
            row = scenario.tracks.index(each.track_id)
            velocity = np.einsum("ijk,j->ki", turns, scenario.tracks.velocity[row, each.timestep].astype(np.float64))
            time = each.dt * np.arange(1, each.modes.shape[1] + 1)
            ways = (factors[:, None] * velocity)[:, None] * time[:, None]
            modes = scenario.tracks.position[row, each.timestep, :2] + ways
            found.append(replace(each, modes=modes, probabilities=np.full(len(FAN), 1.0 / len(FAN)), given=None))
    return found


def _by_scenario(
    lake: LakeLike, predictions: Sequence[Prediction]
) -> tuple[dict[str, list[Prediction]], dict[str, None]]:
    """Predictions by scenario, and those scenarios, in order, that the lake has."""
    found: dict[str, list[Prediction]] = defaultdict(list)
    for each in predictions:
        check_is("prediction", each, Prediction, "what read_predictions returns")
        found[each.scenario_id].append(each)
    view = open_view(lake)
    _, is_known = ScenarioIndex(view.files, view.snapshot).find(pa.array(list(found), pa.string()))
    return found, dict.fromkeys(compress(found, is_known.tolist()))


@dataclass
class _TargetScorer:
    """Collects the scores of targets, scenario by scenario."""

    rows: list[dict[str, Any]] = field(default_factory=list)
    findings: dict[str, tuple[int, str]] = field(default_factory=dict)
    _hard: dict[tuple[str, float], AveragePrecision] = field(
        default_factory=lambda: defaultdict(lambda: AveragePrecision())
    )
    _soft: dict[tuple[str, float], AveragePrecision] = field(
        default_factory=lambda: defaultdict(lambda: AveragePrecision(is_soft=True))
    )

    def note(self, reason: str, prediction: Prediction) -> None:
        """Count a prediction that could not be scored."""
        count, example = self.findings.get(reason, (0, f"{prediction.track_id} of {prediction.scenario_id}"))
        self.findings[reason] = count + 1, example

    def add(self, scenario: ScenarioDescription, predictions: Sequence[Prediction]) -> None:
        """Score the predictions of a scenario."""
        area = drivable_area(scenario.map)
        regular = {dt: resample(scenario, dt) for dt in {each.dt for each in predictions}}
        for each in predictions:
            truth = regular[each.dt]
            if each.track_id not in scenario.tracks.ids or not 0 <= each.timestep < scenario.num_timesteps:
                self.note("of objects or timesteps that the scenario does not have", each)
                continue
            row = truth.tracks.index(each.track_id)
            kind = ObjectType(int(truth.tracks.object_type[row])).name
            now = int(np.argmin(np.abs(truth.timestamps - scenario.timestamps[each.timestep])))
            found: dict[str, Any] = {
                "scenario_id": each.scenario_id,
                "track_id": each.track_id,
                "timestep": each.timestep,
                "object_type": kind,
                "num_modes": len(each.modes),
            }
            if area is not None:
                try:
                    found["off_road_rate"] = off_road_rate(each.modes, area, scenario.origin[:2])
                except ImportError:
                    self.note("without off_road_rate, which needs scipy (extra vary)", each)
            found |= self._displacements(truth, row, now, each)
            found |= self._waymo(truth, row, now, each, kind)
            self.rows.append({name: None if value != value else value for name, value in found.items()})

    def _displacements(
        self, truth: ScenarioDescription, row: int, now: int, prediction: Prediction
    ) -> dict[str, float]:
        steps = slice(now + 1, now + 1 + prediction.modes.shape[1])
        valid = truth.tracks.valid[row, steps]
        if len(valid) < prediction.modes.shape[1] or not valid.all():
            self.note("of futures that are not recorded wholly: without scores of Argoverse and nuScenes", prediction)
            return {}
        path = truth.tracks.position[row, steps, :2].astype(np.float64)
        found = argoverse(prediction.modes, prediction.normalised, path)
        for count in _NUSCENES_MODES:
            found |= nuscenes(prediction.modes, path, count)
        return found

    def _waymo(
        self, truth: ScenarioDescription, row: int, now: int, prediction: Prediction, kind: str
    ) -> dict[str, float]:
        stride = round(_WAYMO_DT / prediction.dt)
        if stride < 1 or abs(stride * prediction.dt - _WAYMO_DT) > 1e-6:
            self.note("of a timestep that 0.5 s is no multiple of: without scores of Waymo", prediction)
            return {}
        challenge = WaymoChallenge(stride=stride)
        order = np.arange(len(prediction.modes)) if prediction.given is None else np.argsort(prediction.given)
        modes = prediction.modes[order, None, stride - 1 :: stride]  # the first 6 as given count
        found: dict[str, float] = {}
        for at in challenge.horizons:
            if modes.shape[2] <= at.step or now + stride * (at.step + 1) >= truth.num_timesteps:
                continue
            measured = measure(truth.tracks, now, [row], modes, prediction.probabilities[order], at, challenge)
            found |= {f"waymo_{name}_{at.seconds:g}s": getattr(measured, name) for name in _MEASURED}
            self._hard[kind, at.seconds].add(measured)
            self._soft[kind, at.seconds].add(measured)
        return found

    def precision(self) -> Iterator[tuple[tuple[str, float, str], float]]:
        """Mean average precisions, of the types that Waymo scores."""
        for name, kept in (("map", self._hard), ("soft_map", self._soft)):
            for (kind, seconds), each in sorted(kept.items()):
                if kind in _TYPES:
                    yield (kind, seconds, name), each.value()
