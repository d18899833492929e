"""The three roles: Surface, Controller, Observer."""
import ctypes
import dataclasses
import enum
import time as _time

import numpy as np

from . import _library as _c
from ._arrays import DTYPES, Arrays, Handle

_lib = _c.lib
_SLICE_NS = 100_000_000  # a wait returns to Python this often, so that Ctrl-C ends it


class Result(enum.IntEnum):
    """What came back from the library; the numbers are those of ssp_result."""
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
    """Something went wrong. result says what; pid is the process in the way, or 0."""

    def __init__(self, result, message, pid=0):
        super().__init__(message)
        self.result, self.pid = Result(result), pid


class NotFound(Error):
    """There is no such surface, or only a dead or closing one."""


class SurfaceDied(Error):
    """The surface was killed, or ended without closing."""


_DIRECTIONS = {"sensor": 1, "actuator": 2}
_MODES = {"time-step": 1, "passive": 2}
_STATES = {"loading": 1, "ready": 2, "running": 3, "paused": 4, "closing": 5}


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
    direction: str = ""  # "sensor" or "actuator"; Surface sets it
    number: int = -1     # in the session's directory; the library sets it


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


def _check(result):
    if result >= 0:
        return Result(result)
    message = _lib.ssp_last_error().decode(errors="replace")
    kind = NotFound if result == Result.NOT_FOUND else Error
    raise kind(result, message, _lib.ssp_last_error_pid())


def _text(raw):
    return raw.decode(errors="replace")


def _in_slices(timeout, call):
    """call(nanoseconds) until it says something else than TIMEOUT, or `timeout` seconds (None: for ever) passed."""
    end = None if timeout is None else _time.monotonic() + timeout
    while True:
        left = _SLICE_NS if end is None else max(0, int((end - _time.monotonic()) * 1e9))
        result = call(min(left, _SLICE_NS))
        if result != Result.TIMEOUT or (end is not None and _time.monotonic() >= end):
            return Result(result)


class _Endpoint:
    """What the three roles have in common."""
    _role = ""

    def _open(self, pointer, free):
        self._handle = Handle(pointer, free)
        self._p = pointer
        raw = _c.Description()
        _check(self._call("describe", ctypes.byref(raw)))
        channels = tuple(self._channel(i) for i in range(raw.channel_count))
        positions = None
        if raw.positions:
            positions = np.ctypeslib.as_array(raw.positions, (raw.rows, raw.columns, 3)).copy()
        self.description = Description(
            _text(raw.name), (raw.version_major, raw.version_minor), raw.session, raw.layout_hash, raw.rows, raw.columns,
            raw.pitch, raw.period_ns * 1e-9, {v: k for k, v in _MODES.items()}[raw.mode], raw.surface_pid, channels,
            positions)

    def _channel(self, number):
        raw = _c.ChannelInfo()
        _check(self._call("channel", number, ctypes.byref(raw)))
        direction = {v: k for k, v in _DIRECTIONS.items()}[raw.direction]
        return Channel(_text(raw.name), raw.minimum, raw.maximum, raw.safe, DTYPES[raw.dtype], raw.components,
                       _text(raw.unit), direction, number)

    def _arrays(self, direction, address_of, writable):
        channels = [c for c in self.description.channels if c.direction == direction]
        return Arrays(self._handle, channels, self.description.rows, self.description.columns, address_of, writable)

    def _call(self, name, *arguments):
        if self._p is None:
            raise Error(Result.ARGUMENT, f"this {self._role} is closed")
        return getattr(_lib, f"ssp_{self._role}_{name}")(self._p, *arguments)

    def _frame(self, *arguments):
        raw = _c.FrameInfo()
        _check(self._call("frame", *arguments, ctypes.byref(raw)))
        return Frame(raw.frame, raw.tick, raw.time_s, raw.answers, raw.status)

    @property
    def counters(self):
        """{"surface": Counters, "controller": Counters}, as both sides see them."""
        both = _c.Counters(), _c.Counters()
        _check(self._call("counters", *(ctypes.byref(b) for b in both)))
        return {who: Counters(b.skipped, b.repeated, b.clamped, b.deadline_misses)
                for who, b in zip(("surface", "controller"), both)}

    def _state(self, who):
        return _text(_lib.ssp_state_text(self._call(f"{who}_state")))

    def __enter__(self):
        return self

    def __exit__(self, *_):
        self.close()


