"""Import direction and folder layout, and the architecture page that documents them."""

from __future__ import annotations

import ast
import subprocess
from functools import cache
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[1]
PACKAGES = ("scenarionet_data", "scenarionet_sim", "pipelines")
TOP = {
    "build_backend.py", "pyproject.toml", "Makefile", "README.md", "LICENSE", ".gitignore", "docs", "pipelines",
    "scenarionet_data", "scenarionet_sim", "schemas", "sql", "tests", ".ci",
}  # fmt: skip
ALSO_ALLOWED = {"CHANGELOG.md", "CONTRIBUTING.md", "CITATION.cff", "SECURITY.md", "mkdocs.yml", ".github"}
LAYERS = (
    "errors", "version", "public_names", "cards", "optional_imports", "compiled", "arrays", "schema", "scenario",
    "building", "statistics", "codec", "ingest", "procedural", "converters", "execution", "interchange",
    "criticality", "storage", "databases", "query", "operations", "loader", "learning", "samples", "forecasts",
    "embeddings", "quality", "catalogue", "packs", "export", "publishing", "maintenance", "conversion", "variations",
    "logical", "generation", "lake", "plots", "display", "testing",
)  # fmt: skip
"""Parts of scenarionet_data; each imports only itself and parts before it."""
SIMULATOR_LAYERS = (
    "arrays", "scenarios", "threads", "roads", "task", "worlds", "backends", "cameras", "sensors", "render", "policies",
    "planners", "simulation", "environments", "bridges", "drivers", "rollouts", "metrics", "evaluation", "borders",
    "regression", "learning",
)  # fmt: skip
"""Rooms of scenarionet_sim, likewise."""
FORBIDDEN_WORDS = ("utils", "helpers", "common", "manager", "misc")


def modules(package: str) -> list[Path]:
    return sorted((ROOT / package).rglob("*.py"))


@cache
def parsed(path: Path) -> ast.Module:
    return ast.parse(path.read_text("utf-8"))


@cache
def import_statements(path: Path) -> list[ast.Import | ast.ImportFrom]:
    """The imports anywhere in a file; expressions have none."""
    found: list[ast.Import | ast.ImportFrom] = []
    waiting: list[ast.AST] = [parsed(path)]
    while waiting:
        for node in ast.iter_child_nodes(waiting.pop()):
            if isinstance(node, ast.Import | ast.ImportFrom):
                found.append(node)
            elif isinstance(node, ast.stmt | ast.excepthandler | ast.match_case):
                waiting.append(node)
    return found


@cache
def imported(path: Path) -> set[str]:
    """Every module imported anywhere in a file, with the names imported from it."""
    found = set()
    for node in import_statements(path):
        if isinstance(node, ast.Import):
            found |= {alias.name for alias in node.names}
        elif node.module:
            found |= {node.module} | {f"{node.module}.{alias.name}" for alias in node.names}
    return found


def reaches(path: Path, *forbidden: str) -> list[str]:
    return [f"{path.relative_to(ROOT)} imports {name}" for name in sorted(imported(path))
            if any(name == f or name.startswith(f + ".") for f in forbidden)]  # fmt: skip


@cache
def import_graph() -> dict[str, set[str]]:
    """The project's own modules that each module imports: at the top, inside functions and for type checking only."""
    roots = {"scenarionet_data": ROOT, "scenarionet_sim": ROOT, "scenarionet_pipelines": ROOT / "pipelines"}
    files = {}
    for package, root in roots.items():
        for path in (root / package).rglob("*.py"):
            parts = path.relative_to(root).with_suffix("").parts
            files[".".join(parts[:-1] if parts[-1] == "__init__" else parts)] = path
    graph: dict[str, set[str]] = {}
    for module, path in files.items():
        found = set()
        for node in import_statements(path):
            if isinstance(node, ast.Import):
                names = [alias.name for alias in node.names]
            elif node.module and not node.level:
                names = [f"{node.module}.{alias.name}" for alias in node.names]
            else:
                continue
            for name in names:
                while name and name not in files:
                    name = name.rpartition(".")[0]
                found.add(name)
        graph[module] = found - {"", module}
    return graph


