"""Put small bugs into the core, one at a time, and count those that its tests catch.

``make mutants`` draws mutants of the areas in ``core.toml`` with a fixed seed, runs the tests of the area for each in a
clone of the last commit, and prints the share that was caught. Results are kept in ``.mutants/session.sqlite``, so an
interrupted run goes on where it stopped. Mutants in ``equivalent.toml`` change no result; others are drawn instead.

Cosmic Ray makes the mutants. Its operators that cannot change a result here are left out: decorators only compile, and
annotations are not evaluated.
"""

from __future__ import annotations

import argparse
import ast
import os
import random
import resource
import shlex
import shutil
import subprocess
import sys
import tomllib
from dataclasses import dataclass
from pathlib import Path

from cosmic_ray.commands.init import init
from cosmic_ray.mutating import mutate_and_test, mutate_code
from cosmic_ray.plugins import get_operator
from cosmic_ray.work_db import WorkDB, use_db
from cosmic_ray.work_item import MutationSpec, TestOutcome, WorkItem

ROOT = Path(__file__).parents[2]
FOLDER = ROOT / ".mutants"
CHECKOUT = FOLDER / "checkout"
NO_EFFECT = ("core/RemoveDecorator", "core/ExceptionReplacer")
KERNELS = FOLDER / "kernels"  # machine code without a mutant
LONGEST = 3.0  # times the processor time without a mutant: tests that take longer loop for ever, which counts as caught
BAR = 0.9
_MARKS = "not integration and not damage and not packaging", "integration"  # those of .ci/run: whole programs come last


@dataclass(frozen=True)
class Area:
    """A part of the core: its name, number of mutants, files, tests, and whether the tests need torch."""

    name: str
    number: int
    modules: tuple[Path, ...]
    tests: tuple[str, ...]
    needs_torch: bool

    def command(self, module: Path | None = None, seconds: int = 0) -> str:
        """Return the command that runs the tests until the first one fails.

        Args:
            module: Tests that import it, and those of its package, come first.
            seconds: Processor time that each half may take; 0 for any.
        """
        python = ROOT / (".venv-learn" if self.needs_torch else ".venv") / "bin" / "python"
        run = f"{python} -m pytest -x -q -p no:cacheprovider -m"
        marks = (
            ["learn and not long"] if self.needs_torch else [f"not long and not learn and {mark}" for mark in _MARKS]
        )
        if module is None:
            commands = [f"{run} '{mark}' {' '.join(self.tests)}" for mark in marks]
        else:
            name, mirror = f"from {'.'.join(module.with_suffix('').parts)} import", "tests" / module.parent
            files = [path for folder in self.tests for path in sorted([Path(folder), *Path(folder).rglob("test_*.py")])]
            files = [path for path in files if path.is_file()]
            near = [path for path in files if path.parent == mirror or name in path.read_text("utf-8")]
            halves = [half for half in (near, [path for path in files if path not in near]) if half]
            commands = [f"{run} '{mark}' {' '.join(map(str, half))}" for mark in marks for half in halves]
        runs = [f"{{ {command} || [ $? = 5 ]; }}" for command in commands]  # 5: all have other marks
        return shlex.join(["sh", "-c", f"ulimit -t {seconds or 'unlimited'}; {' && '.join(runs)}"])


def read_areas() -> list[Area]:
    """Return the areas of ``core.toml``; raise where a pattern names no file."""
    areas = []
    for entry in tomllib.loads((ROOT / "tests" / "mutation" / "core.toml").read_text("utf-8"))["area"]:
        modules: list[Path] = []
        for pattern in entry["modules"]:
            found = sorted(path.relative_to(CHECKOUT) for path in CHECKOUT.glob(pattern) if path.stem != "__init__")
            if not found:
                raise SystemExit(f"core.toml, {entry['name']}: no file is named {pattern}; correct the pattern")
            modules += found
        missing = [name for name in entry["tests"] if not (CHECKOUT / name).exists()]
        if missing:
            raise SystemExit(f"core.toml, {entry['name']}: no tests in {missing}; correct the paths")
        torch = entry.get("environment") == "learn"
        areas.append(Area(entry["name"], entry["number"], tuple(modules), tuple(entry["tests"]), torch))
    return areas


def equivalent_mutants() -> dict[str, str]:
    """Return the proofs of ``equivalent.toml`` by the mutant's name, see :func:`name_of`."""
    entries = tomllib.loads((ROOT / "tests" / "mutation" / "equivalent.toml").read_text("utf-8"))
    return {entry["mutant"]: entry["proof"] for entry in entries.get("equivalent", [])}


