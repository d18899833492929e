"""Files that appear whole or not at all. Needs the standard library only."""
from __future__ import annotations

import contextlib
import os
import pathlib
from collections.abc import Iterator
from typing import Union

PathName = Union[str, "os.PathLike[str]"]


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
def replaced(path: PathName) -> Iterator[pathlib.Path]:
    """Yields a new file, which replaces `path` at the end, once it is on the disk: no reader sees a part of it. After an error the
    old file stays, and an OSError names `path`. A link stays, and its target is replaced; a pipe or a device is written in place."""
    target = pathlib.Path(os.path.realpath(path))
    in_place = target.exists() and not target.is_file()
    # The process id keeps two that write the same file apart.
    part = target if in_place else target.with_name(f"{target.name}.part{os.getpid()}")
    try:
        if not in_place:
            part.unlink(missing_ok=True)
            os.close(os.open(part, os.O_WRONLY | os.O_CREAT | os.O_EXCL | os.O_CLOEXEC, 0o666))
        yield part
        if not in_place:
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
