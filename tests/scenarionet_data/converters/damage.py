"""Trials with damaged recordings, inherited by the test of every converter.

    class TestLyftDamage(DamageConformance):
        converter = Lyft()

        def damage_rows(self, raw, rng): ...

``damage_rows`` changes 1 % of the rows of the recordings in a folder in ways that occur in real data.
"""

from __future__ import annotations

import copy
import json
import re
import shutil
import traceback
import zlib
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow as pa
import pytest

from scenarionet_data.converters.base import Converter
from scenarionet_data.errors import InvalidScenario, ScenarioNetError, SourceError
from scenarionet_data.scenario.description import ScenarioDescription, Tracks

RAW_MESSAGES = re.compile(
    r"unhashable|Expected bytes|object has no attribute|not subscriptable|not supported between|not iterable"
    r"|list index out of range|could not convert|cannot convert|invalid literal|unsupported operand|Traceback"
    r"|Could not convert|ArrowInvalid|takes \d+ positional|must be real number|object is not|cannot be interpreted"
)
"""Words of Python's, NumPy's and Arrow's own messages, which say nothing to a user."""

_ARRAYS = ("position", "heading", "velocity", "size", "valid")
_COLUMNS = ("object_type", "source_type", "is_size_assumed", "is_type_assumed", "is_velocity_estimated")


@dataclass(frozen=True)
class RowDamage:
    """Damaged rows.

    Attributes:
        tracks: Ids of the tracks with damaged rows, as in the lake; with the id of the scenario in the source in front
            and a blank if ids are not unique among scenarios.
        num_added: Rows that were added, for example duplicates.
    """

    tracks: frozenset[str]
    num_added: int = 0


