"""Options of converters."""

from __future__ import annotations

import difflib
import types
from collections.abc import Mapping
from dataclasses import MISSING, dataclass, field, fields
from types import MappingProxyType
from typing import Any, ClassVar, Literal, Self, TypeVar, Union, get_args, get_origin, get_type_hints

from scenarionet_data.errors import BadParameter

Frames = Literal["recorded", "resampled"]
"""Timesteps of a scenario: the recorded times, or times at a fixed rate. Type of the option ``frames``, which every
converter that resamples has (docs/explanation/time.md)."""

Value = TypeVar("Value")


def option(default: Value, doc: str, *, is_path: bool = False, is_added: bool = False) -> Value:
    """Declare an option as a field of a subclass of :class:`Options`.

    Args:
        default: Its default.
        doc: What it is, for the command line.
        is_path, is_added: See :class:`Options`.
    """
    return field(default=default, metadata={"doc": doc, "is_path": is_path, "is_added": is_added})


@dataclass(frozen=True)
class Options:
    """Options of a converter; subclasses add fields with defaults and ``metadata={"doc": ...}``, see :func:`option`.

    A field with ``"is_path": True`` as well names a folder on this machine; it is not part of a shard's identity. Nor
    is one with ``"is_added": True`` at its default, so that shards written before the option existed are recognised.

    Class attributes:
        removed: Options that no longer exist, each with the advice that names their successor.

    Attributes:
        max_bad_rows: Share of unusable rows above which a scenario goes to quarantine.
    """

    removed: ClassVar[Mapping[str, str]] = MappingProxyType({})

    max_bad_rows: float = field(
        default=0.2,
        kw_only=True,
        metadata={"doc": "share of unusable rows above which a scenario goes to quarantine", "is_added": True},
    )

    @classmethod
    def refuse_removed(cls, name: str) -> None:
        """Raise for the name of an option that no longer exists.

        Raises:
            BadParameter: The message names its successor.
        """
        if name in cls.removed:
            raise BadParameter(f"option {name!r} no longer exists; {cls.removed[name]}")

    @property
    def paths(self) -> dict[str, str]:
        """Fields that name folders; values may be empty, or several paths joined as in ``$PATH``."""
        return {each.name: getattr(self, each.name) for each in fields(self) if each.metadata.get("is_path")}

    @property
    def identity(self) -> dict[str, Any]:
        """Values by name that the output depends on, see the class."""
        values = {}
        for each in fields(self):
            value = getattr(self, each.name)
            is_unset = each.metadata.get("is_added") and value == each.default
            if not (is_unset or each.metadata.get("is_path")):
                values[each.name] = value
        return values

    @classmethod
    def from_mapping(cls, values: Mapping[str, Any]) -> Self:
        """Make options from Python values by name.

        Raises:
            BadParameter: An unknown name, or a value of the wrong type.
        """
        if not isinstance(values, Mapping):
            raise BadParameter(f"options: wanted {cls.__name__} or values by name, found {values!r}")
        if not values:
            return cls()
        hints, known = get_type_hints(cls), {each.name: each for each in fields(cls)}
        for name, value in values.items():
            cls.refuse_removed(name)
            if name not in known:
                near = difflib.get_close_matches(name, known, n=1)
                hint = f"did you mean {near[0]!r}? " if near else ""
                raise BadParameter(f"no option {name!r}; {hint}options: {', '.join(known) or 'none'}")
            if not _is_of_type(value, hints[name]):
                field = known[name]
                default = field.default if field.default_factory is MISSING else field.default_factory()
                wanted = hints[name].__name__ if isinstance(hints[name], type) else str(hints[name])
                raise BadParameter(
                    f"option {name!r}: expected {wanted.removeprefix('typing.')}, for example {default!r}; "
                    f"found {value!r}"
                )
        return cls(**values)


def _is_of_type(value: Any, hint: Any) -> bool:
    """Whether a value fits the type of a field; an int is a float, as for type checkers."""
    origin, inner = get_origin(hint), get_args(hint)
    if origin in (Union, types.UnionType):
        return any(_is_of_type(value, kind) for kind in inner)
    if origin is Literal:
        return value in inner
    if origin is tuple:
        if not isinstance(value, tuple):
            return False
        kinds = [inner[0]] * len(value) if inner[-1] is Ellipsis else list(inner)
        return len(kinds) == len(value) and all(map(_is_of_type, value, kinds))
    if hint is float:
        return isinstance(value, int | float) and not isinstance(value, bool)
    if hint is int:
        return isinstance(value, int) and not isinstance(value, bool)
    return hint is Any or not isinstance(hint, type) or isinstance(value, hint)
