"""Machine code of kernels that runs without Numba, for short programs: importing Numba takes 0.2 to 0.3 s.

Where a kernel is compiled, its object file is linked to an image, next to Numba's own file of it. It is read where it
travels with the installation (see ``shipped``), by processes that have not imported Numba. Kernels that allocate, or
have constants that are Python objects, have no image. Other systems than Linux, and other arguments, take Numba.
"""

from __future__ import annotations

import ctypes
import hashlib
import importlib
import json
import mmap
import os
import re
import struct
import sys
import time
from collections.abc import Callable, Sequence
from functools import cache
from importlib import machinery, util
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from scenarionet_data.compiled import shipped
from scenarionet_data.compiled.announcing import Compilation, compilations

_HELPER = "numba_"
"""Prefix of functions in C of Numba's, which read arrays and raise exceptions."""
_ENVIRONMENT = "_ZN08NumbaEnv"
"""Prefix of variables that hold the constants of functions; kernels with images have none."""

_SECTION, _SYMBOL, _RELOCATION = struct.Struct("<IIQQQQIIQQ"), struct.Struct("<IBBHQQ"), struct.Struct("<QQq")
_SYMBOLS, _ADDENDS, _EMPTY = 2, 4, 8
"""Types of sections of ELF files: symbols, relocations with addends, and memory that holds zeros."""
_IS_WRITTEN, _IS_LOADED = 1, 2
_UNDEFINED, _COMMON = 0, 0xFFF2
"""Sections of symbols: of another file, and of variables without values."""
_ABSOLUTE = 1
"""The only relocation in code of the large model, R_X86_64_64: the address of a symbol."""

_IS_POSSIBLE = sys.platform == "linux" and os.uname().machine == "x86_64"
_SETTINGS = {"NUMBA_CACHE_DIR", "NUMBA_NUM_THREADS"}
"""Variables of Numba's that do not change machine code."""


class NotBare(Exception):
    """A kernel has no image; the message says why."""


def is_of_data(function: Any) -> bool:
    """Whether a function is of the package whose short programs need not import Numba; others simulate."""
    return str(function.__module__).startswith("scenarionet_data.")


def file_name(function: Any) -> str:
    """Name of the file of a function."""
    return f"{function.__qualname__}.{sys.implementation.cache_tag}.bare"


def write(folder: str, function: Any, stamp: str, result: Any) -> None:
    """Write the image of a kernel; nothing for one that has none, or that has one already.

    Args:
        folder: Where Numba's own files are.
        function: The Python function.
        stamp: Of the code that it was compiled from.
        result: Numba's result of its compilation.
    """
    path = Path(folder, file_name(function))
    try:
        if not (_IS_POSSIBLE and is_of_data(function)) or _has_stamp(path, stamp):
            return
        environments = [result.environment, *result._find_referenced_environments()]
        if any(each.consts for each in environments):
            raise NotBare("it has constants that are Python objects")
        arguments = [_type_in_words(kind) for kind in result.signature.args]
        image, entry, places = link(result.library._get_compiled_object(), result.fndesc.llvm_cpython_wrapper_name)
    except NotBare:
        return
    head = {"stamp": stamp, "numba": _numba_version(), "arguments": arguments, "entry": entry, "places": places}
    content = json.dumps(head).encode() + b"\n" + image
    written = path.with_suffix(f".{os.getpid()}")
    written.write_bytes(hashlib.sha256(content).digest() + content)
    written.replace(path)


def _has_stamp(path: Path, stamp: str) -> bool:
    """Whether there is a whole image of such code."""
    try:
        return path.exists() and bool(_read(path)[0]["stamp"] == stamp)
    except NotBare:
        return False


