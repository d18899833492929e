"""Tasks in Python: the scene is Lua, all that judges it is a function of arrays over all worlds."""
from __future__ import annotations

import copy
import difflib
import importlib
import os
from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any, ClassVar, Union

import gymnasium
import numpy as np
from gymnasium.vector import AutoresetMode
from gymnasium.vector.utils import batch_space
from numpy.typing import ArrayLike, NDArray

from . import _core, _parameters
from ._env import box
from ._parameters import Numbers, Range
from ._surface import Channel, Closed, FloatArray, checked_options, draw_seed, real_array, views
from ._vector import Flags, Info, VectorEnv, _of_worlds

if TYPE_CHECKING:
    from typing_extensions import Unpack

    from ._simulation import Options
    from ._vector import MostArguments, WorldArguments

    class OneWorld(MostArguments, total=False):
        """What Task.make() takes."""
        set: Options | None
        render_mode: str | None
        shm: str | None
        timeout: float

Array = Any  # NDArray, or the counterpart of Task.arrays
Observation = Union[Array, dict[str, Array]]


class State:
    """What a task's functions see: the arrays of all worlds after a step. Read-only.

    sensors: readings by channel, worlds × rows × columns or worlds × components × rows × columns. actions: the commands of
    the step by channel, likewise, clamped to the channel's range, with its safe value for NaN; those of the surface's start
    after a reset. Those of a controller, and after restore(), are safe values in cells without the channel. goals: the numbers of Task.goals, worlds × …
    time: since the start of the episode, s. ticks: the same in steps. period: of a step, s.
    position, orientation (x y z w), velocity, angular_velocity: of the declared objects, worlds × objects × 3 or 4, ascending
    by id; NaN of objects that are gone. info: the values of the script's info{}.
    """

    def __init__(self, sensors: dict[str, Array], actions: dict[str, Array], goals: dict[str, Array], time: Array, ticks: Array,
                 period: float, objects: dict[str, Array] | None, labels: Sequence[str], info: dict[str, Array], to: Any,
                 cells: tuple[int, int] = (0, 0)):
        self.sensors, self.actions, self.goals, self.info = sensors, actions, goals, info
        self.time, self.ticks, self.period = time, ticks, period
        self._objects, self._labels, self._to, self._cells = objects, labels, to, cells

    def _of(self, field: str, object: str | int | None) -> Array:
        if self._objects is None:
            raise ValueError(f"{field}: a live surface does not know its objects; use sensors, goals and actions")
        values = self._objects[field]
        if object is None:
            return values
        ids, several = _parameters.object_ids(self._labels, object)
        return values[:, ids] if several else values[:, ids[0]]

    def position(self, object: str | int | None = None) -> Array:
        """The positions of all objects, worlds × objects × 3, or of one, by label or id, worlds × 3; u."""
        return self._of("position", object)

    def orientation(self, object: str | int | None = None) -> Array:
        """Likewise, unit quaternions x y z w."""
        return self._of("orientation", object)

    def velocity(self, object: str | int | None = None) -> Array:
        """Likewise, u/s."""
        return self._of("velocity", object)

    def angular_velocity(self, object: str | int | None = None) -> Array:
        """Likewise, rad/s."""
        return self._of("angular_velocity", object)

    def yaw(self, object: str | int | None = None) -> Array:
        """The angle about z, rad: without the last axis of orientation()."""
        q = np.asarray(self.orientation(object))
        x, y, z, w = (q[..., i] for i in range(4))
        return self._to(np.arctan2(2 * (w * z + x * y), 1 - 2 * (y * y + z * z)))


