"""Random damage to one or two files of a lake, undone afterwards."""

from __future__ import annotations

import random
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

_JSON = ".json"


@contextmanager
def harmed(root: Path, seed: int) -> Iterator[str]:
    """Damage a file of a lake while the block runs; yield what was done."""
    draw = random.Random(seed)
    listed = sorted(path for path in root.rglob("*") if path.is_file() and ".tmp" not in path.parts)
    folder = draw.choice(sorted({path.relative_to(root).parts[0] for path in listed}))  # every kind as often
    files = [path for path in listed if path.relative_to(root).parts[0] == folder]
    path = draw.choice(files)
    others = [other for other in files if other != path and other.suffix == path.suffix]
    kept = {path: path.read_bytes()}
    kind = draw.choice(["bit", "byte", "bytes", "zeros", "cut", "grown", "swapped", "footer"])
    if kind == "swapped" and others:
        other = draw.choice(others)
        kept[other] = other.read_bytes()
        changed = {path: kept[other], other: kept[path]}
    else:
        changed = {path: _changed(kept[path], kind, draw)}
    try:
        for each, content in changed.items():
            each.write_bytes(content)
        yield f"{kind} in {path.relative_to(root)}"
    finally:
        for each, content in kept.items():
            each.write_bytes(content)


@contextmanager
def harmed_footer(root: Path, seed: int) -> Iterator[str]:
    """Damage the footer of a Parquet file while the block runs; yield its name."""
    draw = random.Random(seed)
    path = draw.choice(sorted(path for path in root.rglob("*.parquet") if ".tmp" not in path.parts))
    kept = path.read_bytes()
    try:
        path.write_bytes(_changed(kept, "footer", draw))
        yield path.relative_to(root).as_posix()
    finally:
        path.write_bytes(kept)


def _changed(content: bytes, kind: str, draw: random.Random) -> bytes:
    data = bytearray(content)
    if not data:
        return b"\0"
    at, size = draw.randrange(len(data)), draw.choice([2, 8, 64, 4096])
    if kind == "footer" and content.endswith(b"PAR1"):
        length = min(int.from_bytes(content[-8:-4], "little"), len(data) - 8)
        for _ in range(draw.choice([1, 1, 2, 4])):
            place = draw.randrange(len(data) - 8 - length, len(data))
            data[place] = draw.choice([data[place] ^ 1 << draw.randrange(8), draw.randrange(256)])
    elif kind == "cut":
        del data[at:]
    elif kind == "grown":
        data += draw.randbytes(size)
    elif kind == "zeros":
        data[at : at + size] = bytes(len(data[at : at + size]))
    elif kind == "bytes":
        data[at : at + size] = draw.randbytes(len(data[at : at + size]))
    elif kind == "byte":
        data[at] = draw.randrange(256)
    else:
        data[at] ^= 1 << draw.randrange(8)
    return bytes(data)