def circles(graph: dict[str, set[str]]) -> list[set[str]]:
    """Sets of modules that import each other: those remaining after repeatedly removing modules without imports."""
    reachable: dict[str, set[str]] = {}
    for module in graph:
        seen: set[str] = set()
        waiting = [module]
        while waiting:
            new = graph[waiting.pop()] - seen
            seen |= new
            waiting += new
        reachable[module] = seen
    found = [{b for b in reachable[a] if a in reachable[b]} for a in graph if a in reachable[a]]
    return [circle for number, circle in enumerate(found) if circle not in found[:number]]


def test_import_cycles_are_detected():
    graph = {"a": {"b"}, "b": {"c"}, "c": {"b", "d"}, "d": {"d"}, "e": {"a"}}
    assert circles(graph) == [{"b", "c"}, {"d"}]


def test_no_import_cycles():
    assert circles(import_graph()) == []


@pytest.mark.parametrize(("package", "layers"), [("scenarionet_data.", LAYERS), ("scenarionet_sim.", SIMULATOR_LAYERS)])
def test_packages_import_only_lower_layers(package, layers):
    wrong = []
    for module, imports in import_graph().items():
        for other in imports:
            if module.startswith(package) and other.startswith(package):
                part, below = module.split(".")[1], other.split(".")[1]
                if layers.index(below) > layers.index(part):
                    wrong.append(f"{module} imports {other}")
    assert wrong == []


def test_top_level_package_is_imported_by_users_only():
    """``scenarionet_data`` imports its public names from all packages, so they must not import from it."""
    parts = {module: imports for module, imports in import_graph().items() if module.startswith("scenarionet_data.")}
    assert [module for module, imports in parts.items() if "scenarionet_data" in imports] == []


def test_simulator_does_not_import_the_generator():
    assert [line for path in modules("scenarionet_sim") for line in reaches(path, "scenarionet_data.procedural")] == []


def test_imports_go_one_way():
    wrong = []
    for path in modules("scenarionet_data"):
        wrong += reaches(
            path, "scenarionet_sim", "pipelines", "click", "rich", "dask", "pybullet", "gymnasium", "tests"
        )
    for path in modules("scenarionet_sim"):
        wrong += reaches(path, "pipelines", "tests")
    for path in modules("pipelines"):
        wrong += reaches(path, "tests")
    assert wrong == []


def test_browser_and_report_do_not_import_the_command_line():
    sources = [path for part in ("web", "report") for path in modules(f"pipelines/scenarionet_pipelines/{part}")]
    assert len(sources) > 10
    assert [line for path in sources for line in reaches(path, "scenarionet_pipelines.cli")] == []


def test_converters_do_not_import_the_lake():
    above = (
        "schema", "codec", "storage", "databases", "query", "operations", "loader", "quality", "packs", "export",
        "publishing", "maintenance", "execution", "conversion", "lake", "plots",
    )  # fmt: skip
    lake = [f"scenarionet_data.{name}" for name in above]
    sources = [*modules("scenarionet_data/converters"), *modules("scenarionet_data/procedural")]
    assert [line for path in sources for line in reaches(path, *lake)] == []


def test_no_converter_imports_a_devkit():
    devkits = ("tensorflow", "waymo_open_dataset", "av2", "nuscenes", "nuplan", "l5kit", "metadrive", "argoverse")
    assert [line for path in modules("scenarionet_data") for line in reaches(path, *devkits)] == []


def test_duckdb_is_imported_only_by_the_engine():
    users = {str(path.relative_to(ROOT)) for path in modules("scenarionet_data") if reaches(path, "duckdb")}
    engine = {f"scenarionet_data/query/{name}.py" for name in ("engine", "statements", "views")}
    assert users == engine | {"scenarionet_data/publishing/ducklake.py"}


