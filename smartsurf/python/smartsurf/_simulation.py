"""One experiment in this process."""
from __future__ import annotations

import os
from collections.abc import Mapping, Sequence

import numpy as np

from . import _core
from ._surface import Channel, Surface, checked_seed, draw_seed, whole


def thread_count(threads):
    if isinstance(threads, (int, np.integer)) and threads > 1024:
        raise ValueError(f"threads = {threads!r}: must be at most 1024")
    return whole("threads", threads, 1)


def engine_name(engine):
    if engine is not None and not isinstance(engine, str):
        raise ValueError(f"engine = {engine!r}: must be 'native' or 'bullet'")
    return engine or ""


def state_bytes(state):
    if not isinstance(state, (bytes, bytearray, memoryview)):
        raise ValueError(f"restore: a {type(state).__name__} is not a saved state: give the bytes of save()")
    return bytes(state)


def not_picklable(self, protocol=None):
    raise TypeError(f"a {type(self).__name__} cannot be pickled: send what save() returns, and restore it in one that the "
                    "other process makes")


def overrides(options):
    """The value of `set`, a dict, as the list of strings that the core takes."""
    if options is not None and not isinstance(options, Mapping):
        raise ValueError(f"set = {options!r}: must be a dict of options and their values")

    def text(value):
        return str(value).lower() if isinstance(value, (bool, np.bool_)) else str(value)
    return [(str(name), text(value)) for name, value in (options or {}).items()]


def load_extension(path: str | os.PathLike) -> None:
    """Loads an extension, a shared object with actuators and sensors, for the rest of this process."""
    _core.load_extension(os.fspath(path))


def load_extensions(paths):
    if isinstance(paths, (str, bytes, os.PathLike)):
        raise ValueError(f"extensions = {paths!r}: must be a list of paths")
    for path in paths:
        load_extension(path)


def channels(description):
    """The sensor and the actuator channels of an experiment."""
    sensors = tuple(Channel(name, unit, low, high, components)
                    for name, components, low, high, unit in description["sensors"])
    actuators = tuple(Channel(name, unit, low, high, 1, safe)
                      for name, low, high, safe, unit in description["actuators"])
    return sensors, actuators


