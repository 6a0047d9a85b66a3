"""Benchmarks: ``make bench``, or ``python -m tests.bench --only load``."""
