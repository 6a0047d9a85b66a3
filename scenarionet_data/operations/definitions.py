"""Definitions of moments in a TOML file: one table each, with the composition as an expression of relations and events.

.. code-block:: toml

    [close_behind]
    doc = "A vehicle in motion is close behind one that is not parked."
    when = '''
    (has_velocity(min_velocity=2.0) & following & ~stationary.reversed()).lasting(0.5)
    '''

    [three_in_a_queue]
    sql = "SELECT scenario_id, track_id, first_timestep, last_timestep FROM ..."

The expression is read, not run: names are relations, events and other definitions of the file, and the operators and
methods are those of :mod:`scenarionet_data.operations.moments`.
"""

from __future__ import annotations

import ast
import difflib
import tomllib
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from scenarionet_data.errors import BadParameter, UnknownRelation
from scenarionet_data.operations.moments import Moments, RelationSteps, event, relation, selected
from scenarionet_data.query.named_sql import EVENTS, RELATIONS

_KINDS = {"when", "sql"}
_METHODS = ("lasting", "before", "after", "during", "overlaps", "reversed", "at_least")


class Definitions(Mapping[str, Moments]):
    """The moments that a TOML file defines, by name; each is composed when it is asked for.

    Args:
        path: The file.

    Attributes:
        docs: What each is, from the file.

    Raises:
        BadParameter: The file is no TOML, or a table in it is no definition.
    """

    def __init__(self, path: Path) -> None:
        self.path = path
        self._texts: dict[str, str] = {}
        self._selected: dict[str, Moments] = {}
        self.docs: dict[str, str] = {}
        try:
            tables = tomllib.loads(path.read_text("utf-8"))
        except (OSError, ValueError) as error:
            raise BadParameter(f"{path}: no definitions can be read from it: {error}") from error
        for name, table in tables.items():
            keys = set(table) if isinstance(table, dict) else set()
            text = table[(keys & _KINDS).pop()] if len(keys & _KINDS) == 1 else None
            if not isinstance(text, str) or keys - _KINDS - {"doc"}:
                raise BadParameter(
                    f"{path}: [{name}] wants a text `when`, or `sql`, and perhaps `doc`, and nothing else"
                )
            if name in RELATIONS.names() or name in EVENTS.names():
                raise BadParameter(f"{path}: [{name}] has the name of a relation or event; choose another")
            self._texts[name], self.docs[name] = text, str(table.get("doc", ""))
            if "sql" in keys:
                self._selected[name] = selected(text)

    def __getitem__(self, name: str) -> Moments:
        if name not in self._texts:
            raise KeyError(name)
        return self.find(name)

    def find(self, name: str) -> Moments:
        """Compose the moments of a name.

        Raises:
            BadParameter: The file does not define them, or their expression is none.
            UnknownRelation: It names what is neither a relation nor an event.
        """
        if name not in self._texts:
            raise BadParameter(f"{self.path} defines no {name!r}; it defines {', '.join(self) or 'nothing'}")
        found = self._composed(name, (name,))
        return found.lasting() if isinstance(found, RelationSteps) else found

    def __iter__(self) -> Any:
        return iter(self._texts)

    def __len__(self) -> int:
        return len(self._texts)

    def _composed(self, name: str, path: tuple[str, ...]) -> RelationSteps | Moments:
        """Return what a definition stands for; ``path`` has those that are being read, outermost first."""
        if name in self._selected:
            return self._selected[name]
        try:
            parsed = ast.parse(self._texts[name].strip(), mode="eval").body
        except (SyntaxError, ValueError, RecursionError, MemoryError) as error:
            raise BadParameter(f"{self.path}: [{name}] is no expression: {error}") from error
        found = _ExpressionReader(self, self._texts, path).value(parsed)
        if not isinstance(found, RelationSteps | Moments):
            raise BadParameter(f"{self.path}: [{name}] is no relation, event or composition of them")
        return found


