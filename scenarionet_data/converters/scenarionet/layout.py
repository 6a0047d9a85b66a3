"""How a pickle writes each field, recorded on import so that the export can write the same pickle again.

The lake has one form for all datasets: float32 arrays, ids as str, speeds in m/s, null for what is unknown.
ScenarioNet's converters and versions differ in dtypes, shapes, containers, names and placeholders. A layout holds what
the lake's form does not state: a form per field (see :mod:`.columns`), and the values of fields that the lake does not
represent. Values that are large or differ between tracks or features are kept in the extras of these (``own``).
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from functools import lru_cache
from typing import Any

import numpy as np

from scenarionet_data.converters.scenarionet.columns import OWN, literal, pack
from scenarionet_data.converters.scenarionet.values import to_plain

LAYOUT = "pickle"
"""Key of the layout in the extras of a scenario, and of own values in the extras of a track or map feature."""

SIZES = ("length", "width", "height")
STATES = ("position", "heading", "velocity", "valid", *SIZES)
LINES = ("polyline", "polygon", "position")
LINKS = {
    "entry_lanes": "entry_lanes",
    "exit_lanes": "exit_lanes",
    "left_neighbor": "left_neighbors",
    "right_neighbor": "right_neighbors",
    "left_boundaries": "left_boundaries",
    "right_boundaries": "right_boundaries",
    "lane": "controlled_lanes",
}
"""ScenarioNet's lists of ids and the lake's; neighbours and boundaries are records in Waymo's pickles."""

_MEMBERS = {"tracks", "dynamic_map_states", "map_features", "metadata", "length"}
_DERIVED = {"ts", "object_summary"}
_SAME_DISTANCE = 1e-3
_SIMPLE = (str, int, float, bool, type(None))
_ID_KINDS = {int: "int", np.int64: "int", np.int32: "int", str: "str", np.str_: "str", dict: "records"}

Members = Mapping[Any, Mapping[str, Any]]


def describe_pickle(description: Mapping[str, Any]) -> dict[str, Any]:
    """Return the layout of everything but tracks, lights, known map features and the summary of objects."""
    metadata = description["metadata"]
    times = np.asarray(metadata["ts"])
    return {
        "description": to_plain({key: value for key, value in description.items() if key not in _MEMBERS}),
        "metadata": to_plain({key: value for key, value in metadata.items() if key not in _DERIVED}),
        "ts": {
            "dtype": times.dtype.str,
            "first": float(times[0]),
            "is_list": not isinstance(metadata["ts"], np.ndarray),
        },
    }


def describe_tracks(tracks: Members, is_size_unknown: Iterable[bool], own: list[dict[str, Any]]) -> dict[str, Any]:
    """Return the columns of tracks; add what is kept with each track to ``own``.

    Args:
        tracks: The pickle's.
        is_size_unknown: (N,) whether the lake's size is an assumption.
        own: (N,) to be filled.
    """
    states: list[dict[str, str]] = []
    rest: list[dict[str, str]] = []
    for (key, track), unknown, kept in zip(tracks.items(), is_size_unknown, own, strict=True):
        state = track["state"]
        forms = {name: _state_form(name, value, unknown) for name, value in state.items()}
        _keep(kept, "state", state, forms)
        states.append(forms)
        metadata = {name: _metadata_form(name, value, key) for name, value in track["metadata"].items()}
        _keep(kept, "metadata", track["metadata"], metadata)
        others = {name: OWN for name in track if name not in ("type", "state", "metadata")}
        _keep(kept, "track", track, others)
        rest.append({"type": literal(track["type"]), **{f"metadata.{name}": form for name, form in metadata.items()}})
    return {"ids": _id_kinds(tracks), "state": _columns(states), "track": _columns(rest)}


def describe_lights(lights: Members) -> dict[str, Any]:
    """Return the columns of traffic lights."""
    forms = []
    for key, light in lights.items():
        found = {
            name: _light_form(name, value, key) for name, value in light.items() if name not in ("state", "metadata")
        }
        found |= {f"state.{name}": _states_form(name, value) for name, value in light["state"].items()}
        metadata = light.get("metadata", {})
        found |= {f"metadata.{name}": _id_form(value, key) or literal(value) for name, value in metadata.items()}
        forms.append(found)
    return {"ids": _id_kinds(lights), "light": _columns(forms)}


