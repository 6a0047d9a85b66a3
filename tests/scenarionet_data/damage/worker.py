"""A process that reads damaged lakes, one trial after the other, and prints what came of each as a line of JSON.

python -m tests.scenarionet_data.damage.worker TRIAL FIRST STEP COUNT LAKE...

The trial that is about to begin is printed before it runs: if the process dies, the parent knows of which trial.
"""

from __future__ import annotations

import hashlib
import json
import random
import shutil
import sys
import tempfile
import traceback
import warnings
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
from click.testing import CliRunner

from scenarionet_data import Lake, ScenarioLoader
from scenarionet_data.errors import ScenarioNetError
from scenarionet_data.export import export
from scenarionet_data.packs.packing import pack
from scenarionet_pipelines.cli import cli
from tests.scenarionet_data.damage.harm import harmed, harmed_footer

_TABLES = ("metadata", "tracks", "lights", "maps", "states", "shards", "results", "quarantine")
_BARE = (
    "Invalid Input Error", "IO Error", "INTERNAL Error", "FATAL Error", "Serialization Error", "Out of Memory Error",
    "Invalid Error", "TProtocolException", "Conversion Error", "Binder Error", "Catalog Error",
)  # fmt: skip
"""Beginnings of messages of DuckDB."""


def digest(scenario: Any) -> str:
    """Digest of all of a scenario but the name of its source file, which nothing else in an older lake states."""
    found = hashlib.blake2b(digest_size=8)

    def add(value: Any) -> None:
        if hasattr(value, "__dataclass_fields__"):
            for name in value.__dataclass_fields__:
                if (type(value).__name__, name) != ("Source", "file"):
                    found.update(name.encode())
                    add(getattr(value, name))
        elif isinstance(value, np.ndarray):
            found.update(repr((value.dtype, value.shape)).encode())
            found.update(repr(value.tolist()).encode() if value.dtype == object else value.tobytes())
        else:
            found.update(repr(value).encode())

    add(scenario)
    return found.hexdigest()


def loaded(root: Path) -> dict[str, str]:
    """Digest of every scenario of a lake by id."""
    return {scenario.id: digest(scenario) for scenario in ScenarioLoader(root)}


def load(root: Path, seed: int, whole: dict[str, str]) -> str:
    """Load a damaged lake and compare."""
    with harmed(root, seed) as what:
        try:
            found = loaded(root)
        except ScenarioNetError:
            return "error"
        return "same" if found == whole else f"wrong: {what}"


def footer(root: Path, seed: int, whole: dict[str, str]) -> str:
    """Read a lake with a damaged footer in one of several ways."""
    draw = random.Random(seed)
    with harmed_footer(root, seed) as name, tempfile.TemporaryDirectory() as out:
        how = draw.choices(["load", "sql", "export", "pack", "sim", "render"], [40, 44, 6, 4, 3, 3])[0]
        try:
            if how == "sql":
                parts = name.split("/")
                table = parts[2] if parts[0] == "results" else parts[0] if parts[0] in _TABLES else "metadata"
                Lake(root).sql(f"SELECT * FROM {table}")
            elif how == "export":
                loader = ScenarioLoader(root)
                export((loader[index] for index in range(min(2, len(loader)))), Path(out) / "pickles")
            elif how == "pack":
                lake = Lake(root)
                pack(lake, lake.databases[draw.randrange(len(lake.databases))], Path(out) / "pack")
            elif how in ("sim", "render"):
                return verb(root, how, Path(out))
            elif loaded(root) != whole:
                return f"wrong: footer of {name}"
        except ScenarioNetError:
            return "error"
    return "same"


