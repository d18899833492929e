"""Many worlds as TorchRL has environments: Collector(smartsurf.torchrl.Env(envs), policy, …)."""
from __future__ import annotations

from typing import Any

import gymnasium
import numpy as np
from gymnasium.vector import AutoresetMode

from ._vector import VectorEnv, finite_rewards

try:
    import torch
    from tensordict import TensorDict
    from torchrl.data import Bounded, Categorical, Composite, Unbounded
    from torchrl.envs import EnvBase
except ImportError as error:
    raise ImportError("smartsurf.torchrl needs torchrl: pip install torchrl") from error


class Env(EnvBase):  # type: ignore[misc]  # has no types where it is missing
    """All worlds of a VectorEnv, or of a Task's make_vec(), made with autoreset_mode="Disabled": TorchRL says which to
    reset.

    The batch size is the number of worlds. `observation` and `action` are those of `env`, each part of a dict
    observation has its name; `success` says whether a world has reached its goal; `done`, `terminated` and `truncated`
    are Gymnasium's. The episode of a world that fails is truncated with reward 0, and a warning says why."""

    def __init__(self, env: VectorEnv):
        if env.metadata["autoreset_mode"] != AutoresetMode.DISABLED:
            raise ValueError("smartsurf.torchrl.Env needs an environment made with autoreset_mode='Disabled'")
        worlds = env.num_envs
        super().__init__(device="cpu", batch_size=[worlds])
        self.env = env
        self._first_seed: int | None = None
        space = env.observation_space
        spaces = space.spaces if isinstance(space, gymnasium.spaces.Dict) else {"observation": space}
        flag = Categorical(2, shape=(worlds, 1), dtype=torch.bool)
        seen = {name: _spec(of) for name, of in spaces.items()}
        self.observation_spec = Composite({**seen, "success": flag.clone()}, shape=(worlds,))
        self.action_spec = _spec(env.action_space)
        self.reward_spec = Unbounded(shape=(worlds, 1), dtype=torch.float32)
        ends = ("done", "terminated", "truncated")
        self.done_spec = Composite({name: flag.clone() for name in ends}, shape=(worlds,))

    def _tensors(self, observation: Any, success: Any, terminated: Any, truncated: Any, **more: Any) -> Any:
        values = dict(observation) if isinstance(observation, dict) else {"observation": observation}
        flags = {"success": success, "terminated": terminated, "truncated": truncated, "done": terminated | truncated}
        values.update({name: each[:, None] for name, each in flags.items()})
        return TensorDict({name: torch.from_numpy(np.array(value)) for name, value in {**values, **more}.items()},
                          batch_size=self.batch_size)

    def _reset(self, tensordict: Any = None, **arguments: Any) -> Any:
        mask = np.ones(self.env.num_envs, np.bool_)
        if tensordict is not None and "_reset" in tensordict.keys():
            mask = tensordict["_reset"].numpy().reshape(-1)
        observation, _ = self.env.reset(seed=self._first_seed, options={"reset_mask": mask})
        self._first_seed = None
        none = np.zeros(self.env.num_envs, np.bool_)
        return self._tensors(observation, none, none, none)

    def _step(self, tensordict: Any) -> Any:
        observation, rewards, terminated, truncated, infos = self.env.step(tensordict["action"].numpy())
        reward = finite_rewards(rewards, infos)[:, None].astype(np.float32)
        return self._tensors(observation, infos["success"], terminated, truncated, reward=reward)

    def _set_seed(self, seed: int | None) -> None:
        """The next reset gives the worlds the seeds seed, seed + 1, …"""
        self._first_seed = seed

    def close(self, **arguments: Any) -> None:
        self.env.close()
        super().close(**arguments)


def _spec(space: gymnasium.Space[Any]) -> Any:
    low, high = torch.from_numpy(np.array(getattr(space, "low"))), torch.from_numpy(np.array(getattr(space, "high")))
    if not bool(torch.isfinite(low).all() and torch.isfinite(high).all()):
        return Unbounded(shape=low.shape, dtype=low.dtype)
    return Bounded(low, high, shape=low.shape, dtype=low.dtype)
