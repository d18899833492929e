"""Commands and readings of a recording, as identification needs them."""
from __future__ import annotations

import os
import pathlib
from dataclasses import dataclass
from typing import Any

import h5py
import numpy as np
from numpy.typing import NDArray

Array = NDArray[Any]
LEAST_FRAMES = 20


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
        # The commands in a live frame answer it: they are in force in the next tick.
        commands = {key: np.concatenate([values[:1], values[:-1]]) for key, values in commands.items()}
    for values in commands.values():
        if not np.isfinite(values).all():
            values[...] = np.where(np.isfinite(values), values, np.nanmin(values))
    options = {key: _text(value) for key, value in file["meta/options"].attrs.items()} if "meta/options" in file else {}
    return Recorded(name, rows, columns, float(surface["pitch"]), float(meta["control_period_s"]),
                    _text(meta.get("experiment_file", "")), int(meta.get("seed", 1)), options,
                    not is_live and int(ticks[0]) == 0, commands, readings, frames - len(ticks))
