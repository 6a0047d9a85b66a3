"""Footers of Parquet files, checked before Arrow or DuckDB parse them: both may end the process over a damaged one.

Depends on nothing of this package.
"""
