"""The compiler of loops gives what Python gives, and refuses what it cannot compile."""

from __future__ import annotations

from fractions import Fraction
from typing import NamedTuple

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numba.core.errors import UnsupportedError

from scenarionet_data.compiled.decorators import device_function, kernel
from scenarionet_data.compiled.gate import uses_internals

pytestmark = pytest.mark.skipif(not uses_internals(), reason="tests what is built on the internals of numba")


class Table(NamedTuple):
    values: np.ndarray
    flags: np.ndarray


@device_function
def ends(row):
    return row[0], row[-1]


@device_function
def add_row(table, k, out):
    """Variables that are assigned in some branches, in loops, and once."""
    row = table.values[k]
    first, last = ends(row)
    if table.flags[k]:
        factor = 2.0
    elif first > last:
        factor = -1.0
        last += first
    else:
        factor = 0.5
    total, previous = 0.0, np.nan
    for value in row:
        if not np.isnan(previous) and value > previous:
            total += value - previous
        elif value < 0.0:
            break
        previous = value
    else:
        total *= 2.0
    out[k, 0], out[k, 1], out[k, -1] = first * factor, total, last
    inner = table.values[k, 1:-1]
    for j in range(len(inner) - 1, -1, -1):
        out[k, 2] += inner[j] * (j - inner.shape[0])
    return total


@kernel(allocates=False)
def add_rows(table, columns, out):
    best, count = -1, 0
    while count < len(table.flags):
        total = add_row(table, count, out)
        if best < 0 or total > out[best, 1]:
            best = count
        out[count][3] = table.values[count - 1][columns[count, 0]]
        out[-1 - count, columns[count, -1]] -= 1.0
        count += 1
    return best


NUMBERS = st.floats(-9.0, 9.0, width=32)


@settings(max_examples=60, deadline=None)
@given(st.data())
def test_compiled_loops_return_what_python_returns(data):
    count, width = data.draw(st.integers(1, 5)), data.draw(st.integers(3, 5))
    rows = data.draw(st.lists(st.lists(NUMBERS, min_size=width, max_size=width), min_size=count, max_size=count))
    is_reversed, is_transposed = data.draw(st.booleans()), data.draw(st.booleans())
    values = np.array(rows, np.float32)
    if is_reversed:
        values = values[::-1]
    if is_transposed:
        values = np.asfortranarray(values)
    flags = np.array(data.draw(st.lists(st.booleans(), min_size=count, max_size=count)))
    columns = np.array(
        [data.draw(st.tuples(st.integers(-width, width - 1), st.integers(0, 4))) for _ in flags], np.int8
    )
    out, expected = np.zeros((2, count, 5))
    with pytest.MonkeyPatch.context() as patch:
        for function in (ends, add_row):
            patch.setitem(add_rows.py_func.__globals__, function.__name__, function.py_func)
        wanted = add_rows.py_func(Table(values, flags), columns, expected)
    assert add_rows(Table(values, flags), columns, out) == wanted
    np.testing.assert_allclose(out, expected, rtol=1e-6, atol=1e-5)  # sums of float32 cancel out


def test_try_statement_needs_the_other_compiler():
    @kernel(allocates=False)
    def divide(a, b):
        try:
            return a / b
        except Exception:
            return 0.0

    with pytest.raises(UnsupportedError, match=r"divide\(\) has a yield, with or try statement.*allocates=True"):
        divide(1.0, 0.0)


@device_function(in_lanes=True)
def add_tenths(values, out):
    for k in range(len(values)):
        out[k] = values[k] * 0.1 + 0.7


@kernel(allocates=False)
def run_add_tenths(values, out):
    add_tenths(values, out)


@pytest.mark.parametrize("dtype", [np.float32, np.float64])
def test_constants_of_functions_in_lanes_are_float32(dtype):
    values = np.linspace(-3.0, 5.0, 101).astype(dtype)
    out = np.empty_like(values)
    run_add_tenths(values, out)
    tenth, rest = np.float32(0.1), np.float32(0.7)
    exact = [Fraction(float(value)) * Fraction(float(tenth)) + Fraction(float(rest)) for value in values]
    fused = np.array([float(number) for number in exact]).astype(dtype)
    assert ((out == values * tenth + rest) | (out == fused)).all()  # processors may not round the product
    assert (out != (values.astype(np.float64) * 0.1 + 0.7).astype(dtype)).any()


@pytest.mark.parametrize("has_wide_vectors", [False, True])
def test_wide_kernels_prefer_vectors_of_64_bytes_where_these_are_fast(monkeypatch, tmp_path, has_wide_vectors):
    @kernel(allocates=False, is_wide=True)
    def double(values):
        for k in range(len(values)):
            values[k] *= 2.0

    monkeypatch.setattr("numba.core.config.CACHE_DIR", str(tmp_path))  # code from a cache cannot be read
    monkeypatch.setattr("llvmlite.binding.get_host_cpu_features", lambda: {"avx512vbmi2": has_wide_vectors})
    values = np.arange(40, dtype=np.float32)
    double(values)
    np.testing.assert_array_equal(values, 2.0 * np.arange(40))
    (code,) = double.inspect_llvm().values()
    assert ('"prefer-vector-width"="512"' in code) == has_wide_vectors
