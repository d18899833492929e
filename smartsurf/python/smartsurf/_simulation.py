"""One experiment in this process."""
from __future__ import annotations

import html as html_module
import os
import shlex
import sys
from collections.abc import Iterable, Mapping, Sequence
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from . import _core, _parameters
from ._files import PathName, path_text
from ._parameters import Numbers, Range
from ._picture import CameraLike, core_camera, html, png
from ._surface import Actions, Channel, Surface, checked_seed, draw_seed, whole

Options = Mapping[str, object]


def thread_count(threads: Any) -> int:
    if isinstance(threads, (int, np.integer)) and threads > 1024:
        raise ValueError(f"threads = {threads!r}: must be at most 1024")
    return whole("threads", threads, 1)


def engine_name(engine: Any) -> str:
    if engine is not None and not isinstance(engine, str):
        raise ValueError(f"engine = {engine!r}: must be 'native' or 'bullet'")
    return engine or ""


def state_bytes(state: Any) -> bytes:
    if not isinstance(state, (bytes, bytearray, memoryview)):
        raise ValueError(f"restore: a {type(state).__name__} is not a saved state: give the bytes of save()")
    return bytes(state)


def overrides(options: Options | None) -> list[tuple[str, str]]:
    """The value of `set`, a dict, as the list of strings that the core takes."""
    if options is not None and not isinstance(options, Mapping):
        raise ValueError(f"set = {options!r}: must be a dict of options and their values")

    def text(value: object) -> str:
        if isinstance(value, (tuple, list)):  # of a nuisance: (low, high) or (low, high, mode)
            return ":".join(map(text, value))
        return str(value).lower() if isinstance(value, (bool, np.bool_)) else str(value)
    return [(str(name), text(value)) for name, value in (options or {}).items()]


def load_extension(path: PathName) -> None:
    """Loads an extension, a shared object with actuators and sensors, for the rest of this process."""
    _core.load_extension(path_text(path))


def load_extensions(paths: Iterable[PathName]) -> None:
    if isinstance(paths, (str, bytes, os.PathLike)):
        raise ValueError(f"extensions = {paths!r}: must be a list of paths")
    for path in paths:
        load_extension(path)