def link(file: bytes, name: str) -> tuple[bytes, int, list[tuple[int, str, int]]]:
    """Lay out an object file in memory.

    Args:
        file: An ELF file of 64 bits.
        name: The function that is called.

    Returns:
        The image, the place of the function, and places of addresses, each with the name of the symbol, or "" for the
        start of the image, and the number to add.

    Raises:
        NotBare: The file has relocations of other kinds, or needs functions that are not in every process.
    """
    (start,), (size, count) = struct.unpack_from("<Q", file, 0x28), struct.unpack_from("<HH", file, 0x3A)
    sections = [_SECTION.unpack_from(file, start + size * number) for number in range(count)]
    image, placed = bytearray(), {}
    names = sections[struct.unpack_from("<H", file, 0x3E)[0]][4]
    for number, (label, kind, flags, _, offset, length, _, _, alignment, _) in enumerate(sections):
        if flags & _IS_LOADED and flags & _IS_WRITTEN and length:
            raise NotBare("it has variables")
        if flags & _IS_LOADED and not file.startswith(b".eh_frame", names + label):
            image += bytes(-len(image) % max(alignment, 1))
            placed[number] = len(image)
            image += bytes(length) if kind == _EMPTY else file[offset : offset + length]
    symbols: list[tuple[str, int | None]] = []
    for _, kind, _, _, offset, length, strings, _, _, _ in sections:
        for at in range(offset, offset + length if kind == _SYMBOLS else offset, _SYMBOL.size):
            label, _, _, section, value, extent = _SYMBOL.unpack_from(file, at)
            first = sections[strings][4] + label
            symbol = file[first : file.index(b"\0", first)].decode()
            if section == _COMMON and symbol.startswith(_ENVIRONMENT):  # which is not empty, and not looked into
                image += bytes(-len(image) % value)
                symbols.append((symbol, len(image)))
                image += (1).to_bytes(extent, "little")
            else:
                symbols.append((symbol, placed[section] + value if section in placed else None))
    places = []
    for _, kind, _, _, offset, length, _, target, _, _ in sections:
        for at in range(offset, offset + length if kind == _ADDENDS and target in placed else offset, _RELOCATION.size):
            place, found, addend = _RELOCATION.unpack_from(file, at)
            symbol, where = symbols[found >> 32]
            if found & 0xFFFFFFFF != _ABSOLUTE or (where is None and _address(symbol) is None):
                raise NotBare(f"it needs {symbol or 'another kind of relocation'}")
            own = ("", where + addend) if where is not None else (symbol, addend)
            places.append((placed[target] + place, *own))
    entry = dict(symbols).get(name)
    if entry is None:
        raise NotBare("it has no entry for Python")
    return bytes(image), entry, places


class Image(NamedTuple):
    """A kernel in memory.

    Attributes:
        arguments: What it was compiled for, in words.
        entry: The function.
    """

    arguments: list[str]
    entry: Callable[..., Any]

    def fits(self, arguments: Sequence[object]) -> bool:
        """Whether it was compiled for these arguments."""
        try:
            return self.arguments == [value_in_words(value) for value in arguments]
        except NotBare:
            return False


def find(function: Any, stamp: Callable[[], str]) -> Image | None:
    """Load the image of a kernel; None where there is none, or it is of other code.

    Args:
        function: The Python function.
        stamp: Returns the stamp of its code.
    """
    begin = time.process_time()
    try:
        folder = _folder()
        if folder is None:
            return None
        path = folder / function.__module__.rpartition(".")[0] / file_name(function)
        head, image = _read(path)
        if (head["stamp"], head["numba"]) != (stamp(), _numba_version()):
            return None
        found = Image(head["arguments"], _load(function, head, image))
    except (OSError, ValueError, KeyError, NotBare):
        return None
    name = f"{function.__module__}.{function.__qualname__}"
    compilations.append(Compilation(name, time.process_time() - begin, from_cache=True, cache_folder=str(path.parent)))
    return found


def value_in_words(value: object) -> str:
    """What machine code depends on in an argument.

    Raises:
        NotBare: Another argument than arrays, numbers, and tuples of these.
    """
    if type(value) is np.ndarray:
        flags = value.flags
        layout = "C" if flags.c_contiguous else "F" if flags.f_contiguous else "A"
        return _array_in_words(value.dtype, value.ndim, layout, flags.writeable, flags.aligned)
    if isinstance(value, tuple):
        return f"{_title(type(value))}({', '.join(map(value_in_words, value))})"
    if isinstance(value, (bool, float)) or (isinstance(value, int) and value.bit_length() < 64):
        return {bool: "bool", float: "float64", int: "int64"}.get(type(value), "other")
    raise NotBare(f"{type(value).__name__} is no array, number or tuple")


def _type_in_words(kind: Any) -> str:
    """The same of Numba's type of an argument."""
    types: Any = importlib.import_module("numba.core.types")
    as_dtype = importlib.import_module("numba.np.numpy_support").as_dtype

    if isinstance(kind, types.Array):
        return _array_in_words(as_dtype(kind.dtype), kind.ndim, kind.layout, kind.mutable, kind.aligned)
    if isinstance(kind, types.BaseTuple):
        title = _title(getattr(kind, "instance_class", tuple))
        return f"{title}({', '.join(map(_type_in_words, kind.types))})"
    if kind in (types.boolean, types.float64, types.int64):
        return str(kind)
    raise NotBare(f"{kind} is no array, number or tuple")


