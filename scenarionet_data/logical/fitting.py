"""Logical scenarios whose parameters are distributed as in recordings: quantiles of each, and a Gaussian copula."""

from __future__ import annotations

import json
import re
from itertools import combinations
from pathlib import Path

import numpy as np
import polars as pl

from scenarionet_data.errors import BadParameter, needing
from scenarionet_data.logical.description import parse_logical, read_logical
from scenarionet_data.variations.parameters import QUANTILES

FEWEST = 10
"""Occurrences that a distribution is fitted to at least."""

_POINTS = 21  # quantiles, in steps of 5 %
_TABLES = re.compile(r"^\[(?:parameters|correlation)\][^\n]*\n(?:(?!\[)[^\n]*\n?)*", re.MULTILINE)


def fit_logical(source: str | Path, measured: pl.DataFrame) -> str:
    """Return the text of a logical scenario whose parameters are jointly distributed as measured ones.

    A parameter has the empirical quantiles in steps of 5 %; pairs have the correlation of their normal scores (van der
    Waerden's), which a Gaussian copula gives to what is drawn.

    Args:
        source: A file, or a name of the library.
        measured: A row for each occurrence, with columns named as parameters; parameters without a column keep their
            distribution, rows with missing values and other columns are left out.

    Returns:
        The file, with other tables ``parameters`` and ``correlation``.

    Raises:
        BadParameter: No column is a parameter, there are too few rows, or the file cannot be rewritten.
        MissingDependency: SciPy is not installed.
    """
    logical = read_logical(source)
    names = [each.name for each in logical.parameters if each.name in measured.columns]
    if not names:
        have = ", ".join(each.name for each in logical.parameters)
        raise BadParameter(f"{source}: no column of {measured.columns} is one of its parameters {have}")
    rows = measured.select(pl.col(names).cast(pl.Float64)).to_numpy()
    rows = rows[np.isfinite(rows).all(axis=1)]
    if len(rows) < FEWEST:
        raise BadParameter(f"{source}: {len(rows)} occurrences have numbers of {', '.join(names)}; wanted {FEWEST}")
    with needing("fitting distributions needs scipy", "vary"):
        from scipy.special import ndtri
        from scipy.stats import rankdata
    scores = ndtri(rankdata(rows, axis=0) / (len(rows) + 1))
    quantiles = np.quantile(rows, np.linspace(0.0, 1.0, _POINTS), axis=0).T
    fitted = {
        name: f"{QUANTILES}{', '.join(f'{value:.5g}' for value in row)})"
        for name, row in zip(names, quantiles, strict=True)
    }
    lines = ["[parameters]"]
    lines += [f"{each.name} = {json.dumps(fitted.get(each.name, each.distribution))}" for each in logical.parameters]
    lines += ["", "[correlation]"]
    for first, second in combinations([k for k in range(len(names)) if np.ptp(rows[:, k]) > 0], 2):
        value = np.corrcoef(scores[:, first], scores[:, second])[0, 1]
        lines.append(f'"{names[first]}, {names[second]}" = {value:.3f}')
    text = _TABLES.sub("", logical.text).rstrip() + "\n\n" + "\n".join(lines) + "\n"
    if parse_logical(text, logical.name).actors != logical.actors:
        raise BadParameter(f"{source}: cannot be rewritten; put its tables [parameters] and [correlation] last")
    return text
