"""One world as a Gymnasium environment."""
from __future__ import annotations

import os
import pathlib
import time
import warnings
from collections.abc import Callable, Sequence
from typing import TYPE_CHECKING, Any

import gymnasium
import numpy as np
from numpy.typing import ArrayLike, NDArray

from ._files import folder_of_episodes
from ._surface import Channel, Closed, FloatArray, checked_options, draw_seed, finite, real_array
from ._tasks import task_file

if TYPE_CHECKING:
    from ._files import PathName
    from ._picture import CameraLike
    from ._simulation import Options, Simulation

Info = dict[str, Any]


def box(channels: Sequence[Channel], rows: int, columns: int) -> gymnasium.spaces.Box[np.float32]:
    """The space of several channels: planes × rows × columns."""
    low = np.concatenate([np.full(c.components, c.minimum) for c in channels] or [np.zeros(0)])
    high = np.concatenate([np.full(c.components, c.maximum) for c in channels] or [np.zeros(0)])
    shape = (len(low), rows, columns)
    return gymnasium.spaces.Box(np.broadcast_to(low[:, None, None], shape).astype(np.float32),
                                np.broadcast_to(high[:, None, None], shape).astype(np.float32), shape, np.float32)


def random_streams(space: gymnasium.Space[Any]) -> list[Any]:
    """The generators that a space draws from, for a copy; those of a Dict's spaces follow its own."""
    inner = space.spaces.values() if isinstance(space, gymnasium.spaces.Dict) else ()
    return [space._np_random, *(stream for each in inner for stream in random_streams(each))]


def set_random_streams(space: gymnasium.Space[Any], streams: list[Any]) -> None:
    space._np_random, *rest = streams
    for each in space.spaces.values() if isinstance(space, gymnasium.spaces.Dict) else ():
        count = len(random_streams(each))
        set_random_streams(each, rest[:count])
        rest = rest[count:]