class Controller(_Endpoint):
    """Reads sensors, publishes actuators.

    sensors, actuators: mappings from a channel's name to its array, over the shared memory itself. A sensor array is
    read-only and holds the frame taken last until that is answered. An actuator array is writable until publish(),
    and is to be written whole: afterwards it is the surface's, and read-only. Take arrays anew for each frame.
    """
    _role = "controller"

    def __init__(self, name, timeout=0.0):
        pointer = ctypes.c_void_p()
        result = _in_attach_slices(_lib.ssp_controller_attach, name, timeout, pointer)
        _check(result)
        self._name = name
        self._adopt(pointer.value)

    def _adopt(self, pointer):
        self._open(pointer, _lib.ssp_controller_detach)
        self.sensors = self._arrays("sensor", _lib.ssp_controller_sensor, False)
        self.actuators = self._arrays("actuator", _lib.ssp_controller_actuator, True)

    def wait(self, timeout=None):
        """Waits for a sensor frame that was not read yet. True: there is one. False: the surface is closing.
        Raises TimeoutError after `timeout` seconds (None: never) and SurfaceDied."""
        result = _in_slices(timeout, lambda ns: self._call("await", ns, None))
        return self._taken(result, "no frame came")

    def latest(self):
        """Takes the newest frame without waiting. True: it is new. False: it is the one before, or the surface is
        closing (surface_state tells)."""
        return self._taken(Result(self._call("latest")), "")

    def _taken(self, result, late):
        if result == Result.OK:
            return True
        if result in (Result.SURFACE_CLOSED, Result.REPEATED, Result.TORN):
            return False
        if result == Result.TIMEOUT:
            raise TimeoutError(late)
        if result == Result.SURFACE_DEAD:
            raise SurfaceDied(result, f"the surface {self._name} died", self.description.surface_pid)
        if result == Result.OUT_OF_TURN:
            raise Error(result, "the frame taken last has to be answered first: publish()")
        raise Error(result, _text(_lib.ssp_text(result)))

    def publish(self):
        """Publishes the actuator arrays as the answer to the frame taken last. False: the surface has given that
        frame up."""
        result = Result(self._call("publish"))
        if result == Result.OUT_OF_TURN:
            raise Error(result, "there is no frame to answer: wait() first")
        self.actuators.freeze()
        return result == Result.OK

    frame = property(_Endpoint._frame, doc="The Frame taken last.")
    tick = property(lambda self: self.frame.tick)
    time = property(lambda self: self.frame.time, doc="Simulated seconds of the frame taken last.")
    surface_state = property(lambda self: self._state("surface"))

    def set_state(self, state):
        _check(self._call("set_state", _STATES[state]))

    def reconnect(self, timeout=0.0):
        """Attaches to a new surface under the same name, which must have the same layout. All arrays end."""
        layout = self.description.layout_hash
        self.close()
        pointer = ctypes.c_void_p()
        _check(_in_attach_slices(_lib.ssp_controller_attach, self._name, timeout, pointer))
        self._adopt(pointer.value)
        if self.description.layout_hash != layout:
            self.close()
            raise Error(Result.LAYOUT_CHANGED, f"surface {self._name} came back with another size or other channels")

    def close(self):
        """Tells the surface that this controller leaves. Arrays stay readable."""
        if self._p is not None:
            _lib.ssp_controller_leave(self._p)
            self._p = None


def _in_attach_slices(attach, name, timeout, pointer):
    end = _time.monotonic() + (timeout if timeout is not None else float("inf"))
    while True:
        left = min(0.1, max(0.0, end - _time.monotonic()))
        result = attach(name.encode(), int(left * 1e9), None, ctypes.byref(pointer))
        if result != Result.NOT_FOUND or _time.monotonic() >= end:
            return result


