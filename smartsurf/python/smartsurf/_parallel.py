"""A world whose agents are its cells, or blocks of cells, as a PettingZoo parallel environment."""
from __future__ import annotations

import warnings
from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any, TypedDict

import gymnasium
import numpy as np
import pettingzoo
from numpy.typing import ArrayLike
from numpy.lib.stride_tricks import sliding_window_view

from ._env import box, random_streams, set_random_streams
from ._files import PathName
from ._simulation import Options, Simulation
from ._surface import Closed, FloatArray, draw_seed, finite, real_array, whole
from ._task import Task, TaskEnv, TaskVectorEnv

if TYPE_CHECKING:
    from typing_extensions import Unpack


class Arguments(TypedDict, total=False):
    """The arguments of ParallelEnv besides the experiment."""
    block: int
    radius: int
    set: Options | None
    threads: int
    engine: str | None
    render_mode: str | None
    extensions: Sequence[PathName]
    strict: bool


class ParallelEnv(pettingzoo.ParallelEnv):  # type: ignore[misc]
    """Each block of `block` × `block` cells is an agent, named "block_ROW_COLUMN" by its place among the blocks.

    An agent observes the sensors of its block and of `radius` cells around it, float32 of planes × side × side with
    side = block + 2·radius, zero beyond the table; it acts on its block: channels × block × block. All agents receive
    the script's reward, or that of a Task, and their episode ends together. Arrays are in the channels' units; row 0 is north. strict: as of
    Env.
    """
    metadata = {"name": "smartsurf", "render_modes": ["rgb_array"], "is_parallelizable": True}

    def __init__(self, experiment: PathName | Simulation | Task, block: int = 1, radius: int = 1, set: Options | None = None,
                 threads: int = 1, engine: str | None = None, render_mode: str | None = None,
                 extensions: Sequence[PathName] = (), strict: bool = False):
        s: Simulation | TaskVectorEnv
        self.task: TaskEnv | None = None
        if isinstance(experiment, Task):
            self.task = experiment.make(set=set, threads=threads, engine=engine, extensions=extensions)
            s = self.task.worlds
            self._seen, self._targets = s._observations[0], np.zeros(s._actions.shape[1:], np.float32)
        else:
            self.simulation = s = experiment if isinstance(experiment, Simulation) else Simulation(
                experiment, set=set, threads=threads, engine=engine, extensions=extensions)
            self._seen, self._targets = s._observation, s._targets
        self._rows, self._columns = s.rows, s.columns
        block, radius = whole("block", block, 1), whole("radius", radius, 0)
        if s.rows % block or s.columns % block:
            raise ValueError(f"block = {block}: must divide {s.rows} rows and {s.columns} columns")
        self.render_mode = render_mode
        self._block, self._radius, self._strict = block, radius, strict
        self._places = {f"block_{r}_{c}": (r, c) for r in range(s.rows // block) for c in range(s.columns // block)}
        self.possible_agents = list(self._places)
        self.agents: list[str] = []
        side = block + 2 * radius
        # Beyond the table an agent sees 0, which a channel's range may exclude.
        seen = box(s.sensor_channels, side, side)
        self._observation_space = gymnasium.spaces.Box(np.minimum(seen.low, 0), np.maximum(seen.high, 0))
        self._action_space = box(s.actuator_channels, block, block)
        planes = self._seen.shape[0]
        self._padded = np.zeros((planes, s.rows + 2 * radius, s.columns + 2 * radius), np.float32)
        self._windows = sliding_window_view(self._padded, (side, side), (1, 2))[:, ::block, ::block]
        self._random = np.random.default_rng()

    def observation_space(self, agent: str) -> gymnasium.spaces.Box[np.float32]:
        return self._observation_space

    def action_space(self, agent: str) -> gymnasium.spaces.Box[np.float32]:
        return self._action_space

    def reset(self, seed: int | None = None,
              options: dict[str, Any] | None = None) -> tuple[dict[str, FloatArray], dict[str, Any]]:
        if options:
            warnings.warn(f"options = {options!r}: this environment's reset() has no options", stacklevel=2)
        if seed is not None:
            self._random = np.random.default_rng(seed)
        drawn = draw_seed(self._random) if seed is None else seed
        self.agents = list(self.possible_agents)
        if self.task is not None:
            _, info = self.task.reset(seed=drawn)
            self._targets[...] = self.task.worlds._actions[0]
            return self._observations(), self._of_each(info)
        self.simulation.reset(drawn)
        return self._observations(), self._of_each({"seed": self.simulation.seed, "success": self.simulation.success,
                                                    "nonfinite_actions": 0, **self.simulation.info})

    def step(self, actions: Mapping[str, ArrayLike]) -> tuple[dict[str, FloatArray], dict[str, float], dict[str, bool],
                                                              dict[str, bool], dict[str, Any]]:
        b = self._block
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
                self._targets[:, r * b:(r + 1) * b, c * b:(c + 1) * b] = action
            except ValueError:
                raise ValueError(f"the action of {agent} has shape {action.shape}: must be "
                                 f"{self._action_space.shape}") from None
        info: dict[str, Any]
        if self.task is not None:
            _, reward, terminated, truncated, info = self.task.step(self._targets)
        else:
            s = self.simulation
            reward, terminated, truncated = s.step()
            info = {"seed": s.seed, "success": s.success, "nonfinite_actions": nonfinite, **s.info}
            if terminated or truncated:
                info["metrics"] = s.finish()
                info["success"] = s.success
        result = (self._observations(), self._each(reward), self._each(terminated), self._each(truncated),
                  self._of_each(info))
        if terminated or truncated:
            self.agents = []
        return result

    def _observations(self) -> dict[str, FloatArray]:
        k = self._radius
        self._padded[:, k:k + self._rows, k:k + self._columns] = self._seen
        windows = self._windows.copy()
        return {agent: windows[:, r, c] for agent, (r, c) in self._places.items()}

    def _each(self, value: Any) -> dict[str, Any]:
        return {agent: value for agent in self.possible_agents}

    def _of_each(self, info: dict[str, Any]) -> dict[str, dict[str, Any]]:
        """A dict for each agent."""
        return {agent: dict(info) for agent in self.possible_agents}

    def close(self) -> None:
        if self.task is not None:
            self.task.close()
        self.simulation = Closed()  # type: ignore[assignment]

    def __reduce__(self) -> tuple[Any, ...]:
        if self.task is not None:
            raise TypeError("a parallel environment of a task cannot be pickled: send the task")
        return _unpickled, (self._block, self._radius, self.render_mode, self._strict, self.simulation, self.agents,
                            self._random, random_streams(self._action_space), random_streams(self._observation_space))

    def render(self) -> Any:
        if self.render_mode != "rgb_array":
            return None
        if self.task is None:
            return self.simulation.render()
        return self.task.worlds._batch.render(0, 640, 400, ("iso", -1))


def _unpickled(block: int, radius: int, render_mode: str | None, strict: bool, simulation: Simulation, agents: list[str],
               random: np.random.Generator, of_actions: list[Any], of_observations: list[Any]) -> ParallelEnv:
    env = ParallelEnv(simulation, block, radius, render_mode=render_mode, strict=strict)
    env.agents, env._random = agents, random
    set_random_streams(env._action_space, of_actions)
    set_random_streams(env._observation_space, of_observations)
    return env


def parallel_env(experiment: PathName | Simulation | Task, **arguments: Unpack[Arguments]) -> ParallelEnv:
    """A ParallelEnv; the arguments are its."""
    return ParallelEnv(experiment, **arguments)
