"""Count private functions that are used once: each is a place to ask whether the name says more than its lines.

A function or method with a leading underscore counts when its own module mentions its name exactly once beside the
definition, be it a call or a callback passed by name. ``python tests/single_use.py`` prints their share of all
functions by package; ``--list`` also prints the functions, ``--under`` keeps one folder, ``--root`` names another
checkout.
"""

from __future__ import annotations

import argparse
import ast
from collections import Counter
from pathlib import Path
from typing import NamedTuple

PACKAGES = ("scenarionet_data", "scenarionet_sim", "pipelines/scenarionet_pipelines")


class SingleUse(NamedTuple):
    """How many functions a package has, and those among them that are private and used once, as ``file:line name``."""

    functions: int
    once: tuple[str, ...]

    @property
    def share(self) -> float:
        """Share of all functions that are private and used once."""
        return len(self.once) / max(self.functions, 1)


def read_module(path: Path) -> tuple[int, list[tuple[int, str]]]:
    """Return the number of functions of a module, and line and name of the private ones it mentions once."""
    nodes = list(ast.walk(ast.parse(path.read_text("utf-8"))))
    functions = [node for node in nodes if isinstance(node, ast.FunctionDef | ast.AsyncFunctionDef)]
    uses = Counter(node.id for node in nodes if isinstance(node, ast.Name))
    uses += Counter(node.attr for node in nodes if isinstance(node, ast.Attribute))
    private = (node for node in functions if node.name.startswith("_") and not node.name.startswith("__"))
    return len(functions), [(node.lineno, node.name) for node in private if uses[node.name] == 1]


def count_single_use(folder: Path) -> SingleUse:
    """Return the count of all modules below a folder."""
    functions, once = 0, list[str]()
    for path in sorted(folder.rglob("*.py")):
        count, found = read_module(path)
        functions += count
        once += [f"{path.relative_to(folder)}:{line} {name}" for line, name in found]
    return SingleUse(functions, tuple(once))


def main() -> None:
    """Print the share of each package."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--root", type=Path, default=Path(__file__).parents[1])
    parser.add_argument("--under", nargs="+", default=PACKAGES, help="folders of the checkout to count")
    parser.add_argument("--list", action="store_true", help="also print the functions")
    arguments = parser.parse_args()
    for name in arguments.under:
        count = count_single_use(arguments.root / name)
        print(f"{count.share:6.1%}  {len(count.once):4} of {count.functions:5,} functions  {name}")
        for place in count.once if arguments.list else ():
            print(f"        {place}")


if __name__ == "__main__":
    main()
