"""A world whose agents are its cells, or blocks of cells, as a PettingZoo parallel environment."""
from __future__ import annotations

import os
import warnings
from collections.abc import Mapping, Sequence

import gymnasium
import numpy as np
import pettingzoo
from numpy.lib.stride_tricks import sliding_window_view

from ._env import box
from ._simulation import Simulation
from ._surface import Closed, draw_seed, finite, real_array, whole


class ParallelEnv(pettingzoo.ParallelEnv):
    """Each block of `block` × `block` cells is an agent, named "block_ROW_COLUMN" by its place among the blocks.

    An agent observes the sensors of its block and of `radius` cells around it, float32 of planes × side × side with
    side = block + 2·radius, zero beyond the table; it acts on its block: channels × block × block. All agents receive
    the script's reward, and their episode ends together. Arrays are in the channels' units; row 0 is north. strict: as of
    Env.
    """
    metadata = {"name": "smartsurf", "render_modes": ["rgb_array"], "is_parallelizable": True}

    def __init__(self, experiment: str | os.PathLike, block: int = 1, radius: int = 1, set: dict | None = None,
                 threads: int = 1, engine: str | None = None, render_mode: str | None = None,
                 extensions: Sequence[str | os.PathLike] = (), strict: bool = False):
        self.simulation = s = Simulation(experiment, set=set, threads=threads, engine=engine, extensions=extensions)
        block, radius = whole("block", block, 1), whole("radius", radius, 0)
        if s.rows % block or s.columns % block:
            raise ValueError(f"block = {block}: must divide {s.rows} rows and {s.columns} columns")
        self.render_mode = render_mode
        self._block, self._radius, self._strict = block, radius, strict
        self._places = {f"block_{r}_{c}": (r, c) for r in range(s.rows // block) for c in range(s.columns // block)}
        self.possible_agents = list(self._places)
        self.agents = []
        side = block + 2 * radius
        # Beyond the table an agent sees 0, which a channel's range may exclude.
        seen = box(s.sensor_channels, side, side)
        self._observation_space = gymnasium.spaces.Box(np.minimum(seen.low, 0), np.maximum(seen.high, 0))
        self._action_space = box(s.actuator_channels, block, block)
        planes = s._observation.shape[0]
        self._padded = np.zeros((planes, s.rows + 2 * radius, s.columns + 2 * radius), np.float32)
        self._windows = sliding_window_view(self._padded, (side, side), (1, 2))[:, ::block, ::block]
        self._random = np.random.default_rng()

    def observation_space(self, agent: str) -> gymnasium.spaces.Box:
        return self._observation_space

    def action_space(self, agent: str) -> gymnasium.spaces.Box:
        return self._action_space

    def reset(self, seed: int | None = None, options: dict | None = None) -> tuple[dict, dict]:
        if options:
            warnings.warn(f"options = {options!r}: this environment's reset() has no options", stacklevel=2)
        if seed is not None:
            self._random = np.random.default_rng(seed)
        self.simulation.reset(draw_seed(self._random) if seed is None else seed)
        self.agents = list(self.possible_agents)
        return self._observations(), self._each({"seed": self.simulation.seed, "success": False, "nonfinite_actions": 0,
                                                 **self.simulation.info})

    def step(self, actions: dict[str, np.ndarray]) -> tuple[dict, dict, dict, dict, dict]:
        s, b = self.simulation, self._block
        if not isinstance(actions, Mapping):
            raise ValueError(f"actions: a {type(actions).__name__}: must be a dict of agents and their actions")
        nonfinite = 0
        for agent, action in actions.items():
            if agent not in self._places:
                raise KeyError(f"actions: no agent {agent!r}; there are {self.possible_agents[0]} to "
                               f"{self.possible_agents[-1]}")
            r, c = self._places[agent]
            action = real_array(f"the action of {agent}", action)
            nonfinite += finite(f"the action of {agent}", action, self._strict)
            try:
                s._targets[:, r * b:(r + 1) * b, c * b:(c + 1) * b] = action
            except ValueError:
                raise ValueError(f"the action of {agent} has shape {action.shape}: must be "
                                 f"{self._action_space.shape}") from None
        reward, terminated, truncated = s.step()
        info = {"seed": s.seed, "success": bool(s._success), "nonfinite_actions": nonfinite, **s.info}
        if terminated or truncated:
            info["metrics"] = s.finish()
        result = (self._observations(), self._each(reward), self._each(terminated), self._each(truncated),
                  self._each(info))
        if terminated or truncated:
            self.agents = []
        return result

    def _observations(self):
        k, s = self._radius, self.simulation
        self._padded[:, k:k + s.rows, k:k + s.columns] = s._observation
        windows = self._windows.copy()
        return {agent: windows[:, r, c] for agent, (r, c) in self._places.items()}

    def _each(self, value):
        return {agent: value for agent in self.possible_agents}

    def close(self):
        self.simulation = Closed()

    def render(self):
        return self.simulation.render() if self.render_mode == "rgb_array" else None


def parallel_env(experiment: str | os.PathLike, **arguments) -> ParallelEnv:
    """A ParallelEnv; the arguments are its."""
    return ParallelEnv(experiment, **arguments)
