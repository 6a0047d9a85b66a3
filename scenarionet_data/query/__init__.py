"""Asks the lake: DuckDB views over a snapshot's files, databases of scenarios, lineage."""
