"""Episodes of many worlds as a Minari data set, for learning from data."""
from __future__ import annotations

from typing import Any

import gymnasium
import numpy as np
from gymnasium.vector import AutoresetMode

from ._vector import Stepped, VectorEnv


class MinariCollector(gymnasium.vector.VectorWrapper):
    """Collects what it steps, world by world, for create_dataset(). Needs the package minari.

    envs: a VectorEnv, or what Task.make_vec() returns. Episodes count from their reset to their end; those that are cut off by
    another reset or by create_dataset() are truncated there, and those of a world that fails are left out. They are kept in
    memory: one step of 16×16 cells with two sensor planes takes 2 KiB and the action's size.
    """

    def __init__(self, envs: VectorEnv):
        try:
            from minari.data_collector import EpisodeBuffer
        except ImportError as error:
            raise ImportError("MinariCollector needs minari and h5py: pip install minari h5py") from error
        super().__init__(envs)
        self._buffer: Any = EpisodeBuffer
        self._mode = envs.metadata["autoreset_mode"]
        self._open: list[Any] = [None] * envs.num_envs  # None: before a reset, or after the end
        self._episodes: list[Any] = []

    def reset(self, *, seed: Any = None, options: dict[str, Any] | None = None) -> tuple[Any, dict[str, Any]]:
        observations, infos = self.env.reset(seed=seed, options=options)
        for i in map(int, np.flatnonzero(infos["_seed"])):
            self._end(i)
            self._begin(i, observations, infos)
        return observations, infos

    def step(self, actions: Any) -> Stepped:
        given = np.array(actions)
        observations, rewards, terminated, truncated, infos = self.env.step(actions)
        for i in range(self.env.num_envs):
            over = bool(terminated[i] or truncated[i])
            same_step = over and self._mode == AutoresetMode.SAME_STEP
            resets = same_step or self._open[i] is None and self._mode == AutoresetMode.NEXT_STEP
            if np.isnan(rewards[i]):
                self._open[i] = None
            elif self._open[i] is not None:
                last = infos["final_obs"][i] if same_step else _of(observations, i)
                self._add(i, last, given[i], float(rewards[i]), bool(terminated[i]), bool(truncated[i]))
            if over:
                self._end(i)
            if resets:
                self._begin(i, observations, infos)
        return observations, rewards, terminated, truncated, infos

    def _begin(self, world: int, observations: Any, infos: dict[str, Any]) -> None:
        if "error" in infos and infos["_error"][world]:  # it has not started
            return
        first = _of(observations, world)
        of_each = {name: [values] for name, values in first.items()} if isinstance(first, dict) else [first]
        self._open[world] = self._buffer(id=None, seed=int(infos["seed"][world]), observations=of_each, actions=[])

    def _add(self, world: int, observation: Any, action: Any, reward: float, terminated: bool, truncated: bool) -> None:
        episode = self._open[world]
        if isinstance(observation, dict):
            for name, values in observation.items():
                episode.observations[name].append(np.array(values))
        else:
            episode.observations.append(np.array(observation))
        episode.actions.append(np.array(action))
        episode.rewards.append(reward)
        episode.terminations.append(terminated)
        episode.truncations.append(truncated)

    def _end(self, world: int) -> None:
        """Keeps the open episode, if it has a step."""
        episode, self._open[world] = self._open[world], None
        if episode is not None and episode.rewards:
            if not episode.terminations[-1]:
                episode.truncations[-1] = True
            self._episodes.append(episode)

    def create_dataset(self, dataset_id: str, **keywords: Any) -> Any:
        """Writes the episodes as the data set DATASET_ID, such as "table/flat-v0", to Minari's folder (MINARI_DATASETS_PATH), and
        returns it. The next reset starts another one. If Minari raises, the episodes stay for the next call. keywords: those of minari.create_dataset_from_buffers, such as
        algorithm_name, author, description and env, a Gymnasium id."""
        import dataclasses

        import minari
        for i in range(self.env.num_envs):
            self._end(i)
        if not self._episodes:
            raise ValueError("create_dataset: there is no episode; call reset() and step()")
        spaces = dict(observation_space=self.env.single_observation_space, action_space=self.env.single_action_space)
        dataset = minari.create_dataset_from_buffers(
            dataset_id, [dataclasses.replace(episode, id=k) for k, episode in enumerate(self._episodes)], jpeg_encoding=False,
            **{**spaces, **keywords})
        self._episodes = []
        return dataset


def _of(observations: Any, world: int) -> Any:
    """The observation of one world, a copy."""
    if isinstance(observations, dict):
        return {name: np.array(values[world]) for name, values in observations.items()}
    return np.array(observations[world])
