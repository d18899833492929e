"""One world as a Gymnasium environment."""
from __future__ import annotations

import os
from collections.abc import Callable, Sequence

import gymnasium
import numpy as np

from ._surface import Closed, checked_options, draw_seed, finite, real_array
from ._tasks import task_file


def box(channels, rows, columns):
    """The space of several channels: planes × rows × columns."""
    low = np.concatenate([np.full(c.components, c.minimum) for c in channels] or [np.zeros(0)])
    high = np.concatenate([np.full(c.components, c.maximum) for c in channels] or [np.zeros(0)])
    shape = (len(low), rows, columns)
    return gymnasium.spaces.Box(np.broadcast_to(low[:, None, None], shape).astype(np.float32),
                                np.broadcast_to(high[:, None, None], shape).astype(np.float32), shape, np.float32)


class Env(gymnasium.Env):
    """An experiment, or a surface that another process runs, as an environment.

    experiment: a script, computed in this process; reward, success and episode length are the script's.
    shm: the name of a live surface instead, such as hardware or `smartsurf run --shm NAME`, of which this becomes the
        controller. It goes on at a reset and takes no seed. timeout: seconds to wait for it and for its frames.
    reward, done: functions of (observation, action) and of (observation): the reward instead of the script's, and
        another end of the episode. gymnasium.wrappers.TimeLimit gives an episode a length.
    strict: refuse actions with NaN or infinite values. Otherwise NaN becomes the channel's safe value, infinite values are
        clamped, and `info["nonfinite_actions"]` counts both.

    Observations and actions are float32 arrays of planes × rows × columns: all sensor channels, one after the other,
    and all actuator channels, in their units; `simulation.sensor_channels` and `.actuator_channels` name them.
    `simulation` is the Simulation, or what `smartsurf.attach` returns. `info` has `seed`, `success`, the values of
    info{}, and at the end of an episode `metrics`; of a live surface `tick`, `time` and `surface_closed`, which ends
    the episode.
    """
    metadata = {"render_modes": ["rgb_array", "human"], "render_fps": 60}

    def __init__(self, experiment: str | os.PathLike | None = None, set: dict | None = None, threads: int = 1,
                 engine: str | None = None, render_mode: str | None = None, render_size: tuple[int, int] = (640, 400),
                 camera: str = "iso", extensions: Sequence[str | os.PathLike] = (), *, shm: str | None = None,
                 timeout: float = 30.0, reward: Callable[[np.ndarray, np.ndarray], float] | None = None,
                 done: Callable[[np.ndarray], bool] | None = None, strict: bool = False):
        if (experiment is None) == (shm is None):
            raise ValueError("give either an experiment or shm, the name of a live surface")
        if render_mode not in (None, *self.metadata["render_modes"]):
            raise ValueError(f"render_mode = {render_mode!r}: must be None, 'rgb_array' or 'human'")
        if shm is None:
            from ._simulation import Simulation
            self.simulation = Simulation(experiment, set=set, threads=threads, engine=engine, extensions=extensions)
        else:
            if render_mode is not None:
                raise ValueError(f"render_mode = {render_mode!r}: a live surface has no picture; must be None")
            from ._live import LiveSurface
            self.simulation = LiveSurface(shm, timeout)
        self._live, self._reward, self._done, self._strict = shm is not None, reward, done, strict
        s = self.simulation
        self.observation_space = box(s.sensor_channels, s.rows, s.columns)
        self.action_space = box(s.actuator_channels, s.rows, s.columns)
        self.metadata = {**self.metadata, "render_fps": round(1 / s.period)}
        self.render_mode, self._render_size, self._camera, self._window = render_mode, render_size, camera, None

    def reset(self, *, seed: int | None = None, options: dict | None = None) -> tuple[np.ndarray, dict]:
        checked_options(options)
        super().reset(seed=seed)
        self.simulation.reset(draw_seed(self.np_random) if seed is None and not self._live else seed)
        self._show()
        return self._observation(), self._info()

    def step(self, action: np.ndarray) -> tuple[np.ndarray, float, bool, bool, dict]:
        s = self.simulation
        action = real_array("the action", action)
        if action.shape != s._targets.shape:
            raise ValueError(f"the action has shape {action.shape}: must be {s._targets.shape}")
        nonfinite = finite("the action", action, self._strict)
        s._targets[...] = action
        reward, terminated, truncated = s.step()
        observation = self._observation()
        if self._reward is not None:
            reward = float(self._reward(observation, action))
        if self._done is not None:
            terminated = bool(self._done(observation)) or terminated
        info = self._info(not self._live and s._success, nonfinite)
        if (terminated or truncated) and not self._live:
            info["metrics"] = s.finish()
        self._show()
        return observation, reward, terminated, truncated, info

    def _observation(self):
        return self.simulation._observation.copy()

    def _info(self, success=False, nonfinite=0):
        script = {} if self._live else {"seed": self.simulation.seed, "success": bool(success)}
        return {**script, "nonfinite_actions": nonfinite, **self.simulation.info}

    def render(self) -> np.ndarray | None:
        if self.render_mode == "rgb_array":
            return self.simulation.render(*self._render_size, self._camera)
        return None

    def _show(self):
        if self.render_mode != "human":
            return
        if self._window is None:
            self._window = _Window(*self._render_size)
        self._window.show(self.simulation.render(*self._render_size, self._camera))

    def close(self):
        if self._window is not None:
            self._window.close()
            self._window = None
        if self._live:
            self.simulation.close()
        self.simulation = Closed()


class _Window:
    """The window of render_mode="human"; Tk is part of Python."""

    def __init__(self, width, height):
        try:
            import tkinter
            self._root = tkinter.Tk()
        except Exception as error:
            raise RuntimeError(f"render_mode='human' needs Tk and a display ({error}); use 'rgb_array'") from None
        self._root.title("smartsurf")
        self._image = tkinter.PhotoImage(master=self._root, width=width, height=height)
        tkinter.Label(self._root, image=self._image, borderwidth=0).pack()

    def show(self, pixels):
        height, width, _ = pixels.shape
        self._image.configure(data=b"P6 %d %d 255 " % (width, height) + pixels.tobytes())
        self._root.update()

    def close(self):
        self._root.destroy()


def make(task, **arguments):
    """The entry point of the tasks' Gymnasium ids."""
    return Env(task_file(task), **arguments)
