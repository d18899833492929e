"""Cells as agents that share one local policy, as stable-baselines3 has environments."""
import numpy as np
from gymnasium import spaces
from gymnasium.vector import AutoresetMode
from stable_baselines3.common.callbacks import BaseCallback

from tasks import LocalPolicy, metrics_of
from smartsurf import VectorEnv
from smartsurf.sb3 import Batch

TICKS = 6   # per decision
REACH = 3.2  # cells; those at most so far from the middle of a ball are its agents
NEIGHBOURS = ((0, 0), (-1, 0), (0, 1), (1, 0), (0, -1))  # rows and columns, in the order of smartsurf.policy.TAPS


class Cells(Batch):
    """The cells around each ball of each world. A cell sees the colours above itself and its four neighbours, and sets its
    own height from −1, the lowest, to 1. Its reward is the progress of its ball.

    An agent keeps its place beside the ball, and so changes its cell while the ball rolls. Cells without a ball see nothing,
    and all do what the policy does then: `idle`."""

    def __init__(self, task, worlds, seed, threads=1):
        self.env = VectorEnv(str(task.experiment), worlds, threads, set=task.options, seed=seed,
                             autoreset_mode=AutoresetMode.SAME_STEP, copy=False, strict=True)
        names = [f"{channel.name}.{c}" if channel.components > 1 else channel.name
                 for channel in self.env.sensor_channels for c in "rgb"[:channel.components]]
        self.planes = [names.index(name) for name in task.inputs]
        (_, low, high), = task.actions
        self.middle, self.half, self.idle = (high + low) / 2, (high - low) / 2, 0.0
        self.balls = [f"{side}_{i + 1}" for side in ("east", "west") for i in range(task.options["count"])]
        self.direction = np.array([1.0 if name.startswith("east") else -1.0 for name in self.balls])
        span = range(-int(REACH), int(REACH) + 1)
        self.places = np.array([(r, c) for r in span for c in span if np.hypot(r, c) <= REACH])
        self.world = np.arange(worlds)[:, None, None]
        self.x = None  # progress, worlds × balls
        super().__init__(worlds * len(self.balls) * len(self.places),
                         spaces.Box(-np.inf, np.inf, (len(self.planes) * len(NEIGHBOURS),), np.float32),
                         spaces.Box(-1, 1, (1,), np.float32))

    def positions(self, infos):
        return np.stack([infos[name][:, :3] for name in self.balls], axis=1)

    def progress(self, position):
        """How far each ball is towards its side, u; one that has left the surface counts as if it lay at the wrong wall."""
        extent = (self.env.columns - 1) / 2
        return np.where(position[:, :, 2] > 0, np.clip((position[:, :, 0] - extent) * self.direction, -extent, extent), -extent)

    def observe(self, planes, infos):
        position = self.positions(infos)
        self.x = self.progress(position)
        rows, columns = planes.shape[2:]
        row, column = rows - 1 - np.rint(position[:, :, 1]), np.rint(position[:, :, 0])
        self.row = np.clip(row[..., None] + self.places[:, 0], 0, rows - 1).astype(int)
        self.column = np.clip(column[..., None] + self.places[:, 1], 0, columns - 1).astype(int)
        padded = np.pad(planes[:, self.planes], ((0, 0), (0, 0), (1, 1), (1, 1)))
        taps = [padded[self.world, :, self.row + 1 + r, self.column + 1 + c] for r, c in NEIGHBOURS]
        return np.stack(taps, axis=-1).reshape(self.num_envs, -1)

    def reset(self):
        return self.observe(*self.env.reset())

    def step_async(self, actions):
        self.commands = np.full(self.env.action_space.shape, self.idle, np.float32)
        self.commands[self.world, 0, self.row, self.column] = np.clip(actions, -1, 1).reshape(self.row.shape)
        self.commands = self.middle + self.half * self.commands

    def step_wait(self):
        x, ended = self.x.copy(), np.zeros(self.env.num_envs, bool)
        rewards, infos = np.zeros_like(x), [{} for _ in range(self.env.num_envs)]
        for _ in range(TICKS):
            planes, _, terminated, truncated, info = self.env.step(self.commands)
            over = (terminated | truncated) & ~ended
            for world in np.flatnonzero(over):
                infos[world] = {"metrics": metrics_of(info["final_info"], world)}
            now = last = self.progress(self.positions(info))
            if over.any():
                last = np.where(over[:, None], self.progress(self.positions(info["final_info"])), now)
            rewards += np.where(ended[:, None], 0, last - x)
            x, ended = now, ended | over
        agents = len(self.balls) * len(self.places)
        # Once for each world, for the callback; the other agents share an empty one.
        each = [infos[k // agents] if k % agents == 0 else {} for k in range(self.num_envs)]
        return self.observe(planes, info), np.repeat(rewards.reshape(-1), len(self.places)).astype(np.float32), np.repeat(ended, agents), each


class Idle(BaseCallback):
    """Lets the cells without a ball follow the policy."""

    def _on_rollout_start(self):
        nothing = np.zeros((1, *self.training_env.observation_space.shape), np.float32)
        self.training_env.idle = float(np.clip(self.model.predict(nothing, deterministic=True)[0][0, 0], -1, 1))

    def _on_step(self):
        return True


def local_policy(model, task):
    """The policy of a stable-baselines3 model with one hidden layer of rectifiers, as the network that it is."""
    (_, low, high), = task.actions
    first, last = model.policy.mlp_extractor.policy_net[0], model.policy.action_net
    w1, b1, w2, b2 = (t.detach().numpy().astype(np.float64) for t in (first.weight, first.bias, last.weight, last.bias))
    own = np.zeros((1, len(b1), len(NEIGHBOURS)))
    own[:, :, 0] = w2 * (high - low) / 2
    return LocalPolicy(task.inputs, task.actions, [(w1.reshape(len(b1), -1, len(NEIGHBOURS)), b1), (own, b2 * (high - low) / 2 + (high + low) / 2)])
