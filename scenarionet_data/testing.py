"""Conformance suite that every converter must pass; the test of a dataset inherits it.

    class TestWaymo(ConverterConformance):
        converter = Waymo()

        @pytest.fixture(scope="class")
        @classmethod
        def raw(cls, tmp_path_factory):
            return write_waymo_fixture(tmp_path_factory.mktemp("raw"))

This module does not import pytest.
"""

from __future__ import annotations

import pickle
import shutil
from collections.abc import Callable, Iterable, Iterator
from dataclasses import fields
from itertools import islice
from pathlib import Path
from typing import Any

import numpy as np

from scenarionet_data.arrays.ragged import Ragged
from scenarionet_data.converters.base import Converter
from scenarionet_data.errors import InvalidScenario, SourceError
from scenarionet_data.ingest.input_properties import PLACEHOLDER
from scenarionet_data.ingest.shard import Shard
from scenarionet_data.scenario.description import ScenarioDescription

_converted: dict[tuple[type, str], list[ScenarioDescription]] = {}
"""The most recent result of :meth:`ConverterConformance.scenarios`."""


class ConverterConformance:
    """Inherit, set ``converter``, provide a fixture ``raw`` (the raw folder, or a PG range), run pytest.

    A class-scoped ``raw`` is converted once for all tests.
    """

    converter: Converter[Any]
    split: str = "train"
    options: dict[str, Any] = {}  # noqa: RUF012
    damaged_glob: str | None = "*"
    """Files that the damage test truncates, empties and fills with garbage; None if raw is not a folder."""

    # --- helpers for subclasses ----------------------------------------------------------------------

    def shards(self, raw: Any) -> list[Shard]:
        """Shards of ``raw`` with the suite's options."""
        options = self.converter.Options(**self.options)
        return list(self.converter.shards(str(raw), self.split, self.converter.release, options))

    def scenarios(self, raw: Any) -> list[ScenarioDescription]:
        """All scenarios of all shards; converted once per class and ``raw``."""
        key = (type(self), str(raw))
        if key not in _converted:
            _converted.clear()
            _converted[key] = list(self._convert(raw))
        return _converted[key]

    def _convert(self, raw: Any) -> Iterator[ScenarioDescription]:
        for shard in self.shards(raw):
            for record in self.converter.records(shard):
                yield self.converter.scenario(shard, record)

    # --- the suite -----------------------------------------------------------------------------------

    def test_shards_pickle_and_have_unique_keys(self, raw: Any) -> None:
        """Shards can be sent to workers, and no two describe the same work."""
        shards = self.shards(raw)
        assert shards, "no shards"
        assert [pickle.loads(pickle.dumps(shard)) for shard in shards] == shards
        keys = {shard.key(self.converter.version) for shard in shards}
        assert len(keys) == len(shards)
        assert len({shard.name for shard in shards}) == len(shards)
        assert all(shard.split == self.split and shard.dataset == self.converter.name for shard in shards)

    def test_scenarios_validate_with_unique_ids(self, raw: Any) -> None:
        """Every scenario is valid, and ids are unique across shards."""
        ids = []
        for scenario in self.scenarios(raw):
            scenario.validate()
            ids.append(scenario.id)
            assert scenario.dataset == self.converter.name
            assert scenario.split == self.split
            assert scenario.source.licence
        assert ids
        assert len(set(ids)) == len(ids)

    def test_conversion_is_deterministic(self, raw: Any) -> None:
        """The same input gives identical bits."""
        for first, second in zip(self.scenarios(raw), self._convert(raw), strict=True):
            assert differences(first, second) == []

    def test_windows_of_a_log_name_it(self, raw: Any) -> None:
        """Scenarios cut from one log name the log, so that splits can keep them together."""
        for scenario in self.scenarios(raw):
            if "@" in scenario.id:
                assert scenario.source.log

    def test_contracts_hold(self, raw: Any, tmp_path_factory: Any) -> None:
        """A lake of the scenarios breaks no hard rule of ``sql/checks``, and soft ones only within ``budgets``."""
        from scenarionet_data.conversion import convert
        from scenarionet_data.quality.checks import run_checks

        lake = tmp_path_factory.mktemp("lake")
        kind = type(self.converter)
        options = self.converter.Options(**self.options)
        convert(f"{kind.__module__}:{kind.__qualname__}", str(raw), lake, split=self.split, options=options)
        broken = [result for result in run_checks(lake).results if not result.is_met]
        assert broken == []

    def test_encodes_and_round_trips(self, raw: Any) -> None:
        """Encoding to tables and decoding gives identical bits."""
        from scenarionet_data import codec

        for scenario in self.scenarios(raw):
            shared_map = scenario.map if scenario.map_id else None
            decoded = codec.decode(codec.encode(scenario, self.converter.version), shared_map)
            assert differences(scenario, decoded) == []

    def test_damaged_files_are_named(self, raw: Any, tmp_path_factory: Any) -> None:
        """A truncated, empty or garbage file gives a SourceError or InvalidScenario, never a wrong scenario."""
        if self.damaged_glob is None:
            return
        files = sorted(path for path in Path(raw).rglob(self.damaged_glob) if path.is_file())
        assert files, f"nothing matches {self.damaged_glob}"
        for number, (how, damage) in enumerate(_DAMAGES.items()):
            copy = tmp_path_factory.mktemp("damaged") / str(number)
            shutil.copytree(raw, copy)
            target = copy / files[0].relative_to(raw)
            target.chmod(0o644)
            target.write_bytes(damage(target.read_bytes()))
            assert self._is_refused(copy), f"a file that was {how} was accepted: {files[0].name}"

    def test_files_names_everything_that_is_read(self, raw: Any, tmp_path_factory: Any) -> None:
        """A folder with nothing but the files that ``files`` names gives the same scenarios."""
        from scenarionet_data.conversion.remote_raw.mirror import relocated

        for shard in self.shards(raw)[-1:]:
            local = relocated(shard, shard.root, str(tmp_path_factory.mktemp("worker")))
            for batch in self.converter.files(local):
                _copy(Path(shard.root), Path(local.root), batch)
            for first, second in zip(*map(self._first_scenarios, (shard, local)), strict=True):
                assert differences(first, second) == []

    def test_listing_reads_only_the_listed_files(self, raw: Any, tmp_path_factory: Any) -> None:
        """Shards have the same names and inputs if all files except those in ``listed`` are placeholders."""
        if not Path(raw).is_dir():
            return
        copy = tmp_path_factory.mktemp("listed") / Path(raw).name
        shutil.copytree(raw, copy)
        for path in copy.rglob("*"):
            if path.is_file() and not any(path.match(pattern) for pattern in self.converter.listed):
                path.chmod(0o644)
                path.write_bytes(PLACEHOLDER)
        found, expected = (
            sorted((shard.name, *(item.name for item in shard.items)) for shard in self.shards(place))
            for place in (copy, raw)
        )
        assert found == expected

    def _first_scenarios(self, shard: Shard) -> list[ScenarioDescription]:
        return [self.converter.scenario(shard, record) for record in islice(self.converter.records(shard), 2)]

    def _is_refused(self, raw: Path) -> bool:
        refused = False
        try:
            for shard in self.shards(raw):
                for record in self.converter.records(shard):
                    try:
                        self.converter.scenario(shard, record)
                    except InvalidScenario:
                        refused = True
        except SourceError:
            refused = True
        return refused


