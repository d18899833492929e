"""Many worlds as one Gymnasium vector environment."""
from __future__ import annotations

import os
import re
import shlex
import sys
import warnings
from collections.abc import Callable, Collection, Mapping, Sequence
from typing import Any, TypedDict, Union

import gymnasium
import numpy as np
from gymnasium.vector import AutoresetMode
from gymnasium.vector.utils import batch_space
from numpy.typing import ArrayLike, NDArray

from . import _core, _parameters
from ._env import box, random_streams, set_random_streams
from ._files import PathName, folder_of_episodes, path_text
from ._parameters import Numbers, Range
from ._picture import CameraLike, core_camera
from ._simulation import Options, channels, engine_name, load_extensions, overrides, state_bytes, thread_count
from ._surface import Closed, FloatArray, aligned_zeros, checked_options, checked_seed, draw_seed, finite, real_array, whole
from ._tasks import task_file

Info = dict[str, Any]
Flags = NDArray[np.bool_]
Worlds = Union[ArrayLike, None]  # numbers of worlds, a mask, or None for all
Stepped = tuple[FloatArray, Numbers, Flags, Flags, Info]

_SPACES = ("action_space", "single_action_space", "observation_space", "single_observation_space")
_AUTORESET = {AutoresetMode.NEXT_STEP: 0, AutoresetMode.SAME_STEP: 1, AutoresetMode.DISABLED: 2}


class MostArguments(TypedDict, total=False):
    """The arguments of VectorEnv that a Task's environments pass on."""
    threads: int | None
    engine: str | None
    seed: int | Sequence[int] | None
    copy: bool
    render_size: tuple[int, int]
    camera: CameraLike
    extensions: Sequence[PathName]
    max_episode_steps: int | None
    strict: bool
    controller: PathName | None
    controller_set: Mapping[str, float] | None
    record: PathName | None
    record_worlds: Worlds
    record_every: int


class WorldArguments(MostArguments, total=False):
    set: Options | Sequence[Options] | None
    render_mode: str | None
    autoreset_mode: AutoresetMode | str


