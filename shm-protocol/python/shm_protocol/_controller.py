"""The controller's role."""
from . import _library as _c
from ._endpoint import WritingEndpoint, check, in_slices, text
from ._values import STATES, Error, Result, SurfaceDied

_lib = _c.lib


class Controller(WritingEndpoint):
    """Reads sensors, publishes actuators.

    sensors, actuators: mappings from a channel's name to its array, which views the shared memory. A sensor array is
    read-only and holds the frame taken last until that frame is answered. An actuator array must be written
    completely, and is writable until publish(); after that it belongs to the surface and is read-only. Fetch the arrays
    again for each frame.
    """
    _role = "controller"
    _writes = "actuator"

    def __init__(self, name, timeout=0.0):
        self._attach(name, timeout)

    def _open(self, pointer):
        super()._open(pointer)
        self.sensors = self._arrays("sensor", _lib.ssp_controller_sensor, False)
        self.actuators = self._arrays("actuator", _lib.ssp_controller_actuator, True)

    def wait(self, timeout=None):
        """Waits for an unread sensor frame. Returns True if there is one, False if the surface is closing.
        Raises TimeoutError after `timeout` seconds (None: never) and SurfaceDied."""
        result = in_slices(timeout, lambda ns: self._call("await", ns, None))
        return self._taken(result, "no frame came")

    def latest(self):
        """Takes the newest frame without waiting. Returns True if it is new, False if there is no newer one or the
        surface is closing (see surface_state)."""
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
        raise Error(result, text(_lib.ssp_text(result)))

    def publish(self):
        """Publishes the actuator arrays as the answer to the frame taken last. Returns False if the surface has
        abandoned that frame."""
        result = Result(self._call("publish"))
        if result == Result.OUT_OF_TURN:
            raise Error(result, "there is no frame to answer: wait() first")
        self.actuators.freeze()
        return result == Result.OK

    frame = property(WritingEndpoint._frame, doc="The Frame taken last.")
    tick = property(lambda self: self.frame.tick)
    time = property(lambda self: self.frame.time, doc="Simulated seconds of the frame taken last.")
    surface_state = property(lambda self: self._state("surface"))
    surface_status = property(lambda self: Result(self._call("surface_status")),
                              doc="Checks the surface now: Result.OK, SURFACE_CLOSED or SURFACE_DEAD.")

    def set_state(self, state):
        check(self._call("set_state", STATES[state]))

    def reconnect(self, timeout=0.0):
        """Attaches to a new surface under the same name, which must have the same layout. Invalidates all arrays."""
        before = self.description, self.sensors, self.actuators
        self.close()
        self._attach(self._name, timeout)
        if self.description.layout_hash != before[0].layout_hash:
            self.close()
            self.description, self.sensors, self.actuators = before  # the layout that the next attempt asks for
            raise Error(Result.LAYOUT_CHANGED, f"surface {self._name} came back with another size or other channels")

    def close(self):
        """Releases the claim; the surface sees an orderly departure. Arrays stay readable."""
        if self._p is not None:
            self.actuators.close()
            _lib.ssp_controller_close(self._p)
            self._p = None
