"""Queries: DuckDB views over the files of a snapshot, named SQL, and the base class of lakes."""