class VectorEnv(gymnasium.vector.VectorEnv[Any, Any, Any]):
    """`num_envs` worlds of one experiment in this process, computed by `threads` threads.

    Observations have shape (num_envs, planes, rows, columns), actions (num_envs, channels, rows, columns), both
    float32, in the channels' units; row 0 is north, column 0 west. World i computes the same as an `Env` with its
    seeds. reset(seed=s) gives the worlds the seeds s, s + 1, …; the seed of a later episode follows from that of the
    world's previous one, also where reset() starts it, so that a seed determines all that follows.

    set: options of the script, a dict, or one for each world; a value (low, high) stands for one number of that range for
    each world, uniformly drawn by the option's name and the world's number. threads: default: one per core; never more than
    worlds. copy: whether step() and reset() return copies; without, all arrays that they return,
    those of `info` included, are the same ones each time, which the next call overwrites. autoreset_mode: as
    Gymnasium's; NEXT_STEP by default. max_episode_steps: truncates episodes, besides the script's episode{}. strict: as of
    Env.
    `info` is that of Gymnasium's SyncVectorEnv: arrays over the worlds of `seed`, `success`, `nonfinite_actions` and the
    values of info{}, and for the worlds whose episode has ended `metrics`, a dict of arrays. With SAME_STEP these describe
    the new episode, and `final_obs` and `final_info` the one that has ended, with its `metrics`.
    A world that fails, by an error of the script or a state that is not finite, ends its episode: it is truncated, its
    reward and the values of info{} are NaN, its observation is the last one, and `error` in place of `metrics` says why.
    The other worlds go on, and the next reset brings it back. One that cannot start has its `error` in the info of reset(), with
    SAME_STEP of the step that resets it, and fails in its first step, after zeros from reset(). If all worlds fail, or one with strict=True, step() and reset() raise Error.
    controller: an APRON program that commands the actuators of every world, in this process; step() then takes no
    actions. It restarts with each episode, and each world computes what `smartsurf run --controller` computes with its
    seed. An episode whose program ends is truncated. Such worlds are neither saved nor restored. controller_set: values of
    the program's sliders and switches.
    record: a folder, in which episodes are recorded, world 3's first one as world-0003-episode-000001.h5 (docs/recordings.md).
    A folder with such files is refused. A copy does not record, and a warning says so; nor does a child of fork().
    record_worlds: which worlds, numbers or a mask [all]. record_every: the episodes 1, 1 + record_every, … of each [1].
    """
    metadata = {"render_modes": ["rgb_array"], "render_fps": 60}
    _observes_planes = True  # of the sensors

    def __init__(self, experiment: PathName, num_envs: int = 1, threads: int | None = None,
                 set: Options | Sequence[Options] | None = None, engine: str | None = None,
                 seed: int | Sequence[int] | None = None, copy: bool = True,
                 autoreset_mode: AutoresetMode | str = AutoresetMode.NEXT_STEP, render_mode: str | None = None,
                 render_size: tuple[int, int] = (640, 400), camera: CameraLike = "iso",
                 extensions: Sequence[PathName] = (), max_episode_steps: int | None = None, strict: bool = False,
                 source: str | None = None, controller: PathName | None = None,
                 controller_set: Mapping[str, float] | None = None, record: PathName | None = None,
                 record_worlds: Worlds = None, record_every: int = 1):
        if record is None and (record_worlds is not None or record_every != 1):
            raise ValueError("record_worlds and record_every need record, a folder")
        load_extensions(extensions)
        controllers = _controllers(controller, controller_set)
        num_envs = whole("num_envs", num_envs, 1)
        if max_episode_steps is not None:
            max_episode_steps = whole("max_episode_steps", max_episode_steps, 1)
        threads = len(os.sched_getaffinity(0)) if threads is None else thread_count(threads)
        if render_mode not in (None, *self.metadata["render_modes"]):
            raise ValueError(f"render_mode = {render_mode!r}: must be None or 'rgb_array'")
        autoreset_mode = AutoresetMode(autoreset_mode)
        self.num_envs = num_envs
        seeds = self._seeds(seed, lambda world: draw_seed(self.np_random))
        of_worlds = _options_of_worlds(set, num_envs, lambda options: _whole_options(experiment, options, source))
        self._arguments: dict[str, Any] = dict(
            experiment=os.fspath(experiment), num_envs=num_envs, threads=threads, set=of_worlds, engine=engine, seed=seeds,
            copy=copy, autoreset_mode=autoreset_mode, render_mode=render_mode, render_size=render_size, camera=camera,
            extensions=[os.fspath(path) for path in extensions], max_episode_steps=max_episode_steps, strict=strict,
            source=source, controller=controller, controller_set=controller_set)
        self._records, self._process = record is not None, os.getpid()
        self._recording: tuple[Any, ...] | None = None  # what the first reset() starts
        if record is not None:
            worlds, interval = _parameters.world_numbers(record_worlds, num_envs), whole("record_every", record_every, 1)
            self._recording = (folder_of_episodes(record, "world-[0-9]*-episode-[0-9]*.h5"), shlex.join(sys.argv), worlds, interval,
                               [overrides(options) for options in of_worlds])
        self._batch = _core.Batch(path_text(experiment), engine_name(engine), seeds, threads,
                                  _AUTORESET[autoreset_mode], max_episode_steps,
                                  [overrides(options) for options in of_worlds], source, controllers)
        self._description = d = self._batch.describe()
        self.rows: int = d["rows"]
        self.columns: int = d["columns"]
        self.pitch: float = d["pitch"]
        self.period: float = d["period"]
        self.sensor_channels, self.actuator_channels = channels(d)
        self.single_observation_space = box(self.sensor_channels, self.rows, self.columns)
        self.single_action_space = box(self.actuator_channels, self.rows, self.columns)
        self.observation_space = batch_space(self.single_observation_space, num_envs)
        self.action_space = batch_space(self.single_action_space, num_envs)
        self.metadata = {**self.metadata, "autoreset_mode": autoreset_mode, "render_fps": round(1 / self.period)}
        self.render_mode, self._render_size, self._camera = render_mode, render_size, camera
        self._strict, self._has_controller = strict, controllers is not None
        self._copy, self._same_step = copy, autoreset_mode == AutoresetMode.SAME_STEP
        self._rewards = np.zeros(num_envs)
        self._terminated, self._truncated = np.zeros((2, num_envs), np.bool_)
        self._object_states: FloatArray | None = None
        self._observations, self._state_arrays, self._fields = self._state(num_envs, d["info"])
        self._final, self._final_arrays, self._final_fields = self._state(num_envs if self._same_step else 0, d["info"])
        self._bind()
        every = np.ones(num_envs, np.bool_)
        every.flags.writeable = False
        # A step copies this dict, and the arrays if it is to return copies.
        self._every_info: Info = {key: value for name, values in self._fields.items()
                                  for key, value in ((name, values), ("_" + name, every))}

    def _state(self, worlds: int, info: Any) -> tuple[FloatArray, tuple[Any, ...], Info]:
        """Arrays that the batch writes: the observations, all of them but the objects, and the values of `info` by name."""
        observations = aligned_zeros((worlds, len(self._planes()), self.rows, self.columns))
        values, seeds = np.zeros((worlds, self._batch.info_size)), np.zeros(worlds, np.uint64)
        success, nonfinite = np.zeros(worlds, np.bool_), np.zeros(worlds, np.int64)
        fields: Info = {"seed": seeds.view(np.int64), "success": success, "nonfinite_actions": nonfinite}
        first = 0
        for name, size in info:
            fields[name] = values[:, first] if size == 1 else values[:, first:first + size]
            first += size
        return observations, (observations, values, seeds, success.view(np.uint8), nonfinite), fields

    def _planes(self) -> list[str]:
        return [channel.name for channel in self.sensor_channels for _ in range(channel.components)]

    def _bind(self, objects: FloatArray | None = None, time: Numbers | None = None, targets: FloatArray | None = None) -> None:
        """Tells the batch where to write."""
        none, no_time = np.zeros(0, np.float32), np.zeros(0)
        self._batch.bind((*self._state_arrays, none if objects is None else objects, no_time if time is None else time,
                          none if targets is None else targets),
                         (*self._final_arrays, none, no_time, none),
                         self._rewards, self._terminated.view(np.uint8), self._truncated.view(np.uint8))

    def _seeds(self, seed: Any, other: Callable[[int], int]) -> list[int]:
        """The seed of each world; `other` gives those that are None. Infos hold them in 63 bits."""
        if seed is None:
            seed = [None] * self.num_envs
        if isinstance(seed, (int, np.integer)):
            return [checked_seed(checked_seed(seed, 63) + i, 63) for i in range(self.num_envs)]
        if not isinstance(seed, (list, tuple, np.ndarray)):
            raise ValueError(f"seed = {seed!r}: must be a whole number from 0, or one per world")
        if len(seed) != self.num_envs:
            raise ValueError(f"seed has {len(seed)} values: must have one per world, {self.num_envs}")
        return [other(i) if s is None else checked_seed(s, 63) for i, s in enumerate(seed)]

    def _next_seed(self, world: int) -> int:
        """Follows from the seed of the episode that the world has started last."""
        return _core.next_seed(self._batch.started_seed(world))

    def _reset_mask(self, options: dict[str, Any] | None) -> Flags:
        """The worlds that reset() starts: all, or those that options["reset_mask"] names."""
        given = checked_options(options, "reset_mask")
        if "reset_mask" not in given:
            return np.ones(self.num_envs, np.bool_)
        mask = np.asarray(given["reset_mask"])
        if mask.shape != (self.num_envs,) or mask.dtype != np.bool_ or not mask.any():
            raise ValueError("options['reset_mask'] must be an array of bool, one per world, with one True")
        return mask

    def reset(self, *, seed: int | Sequence[int | None] | None = None,
              options: dict[str, Any] | None = None) -> tuple[FloatArray, Info]:
        if seed is None or isinstance(seed, (int, np.integer)):
            super().reset(seed=seed if seed is None else int(seed))
        mask = self._reset_mask(options)
        self._start_recording()
        self._start_worlds(self._seeds(seed, self._next_seed), mask)
        infos = self._infos() if mask.all() else _of_worlds(self._fields, mask)
        self._add_start_errors(infos, mask)
        return self._observed(), infos

    def _start_worlds(self, seeds: list[int], mask: Flags) -> None:
        """Those that cannot start have zeros as their observation, whatever was before."""
        failed = self._batch.reset(seeds, mask.astype(np.uint8).tolist())
        self._observations[failed] = 0

    def _add_start_errors(self, infos: Info, mask: Flags) -> None:
        """Adds why worlds of the mask, which were reset, have not started."""
        for i in map(int, np.flatnonzero(mask)):
            if error := self._batch.start_error(i):
                if self._strict:
                    raise _core.Error(f"world {i}: {error}")
                self._add_info(infos, {"error": error}, i)

    def _start_recording(self) -> None:
        if self._recording is not None and os.getpid() == self._process:
            os.makedirs(self._recording[0], exist_ok=True)
            self._batch.record(*self._recording)
            self._recording = None

    def step(self, actions: ArrayLike | None = None) -> Stepped:
        ended = self._advance(actions)
        infos = self._infos()
        if ended:
            self._add_final(infos, self._terminated | self._truncated)
        if not self._copy:
            return self._observations, self._rewards, self._terminated, self._truncated, infos
        return (self._observations.copy(), self._rewards.copy(), self._terminated.copy(), self._truncated.copy(), infos)

    def _advance(self, actions: ArrayLike | None) -> bool:
        """Computes the step. Returns whether an episode has ended."""
        given: Any = actions
        if self._has_controller:
            if given is not None:
                raise ValueError("the controller commands the actuators: step() takes no actions")
        elif self._strict:
            finite("the array of actions", np.asarray(real_array("the array of actions", given), np.float32), True)
        ended = self._batch.step(given)
        if ended is None:  # not an array of the right type and shape
            array = real_array("the array of actions", given)
            if array.shape != self.action_space.shape:
                raise ValueError(f"the actions have shape {array.shape}: must be {self.action_space.shape}")
            ended = self._batch.step(np.ascontiguousarray(array, np.float32))
        return bool(ended)

    def _observed(self) -> FloatArray:
        return self._observations.copy() if self._copy else self._observations

    def _infos(self) -> Info:
        infos = self._every_info.copy()
        if self._copy:
            for name, values in self._fields.items():
                infos[name] = values.copy()
        return infos

    def _add_final(self, infos: Info, ended: Flags) -> None:
        """Adds what an episode that has ended leaves, as Gymnasium's SyncVectorEnv: its metrics, and where the same step has
        reset the world its last observation and info."""
        final = _of_worlds(self._final_fields, ended) if self._same_step else infos
        for i in np.flatnonzero(ended):
            error = self._batch.error(int(i))
            if error and self._strict:
                raise _core.Error(f"world {i}: {error}")
            self._add_info(final, {"error": error} if error else {"metrics": self._batch.final_metrics(int(i))}, int(i))
        if self._same_step:
            observations = np.full(self.num_envs, None, object)
            for i in np.flatnonzero(ended):
                observations[i] = self._final[i].copy()
            self._add_start_errors(infos, ended)
            infos.update(final_obs=observations, _final_obs=ended, final_info=final, _final_info=ended.copy())

    def save(self, world: int) -> bytes:
        """The state of one world, as Simulation.save()."""
        return self._batch.save(whole("world", world, 0))

    def restore(self, world: int, state: bytes) -> FloatArray:
        """Continues one world from a state, that of any world or Simulation of the same experiment and options. Returns
        its observation."""
        self._batch.restore(whole("world", world, 0), state_bytes(state))
        observation: FloatArray = self._observations[world]
        return observation.copy() if self._copy else observation

    def _arrays(self) -> list[NDArray[Any]]:
        """Those that describe the worlds after the latest step."""
        objects = [] if self._object_states is None else [self._object_states]
        return [*self._state_arrays, self._rewards, self._terminated, self._truncated, *objects]

    def _save_worlds(self) -> Info:
        """All worlds, those that have failed too, for _restore_worlds(); raises Error if one cannot be saved."""
        batch, worlds = self._batch, range(self.num_envs)
        return {"worlds": [np.frombuffer(batch.save(i) if batch.has_running_episode(i) else b"", np.uint8) for i in worlds],
                "status": [batch.status(i) for i in worlds], "arrays": [array.copy() for array in self._arrays()]}

    def _restore_worlds(self, state: Info) -> None:
        for i, (world, status) in enumerate(zip(state["worlds"], state["status"])):
            if world.size:
                self._batch.restore(i, world.tobytes())
            else:
                self._batch.fail(i)
            self._batch.set_status(i, status)
        for to, saved in zip(self._arrays(), state["arrays"]):
            to[...] = saved

    def state_hash(self, world: int) -> int:
        """The state hash of one world, as Simulation.state_hash."""
        return self._batch.state_hash(whole("world", world, 0))

    def render(self) -> Any:
        """A list with a picture of each world (rgb_array), or None."""
        if self.render_mode is None:
            return None
        camera = core_camera(self._camera, self._description["objects"])
        return [self._batch.render(i, *self._render_size, camera) for i in range(self.num_envs)]

    # ---- worlds that differ

    @property
    def options(self) -> list[dict[str, str]]:
        """The script's options of each world, as text."""
        return [self._batch.options(i) for i in range(self.num_envs)]

    @property
    def parameters(self) -> tuple[str, ...]:
        """The names of the parameters, as Simulation.parameters."""
        return tuple(self._batch.parameter_names())

    def get_parameter(self, name: str) -> Numbers:
        """The values of a parameter in the next episodes, worlds × its shape; where it is randomised, those of the running
        episodes."""
        shape, first, _, _ = self._parameter(name)
        of_worlds = [values for _, values, _, _ in self._batch.parameter(name)]
        for i, values in enumerate(of_worlds):
            if len(values) != len(first):
                raise ValueError(f"{name} has {len(values)} numbers in world {i} and {len(first)} in world 0: no array holds both")
        return np.array(of_worlds).reshape(self.num_envs, *shape)

    def set_parameter(self, name: str, values: ArrayLike, worlds: Worlds = None) -> None:
        """Sets a parameter from the next reset of each world on: values broadcast to worlds × its shape. Else as
        Simulation.set_parameter()."""
        which = _parameters.world_numbers(worlds, self.num_envs)
        shape, _, _, per_cell = self._parameter(name)
        checked = _parameters.numbers(name, values, (len(which), *shape), per_cell)
        if which:
            self._batch.set_parameter(name, which, checked)

    def randomise(self, ranges: Mapping[str, Range | None], worlds: Worlds = None) -> None:
        """Draws parameters at each reset, as Simulation.randomise(); low and high broadcast to worlds × the parameter's
        shape."""
        which = _parameters.world_numbers(worlds, self.num_envs)
        for name, given in _parameters.checked_ranges(ranges).items():
            shape, _, is_whole, per_cell = self._parameter(name)
            if per_cell:
                raise ValueError(f"randomise: {name}: is a value for each cell; randomise faults.actuator or faults.sensor")
            if not which:
                continue
            if given is None:
                low = high = np.zeros((len(which), 0))
            else:
                low, high = _parameters.limits(name, given, (len(which), *shape), is_whole)
            self._batch.randomise(name, which, low, high)

    def _parameter(self, name: str) -> tuple[tuple[int, ...], list[float], bool, bool]:
        shape, values, is_whole, per_cell = self._batch.parameter(name)[0]
        return tuple(shape), values, is_whole, per_cell

    @property
    def objects(self) -> dict[str, FloatArray]:
        """The states of the declared objects in all worlds: `position`, `orientation`, `velocity` and `angular_velocity`, each
        worlds × objects × 3 or 4, as Simulation.objects; NaN of objects that are gone. Read-only views, which each step
        overwrites."""
        if self._object_states is None:
            self._object_states = np.zeros((self.num_envs, self._batch.object_count, 13), np.float32)
            self._bind(self._object_states)
            self._batch.observe_objects()
        readable = self._object_states.view()
        readable.flags.writeable = False
        return {name: readable[..., first:last] for name, (first, last) in _parameters.STATE.items()}

    def teleport(self, object: str | int | Sequence[int] | None = None, *, position: ArrayLike | None = None,
                 orientation: ArrayLike | None = None, velocity: ArrayLike | None = None,
                 angular_velocity: ArrayLike | None = None, worlds: Worlds = None) -> None:
        """Moves objects now, as Simulation.teleport(), in all or some worlds: the values broadcast to worlds × objects × 3
        or 4, for one object to worlds × 3 or 4."""
        which = _parameters.world_numbers(worlds, self.num_envs)
        ids, several = _parameters.object_ids(self._description["objects"], object)
        if which:
            for name, values in _parameters.poses((len(which),), len(ids), several, position=position, orientation=orientation,
                                                  velocity=velocity, angular_velocity=angular_velocity):
                self._batch.place(name, which, ids, values)

    def push(self, object: str | int | Sequence[int] | None = None, *, force: ArrayLike | None = None,
             torque: ArrayLike | None = None, worlds: Worlds = None) -> None:
        """Applies forces and torques, as Simulation.push(), in all or some worlds."""
        which = _parameters.world_numbers(worlds, self.num_envs)
        ids, several = _parameters.object_ids(self._description["objects"], object)
        if which:
            self._batch.set_wrenches(which, ids, _parameters.pushes(force, torque, (len(which),), len(ids), several))

    def close_extras(self, **arguments: Any) -> None:
        if not isinstance(self._batch, Closed):
            self._batch.stop_recording()
        self._batch = Closed()  # type: ignore[assignment]

    def __reduce__(self) -> tuple[Any, ...]:
        settings = [self._batch.parameter_settings(i) for i in range(self.num_envs)]
        if self._records:
            warnings.warn("a copy of this environment does not record: its folder has the episodes of this one", stacklevel=2)
        return _unpickled, (type(self), self._arguments, settings, self._save_worlds(), getattr(self, "_np_random", None),
                            self._object_states is not None, [random_streams(getattr(self, name)) for name in _SPACES])


