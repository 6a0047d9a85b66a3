"""A catalogue as a folder without recordings, which anybody who has them can compute again and compare.

``disturbances.parquet`` and ``exposure.parquet`` hold ids, hashes of contents, windows and parameters; ``definitions``
and ``figures`` the SQL; ``catalogue.json`` says of which scenarios, made with what.
"""

from __future__ import annotations

import hashlib
import json
from pathlib import Path
from typing import Any

import pyarrow as pa
import pyarrow.parquet as pq

from scenarionet_data import version
from scenarionet_data.catalogue.figures import FIGURES, definition_texts, figure_sql
from scenarionet_data.catalogue.gathering import Catalogue, gather_catalogue
from scenarionet_data.errors import BadParameter, ScenarioNotFound
from scenarionet_data.execution.progress import Progress
from scenarionet_data.query.lake_view import LakeLike, LakeView, open_view
from scenarionet_data.query.named_sql import DISTURBANCES
from scenarionet_data.query.views import dependencies
from scenarionet_data.storage.files.errors import writing

FILE = "catalogue.json"
_TABLES = ("disturbances", "exposure")


def definitions_sha256() -> str:
    """Return the digest of all SQL that the tables are computed with."""
    texts = [f"{text}\n{dependencies(text)}" for text in definition_texts().values()]
    return hashlib.sha256("\n".join(texts).encode()).hexdigest()


def write_catalogue(view: LakeView, catalogue: Catalogue, folder: str | Path) -> Path:
    """Write a catalogue into a folder that does not exist, without recordings.

    Args:
        view: The lake it was gathered from.
        catalogue: The catalogue.
        folder: The folder.

    Raises:
        BadParameter: The folder exists.
        LakeError: It cannot be written.
    """
    out = Path(folder)
    if out.exists():
        raise BadParameter(f"{out}: exists; choose another name, or remove it first")
    files = {f"definitions/{name}.sql": text for name, text in definition_texts().items()}
    files |= {f"figures/{name}.sql": f"{figure_sql(name)}\n" for name in FIGURES}
    files[FILE] = json.dumps(_described(view, catalogue), indent=2)
    with writing(out):
        for name, text in files.items():
            out.joinpath(name).parent.mkdir(parents=True, exist_ok=True)
            out.joinpath(name).write_text(text, "utf-8")
        for name in _TABLES:
            pq.write_table(getattr(catalogue, name), out / f"{name}.parquet", compression="zstd")
    return out


def compare_catalogue(lake: LakeLike, folder: str | Path, on_progress: Progress | None = None) -> list[str]:
    """Compute a catalogue again from the recordings in a lake, and return in words what differs, if anything does.

    Args:
        lake: A lake with the scenarios; others in it are left out.
        folder: The folder of the catalogue.
        on_progress: Called after each batch with the number of scenarios.

    Raises:
        BadParameter: The folder holds no catalogue.
        ScenarioNotFound: The lake lacks scenarios, or has them with another content.
    """
    path = Path(folder)
    try:
        described = json.loads((path / FILE).read_text("utf-8"))
        kept = {name: pq.read_table(path / f"{name}.parquet") for name in _TABLES}
        digest = described["definitions_sha256"]
    except (OSError, ValueError, KeyError, TypeError, pa.ArrowException) as error:
        raise BadParameter(f"{path}: no catalogue can be read from it ({error}); wanted the folder of one") from error
    view = open_view(lake)
    wanted = kept["exposure"].group_by(["scenario_id", "content_hash"]).aggregate([])
    there = view.arrow("SELECT scenario_id, content_hash FROM metadata_rows")
    missing = wanted.join(there, ["scenario_id", "content_hash"], join_type="left anti")
    if missing.num_rows:
        raise ScenarioNotFound(
            f"{view.root}: {missing.num_rows:,} of {wanted.num_rows:,} scenarios of the catalogue are not there with "
            f"the same content, for example {missing['scenario_id'][0]}; convert the recordings with "
            f"{described.get('created_with', 'the same version')} and the same options"
        )
    again = gather_catalogue(view.restrict_to(wanted["scenario_id"].to_pylist()), on_progress=on_progress)
    differences = []
    if digest != definitions_sha256():
        differences.append("the definitions are others in this version of the software")
    for name in _TABLES:
        table = getattr(again, name)
        if not table.equals(kept[name].cast(table.schema)):
            differences.append(
                f"{name}: {kept[name].num_rows:,} rows before, {table.num_rows:,} again, not all the same"
            )
    return differences


def _described(view: LakeView, catalogue: Catalogue) -> dict[str, Any]:
    """Return what the tables depend on."""
    sources = view.arrow(
        "SELECT dataset, version, count(DISTINCT scenario_id) AS scenarios, sum(meters) / 1000 AS km, "
        "sum(seconds) / 3600 AS hours FROM exposure GROUP BY ALL ORDER BY ALL",
        tables={"exposure": catalogue.exposure},
    )
    return {
        "created_with": version.name_and_version(),
        "snapshot": view.snapshot.number,
        "definitions": {name: DISTURBANCES.load(name).defaults for name in DISTURBANCES.names()},
        "definitions_sha256": definitions_sha256(),
        "sources": sources.to_pylist(),
        "left_out": catalogue.left_out,
    }