def channels(description: Mapping[str, Any]) -> tuple[tuple[Channel, ...], tuple[Channel, ...]]:
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
    source: the script's text, if it is not that of the file; files that it names are looked for beside `experiment`.

    Arrays have rows × columns, row 0 north, column 0 west, or components × rows × columns. They are float32 views of
    memory that the simulation overwrites in each step: copy what must last. Equal experiment, seed, options and
    actions give equal bits, for any number of threads. A simulation is used by one thread at a time.

    Errors of the experiment raise smartsurf.Error, a ValueError with one line that names file and line.
    """

    def __init__(self, experiment: PathName, seed: int | None = None, set: Options | None = None,
                 threads: int = 1, engine: str | None = None, extensions: Sequence[PathName] = (),
                 source: str | None = None):
        threads = thread_count(threads)
        load_extensions(extensions)
        self._core = _core.Simulation(path_text(experiment), engine_name(engine), overrides(set),
                                      None if seed is None else checked_seed(seed), threads, source)
        self._process, self._threads = os.getpid(), threads
        self._arguments: dict[str, Any] = dict(experiment=os.fspath(experiment), set=dict(set or {}), threads=threads,
                                               engine=engine, extensions=[os.fspath(path) for path in extensions],
                                               source=source)
        self.experiment = os.fspath(experiment)
        self._description = self._core.describe()
        self.pitch: float = self._description["pitch"]    # distance of neighbouring cells, u
        self.period: float = self._description["period"]  # of a tick, s
        super().__init__(*channels(self._description), self._core.observation, self._core.targets)

    # ---- the state after the latest tick

    @property
    def objects(self) -> dict[str, NDArray[Any]]:
        """The live objects as arrays by name, ascending by id: `id` (objects), `position` (objects × 3, u),
        `orientation` (objects × 4, unit quaternions x y z w), `velocity` (objects × 3, u/s) and `angular_velocity`
        (objects × 3, rad/s). Read-only; teleport() moves objects. An array follows the simulation until objects appear or
        vanish: then fetch it again."""
        objects = {name: values.view() for name, values in self._core.objects.items()}
        for values in objects.values():
            values.flags.writeable = False
        return objects

    def label(self, id: int) -> str:
        """The label of an object, also of one that is gone."""
        count = self._core.object_count
        if not isinstance(id, (int, np.integer)) or not 0 <= id < count:
            raise ValueError(f"object {id!r}: must be 0 to {count - 1}, of the {count} objects so far" if count else
                             f"object {id!r}: there is no object so far")
        return self._core.label(int(id))

    @property
    def metrics(self) -> dict[str, float]:
        """The values that the script has reported by metric(), by name. finish() adds those of on_finish."""
        return self._core.metrics

    @property
    def info(self) -> dict[str, float | Numbers]:
        """The values of the script's info{}, by name: a float, or the 13 numbers of an object's state (position,
        orientation x y z w, velocity, angular velocity)."""
        fields = self._description["info"]
        values = np.array(self._core.info(sum(size for _, size in fields)))
        out: dict[str, float | Numbers] = {}
        for name, size in fields:
            out[name], values = (float(values[0]) if size == 1 else values[:size]), values[size:]
        return out

    @property
    def state_hash(self) -> int:
        """A 64-bit hash of all poses, velocities, pin heights and pin speeds; as in recordings."""
        return self._core.state_hash

    @property
    def tick(self) -> int:
        """The number of ticks since the start of the episode."""
        return self._core.tick

    @property
    def time(self) -> float:
        """The simulated time since then, s."""
        return self._core.time

    @property
    def seed(self) -> int:
        """The seed of the episode."""
        return self._core.seed

    @property
    def success(self) -> bool:
        """Whether the episode has reached its goal: success() has said so at a tick or, at the end, stop() or the metric
        `success`; after finish(), also one of on_finish."""
        return bool(self._core.success)

    @property
    def engine(self) -> str:
        """The physics engine, "native" or "bullet"."""
        return str(self._description["engine"])

    @property
    def options(self) -> dict[str, str]:
        """The script's options, as text."""
        return dict(self._description["options"])

    # ---- running

    def step(self, actions: Actions | None = None) -> tuple[float, bool, bool]:
        """Advances by one tick and returns (reward, terminated, truncated) of the script's reward(), success() and
        episode{}.

        actions: a dict of actuator channels, or the array alone where there is one channel; each rows × columns, or
        one number for all cells. Channels that are not named keep their targets. Values are clamped to the channel's
        range; NaN becomes its safe value. What the script commands takes their place.
        """
        self._check_process()
        if actions is not None:
            self._take(actions)
        reward, terminated, truncated = self._core.step()
        return reward, terminated, truncated

    def reset(self, seed: int | None = None) -> int:
        """Starts the next episode and returns its seed; without one, a seed is drawn at random.

        The state is that of a new simulation with this seed; arrays stay valid.
        """
        self._check_process()
        self._core.reset(checked_seed(seed) if seed is not None else draw_seed())
        return self.seed

    def save(self) -> bytes:
        """The whole state as bytes: bodies, contacts, actuators, sensors, the targets of the next step, and the script's
        variables and random numbers.
        Raises Error for what cannot be saved: see docs/python.md."""
        return self._core.save()

    def restore(self, state: bytes) -> None:
        """Continues from a saved state, with the same bits: in this simulation or in another one of the same
        experiment and options. Restore only what you trust. Raises Error, and changes nothing, for bytes that are
        damaged or of another experiment."""
        self._check_process()
        self._core.restore(state_bytes(state))

    def finish(self) -> dict[str, float]:
        """Ends the episode: runs the script's on_finish, once, and returns the metrics."""
        self._core.finish()
        return self.metrics

    def record(self, path: PathName) -> None:
        """Records this episode, from its start to stop_recording() or the next reset() or restore(), in a file that
        `smartsurf replay` and all other tools read: HDF5 (.h5) or CSV (.csv). Call it before the first step. The file is
        complete after its end. `smartsurf replay --verify` repeats the episode unless parameters, teleport() or push() have
        changed it."""
        self._core.record(path_text(path), shlex.join(sys.argv), overrides(self._arguments["set"]))

    def stop_recording(self) -> None:
        """Completes the file of record()."""
        self._core.stop_recording()

    def render(self, width: int = 640, height: int = 400, camera: CameraLike = "iso",
               fast: bool = False) -> NDArray[np.uint8]:
        """A picture of the current state: height × width × 3, uint8, row 0 at the top. camera: "iso", "top" or "side",
        (position, target), or a Camera, which may follow an object. fast: without smooth edges and
        soft shadows. Raises smartsurf.Error in a build without the view, RuntimeError where OpenGL is missing."""
        return self._core.render(whole("width", width, 1), whole("height", height, 1), self._camera(camera), fast)

    def render_depth(self, width: int = 640, height: int = 400, camera: CameraLike = "iso") -> NDArray[np.float32]:
        """The depth of each pixel of render() along the camera's axis, u; infinite where nothing is. Needs no OpenGL."""
        return self._core.render_range(whole("width", width, 1), whole("height", height, 1), self._camera(camera))[0]

    def render_segmentation(self, width: int = 640, height: int = 400, camera: CameraLike = "iso") -> NDArray[np.int32]:
        """What each pixel of render() shows: the id of an object, −1 for nothing, −2 − k for cell k = row · columns + column.
        Needs no OpenGL."""
        return self._core.render_range(whole("width", width, 1), whole("height", height, 1), self._camera(camera))[1]

    def _camera(self, camera: CameraLike) -> tuple[str, int]:
        return core_camera(camera, self._description["objects"])

    def _repr_html_(self) -> str:
        """For notebooks: a picture, where OpenGL is, and what the simulation is."""
        caption = (f"{html_module.escape(os.path.basename(self.experiment))}: tick {self.tick}, {self.time:.2f} s, seed "
                   f"{self.seed}, {self.rows} × {self.columns} cells, {len(self.objects['id'])} objects")
        try:
            return f"{html(png([self.render(480, 300)]), 480)}<br/>{caption}"
        except (_core.Error, RuntimeError):
            return caption

    # ---- what differs between episodes

    @property
    def parameters(self) -> tuple[str, ...]:
        """The names of the parameters that set_parameter() and randomise() take; docs/python.md explains them. An object is
        also named by its id, "object.#3.mass"."""
        return tuple(self._core.parameter_names())

    def get_parameter(self, name: str) -> Numbers:
        """The value of a parameter in the next episode, NaN where there is none. One that is randomised: that of this
        episode."""
        shape, values, _, _ = self._core.parameter(name)
        return np.array(values).reshape(shape)

    def set_parameter(self, name: str, values: ArrayLike) -> None:
        """Sets a parameter from the next reset() on, as if the script declared the value. Raises Error for a value that the
        script could not declare."""
        shape, _, _, per_cell = self._core.parameter(name)
        self._core.set_parameter(name, _parameters.numbers(name, values, tuple(shape), per_cell))

    def randomise(self, ranges: Mapping[str, Range | None]) -> None:
        """Draws parameters at each reset() from the range (low, high), uniformly, each number by itself, from a stream of
        the episode's seed and the name. None ends it. Call it again to change the ranges."""
        for name, given in _parameters.checked_ranges(ranges).items():
            shape, _, is_whole, per_cell = self._core.parameter(name)
            if per_cell:
                raise ValueError(f"randomise: {name}: is a value for each cell; randomise faults.actuator or faults.sensor")
            if given is None:
                self._core.randomise(name, np.zeros(0), np.zeros(0))
                continue
            low, high = _parameters.limits(name, given, tuple(shape), is_whole)
            self._core.randomise(name, low, high)

    def teleport(self, object: str | int | Sequence[int] | None = None, *, position: ArrayLike | None = None,
                 orientation: ArrayLike | None = None, velocity: ArrayLike | None = None,
                 angular_velocity: ArrayLike | None = None) -> None:
        """Moves objects now: all declared ones, those with a label, or by id. Arrays of (3,) or (4,), quaternions x y z w, or
        objects × that. Sensors follow with the next step()."""
        ids, several = _parameters.object_ids(self._description["objects"], object)
        for name, values in _parameters.poses((), len(ids), several, position=position, orientation=orientation,
                                              velocity=velocity, angular_velocity=angular_velocity):
            self._core.place(name, ids, values)

    def push(self, object: str | int | Sequence[int] | None = None, *, force: ArrayLike | None = None,
             torque: ArrayLike | None = None) -> None:
        """Applies a force (mass·u/s²) at the object's origin and a torque (mass·u²/s²), world axes, until the next push() of
        the object or the end of the episode. Without values: none any more."""
        ids, several = _parameters.object_ids(self._description["objects"], object)
        self._core.set_wrenches(ids, _parameters.pushes(force, torque, (), len(ids), several))

    def __reduce__(self) -> tuple[Any, ...]:
        state = self.save() if self._core.has_running_episode else None
        return _unpickled, (self._arguments, self._core.parameter_settings(), state)

    def _check_process(self) -> None:
        if self._threads > 1 and self._process != os.getpid():
            raise RuntimeError("this simulation's threads belong to the process that created it: create it after the "
                               "fork, or with threads=1")


def _unpickled(arguments: dict[str, Any], settings: Any, state: bytes | None) -> Simulation:
    simulation = Simulation(**arguments)
    simulation._core.set_parameter_settings(settings)
    if state is None:  # as the original, good for reset() and restore()
        simulation._core.fail()
    else:
        simulation.restore(state)
    return simulation