class Env(gymnasium.Env[FloatArray, ArrayLike]):
    """An experiment, or a surface that another process runs, as an environment.

    experiment: a script, computed in this process; reward, success and episode length are the script's.
    shm: the name of a live surface instead, such as hardware or `smartsurf run --shm NAME`, of which this becomes the
        controller. It goes on at a reset and takes no seed. timeout: seconds to wait for it and for its frames.
    reward, done: functions of (observation, action) and of (observation): the reward instead of the script's, and
        another end of the episode. gymnasium.wrappers.TimeLimit gives an episode a length.
    record: a folder, in which each episode is recorded as episode-000001.h5, … (docs/recordings.md). A folder
        with such files is refused. A copy does not record, and a warning says so; nor does a child of fork().
    strict: refuse actions with NaN or infinite values. Otherwise NaN becomes the channel's safe value, infinite values are
        clamped, and `info["nonfinite_actions"]` counts both.

    Observations and actions are float32 arrays of planes × rows × columns: all sensor channels, one after the other,
    and all actuator channels, in their units; `simulation.sensor_channels` and `.actuator_channels` name them.
    `simulation` is the Simulation, or what `smartsurf.attach` returns. `info` has `seed`, `success`, the values of
    info{}, and at the end of an episode `metrics`; of a live surface `tick`, `time` and `surface_closed`, which ends
    the episode.
    """
    metadata = {"render_modes": ["rgb_array", "human"], "render_fps": 60}

    simulation: Simulation  # with shm, a LiveSurface, which has the same arrays

    def __init__(self, experiment: PathName | None = None, set: Options | None = None, threads: int = 1,
                 engine: str | None = None, render_mode: str | None = None, render_size: tuple[int, int] = (640, 400),
                 camera: CameraLike = "iso", extensions: Sequence[PathName] = (), *, shm: str | None = None,
                 timeout: float = 30.0, reward: Callable[[FloatArray, NDArray[Any]], float] | None = None,
                 done: Callable[[FloatArray], bool] | None = None, strict: bool = False, source: str | None = None,
                 record: PathName | None = None):
        if (experiment is None) == (shm is None):
            raise ValueError("give either an experiment or shm, the name of a live surface")
        if shm is not None and record is not None:
            raise ValueError("record: the process of a live surface records it: smartsurf run --record FILE")
        if render_mode not in (None, *self.metadata["render_modes"]):
            raise ValueError(f"render_mode = {render_mode!r}: must be None, 'rgb_array' or 'human'")
        self._record = None if record is None else pathlib.Path(folder_of_episodes(record, "episode-[0-9]*.h5"))
        if experiment is not None:
            from ._simulation import Simulation
            self.simulation = Simulation(experiment, set=set, threads=threads, engine=engine, extensions=extensions,
                                         source=source)
        else:
            if render_mode is not None:
                raise ValueError(f"render_mode = {render_mode!r}: a live surface has no picture; must be None")
            from ._live import LiveSurface
            assert shm is not None
            self.simulation = LiveSurface(shm, timeout)  # type: ignore[assignment]
        self._live, self._reward, self._done, self._strict = shm is not None, reward, done, strict
        self._episodes, self._process = 0, os.getpid()
        self._arguments: Info = dict(render_mode=render_mode, render_size=render_size, camera=camera, reward=reward, done=done,
                                     strict=strict)
        s = self.simulation
        self.observation_space = box(s.sensor_channels, s.rows, s.columns)
        self.action_space = box(s.actuator_channels, s.rows, s.columns)
        self.metadata = {**self.metadata, "render_fps": round(1 / s.period)}
        self.render_mode, self._render_size, self._camera = render_mode, render_size, camera
        self._window: _Window | None = None

    def reset(self, *, seed: int | None = None, options: Info | None = None) -> tuple[FloatArray, Info]:
        checked_options(options)
        super().reset(seed=seed)
        if self._live:
            self.simulation.reset(seed)
        else:
            self.simulation.reset(draw_seed(self.np_random) if seed is None else seed)
            if self._record is not None and os.getpid() == self._process:
                self._episodes += 1
                self._record.mkdir(parents=True, exist_ok=True)
                self.simulation.record(self._record / f"episode-{self._episodes:06d}.h5")
        self._show()
        return self._observation(), self._info()

    def step(self, action: ArrayLike) -> tuple[FloatArray, float, bool, bool, Info]:
        s = self.simulation
        action = real_array("the action", action)
        if action.shape != s._targets.shape:
            raise ValueError(f"the action has shape {action.shape}: must be {s._targets.shape}")
        nonfinite = finite("the action", np.asarray(action, np.float32), self._strict)
        s._targets[...] = action
        reward, terminated, truncated = s.step()
        observation = self._observation()
        if self._reward is not None:
            reward = float(self._reward(observation, action))
        if self._done is not None:
            terminated = bool(self._done(observation)) or terminated
        info = self._info(nonfinite)
        if (terminated or truncated) and not self._live:
            info["metrics"] = s.finish()
            info["success"] = s.success  # of which on_finish may decide
            s.stop_recording()
        self._show()
        return observation, reward, terminated, truncated, info

    def _observation(self) -> FloatArray:
        return self.simulation._observation.copy()

    def _info(self, nonfinite: int = 0) -> Info:
        script = {} if self._live else {"seed": self.simulation.seed, "success": self.simulation.success}
        return {**script, "nonfinite_actions": nonfinite, **self.simulation.info}

    def __reduce__(self) -> tuple[Any, ...]:
        if self._live:
            raise TypeError("an Env of a live surface cannot be pickled: attach where the surface is needed")
        if self._record is not None:
            warnings.warn("a copy of this environment does not record: its folder has the episodes of this one", stacklevel=2)
        return _unpickled, (type(self), self.simulation, self._arguments, self._np_random, self._np_random_seed,
                            random_streams(self.action_space), random_streams(self.observation_space))

    def render(self) -> Any:
        if self.render_mode == "rgb_array":
            return self.simulation.render(*self._render_size, self._camera)
        return None

    def _show(self) -> None:
        if self.render_mode == "human":
            if self._window is None:
                self._window = _Window(self.simulation, self._render_size, self._camera)
            self._window.show(self.simulation)

    def close(self) -> None:
        if self._window is not None:
            self._window.close()
            self._window = None
        if self._live:
            self.simulation.close()  # type: ignore[attr-defined]
        elif not isinstance(self.simulation, Closed):
            self.simulation.stop_recording()
        self.simulation = Closed()  # type: ignore[assignment]


def _unpickled(cls: type[Env], simulation: Simulation, arguments: Info, random: Any, seed: int | None, of_actions: list[Any],
               of_observations: list[Any]) -> Env:
    env = cls(**simulation._arguments, **arguments)
    env.simulation = simulation
    env._np_random, env._np_random_seed = random, seed
    set_random_streams(env.action_space, of_actions)
    set_random_streams(env.observation_space, of_observations)
    return env


class _Window:
    """The simulator's own window, of render_mode="human", in real time. When the user closes it, the episode goes on."""

    def __init__(self, simulation: Simulation, size: tuple[int, int], camera: CameraLike):
        from . import _core
        self._core: _core.Window | None = _core.Window(simulation._core, os.path.basename(simulation.experiment), *size,
                                                       simulation._camera(camera))
        self._due = time.monotonic()

    def show(self, simulation: Simulation) -> None:
        if self._core is None:
            return
        self._due = max(self._due + simulation.period, time.monotonic() - simulation.period)
        time.sleep(max(0.0, self._due - time.monotonic()))
        if not self._core.show(simulation._core):
            self._core = None

    def close(self) -> None:
        self._core = None


def make(task: str, **arguments: Any) -> Env:
    """The entry point of the tasks' Gymnasium ids."""
    return Env(task_file(task), **arguments)