class Task:
    """A task. Subclasses give `script` or `scene`, and override what judges the state; all arrays are over all worlds.

    script: path of an experiment; scene: its text instead. Both may have events, reward and info{} of their own.
    set: options of the script. parameters: values of parameters (`Simulation.parameters`), randomise: ranges of parameters,
    drawn at each reset. goals: name → (low, high), numbers or arrays, drawn at each reset too; State.goals has them.
    episode_seconds: the length of an episode. arrays: "numpy"; "torch" and "jax" give the functions tensors that share the
    memory of NumPy's arrays, as DLPack defines it.

    The functions are pure: they must not write to what they are given.
    """
    script: ClassVar[str | os.PathLike[str] | None] = None
    scene: ClassVar[str | None] = None
    set: ClassVar[Mapping[str, Any]] = {}
    parameters: ClassVar[Mapping[str, ArrayLike]] = {}
    randomise: ClassVar[Mapping[str, Range]] = {}
    goals: ClassVar[Mapping[str, tuple[ArrayLike, ArrayLike]]] = {}
    episode_seconds: ClassVar[float | None] = None
    arrays: ClassVar[str] = "numpy"

    def __init_subclass__(cls, **arguments: Any) -> None:
        super().__init_subclass__(**arguments)
        for name, value in vars(cls).items():
            for meant in difflib.get_close_matches(name, _ATTRIBUTES, 1, 0.8):
                if name != meant and isinstance(value, _ATTRIBUTES[meant]):
                    raise TypeError(f"{cls.__name__}.{name}: a Task has no such attribute (did you mean '{meant}'?)")
            # Beside a function of the right name, one of a name that is close to it is a helper.
            for meant in difflib.get_close_matches(name, _FUNCTIONS, 1, 0.8):
                if name != meant and callable(value) and getattr(cls, meant) is getattr(Task, meant):
                    raise TypeError(f"{cls.__name__}.{name}: a Task has no such function (did you mean '{meant}'?)")

    def reward(self, state: State) -> Array:
        """The reward of a step, (worlds,)."""
        return 0.0

    def success(self, state: State) -> Array:
        """Whether the goal is reached, (worlds,), in the start or after a step; this ends the episode, after one step at the
        earliest. NumPy's booleans."""
        return False

    def failure(self, state: State) -> Array:
        """Whether the episode ends without success, (worlds,)."""
        return False

    def observation(self, state: State) -> Observation:
        """What the learner sees: an array of worlds × …, or a dict of such. Default: the planes of all sensors, worlds ×
        planes × rows × columns, as those of Env and VectorEnv."""
        return planes(state)

    def metrics(self, state: State) -> Mapping[str, Array]:
        """Values of the end of an episode, by name, each (worlds,)."""
        return {}

    # ---- environments

    def make_vec(self, num_envs: int = 1, **arguments: Unpack[WorldArguments]) -> TaskVectorEnv:
        """Many worlds; arguments as those of VectorEnv."""
        return TaskVectorEnv(self, num_envs, **arguments)

    def make(self, **arguments: Unpack[OneWorld]) -> TaskEnv:
        """One world, or with shm=NAME a live surface."""
        return TaskEnv(self, **arguments)

    @classmethod
    def register(cls, id: str) -> None:
        """Makes gymnasium.make(id) and gymnasium.make_vec(id) work in this process."""
        gymnasium.register(id, entry_point=lambda **a: cls().make(**a),
                           vector_entry_point=lambda num_envs=1, **a: cls().make_vec(num_envs, **a))


# What a Task declares besides functions, and the types by which a misspelt name is told from a constant of the user's.
_ATTRIBUTES: Mapping[str, Any] = {"script": (str, os.PathLike), "scene": str, "set": Mapping, "parameters": Mapping,
                                  "randomise": Mapping, "goals": Mapping, "episode_seconds": (int, float), "arrays": str}
_FUNCTIONS = ("reward", "success", "failure", "observation", "metrics")


def planes(state: State) -> Array:
    """The planes of all sensors: worlds × planes × rows × columns."""
    blocks = [values if values.ndim == 4 else values[:, None] for values in state.sensors.values()]
    if not blocks:
        return state._to(np.zeros((len(state.time), 0, *state._cells), np.float32))
    if len(blocks) == 1:
        return blocks[0]
    return state._to(np.concatenate([np.asarray(block) for block in blocks], axis=1))


def _to(arrays: str) -> Any:
    """The function that gives NumPy's arrays the type that a task wants, without copies."""
    if arrays == "numpy":
        return lambda values: values
    if arrays == "torch":
        return importlib.import_module("torch").from_numpy
    if arrays == "jax":
        return importlib.import_module("jax").numpy.asarray
    raise ValueError(f"arrays = {arrays!r}: must be 'numpy', 'torch' or 'jax'")


def _space(values: NDArray[Any]) -> gymnasium.spaces.Box[Any]:
    return gymnasium.spaces.Box(-np.inf, np.inf, values.shape[1:], np.float32)


