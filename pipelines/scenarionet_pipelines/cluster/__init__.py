"""Jobs on a Dask cluster: profiles say how to get one, ``crew`` is one that follows ``conversion.runners.Run``.

Nothing here is imported before ``--cluster`` is given.
"""

from __future__ import annotations

from scenarionet_pipelines.cluster.opening import open_cluster

__all__ = ["open_cluster"]
