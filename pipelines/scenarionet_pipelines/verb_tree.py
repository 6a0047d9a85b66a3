"""The verbs of the command line: where each stands, in the order of the help."""

from __future__ import annotations

from typing import NamedTuple

SECTIONS = {
    "Convert and look": ("convert", "list", "show", "sql", "mine", "render", "browse", "report"),
    "Select scenarios": ("filter", "split", "sample", "merge", "vary"),
    "Simulate and learn": ("sim", "train"),
    "Share": ("export", "pack"),
}
"""Verbs without a group by task; ``verbs/<verb>.py`` defines each."""


class Group(NamedTuple):
    """A group of verbs: what they are for, and their names; ``verbs/<group>/<verb>.py`` defines each."""

    doc: str
    verbs: tuple[str, ...]


GROUPS = {
    "db": Group(
        "Databases and user columns: combine, compare, trace, update, rename, tag, embed.",
        (
            "intersect", "subtract", "diff", "overlap", "stats", "lineage", "rebuild", "rebase", "copy", "rename",
            "drop", "checkout", "tag", "embed", "similar", "catalogue",
        ),
    ),
    "runs": Group(
        "Runs of drivers: bridge stacks, compare, test, film, verify, add others, search failures, record, experiment.",
        ("bridge", "compare", "regress", "films", "verify", "add", "search", "record", "experiment"),
    ),
    "forecast": Group(
        "Predicted trajectories: train a forecaster, score, submit to challenges.", ("fit", "score", "submit")
    ),
    "traffic": Group(
        "Traffic that a model makes on recorded maps: train it, generate scenarios, compare them with the recordings.",
        ("learn", "generate", "measure"),
    ),
    "tables": Group("The Parquet files of a lake for other engines and catalogs.", ("files", "publish")),
    "maintain": Group(
        "Lakes and this installation: check, verify, repair, compact, clean up.",
        ("check", "fsck", "compact", "vacuum", "doctor", "compile"),
    ),
    "info": Group("What there is: converters with their options, named filters, columns.", ("converters", "filters")),
}  # fmt: skip


def full_name(verb: str) -> str:
    """Return a verb as it is typed, with its group.

    Example:
        >>> full_name("rebase"), full_name("filter")
        ('db rebase', 'filter')
    """
    return next((f"{name} {verb}" for name, group in GROUPS.items() if verb in group.verbs), verb)