def name_of(mutation: MutationSpec) -> str:
    """Return a name that stays the same while the mutated definition is unchanged above the mutant."""
    first = first_line(mutation)
    place = f"{mutation.module_path}:{mutation.definition_name}+{first}:{mutation.start_pos[1]}"
    return f"{place} {mutation.operator_name}{variant(mutation)}"


def first_line(mutation: MutationSpec) -> int:
    """Return the line of a mutant within the definition around it."""
    lines = [
        node.lineno
        for node in ast.walk(ast.parse((CHECKOUT / mutation.module_path).read_text("utf-8")))
        if isinstance(node, ast.FunctionDef | ast.ClassDef) and node.name == mutation.definition_name
    ]
    return mutation.start_pos[0] - max((line for line in lines if line <= mutation.start_pos[0]), default=0)


def variant(mutation: MutationSpec) -> str:
    """Return which of the mutants of one place it is: numbers have two, one more and one less."""
    return "+-"[mutation.occurrence % 2] if mutation.operator_name == "core/NumberReplacer" else ""


def unevaluated(path: Path) -> list[tuple[tuple[int, int], tuple[int, int]]]:
    """Return the ranges of a file (line, column) that are annotations or decorators."""
    ranges = []
    for node in ast.walk(ast.parse(path.read_text("utf-8"))):
        notes: list[ast.expr | None] = []
        if isinstance(node, ast.arg | ast.AnnAssign):
            notes.append(node.annotation)
        elif isinstance(node, ast.FunctionDef | ast.ClassDef):
            notes += [getattr(node, "returns", None), *node.decorator_list]
        for note in notes:
            if note is not None:
                ranges.append(((note.lineno, note.col_offset), (note.end_lineno or 0, note.end_col_offset or 0)))
    return ranges


def candidates(area: Area, database: WorkDB) -> list[WorkItem]:
    """Return all mutants of an area that can change a result, in a fixed order."""
    init(area.modules, database, {})
    notes = {path: unevaluated(path) for path in area.modules}
    items = [
        item
        for item in database.work_items
        for mutation in item.mutations
        if mutation.operator_name not in NO_EFFECT
        and not any(start <= mutation.start_pos < end for start, end in notes[mutation.module_path])
    ]
    database.clear()
    return sorted(items, key=place_of)


def place_of(item: WorkItem) -> tuple[str, tuple[int, int], str, int]:
    """Return a key that orders mutants by their place and kind."""
    mutation = item.mutations[0]
    return str(mutation.module_path), mutation.start_pos, mutation.operator_name, mutation.occurrence


def draw(area: Area, items: list[WorkItem], seed: int) -> list[WorkItem]:
    """Draw the mutants of an area: every place in the code is as likely, however many mutants it has."""
    places: dict[tuple[Path, tuple[int, int]], list[WorkItem]] = {}
    for item in items:
        places.setdefault((item.mutations[0].module_path, item.mutations[0].start_pos), []).append(item)
    generator, proofs = random.Random(f"{seed} {area.name}"), equivalent_mutants()
    order = sorted(places)
    generator.shuffle(order)
    drawn = []
    for place in order:
        item = generator.choice(places[place])
        mutation = item.mutations[0]
        if name_of(mutation) not in proofs and not is_strictness(mutation) and is_python(mutation):
            drawn.append(item)
        if len(drawn) == area.number:
            break
    return drawn


def is_strictness(mutation: MutationSpec) -> bool:
    """Whether the mutant is that of ``strict=True``, which only raises where a caller is wrong already."""
    row, column = mutation.start_pos
    return mutation.module_path.read_text("utf-8").splitlines()[row - 1][:column].endswith("strict=")


def is_python(mutation: MutationSpec) -> bool:
    """Whether the mutant compiles, so that a test has to catch it."""
    operator = get_operator(mutation.operator_name)(**mutation.operator_args)
    text = mutation.module_path.read_text("utf-8")
    try:
        compile(mutate_code(text, operator, mutation.occurrence) or "", mutation.module_path, "exec", dont_inherit=True)
    except SyntaxError:
        return False
    return True


def prepare_checkout() -> None:
    """Clone the last commit into ``.mutants/checkout``, or bring the clone to it, without mutants left by a kill."""
    FOLDER.mkdir(exist_ok=True)
    if not CHECKOUT.exists():
        subprocess.run(["git", "clone", "--quiet", "--shared", str(ROOT), str(CHECKOUT)], check=True)
    head = subprocess.run(["git", "rev-parse", "HEAD"], cwd=ROOT, capture_output=True, text=True, check=True).stdout
    subprocess.run(["git", "fetch", "--quiet", str(ROOT), head.strip()], cwd=CHECKOUT, check=True)
    subprocess.run(["git", "reset", "--quiet", "--hard", head.strip()], cwd=CHECKOUT, check=True)


