"""The schemas of every table, read from ``schemas/*.toml``."""
