"""Pictures: one scenario drawn, thumbnails per second, and the overview notebook over a million rows."""

from __future__ import annotations

import io
import json
import tempfile
from collections.abc import Iterator
from dataclasses import replace
from functools import partial
from pathlib import Path

from scenarionet_data import converters, plots
from scenarionet_data.scenario.description import ScenarioDescription
from tests.bench.measure import Figure, in_fresh_process, median_ms
from tests.bench.scale import write_metadata_lake
from tests.fixtures.drives import make_drive
from tests.fixtures.towns import make_town

_ROWS = 1_000_000

_OVERVIEW = """
import ast, json, os, sys, time
os.chdir(sys.argv[1])
from scenarionet_pipelines.notebooks.execution import read
cells = [cell for cell in read("overview").cells if cell.cell_type == "code"]
started, known, shown = time.perf_counter(), {}, 0
for cell in cells:
    if "scenario" in cell.metadata.get("tags", []):
        continue  # a scenario's own files: this lake is metadata alone
    tree = ast.parse(cell.source)
    exec(compile(ast.Module(tree.body[:-1], []), "cell", "exec"), known)
    value = eval(compile(ast.Expression(tree.body[-1].value), "cell", "eval"), known)
    for way in ("_repr_png_", "_repr_html_"):
        if hasattr(value, way):
            getattr(value, way)()
            shown += 1
            break
print(json.dumps({"seconds": time.perf_counter() - started, "shown": shown}))
"""


def figures(recordings: Path | None) -> Iterator[Figure]:
    """All plot benchmarks; on recorded scenarios if available."""
    for name, scenario in _scenarios(recordings):
        yield Figure(f"{name}: drawn, as PNG", median_ms(partial(_draw, scenario), 7) / 1e3, "s", "<= 0.3")
        seconds = median_ms(partial(_thumbnail, scenario), 15) / 1e3
        yield Figure(f"{name}: thumbnails", 1 / seconds, "1/s", ">= 20")
    with tempfile.TemporaryDirectory() as folder:
        draw = partial(_draw_all, replace(make_drive(), map=make_town(10_000)), Path(folder) / "town.png")
        yield Figure("a map of 10,000 features: drawn whole", median_ms(draw, 3) / 1e3, "s", "<= 0.5")
        write_metadata_lake(Path(folder) / "lake", _ROWS)
        found = json.loads(in_fresh_process(_OVERVIEW, folder))
        yield Figure(f"{_ROWS // 1000} k rows: overview notebook, imports included", found["seconds"], "s", "<= 10")


def _draw(scenario: ScenarioDescription, _: int) -> None:
    plots.scenario_figure(scenario, size=800).savefig(io.BytesIO(), format="png")


def _draw_all(scenario: ScenarioDescription, path: Path, _: int) -> None:
    plots.Drawing(size=600, view="all").save(path, scenario, now=10)


def _thumbnail(scenario: ScenarioDescription, _: int) -> None:
    plots.thumbnail(scenario)


def _scenarios(recordings: Path | None) -> Iterator[tuple[str, ScenarioDescription]]:
    yield "pg", _first("pg", "3:4")
    for dataset, place in (("waymo", "waymo/training"), ("argoverse2", "argoverse2/motion-forecasting/val")):
        if recordings and (recordings / place).exists():
            yield dataset, _first(dataset, str(recordings / place))


def _first(dataset: str, raw: str) -> ScenarioDescription:
    converter = converters.get(dataset)
    shard = next(iter(converter.shards(raw, "train", converter.release, converter.Options())))
    return converter.scenario(shard, next(iter(converter.records(shard))))
