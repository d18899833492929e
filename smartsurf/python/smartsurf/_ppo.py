"""Proximal policy optimization (Schulman et al. 2017) with PyTorch, for `smartsurf train --method ppo`.

Observations are normalised by their mean and deviation, rewards by the deviation of the discounted return; advantages
are generalised (Schulman et al. 2016); ratios and gradients are clipped; the learning rate falls to 0; an episode that
ends by time goes on with the value of its last state, as CleanRL does all of these. The value is not clipped, which
would keep it from its scale. It also sees the states of the objects and the goals (Pinto et al. 2018), since training
alone needs it, and the last reward, from which it soon learns what rewards will come: advantages have less of its
error.

Each cell's commands are an action of their own, with the world's advantage. Most of the noise depends on the state
(Raffin et al. 2021): it is a random linear function of a cell's features, the same for all cells of a world and for
some ticks; of a network of the whole surface, of waves across the table. Noise of single cells would average out below
an object, which lies on many.
"""
from __future__ import annotations

import argparse
import sys
from collections.abc import Callable
from typing import Any

import numpy as np
import torch
from gymnasium.vector import AutoresetMode
from numpy.typing import ArrayLike, NDArray
from torch import nn

from ._network import NetworkPolicy
from ._printable import printable
from ._task import TaskVectorEnv
from ._vector import VectorEnv, finite_rewards
from .policy import LocalPolicy
from .training import Log, channel_scale, has_success, local_policy, training_seeds

Floats = NDArray[np.float32]

VALUE_RATE = 2e-3  # learning rate of the value


class Moments:
    """Mean and deviation of all arrays added: of each plane of (n, planes, rows, columns), else of each number."""

    def __init__(self, shape: tuple[int, ...], smallest: ArrayLike):
        """smallest: deviations are at least these, so that what hardly ever differs is not magnified."""
        self._axes = (0, 2, 3) if len(shape) == 3 else (0,)
        self._mean = np.zeros((shape[0], 1, 1) if len(shape) == 3 else shape)
        self._smallest = np.asarray(smallest, np.float32)
        self._square, self._count = np.zeros_like(self._mean), 0.0

    def add(self, values: Floats) -> None:
        if values.size == 0:  # a surface without sensors
            return
        count = values.size / self._mean.size
        mean = values.mean(axis=self._axes, keepdims=True, dtype=np.float64)[0]
        square = ((values - mean) ** 2).sum(axis=self._axes, keepdims=True, dtype=np.float64)[0]
        both, away = self._count + count, mean - self._mean
        self._square += square + away**2 * self._count * count / both
        self._mean = self._mean + away * count / both
        self._count = both

    @property
    def state(self) -> list[Any]:
        return [np.asarray(self._mean), np.asarray(self._square), self._count]

    @state.setter
    def state(self, state: list[Any]) -> None:
        self._mean, self._square, self._count = state

    @property
    def mean(self) -> Floats:
        return self._mean.astype(np.float32)

    @property
    def deviation(self) -> Floats:
        return np.maximum(np.sqrt(self._square / max(self._count, 1.0)), self._smallest).astype(np.float32)


class Rewards:
    """Divides rewards by the deviation of the discounted return, so that values are about 1."""

    def __init__(self, worlds: int, discount: float):
        self.returns, self._discount, self.moments = np.zeros(worlds), discount, Moments((), 1e-4)

    def __call__(self, rewards: NDArray[np.float64], ends: NDArray[np.bool_]) -> Floats:
        """Both: decisions × worlds."""
        for now, over in zip(rewards, ends):
            self.returns = self._discount * self.returns + now
            self.moments.add(self.returns.astype(np.float32))
            self.returns[over] = 0
        return np.clip(rewards / self.moments.deviation, -10, 10).astype(np.float32)


