"""The scenarios whose vectors lie nearest to that of another."""

from __future__ import annotations

import numpy as np
import pyarrow as pa
import pyarrow.compute as pc
import pyarrow.parquet as pq

from scenarionet_data.arrays.dtypes import Float32
from scenarionet_data.databases import user_columns
from scenarionet_data.databases.record import DatabaseRecord
from scenarionet_data.databases.user_columns import UserColumn
from scenarionet_data.errors import BadParameter
from scenarionet_data.operations.database_query import check_whole
from scenarionet_data.query.lake_view import LakeView
from scenarionet_data.query.statements import quoted

_MORE = 8  # times as many candidates as are asked for, until enough of them are of the database


def embeddings_of(view: LakeView) -> list[str]:
    """Return the names of the embeddings of a lake, sorted."""
    return [record.name for record in _records(view) if user_columns.is_vector(record)]


def embedding_of(view: LakeView, name: str | None = None) -> str:
    """Return the name of an embedding; by default the only one of the lake.

    Raises:
        BadParameter: There is none of this name, or several to choose from; the message lists them.
    """
    found = embeddings_of(view)
    if name in found or (name is None and len(found) == 1):
        return name or found[0]
    listed = f"there are {', '.join(found)}" if found else "there is none yet: scenarionet db embed LAKE --name NAME"
    if name is None:
        raise BadParameter(f"{view.root}: which embedding? {listed}")
    wrong = next((f", but of type {record.type}" for record in _records(view) if record.name == name), "")
    what = f"{name!r} is a user column{wrong}" if wrong else f"no embedding {name!r} here"
    raise BadParameter(f"{view.root}: {what}; {listed}")


def similar(
    view: LakeView, scenario_id: str, k: int, by: str | None, database: DatabaseRecord | str | None
) -> pa.Table:
    """Return the nearest scenarios with their distance; see :meth:`Lake.similar <scenarionet_data.Lake.similar>`."""
    check_whole("k", k, 1)
    name = embedding_of(view, by)
    scenario_id = view.describe(scenario_id)["scenario_id"]
    path = quoted(str(view.files.verified(_file(view, name))))
    rows = f"(SELECT *, file_row_number AS number FROM read_parquet({path}, file_row_number = true))"
    found = view.engine.arrow(f"SELECT {name} FROM {rows} WHERE scenario_id = $id", {"id": scenario_id})
    if not len(found) or not found[0][0].is_valid:
        raise BadParameter(
            f"{scenario_id} has no vector in {name}; embed it with the others: scenarionet db embed --replace"
        )
    members = None if database is None else view.resolve(database)[1]["scenario_id"]
    tables = {} if members is None else {"wanted": pa.table({"scenario_id": members})}
    wanted = "metadata_rows" if members is None else "wanted"
    query = f"""
        WITH nearest AS MATERIALIZED (
            SELECT number, list_distance({name}, $vector::FLOAT[]) AS distance FROM {rows}
            ORDER BY distance, number LIMIT $most
        ),
        named AS (SELECT * FROM nearest JOIN (SELECT scenario_id, number FROM {rows}) USING (number))
        SELECT scenario_id, distance FROM named SEMI JOIN {wanted} USING (scenario_id)
        WHERE distance IS NOT NULL AND scenario_id <> $id ORDER BY distance, number LIMIT $k"""
    parameters = {"vector": found[0][0].as_py(), "id": scenario_id, "k": k}
    count = view.engine.arrow(f"SELECT count(*) FROM {rows}")[0][0].as_py()
    most = k + 1  # itself is the nearest
    while True:  # reading the ids of the nearest alone, and joining those, takes a third less than joining all
        table = view.engine.arrow(query, parameters | {"most": most}, tables=tables)
        if len(table) == k or most > count:
            return table
        most *= _MORE


def vectors(view: LakeView, name: str, scenario_ids: pa.Array) -> Float32:
    """Return the vectors (n, d) of scenarios in the given order.

    Raises:
        BadParameter: Some have none.
    """
    path = view.files.verified(_file(view, name))
    rows = pq.read_table(path, columns=["scenario_id", name]).combine_chunks()
    place = pc.index_in(scenario_ids, value_set=rows["scenario_id"].combine_chunks())
    found = rows[name].combine_chunks().take(place)
    if found.null_count:
        missing = scenario_ids.filter(pc.is_null(found))
        raise BadParameter(
            f"{len(missing)} of {len(scenario_ids)} scenarios have no vector in {name}, for example {missing[0]}; "
            "embed them with the others: scenarionet db embed --replace"
        )
    return np.asarray(found.flatten()).reshape(len(found), -1)


def _records(view: LakeView) -> list[UserColumn]:
    return [user_columns.read(view.files, *column) for column in sorted(view.user_columns.items())]


def _file(view: LakeView, name: str) -> str:
    return user_columns.file_name(name, view.user_columns[name])