class _ExpressionReader:
    """Composes moments from the syntax tree of an expression.

    Args:
        definitions: The file's definitions, for messages.
        texts: Expressions by name.
        path: Names of the definitions that are being read, outermost first.
    """

    def __init__(self, definitions: Definitions, texts: Mapping[str, str], path: tuple[str, ...]) -> None:
        self._definitions = definitions
        self._texts = texts
        self._path = path

    def value(self, node: ast.expr) -> Any:
        """Return the value of a node: steps, moments, or a constant."""
        match node:
            case ast.Constant(value=value) if isinstance(value, str | int | float):
                return value
            case ast.UnaryOp(op=ast.USub(), operand=ast.Constant(value=int() | float() as number)):
                return -number
            case ast.List(elts=parts):
                return [self.value(part) for part in parts]
            case ast.UnaryOp(op=ast.Invert(), operand=part):
                return ~self._steps(part)
            case ast.BinOp(left=left, op=ast.BitAnd(), right=right):
                return self._steps(left) & self._steps(right)
            case ast.BinOp(left=left, op=ast.BitOr(), right=right):
                return self._steps(left) | self._steps(right)
            case ast.Name(id=name):
                return self._named(name, {}, node)
            case ast.Call(func=ast.Name(id=name), args=[], keywords=keywords):
                return self._named(name, self._keywords(keywords), node)
            case ast.Call(func=ast.Attribute(value=owner, attr=method), args=args, keywords=keywords):
                return self._call(
                    self.value(owner), method, [self.value(arg) for arg in args], self._keywords(keywords)
                )
        raise self._refused(f"{ast.unparse(node)!r} is none of: name(parameter=value), &, |, ~, {', '.join(_METHODS)}")

    def _named(self, name: str, parameters: dict[str, Any], node: ast.expr) -> RelationSteps | Moments:
        if name not in self._texts:
            if name not in (*RELATIONS.names(), *EVENTS.names()):
                known = sorted({*self._texts, *RELATIONS.names(), *EVENTS.names()})
                near = difflib.get_close_matches(name, known) or known
                raise UnknownRelation(
                    f"{self._where}: no definition, relation or event {name!r}; did you mean {', '.join(near)}?"
                )
            try:
                return event(name, parameters) if name in EVENTS.names() else relation(name, parameters)
            except BadParameter as error:
                raise self._refused(str(error)) from error
        if parameters:
            raise self._refused(f"{ast.unparse(node)!r}: definitions have no parameters")
        if name in self._path:
            raise self._refused(f"it is defined by itself: {' -> '.join((*self._path, name))}")
        return self._definitions._composed(name, (*self._path, name))

    def _call(self, owner: Any, method: str, args: list[Any], keywords: dict[str, Any]) -> Any:
        """Apply a method of steps or moments."""
        if method not in _METHODS or not isinstance(owner, RelationSteps | Moments):
            raise self._refused(f"there is no method {method!r}; there are {', '.join(_METHODS)}")
        if not hasattr(owner, method):
            kinds = (
                "spans of time: add .lasting() before it"
                if method in dir(Moments)
                else "single steps, not spans of time"
            )
            raise self._refused(f".{method}() wants {kinds}")
        given = [arg.lasting() if isinstance(arg, RelationSteps) else arg for arg in args]
        try:
            return getattr(owner, method)(*given, **keywords)
        except (TypeError, AttributeError, BadParameter) as error:
            raise self._refused(f".{method}(): {error}") from error

    def _steps(self, node: ast.expr) -> RelationSteps:
        found = self.value(node)
        if not isinstance(found, RelationSteps):
            raise self._refused(
                f"&, | and ~ combine relations at single steps, found {ast.unparse(node)!r}; "
                "spans of time are combined by during, overlaps, before and after"
            )
        return found

    def _keywords(self, keywords: list[ast.keyword]) -> dict[str, Any]:
        if any(keyword.arg is None for keyword in keywords):
            raise self._refused("parameters are given as name=value")
        return {str(keyword.arg): self.value(keyword.value) for keyword in keywords}

    def _refused(self, why: str) -> BadParameter:
        return BadParameter(f"{self._where}: {why}")

    @property
    def _where(self) -> str:
        """The file, and the definition in it that is being read."""
        return f"{self._definitions.path}: [{self._path[-1]}]"
