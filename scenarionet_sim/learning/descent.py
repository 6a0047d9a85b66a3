"""Descent along a loss: Adam over all parameters of some networks as one tensor."""

from __future__ import annotations

from collections.abc import Iterable, Mapping

import torch
from torch import Tensor, nn


class Descent:
    """Adam (Kingma and Ba 2015) with gradients of a largest norm.

    The parameters become parts of one tensor, and so do their gradients: the norm, the clipping and the step are one
    operation each, where small networks would spend as long on the calls for each layer as on the numbers.

    Args:
        parameters: What descends.
        rate: Learning rate.
        longest_gradient: Gradients are scaled down to this norm.
    """

    def __init__(self, parameters: Iterable[nn.Parameter], rate: float, longest_gradient: float) -> None:
        self._parts, self._longest = list(parameters), longest_gradient
        self._sizes = [part.numel() for part in self._parts]
        self._all = nn.Parameter(torch.cat([part.detach().flatten() for part in self._parts]))
        self._all.grad = self._gradient = torch.zeros_like(self._all)
        values, gradients = self._split(self._all.detach()), self._split(self._gradient)
        for part, value, gradient in zip(self._parts, values, gradients, strict=True):
            part.data, part.grad = value, gradient
        self._adam = torch.optim.Adam([self._all], rate, eps=1e-5, fused=True)

    def step(self, loss: Tensor) -> None:
        """Make a step along the gradient of a loss."""
        self._gradient.zero_()
        loss.backward()
        nn.utils.clip_grad_norm_(self._all, self._longest)
        self._adam.step()

    def set_rate(self, rate: float) -> None:
        """Set the learning rate of the next steps."""
        self._adam.param_groups[0]["lr"] = rate

    def tensors(self, name: str) -> dict[str, Tensor]:
        """Return the state of the optimizer, by parameter, as tensors with names that begin with ``name``."""
        found: dict[str, Tensor] = {}
        for key, values in self._adam.state[self._all].items():
            parts = [values] * len(self._parts) if key == "step" else self._split(values)
            found |= {f"{name}.{number}.{key}": part for number, part in enumerate(parts)}
        return found

    def restore(self, name: str, tensors: Mapping[str, Tensor]) -> None:
        """Set the state of the optimizer from :meth:`tensors`; the parameters are set by their networks."""
        if f"{name}.0.step" not in tensors:
            return  # no step has been made
        numbers = range(len(self._parts))
        state = {key: torch.cat([tensors[f"{name}.{number}.{key}"].flatten() for number in numbers])
                 for key in ("exp_avg", "exp_avg_sq")}  # fmt: skip
        state["step"] = tensors[f"{name}.0.step"].clone()
        self._adam.load_state_dict(self._adam.state_dict() | {"state": {0: state}})

    def _split(self, values: Tensor) -> list[Tensor]:
        """Return the parts of a tensor that belong to the parameters, of their shapes."""
        return [part.view_as(of) for part, of in zip(values.split(self._sizes), self._parts, strict=True)]
