"""One world as a Gymnasium environment."""
from __future__ import annotations

import os

import gymnasium
import numpy as np

from ._simulation import Closed, Simulation, draw_seed, real_array
from ._tasks import task_file


def box(channels, rows, columns):
    """The space of several channels: planes × rows × columns."""
    low = np.concatenate([np.full(c.components, c.minimum) for c in channels] or [np.zeros(0)])
    high = np.concatenate([np.full(c.components, c.maximum) for c in channels] or [np.zeros(0)])
    shape = (len(low), rows, columns)
    return gymnasium.spaces.Box(np.broadcast_to(low[:, None, None], shape).astype(np.float32),
                                np.broadcast_to(high[:, None, None], shape).astype(np.float32), shape, np.float32)


class Env(gymnasium.Env):
    """An experiment as an environment. Reward, success and episode length are the script's (reward, success,
    episode).

    Observations and actions are float32 arrays of planes × rows × columns: all sensor channels, one after the other,
    and all actuator channels, in their units; `simulation.sensor_channels` and `.actuator_channels` name them.
    `info` has `seed`, `success`, the values of info{}, and at the end of an episode `metrics`.
    """
    metadata = {"render_modes": ["rgb_array", "human"], "render_fps": 60}

    def __init__(self, experiment: str | os.PathLike, set: dict | None = None, threads: int = 1,
                 engine: str | None = None, render_mode: str | None = None, render_size: tuple[int, int] = (640, 400),
                 camera: str = "iso"):
        if render_mode not in (None, *self.metadata["render_modes"]):
            raise ValueError(f"render_mode = {render_mode!r}: must be None, 'rgb_array' or 'human'")
        self.simulation = Simulation(experiment, set=set, threads=threads, engine=engine)
        s = self.simulation
        self.observation_space = box(s.sensor_channels, s.rows, s.columns)
        self.action_space = box(s.actuator_channels, s.rows, s.columns)
        self.metadata = {**self.metadata, "render_fps": round(1 / s.period)}
        self.render_mode, self._render_size, self._camera, self._window = render_mode, render_size, camera, None

    def reset(self, *, seed: int | None = None, options: dict | None = None) -> tuple[np.ndarray, dict]:
        super().reset(seed=seed)
        self.simulation.reset(draw_seed(self.np_random) if seed is None else seed)
        self._show()
        return self._observation(), self._info(False)

    def step(self, action: np.ndarray) -> tuple[np.ndarray, float, bool, bool, dict]:
        s = self.simulation
        action = real_array("the action", action)
        if action.shape != s._targets.shape:
            raise ValueError(f"the action has shape {action.shape}: must be {s._targets.shape}")
        s._targets[...] = action
        reward, terminated, truncated = s.step()
        info = self._info(s._success)
        if terminated or truncated:
            info["metrics"] = s.finish()
        self._show()
        return self._observation(), reward, terminated, truncated, info

    def _observation(self):
        return self.simulation._core.observation.copy()

    def _info(self, success):
        return {"seed": self.simulation.seed, "success": bool(success), **self.simulation.info}

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
