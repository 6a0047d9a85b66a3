"""The schemas in schemas/*.toml: frozen per version, and the Parquet writer options."""

from __future__ import annotations

import json
import re
from pathlib import Path

import pyarrow as pa
import pyarrow.parquet as pq
import pytest

from scenarionet_data import codec
from scenarionet_data.errors import SchemaMismatch
from scenarionet_data.schema import tables
from scenarionet_data.schema.package_data import SCHEMAS
from tests.fixtures.scenarios import make_scenario

UNITS = ("", "m", "m/s", "s", "rad", "rad/s", "rad/s2", "m/s2", "m/s3", "m rad", "1/(100 m)", "byte")
GOLDEN = Path(__file__).parents[2] / "golden"


def frozen(name: str) -> dict:
    """Properties that require a new version when changed: columns in order, type, unit, nullability, statistics."""
    table = tables.load(name)
    return {"table": name, "version": table.version, "columns": {c.name: _signature(c) for c in table.columns}}


def _signature(column: tables.Column) -> str:
    words = [column.type, f"[{column.unit}]" if column.unit else "", "nullable" if column.nullable else ""]
    return " ".join(filter(None, [*words, "statistics" if column.statistics else ""]))


@pytest.mark.parametrize("name", tables.TABLES)
def test_schema_changes_only_with_its_version(name):
    found = frozen(name)
    golden = GOLDEN / f"{name}-v{found['version']}.json"
    if not golden.exists():
        golden.write_text(json.dumps(found, indent=1) + "\n")
        pytest.fail(f"{golden.name} was missing and has been written: check it, commit it, run again")
    assert _difference(json.loads(golden.read_text()), found) is None


@pytest.mark.parametrize("path", sorted(GOLDEN.glob("*-v*.json")), ids=lambda path: path.stem)
def test_older_versions_lack_the_columns_added_since(path):
    golden = json.loads(path.read_text())
    table = tables.load(golden["table"])
    if table.oldest <= golden["version"]:
        columns = {c.name: _signature(c) for c in table.columns if c.since <= golden["version"]}
        assert columns == golden["columns"]


def _difference(golden: dict, found: dict) -> str | None:
    if list(golden["columns"].items()) == list(found["columns"].items()) and golden == found:
        return None
    names = {*golden["columns"], *found["columns"]}
    changed = sorted(name for name in names if golden["columns"].get(name) != found["columns"].get(name))
    what = ", ".join(changed) or "order of columns"
    return (
        f"schemas/{found['table']}.toml changed ({what}) without a new version, and lakes written before would be "
        f"misread; raise `version` to {found['version'] + 1} there and run this test again, which freezes it"
    )


def test_schema_mismatch_is_named_with_the_remedy():
    golden, found = frozen("tracks"), frozen("tracks")
    found["columns"]["x"] = "list<float32> [cm]"
    message = _difference(golden, found)
    assert "tracks.toml changed (x)" in message
    assert f"raise `version` to {tables.load('tracks').version + 1}" in message
    found = frozen("tracks")
    found["columns"] = dict(reversed(found["columns"].items()))
    assert "order of columns" in _difference(golden, found)


def test_every_golden_file_is_used():
    current = {f"{name}-v{tables.load(name).version}.json" for name in tables.TABLES}
    for path in GOLDEN.glob("*-v*.json"):
        table, version = re.fullmatch(r"(\w+)-v(\d+)", path.stem).groups()
        assert path.name in current or int(version) < tables.load(table).version


def test_every_schema_file_is_a_table():
    assert {path.stem for path in SCHEMAS.glob("*.toml")} == set(tables.TABLES)


