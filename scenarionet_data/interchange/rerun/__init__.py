"""Rerun: recordings as .rrd."""
