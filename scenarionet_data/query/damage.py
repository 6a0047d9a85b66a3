"""Find the damaged file behind an error of DuckDB, whose messages name neither file nor remedy."""

from __future__ import annotations

import re
from collections.abc import Iterable

from scenarionet_data.errors import LakeError
from scenarionet_data.query.statements import can_decode
from scenarionet_data.storage.files.errors import damaged
from scenarionet_data.storage.files.lake_files import READ_IN_PLACE, LakeFiles
from scenarionet_data.storage.files.places import is_url

_READING = re.compile(
    "parquet|thrift|zstd|lz4|compress|utf-?8|unicode|memory|dictionary|corrupt|internal|invalidated|page|io error|"
    "bit ?pack|rle|offset|buffer|read|what type|protocol",
    re.IGNORECASE,
)
"""Words in errors that can have their cause in a file."""


def damage(files: LakeFiles, scanned: Iterable[str], error: Exception, sql: str) -> LakeError | None:
    """The error for a damaged file that a query reads; None if there is none.

    Args:
        files: The lake.
        scanned: Files that its views read.
        error: The error of DuckDB.
        sql: The query.
    """
    if not _READING.search(str(error)):
        return None
    named = re.findall(rf"{re.escape(str(files.root))}/([^'\"\n]+?\.parquet)", f"{error}\n{sql}")
    others = [name for name in scanned if not (is_url(files.root) and name.startswith(READ_IN_PLACE))]
    only_read = []
    for name in dict.fromkeys([*named, *others]):
        try:
            if not files.are_verified([name]):
                files.read(name)
                only_read.append(str(files.path(name)))
        except LakeError as found:
            return found
    for path in only_read if not is_url(files.root) else ():  # of version 0.1: Arrow passes over what DuckDB does not
        if not can_decode(path):
            return damaged(path, "DuckDB cannot decode it")
    return None
