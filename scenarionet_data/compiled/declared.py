"""Compiled functions and instructions as they stand in modules, which Numba need not be imported for."""

from __future__ import annotations

import functools
import sys
from collections.abc import Callable
from functools import cached_property
from typing import Any, NoReturn

from scenarionet_data.compiled import bare
from scenarionet_data.compiled.stamps import stamp_of

_FEW = 1_000
"""Calls of a kernel by its image; more are quicker by Numba's dispatcher, whose import pays off then."""


class DeclaredFunction:
    """A function to be compiled, in the place of Numba's dispatcher of it, which is made when it is needed.

    Args:
        plain: The Python function.
        targetoptions: Numba's options.
        make: Makes the dispatcher.

    Attributes:
        py_func: The Python function.
    """

    def __init__(self, plain: Any, targetoptions: dict[str, Any], make: Callable[[], Any]) -> None:
        as_any: Any = self
        functools.update_wrapper(as_any, plain)
        self.py_func, self.targetoptions, self._make = plain, targetoptions, make

    @cached_property
    def dispatcher(self) -> Any:
        """Numba's dispatcher."""
        return self._make()

    @property
    def _numba_type_(self) -> Any:
        """The type of the name in other compiled functions."""
        return self.dispatcher._numba_type_

    def __getattr__(self, name: str) -> Any:
        if name.startswith("__"):
            raise AttributeError(name)
        return getattr(self.dispatcher, name)

    def __reduce__(self) -> str:
        return str(self.py_func.__qualname__)


class DeclaredKernel(DeclaredFunction):
    """A kernel: its first calls are of its image, in processes without Numba."""

    _num_calls = 0

    @cached_property
    def _image(self) -> bare.Image | None:
        return bare.find(self.py_func, lambda: stamp_of(self))

    @property
    def only_entry(self) -> Callable[..., Any]:
        """See ``checking.unchecked``."""
        return getattr(self.dispatcher, "only_entry", self) if "dispatcher" in self.__dict__ else self

    @property
    def signatures(self) -> list[Any]:
        """Types of arguments that Numba has machine code for in this process."""
        return self.dispatcher.signatures if "dispatcher" in self.__dict__ else []

    def __call__(self, *arguments: Any, **others: Any) -> Any:
        """Call the compiled function."""
        if "numba" not in sys.modules and not others and self._num_calls < _FEW:
            self._num_calls += 1
            if self._image is not None and self._image.fits(arguments):
                return self._image.entry(*arguments)
        return self.dispatcher(*arguments, **others)


class DeclaredDeviceFunction(DeclaredFunction):
    """A device function."""

    def __call__(self, *_arguments: object, **_others: object) -> NoReturn:
        """Refuse: without an entry, a call would end the interpreter."""
        name = self.py_func.__qualname__
        raise TypeError(f"{name}() is a device function, which only kernels call; from Python use {name}.py_func(...)")


class _Instruction:
    """See :func:`instruction`."""

    def __init__(self, make: Callable[[], Any]) -> None:
        self._make = make

    @cached_property
    def _numba_type_(self) -> Any:
        from numba.core.registry import cpu_target

        typing: Any = cpu_target.typing_context
        made = self._made = self._make()  # which Numba knows by its identity
        typing.refresh()
        return typing.resolve_value_type(made)


def instruction(make: Callable[[], Any]) -> Any:
    """Return code that is written for calls from compiled functions.

    Args:
        make: Makes Numba's intrinsic, or a device function in its place, when a call is compiled.
    """
    return _Instruction(make)
