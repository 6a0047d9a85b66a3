"""Checkpoints of training runs: one immutable safetensors file each, in ``results/<run>/checkpoints``.

The file's metadata have the facts as JSON, and the XXH3-128 of the file with zeros in its place, followed by the file's
place. A number belongs to the process that publishes it first, so that two processes never write into each other's
checkpoints. Earlier versions wrote two files, tensors and facts; these stay readable.

The format of the tensors is https://github.com/huggingface/safetensors, which needs no package to be read.
"""

from __future__ import annotations

import json
import re
import sys
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from xxhash import xxh3_128, xxh3_128_hexdigest

from scenarionet_data.arrays.dtypes import Array
from scenarionet_data.errors import LakeError
from scenarionet_data.storage import evaluation_runs
from scenarionet_data.storage.files.lake_files import LakeFiles
from scenarionet_data.storage.integrity import seals
from scenarionet_data.storage.integrity.file_end import Place

if sys.platform != "win32":
    import fcntl

_DTYPES = {
    "F64": np.float64, "F32": np.float32, "I64": np.int64, "I32": np.int32, "U8": np.uint8, "BOOL": np.bool_,
}  # fmt: skip
_NAMES = {np.dtype(dtype): name for name, dtype in _DTYPES.items()}
_FILE = re.compile(r"checkpoint-(\d+)\.safetensors|(\d+)\.json")
_ZEROS = b"0" * 32


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


