"""Random damage to one or two files of a lake, undone afterwards."""

from __future__ import annotations

import random
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path

_KINDS = ("bit", "byte", "bytes", "zeros", "cut", "grown", "swapped", "footer")


@dataclass(frozen=True)
class Harm:
    """Damage to a lake.

    Attributes:
        kind: What was done.
        files: Names of the damaged files, relative to the lake.
    """

    kind: str
    files: tuple[str, ...]

    def __str__(self) -> str:
        return f"{self.kind} in {' and '.join(self.files)}"


@contextmanager
def harmed(root: Path, seed: int) -> Iterator[Harm]:
    """Damage a file of a lake, or exchange two, while the block runs; each folder of the lake is damaged as often."""
    draw = random.Random(seed)
    listed = sorted(path for path in root.rglob("*") if path.is_file() and ".tmp" not in path.parts)
    folder = draw.choice(sorted({path.relative_to(root).parts[0] for path in listed}))
    files = [path for path in listed if path.relative_to(root).parts[0] == folder]
    path, kind = draw.choice(files), draw.choice(_KINDS)
    others = [other for other in files if other != path and other.suffix == path.suffix]
    if kind == "swapped" and others:
        other = draw.choice(others)
        changed = {path: other.read_bytes(), other: path.read_bytes()}
    else:
        changed = {path: _changed(path.read_bytes(), kind, draw)}
    with _replaced(changed):
        yield Harm(kind, tuple(each.relative_to(root).as_posix() for each in changed))


@contextmanager
def harmed_footer(root: Path, seed: int) -> Iterator[Harm]:
    """Damage the footer of a Parquet file while the block runs; each folder of the lake is damaged as often."""
    draw = random.Random(seed)
    listed = sorted(path for path in root.rglob("*.parquet") if ".tmp" not in path.parts)
    folder = draw.choice(sorted({path.relative_to(root).parts[0] for path in listed}))
    path = draw.choice([path for path in listed if path.relative_to(root).parts[0] == folder])
    with _replaced({path: _changed(path.read_bytes(), "footer", draw)}):
        yield Harm("footer", (path.relative_to(root).as_posix(),))


@contextmanager
def _replaced(contents: dict[Path, bytes]) -> Iterator[None]:
    """Files with other contents while the block runs."""
    kept = {path: path.read_bytes() for path in contents}
    for path, content in contents.items():
        path.write_bytes(content)
    try:
        yield
    finally:
        for path, content in kept.items():
            path.parent.mkdir(parents=True, exist_ok=True)
            path.write_bytes(content)


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
