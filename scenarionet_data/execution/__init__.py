"""Executors: run the jobs of a conversion, check or evaluation in this process, in worker processes or on a cluster.

executors     the :class:`Executor` protocol, :func:`run_serially` and :class:`ProcessExecutor`
worker        what a worker process does at startup, its name and its memory
worker_stats  jobs, time and memory by worker
progress      the type of ``on_progress``
"""
