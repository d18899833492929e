"""The observer's role."""
from . import _library as _c
from ._endpoint import Endpoint, in_slices
from ._values import DIRECTIONS, Result, SurfaceDied

_lib = _c.lib


class Observer(Endpoint):
    """Observes a running pair through a read-only mapping. sensors and actuators hold the frame copied last;
    copying a new one invalidates the arrays handed out before."""
    _role = "observer"

    def __init__(self, name, timeout=0.0):
        self._attach(name, timeout)
        self.sensors = self._arrays("sensor", _lib.ssp_observer_array, False)
        self.actuators = self._arrays("actuator", _lib.ssp_observer_array, False)

    def latest(self, direction="sensor"):
        """Copies the newest complete frame. Returns True if it is new; False if there is none newer, if it was
        overwritten during the copy, or if the surface has closed (see surface_state). Raises SurfaceDied."""
        return self._seen(Result(self._call("latest", DIRECTIONS[direction])))

    def wait(self, direction="sensor", timeout=None):
        """Waits for a new frame. Returns True if there is one, False if the surface has closed."""
        number = DIRECTIONS[direction]
        return self._seen(in_slices(timeout, lambda ns: self._call("await", number, ns, None)))

    def _seen(self, result):
        if result == Result.TIMEOUT:
            raise TimeoutError("no frame came")
        if result == Result.SURFACE_DEAD:
            raise SurfaceDied(result, f"the surface {self._name} died", self.description.surface_pid)
        return result == Result.OK

    def frame(self, direction="sensor"):
        return self._frame(DIRECTIONS[direction])

    surface_state = property(lambda self: self._state("surface"))
    controller_state = property(lambda self: self._state("controller"))
    controller_pid = property(lambda self: self._call("controller_pid"))

    def close(self):
        """Arrays stay readable; the last one releases the mapping."""
        self._p = None
        self._handle = None
