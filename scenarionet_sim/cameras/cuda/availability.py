"""Whether cameras can draw on a graphics card here."""

from __future__ import annotations

from importlib.util import find_spec
from typing import Any

from numba.core import config

from scenarionet_data.errors import BadParameter, MissingDependency
from scenarionet_sim.cameras.cuda.rounding import support_rounding


def require_cuda() -> None:
    """Raise unless numba-cuda is installed and finds a graphics card.

    Raises:
        MissingDependency: numba-cuda is not installed.
        BadParameter: There is no graphics card that CUDA can use.
    """
    if find_spec("numba_cuda") is None:
        raise MissingDependency("cameras with device='cuda' need numba-cuda", "cuda", "device='cpu' needs nothing")
    import numba.cuda

    cuda: Any = numba.cuda
    settings: Any = config
    if not cuda.is_available():
        raise BadParameter(
            "device='cuda' expects a graphics card of NVIDIA with its driver, found none; draw with device='cpu'"
        )
    if not settings.ENABLE_CUDASIM:  # the simulator runs NumPy's own functions
        support_rounding()
