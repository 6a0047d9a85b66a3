"""The damaged file behind an error of DuckDB."""

from __future__ import annotations

from types import SimpleNamespace

from scenarionet_data.query.damage import damage


def test_a_file_that_only_duckdb_cannot_decode_is_named(tmp_path):
    """Files of version 0.1 have no seals, and Arrow reads some footers that DuckDB does not."""
    good, bad = tmp_path / "good.parquet", tmp_path / "bad.parquet"
    bad.write_bytes(b"PAR1" * 9)
    files = SimpleNamespace(
        root=tmp_path, are_verified=lambda names: names == ["good.parquet"], read=lambda _: None, path=tmp_path.joinpath
    )
    found = damage(files, [good.name, bad.name], ValueError("TProtocolException: Invalid data"), "FROM metadata")
    assert str(found).startswith(f"cannot read {bad}: DuckDB cannot decode it; `scenarionet maintain check`")