def _copy(source: Path, target: Path, names: Iterable[str]) -> None:
    """Copy files by name or pattern; skip missing ones."""
    for name in names:
        for path in source.glob(name) if "*" in name else [source / name]:
            if path.is_file():
                copy = target / path.relative_to(source)
                copy.parent.mkdir(parents=True, exist_ok=True)
                shutil.copyfile(path, copy)


_DAMAGES: dict[str, Callable[[bytes], bytes]] = {
    "truncated": lambda data: data[: len(data) // 2],
    "emptied": lambda data: data[:0],
    "filled with garbage": lambda data: bytes(range(251)) * (len(data) // 251 + 1),
}


def differences(first: Any, second: Any, path: str = "scenario") -> list[str]:
    """Return the fields in which two scenarios (or parts) differ, bit for bit; NaN equals NaN."""
    if isinstance(first, np.ndarray):
        same = (
            isinstance(second, np.ndarray)
            and first.dtype == second.dtype
            and np.array_equal(first, second, equal_nan=first.dtype.kind == "f")
        )
        return [] if same else [path]
    if isinstance(first, Ragged):
        return [] if isinstance(second, Ragged) and first.is_equal(second) else [path]
    if hasattr(first, "__dataclass_fields__"):
        if type(first) is not type(second):
            return [path]
        found = []
        for field in fields(first):
            if field.compare:
                found += differences(getattr(first, field.name), getattr(second, field.name), f"{path}.{field.name}")
        return found
    return [] if first == second else [path]