@pytest.mark.parametrize("name", tables.TABLES)
def test_declarations_are_complete(name):
    table = tables.load(name)
    assert table.name == name
    assert table.doc.endswith(".")
    assert [column.name for column in table.columns] == table.schema.names
    for column in (*table.columns, *table.derived):
        assert re.fullmatch(r"[a-z][a-z0-9_]*", column.name)
        assert column.doc.endswith("."), column.name
        assert column.unit in UNITS, column.name
        assert table.column(column.name) is column
    for field, column in zip(table.schema, table.columns, strict=True):
        assert field.nullable == column.nullable


def test_unknown_type_is_refused():
    with pytest.raises(KeyError):
        _ = tables.Column("x", "float16", "No such type.").arrow_type


@pytest.fixture(scope="module")
def written(tmp_path_factory):
    """One file of each table that scenarios fill, written with the schema's options."""
    scenario = make_scenario(1, num_objects=40, num_steps=91, num_lanes=40, num_lights=4)
    encoded = codec.encode(scenario, "1")
    schema = tables.load("metadata").schema
    lacking = {name: (0 if name.endswith("rows") else None) for name in schema.names if name not in encoded.metadata}
    row = {**encoded.metadata, **lacking, "tracks_file": "f", "tracks_row_group": 0, "tracks_first_row": 0}
    content = {
        "metadata": pa.Table.from_pylist([row], schema=schema),
        "tracks": pa.Table.from_batches([encoded.tracks]),
        "lights": pa.Table.from_batches([encoded.lights]),
        "maps": pa.Table.from_batches([encoded.maps]),
    }
    folder = tmp_path_factory.mktemp("written")
    for name, table in content.items():
        with tables.load(name).writer(folder / f"{name}.parquet", {}) as writer:
            writer.write_table(table)
    return folder


@pytest.mark.parametrize("name", ["metadata", "tracks", "lights", "maps"])
def test_files_are_written_as_declared(written, name):
    table = tables.load(name)
    file = pq.ParquetFile(written / f"{name}.parquet")
    assert file.schema_arrow.names == table.schema.names
    assert file.read().cast(table.schema).schema.equals(table.schema)
    table.check_version(file.metadata.metadata, name)
    group = file.metadata.row_group(0)
    leaves = {group.column(i).path_in_schema: group.column(i) for i in range(group.num_columns)}
    assert set(leaves) == {column.path for column in table.columns}
    for column in table.columns:
        leaf = leaves[column.path]
        is_zstd = column.element == "json" and name not in ("tracks", "lights", "maps")
        assert leaf.compression == ("ZSTD" if is_zstd else "LZ4"), column.name
        assert leaf.is_stats_set == column.statistics, column.name
        assert ("RLE_DICTIONARY" in leaf.encodings) == (column.element == "dictionary"), (column.name, leaf.encodings)
        split = column.is_list and column.element.startswith("float")
        assert ("BYTE_STREAM_SPLIT" in leaf.encodings) == split, column.name


@pytest.mark.parametrize("name", tables.TABLES)
def test_file_of_a_newer_version_is_refused(name):
    table = tables.load(name)
    table.check_version({b"scenarionet.schema": table.tag.encode()}, "a.parquet")
    for footer in ({}, {b"scenarionet.schema": f"{name}/{table.version + 1}".encode()}):
        with pytest.raises(SchemaMismatch, match=r"^a\.parquet: written under schema .*replace=True"):
            table.check_version(footer, "a.parquet")


@pytest.mark.parametrize(("name", "wanted"), [("metadata", "zstd"), ("tracks", "lz4")])
def test_zstd_is_used_for_large_texts_that_scenarios_are_not_decoded_from(name, wanted):
    table = tables.load(name)
    large, small = (
        pa.table({c.name: pa.array([text] * 60 if c.name == "extras" else [None] * 60) for c in table.columns})
        for text in ('{"a": 1}' * 20, "{}")
    )
    assert set(table.writer_options(small)["compression"].values()) == {"lz4"}
    chosen = table.writer_options(large)["compression"]
    assert chosen.pop("extras") == wanted
    assert set(chosen.values()) == {"lz4"}