class Simulation(Surface):
    """One experiment, advanced tick by tick. A tick is one control period of the surface.

    experiment: path of the Lua script. seed: of its random numbers; default: the script's. set: values of its
    options, a dict. threads: of the physics. engine: "native" or "bullet". extensions: paths of shared objects to load.

    Arrays have rows × columns, row 0 north, column 0 west, or components × rows × columns. They are float32 views of
    memory that the simulation overwrites in each step: copy what must last. Equal experiment, seed, options and
    actions give equal bits, for any number of threads. A simulation is used by one thread at a time.

    Errors of the experiment raise smartsurf.Error, a ValueError with one line that names file and line.
    """

    def __init__(self, experiment: str | os.PathLike, seed: int | None = None, set: dict | None = None,
                 threads: int = 1, engine: str | None = None, extensions: Sequence[str | os.PathLike] = ()):
        threads = thread_count(threads)
        load_extensions(extensions)
        self._core = _core.Simulation(os.fspath(experiment), engine_name(engine), overrides(set), checked_seed(seed), threads)
        self._process, self._threads = os.getpid(), threads
        self.experiment = os.fspath(experiment)
        self._description = self._core.describe()
        self.pitch = self._description["pitch"]    # distance of neighbouring cells, u
        self.period = self._description["period"]  # of a tick, s
        super().__init__(*channels(self._description), self._core.observation, self._core.targets)

    # ---- the state after the latest tick

    @property
    def objects(self) -> dict[str, np.ndarray]:
        """The live objects as arrays by name, ascending by id: `id` (objects), `position` (objects × 3, u),
        `orientation` (objects × 4, unit quaternions x y z w), `velocity` (objects × 3, u/s) and `angular_velocity`
        (objects × 3, rad/s). An array follows the simulation until objects appear or vanish: then fetch it again."""
        return self._core.objects

    def label(self, id: int) -> str:
        """The label of an object."""
        return self._core.label(id)

    @property
    def metrics(self) -> dict[str, float]:
        """The values that the script has reported by metric(), by name. finish() adds those of on_finish."""
        return self._core.metrics

    @property
    def info(self) -> dict[str, float | np.ndarray]:
        """The values of the script's info{}, by name: a float, or the 13 numbers of an object's state (position,
        orientation x y z w, velocity, angular velocity)."""
        fields = self._description["info"]
        values, out = np.array(self._core.info(sum(size for _, size in fields))), {}
        for name, size in fields:
            out[name], values = (float(values[0]) if size == 1 else values[:size]), values[size:]
        return out

    @property
    def state_hash(self) -> int:
        """A 64-bit hash of all poses, velocities, pin heights and pin speeds; as in recordings."""
        return self._core.state_hash

    tick = property(lambda self: self._core.tick, doc="The number of ticks since the start of the episode.")
    time = property(lambda self: self._core.time, doc="The simulated time since then, s.")
    seed = property(lambda self: self._core.seed, doc="The seed of the episode.")
    engine = property(lambda self: self._description["engine"], doc='The physics engine, "native" or "bullet".')
    options = property(lambda self: dict(self._description["options"]), doc="The script's options, as text.")

    # ---- running

    def step(self, actions: dict | np.ndarray | float | None = None) -> tuple[float, bool, bool]:
        """Advances by one tick and returns (reward, terminated, truncated) of the script's reward(), success() and
        episode{}.

        actions: a dict of actuator channels, or the array alone where there is one channel; each rows × columns, or
        one number for all cells. Channels that are not named keep their targets. Values are clamped to the channel's
        range; NaN becomes its safe value.
        """
        self._check_process()
        if actions is not None:
            self._take(actions)
        for i, channel in enumerate(self.actuator_channels):
            self._core.set_targets(i, self._targets[i])
        reward, terminated, truncated, self._success = self._core.step()
        return reward, terminated, truncated

    def reset(self, seed: int | None = None) -> int:
        """Starts the next episode and returns its seed; without one, a seed is drawn at random.

        The state is that of a new simulation with this seed; arrays stay valid.
        """
        self._check_process()
        self._core.reset(checked_seed(seed) if seed is not None else draw_seed())
        self._targets[...] = self._core.targets
        return self.seed

    def save(self) -> bytes:
        """The whole state as bytes: bodies, contacts, actuators, sensors, and the script's variables and random numbers.
        Raises Error for what cannot be saved: see docs/python.md."""
        return self._core.save()

    def restore(self, state: bytes) -> None:
        """Continues from a saved state, with the same bits: in this simulation or in another one of the same
        experiment and options. Restore only what you trust. Raises Error, and changes nothing, for bytes that are
        damaged or of another experiment."""
        self._check_process()
        self._core.restore(state_bytes(state))
        self._targets[...] = self._core.targets

    def finish(self) -> dict[str, float]:
        """Ends the episode: runs the script's on_finish, once, and returns the metrics."""
        self._core.finish()
        return self.metrics

    def render(self, width: int = 640, height: int = 400, camera: str = "iso") -> np.ndarray:
        """A picture of the current state: height × width × 3, uint8, row 0 at the top. camera: "iso", "top", "side".
        Raises smartsurf.Error in a build without the view, RuntimeError where OpenGL is missing."""
        return self._core.render(whole("width", width, 1), whole("height", height, 1), str(camera))

    __reduce_ex__ = not_picklable

    def _check_process(self):
        if self._threads > 1 and self._process != os.getpid():
            raise RuntimeError("this simulation's threads belong to the process that created it: create it after the "
                               "fork, or with threads=1")
