"""Snapshots of a lake as tables of other catalogs, over the same Parquet files."""
