"""Count the code lines of the three packages: neither blank, nor docstring, nor comment.

``python tests/code_lines.py`` prints a table by area; ``--json`` prints the same as JSON, ``--root`` names another
checkout. Strings that document an attribute below it count as docstrings.
"""

from __future__ import annotations

import argparse
import ast
import json
from collections import Counter
from pathlib import Path

PACKAGES = ("scenarionet_data", "scenarionet_sim", "pipelines/scenarionet_pipelines")


def docstring_lines(tree: ast.Module) -> set[int]:
    """Return the lines of all strings that are statements: docstrings of modules, classes, functions, attributes."""
    texts = (node for node in ast.walk(tree) if isinstance(node, ast.Expr) and isinstance(node.value, ast.Constant))
    strings = (node for node in texts if isinstance(node.value.value, str))
    return {line for node in strings for line in range(node.lineno, (node.end_lineno or node.lineno) + 1)}


def count_code(text: str) -> int:
    """Return the number of code lines of a Python file."""
    documented = docstring_lines(ast.parse(text))
    stripped = ((number, line.strip()) for number, line in enumerate(text.splitlines(), 1))
    return sum(1 for number, line in stripped if line and not line.startswith("#") and number not in documented)


def count_areas(root: Path) -> Counter[str]:
    """Return the code lines of each folder or module below a package, with examples where they are outside of it."""
    counts: Counter[str] = Counter()
    for package in PACKAGES:
        for path in (root / package).rglob("*.py"):
            area = path.relative_to(root / package).parts[0]
            counts[f"{Path(package).name}/{area}"] += count_code(path.read_text("utf-8"))
    for path in (root / "docs" / "examples").rglob("*.py"):
        counts["docs/examples"] += count_code(path.read_text("utf-8"))
    return counts


def main() -> None:
    """Print the counts."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--root", type=Path, default=Path(__file__).parents[1])
    parser.add_argument("--json", action="store_true")
    arguments = parser.parse_args()
    counts = count_areas(arguments.root)
    if arguments.json:
        print(json.dumps({"total": counts.total(), "areas": dict(counts.most_common())}, indent=1))
        return
    for area, count in counts.most_common():
        print(f"{count:7,}  {area}")
    print(f"{counts.total():7,}  in all")


if __name__ == "__main__":
    main()
