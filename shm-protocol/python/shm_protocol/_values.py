"""Results, errors and the plain values that the three roles share."""
import dataclasses
import enum
import sys

import numpy as np


class Result(enum.IntEnum):
    """A result of the library, numbered as in ssp_result."""
    OK = 0
    REPEATED = 1
    TORN = 2
    TIMEOUT = 3
    INTERRUPTED = 4
    OUT_OF_TURN = 5
    NO_CONTROLLER = 6
    CONTROLLER_DEAD = 7
    CONTROLLER_CLOSED = 8
    SURFACE_DEAD = 9
    SURFACE_CLOSED = 10
    BAD_CONFIG = -1
    SURFACE_LIVES = -2
    NOT_FOUND = -3
    CONTROLLER_LIVES = -4
    WRONG_VERSION = -5
    CORRUPT = -6
    FOREIGN = -7
    LAYOUT_CHANGED = -8
    ATTACH_INTERRUPTED = -9
    SYSTEM = -10
    ARGUMENT = -11
    NO_MEMORY = -12
    INTERNAL = -13


class Error(RuntimeError):
    """A failure. result is the reason; pid the process that caused it, or 0."""

    def __init__(self, result, message, pid=0):
        super().__init__(message)
        self.result, self.pid = Result(result), pid

    def report(self):
        """Prints the reason in one line on stderr. Returns 3, the exit status of a controller without a surface."""
        print(self, file=sys.stderr)
        return 3


def c_text(field, text):
    """The text for the library, where it would end at a NUL."""
    if "\0" in text:
        raise Error(Result.BAD_CONFIG, f"{field} {text!r}: must not contain a NUL")
    return text.encode()


class NotFound(Error):
    """There is no such surface, or only a dead or closing one."""


class SurfaceDied(Error):
    """The surface was killed, or ended without closing."""


DIRECTIONS = {"sensor": 1, "actuator": 2}
MODES = {"time-step": 1, "passive": 2}
STATES = {"loading": 1, "ready": 2, "running": 3, "paused": 4, "closing": 5}


@dataclasses.dataclass(frozen=True)
class Channel:
    """One array that is exchanged each tick: components × rows × columns."""
    name: str
    minimum: float = 0.0
    maximum: float = 1.0
    safe: float = 0.0
    dtype: np.dtype = np.dtype("<f4")
    components: int = 1
    unit: str = ""
    direction: str = ""  # "sensor" or "actuator"; set by Surface
    number: int = -1     # index in the session's directory; set by the library


@dataclasses.dataclass(frozen=True)
class Description:
    name: str
    version: tuple
    session: int
    layout_hash: int
    rows: int
    columns: int
    pitch: float
    period: float  # seconds
    mode: str      # "time-step" or "passive"
    surface_pid: int
    channels: tuple
    positions: np.ndarray  # rows × columns × 3, or None for a regular grid


@dataclasses.dataclass(frozen=True)
class Frame:
    frame: int = 0
    tick: int = 0
    time: float = 0.0
    answers: int = 0
    status: int = 0


@dataclasses.dataclass(frozen=True)
class Counters:
    skipped: int
    repeated: int
    clamped: int
    deadline_misses: int