def describe_features(features: Members, has_thirds: bool, own: list[dict[str, Any]]) -> dict[str, Any]:
    """Return the columns of map features; add what is kept with each feature to ``own``.

    Args:
        features: The pickle's, of known types.
        has_thirds: Whether third coordinates are not heights.
        own: (M,) to be filled.
    """
    forms = []
    for feature, kept in zip(features.values(), own, strict=True):
        found = {name: _feature_form(name, value, feature) for name, value in feature.items()}
        _keep(kept, "feature", feature, found)
        forms.append(found)
    if has_thirds:
        _keep_thirds(features, own)
    return {"ids": _id_kinds(features), "feature": _columns(forms)}


def describe_objects(
    summary: Mapping[Any, Any] | None,
    tracks: Members,
    valid: np.ndarray[Any, Any],
    distances: np.ndarray[Any, Any],
) -> dict[str, Any] | None:
    """Return the columns of ``object_summary``, and its entries that are not those of the tracks, such as ``sdc``.

    Args:
        summary: The pickle's; None if it has none.
        tracks: The pickle's.
        valid: (N, T).
        distances: (N,) travelled by each track [m].
    """
    if summary is None:
        return None
    lengths, runs, known = valid.sum(axis=1).tolist(), _first_runs(valid), set()
    forms: list[dict[str, str]] = []
    for row, (key, track) in enumerate(tracks.items()):
        found = {}
        if key in summary:
            known.add(key)
            told = {"type": track["type"], "valid_length": lengths[row], "continuous_valid_length": runs[row]}
            for name, value in summary[key].items():
                found[name] = name if told.get(name, ...) == value else _id_form(value, key) or literal(value)
            for name in {"moving_distance", "distance"} & set(found):
                if abs(summary[key][name] - distances[row]) <= _SAME_DISTANCE * (1 + distances[row]):
                    found[name] = "distance"
        forms.append(found)
    others = {key: entry for key, entry in summary.items() if key not in known}
    return {"columns": _columns(forms), "others": to_plain(others)}


def _first_runs(valid: np.ndarray[Any, Any]) -> list[int]:
    """(N,) number of timesteps of each track's first unbroken run."""
    steps = valid.shape[1]
    first = valid.argmax(axis=1)
    is_over = ~valid & (np.arange(steps) > first[:, None])
    end = np.where(is_over.any(axis=1), is_over.argmax(axis=1), steps)
    runs: list[int] = np.where(valid.any(axis=1), end - first, 0).tolist()
    return runs


def _columns(forms: Sequence[Mapping[str, str]]) -> dict[str, Any]:
    names = dict.fromkeys(name for found in forms for name in found)
    return {name: pack([found.get(name) for found in forms]) for name in names}


def _keep(own: dict[str, Any], part: str, values: Mapping[str, Any], forms: Mapping[str, str]) -> None:
    """Add the values whose form is ``OWN``."""
    kept = {str(name): to_plain(values[name]) for name, form in forms.items() if form == OWN}
    if kept:
        own[part] = kept


def _id_kinds(members: Members) -> Any:
    """Column of the type of the keys."""
    return pack(["int" if isinstance(key, int | np.integer) else "str" for key in members]) if members else "str"


def _id_form(value: Any, key: Any) -> str | None:
    """Form of a value that repeats the member's key, as ``str`` or ``int``; None for others."""
    if type(value) is str and value == str(key):
        return "str"
    return "int" if type(value) is int and str(value) == str(key) else None


def _metadata_form(name: str, value: Any, key: Any) -> str:
    if name in ("object_id", "original_id"):
        form = _id_form(value, key)
        if form:
            return form
    return literal(value) if name in ("type", "object_id", "track_length", "dataset") else OWN


def _state_form(name: str, value: Any, is_size_unknown: bool) -> str:
    if name not in STATES or (name in SIZES and is_size_unknown) or not isinstance(value, np.ndarray):
        return OWN
    if name == "velocity" and value.shape[1:] != (2,):
        return OWN
    return array_form(value)