@cache
def _title(kind: type) -> str:
    """Name of a kind of tuples, and of its fields."""
    return f"{kind.__name__} {' '.join(getattr(kind, '_fields', ()))}".strip()


def _array_in_words(dtype: Any, ndim: int, layout: str, is_writeable: bool, is_aligned: bool) -> str:
    if dtype.kind not in "biuf":
        raise NotBare(f"{dtype} are no numbers")
    return f"{dtype.str} {ndim} {layout} {is_writeable:d} {is_aligned:d}"


@cache
def _folder() -> Path | None:
    """Folder of images for this processor; None where machine code may differ from that of the installation."""
    changed = any(name.startswith("NUMBA_") and name not in _SETTINGS for name in os.environ)
    if not _IS_POSSIBLE or changed or os.environ.get("SCENARIONET_PLAIN_NUMBA") == "1":
        return None
    return next((level.folder for level in shipped.levels_by_flags()), None)


@cache
def _numba_folder() -> Path:
    found = util.find_spec("numba")
    return Path(((found and found.submodule_search_locations) or [""])[0])


@cache
def _numba_version() -> str:
    """Version of Numba, without its import."""
    found = re.search(r'"version": "([^"]+)"', (_numba_folder() / "_version.py").read_text("utf-8"))
    return found[1] if found else ""


def _read(path: Path) -> tuple[dict[str, Any], bytes]:
    """What is needed to load an image, and the image.

    Raises:
        NotBare: The file is damaged: its machine code would end the process.
    """
    file = path.read_bytes()
    digest, content = file[:32], file[32:]
    if hashlib.sha256(content).digest() != digest:
        raise NotBare(f"{path} is damaged")
    head, _, image = content.partition(b"\n")
    return json.loads(head), image


@cache
def _address(symbol: str) -> int | None:
    """Address of a function or variable of Python, the C library or Numba; None for others."""
    if symbol.startswith(_HELPER):
        return _helpers().get(symbol.removeprefix(_HELPER))
    found = getattr(ctypes.pythonapi, symbol, None)
    return found and ctypes.cast(found, ctypes.c_void_p).value


@cache
def _helpers() -> dict[str, int]:
    """Addresses of Numba's functions in C: of its extension module, which needs no other one."""
    name, suffixes = "numba._helperlib", machinery.EXTENSION_SUFFIXES
    file = next(path for path in (_numba_folder() / f"_helperlib{suffix}" for suffix in suffixes) if path.exists())
    loader = machinery.ExtensionFileLoader(name, str(file))
    module: Any = util.module_from_spec(machinery.ModuleSpec(name, loader, origin=str(file)))
    loader.exec_module(module)
    return dict(module.c_helpers)


class _Method(ctypes.Structure):
    """PyMethodDef of Python's C interface."""

    _fields_ = (
        ("name", ctypes.c_char_p),
        ("function", ctypes.c_void_p),
        ("flags", ctypes.c_int),
        ("doc", ctypes.c_char_p),
    )


_WITH_KEYWORDS = 3  # METH_VARARGS | METH_KEYWORDS
_kept: list[Any] = []
"""Memory of loaded images, and what describes them to Python: kept as long as the process runs."""


def _load(function: Any, head: dict[str, Any], image: bytes) -> Callable[..., Any]:
    """Load an image; returns its entry."""
    memory = mmap.mmap(-1, len(image), prot=mmap.PROT_READ | mmap.PROT_WRITE)
    memory.write(image)
    start = ctypes.addressof(ctypes.c_char.from_buffer(memory))
    for place, symbol, addend in head["places"]:
        address = _address(symbol) if symbol else start
        if address is None:
            raise NotBare(f"this process has no {symbol}")
        struct.pack_into("<Q", memory, place, (address + addend) % 2**64)
    if ctypes.CDLL(None).mprotect(ctypes.c_void_p(start), ctypes.c_size_t(len(image)), mmap.PROT_READ | mmap.PROT_EXEC):
        raise NotBare("the system forbids it")
    method = _Method(function.__name__.encode(), start + head["entry"], _WITH_KEYWORDS, None)
    _kept.append((memory, method))
    make = ctypes.pythonapi.PyCFunction_NewEx
    make.restype, make.argtypes = ctypes.py_object, [ctypes.c_void_p, ctypes.c_void_p, ctypes.c_void_p]
    entry: Callable[..., Any] = make(ctypes.addressof(method), None, None)
    return entry