VERBS: tuple[str, ...] = (
    "sql 'SELECT count(*), sum(num_objects) FROM metadata'", "sql 'SELECT * FROM tracks LIMIT 3'",
    "sql 'SELECT avg(speed) FROM states'", "sql 'SELECT * FROM results'", "sql 'SELECT score FROM metadata'",
    "filter --where 'num_objects > 1'", "stats", "list", "show", "check", "export", "pack", "sim", "render", "diff",
    "sample", "split", "lineage", "report", "files tracks", "mine", "fsck",
)  # fmt: skip


def command(root: Path, text: str, database: str, out: Path) -> list[str]:
    """Words of a command on a lake."""
    import shlex

    name, *rest = shlex.split(text)
    lake, scenario = str(root), str(out / "x")
    given = {
        "export": [lake, database, scenario],
        "pack": [lake, database, scenario],
        "sim": [lake, database, "--policy", "replay", "--to", "again", "--workers", "1", "--quiet"],
        "render": [lake, database, "-o", f"{scenario}.png"],
        "diff": [lake, database, "@1"],
        "check": [lake, *rest],
        "sample": [lake, database, "-n", "1", "--to", "drawn"],
        "split": [lake, database, "--fractions", "a=0.5", "b=0.5"],
        "lineage": [lake, database],
        "report": [lake, "-o", f"{scenario}.html"],
        "show": [lake, database],
        "mine": [lake, "following"],
        "filter": [lake, *rest, "--to", "some"],
    }
    return [name, *given.get(name, [lake, *rest])]


def verb(root: Path, text: str, out: Path) -> str:
    """Run one command on a lake; what its message is."""
    result = CliRunner().invoke(cli, command(root, text, _database(root), out))
    if result.exception is not None and not isinstance(result.exception, SystemExit):
        lines = traceback.format_exception(result.exception)
        return f"traceback: {text}: {lines[-1].strip()} {lines[-2].strip() if len(lines) > 1 else ''}"
    message = result.output.strip().splitlines()[-1] if result.output.strip() else ""
    if "Traceback" in result.output:
        return f"traceback: {text}: {message}"
    if result.exit_code and any(message.removeprefix("Error: ").startswith(bare) for bare in _BARE):
        return f"bare: {text}: {message}"
    return "error" if result.exit_code else "same"


def _database(root: Path) -> str:
    names = sorted(path.name for path in (root / "databases").iterdir()) if (root / "databases").exists() else []
    return "all" if "all" in names else (names or ["all"])[0]


def verbs(root: Path, seed: int, _: dict[str, str]) -> str:
    """Run a random command on a copy of a lake that is damaged."""
    text = random.Random(seed).choice(VERBS)
    with tempfile.TemporaryDirectory() as folder:
        copied = Path(shutil.copytree(root, Path(folder) / "lake"))
        with harmed(copied, seed) as what:
            found = verb(copied, text, Path(folder))
    return found if ":" not in found else f"{found} ({what})"


TRIALS: dict[str, Callable[[Path, int, dict[str, str]], str]] = {"load": load, "footer": footer, "verbs": verbs}


def main(trial: str, first: str, step: str, count: str, *lakes: str) -> None:
    """Run trials ``first``, ``first + step``, ... below ``count`` on private copies of lakes."""
    warnings.simplefilter("ignore")
    with tempfile.TemporaryDirectory() as folder:
        roots = [Path(shutil.copytree(lake, Path(folder) / str(k))) for k, lake in enumerate(lakes)]
        whole = [loaded(root) for root in roots] if trial != "verbs" else [{} for _ in roots]
        for seed in range(int(first), int(count), int(step)):
            print(json.dumps({"begins": seed}), flush=True)  # noqa: T201
            lake = seed // int(step) % len(roots)
            try:
                found = TRIALS[trial](roots[lake], seed, whole[lake])
            except Exception as error:  # whatever is no sentence is counted
                found = f"traceback: {''.join(traceback.format_exception(error)[-2:])}"
            print(json.dumps({"seed": seed, "lake": lakes[lake], "found": found}), flush=True)  # noqa: T201


if __name__ == "__main__":
    main(*sys.argv[1:])
