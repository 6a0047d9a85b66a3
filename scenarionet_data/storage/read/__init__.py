"""Reading of scenarios and shared maps from Parquet files."""