def _unpickled(cls: type[VectorEnv], arguments: dict[str, Any], settings: list[Any], worlds: Info, random: Any,
               has_objects: bool, streams: list[Any]) -> VectorEnv:
    envs = cls(**arguments)  # with seeds of which one, as then, can start
    for i, of_world in enumerate(settings):
        envs._batch.set_parameter_settings(i, of_world)
    if has_objects:
        envs.objects
    envs._restore_worlds(worlds)
    envs._np_random = random
    for name, of_space in zip(_SPACES, streams):
        set_random_streams(getattr(envs, name), of_space)
    return envs


def _options_of_worlds(given: Any, count: int, whole_options: Callable[[Options], Collection[str]]) -> list[Options]:
    """The options of each world. whole_options: the names of those of which a range of whole numbers gives whole ones."""
    if given is None or isinstance(given, Mapping):
        given = [given or {}] * count
    elif not isinstance(given, Sequence) or isinstance(given, str) or len(given) != count:
        raise ValueError(f"set = {given!r}: must be a dict, or a list of one per world, {count}")
    known: dict[int, Collection[str]] = {}  # often the same dict for all worlds

    def drawn(options: Any, world: int) -> Any:
        if not isinstance(options, Mapping) or not any(isinstance(value, tuple) for value in options.values()):
            return options
        if id(options) not in known:
            known[id(options)] = whole_options(options)
        return {name: _drawn(name, value, world, name in known[id(options)]) for name, value in options.items()}
    return [drawn(options, i) for i, options in enumerate(given)]


