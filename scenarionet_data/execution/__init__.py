"""Executors: run the jobs of a conversion, check or evaluation in this process, in worker processes or on a cluster.

executors  the :class:`Executor` protocol, :func:`run_serially`, :class:`ProcessExecutor`, statistics by worker
worker     what a worker process does at startup, its name and its memory
progress   the type of ``on_progress``
"""