class Actor:
    """The policy's network, from observations to commands from −1 to 1, and its exploration.

    kind: "local": what a LocalPolicy computes, with `memory` values that each cell passes to its next step; "cnn":
    convolutions, then a layer that sees all; "mlp": dense layers."""

    def __init__(self, kind: str, shape: tuple[int, ...], hidden: tuple[int, ...], action: tuple[int, int, int],
                 memory: int, neighbours: int, moments: Moments, deviation: float, together: float):
        """deviation: of the noise at first. together: the share of its variance that is a function of the features."""
        self.kind, self.action, self.memory, self._moments = kind, action, memory, moments
        channels, rows, columns = action
        self.layers: list[Any] = []
        row, column = np.mgrid[0:rows, 0:columns].astype(np.float32)
        self._places = torch.tensor(np.stack([(2 * row - rows + 1) / rows, (2 * column - columns + 1) / columns]))
        width = shape[0] + 2 + memory if kind == "local" else shape[0] if kind == "cnn" else int(np.prod(shape))
        for units in hidden:
            self.layers.append(nn.Linear(width, units) if kind == "mlp" else nn.Conv2d(width, units, 3, padding=1))
            width = units
        outputs = channels + memory if kind == "local" else channels * rows * columns
        if kind == "cnn":
            width *= rows * columns
        self.layers.append(nn.Conv2d(width, outputs, 3, padding=1) if kind == "local" else nn.Linear(width, outputs))
        for number, layer in enumerate(self.layers):
            last = number + 1 == len(self.layers)
            nn.init.orthogonal_(layer.weight, 0.01 if last else 2**0.5)
            if last and memory:  # what a cell remembers differs from the start
                nn.init.orthogonal_(layer.weight.data[channels:], 1.0)
            nn.init.zeros_(layer.bias)
        kernel = np.zeros((3, 3), np.float32)  # the neighbours that a cell reads
        kernel[1], kernel[:, 1] = neighbours > 0, neighbours > 0
        kernel[1, 1] = 1
        self._kernel = torch.tensor(np.ones((3, 3), np.float32) if neighbours == 8 else kernel)
        # Features of the noise: 1, row and column, and what a local policy's last layer sees of the own cell; of other
        # networks waves across the table, since a linear function hardly turns an object that is small beside it.
        waves = [] if kind == "local" else [wave(np.pi * k * self._places) for k in (1, 2) for wave in (torch.sin, torch.cos)]
        self._fields = torch.cat([torch.ones(1, rows, columns), self._places, *waves])
        self._features = len(self._fields) + (width if kind == "local" else 0)
        shared, single = np.log(deviation) + 0.5 * np.log(np.maximum([together / self._features, 1 - together], 1e-6))
        self.log_deviation = nn.Parameter(torch.full((channels, self._features), float(shared)))
        self.log_single_deviation = nn.Parameter(torch.full((channels, 1, 1), float(single)))
        self.parameters = [self.log_deviation, self.log_single_deviation]
        self.parameters += [p for layer in self.layers for p in layer.parameters()]

    def _weight(self, layer: Any) -> Any:
        return layer.weight * self._kernel if self.kind == "local" else layer.weight

    def __call__(self, observation: Any, memory: Any) -> tuple[Any, Any, Any]:
        """The commands, the memory of the next step, and the features of the noise. observation: the environment's."""
        mean, deviation = torch.from_numpy(self._moments.mean), torch.from_numpy(self._moments.deviation)
        channels, rows, columns = self.action
        count = len(observation)
        features = self._fields.expand(count, *self._fields.shape)
        if self.kind != "local":
            value = (observation - mean) / deviation
            for number, layer in enumerate(self.layers):
                value = layer(value.flatten(1) if isinstance(layer, nn.Linear) else value)
                value = value if number + 1 == len(self.layers) else torch.relu(value)
            return value.reshape(count, *self.action), memory, features
        # Beyond the edge a LocalPolicy reads 0, before its inputs are normalised.
        sensed = (nn.functional.pad(observation, (1, 1, 1, 1)) - mean) / deviation
        own = torch.cat([self._places.expand(count, 2, rows, columns), memory], dim=1)
        value = torch.cat([sensed, nn.functional.pad(own, (1, 1, 1, 1))], dim=1)
        seen = value[:, :, 1:-1, 1:-1]
        for number, layer in enumerate(self.layers):
            value = nn.functional.conv2d(value, self._weight(layer), layer.bias, padding=0 if number == 0 else 1)
            if number + 1 < len(self.layers):
                value = seen = torch.relu(value)
        return value[:, :channels], value[:, channels:].clamp(-1, 1), torch.cat([features, seen.detach()], dim=1)

    def draw(self, worlds: int, generator: torch.Generator) -> Any:
        """The random functions of some worlds."""
        return torch.randn((worlds, *self.log_deviation.shape), generator=generator)

    def noise(self, functions: Any, features: Any, generator: torch.Generator) -> Any:
        shared = torch.einsum("wkf,wfrc->wkrc", functions * self.log_deviation.exp(), features)
        return shared + self.log_single_deviation.exp() * torch.randn(shared.shape, generator=generator)

    def log_probability(self, actions: Any, mean: Any, features: Any) -> Any:
        """The log probability of each cell's commands: (n, rows, columns)."""
        variance = torch.einsum("kf,nfrc->nkrc", (2 * self.log_deviation).exp(), features**2)
        variance = variance + (2 * self.log_single_deviation).exp()
        return (-0.5 * ((actions - mean) ** 2 / variance + variance.log() + np.log(2 * np.pi))).sum(dim=1)

    def layers_of(self) -> list[tuple[NDArray[np.float64], NDArray[np.float64]]]:
        """Weights and biases as numbers; the first layer of a local policy takes inputs that are not normalised."""
        layers = [(self._weight(layer).detach().numpy().astype(np.float64),
                   layer.bias.detach().numpy().astype(np.float64)) for layer in self.layers]
        if self.kind == "local":
            weights, biases = layers[0]
            planes = self._moments.mean.shape[0]
            mean, deviation = (m.astype(np.float64).ravel() for m in (self._moments.mean, self._moments.deviation))
            sensed = weights[:, :planes] / deviation[:, None, None]
            biases -= np.einsum("oikl,i->o", sensed, mean)
            weights[:, :planes] = sensed
            weights[:, planes:planes + 2] *= (2 / np.array(self.action[1:]))[:, None, None]
        return layers


