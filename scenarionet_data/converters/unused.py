"""Find raw files that a conversion does not use, for its report."""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Callable, Collection, Iterator
from pathlib import Path

from scenarionet_data.converters.splits import is_of_split
from scenarionet_data.ingest.listing import walk
from scenarionet_data.ingest.passed_over import PassedOver

_CHECKSUMS = (".md5", ".sha1", ".sha256", ".crc32", ".crc32c", ".sig", ".asc")
_PARTIAL = (".gstmp", ".part", ".partial", ".tmp", ".crdownload", ".aria2")


def unused_files(
    raw: Path, is_used: Callable[[Path], bool], split: str = "", ignored: Collection[str] = ()
) -> Iterator[PassedOver]:
    """Yield the files below a folder that are not used, grouped by ending and reason, with an example of each.

    Args:
        raw: The folder; nothing is yielded for anything else.
        is_used: Whether a conversion uses a file.
        split: Split that is converted: files below folders named after others are grouped by that.
        ignored: Names of folders that are counted and not searched.
    """
    groups: Counter[tuple[str, str]] = Counter()
    examples: dict[tuple[str, str], str] = {}
    for place, folders, files in walk(raw):
        inside = [f"folders {name}" for name in folders if name in ignored]
        folders[:] = sorted(name for name in folders if name not in ignored)
        found = [(what, "its content is not read", what.removeprefix("folders ")) for what in inside]
        for name in sorted(files):
            path = Path(place, name)
            if not is_used(path):
                found.append((f"files {_ending(name)}", _reason(path, raw, split), name))
        for what, reason, name in found:
            groups[what, reason] += 1
            examples.setdefault((what, reason), Path(place, name).relative_to(raw).as_posix())
    for (what, reason), count in sorted(groups.items()):
        example = examples[what, reason]
        yield PassedOver(f"{what}: {example}" if count == 1 else f"{what}, for example {example}", count, reason)


def counted(what: str, count: int, reason: str) -> Iterator[PassedOver]:
    """Yield a group if there is anything in it."""
    if count:
        yield PassedOver(what, count, reason)


def _ending(name: str) -> str:
    """Pattern of a file's name: its ending, with N for numbers, or the name itself."""
    _, dot, ending = name.rpartition(".")
    return f"*.{re.sub('[0-9]{3,}', 'N', ending)}" if dot and ending else name


def _reason(path: Path, raw: Path, split: str) -> str:
    if split and not is_of_split(path, raw, split):
        return f"of another split than {split}"
    if path.name.endswith(_PARTIAL):
        return "an unfinished download"
    if path.name.endswith(_CHECKSUMS):
        return "a checksum"
    return "not read by this converter"
