"""Commands and readings of a recording, as identification needs them."""
from __future__ import annotations

import ctypes
import multiprocessing
import os
import pathlib
import re
import resource
import signal
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from typing import Any, TypeVar

import h5py
import numpy as np
from numpy.typing import NDArray

Array = NDArray[Any]
Read = TypeVar("Read")
LEAST_FRAMES = 20
MOST_MEMORY, MEMORY_OF_BYTE = 2 << 30, 16  # in bytes: to read a file, and to read each of its bytes
MOST_S, S_OF_BYTE = 60, 2.0**-20  # processor time, likewise
MOST_OBJECTS, MOST_ATTRIBUTES = 200_000, 8000  # of the groups that are read; of one object
PR_SET_PDEATHSIG = 1  # of Linux
SETTLES_S = 0.5  # after a command whose time is not known,
CROSSES_S = 1.0  # and for how long a cell may move, if the command changed by more than
SMALL = 0.1      # of the span of its commands


class RecordingError(ValueError):
    """A recording that cannot be used, in one line."""


@dataclass
class Recorded:
    """One recording, frame by frame from its first to its last tick. Commands are those in force in the tick that ends with the
    frame; of a frame that was lost they are the previous ones, and its readings are NaN."""
    path: str
    rows: int
    columns: int
    pitch: float
    period_s: float
    experiment: str                # name of the experiment's file; "": a live surface
    seed: int
    options: dict[str, str]        # of the experiment; none of a live surface
    from_start: bool               # the first frame is the state before the first command
    commands: dict[str, Array]     # F × rows × columns, float32
    readings: dict[str, Array]     # the same; channels of one component
    lost: int
    ranges: dict[str, tuple[float, float]] = field(default_factory=dict)  # of the commands, where the recording says so

    @property
    def frames(self) -> int:
        return len(next(iter(self.commands.values())))


def _answers(file: h5py.File, ticks: Array, frames: int) -> Array:
    """For each tick from the first one on, which row of /actuators answers it; −1: none that was seen, or one of which it is not
    known whether the boards followed it from the next tick on: their frames then have to say so."""
    answered = file["answers/tick"][:len(ticks)].astype(np.int64) if "answers/tick" in file else ticks
    row = np.full(frames, -1)
    known = (answered >= ticks[0]) & (answered < ticks[0] + frames)
    row[answered[known] - ticks[0]] = np.flatnonzero(known)
    if "boards/in_force" in file:
        in_force, valid = (file["boards/" + name][:len(ticks)].astype(np.int64) for name in ("in_force", "valid"))
        follow = ((in_force == ticks[:, None] - 1) | (valid != 1)).all(1) & (valid == 1).any(1)
        sure = np.zeros(frames + 1, bool)
        sure[ticks[follow] - ticks[0]] = True
        row[~sure[1:]] = -1
    return row


def _of_other_ticks(file: h5py.File, ticks: Array) -> Array:
    """For each recorded frame, whether a board's part of it is of another tick than usual: its own came too late."""
    if "boards/tick" not in file:
        return np.zeros(len(ticks), bool)
    ahead, valid = (file["boards/" + name][:len(ticks)].astype(np.int64) for name in ("tick", "valid"))
    ahead = ahead - ticks[:, None]
    other = np.zeros(len(ticks), bool)
    for board in range(ahead.shape[1]):
        known = valid[:, board] == 1
        if known.any():
            values, counts = np.unique(ahead[known, board], return_counts=True)
            other |= known & (ahead[:, board] != values[counts.argmax()])
    return other


def _in_force(values: Array, row: Array) -> Array:
    """The commands in force in the tick that ends with each frame: those that answered the previous one, or, where these are not
    known, the last ones known."""
    last = np.maximum.accumulate(np.where(row >= 0, np.arange(len(row)), -1))
    rows = np.where(last >= 0, row[np.maximum(last, 0)], 0)
    in_force: Array = values[np.concatenate([rows[:1], rows[:-1]])]
    return in_force


