"""Parquet row groups and footers as bytes: read and copied without Arrow where our own writer made them."""