def session_for(seed: int, scale: float, areas: list[Area]) -> WorkDB:
    """Open the session, and add the mutants of areas that it lacks: all, or those instead of equivalent ones."""
    drawn: list[WorkItem] = []
    with use_db(FOLDER / "all.sqlite") as scratch:
        for area in areas:
            drawn += draw(area, candidates(area, scratch), seed)[: round(scale * area.number)]
    database = WorkDB(FOLDER / "session.sqlite", WorkDB.Mode.create)
    known = {place_of(item) for item in database.work_items}
    database.add_work_items([item for item in drawn if place_of(item) not in known])
    return database


def check_unmutated(area: Area) -> float:
    """Return the processor time of the tests of an area [s]; raise if some fail. This also compiles its kernels."""
    os.environ["NUMBA_CACHE_DIR"] = str(KERNELS)
    started = children_seconds()
    done = subprocess.run(area.command(), shell=True, capture_output=True, text=True, check=False)
    if done.returncode:
        raise SystemExit(f"{area.name}: the tests fail without a mutant\n{done.stdout[-3000:]}")
    seconds = children_seconds() - started
    print(f"{area.name}: {seconds:.0f} s without a mutant", flush=True)
    return seconds


def children_seconds() -> float:
    """Return the processor time of all processes that this one waited for [s]."""
    used = resource.getrusage(resource.RUSAGE_CHILDREN)
    return used.ru_utime + used.ru_stime


def run(database: WorkDB, area: Area) -> None:
    """Run the tests for each mutant of an area that has no result yet.

    Each starts with the machine code that was compiled without a mutant.
    """
    pending = [item for item in database.pending_work_items if item.mutations[0].module_path in area.modules]
    limit = round(LONGEST * check_unmutated(area)) if pending else 0
    os.environ["NUMBA_CACHE_DIR"] = str(FOLDER / "mutated_kernels")
    for number, item in enumerate(pending, 1):
        mutation, began = item.mutations[0], children_seconds()
        shutil.rmtree(os.environ["NUMBA_CACHE_DIR"], ignore_errors=True)
        shutil.copytree(KERNELS, os.environ["NUMBA_CACHE_DIR"], copy_function=os.link)
        result = mutate_and_test(item.mutations, area.command(mutation.module_path, limit), 3600.0)
        database.set_result(item.job_id, result)
        word = "caught" if result.is_killed else "SURVIVED"
        spent = children_seconds() - began
        print(f"{number}/{len(pending)} {word} {name_of(mutation)} in {spent:.0f} s", flush=True)


def report(database: WorkDB, areas: dict[Path, Area]) -> float:
    """Print the share of caught mutants by area, and each survivor; return the share of all."""
    items = {item.job_id: item.mutations[0] for item in database.work_items}
    caught: dict[str, list[bool]] = {}
    proofs = equivalent_mutants()
    for job, result in database.results:
        if name_of(items[job]) in proofs or is_strictness(items[job]):
            continue
        caught.setdefault(areas[items[job].module_path].name, []).append(result.test_outcome != TestOutcome.SURVIVED)
        if result.test_outcome == TestOutcome.SURVIVED:
            print(f"\nsurvived: {name_of(items[job])}\n{result.diff}")
    for name, outcomes in caught.items():
        print(f"{sum(outcomes):4} of {len(outcomes):3} caught: {name}")
    every = [outcome for outcomes in caught.values() for outcome in outcomes]
    print(f"{sum(every):4} of {len(every):3} caught in all, {len(proofs)} equivalent ones replaced")
    return sum(every) / len(every) if every else 1.0


def main() -> None:
    """Run the session from where it is, and exit with 1 below the bar."""
    parser = argparse.ArgumentParser(prog="make mutants", description=__doc__)
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--scale", type=float, default=1.0, help="share of the numbers in core.toml")
    parser.add_argument("--area", default="", help="only areas whose name contains this")
    parser.add_argument("--fresh", action="store_true", help="forget earlier results")
    parser.add_argument("--report", action="store_true", help="only print the results")
    arguments = parser.parse_args()
    if arguments.fresh:
        (FOLDER / "session.sqlite").unlink(missing_ok=True)
    if not arguments.report:
        prepare_checkout()
    os.chdir(CHECKOUT)
    os.environ |= {
        "PYTHONPATH": f"{CHECKOUT}:{CHECKOUT / 'pipelines'}",
        "SCENARIONET_HYPOTHESIS": "mutants",
    }
    os.environ.pop("PYTHONDONTWRITEBYTECODE", None)
    areas = read_areas()
    chosen = [area for area in areas if arguments.area in area.name and not arguments.report]
    database = session_for(arguments.seed, arguments.scale, chosen)
    for area in chosen:
        run(database, area)
    sys.exit(report(database, {module: area for area in areas for module in area.modules}) < BAR)


if __name__ == "__main__":
    main()
