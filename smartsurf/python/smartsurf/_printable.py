"""Texts of files and names on terminals, whose control characters they must not reach. Needs the standard library only."""
from __future__ import annotations

import contextlib
import os
import re
import sys
from collections.abc import Iterable, Iterator
from typing import Any, TextIO, cast

# Those of common/text/Printable.cpp: control characters, and Unicode's of lines and of the direction of writing.
_CONTROL = re.compile("[\x00-\x1f\x7f-\x9f\u061c\u200e\u200f\u2028-\u202e\u2066-\u2069\ud800-\udfff]")


def printable(text: object, also: str = "") -> str:
    r"""The text on one line, control characters but those of `also` escaped, as \x1b."""
    return _CONTROL.sub(lambda found: found[0] if found[0] in also else repr(found[0])[1:-1], str(text))


class _Guarded:
    """A stream to which nothing is written once nobody reads it. escapes: control characters but line breaks and tabs."""

    def __init__(self, stream: TextIO, escapes: bool):
        self._stream, self._escapes = stream, escapes

    def write(self, text: str) -> int:
        with self._unread():
            self._stream.write(printable(text, "\n\t") if self._escapes else text)
        return len(text)

    def writelines(self, lines: Iterable[str]) -> None:
        for line in lines:
            self.write(line)

    def flush(self) -> None:
        with self._unread():
            self._stream.flush()

    @contextlib.contextmanager
    def _unread(self) -> Iterator[None]:
        """Drops what is buffered and what follows once the reader has closed the pipe."""
        try:
            yield
        except BrokenPipeError:
            nowhere = os.open(os.devnull, os.O_WRONLY)
            os.dup2(nowhere, self._stream.fileno())
            os.close(nowhere)
            self._stream.flush()

    def __getattr__(self, name: str) -> Any:
        return getattr(self._stream, name)


def guard_output() -> None:
    """Escapes what this process writes to sys.stderr and, if that is a terminal, to sys.stdout. A process whose output nobody reads
    goes on with its work."""
    if sys.stderr is not None:  # it is None where its descriptor is closed
        sys.stderr = cast(TextIO, _Guarded(sys.stderr, True))
    if sys.stdout is not None:
        sys.stdout = cast(TextIO, _Guarded(sys.stdout, sys.stdout.isatty()))
