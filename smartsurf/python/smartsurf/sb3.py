"""Many worlds as stable-baselines3 has environments: PPO("MlpPolicy", smartsurf.sb3.VecEnv(envs))."""
from __future__ import annotations

import copy
from collections.abc import Sequence
from typing import Any

import numpy as np
from gymnasium.vector import AutoresetMode

from ._vector import VectorEnv, finite_rewards

try:
    from stable_baselines3.common import vec_env
except ImportError as error:
    raise ImportError("smartsurf.sb3 needs stable-baselines3: pip install stable-baselines3") from error


class Batch(vec_env.VecEnv):  # type: ignore[misc]  # has no types where it is missing
    """What stable-baselines3 asks of environments that one VectorEnv, `env`, computes. Subclasses have reset(), step_async() and
    step_wait()."""
    env: VectorEnv

    def close(self) -> None:
        self.env.close()

    def env_is_wrapped(self, wrapper_class: Any, indices: Any = None) -> list[bool]:
        return [False] * self.num_envs

    def get_attr(self, name: str, indices: Any = None) -> list[Any]:
        return [getattr(self, name, None)] * self.num_envs

    def set_attr(self, name: str, value: Any, indices: Any = None) -> None:
        raise NotImplementedError

    def env_method(self, name: str, *arguments: Any, indices: Any = None, **keywords: Any) -> list[Any]:
        raise NotImplementedError


class VecEnv(Batch):
    """All worlds of a VectorEnv, or of a Task's make_vec(), made with autoreset_mode="SameStep" as stable-baselines3 resets.

    Observations and actions are those of `env`, infos one dict for each world: its values, and at the end of an episode
    `metrics`, `terminal_observation` and `TimeLimit.truncated`. The episode of a world that fails is truncated with reward 0;
    `error` in place of `metrics` says why, as does a warning. All are copies, also those of an `env` with copy=False, because
    stable-baselines3 keeps an observation until the step after it."""

    def __init__(self, env: VectorEnv):
        if env.metadata["autoreset_mode"] != AutoresetMode.SAME_STEP:
            raise ValueError("smartsurf.sb3.VecEnv needs an environment made with autoreset_mode='SameStep'")
        self.env, self._actions = env, None
        super().__init__(env.num_envs, env.single_observation_space, env.single_action_space)

    def reset(self) -> Any:
        seeds: Sequence[int | None] = self._seeds
        observations, infos = self.env.reset(seed=None if seeds[0] is None else list(seeds))
        self.reset_infos = [_of_world(infos, i) for i in range(self.num_envs)]
        self._reset_seeds()
        return copy.deepcopy(observations)

    def step_async(self, actions: Any) -> None:
        self._actions = actions

    def step_wait(self) -> Any:
        observations, rewards, terminated, truncated, infos = self.env.step(self._actions)
        over = terminated | truncated
        each = [{} if over[i] else _of_world(infos, i) for i in range(self.num_envs)]
        for i in np.flatnonzero(over):
            each[i] = {**_of_world(infos["final_info"], int(i)), "terminal_observation": infos["final_obs"][i],
                       "TimeLimit.truncated": bool(truncated[i] and not terminated[i])}
        return copy.deepcopy(observations), finite_rewards(rewards, infos).astype(np.float32), over, each


def _of_world(infos: dict[str, Any], world: int) -> dict[str, Any]:
    """Copies of the values of one world."""
    out: dict[str, Any] = {}
    for name, values in infos.items():
        if name.startswith("_") or name in ("final_obs", "final_info") or not infos["_" + name][world]:
            continue
        out[name] = _of_world(values, world) if isinstance(values, dict) else copy.copy(values[world])
    return out
