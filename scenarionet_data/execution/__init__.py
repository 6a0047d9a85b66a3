"""Executors that run jobs in this process, in worker processes or elsewhere."""
