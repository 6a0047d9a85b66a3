"""Arithmetic in the files of logical scenarios: numbers, names, ``+ - * / **`` and a few functions, over arrays."""

from __future__ import annotations

import ast
import operator
from collections.abc import Callable, Mapping
from functools import lru_cache
from typing import Any

import numpy as np

from scenarionet_data.arrays.dtypes import Float64
from scenarionet_data.errors import BadParameter

_FUNCTIONS: Mapping[str, Callable[..., Any]] = {
    "abs": np.abs, "sign": np.sign, "min": np.minimum, "max": np.maximum, "sqrt": np.sqrt, "sin": np.sin,
    "cos": np.cos, "acos": np.arccos, "where": np.where,
}  # fmt: skip
_OPERATORS: Mapping[type, Callable[..., Any]] = {
    ast.Add: operator.add, ast.Sub: operator.sub, ast.Mult: operator.mul, ast.Div: operator.truediv,
    ast.Pow: operator.pow, ast.USub: operator.neg, ast.UAdd: operator.pos, ast.Gt: operator.gt, ast.Lt: operator.lt,
}  # fmt: skip


def evaluate(text: str, values: Mapping[str, Float64]) -> Float64:
    """Return the value (B,) of an expression over named arrays (B,); one without names has the shape ().

    Raises:
        BadParameter: It is no arithmetic, names something unknown, or a result is not finite.
    """
    try:
        with np.errstate(all="ignore"):
            result = np.asarray(_value(_parsed(text), values), np.float64)
    except (SyntaxError, TypeError, ValueError, ZeroDivisionError) as error:
        raise BadParameter(f"expression {text!r}: {error}; wanted arithmetic with {', '.join(values)}") from error
    if not np.isfinite(result).all():
        raise BadParameter(
            f"expression {text!r} gives {result[~np.isfinite(result)].ravel()[0]}; wanted finite numbers"
        )
    return result


@lru_cache
def _parsed(text: str) -> ast.expr:
    return ast.parse(text.strip(), mode="eval").body


def _value(node: ast.AST, values: Mapping[str, Float64]) -> Any:
    match node:
        case ast.Constant(value=int() | float() as number):
            return np.float64(number)
        case ast.Name(id=name) if name in values:
            return values[name]
        case ast.UnaryOp(op=op, operand=inner):
            return _OPERATORS[type(op)](_value(inner, values))
        case ast.BinOp(left=left, op=op, right=right) if type(op) in _OPERATORS:
            return _OPERATORS[type(op)](_value(left, values), _value(right, values))
        case ast.Compare(left=left, ops=[op], comparators=[right]) if type(op) in _OPERATORS:
            return _OPERATORS[type(op)](_value(left, values), _value(right, values))
        case ast.Call(func=ast.Name(id=name), args=inner, keywords=[]) if name in _FUNCTIONS:
            return _FUNCTIONS[name](*(_value(each, values) for each in inner))
    raise ValueError(f"{ast.unparse(node)!r} is unknown")
