"""A multilayer perceptron and the Adam optimizer in NumPy, without further dependencies."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import pairwise

import numpy as np
import numpy.typing as npt

from scenarionet_data.arrays.dtypes import Float64

Layers = list[Float64]


class Perceptron:
    """Dense layers with tanh between them.

    Args:
        sizes: Number of inputs, of units per hidden layer, and of outputs.
        rng: Source of the orthogonal initial weights.
        last: Scale of the last layer's weights: small for actions, 1 for values.

    Attributes:
        parameters: Weights (inputs, outputs) and biases (outputs,), layer by layer; updated in place.
    """

    def __init__(self, sizes: Sequence[int], rng: np.random.Generator, last: float) -> None:
        self.parameters: Layers = []
        for layer, (inputs, outputs) in enumerate(pairwise(sizes)):
            scale = last if layer == len(sizes) - 2 else np.sqrt(2.0)
            square = np.linalg.qr(rng.normal(size=(max(inputs, outputs),) * 2))[0]
            self.parameters += [scale * square[:inputs, :outputs], np.zeros(outputs)]

    def __call__(self, inputs: npt.NDArray[np.floating]) -> Float64:
        """Return outputs (B, outputs) for inputs (B, inputs)."""
        return self.forward(inputs)[-1]

    def forward(self, inputs: npt.NDArray[np.floating]) -> Layers:
        """Return the values of all layers, from the inputs to the outputs."""
        values: Layers = [np.asarray(inputs, np.float64)]
        count = len(self.parameters) // 2
        for layer in range(count):
            total = values[-1] @ self.parameters[2 * layer] + self.parameters[2 * layer + 1]
            values.append(np.tanh(total) if layer < count - 1 else total)
        return values

    def backward(self, values: Layers, gradient: Float64) -> Layers:
        """Return the gradients of a loss by ``parameters``, given its gradient by the outputs (B, outputs)."""
        found: Layers = []
        for layer in reversed(range(len(self.parameters) // 2)):
            found = [values[layer].T @ gradient, gradient.sum(axis=0), *found]
            if layer:
                gradient = (gradient @ self.parameters[2 * layer].T) * (1.0 - values[layer] ** 2)
        return found


class Adam:
    """Adam (Kingma and Ba, 2015) with clipping of the global gradient norm."""

    def __init__(self, parameters: Layers, rate: float, longest: float = 0.5) -> None:
        self._parameters, self._rate, self._longest = parameters, rate, longest
        self._mean = [np.zeros_like(values) for values in parameters]
        self._square = [np.zeros_like(values) for values in parameters]
        self._steps = 0

    def step(self, gradients: Layers) -> None:
        """Update the parameters."""
        self._steps += 1
        length = np.sqrt(sum(float((gradient**2).sum()) for gradient in gradients))
        shorten = min(1.0, self._longest / (length + 1e-12))
        rate = self._rate * np.sqrt(1.0 - 0.999**self._steps) / (1.0 - 0.9**self._steps)
        for values, gradient, mean, square in zip(self._parameters, gradients, self._mean, self._square, strict=True):
            mean += 0.1 * (shorten * gradient - mean)
            square += 0.001 * ((shorten * gradient) ** 2 - square)
            values -= rate * mean / (np.sqrt(square) + 1e-8)
