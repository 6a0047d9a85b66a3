"""fsck of evaluation results and kept moments."""

from __future__ import annotations

from scenarionet_data.maintenance.findings import Findings
from scenarionet_data.schema import tables
from scenarionet_data.storage import checkpoints, evaluation_runs, kept_moments
from scenarionet_data.storage.files.lake_files import LakeFiles
from scenarionet_data.storage.integrity.file_checks import Damage, Written, check_file


def check(files: LakeFiles, found: Findings, *, is_deep: bool) -> None:
    """Check the description and the parts of every evaluation run."""
    for run in evaluation_runs.names(files):
        description = evaluation_runs.file_name(run)
        with found.of(description):
            found.saw(description, is_older=not evaluation_runs.parse(files, run)[1])
        if description in found.broken:
            continue  # the seals of the others cover its id
        for table in files.folders(f"results/{run}"):
            if table in evaluation_runs.RUN_TABLES:
                _check_parts(files, f"results/{run}/{table}", table, found, is_deep=is_deep)
        found.refuse_folders(files, f"results/{run}/checkpoints")
        for name in files.names(f"results/{run}/checkpoints") if is_deep else ():
            with found.of(name):
                checkpoints.verify_file(files, name)
        with found.of(description):
            _check_complete(files, run, found)


def check_moments(files: LakeFiles, found: Findings, *, is_deep: bool) -> None:
    """Check the description and the parts of every version of kept moments."""
    for kept in (kept for listed in kept_moments.every(files) for kept in listed):
        description = f"{kept.folder}/run.json"
        with found.of(description):
            found.saw(description, is_older=not kept.description()[1])
        if description not in found.broken:  # the seals of the others cover its id
            _check_parts(files, f"{kept.folder}/moments", "moments", found, is_deep=is_deep)


def _check_parts(files: LakeFiles, folder: str, table: str, found: Findings, *, is_deep: bool) -> None:
    found.refuse_folders(files, folder)
    for name in files.names(folder, ".parquet"):
        with found.of(name):
            intact = check_file(files, name, Written(), table=table, is_deep=is_deep)
            found.saw(name, is_older=intact.is_older)


def _check_complete(files: LakeFiles, run: str, found: Findings) -> None:
    """Find parts of which only some tables exist; that of the last table is written last."""
    *others, last = [tag.partition("/")[0] for tag in evaluation_runs.describe(files, run)["tables"]]
    for name in files.names(f"results/{run}/{last}", ".parquet"):
        part = name.rpartition("/")[2]
        missing = (f"results/{run}/{table}/{part}" for table in others if table in tables.TABLES)
        found.damages += (Damage(other, "gone") for other in missing if not files.has(other))
