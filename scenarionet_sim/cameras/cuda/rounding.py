"""NumPy's ``ceil`` and ``floor`` of a number, which numba-cuda 0.30 has for arrays on the processor only."""

from __future__ import annotations

import math
from functools import partial
from typing import Any

import numpy as np


def support_rounding() -> None:
    """Let numba-cuda compile ``np.ceil`` and ``np.floor`` of a number like those of ``math``."""
    from numba.cuda import ufuncs

    known: dict[Any, Any] = ufuncs.ufunc_db()
    for function, of_math in ((np.ceil, math.ceil), (np.floor, math.floor)):
        lower = partial(_lower, of_math)
        known.setdefault(function, {"f->f": lower, "d->d": lower})


def _lower(function: Any, context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
    """Write the code of a call, as a lowering function of numba."""
    from numba.cuda import mathimpl

    find: Any = mathimpl.get_unary_impl_for_fn_and_ty
    return find(function, signature.args[0])(context, builder, signature, arguments)
