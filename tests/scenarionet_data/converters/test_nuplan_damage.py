"""Trials with damaged nuPlan logs and maps: rows damaged in realistic ways, and files damaged in any way."""

from __future__ import annotations

import sqlite3
from contextlib import closing
from pathlib import Path

import numpy as np
import pytest

from scenarionet_data.converters.nuplan import NuPlan
from tests.fixtures import nuplan as fixture
from tests.fixtures import nuplan_drive as drives
from tests.scenarionet_data.converters.damage import DamageConformance, RowDamage, damage_json, flip_bits

ROWS = (
    "x = NULL",
    "x = 1e12",
    "y = 'north'",
    "yaw = x'00'",
    "width = 0.0",
    "height = 1e9",
    "length = NULL",
    "track_token = x'0011223344556677'",
    "lidar_pc_token = x'0011223344556677'",
)
"""Damages of rows of ``lidar_box``."""
VALUES = (
    "NULL",
    "0",
    "-1",
    "1e308",
    "9223372036854775807",
    "'text'",
    "''",
    "x''",
    "x'ff00fe'",
    "CAST(x'ff41' AS TEXT)",
)


class TestNuPlanDamage(DamageConformance):
    converter = NuPlan()
    split = "mini"
    options = {"frames": "recorded"}  # noqa: RUF012  # each state is a row

    @pytest.fixture(scope="class")
    @classmethod
    def raw(cls, tmp_path_factory: pytest.TempPathFactory) -> Path:
        drive = drives.invented(seconds=6.0)
        tags = [(70, "unprotected_left", drive.boxes["track"][0]), (10, "stopping", None)]
        root = tmp_path_factory.mktemp("nuplan") / "raw"
        return fixture.write_raw(root, [drive], scene_seconds=3.5, tags=tags)

    def damage_rows(self, raw: Path, rng: np.random.Generator) -> RowDamage:
        (path,) = raw.rglob("*.db")
        with closing(sqlite3.connect(path)) as database, database:
            rows = database.execute("SELECT rowid, lower(hex(track_token)) FROM lidar_box").fetchall()
            chosen = rng.choice(len(rows), max(len(rows) // 100, len(ROWS)), replace=False)
            for count, number in enumerate(chosen):
                database.execute(f"UPDATE lidar_box SET {ROWS[count % len(ROWS)]} WHERE rowid = ?", rows[number][:1])
            database.execute(
                "INSERT INTO lidar_box SELECT x'0102030405060708', lidar_pc_token, track_token, NULL, NULL, x, y, z, "
                "width, length, height, vx, vy, vz, yaw, confidence FROM lidar_box WHERE rowid = 1"
            )
        return RowDamage(frozenset(rows[number][1] for number in chosen) | {rows[0][1]}, num_added=1)

    def damage_input(self, path: Path, rng: np.random.Generator) -> str:
        """Change a table of a database: a value of one row or of all, a column, or the rows."""
        if path.suffix not in (".db", ".gpkg"):
            return damage_json(path, rng) if path.suffix == ".json" else flip_bits(path, rng)
        with closing(sqlite3.connect(path)) as database, database:
            names = "SELECT name FROM sqlite_master WHERE type = 'table' AND name NOT LIKE 'sqlite%' ORDER BY name"
            table = str(rng.choice([name for (name,) in database.execute(names)]))
            column = str(rng.choice([row[1] for row in database.execute(f"PRAGMA table_info({table})")]))
            some = "" if rng.random() < 0.3 else f"WHERE rowid = (SELECT rowid FROM {table} LIMIT 1)"
            statement = str(
                rng.choice(
                    [
                        *[f"UPDATE OR IGNORE {table} SET {column} = {value} {some}" for value in VALUES],
                        f"DELETE FROM {table} {some}",
                        f"ALTER TABLE {table} RENAME COLUMN {column} TO other",
                    ]
                )
            )
            try:
                database.execute(statement)
            except sqlite3.IntegrityError:  # the column must not be NULL
                database.execute(f"DELETE FROM {table} {some}")
        return statement
