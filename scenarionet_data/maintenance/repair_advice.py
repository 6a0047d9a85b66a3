"""Advice on repairing damaged files of a lake, by kind of file."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Iterable

import pyarrow as pa

from scenarionet_data.storage import checkpoints

_SHOWN = 3
_OF_FOLDER = {
    "databases": "restore it from a copy of the lake, or `scenarionet db drop LAKE {reference} --force` and create it "
    "again (`scenarionet db rebase` does, if its members have changed)",
    "layers": "restore it from a copy of the lake, or `scenarionet db tag LAKE --drop {reference} --force` and tag "
    "again",
    "results": "remove the run's folder and simulate again",
    "checkpoints": "remove it: training goes on from the checkpoint before it",
    "strays": "remove it: training does not read it",
    "origins.json": "restore it from a copy of the pack",
    "lake.json": "restore it from a copy of the lake; without it nothing else can be verified",
}
_MERGED = "`scenarionet maintain fsck LAKE --repair` merges it again"
_ORDER = "`scenarionet maintain fsck LAKE --repair` computes it again"
_SNAPSHOT = (
    "restore it from a copy of the lake, or remove it: the previous snapshot has everything except what was added by it"
)
_OLDER = (
    "the newest snapshot does not need it: `scenarionet db rebase` the databases made on older ones, then "
    "`scenarionet maintain vacuum LAKE --keep-last 1 --yes`; or restore it from a copy of the lake"
)
_MANIFEST = "restore it from a copy of the lake; without it the shards of its snapshots are unknown"


class Inputs:
    """Recordings that the files of a snapshot were converted from.

    Args:
        manifests: Its shards, as rows of ``schemas/shards.toml``.
    """

    def __init__(self, manifests: Iterable[pa.Table]) -> None:
        self._names: dict[str, dict[str, None]] = defaultdict(dict)
        columns = ["dataset", "version", "split", "items", "files", "metadata_file"]
        for shards in manifests:
            for row in shards.select(columns).to_pylist():
                place = " ".join(filter(None, (row["dataset"], row["version"], row["split"])))
                for file in filter(None, (*row["files"], row["metadata_file"])):
                    self._names[file] |= dict.fromkeys(f"{place}: {item}" for item in row["items"])

    def of(self, file: str) -> list[str]:
        """Raw inputs of a file, each with its dataset, version and split."""
        return list(self._names.get(file, ()))


def remedy(file: str, newest: Inputs) -> str:
    """Return how to repair a damaged file, depending on the newest snapshot."""
    folder, _, rest = file.partition("/")
    if folder == "snapshots":
        kind = rest.partition("-")[0]
        return {"manifest": _MANIFEST, "order": _ORDER}.get(kind, _SNAPSHOT)
    if "/merged-" in file and folder == "metadata":
        return _MERGED
    listed = newest.of(file)
    if listed:
        more = f" and {len(listed) - _SHOWN:,} more" if len(listed) > _SHOWN else ""
        return (
            "restore it from a copy of the lake, or `scenarionet maintain fsck LAKE --repair` and convert again "
            f"{', '.join(listed[:_SHOWN])}{more}"
        )
    if folder == "results" and "/checkpoints/" in rest:
        folder = "checkpoints" if checkpoints.is_name(rest.rpartition("/")[2]) else "strays"
    name, _, version = rest.removesuffix(".parquet").partition("/")
    return _OF_FOLDER.get(folder, _OLDER).format(reference=f"{name}@{version}")
