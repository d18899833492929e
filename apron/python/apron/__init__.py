"""APRON programs as functions of NumPy arrays.

    import apron
    f = apron.compile('''
    !register(A, B, Y)
    Y = max(A, north(A)) * (B > 0.5)
    ''')
    y = f(A=a, B=b)["Y"]

The program runs as `apron run` runs it, from the same machine code, with the same bits. docs/python.md and
docs/apron-language.md describe the functions and the language.
"""
from __future__ import annotations

import os
import pathlib
import warnings as _warnings
from collections.abc import Iterable, Mapping
from typing import Any

import numpy as np

from . import _core
from ._core import Function, __version__
from ._errors import Error

__all__ = ["Error", "Function", "__version__", "compile", "empty", "zeros"]

_LIBRARY = os.fspath(pathlib.Path(__file__).parent / "library")
_MAX_THREADS = 256


def _whole(name: str, value: Any, least: int, most: int) -> int:
    if isinstance(value, (bool, np.bool_)) or not isinstance(value, (int, np.integer)) or not least <= value <= most:
        raise ValueError(f"{name} = {value!r}: must be a whole number from {least} to {most}")
    return int(value)


def _shape(shape: Any) -> tuple[int, int]:
    if not isinstance(shape, (tuple, list)) or len(shape) != 2:
        raise ValueError(f"shape = {shape!r}: must be (rows, columns)")
    rows, columns = (_whole("shape", side, 1, _core.max_cells) for side in shape)
    if rows * columns > _core.max_cells:
        raise ValueError(f"shape = {shape!r}: must have at most {_core.max_cells} cells")
    return rows, columns


def _names(argument: str, names: Any) -> list[str]:
    if isinstance(names, str) or not isinstance(names, Iterable):
        raise ValueError(f"{argument} = {names!r}: must be a list of strings")
    return [_path(name) for name in names]


def _path(path: str | os.PathLike[str]) -> str:
    """The path for the compiled part, which takes NUL for its end: ValueError, as of open()."""
    text = os.fspath(path)
    if "\0" in os.fsdecode(text):
        raise ValueError("embedded null character")
    return text


def _dialect(original: Any) -> str:
    if isinstance(original, (bool, np.bool_)):
        return "original" if original else ""
    if original not in ("original", "scamp5c"):
        raise ValueError(f"original = {original!r}: must be True, False or 'scamp5c'")
    return original


def _source(source: Any) -> tuple[str, str | None]:
    """File and text of a program; the text is None for a file."""
    if isinstance(source, os.PathLike) or isinstance(source, str) and "\n" not in source and source.endswith(".aps"):
        return _path(source), None
    if not isinstance(source, str):
        raise TypeError(f"source is a {type(source).__name__}: must be a program's text, or the path of an .aps file")
    return "<text>", source


def compile(source: str | os.PathLike[str], *, results: Iterable[str] | None = None,
            shape: tuple[int, int] | None = None, threads: int = 1, ticks: int | None = None,
            include: Iterable[str | os.PathLike[str]] = (), original: bool | str = False, isa: str | None = None) -> Function:
    """Compiles a program to a function of arrays.

    source: the text of a program, or the path of an .aps file: a path object, or one line that ends in ".aps".
    results: the registers and scalars that a call returns; default: all that the program writes. Fewer are faster,
    because the others need not be kept.
    shape: rows and columns of the registers without a size of their own; default: those of the arrays of each call.
    threads: of large arrays, and of batches; results do not depend on it.
    ticks: ends a run after that many surface.step or sim.frame, with an Error where an endless loop has none.
    include: folders that !include searches. original: a script of APRON 2.9, or "scamp5c", one for
    the SCAMP-5. isa: "avx512", "avx2" or "portable";
    results do not depend on it.

    Raises Error with file and line for errors in the program, and warns of what the compiler warns of."""
    file, text = _source(source)
    function = Function(file, text, _names("include", include), _LIBRARY, _dialect(original),
                        None if results is None else _names("results", results),
                        None if shape is None else _shape(shape), _whole("threads", threads, 1, _MAX_THREADS),
                        None if ticks is None else _whole("ticks", ticks, 1, 2**63), isa or "")
    if function.warnings:
        _warnings.warn(function.warnings.rstrip("\n"), stacklevel=2)
    return function


def empty(shape: tuple[int, int], dtype: Any = np.float32) -> np.ndarray:
    """An array of float32, int32, uint16 or uint8 with any values, (rows, columns), laid out as programs lay out their registers: a function
    takes it without a copy. Its rows lie farther apart than it is wide, so that it is not C-contiguous."""
    return _core.make_array(*_shape(shape), np.dtype(dtype).name)


def zeros(shape: tuple[int, int], dtype: Any = np.float32) -> np.ndarray:
    """As `empty`, with zeros."""
    array = empty(shape, dtype)
    array[...] = 0
    return array


def _controllers(program: str | os.PathLike[str], parameters: Mapping[str, float] | None = None,
                 include: Iterable[str | os.PathLike[str]] = ()) -> Any:
    """For smartsurf.VectorEnv: controllers that run this program, in a capsule."""
    values = []
    for name, value in (parameters or {}).items():
        if isinstance(value, str) or not np.isfinite(value):
            raise ValueError(f"{name} = {value!r}: the value of a slider or switch must be a finite number")
        values.append((str(name), float(value)))
    return _core.make_controllers(_path(program), _LIBRARY, _names("include", include), values)
