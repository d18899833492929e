"""The surface's role."""
import ctypes
import dataclasses

import numpy as np

from . import _library as _c
from ._arrays import DTYPES
from ._endpoint import WritingEndpoint, check, in_slices
from ._values import DIRECTIONS, MODES, STATES, Error, Result, c_text

_lib = _c.lib


def _require(holds, field, value, requirement):
    """ctypes takes whole numbers modulo the width of the field: the library would see another number."""
    if not holds:
        raise Error(Result.BAD_CONFIG, f"{field} = {value}: must be {requirement}")


class Surface(WritingEndpoint):
    """Owns the segment: publishes sensors, receives actuators. sensors are writable until publish(); actuators are
    read-only, checked copies within their channels' ranges."""
    _role = "surface"
    _writes = "sensor"

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
            _require(0 <= c.components <= 64, f"channel {c.name!r}: components", c.components, "1 to 64")
            spec.name, spec.unit = c_text("channel", c.name), c_text(f"channel {c.name!r}: unit", c.unit)
            spec.direction, spec.dtype, spec.components = DIRECTIONS[c.direction], codes[dtype], c.components
            spec.minimum, spec.maximum, spec.safe = c.minimum, c.maximum, c.safe
        _require(1 <= rows <= 65536, "rows", rows, "1 to 65536")
        _require(1 <= columns <= 65536, "columns", columns, "1 to 65536")
        _require(0 <= slots <= 64, "slots", slots, "4, 8, 16, 32 or 64")
        _require(0 < period * 1e9 < 2**64, "period", period, "greater than 0 and below 2^64 ns, in seconds")
        config = _c.SurfaceConfig(name=c_text("name", name), rows=rows, columns=columns, pitch=pitch,
                                  period_ns=round(period * 1e9), mode=MODES[mode], slots=slots, channels=specs,
                                  channel_count=len(channels), safe_when_alone=bool(safe_when_alone))
        if positions is not None:
            positions = np.ascontiguousarray(positions, dtype=np.float32)
            if positions.shape != (rows, columns, 3):
                raise ValueError(f"positions have shape {positions.shape}: must be {(rows, columns, 3)}")
            config.positions = positions.ctypes.data_as(ctypes.POINTER(ctypes.c_float))
        pointer = ctypes.c_void_p()
        check(_lib.ssp_surface_create(ctypes.byref(config), ctypes.byref(pointer)))
        self._open(pointer.value)
        self._tick = 0
        self.result = Result.OK
        self.sensors = self._arrays("sensor", _lib.ssp_surface_sensor, True)
        self.actuators = self._arrays("actuator", _lib.ssp_surface_actuator, False)

    def publish(self, tick, time, status=0):
        """Publishes the sensor arrays. Raises Error (OUT_OF_TURN) while the controller's answer is outstanding."""
        if not (0 <= tick < 2**64 and 0 <= status < 2**32):
            raise Error(Result.ARGUMENT, f"tick {tick}, status {status}: must be of 64 and of 32 bits")
        result = Result(self._call("publish", tick, time, status))
        if result != Result.OK:
            raise Error(result, "time-step: the frame before has not been answered")
        self._tick = tick
        self.sensors.freeze()

    def wait(self, timeout=None):
        """Time-step: waits for the answer to the frame published last. Returns True if it has arrived, False if there
        is no controller, or it left or died (see result). Raises TimeoutError."""
        return self._taken(in_slices(timeout, lambda ns: self._call("await", self._tick, ns, None)))

    def latest(self):
        """Passive: takes the newest actuator frame without waiting. Returns True if it is new."""
        return self._taken(Result(self._call("latest")))

    def wait_for_controller(self, timeout=None):
        """True once a controller is attached; False after `timeout` seconds."""
        return in_slices(timeout, lambda ns: self._call("await_controller", ns, None)) == Result.OK

    def _taken(self, result):
        self.result = result
        if result == Result.TIMEOUT:
            raise TimeoutError("the controller did not answer")
        if result == Result.OUT_OF_TURN:
            raise Error(result, "time-step: publish() first")
        return result == Result.OK

    frame = property(WritingEndpoint._frame, doc="The actuator Frame in effect; frame 0: none was taken yet.")
    controller_pid = property(lambda self: self._call("controller_pid"))
    controller_state = property(lambda self: self._state("controller"))

    def set_state(self, state):
        check(self._call("set_state", STATES[state]))

    def miss_deadline(self):
        check(self._call("miss_deadline"))

    def close(self):
        """Ends the session and removes the segment. Arrays stay readable."""
        if self._p is not None:
            self.sensors.close()
            _lib.ssp_surface_close(self._p)
            self._p = None
