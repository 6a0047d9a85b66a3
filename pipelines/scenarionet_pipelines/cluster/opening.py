"""Open the cluster that a profile describes, and stop processes started for it."""

from __future__ import annotations

import importlib
import logging
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager
from dataclasses import replace
from typing import TYPE_CHECKING, Any

from scenarionet_data import version
from scenarionet_data.errors import BadParameter, ClusterLost, needing
from scenarionet_pipelines.cluster import profile as profiles
from scenarionet_pipelines.cluster.profile import ClusterProfile
from scenarionet_pipelines.machine import default_workers

if TYPE_CHECKING:
    from distributed import Client

    from scenarionet_pipelines.cluster.dask_executor import DaskExecutor

_CONNECT_WITHIN = 15.0

_CLASSES = {
    "local": ("distributed", "LocalCluster", "cluster"),
    "ssh": ("distributed", "SSHCluster", "ssh"),
    "slurm": ("dask_jobqueue", "SLURMCluster", "slurm"),
    "kubernetes": ("dask_kubernetes.operator", "KubeCluster", "kubernetes"),
}
"""Dask's class for each kind: module, name, and our extra that installs it."""


@contextmanager
def open_cluster(name: str, workers: int | None = None) -> Iterator[DaskExecutor]:
    """Open a cluster until the block ends.

    Args:
        name: A profile's name, a profile's file, or a scheduler's address.
        workers: Number of workers to start instead of the profile's.

    Raises:
        BadParameter: Unknown profile, or ``workers`` given for an existing scheduler.
        MissingDependency: A package that this kind of cluster needs is not installed.
        ClusterLost: The scheduler does not answer, has no workers, or they run another version.
    """
    found = profiles.find(name)
    if workers is not None and found.kind == "scheduler":
        raise BadParameter(f"--workers: {found.address} is a running scheduler; start more workers with `dask worker`")
    found = found if workers is None else replace(found, workers=workers)
    with needing("Dask clusters need dask and distributed", "cluster"):
        dask = importlib.import_module("dask")
        from scenarionet_pipelines.cluster.dask_executor import DaskExecutor
    with ExitStack() as stack:
        # Silence warnings about busy event loops and lost workers; lost jobs are reported by the executor.
        stack.enter_context(_quiet("distributed"))
        stack.enter_context(dask.config.set(dict(found.config)))
        where = found.address or stack.enter_context(_start(found))
        client = stack.enter_context(_connected(where))
        executor = DaskExecutor(client, found.in_flight, found.patience)
        executor.wait_for_worker()
        _check_software(client)
        yield executor


def _start(profile: ClusterProfile) -> Any:
    """Start the cluster of a profile, without waiting for its workers."""
    module, name, extra = _CLASSES[profile.kind]
    with needing(f"clusters of kind {profile.kind} need {module.partition('.')[0]}", extra):
        make = getattr(importlib.import_module(module), name)
    options = dict(profile.options)
    if profile.kind == "local":
        options["n_workers"] = profile.workers or default_workers()
    try:
        cluster = make(**options)
        if profile.kind in ("slurm", "kubernetes"):
            cluster.scale(max(1, profile.workers))
        return cluster
    except Exception as error:  # from asyncssh, Kubernetes or Dask, without a common base class
        reason = " ".join(str(error).split()) or type(error).__name__
        raise ClusterLost(f"the {profile.kind} cluster does not start: {reason}; see its profile") from error


@contextmanager
def _connected(where: Any) -> Iterator[Client]:
    from distributed import Client

    try:
        client = Client(where, timeout=_CONNECT_WITHIN, set_as_default=False)
    except (OSError, ValueError) as error:
        raise ClusterLost(
            f"{where}: no scheduler answers; start one with `dask scheduler`, and workers with "
            "`dask worker ADDRESS --nthreads 1 --memory-limit 2GiB`"
        ) from error
    try:
        yield client
    finally:
        client.close(timeout=2)


def _check_software(client: Client) -> None:
    """Check that every worker runs this version: files written by another may differ.

    Raises:
        ClusterLost: A worker runs another version.
    """
    wanted = version.name_and_version()
    try:
        answers = client.run(version.name_and_version, on_error="return")
    except OSError:  # a worker just left; continue with the others
        return
    for worker, found in answers.items():
        if isinstance(found, OSError):
            continue
        if found != wanted:
            raise ClusterLost(
                f"worker {worker} runs {found!r}, this is {wanted}: install the same version on every worker "
                "and restart it"
            )


@contextmanager
def _quiet(name: str) -> Iterator[None]:
    """Silence all loggers of a package."""
    loggers = [logging.getLogger(each) for each in (name, *logging.root.manager.loggerDict) if each.startswith(name)]
    levels = [logger.level for logger in loggers]
    for logger in loggers:
        logger.setLevel(logging.CRITICAL)
    try:
        yield
    finally:
        for logger, level in zip(loggers, levels, strict=True):
            logger.setLevel(level)