def array_form(array: np.ndarray[Any, Any]) -> str:
    """Dtype and number of coordinates of an array (n,), (n, 1), (n, 2) or (n, 3): ``<f8``, ``<f8 1``, ..."""
    return _array_form(array.dtype, array.shape[1:])


@lru_cache(maxsize=256)
def _array_form(dtype: np.dtype[Any], shape: tuple[int, ...]) -> str:
    return " ".join([dtype.str, *map(str, shape)])


def _light_form(name: str, value: Any, key: Any) -> str:
    if name == "stop_point":
        return _point_form(value)
    return (_id_form(value, key) if name == "lane" else None) or literal(value)


def _point_form(value: Any) -> str:
    """Form of one point: container or dtype, and number of coordinates."""
    is_array = isinstance(value, np.ndarray) and value.ndim == 1 and value.dtype.kind == "f"
    is_list = type(value) in (list, tuple) and all(type(number) is float for number in value)
    if not (is_array or is_list) or len(value) not in (2, 3) or not np.isfinite(value).all():
        return literal(value)
    return f"point {value.dtype.str if is_array else type(value).__name__} {len(value)}"


def _states_form(name: str, value: Any) -> str:
    """Form of a light's state; the oldest have their stop points in it, too."""
    if name != "object_state" or not isinstance(value, list | tuple | np.ndarray):
        return literal(value)
    if any(isinstance(state, int | np.integer) for state in value):
        return literal(value)
    return value.dtype.str if isinstance(value, np.ndarray) else type(value).__name__


def _feature_form(name: str, value: Any, feature: Mapping[str, Any]) -> str:
    if name == "type":
        return name
    if name in LINES:
        return OWN if name == "polyline" and "position" in feature else _line_form(value)
    if name in LINKS:
        if type(value) is not list:
            return literal(value) if value is None else OWN
        kinds = {_ID_KINDS.get(type(item), OWN) for item in value}
        return "none" if not value else kinds.pop() if len(kinds) == 1 else OWN
    if name == "width" and isinstance(value, np.ndarray) and value.ndim == 2 and value.size:
        count = len(feature.get("polyline", ()))
        if value.any():
            return array_form(value) if len(value) in (1, count) else OWN
        return f"{array_form(value)} 0" if len(value) == count else OWN
    return literal(value) if isinstance(value, _SIMPLE) else OWN


def _line_form(line: Any) -> str:
    """Form of points: container and number of coordinates; that of their container for lists."""
    if isinstance(line, np.ndarray) and line.dtype.kind == "f":
        if line.ndim == 2 and len(line):
            return array_form(line)
        return _point_form(line) if line.ndim == 1 and len(line) else OWN
    if type(line) not in (list, tuple) or not len(line):
        return literal(line) if line is None or not len(line) else OWN
    first = line[0]
    if isinstance(first, np.ndarray) and first.dtype.kind == "f":
        return f"{type(line).__name__} of {first.dtype.str} {len(first)}"
    if type(first) in (list, tuple) and all(type(number) is float for number in first):
        return f"{type(line).__name__} of {type(first).__name__} {len(first)}"
    return OWN


def _keep_thirds(features: Members, own: list[dict[str, Any]]) -> None:
    """Add third coordinates of lines in millionths, as differences: nuScenes' lanes have a heading [rad] there."""
    for name in LINES:
        rows = [(feature[name], kept) for feature, kept in zip(features.values(), own, strict=True) if name in feature]
        rows = [(line, kept) for line, kept in rows if line is not None and len(line) and _width(line[0]) == 3]
        thirds = np.fromiter((point[2] for line, _ in rows for point in line), np.float64)
        starts = np.cumsum([0, *(len(line) for line, _ in rows)])
        millionths = np.rint(thirds * 1e6).astype(np.int64)
        steps = np.diff(millionths, prepend=0)
        steps[starts[:-1]] = millionths[starts[:-1]]
        listed = steps.tolist()
        for (_, kept), start, end in zip(rows, starts[:-1].tolist(), starts[1:].tolist(), strict=True):
            if any(listed[start:end]):
                kept.setdefault("thirds", {})[name] = listed[start:end]


def _width(point: Any) -> int:
    return len(point) if isinstance(point, list | tuple | np.ndarray) else 0