def _whole_options(experiment: PathName, options: Options, source: str | None) -> Collection[str]:
    """The options whose ranges are of whole numbers and whose default is no float, as text 2 and not 2.0."""
    ranges = [name for name, value in options.items() if isinstance(value, tuple) and not name.startswith("vary.")
              and all(isinstance(end, int) for end in value)]
    try:
        defaults = _core.option_values(path_text(experiment), overrides(
            {name: value for name, value in options.items() if not isinstance(value, tuple)}), source) if ranges else {}
    except _core.Error:  # which creating the worlds names, if they have it too
        defaults = {}
    return [name for name in ranges if re.fullmatch(r"-?\d+", defaults.get(name, "0"))]


def _drawn(name: str, value: Any, world: int, whole: bool) -> Any:
    """The value of an option in a world: that of a range (low, high) is drawn."""
    if not isinstance(value, tuple) or name.startswith("vary."):  # which each episode draws
        return value
    if len(value) != 2 or not all(isinstance(end, (int, float)) for end in value) or not value[0] <= value[1]:
        raise ValueError(f"set: {name} = {value!r}: a range must be (low, high), two numbers")
    low, high = value
    share = float(_core.draw_uniform([world], f"option {name}", 1)[0, 0])
    if whole:
        return low + int(share * (high - low + 1))
    return low + share * (high - low)


