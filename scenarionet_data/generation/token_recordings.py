"""Train a model of tokens on the recordings of a database."""

from __future__ import annotations

from dataclasses import asdict

import numpy as np
import torch

from scenarionet_data.arrays.dtypes import Float32, UInt8
from scenarionet_data.arrays.ragged import Ragged
from scenarionet_data.building import resample
from scenarionet_data.errors import BadParameter
from scenarionet_data.generation.token_model import EDGE, LANE, LINE, TokenConfig, TokenModel
from scenarionet_data.generation.token_training import Recordings, fit_tokens, load_tokens, make_model
from scenarionet_data.generation.tokens import KINDS, STEP, STEPS
from scenarionet_data.learning.fitting import FitRun, weights_digest
from scenarionet_data.loader import ScenarioLoader
from scenarionet_data.query.lake_view import LakeView
from scenarionet_data.scenario.vocabulary import MapFeatureType, ObjectType, is_lane, is_road_edge, is_road_line

LONGEST = 5.0
"""Length of the longest piece of a map [m]."""

_NETWORK = ("tokens", "size", "heads", "near_lanes", "near_lines", "near_cars")  # settings that weights belong to

OBJECTS = 64
"""Most road users of a scenario: those that are there longest."""

KIND_OF = np.full(256, -1)
"""Number in KINDS by ``ObjectType``; -1 for what has no tokens."""
KIND_OF[[ObjectType[name] for name in KINDS]] = range(len(KINDS))


def map_pieces(lines: Ragged, types: UInt8) -> Float32:
    """Return the pieces (P, 5) of polylines (n, 2 or more) [m], whose types are codes of ``MapFeatureType``.

    Lanes, road lines, stop lines and road edges are cut into equal pieces of at most ``LONGEST``; see ``TokenScene``.
    """
    is_line = is_road_line(types) | (types == MapFeatureType.STOP_LINE)
    kinds = np.select([is_lane(types), is_line, is_road_edge(types)], [LANE, LINE, EDGE], -1)
    found = [np.zeros((0, 5))]
    for line in np.flatnonzero((kinds >= 0) & (lines.lengths > 1)).tolist():
        points = lines[line][:, :2].astype(np.float64)
        arc = np.append(0.0, np.hypot(*np.diff(points, axis=0).T).cumsum())
        ends = np.linspace(0.0, arc[-1], max(1, int(np.ceil(arc[-1] / LONGEST))) + 1)
        x, y = (np.interp(ends, arc, points[:, column]) for column in range(2))
        along = np.stack([np.diff(x), np.diff(y)], axis=1)
        middle = np.stack([x[:-1], y[:-1]], axis=1) + along / 2
        length = np.hypot(*along.T)
        found.append(np.column_stack([middle, np.arctan2(along[:, 1], along[:, 0]), length, 0 * length + kinds[line]]))
    return np.concatenate(found).astype(np.float32)


def read_recordings(lake: LakeView, database: str) -> Recordings:
    """Return all scenarios of a database that last for a token.

    Raises:
        BadParameter: There is none.
    """
    parts = []
    for given in ScenarioLoader(lake, database):
        scenario = resample(given, STEP)
        tracks, kind = scenario.tracks, KIND_OF[scenario.tracks.object_type]
        count = tracks.valid.sum(axis=1)
        rows = np.argsort(-count, kind="stable")
        rows = rows[(count[rows] > STEPS) & (kind[rows] >= 0)][:OBJECTS]
        if not len(rows):
            continue
        motion = (tracks.position[rows, :, :2], tracks.heading[rows, :, None], tracks.velocity[rows])
        size = np.nanmedian(np.where(tracks.valid[rows, :, None], tracks.size[rows, :, :2], np.nan), axis=1)
        features = scenario.map
        pieces = (
            np.zeros((0, 5), np.float32) if features is None else map_pieces(features.polyline, features.feature_type)
        )
        parts.append((np.concatenate(motion, axis=2), tracks.valid[rows], size, kind[rows], pieces))
    if not parts:
        raise BadParameter(f"{database}: no road user is there for {STEPS * STEP:g} s; give another database")
    shape = [max(len(each) for each in column) for column in zip(*parts, strict=True)]
    longest = max(len(part[1][0]) for part in parts)
    found = Recordings(
        torch.zeros(len(parts), shape[0], longest, 5),
        torch.zeros(len(parts), shape[0], longest, dtype=torch.bool),
        torch.ones(len(parts), shape[0], 2),
        torch.zeros(len(parts), shape[0], dtype=torch.long),
        torch.full((len(parts), max(1, shape[4]), 5), -1.0),
    )
    for row, (states, ok, build, kind, pieces) in enumerate(parts):
        count, steps = ok.shape
        found.states[row, :count, :steps], found.ok[row, :count, :steps] = map(torch.from_numpy, (states, ok))
        found.build[row, :count], found.kind[row, :count] = map(torch.from_numpy, (build, kind))
        found.pieces[row, : len(pieces)] = torch.from_numpy(pieces)
    return found


def train(run: FitRun, config: TokenConfig, start: str | None = None) -> TokenModel:
    """Train a model of tokens, on a GPU if there is one.

    Args:
        run: The run; what the model is measured on, see ``token_training.measured``.
        config: Network and training.
        start: Run whose weights and tokens it begins with, of equal networks.

    Raises:
        BadParameter: No road user is there for the time of a token, or the run to begin with has another network.
        LakeError: The run to begin with cannot be loaded.
    """
    lake = run.lake
    begun = None if start is None else load_tokens(lake.files, start)
    own, given = asdict(config if begun is None else begun.config), asdict(config)
    others = [f"{name}={own[name]}" for name in _NETWORK if own[name] != given[name]]
    if others:
        raise BadParameter(
            f"the network of run {start} has {', '.join(others)}; give the same: -p {' -p '.join(others)}"
        )
    recordings = read_recordings(lake, run.database)
    model = make_model(config, recordings, run.seed, config.device, begun)
    tested = {name: read_recordings(lake, name) for name in run.tests}
    fit_tokens(run, model, recordings, tested, {"start": None if begun is None else weights_digest(begun)})
    model.cpu().eval()
    return model