class _Judge:
    """The functions of a task, their results checked."""

    def __init__(self, task: Task, worlds: int):
        self.task, self.worlds, self._to = task, worlds, _to(task.arrays)
        self.scene: dict[str, Any] = dict(experiment=task.script, source=None)
        if (task.script is None) == (task.scene is None):
            raise ValueError(f"{type(task).__name__}: give either script, a path, or scene, the text of a script")
        if task.scene is not None:
            self.scene = dict(experiment=f"{type(task).__name__}.lua", source=task.scene)
        if task.episode_seconds is not None and not (isinstance(task.episode_seconds, (int, float))
                                                     and 0 < task.episode_seconds < np.inf):
            raise ValueError(f"episode_seconds = {task.episode_seconds!r}: must be a number above 0, or None")
        self.ranges = {name: _goal_range(name, given) for name, given in task.goals.items()}
        self.goals = {name: np.zeros((worlds, *low.shape)) for name, (low, _) in self.ranges.items()}
        self.shapes: dict[str, tuple[int, ...]] | None = None  # of the parts of an observation

    def draw_goals(self, seeds: NDArray[Any], mask: Flags) -> None:
        """New goals for the worlds of the mask, from the seeds of their episodes."""
        which = np.flatnonzero(mask)
        for name, (low, high) in self.ranges.items():
            if which.size:
                shares = _core.draw_uniform([int(s) for s in seeds[which]], f"goal {name}", max(low.size, 1))
                self.goals[name][which] = low + (high - low) * shares.reshape(len(which), *low.shape)

    def state(self, sensors: dict[str, FloatArray], actions: dict[str, FloatArray], time: Numbers, ticks: NDArray[Any],
              period: float, objects: dict[str, FloatArray] | None, labels: Sequence[str], info: Info,
              cells: tuple[int, int]) -> State:
        def readable(values: Mapping[str, NDArray[Any]]) -> dict[str, Array]:
            out = {}
            for name, array in values.items():
                out[name] = array.view()
                out[name].flags.writeable = self.task.arrays == "torch"  # which has no arrays that are read-only
            return {name: self._to(array) for name, array in out.items()}
        clock = readable({"time": time, "ticks": ticks})
        return State(readable(sensors), readable(actions), readable(self.goals), clock["time"], clock["ticks"], period,
                     None if objects is None else readable(objects), labels, readable(info), self._to, cells)

    def numbers(self, name: str, values: Array) -> Numbers:
        array = real_array(f"{type(self.task).__name__}.{name}", values)
        if array.shape not in ((), (self.worlds,)):
            raise ValueError(f"{type(self.task).__name__}.{name} returned an array of shape {array.shape}: must be one value per "
                             f"world, ({self.worlds},)")
        return np.broadcast_to(array.astype(np.float64), (self.worlds,)).copy()

    def judge(self, state: State) -> dict[str, Numbers]:
        """What reward, success and failure return."""
        return {name: self.numbers(name, getattr(self.task, name)(state)) for name in ("reward", "success", "failure")}

    def starts_with_success(self, state: State) -> Flags:
        """What success returns after a reset."""
        return _holds(self.numbers("success", self.task.success(state)))

    def not_finite(self, values: Mapping[str, Numbers], runs: Flags) -> dict[int, str]:
        """The errors of worlds in which one of them is not finite."""
        return {int(i): f"{type(self.task).__name__}.{name} is {of_worlds[i]} in world {i}: must be finite"
                for name, of_worlds in reversed(list(values.items())) for i in np.flatnonzero(runs & ~np.isfinite(of_worlds))}

    def metrics(self, state: State) -> dict[str, Numbers]:
        given: Any = self.task.metrics(state)
        if not isinstance(given, Mapping):
            raise ValueError(f"{type(self.task).__name__}.metrics returned a {type(given).__name__}: must be a dict of arrays")
        return {str(name): self.numbers(f"metrics['{name}']", values) for name, values in given.items()}

    def observation(self, state: State) -> Any:
        def checked(name: str, values: Array) -> FloatArray:
            array = np.array(real_array(name, np.asarray(values)), np.float32)
            if array.ndim < 1 or array.shape[0] != self.worlds:
                raise ValueError(f"{type(self.task).__name__}.{name} has shape {array.shape}: must be ({self.worlds}, …), "
                                 "worlds first")
            return array
        given = self.task.observation(state)
        if isinstance(given, Mapping):
            parts = {str(name): checked(f"observation['{name}']", values) for name, values in given.items()}
        else:
            parts = {"": checked("observation", given)}
        shapes = {name: values.shape for name, values in parts.items()}
        if self.shapes is None:
            self.shapes = shapes
        elif shapes != self.shapes:
            raise ValueError(f"{type(self.task).__name__}.observation has the shapes {list(shapes.items())}: must have those of "
                             f"the first observation, {list(self.shapes.items())}")
        return parts if isinstance(given, Mapping) else parts[""]

    def space(self, observation: Any, of_planes: gymnasium.Space[Any]) -> gymnasium.Space[Any]:
        """The observation space of one world. The planes have the limits of their channels."""
        if isinstance(observation, dict):
            return gymnasium.spaces.Dict({name: _space(values) for name, values in observation.items()})
        return of_planes if type(self.task).observation is Task.observation else _space(observation)


