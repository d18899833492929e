"""Commands and readings of a recording, as identification needs them."""
from __future__ import annotations

import os
import pathlib
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import h5py
import numpy as np
from numpy.typing import NDArray

Array = NDArray[Any]
LEAST_FRAMES = 20
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
    name = os.fspath(path)
    if not pathlib.Path(path).is_file():
        raise RecordingError(f"{name}: no such file")
    try:
        with h5py.File(path, "r") as file:
            return _read(name, file)
    except (OSError, KeyError, RuntimeError) as error:
        raise RecordingError(f"{name}: cannot be read as a recording: {str(error).splitlines()[0]}") from error


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
    ticks = file["tick"][:].astype(np.int64)
    if len(ticks) < LEAST_FRAMES:
        raise RecordingError(f"{name}: has {len(ticks)} frames: must have at least {LEAST_FRAMES}")
    if (np.diff(ticks) <= 0).any():
        raise RecordingError(f"{name}: its ticks do not ascend")
    is_live = "clock" in file
    frames = int(ticks[-1] - ticks[0]) + 1
    if frames > 4 * len(ticks):
        raise RecordingError(f"{name}: {frames - len(ticks)} of {frames} frames are lost")
    at = ticks - ticks[0]
    rows, columns = int(surface["rows"]), int(surface["columns"])

    def plane(data: h5py.Dataset, gap: bool) -> Array:
        """gap: frames that were lost read NaN; else they repeat the previous one."""
        values = data[:len(ticks)].astype(np.float32)
        if gap:
            full = np.full((frames, *values.shape[1:]), np.nan, np.float32)
            full[at] = values
            return full
        held: Array = values[np.searchsorted(at, np.arange(frames), side="right") - 1]
        return held

    commands = {key: plane(data, False) for key, data in file["actuators"].items() if data.ndim == 3}
    readings = {key: plane(data, True) for key, data in file["sensors"].items() if data.ndim == 3}
    if not is_live and "surface/height" in file:
        readings.setdefault("", plane(file["surface/height"], True))  # the heights themselves
    valid = readings.pop("valid", None)
    readings.pop("age", None)
    if valid is not None:
        for values in readings.values():
            values[valid == 0] = np.nan
    if is_live:
        sure = _answers(file, ticks, frames)
        for key, data in file["actuators"].items():
            if data.ndim == 3:
                commands[key] = _in_force(data[:len(ticks)].astype(np.float32), sure)
        unsure = _unsure_cells(commands, sure, valid, float(meta["control_period_s"]))
        other = at[_of_other_ticks(file, ticks)]
        for values in readings.values():
            values[unsure] = np.nan
            values[other] = np.nan
    for values in commands.values():
        if not np.isfinite(values).all():
            values[...] = np.where(np.isfinite(values), values, np.nanmin(values))
    options = {key: _text(value) for key, value in file["meta/options"].attrs.items()} if "meta/options" in file else {}
    return Recorded(name, rows, columns, float(surface["pitch"]), float(meta["control_period_s"]),
                    _text(meta.get("experiment_file", "")), int(meta.get("seed", 1)), options,
                    not is_live and int(ticks[0]) == 0, commands, readings, frames - len(ticks))
