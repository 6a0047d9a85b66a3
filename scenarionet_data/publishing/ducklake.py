"""DuckLake (https://ducklake.select) in a DuckDB file, by DuckDB's extension."""

from __future__ import annotations

import importlib.util
from collections.abc import Mapping, Sequence
from pathlib import Path

import duckdb

from scenarionet_data.errors import LakeError, MissingDependency
from scenarionet_data.query.statements import quoted

NAME = "lake.ducklake"


def load_extension(connection: duckdb.DuckDBPyConnection) -> None:
    """Load the extension ducklake from its package, or from DuckDB's folder of installed extensions.

    Raises:
        MissingDependency: There is none for this version of DuckDB.
    """
    package = importlib.util.find_spec("duckdb_extension_ducklake")
    places = [Path(root) for root in (package.submodule_search_locations or ())] if package else []
    path = f"extensions/v{duckdb.__version__}/ducklake.duckdb_extension"
    found = [f"'{root / path}'" for root in places if (root / path).is_file()]
    try:
        connection.execute(f"LOAD {found[0] if found else 'ducklake'}")
    except duckdb.Error as error:
        raise MissingDependency(
            f"publishing as DuckLake needs the extension ducklake of DuckDB {duckdb.__version__}",
            "ducklake",
            "duckdb_extension_ducklake must have the version of duckdb",
        ) from error


def write_ducklake(folder: Path, files: Mapping[str, Sequence[str]]) -> dict[str, str]:
    """Write the catalog ``lake.ducklake``; return where each table is, the same file.

    Args:
        folder: An existing folder.
        files: Absolute paths of the Parquet files of each table; they are referenced where they are.

    Raises:
        LakeError: DuckDB cannot read a file.
    """
    path = folder / NAME
    with duckdb.connect(config={"autoinstall_known_extensions": False}) as connection:
        load_extension(connection)
        try:
            connection.execute(f"ATTACH {quoted(f'ducklake:{path}')} AS lake (DATA_PATH {quoted(f'{folder}/data/')})")
            for name, listed in files.items():
                scan = f"read_parquet([{', '.join(map(quoted, listed))}], union_by_name = true, {_FOLDERS})"
                connection.execute(f"CREATE TABLE lake.{name} AS FROM {scan} LIMIT 0")
                for file in listed:
                    connection.execute(
                        f"CALL ducklake_add_data_files('lake', '{name}', {quoted(file)}, allow_missing => true, "
                        "hive_partitioning => true)"
                    )
            connection.execute("DETACH lake")
        except duckdb.Error as error:
            raise LakeError(
                f"{path}: DuckDB cannot publish the lake ({error}); run scenarionet maintain fsck on it"
            ) from error
    return dict.fromkeys(files, str(path))


_FOLDERS = "hive_partitioning = true, hive_types_autocast = false"
"""Tables have dataset, version and split, the names of folders, as text."""