class Surface(_Endpoint):
    """Owns the segment: publishes sensors, takes in actuators. sensors are writable until publish(), actuators
    are read-only: checked copies, within their channels' ranges."""
    _role = "surface"

    def __init__(self, name, rows, columns, period, sensors=(), actuators=(), mode="time-step", pitch=1.0,
                 positions=None, slots=4, safe_when_alone=False):
        channels = [dataclasses.replace(c, direction="sensor") for c in sensors]
        channels += [dataclasses.replace(c, direction="actuator") for c in actuators]
        specs = (_c.ChannelSpec * max(1, len(channels)))()
        codes = {dtype: code for code, dtype in DTYPES.items()}
        for spec, c in zip(specs, channels):
            dtype = np.dtype(c.dtype)
            if dtype not in codes:
                raise ValueError(f"channel {c.name}: dtype {dtype}: must be float32, uint32 or uint8")
            spec.name, spec.unit = c.name.encode(), c.unit.encode()
            spec.direction, spec.dtype, spec.components = _DIRECTIONS[c.direction], codes[dtype], c.components
            spec.minimum, spec.maximum, spec.safe = c.minimum, c.maximum, c.safe
        config = _c.SurfaceConfig(name=name.encode(), rows=rows, columns=columns, pitch=pitch,
                                  period_ns=round(period * 1e9), mode=_MODES[mode], slots=slots, channels=specs,
                                  channel_count=len(channels), safe_when_alone=bool(safe_when_alone))
        if positions is not None:
            positions = np.ascontiguousarray(positions, dtype=np.float32)
            if positions.shape != (rows, columns, 3):
                raise ValueError(f"positions have shape {positions.shape}: must be {(rows, columns, 3)}")
            config.positions = positions.ctypes.data_as(ctypes.POINTER(ctypes.c_float))
        pointer = ctypes.c_void_p()
        _check(_lib.ssp_surface_create(ctypes.byref(config), ctypes.byref(pointer)))
        self._open(pointer.value, _lib.ssp_surface_destroy)
        self._tick = 0
        self.result = Result.OK
        self.sensors = self._arrays("sensor", _lib.ssp_surface_sensor, True)
        self.actuators = self._arrays("actuator", _lib.ssp_surface_actuator, False)

    def publish(self, tick, time, status=0):
        """Publishes the sensor arrays. Raises Error (OUT_OF_TURN) while the controller owes an answer."""
        result = Result(self._call("publish", tick, time, status))
        if result != Result.OK:
            raise Error(result, "time-step: the frame before has not been answered")
        self._tick = tick
        self.sensors.freeze()

    def wait(self, timeout=None):
        """Time-step: waits for the answer to the frame published last. True: it is here. False: there is no
        controller, or it left or died (result tells which). Raises TimeoutError."""
        return self._taken(_in_slices(timeout, lambda ns: self._call("await", self._tick, ns, None)))

    def latest(self):
        """Passive: takes the newest actuator frame in without waiting. True: it is new."""
        return self._taken(Result(self._call("latest")))

    def wait_for_controller(self, timeout=None):
        """True once a controller is attached; False after `timeout` seconds."""
        return _in_slices(timeout, lambda ns: self._call("await_controller", ns, None)) == Result.OK

    def _taken(self, result):
        self.result = result
        if result == Result.TIMEOUT:
            raise TimeoutError("the controller did not answer")
        if result == Result.OUT_OF_TURN:
            raise Error(result, "time-step: publish() first")
        return result == Result.OK

    frame = property(_Endpoint._frame, doc="The actuator Frame that stands; frame 0: nobody sent one yet.")
    controller_pid = property(lambda self: self._call("controller_pid"))
    controller_state = property(lambda self: self._state("controller"))

    def set_state(self, state):
        _check(self._call("set_state", _STATES[state]))

    def miss_deadline(self):
        _check(self._call("miss_deadline"))

    def close(self):
        """Ends the session and removes the segment. Arrays stay readable."""
        if self._p is not None:
            self.sensors.freeze()
            _lib.ssp_surface_close(self._p)
            self._p = None


class Observer(_Endpoint):
    """Looks at a running pair through a read-only mapping. sensors and actuators hold the frame copied last; a
    look that copies a new one ends the arrays handed out before it."""
    _role = "observer"

    def __init__(self, name, timeout=0.0):
        pointer = ctypes.c_void_p()
        _check(_in_attach_slices(_lib.ssp_observer_open, name, timeout, pointer))
        self._name = name
        self._open(pointer.value, _lib.ssp_observer_close)
        self.sensors = self._arrays("sensor", _lib.ssp_observer_array, False)
        self.actuators = self._arrays("actuator", _lib.ssp_observer_array, False)

    def look(self, direction="sensor"):
        """Copies the newest whole frame. True: it is new. False: none newer, or it was overwritten while it was
        copied. Raises SurfaceDied; False as well when the surface has closed (surface_state tells)."""
        return self._seen(Result(self._call("look", _DIRECTIONS[direction])))

    def wait(self, direction="sensor", timeout=None):
        """Looks until there is a new frame. True: there is. False: the surface has closed."""
        number = _DIRECTIONS[direction]
        return self._seen(_in_slices(timeout, lambda ns: self._call("await", number, ns, None)))

    def _seen(self, result):
        if result == Result.TIMEOUT:
            raise TimeoutError("no frame came")
        if result == Result.SURFACE_DEAD:
            raise SurfaceDied(result, f"the surface {self._name} died", self.description.surface_pid)
        return result == Result.OK

    def frame(self, direction="sensor"):
        return self._frame(_DIRECTIONS[direction])

    surface_state = property(lambda self: self._state("surface"))
    controller_state = property(lambda self: self._state("controller"))
    controller_pid = property(lambda self: self._call("controller_pid"))

    def close(self):
        """Arrays stay readable; the mapping goes with the last of them."""
        self._p = None
        self._handle = None


_OWNERSHIP = ("living", "orphan", "foreign")


@dataclasses.dataclass(frozen=True)
class Segment:
    name: str
    bytes: int
    ownership: str  # "living", "orphan", "foreign"
    version: tuple
    surface_pid: int
    controller_pid: int


def _segments(call):
    capacity, count = 1024, ctypes.c_size_t()
    found = (_c.SegmentInfo * capacity)()
    _check(call(found, capacity, ctypes.byref(count)))
    return [Segment(_text(s.name), s.bytes, _OWNERSHIP[s.ownership], (s.version_major, s.version_minor), s.surface_pid,
                    s.controller_pid) for s in found[:min(capacity, count.value)]]


def list_surfaces():
    """All segments in /dev/shm, by name."""
    return _segments(_lib.ssp_list)


def clean(prefix=""):
    """Removes the segments that dead surfaces left, and says which."""
    return _segments(lambda *to: _lib.ssp_clean(prefix.encode(), *to))
