"""Run jobs on a Dask cluster: ``profile`` describes clusters, ``dask_executor`` is the executor.

Imported only if ``--cluster`` is given.
"""

from __future__ import annotations

from scenarionet_pipelines.cluster.opening import open_cluster

__all__ = ["open_cluster"]
