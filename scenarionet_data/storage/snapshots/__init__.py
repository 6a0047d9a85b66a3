"""Snapshots: immutable lists of the shards of a lake, and how commits publish them."""
