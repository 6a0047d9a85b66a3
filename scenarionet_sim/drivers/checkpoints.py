"""Checkpoints of training runs: tensors as safetensors and the rest as JSON, in ``results/<run>/checkpoints``.

The JSON file is published last and marks its checkpoint as complete; it holds the digest of the tensors. The format of
the tensors is https://github.com/huggingface/safetensors, which needs no package to be read.
"""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from xxhash import xxh3_128_hexdigest

from scenarionet_data.arrays.dtypes import Array
from scenarionet_data.errors import LakeError
from scenarionet_data.storage import sealed_json
from scenarionet_data.storage.files.errors import reading, writing
from scenarionet_data.storage.files.lake_files import LakeFiles

_DTYPES = {
    "F64": np.float64, "F32": np.float32, "I64": np.int64, "I32": np.int32, "U8": np.uint8, "BOOL": np.bool_,
}  # fmt: skip
_NAMES = {np.dtype(dtype): name for name, dtype in _DTYPES.items()}


@dataclass(frozen=True, eq=False)
class Checkpoint:
    """Where a training run stands.

    Attributes:
        number: Its number in the run, from 1.
        facts: JSON-serialisable: rounds, steps, the series of scenarios.
        arrays: Networks, optimizers, random states, experience and environment, by name.
    """

    number: int
    facts: Mapping[str, Any]
    arrays: Mapping[str, Array]


def save(files: LakeFiles, run: str, checkpoint: Checkpoint, keep: int = 2) -> int:
    """Publish a checkpoint and remove all but the newest ones; return its size [bytes]."""
    data = encode(checkpoint.arrays)
    temporary = files.temporary()
    with writing(temporary, temporary):
        temporary.write_bytes(data)
    files.publish(temporary, _tensors(run, checkpoint.number))
    facts = {**checkpoint.facts, "number": checkpoint.number, "tensors": xxh3_128_hexdigest(data)}
    files.publish_new(_json(run, checkpoint.number), sealed_json.seal(facts, _json(run, checkpoint.number)))
    for old in numbers(files, run)[:-keep]:
        files.remove(_json(run, old))
        files.remove(_tensors(run, old))
    return len(data)


def load(files: LakeFiles, run: str, number: int | None = None) -> Checkpoint | None:
    """Return a checkpoint of a run, by default the newest; None if there is none yet.

    Raises:
        LakeError: It is damaged.
    """
    known = numbers(files, run)
    if not known or (number is not None and number not in known):
        return None
    number = known[-1] if number is None else number
    path, tensors = files.path(_json(run, number)), files.path(_tensors(run, number))
    try:
        with reading(path):
            facts, _ = sealed_json.read(path.read_bytes(), _json(run, number))
        with reading(tensors):
            data = tensors.read_bytes()
        if xxh3_128_hexdigest(data) != facts["tensors"]:
            raise ValueError("its tensors differ from those that were written")
        return Checkpoint(number, facts, decode(data))
    except (ValueError, KeyError) as error:
        raise LakeError(
            f"{path}: a damaged checkpoint, {error}; remove this file to continue with the checkpoint before it"
        ) from error


def numbers(files: LakeFiles, run: str) -> list[int]:
    """Numbers of the complete checkpoints of a run, ascending."""
    names = files.names(f"results/{run}/checkpoints", ".json")
    return sorted(int(name.rpartition("/")[2].removesuffix(".json")) for name in names)


def encode(arrays: Mapping[str, Array]) -> bytes:
    """Return arrays as a safetensors file."""
    header: dict[str, Any] = {}
    parts, end = [], 0
    for name, array in arrays.items():
        values = np.asarray(array)
        part = values.tobytes()
        place = [end, end + len(part)]
        header[name] = {"dtype": _NAMES[values.dtype], "shape": list(values.shape), "data_offsets": place}
        parts.append(part)
        end += len(part)
    text = json.dumps(header).encode()
    text += b" " * (-len(text) % 8)
    return b"".join([len(text).to_bytes(8, "little"), text, *parts])


def decode(data: bytes) -> dict[str, Array]:
    """Return the arrays of a safetensors file.

    Raises:
        ValueError: It is damaged.
    """
    size = int.from_bytes(data[:8], "little")
    header = json.loads(data[8 : 8 + size])
    header.pop("__metadata__", None)
    found = {}
    for name, entry in header.items():
        begin, end = (8 + size + offset for offset in entry["data_offsets"])
        found[name] = np.frombuffer(data[begin:end], _DTYPES[entry["dtype"]]).reshape(entry["shape"])
    return found


def _json(run: str, number: int) -> str:
    return f"results/{run}/checkpoints/{number:06d}.json"


def _tensors(run: str, number: int) -> str:
    return f"results/{run}/checkpoints/{number:06d}.safetensors"