def _holds(values: Numbers) -> Flags:
    """Not for NaN, which the first step reports."""
    holds: Flags = (values != 0) & np.isfinite(values)
    return holds


def _of_channels(of: Sequence[Channel], field: str) -> FloatArray:
    """The values of a field, channels × 1 × 1."""
    return np.array([getattr(channel, field) for channel in of], np.float32)[:, None, None]


def _commands(actions: ArrayLike, of: Sequence[Channel]) -> FloatArray:
    """What actuators make of actions: values within the channels' ranges, and the safe ones for NaN."""
    commands: FloatArray = np.clip(np.asarray(actions, np.float32), _of_channels(of, "minimum"), _of_channels(of, "maximum"))
    np.copyto(commands, _of_channels(of, "safe"), where=np.isnan(commands))
    return commands


def _goal_range(name: str, given: Any) -> tuple[Numbers, Numbers]:
    if not isinstance(given, (tuple, list)) or len(given) != 2:
        raise ValueError(f"goals: {name} = {given!r}: must be (low, high)")
    low, high = (real_array(f"goals: {name}", end).shape for end in given)
    try:
        shape = np.broadcast_shapes(low, high)
    except ValueError:
        raise ValueError(f"goals: {name}: low, of shape {low}, and high, of shape {high}, do not broadcast") from None
    return _parameters.limits(f"goals: {name}", given, shape, False)


