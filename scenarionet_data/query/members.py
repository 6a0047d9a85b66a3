"""Where the members of a database lie in a snapshot."""

from __future__ import annotations

import pyarrow as pa

from scenarionet_data.query.engine import Engine
from scenarionet_data.schema.tables import DESCRIPTION_COLUMNS

ADDRESS_COLUMNS = tuple(
    f"{table}_{part}"
    for table in ("tracks", "lights", "maps")
    for part in ("file", "row_group", "first_row", "num_rows")
)


def locate(engine: Engine, wanted: pa.Table) -> pa.Table:
    """Address and description columns of scenarios, one row per row of ``wanted``, in its order.

    Args:
        engine: Over the snapshot to look in.
        wanted: scenario_id, and content_hash where content must not have changed.

    Returns:
        Columns as the files hold them, and ``is_found``: False where the scenario is not in the snapshot, or
        (with a content_hash) is not what it was.
    """
    numbered = wanted.append_column("_row", pa.array(range(wanted.num_rows), pa.int64()))
    same = " AND m.content_hash = w.content_hash" if "content_hash" in wanted.column_names else ""
    columns = ", ".join(f"m.{name}" for name in (*DESCRIPTION_COLUMNS[1:], *ADDRESS_COLUMNS))
    query = (
        f"SELECT w.scenario_id, {columns}, m.scenario_id IS NOT NULL AS is_found "
        f"FROM wanted w LEFT JOIN metadata_rows m ON m.scenario_id = w.scenario_id{same} ORDER BY w._row"
    )
    return engine.arrow(query, wanted=numbered)
