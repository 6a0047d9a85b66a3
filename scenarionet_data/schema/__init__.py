"""Table schemas, read from ``schemas/*.toml``."""