@contextmanager
def only_process(files: LakeFiles, run: str) -> Iterator[None]:
    """Keep other processes of this machine from training a run; the lock ends with the process, however it ends.

    In an object store, or on another machine whose locks are not seen here, :func:`save` tells two processes apart.

    Raises:
        LakeError: Another process trains it.
    """
    if not isinstance(files.root, Path) or sys.platform == "win32":
        yield
        return
    with files.path(evaluation_runs.file_name(run)).open("rb") as claimed:
        try:
            fcntl.flock(claimed, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except BlockingIOError as error:
            raise LakeError(
                f"run {run}: another process trains it now; wait for its end, or train under another name"
            ) from error
        except OSError:  # a file system without locks
            pass
        yield


def save(files: LakeFiles, run: str, checkpoint: Checkpoint, keep: int = 2) -> int:
    """Publish a checkpoint and remove all but the newest ones; return its size [bytes].

    Raises:
        LakeError: Another process has published this one or a later one.
    """
    check_free(files, run, checkpoint.number)
    name = _file(run, checkpoint.number)
    data = encode(checkpoint.arrays, {"digest": _ZEROS.decode(), "facts": json.dumps(dict(checkpoint.facts))})
    data = data.replace(_ZEROS, _digest(data, files.place_to_write(name)), 1)
    if not files.publish_new(name, data):
        check_free(files, run, checkpoint.number)
    for old in numbers(files, run)[:-keep]:
        for part in (_file(run, old), *_older_files(run, old)):
            if files.has(part):
                files.remove(part)
    return len(data)


def check_free(files: LakeFiles, run: str, number: int) -> None:
    """Check that no other process has published a checkpoint of this number or a later one.

    Raises:
        LakeError: It has.
    """
    newest = max(numbers(files, run), default=0)
    if number <= newest:
        raise LakeError(
            f"run {run}: another process trains it, too, and has written checkpoint {newest}; this process ends, and "
            "nothing is lost"
        )


def load(files: LakeFiles, run: str, number: int | None = None) -> Checkpoint | None:
    """Return a checkpoint of a run, by default the newest; None if there is none yet.

    Raises:
        LakeError: It is damaged.
    """
    known = numbers(files, run)
    if not known or (number is not None and number not in known):
        return None
    number = known[-1] if number is None else number
    name = _file(run, number)
    older, tensors = _older_files(run, number)
    is_older = not files.has(name)
    path = files.path(older if is_older else name)
    try:
        if is_older:
            facts, _ = seals.read_json(files.content(older), files.place(older))
            data = files.content(tensors)
            if xxh3_128_hexdigest(data) != facts["tensors"]:
                raise ValueError("its tensors differ from those that were written")
            return Checkpoint(number, facts, decode(data)[0])
        data, place = files.content(name), files.place(name)
        try:
            arrays, metadata = decode(data)
            written = metadata["digest"].encode()
        except (ValueError, KeyError, TypeError, AttributeError) as error:
            raise ValueError("it is cut off, or its header differs from the one that was written") from error
        if len(written) != len(_ZEROS) or written != _digest(data.replace(written, _ZEROS, 1), place):
            raise ValueError("its bytes differ from those that were written under this name in this lake")
        return Checkpoint(number, json.loads(metadata["facts"]), arrays)
    except (ValueError, KeyError, TypeError, AttributeError) as error:
        raise LakeError(
            f"{path}: a damaged checkpoint, {error}; remove this file to continue with the checkpoint before it"
        ) from error


def numbers(files: LakeFiles, run: str) -> list[int]:
    """Numbers of the complete checkpoints of a run, ascending."""
    found = (_FILE.fullmatch(name.rpartition("/")[2]) for name in files.names(f"results/{run}/checkpoints"))
    return sorted({int(match[1] or match[2]) for match in found if match})


def verify(files: LakeFiles, run: str) -> None:
    """Verify every byte of all checkpoints of a run.

    Raises:
        LakeError: One is damaged, or not the file that was published under its name.
    """
    for number in numbers(files, run):
        load(files, run, number)


def verify_file(files: LakeFiles, name: str) -> None:
    """Verify every byte of a file among the checkpoints of a run.

    Raises:
        LakeError: It is damaged, not the file that was published under its name, or not of a checkpoint.
    """
    _, run, _, file = name.split("/")
    found = _FILE.fullmatch(file)
    if found:
        load(files, run, int(found[1] or found[2]))
    elif not is_name(file):
        raise LakeError("not a file of a checkpoint; remove it")


def is_name(file: str) -> bool:
    """Return whether a file among checkpoints has the name of one; an earlier version wrote two, tensors first."""
    return bool(_FILE.fullmatch(file) or re.fullmatch(r"\d+\.safetensors", file))


def encode(arrays: Mapping[str, Array], metadata: Mapping[str, str] | None = None) -> bytes:
    """Return arrays, sorted by name, as a safetensors file."""
    header: dict[str, Any] = {} if metadata is None else {"__metadata__": dict(metadata)}
    parts, end = [], 0
    for name, array in sorted(arrays.items()):
        values = np.asarray(array)
        part = values.tobytes()
        place = [end, end + len(part)]
        header[name] = {"dtype": _NAMES[values.dtype], "shape": list(values.shape), "data_offsets": place}
        parts.append(part)
        end += len(part)
    text = json.dumps(header).encode()
    text += b" " * (-len(text) % 8)
    return b"".join([len(text).to_bytes(8, "little"), text, *parts])


def decode(data: bytes) -> tuple[dict[str, Array], dict[str, str]]:
    """Return the arrays and the metadata of a safetensors file.

    Raises:
        ValueError: It is damaged.
    """
    size = int.from_bytes(data[:8], "little")
    header = json.loads(data[8 : 8 + size])
    metadata = header.pop("__metadata__", {})
    found = {}
    for name, entry in header.items():
        begin, end = (8 + size + offset for offset in entry["data_offsets"])
        found[name] = np.frombuffer(data[begin:end], _DTYPES[entry["dtype"]]).reshape(entry["shape"])
    return found, metadata


def _digest(blank: bytes, place: Place) -> bytes:
    digest = xxh3_128(blank)
    digest.update(seals.covered(place))
    return digest.hexdigest().encode()


def _file(run: str, number: int) -> str:
    return f"results/{run}/checkpoints/checkpoint-{number:06d}.safetensors"


def _older_files(run: str, number: int) -> tuple[str, str]:
    return f"results/{run}/checkpoints/{number:06d}.json", f"results/{run}/checkpoints/{number:06d}.safetensors"