def _unsure_cells(commands: Mapping[str, Array], row: Array, valid: Array | None, period_s: float) -> Array:
    """Frames × rows × columns: where a command changed at a time that is not known, until the cell has settled. valid: by cell,
    whether its board said what was in force."""
    unsure = np.zeros(next(iter(commands.values())).shape, bool)
    spans = {key: np.ptp(values, axis=0) for key, values in commands.items()}
    settles, crosses = round(SETTLES_S / period_s), round((SETTLES_S + CROSSES_S) / period_s)

    def mark(begin: int, after: int, cells: Array | bool = True) -> None:
        for key, values in commands.items():
            change = np.abs(values[begin] - values[after])
            unsure[begin:after + settles] |= cells & (change > 0)
            unsure[begin:after + crosses] |= cells & (change > SMALL * spans[key])
    gaps = np.flatnonzero(np.diff(np.concatenate([[False], row < 0, [False]]).astype(int)))
    for begin, end in gaps.reshape(-1, 2):  # ticks without a known answer
        after = min(end + 1, len(row) - 1)  # the first frame whose commands are known again
        mark(begin, after)
    if valid is not None:
        for frame in np.flatnonzero((valid == 0).any((1, 2))):
            mark(max(int(frame) - 1, 0), int(frame), valid[frame] == 0)
    return unsure


def _text(value: Any) -> str:
    return value.decode() if isinstance(value, bytes) else str(value)


def read(path: str | os.PathLike[str]) -> Recorded:
    """Reads a recording. Raises RecordingError."""
    return read_apart(path, _read)


def read_apart(path: str | os.PathLike[str], read_file: Callable[[str, h5py.File], Read]) -> Read:
    """What read_file returns of the recording's name and file, in a process of its own: a damaged file may let HDF5 crash, or ask
    for any amount of memory. Raises RecordingError."""
    name = os.fspath(path)
    if not pathlib.Path(path).is_file():
        raise RecordingError(f"{name}: {'is not a regular file' if pathlib.Path(path).exists() else 'no such file'}")
    receiver, sender = multiprocessing.Pipe(duplex=False)
    prctl, parent = ctypes.CDLL(None).prctl, os.getpid()
    child = os.fork()
    if child == 0:
        prctl(PR_SET_PDEATHSIG, signal.SIGKILL)
        if os.getppid() != parent:
            os._exit(1)
        try:
            sender.send(_outcome(name, read_file))
        finally:
            os._exit(0)
    sender.close()
    try:
        found, error = receiver.recv()
    except (EOFError, OSError):
        found, error = None, "is damaged: the HDF5 library cannot read it"
    finally:
        receiver.close()
        _, status = os.waitpid(child, 0)
    if os.WIFSIGNALED(status) and os.WTERMSIG(status) == signal.SIGPROF:
        error = f"needs more than {_most_s(name):.0f} s of processor time, the most that a reader of a file of this size may have"
    if error is not None:
        raise RecordingError(f"{name}: {error}")
    result: Read = found
    return result


def _most_s(name: str) -> float:
    return MOST_S + S_OF_BYTE * os.path.getsize(name)


def _outcome(name: str, read_file: Callable[[str, h5py.File], Read]) -> tuple[Read | None, str | None]:
    """What was read, or why nothing was."""
    try:
        own = int(pathlib.Path("/proc/self/statm").read_text().split()[0]) * resource.getpagesize()
        soft, hard = resource.getrlimit(resource.RLIMIT_AS)
        most = own + MOST_MEMORY + MEMORY_OF_BYTE * os.path.getsize(name)
        resource.setrlimit(resource.RLIMIT_AS, (most if soft == resource.RLIM_INFINITY else min(most, soft), hard))
        signal.signal(signal.SIGPROF, signal.SIG_DFL)
        signal.setitimer(signal.ITIMER_PROF, _most_s(name))
        with h5py.File(name, "r", locking=False) as file:
            _check_is_whole(file)
            return read_file(name, file), None
    except RecordingError as error:
        return None, str(error).removeprefix(f"{name}: ")
    except MemoryError:
        return None, "cannot be read as a recording: needs too much memory"
    except Exception as error:  # whatever h5py and numpy say of what is not a recording
        return None, f"cannot be read as a recording: {(str(error).splitlines() or [type(error).__name__])[0]}"


def _check_is_whole(file: h5py.File) -> None:
    """Refuses a file that lets HDF5 open others, or that would take it long. Nothing below the second level is read."""
    objects = 0

    def bounded(group: Any) -> Any:
        nonlocal objects
        if (attributes := len(group.attrs)) > MOST_ATTRIBUTES:
            raise RecordingError(f"{group.name} has {attributes} attributes; at most {MOST_ATTRIBUTES} are read")
        objects += len(group) if isinstance(group, h5py.Group) else 0
        if objects > MOST_OBJECTS:
            raise RecordingError(f"has more than {MOST_OBJECTS} objects, the most that are read")
        return group

    def own(group: h5py.Group, name: str) -> Any:
        item = group[name] if isinstance(group.get(name, getlink=True), h5py.HardLink) else None
        if item is None or isinstance(item, h5py.Dataset) and (item.external or item.is_virtual):
            raise RecordingError(f"{group.name.rstrip('/')}/{name} is not in the file itself")
        return bounded(item)
    bounded(file)
    for top in file:
        group = own(file, top)
        for name in group if isinstance(group, h5py.Group) else ():
            own(group, name)


