"""Many worlds as one Gymnasium vector environment."""
from __future__ import annotations

import os
from collections.abc import Sequence

import gymnasium
import numpy as np
from gymnasium.vector import AutoresetMode

from . import _core
from ._env import box
from ._simulation import channels, engine_name, load_extensions, not_picklable, overrides, state_bytes, thread_count
from ._surface import Closed, checked_options, checked_seed, draw_seed, finite, real_array, whole
from ._tasks import task_file

_AUTORESET = {AutoresetMode.NEXT_STEP: 0, AutoresetMode.SAME_STEP: 1, AutoresetMode.DISABLED: 2}


class VectorEnv(gymnasium.vector.VectorEnv):
    """`num_envs` worlds of one experiment in this process, computed by `threads` threads.

    Observations have shape (num_envs, planes, rows, columns), actions (num_envs, channels, rows, columns), both
    float32, in the channels' units; row 0 is north, column 0 west. World i computes the same as an `Env` with its
    seeds. reset(seed=s) gives the worlds the seeds s, s + 1, …; later episodes have seeds derived from these, so that
    a seed determines all that follows.

    threads: default: one per core. copy: whether step() and reset() return copies; without, all arrays that they return,
    those of `info` included, are the same ones each time, which the next call overwrites. autoreset_mode: as
    Gymnasium's; NEXT_STEP by default. max_episode_steps: truncates episodes, besides the script's episode{}. strict: as of
    Env.
    `info` is that of Gymnasium's SyncVectorEnv: arrays over the worlds of `seed`, `success`, `nonfinite_actions` and the values of info{}, and
    for the worlds whose episode has ended `metrics`, a dict of arrays. With SAME_STEP these describe the new episode, and
    `final_obs` and `final_info` the one that has ended, with its `metrics`.
    A world that fails, by an error of the script or a state that is not finite, ends its episode: it is truncated, its
    reward and the values of info{} are NaN, and `error` in place of `metrics` says why. The other worlds go on, and the next
    reset brings it back. If all worlds fail, or one with strict=True, step() raises Error.
    """
    metadata = {"render_modes": ["rgb_array"], "render_fps": 60}

    def __init__(self, experiment: str | os.PathLike, num_envs: int = 1, threads: int | None = None,
                 set: dict | None = None, engine: str | None = None, seed: int | None = None, copy: bool = True,
                 autoreset_mode: AutoresetMode | str = AutoresetMode.NEXT_STEP, render_mode: str | None = None,
                 render_size: tuple[int, int] = (640, 400), camera: str = "iso",
                 extensions: Sequence[str | os.PathLike] = (), max_episode_steps: int | None = None, strict: bool = False):
        load_extensions(extensions)
        num_envs = whole("num_envs", num_envs, 1)
        if max_episode_steps is not None:
            max_episode_steps = whole("max_episode_steps", max_episode_steps, 1)
        threads = len(os.sched_getaffinity(0)) if threads is None else thread_count(threads)
        if render_mode not in (None, *self.metadata["render_modes"]):
            raise ValueError(f"render_mode = {render_mode!r}: must be None or 'rgb_array'")
        autoreset_mode = AutoresetMode(autoreset_mode)
        self.num_envs = num_envs
        self._batch = _core.Batch(os.fspath(experiment), engine_name(engine), overrides(set), self._seeds(seed), threads,
                                  _AUTORESET[autoreset_mode], max_episode_steps)
        d = self._batch.describe()
        self.rows, self.columns, self.pitch, self.period = d["rows"], d["columns"], d["pitch"], d["period"]
        self.sensor_channels, self.actuator_channels = channels(d)
        self.single_observation_space = box(self.sensor_channels, self.rows, self.columns)
        self.single_action_space = box(self.actuator_channels, self.rows, self.columns)
        batched = gymnasium.vector.utils.batch_space
        self.observation_space = batched(self.single_observation_space, num_envs)
        self.action_space = batched(self.single_action_space, num_envs)
        self.metadata = {**self.metadata, "autoreset_mode": autoreset_mode, "render_fps": round(1 / self.period)}
        self.render_mode, self._render_size, self._camera = render_mode, render_size, camera
        self._strict = strict
        self._copy, self._same_step = copy, autoreset_mode == AutoresetMode.SAME_STEP
        self._rewards = np.zeros(num_envs)
        self._terminated, self._truncated = np.zeros((2, num_envs), np.bool_)
        self._observations, state, self._fields = self._state(num_envs, d["info"])
        self._final, final_state, self._final_fields = self._state(num_envs if self._same_step else 0, d["info"])
        self._batch.bind(state, final_state, self._rewards, self._terminated.view(np.uint8), self._truncated.view(np.uint8))
        every = np.ones(num_envs, np.bool_)
        every.flags.writeable = False
        # A step copies this dict, and the arrays if it is to return copies.
        self._every_info = {key: value for name, values in self._fields.items()
                            for key, value in ((name, values), ("_" + name, every))}

    def _state(self, worlds, info):
        """Arrays that the batch writes: the observations, all of them, and the values of `info` by name."""
        observations = np.zeros((worlds, *self.single_observation_space.shape), np.float32)
        values, seeds = np.zeros((worlds, self._batch.info_size)), np.zeros(worlds, np.uint64)
        success, nonfinite = np.zeros(worlds, np.bool_), np.zeros(worlds, np.int64)
        fields, first = {"seed": seeds.view(np.int64), "success": success, "nonfinite_actions": nonfinite}, 0
        for name, size in info:
            fields[name] = values[:, first] if size == 1 else values[:, first:first + size]
            first += size
        return observations, (observations, values, seeds, success.view(np.uint8), nonfinite), fields

    def _seeds(self, seed):
        if seed is None:
            return [draw_seed(self.np_random) for _ in range(self.num_envs)]
        if isinstance(seed, (int, np.integer)):
            return [checked_seed(seed) + i for i in range(self.num_envs)]
        if not isinstance(seed, (list, tuple, np.ndarray)):
            raise ValueError(f"seed = {seed!r}: must be a whole number from 0, or one per world")
        if len(seed) != self.num_envs:
            raise ValueError(f"seed has {len(seed)} values: must have one per world, {self.num_envs}")
        return [draw_seed(self.np_random) if s is None else checked_seed(s) for s in seed]

    def reset(self, *, seed: int | list[int | None] | None = None,
              options: dict | None = None) -> tuple[np.ndarray, dict]:
        if seed is None or isinstance(seed, (int, np.integer)):
            super().reset(seed=seed if seed is None else int(seed))
        mask = np.ones(self.num_envs, np.bool_)
        if "reset_mask" in checked_options(options, "reset_mask"):
            mask = np.asarray(options["reset_mask"])
            if mask.shape != (self.num_envs,) or mask.dtype != np.bool_ or not mask.any():
                raise ValueError("options['reset_mask'] must be an array of bool, one per world, with one True")
        self._batch.reset(self._seeds(seed), mask.astype(np.uint8).tolist())
        return self._observed(), self._infos() if mask.all() else _of_worlds(self._fields, mask)

    def step(self, actions: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray, dict]:
        if self._strict:
            finite("the array of actions", real_array("the array of actions", actions), True)
        ended = self._batch.step(actions)
        if ended is None:  # not an array of the right type and shape
            actions = real_array("the array of actions", actions)
            if actions.shape != self.action_space.shape:
                raise ValueError(f"the actions have shape {actions.shape}: must be {self.action_space.shape}")
            ended = self._batch.step(np.ascontiguousarray(actions, np.float32))
        infos = self._infos()
        if ended:
            self._add_final(infos, self._terminated | self._truncated)
        if not self._copy:
            return self._observations, self._rewards, self._terminated, self._truncated, infos
        return (self._observations.copy(), self._rewards.copy(), self._terminated.copy(), self._truncated.copy(), infos)

    def _observed(self):
        return self._observations.copy() if self._copy else self._observations

    def _infos(self):
        infos = self._every_info.copy()
        if self._copy:
            for name, values in self._fields.items():
                infos[name] = values.copy()
        return infos

    def _add_final(self, infos, ended):
        """Adds what an episode that has ended leaves, as Gymnasium's SyncVectorEnv: its metrics, and where the same step has
        reset the world its last observation and info."""
        final = _of_worlds(self._final_fields, ended) if self._same_step else infos
        for i in np.flatnonzero(ended):
            error = self._batch.error(int(i))
            if error and self._strict:
                raise _core.Error(f"world {i}: {error}")
            self._add_info(final, {"error": error} if error else {"metrics": self._batch.final_metrics(int(i))}, i)
        if self._same_step:
            observations = np.full(self.num_envs, None, object)
            for i in np.flatnonzero(ended):
                observations[i] = self._final[i].copy()
            infos.update(final_obs=observations, _final_obs=ended, final_info=final, _final_info=ended.copy())

    def save(self, world: int) -> bytes:
        """The state of one world, as Simulation.save()."""
        return self._batch.save(whole("world", world, 0))

    def restore(self, world: int, state: bytes) -> np.ndarray:
        """Continues one world from a state, that of any world or Simulation of the same experiment and options. Returns
        its observation."""
        self._batch.restore(whole("world", world, 0), state_bytes(state))
        return self._observations[world].copy() if self._copy else self._observations[world]

    def state_hash(self, world: int) -> int:
        """The state hash of one world, as Simulation.state_hash."""
        return self._batch.state_hash(whole("world", world, 0))

    def render(self) -> list[np.ndarray] | None:
        """A list with a picture of each world (rgb_array), or None."""
        if self.render_mode is None:
            return None
        return [self._batch.render(i, *self._render_size, self._camera) for i in range(self.num_envs)]

    def close_extras(self, **arguments):
        self._batch = Closed()

    __reduce_ex__ = not_picklable


def _of_worlds(fields, mask):
    """Copies of the fields of an info with the values of some worlds, and masks that say which."""
    infos = {}
    for name, values in fields.items():
        infos[name], infos["_" + name] = np.zeros_like(values), mask.copy()
        infos[name][mask] = values[mask]
    return infos


def make(task, num_envs=1, **arguments):
    """The vector entry point of the tasks' Gymnasium ids."""
    return VectorEnv(task_file(task), num_envs, **arguments)
