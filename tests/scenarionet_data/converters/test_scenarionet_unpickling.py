"""Pickles of every protocol are read; those that run code or forge NumPy arrays are refused."""

from __future__ import annotations

import os
import pickle
from pathlib import Path

import numpy as np
import pytest

from scenarionet_data.converters.scenarionet.unpickling import load
from scenarionet_data.errors import InvalidScenario
from tests.fixtures import scenarionet_pickles as made


class Malicious:
    """Runs a command when it is unpickled."""

    def __init__(self, marker: Path) -> None:
        self.marker = marker

    def __reduce__(self):
        return os.system, (f"touch {self.marker}",)


@pytest.mark.parametrize("protocol", range(6))
def test_pickle_that_runs_code_is_refused(protocol: int, tmp_path: Path) -> None:
    marker = tmp_path / "ran"
    description = made.waymo("x")
    description["metadata"]["source_file"] = Malicious(marker)
    path = made.write_pickle(description, tmp_path / "sd_evil.pkl", protocol)
    with pytest.raises(InvalidScenario, match=r"expected arrays and builtins, found posix\.system"):
        load(path, "sd_evil.pkl")
    assert not marker.exists()


@pytest.mark.parametrize("name", ["builtins eval", "builtins getattr", "numpy load", "numpy.core.multiarray fromfile"])
def test_other_functions_of_allowed_modules_are_refused(name: str, tmp_path: Path) -> None:
    module, _, function = name.partition(" ")
    path = tmp_path / "sd_evil.pkl"
    path.write_bytes(b"c" + module.encode() + b"\n" + function.encode() + b"\n(S'1'\ntR.")
    with pytest.raises(InvalidScenario, match=f"found {module}.{function}"):
        load(path, "evil")


class Forged:
    """A call of a NumPy constructor with inconsistent arguments that NumPy does not check."""

    def __init__(self, *call: object) -> None:
        self.call = call

    def __reduce__(self):
        return self.call


FORGERIES = {
    "objects at addresses of the pickle's choice": Forged(np.ndarray, ((1,), np.dtype(object), b"A" * 8)),
    "a dtype with fields": np.zeros(1, [("a", object)]),
    "a dtype that claims to have no objects": Forged(
        np.dtype, ("V8", False, True), (3, "|", None, ("a",), {"a": (np.dtype(object), 0)}, 8, 1, 0)
    ),
    "raw bytes for objects": Forged(
        np.ndarray, ((0,), np.dtype("i1")), (1, (1,), np.dtype(object), False, b"A" * 8)
    ),
    "fewer bytes than values": Forged(
        np.ndarray, ((0,), np.dtype("i1")), (1, (9,), np.dtype("f8"), False, b"A" * 8)
    ),
}  # fmt: skip


@pytest.mark.parametrize("forgery", FORGERIES)
@pytest.mark.parametrize("protocol", range(6))
def test_forged_arrays_do_no_harm(forgery: str, protocol: int, tmp_path: Path) -> None:
    path = made.write_pickle({"a": FORGERIES[forgery]}, tmp_path / "sd_evil.pkl", protocol)
    try:
        (found,) = load(path, "evil").values()
    except InvalidScenario:
        return
    assert forgery.startswith("objects at") and found.shape == (0,)


@pytest.mark.parametrize("protocol", range(6))
@pytest.mark.parametrize("core", ["numpy.core", "numpy._core"])
def test_names_of_numpy_1_and_2_are_read(protocol: int, core: str, tmp_path: Path) -> None:
    value = {"a": np.arange(6.0).reshape(2, 3), "b": np.float32(1.5), "c": np.array(["x", None], dtype=object)}
    data = pickle.dumps(value, protocol)
    current = f"{np.zeros(0).__reduce__()[0].__module__.rpartition('.')[0]}".encode()
    if protocol >= 4:  # names are prefixed with their length
        for module in (b".multiarray", b".numeric"):
            old, new = current + module, core.encode() + module
            data = data.replace(bytes([len(old)]) + old, bytes([len(new)]) + new)
        data = data[:2] + data[11:]  # without the frame, whose length has changed
    else:
        data = data.replace(current + b".", core.encode() + b".")
    path = tmp_path / "sd_x.pkl"
    path.write_bytes(data)
    found = load(path, "x")
    assert found["a"].tolist() == value["a"].tolist()
    assert found["b"] == value["b"] and found["c"].tolist() == ["x", None]


@pytest.mark.parametrize(
    "content", [b"", pickle.dumps({"a": list(range(99))})[:-20], b"\xff garbage", b"\x80\x63}.", b"c"]
)
def test_unreadable_pickle_says_what_was_found(content: bytes, tmp_path: Path) -> None:
    (tmp_path / "sd_x.pkl").write_bytes(content)
    with pytest.raises(InvalidScenario, match=r"expected .*, found \w+") as caught:
        load(tmp_path / "sd_x.pkl", "sd_x.pkl")
    assert "\n" not in str(caught.value)


def test_file_that_cannot_be_opened_says_why(tmp_path: Path) -> None:
    (tmp_path / "sd_x.pkl").symlink_to(tmp_path / "sd_x.pkl")
    with pytest.raises(InvalidScenario, match=r"cannot be read \(Too many levels of symbolic links\); repair the file"):
        load(tmp_path / "sd_x.pkl", "sd_x.pkl")
