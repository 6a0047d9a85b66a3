"""A trained driver without torch: its network in NumPy, from a checkpoint, and as ONNX for other programs."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from scenarionet_data import version
from scenarionet_data.arrays.dtypes import Array, Float32
from scenarionet_data.errors import BadParameter, MissingDependency
from scenarionet_data.storage import checkpoints, evaluation_runs
from scenarionet_data.storage.files.lake_files import LakeFiles
from scenarionet_sim.environments.config import OBSERVATIONS, PAPER_OBSERVATION
from scenarionet_sim.sensors.base import Sensor

PREFIX = "runs/"
"""Name of a policy that is a trained driver: ``runs/NAME`` or, at a checkpoint, ``runs/NAME@12``."""

_OPSET, _IR = 17, 8
"""Versions of ONNX that runtimes since 2022 read."""


class TrainedDriver:
    """Drives by the mode of a trained policy; a driver of ``scenarionet sim`` and of FlatEnv.

    Args:
        layers: Weights (outputs, inputs) and biases (outputs,) of each dense layer.
        activation: Between the layers: ``tanh`` or ``relu``.
        bins: Actions of each control of a discrete policy; 0 for a continuous one.
        is_squashed: Whether the last layer's outputs pass tanh.
        sensors: What it sees.
    """

    def __init__(
        self,
        layers: Sequence[tuple[Float32, Float32]],
        activation: str,
        bins: int = 0,
        *,
        is_squashed: bool = False,
        sensors: tuple[Sensor, ...] = PAPER_OBSERVATION,
    ) -> None:
        self._layers, self._bins, self._is_squashed = tuple(layers), bins, is_squashed
        self._activation, self.sensors = activation, sensors

    @classmethod
    def of_arrays(cls, arrays: Mapping[str, Array], bins: int, observation: str = "paper") -> TrainedDriver:
        """Return the driver of the arrays of a checkpoint, of any algorithm, that sees a name in ``OBSERVATIONS``."""
        is_squashed = "policy.log_std" not in arrays and not bins  # TD3
        first = "policy.0." if is_squashed else "policy.body."
        names = [name for name in arrays if name.startswith(first) and name.endswith(".weight")]
        names.sort(key=lambda name: int(name.split(".")[-2]))
        layers = [(arrays[name], arrays[name.removesuffix("weight") + "bias"]) for name in names]
        activation = "relu" if is_squashed else "tanh"
        return cls(layers, activation, bins, is_squashed=is_squashed, sensors=OBSERVATIONS[observation])

    def __call__(self, observations: Float32) -> Float32:
        """Return steering and throttle (B, 2) in [-1, 1] for observations (B, D)."""
        values = observations
        for number, (weight, bias) in enumerate(self._layers):
            values = values @ weight.T + bias
            if number < len(self._layers) - 1:
                values = np.tanh(values) if self._activation == "tanh" else np.maximum(values, 0.0)
        if self._bins:
            best = values.reshape(len(values), 2, self._bins).argmax(axis=2)
            return np.asarray(best * (2.0 / (self._bins - 1)) - 1.0, np.float32)
        return np.tanh(values) if self._is_squashed else np.clip(values, -1.0, 1.0)

    def act(self, observation: Float32) -> Float32:
        """Return steering and throttle for one observation (D,)."""
        controls: Float32 = self(np.asarray(observation, np.float32)[None])[0]
        return controls

    def export_onnx(self, path: str | Path) -> None:
        """Write the driver as ONNX: input ``observations`` (B, D), output ``controls`` (B, 2), both float32.

        Raises:
            MissingDependency: The package onnx is not installed.
        """
        try:
            import onnx
            from onnx import TensorProto, helper, numpy_helper
        except ModuleNotFoundError as error:
            raise MissingDependency("ONNX files need onnx", "learn") from error
        nodes: list[Any] = []
        constants: list[Any] = []

        def add(operation: str, inputs: list[str], output: str, **attributes: Any) -> str:
            nodes.append(helper.make_node(operation, inputs, [output], **attributes))
            return output

        def constant(values: npt.ArrayLike, name: str) -> str:
            constants.append(numpy_helper.from_array(np.asarray(values, order="C"), name))
            return name

        last = "observations"
        for number, (weight, bias) in enumerate(self._layers):
            given = [last, constant(weight, f"weight{number}"), constant(bias, f"bias{number}")]
            last = add("Gemm", given, f"dense{number}", transB=1)
            if number < len(self._layers) - 1:
                last = add("Tanh" if self._activation == "tanh" else "Relu", [last], f"hidden{number}")
        if self._bins:
            last = add("Reshape", [last, constant(np.array([-1, 2, self._bins]), "shape")], "logits")
            last = add("Cast", [add("ArgMax", [last], "best", axis=2, keepdims=0)], "value", to=TensorProto.FLOAT)
            last = add("Mul", [last, constant(np.float32(2.0 / (self._bins - 1)), "width")], "scaled")
            add("Sub", [last, constant(np.float32(1.0), "one")], "controls")
        elif self._is_squashed:
            add("Tanh", [last], "controls")
        else:
            bounds = [constant(np.float32(-1.0), "low"), constant(np.float32(1.0), "high")]
            add("Clip", [last, *bounds], "controls")
        width = self._layers[0][0].shape[1]
        graph = helper.make_graph(
            nodes,
            "driver",
            [helper.make_tensor_value_info("observations", TensorProto.FLOAT, ["B", width])],
            [helper.make_tensor_value_info("controls", TensorProto.FLOAT, ["B", 2])],
            constants,
        )
        model = helper.make_model(graph, opset_imports=[helper.make_opsetid("", _OPSET)], ir_version=_IR)
        model.producer_name = version.name_and_version()
        onnx.checker.check_model(model)
        Path(path).write_bytes(model.SerializeToString())


def pinned(files: LakeFiles, policy: str) -> str:
    """Return ``runs/NAME@NUMBER`` for ``runs/NAME``, with its newest checkpoint.

    Raises:
        BadParameter: The run does not exist or has no checkpoint.
    """
    name, _, number = policy.removeprefix(PREFIX).partition("@")
    known = checkpoints.numbers(files, name)
    wanted = int(number) if number.isdecimal() else (known[-1] if known and not number else -1)
    if wanted not in known:
        trained = [run for run in evaluation_runs.names(files) if checkpoints.numbers(files, run)]
        raise BadParameter(f"no checkpoint {policy!r}; trained drivers: {', '.join(trained) or 'none'}")
    return f"{PREFIX}{name}@{wanted}"


def load_driver(files: LakeFiles, policy: str) -> TrainedDriver:
    """Return the driver of a run, ``runs/NAME`` or ``runs/NAME@NUMBER``.

    Raises:
        BadParameter: The run does not exist or has no checkpoint.
        LakeError: It is damaged.
    """
    name, _, number = pinned(files, policy).removeprefix(PREFIX).partition("@")
    checkpoint = checkpoints.load(files, name, int(number))
    if checkpoint is None:
        raise BadParameter(f"checkpoint {policy!r} was removed meanwhile; use the newest one, runs/{name}")
    run = evaluation_runs.describe(files, name)
    observation = run.get("observation", "paper")  # runs of older versions do not say
    return TrainedDriver.of_arrays(checkpoint.arrays, int(run["config"]["bins"]), observation)
