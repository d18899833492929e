"""Files that appear whole or not at all, and those of a folder of results. Needs the standard library only."""
from __future__ import annotations

import contextlib
import errno
import json
import math
import os
import pathlib
import stat
from collections.abc import Iterable, Iterator
from typing import Any, Union

PathName = Union[str, "os.PathLike[str]"]

MAX_RESULT_BYTES = 16 << 20
MAX_RESULT_LEVELS = 32  # of objects and arrays in JSON


class ResultError(ValueError):
    """What lies in a folder of results is not what was written there. Its text is one line that begins with the path."""


def path_text(path: PathName) -> str:
    """The path for the compiled part, which takes NUL for its end: ValueError, as of open()."""
    text = os.fspath(path)
    if "\0" in os.fsdecode(text):
        raise ValueError("embedded null character")
    return text


def folder_of_episodes(folder: PathName, pattern: str) -> str:
    """The path of a folder for new files that match the pattern, which has none of them or does not exist, or ValueError."""
    text = path_text(folder)
    path = pathlib.Path(text)
    if path.exists() and not path.is_dir():
        raise ValueError(f"record = {text!r}: is a file: must be a folder, in which each episode is a file")
    for old in sorted(path.glob(pattern))[:1]:
        raise ValueError(f"record = {text!r}: has {old.name} of an earlier recording: give another folder")
    return text


@contextlib.contextmanager
def replaced(path: PathName, own: bool = False, sync: bool = True) -> Iterator[pathlib.Path]:
    """Yields a new file, which replaces `path` at the end, with `sync` once it is on the disk: no reader sees a part of it. After an
    error the old file stays, and an OSError names `path`. A link stays, and its target is replaced; a pipe or a device is written in
    place. own: of a folder of results: the file replaces what lies there, be it a link, a pipe or a device."""
    target = pathlib.Path(path if own else os.path.realpath(path))
    in_place = not own and target.exists() and not target.is_file()
    # The process id keeps two that write the same file apart.
    part = target if in_place else target.with_name(f"{target.name}.part{os.getpid()}")
    try:
        if not in_place:
            part.unlink(missing_ok=True)
            os.close(os.open(part, os.O_WRONLY | os.O_CREAT | os.O_EXCL | os.O_CLOEXEC, 0o666))
        yield part
        if not in_place:
            if sync:
                with part.open("rb") as file:
                    os.fsync(file.fileno())
            part.replace(target)
    except OSError as error:
        if error.errno is None:
            raise
        raise OSError(error.errno, error.strerror, os.fspath(path)) from error
    finally:
        if not in_place:
            with contextlib.suppress(OSError):
                part.unlink()


def write_own(path: PathName, text: str) -> None:
    """Writes a file of a folder of results, which may vanish if the machine loses its power."""
    with replaced(path, own=True, sync=False) as part:
        part.write_bytes(text.encode())


def clear(path: pathlib.Path) -> None:
    """Removes what is neither a file nor a folder, such as a link, to make place for what another program writes."""
    with contextlib.suppress(FileNotFoundError):
        if stat.S_IFMT(path.lstat().st_mode) not in (stat.S_IFREG, stat.S_IFDIR):
            path.unlink()


def require_no_link(folder: pathlib.Path) -> None:
    if folder.is_symlink():
        raise ResultError(f"{folder}: is a link: must be a folder, as results are written to no other place")


def open_own(path: pathlib.Path, flags: int = os.O_RDONLY) -> int:
    """The descriptor of a file of a folder of results. Raises ResultError unless it is a regular one."""
    try:
        descriptor = os.open(path, flags | os.O_NOFOLLOW | os.O_NONBLOCK | os.O_CLOEXEC, 0o666)
    except OSError as error:
        if error.errno not in (errno.ELOOP, errno.ENXIO):
            raise
    else:
        if stat.S_ISREG(os.fstat(descriptor).st_mode):
            return descriptor
        os.close(descriptor)
    raise ResultError(f"{path}: is a link, a pipe or the like: must be a file")


def read_own(path: pathlib.Path, last: int | None = None) -> bytes:
    """A file of a folder of results, or its `last` bytes. Raises ResultError unless it is a regular one of at most
    MAX_RESULT_BYTES."""
    with open(open_own(path), "rb") as file:
        if last is not None:
            file.seek(max(0, os.fstat(file.fileno()).st_size - last))
            return file.read(last)
        read = file.read(MAX_RESULT_BYTES + 1)
    if len(read) > MAX_RESULT_BYTES:
        raise ResultError(f"{path}: has more than {MAX_RESULT_BYTES >> 20} MiB, the most that a file of results may have")
    return read


def _finite(text: str) -> float:
    value = float(text)
    if not math.isfinite(value):
        raise ValueError(f"{text[:20]}: must be a finite number")
    return value


def _whole(text: str) -> int | float:
    value = _finite(text)
    number = int(text)
    return number if abs(number) < 2**64 else value


def _inner(value: Any) -> Iterable[Any]:
    return value.values() if isinstance(value, dict) else value if isinstance(value, list) else ()


def read_json(path: pathlib.Path) -> dict[str, Any]:
    """The object in a file of a folder of results. Its numbers are finite and its texts can be encoded. Raises ResultError for any
    other file, and OSError."""
    text = read_own(path)
    try:
        stored = json.loads(text, parse_int=_whole, parse_float=_finite, parse_constant=_finite)
        json.dumps(stored, ensure_ascii=False).encode()
        level = [stored]
        for _ in range(MAX_RESULT_LEVELS):
            level = [inner for value in level for inner in _inner(value)]
        if level:
            raise RecursionError
    except RecursionError:
        raise ResultError(f"{path}: is damaged: has more than {MAX_RESULT_LEVELS} levels") from None
    except ValueError as error:
        raise ResultError(f"{path}: is damaged: {error}") from None
    if not isinstance(stored, dict):
        raise ResultError(f"{path}: is damaged: must be an object in JSON")
    return stored