class Learner:
    """Policy, value and what they have seen."""

    def __init__(self, make: Callable[..., VectorEnv], how: argparse.Namespace):
        torch.manual_seed(how.seed)
        torch.set_num_threads(1)  # the same bits for any number of cores
        self.how, self.envs = how, make(how.worlds, threads=how.threads, autoreset_mode=AutoresetMode.DISABLED)
        envs, worlds = self.envs, how.worlds
        self.channels = envs.actuator_channels
        self.low, self.high = (np.array([getattr(c, end) for c in self.channels], np.float32)[:, None, None]
                               for end in ("minimum", "maximum"))
        planes, shape = (len(envs._planes()), envs.rows, envs.columns), envs.single_observation_space.shape
        if how.policy == "mlp" and shape is None:
            raise ValueError("--policy mlp: the task's observation is a dict: it must be one array")
        if how.policy == "cnn" and not planes[0]:
            raise ValueError("--policy cnn: the surface has no sensors, whose planes it sees")
        # A local policy and a CNN see the planes of the sensors, an MLP what the task observes.
        self._sees_planes = how.policy != "mlp" or envs._observes_planes
        own = planes if self._sees_planes or shape is None else shape
        scales = np.array([channel_scale(c.minimum, c.maximum) for c in envs.sensor_channels
                           for _ in range(c.components)], np.float32)
        self.moments = Moments(own, 0.02 / scales[:, None, None] if self._sees_planes else 1e-4)
        action = (len(self.channels), envs.rows, envs.columns)
        self.actor = Actor(how.policy, own, tuple(how.hidden), action, how.memory, how.neighbours, self.moments,
                           how.exploration, how.together)
        self._generator = torch.Generator().manual_seed(how.seed)
        self._rewards = Rewards(worlds, how.discount)
        self.samples = self.episodes = 0
        self.returns: list[float] = []
        self.won: list[bool] = []
        self._running = np.zeros(worlds)
        self._noise_ticks = np.zeros(worlds, np.int64)  # until a world draws new noise
        self._functions = self.actor.draw(worlds, self._generator)
        self._memory = torch.zeros(worlds, how.memory, envs.rows, envs.columns)
        self._fresh = np.ones(worlds, np.bool_)
        self._last_reward = np.zeros((worlds, 2), np.float32)  # and 1 if there is one in this episode
        envs.objects  # from now on the batch writes their states
        self._observe(envs.reset(seed=training_seeds(how.seed, worlds).start)[0])
        self.judged_moments = Moments(self._judged.shape[1:], 1e-2)
        sizes = [self._judged.shape[1], 64, 64]
        parts: list[Any] = [part for m, n in zip(sizes, sizes[1:]) for part in (nn.Linear(m, n), nn.Tanh())]
        self._critic = nn.Sequential(*parts, nn.Linear(64, 1))
        for part in parts[::2]:
            nn.init.orthogonal_(part.weight, 2**0.5)
            nn.init.zeros_(part.bias)
        self._targets, self._targets_known = Moments((), 1e-4), False
        self._values_parameters = list(self._critic.parameters())
        self._learned, self._unsaved = [*self.actor.parameters, *self._values_parameters], False
        self.optimizer = torch.optim.Adam([{"params": self.actor.parameters, "lr": how.learning_rate},
                                           {"params": self._values_parameters, "lr": VALUE_RATE}], eps=1e-5)

    def _observe(self, observation: Any) -> None:
        envs, worlds = self.envs, self.how.worlds
        planes = np.array(envs._observations, np.float32)
        parts = observation.values() if isinstance(observation, dict) else [observation]
        goals = envs._judge.goals.values() if isinstance(envs, TaskVectorEnv) else []
        known = [np.asarray(part, np.float32).reshape(worlds, -1) for part in (envs._object_states, *goals, *parts)]
        known.append(self._last_reward)
        self._judged = np.nan_to_num(np.concatenate(known, axis=1))
        self._seen = planes if self._sees_planes else np.array(observation, np.float32)

    def _normalised_value(self, judged: Any) -> Any:
        m = self.judged_moments
        return self._critic(((judged - torch.from_numpy(m.mean)) / torch.from_numpy(m.deviation)).clamp(-10, 10))[:, 0]

    def value(self, judged: Any) -> Any:
        return float(self._targets.mean) + float(self._targets.deviation) * self._normalised_value(judged)

    def _learn_scale_of_values(self, targets: Any) -> None:
        """The value's network has outputs of about 1; its last layer changes so that the value stays (van Hasselt et
        al. 2016)."""
        mean, deviation = float(self._targets.mean), float(self._targets.deviation)
        known = self._targets_known
        self._targets.add(targets.numpy().ravel())
        self._targets_known = True
        if known:
            last, scale = self._critic[-1], float(self._targets.deviation)
            with torch.no_grad():
                last.weight *= deviation / scale
                last.bias.copy_((last.bias * deviation + mean - float(self._targets.mean)) / scale)

    def warm_up(self) -> None:
        """A first rollout for the statistics, in which each world begins another episode at its own time: later ones
        are then in all parts of their episodes."""
        decisions = self.how.horizon
        again = torch.randint(decisions, (self.how.worlds,), generator=self._generator).numpy()
        for decision in range(decisions):
            self.learn_statistics(self.rollout(1))
            if (again == decision).any():
                self._running[again == decision] = 0
                self._fresh = self._fresh | (again == decision)
                self._last_reward[again == decision] = 0
                self._observe(self.envs.reset(options={"reset_mask": again == decision})[0])

    def _decide(self, worlds: NDArray[np.bool_], ticks: int) -> Any:
        """The actions of some worlds for so many ticks."""
        renewed, which = worlds & (self._fresh | (self._noise_ticks <= 0)), torch.from_numpy(worlds)
        if renewed.any():
            self._functions[torch.from_numpy(renewed)] = self.actor.draw(int(renewed.sum()), self._generator)
            self._noise_ticks[renewed] = self.how.noise_ticks
        self._noise_ticks[worlds] -= ticks
        with torch.no_grad():
            mean, memory, features = self.actor(torch.from_numpy(self._seen)[which], self._memory[which])
            actions = mean + self.actor.noise(self._functions[which], features, self._generator)
        self._memory = self._memory.clone()
        self._memory[which] = memory
        return actions

    def _commands(self, actions: Any) -> Floats:
        middle, half = (self.high + self.low) / 2, (self.high - self.low) / 2
        commands: Floats = (middle + half * np.clip(actions.numpy(), -1, 1)).astype(np.float32)
        return commands

    def rollout(self, decisions: int) -> dict[str, Any]:
        """What the worlds do in some decisions; lists over these, and the ends by time: (decision, worlds, last
        observations)."""
        how, worlds = self.how, self.how.worlds
        names = ("seen", "judged", "actions", "rewards", "ends", "fresh", "memory", "cut")
        out: dict[str, Any] = {name: [] for name in names}
        for decision in range(decisions):
            self._memory[torch.from_numpy(self._fresh)] = 0
            for name, value in (("seen", self._seen), ("judged", self._judged), ("fresh", self._fresh)):
                out[name].append(torch.from_numpy(value))
            out["memory"].append(self._memory)
            out["actions"].append(self._decide(np.ones(worlds, np.bool_), how.hold))
            commands = self._commands(out["actions"][-1])
            reward, over = np.zeros(worlds), np.zeros(worlds, np.bool_)
            for left in reversed(range(how.hold)):
                observation, tick_reward, terminated, truncated, infos = self.envs.step(commands)
                failed = np.isnan(tick_reward)
                tick_reward = finite_rewards(tick_reward, infos)
                self._last_reward = np.stack([tick_reward, np.ones(worlds)], axis=1).astype(np.float32)
                reward += np.where(over, 0, tick_reward / how.hold)
                self._running += tick_reward
                self.samples += worlds
                self._fresh = terminated | truncated
                if self._fresh.any():
                    self.returns += list(self._running[self._fresh])
                    self.won += list(infos["success"][self._fresh])
                    self.episodes += int(self._fresh.sum())
                    self._running[self._fresh] = 0
                    cut = np.flatnonzero(truncated & ~terminated & ~over)
                    if len(cut):
                        before = self._judged
                        self._observe(observation)
                        self._judged[failed] = before[failed]  # whose objects are not known
                        out["cut"].append((decision, cut, torch.from_numpy(self._judged[cut])))
                    over |= self._fresh
                    observation, _ = self.envs.reset(options={"reset_mask": self._fresh})
                    self._last_reward[self._fresh] = 0
                    if left:
                        # The next episode decides at once; it is learned from the next decision of all worlds on.
                        self._observe(observation)
                        commands[self._fresh] = self._commands(self._decide(self._fresh, left))
            out["rewards"].append(reward)
            out["ends"].append(over)
            self._observe(observation)
        return out

    def learn_statistics(self, rollout: dict[str, Any]) -> None:
        self.moments.add(torch.cat(rollout["seen"]).numpy())
        self.judged_moments.add(torch.cat(rollout["judged"]).numpy())

    def update(self, rollout: dict[str, Any], left: float, policy: bool = True) -> None:
        """left: the share of the training that is to come, by which the learning rates fall. policy: else the value
        alone learns."""
        how = self.how
        judged, ends = torch.stack(rollout["judged"]), np.array(rollout["ends"])
        decisions, worlds = ends.shape
        with torch.no_grad():
            rewards = torch.from_numpy(self._rewards(np.array(rollout["rewards"]), ends))
            for decision, cut, last in rollout["cut"]:
                rewards[decision, cut] += how.discount * self.value(last)
            values = self.value(judged.flatten(0, 1)).reshape(decisions, worlds)
            advantages, advantage = torch.zeros_like(values), torch.zeros(worlds)
            after = self.value(torch.from_numpy(self._judged))
            goes_on = torch.from_numpy(1.0 - ends).float()
            for t in reversed(range(decisions)):
                difference = rewards[t] + how.discount * after * goes_on[t] - values[t]
                advantage = difference + how.discount * how.gae_lambda * goes_on[t] * advantage
                advantages[t], after = advantage, values[t]
        # Sequences of some decisions of one world; a policy without memory has sequences of one.
        length = min(how.sequence, decisions) if how.memory else 1
        starts = [(t, w) for t in range(0, decisions - length + 1, length) for w in range(worlds)]
        seen, actions, memory = (torch.stack(rollout[name]) for name in ("seen", "actions", "memory"))
        fresh, targets = torch.stack(rollout["fresh"]), advantages + values

        def of(data: Any, chosen: Any, step: int) -> Any:
            return data[chosen[:, 0] + step, chosen[:, 1]]

        def log_probabilities(chosen: Any) -> Any:
            """(step · sequence, rows, columns)."""
            carried, out = of(memory, chosen, 0), []
            for step in range(length):
                if step > 0 and how.memory:
                    carried = torch.where(of(fresh, chosen, step)[:, None, None, None], torch.zeros(()), carried)
                mean, carried, features = self.actor(of(seen, chosen, step), carried)
                out.append(self.actor.log_probability(of(actions, chosen, step), mean, features))
            return torch.cat(out)

        every = torch.tensor(starts)
        with torch.no_grad():  # with the statistics of now
            before = torch.cat([log_probabilities(part).reshape(length, len(part), *self.actor.action[1:])
                                for part in every.split(1024)], dim=1)
        self._learn_scale_of_values(targets)
        for group, rate in zip(self.optimizer.param_groups, (how.learning_rate if policy else 0.0, VALUE_RATE)):
            group["lr"] = rate * left
        for _ in range(how.epochs):
            for batch in torch.randperm(len(every), generator=self._generator).chunk(how.minibatches):
                chosen = every[batch]

                def flat(data: Any) -> Any:
                    return torch.cat([of(data, chosen, step) for step in range(length)])
                ratio = (log_probabilities(chosen) - before[:, batch].flatten(0, 1)).exp()
                own = flat(advantages)
                deviation = own.std() if len(own) > 1 else torch.zeros(())  # one number has none
                own = ((own - own.mean()) / (deviation + 1e-8))[:, None, None]
                loss = -torch.min(own * ratio, own * ratio.clamp(1 - how.clip, 1 + how.clip)).mean()
                loss = loss - how.entropy * (self.actor.log_deviation.mean() + self.actor.log_single_deviation.mean())
                wanted = (flat(targets) - float(self._targets.mean)) / float(self._targets.deviation)
                loss = loss + 0.5 * ((self._normalised_value(flat(judged)) - wanted) ** 2).mean()
                self.optimizer.zero_grad()
                loss.backward()
                nn.utils.clip_grad_norm_(self.actor.parameters, 0.5)
                nn.utils.clip_grad_norm_(self._values_parameters, 0.5)
                self.optimizer.step()

    _STATE = ("samples", "episodes", "_running", "_noise_ticks", "_fresh", "_last_reward", "_judged", "_seen", "_targets_known")

    def _moments(self) -> dict[str, Moments]:
        return {"moments": self.moments, "judged_moments": self.judged_moments, "targets": self._targets,
                "rewards": self._rewards.moments}

    def save(self) -> dict[str, Any] | None:
        """All on which an iteration depends, after an update; None, with a line on the terminal, if a world cannot be saved."""
        try:
            worlds = self.envs._save_worlds()
        except ValueError as error:
            if not self._unsaved:
                print(f"smartsurf train: no checkpoint: {printable(error)}", file=sys.stderr)
            self._unsaved = True
            return None
        optimizer = [{name: value.numpy() for name, value in self.optimizer.state[p].items()} for p in self._learned]
        return {"worlds": worlds,
                "own": {name: getattr(self, name) for name in self._STATE},
                "moments": {name: moments.state for name, moments in self._moments().items()}, "returns": self._rewards.returns,
                "generator": self._generator.get_state().numpy(), "functions": self._functions.numpy(),
                "memory": self._memory.numpy(), "learned": [p.detach().numpy() for p in self._learned], "optimizer": optimizer}

    def restore(self, state: dict[str, Any]) -> None:
        """Goes on from what save() returned."""
        self.envs._restore_worlds(state["worlds"])
        for name, value in state["own"].items():
            setattr(self, name, value)
        for name, moments in self._moments().items():
            moments.state = state["moments"][name]
        self._rewards.returns = state["returns"]
        self._generator.set_state(torch.from_numpy(state["generator"]))
        self._functions, self._memory = torch.from_numpy(state["functions"]), torch.from_numpy(state["memory"])
        for p, values, moments_of_p in zip(self._learned, state["learned"], state["optimizer"]):
            p.data.copy_(torch.from_numpy(values))
            self.optimizer.state[p] = {name: torch.from_numpy(value) for name, value in moments_of_p.items()}

    def policy(self) -> LocalPolicy | NetworkPolicy:
        layers, envs = self.actor.layers_of(), self.envs
        if self.how.policy == "local":
            return local_policy(layers, envs.sensor_channels, self.channels, self.how.memory)
        shape = self._seen.shape[1:]
        return NetworkPolicy(layers, shape, self.actor.action, self.low, self.high, self.moments.deviation,
                             self.moments.mean)


def train(make: Callable[..., VectorEnv], how: argparse.Namespace, log: Log) -> LocalPolicy | NetworkPolicy:
    """A LocalPolicy with how.policy "local", else a NetworkPolicy, "cnn" or "mlp"; how: as train.main() parses it."""
    learner = Learner(make, how)
    if log.state is None:
        learner.warm_up()
        learner.update(learner.rollout(how.horizon), 1.0, policy=False)
    else:
        learner.restore(log.state)
    for iteration in range(log.iterations, how.iterations):
        rollout = learner.rollout(how.horizon)
        learner.learn_statistics(rollout)
        learner.update(rollout, 1 - iteration / how.iterations)
        policy = learner.policy()
        returns = learner.returns
        log.add(learner.samples, learner.episodes, np.array(returns), max(returns, default=float("nan")),
                float(np.mean(learner.won)) if learner.won and has_success(learner.envs) else None, policy, learner.save())
        learner.returns, learner.won = [], []
    learner.envs.close()
    return policy
