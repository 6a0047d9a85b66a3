"""Writing of Parquet files: shards, shared maps, rewritten files."""
