"""The common base of the three roles."""
import ctypes
import time as _time

import numpy as np

from . import _library as _c
from ._arrays import DTYPES, Arrays, Handle, array_at
from ._values import DIRECTIONS, MODES, Channel, Counters, Description, Error, Frame, NotFound, Result, c_text

_lib = _c.lib
_SLICE_NS = 100_000_000  # waits return to Python this often, so that Ctrl-C works


def check(result):
    if result >= 0:
        return Result(result)
    message = _lib.ssp_last_error().decode(errors="replace")
    kind = NotFound if result == Result.NOT_FOUND else Error
    raise kind(result, message, _lib.ssp_last_error_pid())


def text(raw):
    return raw.decode(errors="replace")


def in_slices(timeout, call, pending=Result.TIMEOUT):
    """Repeats call(nanoseconds) until its result is not `pending` or `timeout` seconds (None: forever) have passed."""
    end = None if timeout is None else _time.monotonic() + timeout
    while True:
        left = _SLICE_NS if end is None else max(0, int((end - _time.monotonic()) * 1e9))
        result = call(min(left, _SLICE_NS))
        if result != pending or (end is not None and _time.monotonic() >= end):
            return Result(result)


class Endpoint:
    """The common base of the three roles."""
    _role = ""

    def _attach(self, name, timeout):
        pointer = ctypes.c_void_p()
        attach = getattr(_lib, f"ssp_{self._role}_attach")
        raw = c_text("name", name)
        check(in_slices(timeout, lambda ns: attach(raw, ns, None, ctypes.byref(pointer)), Result.NOT_FOUND))
        self._name = name
        self._open(pointer.value)

    def _open(self, pointer):
        self._handle = Handle(pointer, getattr(_lib, f"ssp_{self._role}_destroy"))
        self._p = pointer
        raw = _c.Description()
        check(self._call("describe", ctypes.byref(raw)))
        channels = tuple(self._channel(i) for i in range(raw.channel_count))
        positions = None
        if raw.positions:
            positions = np.ctypeslib.as_array(raw.positions, (raw.rows, raw.columns, 3)).copy()
        self.description = Description(
            text(raw.name), (raw.version_major, raw.version_minor), raw.session, raw.layout_hash, raw.rows, raw.columns,
            raw.pitch, raw.period_ns * 1e-9, {v: k for k, v in MODES.items()}[raw.mode], raw.surface_pid, channels,
            positions)

    def _channel(self, number):
        raw = _c.ChannelInfo()
        check(self._call("channel", number, ctypes.byref(raw)))
        direction = {v: k for k, v in DIRECTIONS.items()}[raw.direction]
        return Channel(text(raw.name), raw.minimum, raw.maximum, raw.safe, DTYPES[raw.dtype], raw.components,
                       text(raw.unit), direction, number)

    def _arrays(self, direction, address_of, writable):
        channels = [c for c in self.description.channels if c.direction == direction]
        return Arrays(self._handle, channels, self.description.rows, self.description.columns, address_of, writable)

    def _call(self, name, *arguments):
        if self._p is None:
            raise Error(Result.ARGUMENT, f"this {self._role} is closed")
        return getattr(_lib, f"ssp_{self._role}_{name}")(self._p, *arguments)

    def _frame(self, *arguments):
        raw = _c.FrameInfo()
        check(self._call("frame", *arguments, ctypes.byref(raw)))
        return Frame(raw.frame, raw.tick, raw.time_s, raw.answers, raw.status)

    @property
    def counters(self):
        """{"surface": Counters, "controller": Counters}."""
        both = _c.Counters(), _c.Counters()
        check(self._call("counters", *(ctypes.byref(b) for b in both)))
        return {who: Counters(b.skipped, b.repeated, b.clamped, b.deadline_misses)
                for who, b in zip(("surface", "controller"), both)}

    def _state(self, who):
        return text(_lib.ssp_state_text(self._call(f"{who}_state")))

    def __enter__(self):
        return self

    def __exit__(self, *_):
        self.close()


class WritingEndpoint(Endpoint):
    """The common base of the surface and the controller."""
    _writes = ""  # the direction of the channels that this role publishes

    def write(self, name, values, first=0):
        """Copies values to the next frame's array from cell `first` on, counted through all components. The peer can
        read along if writes ascend. The values are final for this frame."""
        channel = self._named(name, self._writes)
        values = np.ascontiguousarray(values, dtype=channel.dtype)
        check(self._call("write", channel.number, first * channel.dtype.itemsize, values.ctypes.data, values.nbytes))

    def next_cells(self, name, timeout=None):
        """Time-step: the next cells of that channel in the frame being written, flat and read-only, as far as the peer
        has written them. None: the channel is complete, or no more cells came in time. Then call wait(): True confirms
        that all cells belong to one complete frame."""
        channel = self._named(name, "actuator" if self._writes == "sensor" else "sensor")
        nbytes, address = ctypes.c_size_t(), None

        def call(ns):
            nonlocal address
            begun = _time.monotonic_ns()
            address = self._call("next", channel.number, ns, None, ctypes.byref(nbytes))
            # The call returned null before its timeout: no more cells will come.
            return Result.OK if address or _time.monotonic_ns() - begun < ns else Result.TIMEOUT

        in_slices(timeout, call)
        return array_at(self._handle, address, nbytes.value, channel.dtype, (-1,), False) if address else None

    def _named(self, name, direction):
        for channel in self.description.channels:
            if channel.name == name and channel.direction == direction:
                return channel
        raise KeyError(f"there is no {direction} channel {name!r}")