def _controllers(program: PathName | None, parameters: Mapping[str, float] | None) -> Any:
    if program is None:
        if parameters is not None:
            raise ValueError("controller_set needs a controller")
        return None
    import apron  # of the same wheel; environments without a controller do without
    return apron._controllers(program, parameters)


def finite_rewards(rewards: Numbers, infos: Info, of_failed: float = 0.0) -> Numbers:
    """What VectorEnv.step() has returned, without the NaN of worlds that fail, with which a learner would spoil its weights; warns
    of each error once."""
    failed = np.isnan(rewards)
    if failed.any():
        for error in sorted(set(infos.get("final_info", infos)["error"][failed])):
            warnings.warn(f"a world has failed, which ends its episode: {error}", stacklevel=2)
    return np.where(failed, of_failed, rewards)


def _of_worlds(fields: Info, mask: Flags) -> Info:
    """Copies of the fields of an info with the values of some worlds, and masks that say which."""
    infos: Info = {}
    for name, values in fields.items():
        infos[name], infos["_" + name] = np.zeros_like(values), mask.copy()
        infos[name][mask] = values[mask]
    return infos


def make(task: str, num_envs: int = 1, **arguments: Any) -> VectorEnv:
    """The vector entry point of the tasks' Gymnasium ids."""
    return VectorEnv(task_file(task), num_envs, **arguments)