class DamageConformance:
    """Inherit, set ``converter``, provide the fixture ``raw``, and define ``damage_rows``."""

    converter: Converter[Any]
    split: str = "train"
    options: dict[str, Any] = {}  # noqa: RUF012
    num_damaged_inputs: int = 240

    def damage_rows(self, raw: Path, rng: np.random.Generator) -> RowDamage:
        """Damage 1 % of the rows of the recordings in ``raw`` (at least one of each kind of damage), in place."""
        raise NotImplementedError

    def damage_input(self, path: Path, rng: np.random.Generator) -> str:
        """Damage a file in a way that is specific to its format, in place; return a description.

        By default values of JSON files are replaced; other files have random bytes changed.
        """
        return damage_json(path, rng) if path.suffix == ".json" else flip_bits(path, rng)

    # --- the trials ----------------------------------------------------------------------------------

    def test_bad_rows_cost_only_themselves(self, raw: Path, tmp_path: Path) -> None:
        """With damaged rows every other object arrives unchanged, and dropped and kept rows add up."""
        before = list(self._convert(raw))
        damaged = _copied(raw, tmp_path / "damaged")
        damage = self.damage_rows(damaged, np.random.default_rng(7))
        assert damage.tracks
        after = list(self._convert(damaged))
        assert [scenario.id for scenario in after] == [scenario.id for scenario in before]
        for one, other in zip(before, after, strict=True):
            assert np.array_equal(one.origin, other.origin)
            hit = {track for track in one.tracks.ids if {track, f"{one.source.scenario_id} {track}"} & damage.tracks}
            assert _of_others(one.tracks, hit) == _of_others(other.tracks, hit)
        num_dropped = sum(
            defect.count
            for s in after
            for defect in s.defects
            if (defect.table, defect.action) == ("tracks", "dropped")
        )
        assert num_dropped
        assert _num_states(after) + num_dropped == _num_states(before) + damage.num_added

    @pytest.mark.long
    def test_damaged_inputs_give_sentences(self, raw: Path, tmp_path: Path) -> None:
        """Whatever is damaged gives scenarios, or an error of the project in words of its own."""
        files = sorted(path.relative_to(raw) for path in Path(raw).rglob("*") if path.is_file())
        wrong, refused = [], 0
        for number in range(self.num_damaged_inputs):
            rng = np.random.default_rng([zlib.crc32(self.converter.name.encode()), number])
            damaged = _copied(raw, tmp_path / "damaged")
            target = damaged / files[number // 2 % len(files)]
            how = (self.damage_input if number % 2 else damage_file)(target, rng)
            faults, was_refused = self._faults(damaged)
            wrong += [f"{number}: {target.name}, {how}: {fault}" for fault in faults]
            refused += was_refused
        counts = f"{self.num_damaged_inputs} damaged inputs, {refused} refused, {len(wrong)} wrong"
        print(f"{self.converter.name}: {counts}")  # noqa: T201
        assert wrong == [], "\n".join(wrong)

    def _convert(self, raw: Path) -> Iterator[ScenarioDescription]:
        options = self.converter.Options(**self.options)
        for shard in self.converter.shards(str(raw), self.split, self.converter.release, options):
            for record in self.converter.records(shard):
                scenario = self.converter.scenario(shard, record)
                scenario.validate()
                yield scenario

    def _faults(self, raw: Path) -> tuple[list[str], bool]:
        """Errors that are not the project's, or say something in the words of Python or Arrow; whether any was one."""
        faults: list[str] = []
        refused = False

        def attempt(action: Callable[[], Any]) -> Any:
            nonlocal refused
            try:
                return action()
            except (SourceError, InvalidScenario) as error:
                refused = True
                faults.extend([f"message {error}"] if RAW_MESSAGES.search(str(error)) else [])
            except ScenarioNetError as error:
                refused = True
                faults.append(f"{type(error).__name__}: {error}")
            except Exception as error:
                where = traceback.extract_tb(error.__traceback__)[-1]
                faults.append(f"{type(error).__name__}: {error} ({Path(where.filename).name}:{where.lineno})")
            return None

        options = self.converter.Options(**self.options)
        release = self.converter.release
        shared = attempt(lambda: list(self.converter.maps(str(raw), release, options))) or ()
        for shard in shared:
            attempt(lambda shard=shard: self.converter.map_features(shard).build(np.zeros(3)))
        for shard in attempt(lambda: list(self.converter.shards(str(raw), self.split, release, options))) or ():
            for record in attempt(lambda shard=shard: list(self.converter.records(shard))) or ():
                scenario = attempt(lambda shard=shard, record=record: self.converter.scenario(shard, record))
                if scenario is not None:
                    attempt(scenario.validate)
        return faults, refused


def _copied(raw: Path, target: Path) -> Path:
    shutil.rmtree(target, ignore_errors=True)
    shutil.copytree(raw, target, symlinks=False)
    for path in target.rglob("*"):
        path.chmod(0o755 if path.is_dir() else 0o644)
    return target


def _of_others(tracks: Tracks, hit: set[str]) -> dict[str, list[Any]]:
    """Every value of the tracks that are not ``hit``, bit for bit, by id."""
    return {
        track: [getattr(tracks, name)[row].tobytes() for name in _ARRAYS]
        + [getattr(tracks, name)[row] for name in (*_COLUMNS, "extras")]
        for row, track in enumerate(tracks.ids)
        if track not in hit
    }


def _num_states(scenarios: list[ScenarioDescription]) -> int:
    return sum(int(scenario.tracks.valid.sum()) for scenario in scenarios)


# --- damages --------------------------------------------------------------------------------------------


def flip_bits(path: Path, rng: np.random.Generator) -> str:
    """Flip 1 to 8 bits of a file."""
    data = bytearray(path.read_bytes())
    count = int(rng.integers(1, 9)) if data else 0
    for place in rng.integers(0, max(len(data), 1), count):
        data[place] ^= 1 << int(rng.integers(8))
    path.write_bytes(data)
    return f"{count} bits flipped"


def damage_file(path: Path, rng: np.random.Generator) -> str:
    """Damage a file of any format."""
    data = path.read_bytes()
    place = int(rng.integers(0, len(data) + 1))
    how = str(rng.choice(["flipped", "cut", "emptied", "garbage", "zeros", "folder", "gone", "extended"]))
    if how == "flipped":
        return flip_bits(path, rng)
    if how in ("folder", "gone"):
        path.unlink()
        if how == "folder":
            path.mkdir()
        return how
    changed = {
        "cut": data[:place],
        "emptied": b"",
        "garbage": rng.bytes(max(len(data), 1)),
        "zeros": data[:place] + bytes(min(64, len(data) - place)) + data[place + 64 :],
        "extended": data + rng.bytes(64),
    }
    path.write_bytes(changed[how])
    return f"{how} at {place}"


ODD_VALUES = (
    None,
    True,
    -1,
    0,
    1e308,
    -1e12,
    float("nan"),
    "",
    "text",
    [],
    [1, 2],
    {},
    {"a": 1},
    [None],
    2**63,
    "\ud800",
)
"""Values in place of others in JSON."""


def damage_json(path: Path, rng: np.random.Generator) -> str:
    """Replace or remove one value anywhere in a JSON file."""
    try:
        content = json.loads(path.read_bytes())
    except (OSError, ValueError):
        return flip_bits(path, rng)
    parent, key, at = None, None, content
    for _ in range(int(rng.integers(1, 7))):
        keys = list(at) if isinstance(at, dict) else range(len(at)) if isinstance(at, list) else ()
        if not len(keys):
            break
        parent, key = at, keys[int(rng.integers(len(keys)))]
        at = at[key]
    if parent is None:
        path.write_text("7")
        return "content replaced by 7"
    if rng.random() < 0.2:
        del parent[key]
        how = f"{key} removed"
    else:
        parent[key] = copy.deepcopy(ODD_VALUES[int(rng.integers(len(ODD_VALUES)))])
        how = f"{key} replaced by {parent[key]!r}"
    path.write_text(json.dumps(content))
    return how


def damage_table(table: pa.Table, rng: np.random.Generator) -> tuple[pa.Table, str]:
    """Change one column of an Arrow table: its type, its nulls, its values, or its presence."""
    index = int(rng.integers(table.num_columns))
    name, column = table.column_names[index], table.column(index)
    size = table.num_rows
    number = rng.integers(0, 100, size)
    made: dict[str, Callable[[], Any]] = {
        "text": lambda: pa.array([f"t{n}" for n in number]),
        "bytes": lambda: pa.array([b"\xff"] * size, pa.binary()),
        "bool": lambda: pa.array([True] * size),
        "null": lambda: pa.nulls(size),
        "lists": lambda: pa.array([[1.0]] * size, pa.list_(pa.float64())),
        "structs": lambda: pa.array([{"a": 1}] * size),
        "times": lambda: pa.array(number, pa.timestamp("ns")),
        "decimals": lambda: pa.array(number, pa.int64()).cast(pa.decimal128(30, 2)),
        "int8": lambda: pa.array(number, pa.int8()),
        "huge": lambda: pa.array([1e300] * size),
        "uint64": lambda: pa.array([2**64 - 1] * size, pa.uint64()),
        "some nulls": lambda: pa.array(
            [v if n > 5 else None for v, n in zip(column.to_pylist(), number, strict=True)], column.type
        ),
    }
    how = str(rng.choice([*made, "gone", "twice", "no rows"]))
    if how == "gone":
        return table.remove_column(index), f"column {name} gone"
    if how == "twice":
        return table.append_column(name, column), f"column {name} twice"
    if how == "no rows":
        return table.slice(0, 0), "no rows"
    return table.set_column(index, name, made[how]()), f"column {name}: {how}"