class TaskVectorEnv(VectorEnv):
    """A task in many worlds; made by Task.make_vec(). Arguments as those of VectorEnv, of which `set` adds to the task's.

    Rewards are the task's plus those of the script; episodes end when either says so. A world that fails, also by a reward, success or
    failure of the task that is not finite, is ended as VectorEnv does it. `infos` has the goals besides the values of info{}.
    """

    def __init__(self, task: Task, num_envs: int = 1, *, set: Any = None, render_mode: str | None = None,
                 autoreset_mode: AutoresetMode | str = AutoresetMode.NEXT_STEP, **arguments: Unpack[MostArguments]):
        self.task = task
        self._judge = _Judge(task, num_envs)
        self._observes_planes = type(task).observation is Task.observation
        def merged(own: Any) -> Any:
            return {**task.set, **own} if isinstance(own, Mapping) else own
        options = ([merged(own) for own in set] if isinstance(set, Sequence) and not isinstance(set, str)
                   else merged({} if set is None else set))
        self._resets_itself = AutoresetMode(autoreset_mode) == AutoresetMode.SAME_STEP
        # The batch itself resets with NEXT_STEP only: a task's end of an episode follows its step.
        super().__init__(num_envs=num_envs, set=options, autoreset_mode=AutoresetMode.DISABLED if self._resets_itself
                         else autoreset_mode, render_mode=render_mode, **self._judge.scene, **arguments)
        self.metadata["autoreset_mode"] = AutoresetMode(autoreset_mode)
        self._arguments = {**self._arguments, "autoreset_mode": AutoresetMode(autoreset_mode)}
        self._arguments["task"] = task
        self._time = np.zeros(num_envs)
        self._over, self._failed, self._reached = np.zeros((3, num_envs), np.bool_)
        self._last: dict[str, FloatArray] | None = None  # of a task's own observation
        self._object_states = np.zeros((num_envs, self._batch.object_count, 13), np.float32)
        self._actions = np.zeros((num_envs, len(self.actuator_channels), self.rows, self.columns), np.float32)
        self._bind(self._object_states, self._time, self._actions)
        for name in {*self._fields, "metrics", "error", "final_obs", "final_info"} & task.goals.keys():
            raise ValueError(f"goals: {name}: infos have another value of this name")
        self._limit = (None if task.episode_seconds is None
                       else int(np.ceil(task.episode_seconds / self.period - 1e-9)))
        for name, values in task.parameters.items():
            self.set_parameter(name, values)
        VectorEnv.randomise(self, task.randomise)
        every = np.ones(num_envs, np.bool_)
        self._start_worlds(self._seeds(arguments.get("seed"), self._batch.started_seed), every)
        observation = self._observe_start(every)
        self.single_observation_space = self._judge.space(observation, self.single_observation_space)
        self.observation_space = batch_space(self.single_observation_space, num_envs)

    def _observe(self, state: State) -> Any:
        """The task's observation; of the worlds that have failed, whose objects and info{} are NaN, the last one."""
        seen = self._judge.observation(state)
        if not self._observes_planes:  # which are the last ones anyway
            parts = seen if isinstance(seen, dict) else {"": seen}
            if self._last is None:
                self._last = {name: np.zeros_like(values) for name, values in parts.items()}
            for name, values in parts.items():
                values[self._failed] = self._last[name][self._failed]
                self._last[name][...] = values
        return seen

    def _start_worlds(self, seeds: list[int], mask: Flags) -> None:
        super()._start_worlds(seeds, mask)
        self._begin(mask)
        for values in (self._last or {}).values():
            values[self._failed & mask] = 0

    def _begin(self, mask: Flags) -> None:
        """After the reset of some worlds."""
        self._judge.draw_goals(self._fields["seed"], mask)
        self._over[mask] = self._reached[mask] = False
        self._failed[mask] = [self._batch.start_error(int(i)) != "" for i in np.flatnonzero(mask)]

    def _observe_start(self, mask: Flags) -> Any:
        """The observation, after the reset of some worlds."""
        state = self.state()
        self._note_success(self._judge.starts_with_success(state), mask & ~self._failed)
        return self._observe(state)

    def _note_success(self, success: Flags, mask: Flags) -> None:
        """That of a reset ends the episode in its first step."""
        self._reached |= success & mask
        self._fields["success"][...] |= self._reached & mask

    def state(self) -> State:
        """The state of all worlds."""
        def by_channel(of: Sequence[Channel], values: FloatArray) -> dict[str, FloatArray]:
            return {name: plane.swapaxes(0, 1) if plane.ndim == 4 else plane
                    for name, plane in views(values.swapaxes(0, 1), of).items()}
        own = ("seed", "success", "nonfinite_actions")
        return self._judge.state(by_channel(self.sensor_channels, self._observations),
                                 by_channel(self.actuator_channels, self._actions), self._time,
                                 np.rint(self._time / self.period).astype(np.int64), self.period, self.objects,
                                 self._description["objects"],
                                 {name: values for name, values in self._fields.items() if name not in own},
                                 (self.rows, self.columns))

    def _task_infos(self) -> Info:
        infos = {name: values.copy() for name, values in self._fields.items()}
        infos.update({name: values.copy() for name, values in self._judge.goals.items() if name not in infos})
        return infos

    def reset(self, *, seed: int | Sequence[int | None] | None = None,
              options: dict[str, Any] | None = None) -> tuple[Any, Info]:
        if seed is None or isinstance(seed, (int, np.integer)):
            gymnasium.vector.VectorEnv.reset(self, seed=seed if seed is None else int(seed))
        mask = self._reset_mask(options)
        self._start_recording()
        self._start_worlds(self._seeds(seed, self._next_seed), mask)
        observation, infos = self._observe_start(mask), _of_worlds(self._task_infos(), mask)
        self._add_start_errors(infos, mask)
        return observation, infos

    def step(self, actions: ArrayLike | None = None) -> Any:
        fresh = self._over & (not self._resets_itself) & (self.metadata["autoreset_mode"] != AutoresetMode.DISABLED)
        self._advance(actions)
        script_over = self._terminated | self._truncated
        if actions is not None:  # those of a controller, and of a start, are in effect
            np.copyto(self._actions, _commands(actions, self.actuator_channels), where=~fresh[:, None, None, None])
        if fresh.any():
            self._begin(fresh)
        failed = np.isnan(self._rewards)
        runs = ~fresh & ~failed
        state = self.state()
        own = self._judge.judge(state)
        errors = self._judge.not_finite(own, runs)
        unjudged = np.isin(np.arange(self.num_envs), list(errors))
        if errors and (unjudged | failed).all():
            raise _core.Error(errors[min(errors)])
        runs &= ~unjudged
        rewards = np.where(runs, self._rewards + own["reward"], np.where(unjudged, np.nan, self._rewards))
        self._note_success(_holds(own["success"]), ~failed & ~unjudged)
        terminated = self._terminated | ((self._reached | (own["failure"] != 0)) & runs)
        truncated = self._truncated | unjudged
        if self._limit is not None:
            truncated |= runs & (np.rint(self._time / self.period) >= self._limit)
        over = terminated | truncated
        ends = over & ~script_over
        if ends.any():
            self._batch.end_episodes(ends.astype(np.uint8).tolist())
        self._failed = failed | unjudged
        observation, infos = self._observe(state), self._task_infos()
        infos.update({"_" + name: np.ones(self.num_envs, np.bool_) for name in list(infos)})
        final: Info = {}
        if over.any():
            final = _of_worlds(self._task_infos(), over) if self._resets_itself else infos
            self._add_metrics(final, state, over, errors)
        self._over = over.copy()
        if self._resets_itself and over.any():
            last = observation
            self._batch.reset(self._seeds(None, self._next_seed), over.astype(np.uint8).tolist())
            self._begin(over)
            observation, infos = self._observe_start(over), self._task_infos()
            infos.update({"_" + name: np.ones(self.num_envs, np.bool_) for name in list(infos)})
            self._add_start_errors(infos, over)
            final_obs = np.full(self.num_envs, None, object)
            for i in np.flatnonzero(over):
                final_obs[i] = _of_world(last, int(i))
            infos.update(final_obs=final_obs, _final_obs=over.copy(), final_info=final, _final_info=over.copy())
        return observation, rewards, terminated, truncated, infos

    def _add_metrics(self, infos: Info, state: State, over: Flags, errors: Mapping[int, str]) -> None:
        own = self._judge.metrics(state)
        for i in np.flatnonzero(over):
            error = self._batch.error(int(i)) or errors.get(int(i))
            if error and self._strict:
                raise _core.Error(f"world {i}: {error}")
            metrics = {**self._batch.final_metrics(int(i)), **{name: float(values[i]) for name, values in own.items()}}
            self._add_info(infos, {"error": error} if error else {"metrics": metrics}, int(i))

    def restore(self, world: int, state: bytes) -> Any:
        """As VectorEnv.restore(); the goals are those of the state's seed."""
        super().restore(world, state)
        mask = np.arange(self.num_envs) == world
        self._begin(mask)
        return _of_world(self._observe_start(mask), world)

    def _arrays(self) -> list[NDArray[Any]]:
        return [*super()._arrays(), self._time, self._actions, self._over, self._failed, self._reached,
                *self._judge.goals.values(), *(self._last or {}).values()]

    def __reduce__(self) -> tuple[Any, ...]:
        function, (cls, arguments, *rest) = super().__reduce__()
        return function, (cls, {k: v for k, v in arguments.items() if k not in ("experiment", "source")}, *rest)