def test_top_level_matches_the_page():
    tracked = subprocess.run(["git", "ls-files"], cwd=ROOT, capture_output=True, text=True, check=False)
    if tracked.returncode:
        pytest.skip("not a git checkout: the top level cannot be told from what was built in it")
    assert {name.split("/")[0] for name in tracked.stdout.split()} - ALSO_ALLOWED == TOP


@pytest.mark.parametrize("package", PACKAGES)
def test_module_names_are_specific(package):
    names = {part for path in modules(package) for part in path.relative_to(ROOT).with_suffix("").parts}
    assert names.isdisjoint(FORBIDDEN_WORDS)


def type_names(path: Path) -> list[str]:
    """Classes and type aliases that a module defines at its top level."""
    found = []
    for node in parsed(path).body:
        if isinstance(node, ast.ClassDef):
            found.append(node.name)
        elif isinstance(node, ast.AnnAssign) and isinstance(node.target, ast.Name):
            if "TypeAlias" in ast.unparse(node.annotation):
                found.append(node.target.id)
        elif isinstance(node, ast.Assign) and isinstance(node.targets[0], ast.Name):
            name = node.targets[0].id
            found += [name] if name[0].isupper() and not name.isupper() else []
    return found


def test_no_two_types_share_a_name():
    places: dict[str, list[str]] = {}
    for package in PACKAGES:
        for path in modules(package):
            for name in type_names(path):
                places.setdefault(name, []).append(str(path.relative_to(ROOT)))
    assert {name: found for name, found in places.items() if len(found) > 1} == {}


def test_architecture_page_names_every_package():
    page = (ROOT / "docs" / "explanation" / "architecture.md").read_text("utf-8")
    rooms = {path.relative_to(ROOT / "scenarionet_data").parts[0] for path in modules("scenarionet_data")}
    missing = [room for room in sorted(rooms) if not room.startswith("__") and room not in page]
    assert missing == []
    simulator = {path.relative_to(ROOT / "scenarionet_sim").parts[0] for path in modules("scenarionet_sim")}
    assert [room for room in sorted(simulator) if not room.startswith("__") and room not in page] == []
    questions = {path.name for path in (ROOT / "sql").iterdir() if path.is_dir()}
    assert [name for name in questions if f"{name}/" not in page] == []


def test_no_machine_specific_paths():
    """No path of a particular machine, and no folder beside the checkout except in the CI script."""
    words = ("/" + "work/", "../" + "shared", "/" + "root/")
    files = [path for folder in (*PACKAGES, "tests", "docs", "schemas", "sql") for path in (ROOT / folder).rglob("*")]
    files += [ROOT / "README.md", ROOT / "Makefile", ROOT / "pyproject.toml"]
    for path in files:
        if path.suffix in {".py", ".md", ".toml", ".sql", ".json", ""} and path.is_file():
            text = path.read_text("utf-8", errors="ignore")
            assert not [word for word in words if word in text], path


def num_parameters(function: ast.FunctionDef | ast.AsyncFunctionDef) -> int:
    """Number of named parameters besides ``self`` and ``cls``."""
    named = function.args.posonlyargs + function.args.args + function.args.kwonlyargs
    return sum(parameter.arg not in ("self", "cls") for parameter in named)


def test_parameters_are_counted():
    function = ast.parse("def f(self, a, /, b, *rest, c, **more): ...").body[0]
    assert isinstance(function, ast.FunctionDef) and num_parameters(function) == 3


@pytest.mark.parametrize(("package", "most"), [("scenarionet_data", 13), ("scenarionet_sim", 5), ("pipelines", 0)])
def test_few_functions_have_more_than_eight_parameters(package, most):
    """Pass what belongs together as a named tuple or dataclass; lower the number when fewer are left."""
    nodes = ((path, node) for path in modules(package) for node in ast.walk(parsed(path)))
    long = [f"{path.relative_to(ROOT)}:{node.lineno} {node.name}" for path, node in nodes
            if isinstance(node, ast.FunctionDef | ast.AsyncFunctionDef) and num_parameters(node) > 8]  # fmt: skip
    assert len(long) <= most, long