def name_of_link(link: str) -> str:
    """The name of a metric, by that of its dataset."""
    return re.sub("%(2F|00|2E|25)", lambda code: chr(int(code[1], 16)), link)


def _read(name: str, file: h5py.File) -> Recorded:
    meta = file["meta"].attrs
    if _text(meta.get("format", "")) != "smartsurf-recording":
        raise RecordingError(f"{name}: is not a recording of smartsurf")
    if int(meta.get("every", 1)) != 1:
        raise RecordingError(f"{name}: has every {int(meta['every'])}th tick only: record with record {{ every = 1 }}")
    for group, flag in (("actuators", "actuators"), ("sensors", "sensors")):
        if group not in file or len(file[group]) == 0:
            raise RecordingError(f"{name}: has no {group}: record with record {{ {flag} = true }}")
    surface = file["surface"].attrs
    if file["tick"].dtype.kind not in "iu":
        raise RecordingError(f"{name}: its ticks are no whole numbers")
    ticks = file["tick"][:].astype(np.int64)
    if len(ticks) < LEAST_FRAMES:
        raise RecordingError(f"{name}: has {len(ticks)} frames: must have at least {LEAST_FRAMES}")
    if (ticks < 0).any() or (np.diff(ticks) <= 0).any():
        raise RecordingError(f"{name}: its ticks do not ascend")
    is_live = "clock" in file
    frames = int(ticks[-1]) - int(ticks[0]) + 1
    if frames > 4 * len(ticks):
        raise RecordingError(f"{name}: {frames - len(ticks)} of {frames} frames are lost")
    at = ticks - ticks[0]
    rows, columns = int(surface["rows"]), int(surface["columns"])

    def planes(group: str) -> dict[str, h5py.Dataset]:
        return {key: data for key, data in file[group].items() if isinstance(data, h5py.Dataset) and data.ndim == 3}

    def plane(data: h5py.Dataset, gap: bool) -> Array:
        """gap: frames that were lost read NaN; else they repeat the previous one."""
        if data.shape[0] < len(ticks) or data.shape[1:] != (rows, columns) or data.dtype.kind not in "fiu":
            raise RecordingError(f"{name}: {data.name} does not have {len(ticks)} frames of {rows} x {columns} numbers")
        values = data[:len(ticks)].astype(np.float32)
        if gap:
            full = np.full((frames, *values.shape[1:]), np.nan, np.float32)
            full[at] = values
            return full
        held: Array = values[np.searchsorted(at, np.arange(frames), side="right") - 1]
        return held

    commands = {key: plane(data, False) for key, data in planes("actuators").items()}
    ranges = {key: (float(data.attrs["minimum"]), float(data.attrs["maximum"])) for key, data in planes("actuators").items()
              if {"minimum", "maximum"} <= data.attrs.keys()}
    readings = {key: plane(data, True) for key, data in planes("sensors").items()}
    if not is_live and "surface/height" in file:
        readings.setdefault("", plane(file["surface/height"], True))  # the heights themselves
    valid = readings.pop("valid", None)
    readings.pop("age", None)
    if valid is not None:
        for values in readings.values():
            values[valid == 0] = np.nan
    if is_live:
        sure = _answers(file, ticks, frames)
        for key, data in planes("actuators").items():
            commands[key] = _in_force(data[:len(ticks)].astype(np.float32), sure)
        unsure = _unsure_cells(commands, sure, valid, float(meta["control_period_s"]))
        other = at[_of_other_ticks(file, ticks)]
        for values in readings.values():
            values[unsure] = np.nan
            values[other] = np.nan
    for key, values in commands.items():
        known = np.isfinite(values)
        if not known.any():
            raise RecordingError(f"{name}: no command of '{key}' is a finite number")
        values[~known] = values[known].min()
    options = {key: _text(value) for key, value in file["meta/options"].attrs.items()} if "meta/options" in file else {}
    return Recorded(name, rows, columns, float(surface["pitch"]), float(meta["control_period_s"]),
                    _text(meta.get("experiment_file", "")), int(meta.get("seed", 1)), options,
                    not is_live and int(ticks[0]) == 0, commands, readings, frames - len(ticks), ranges)