class TaskEnv(gymnasium.Env[Any, ArrayLike]):
    """A task in one world, or on a live surface (shm=NAME), made by Task.make().

    Observations are those of TaskVectorEnv without the first axis, in both. A live surface has no states of objects and no
    info{}: functions that use them raise ValueError. Its reset takes no seed and draws new goals.
    """
    metadata = {"render_modes": ["rgb_array"], "render_fps": 60}

    def __init__(self, task: Task, *, shm: str | None = None, timeout: float = 30.0, render_mode: str | None = None,
                 set: Options | None = None, **arguments: Unpack[MostArguments]):
        self.task, self.render_mode = task, render_mode
        self._live: Any = None
        if shm is None:
            self._envs = TaskVectorEnv(task, 1, autoreset_mode=AutoresetMode.DISABLED, render_mode=render_mode,
                                       set=set, **arguments)
            self.observation_space = self._envs.single_observation_space
            self.action_space = self._envs.single_action_space
            self.metadata = {**self.metadata, "render_fps": round(1 / self._envs.period)}
            return
        from ._live import LiveSurface
        given = [*arguments, *(name for name, value in (("set", set), ("render_mode", render_mode)) if value is not None)]
        if given:
            raise ValueError(f"{', '.join(given)}: a live surface has no such argument")
        self._live, self._judge = LiveSurface(shm, timeout), _Judge(task, 1)
        self._limit = None if task.episode_seconds is None else int(np.ceil(task.episode_seconds / self._live.period - 1e-9))
        self._start, self._reached = self._live.tick, False
        self._judge.draw_goals(np.zeros(1, np.int64), np.ones(1, np.bool_))
        self.observation_space = self._judge.space(self._judge.observation(self._live_state()), box(
            self._live.sensor_channels, self._live.rows, self._live.columns))
        self.action_space = box(self._live.actuator_channels, self._live.rows, self._live.columns)

    def _live_state(self) -> State:
        s = self._live
        ticks = np.array([s.tick - self._start])
        return self._judge.state({name: values[None] for name, values in s.sensors.items()},
                                 {name: values[None] for name, values in s.actuators.items()},
                                 ticks * s.period, ticks, s.period, None, (), {}, (s.rows, s.columns))

    def reset(self, *, seed: int | None = None, options: dict[str, Any] | None = None) -> tuple[Any, Info]:
        super().reset(seed=seed)
        checked_options(options)
        if self._live is None:
            drawn = draw_seed(self.np_random) if seed is None else seed
            observation, infos = self._envs.reset(seed=[drawn])
            return _first(observation), _first_infos(infos)
        self._live.reset(seed)
        self._start = self._live.tick
        self._judge.draw_goals(self.np_random.integers(2**31, size=1), np.ones(1, np.bool_))
        state = self._live_state()
        self._reached = bool(self._judge.starts_with_success(state)[0])
        return _first(self._judge.observation(state)), self._live_info()

    def _live_info(self) -> Info:
        return {**self._live.info, **{name: values[0] for name, values in self._judge.goals.items()}, "success": self._reached}

    def step(self, action: ArrayLike | None = None) -> tuple[Any, float, bool, bool, Info]:
        """action: None if a controller commands the actuators."""
        if self._live is None:
            observation, rewards, terminated, truncated, infos = self._envs.step(
                None if action is None else real_array("the action", action)[None])
            if "error" in infos:
                raise _core.Error(str(infos["error"][0]))
            return _first(observation), float(rewards[0]), bool(terminated[0]), bool(truncated[0]), _first_infos(infos)
        given: Any = action
        self._live._targets[...] = _commands(real_array("the action", given), self._live.actuator_channels)
        _, closed, _ = self._live.step()
        state = self._live_state()
        judged = self._judge.judge(state)
        if errors := self._judge.not_finite(judged, np.ones(1, np.bool_)):
            raise _core.Error(errors[0])
        reward, failure = float(judged["reward"][0]), bool(judged["failure"][0])
        self._reached |= bool(judged["success"][0])
        truncated = self._limit is not None and self._live.tick - self._start >= self._limit
        info = self._live_info()
        if self._reached or failure or truncated or closed:
            info["metrics"] = {name: float(values[0]) for name, values in self._judge.metrics(state).items()}
        return _first(self._judge.observation(state)), reward, self._reached or failure or closed, truncated, info

    @property
    def worlds(self) -> TaskVectorEnv:
        """The vector environment of one world that computes this one: its parameters, objects and pushes."""
        return self._envs

    def render(self) -> Any:
        pictures = None if self._live is not None else self._envs.render()
        return pictures[0] if pictures else None

    def close(self) -> None:
        if self._live is not None:
            self._live.close()
        else:
            self._envs.close()
        self._live = Closed()

    def __reduce__(self) -> tuple[Any, ...]:
        if self._live is not None:
            raise TypeError("an environment of a live surface cannot be pickled: attach where the surface is needed")
        return _unpickled_env, (copy.copy(self.__dict__),)


def _unpickled_env(members: dict[str, Any]) -> TaskEnv:
    env = TaskEnv.__new__(TaskEnv)
    env.__dict__.update(members)
    return env


def _first(observation: Any) -> Any:
    return _of_world(observation, 0)


def _of_world(observation: Any, world: int) -> Any:
    """An array also where each world has one number."""
    if isinstance(observation, dict):
        return {name: np.asarray(values[world]) for name, values in observation.items()}
    return np.asarray(observation[world])


def _first_infos(infos: Info) -> Info:
    out: Info = {}
    for name, values in infos.items():
        if name.startswith("_"):
            continue
        if isinstance(values, dict):
            out[name] = _first_infos(values)
        else:
            out[name] = values[0].item() if values[0].ndim == 0 and hasattr(values[0], "item") else values[0]
    return out
