"""How `smartsurf train` learns: the cross-entropy method over local policies, and proximal policy optimization with PyTorch.

Equal arguments give equal policies, for any number of threads.
"""
from __future__ import annotations

import argparse
import csv
import importlib.util
import os
import pathlib
import sys
import time
from collections.abc import Callable, Iterator, Sequence
from typing import Any, NamedTuple

import numpy as np
from gymnasium.vector import AutoresetMode
from numpy.typing import NDArray

from ._network import NetworkPolicy
from ._surface import Channel
from ._task import Task
from ._tasks import TASKS, task_file
from ._vector import VectorEnv
from .policy import LocalPolicy, export_onnx, export_policy, square

Vector = NDArray[np.float64]
Make = Callable[..., VectorEnv]


class Generation(NamedTuple):
    """What a generation of the cross-entropy method has led to: the mean score of all candidates and of the best fifth, and the
    mean of these."""
    number: int
    mean_score: float
    elite_score: float
    mean: Vector


def cem(scores: Callable[[Vector, range], Vector], initial: Vector, deviation: float, *, generations: int, candidates: int,
        runs: int, seed: int = 1) -> Iterator[Generation]:
    """The cross-entropy method. scores(vectors, seeds): one score of each row of `vectors`, which learning maximizes, over the
    episodes with these seeds: the same for all candidates, others in each generation."""
    source = np.random.default_rng(seed)
    mean, deviations = initial, np.full(len(initial), deviation)
    elite = max(2, candidates // 5)
    for generation in range(generations):
        seeds = range(1 + generation * runs, 1 + (generation + 1) * runs)
        vectors = mean + deviations * source.standard_normal((candidates, len(mean)))
        values = scores(vectors, seeds)
        best = np.argsort(values)[-elite:]
        # Added noise, which decreases, keeps the deviation from collapsing early (Szita and Lőrincz 2006).
        noise = 0.3 * deviation * max(0, 1 - generation / (0.7 * generations))
        mean, deviations = vectors[best].mean(axis=0), np.sqrt(vectors[best].var(axis=0) + noise**2)
        yield Generation(generation, float(values.mean()), float(values[best].mean()), mean)


def find_task(name: str) -> tuple[str, Make]:
    """A name for the folder, and the function that makes a task's environment; ValueError if there is none of that name."""
    path, _, member = name.partition(":")
    if path.endswith(".py") and member:
        spec = importlib.util.spec_from_file_location("smartsurf_task", path)
        if spec is None or spec.loader is None or not os.path.isfile(path):
            raise ValueError(f"task {name}: there is no file {path}")
        module = importlib.util.module_from_spec(spec)
        sys.modules[spec.name] = module
        spec.loader.exec_module(module)
        found = getattr(module, member, None)
        if not isinstance(found, type) or not issubclass(found, Task):
            raise ValueError(f"task {name}: {path} has no smartsurf.Task {member}")
        return member, found().make_vec
    if path.endswith(".lua"):
        script = name
    else:
        known = {task.id[len("smartsurf/"):-len("-v0")]: task.id for task in TASKS}
        short = name.removeprefix("smartsurf/").removesuffix("-v0")
        if short not in known:
            raise ValueError(f"task {name}: must be EXPERIMENT.lua, FILE.py:CLASS or one of {', '.join(known)}")
        name, script = short, task_file(known[short])

    def make(num_envs: int, **arguments: Any) -> VectorEnv:
        return VectorEnv(script, num_envs, **arguments)
    return pathlib.Path(name).stem, make


def input_names(channels: Sequence[Channel]) -> list[str]:
    """The names of a LocalPolicy's inputs for all planes of these channels."""
    return [name for c in channels for name in ([c.name] if c.components == 1 else [f"{c.name}.{k}" for k in "rgb"[:c.components]])]


class Log:
    """curve.csv, TensorBoard and the terminal: one row per iteration."""
    FIELDS = ("iteration", "samples", "episodes", "cpu_s", "wall_s", "return", "best_return", "success_rate")

    def __init__(self, folder: pathlib.Path):
        folder.mkdir(parents=True, exist_ok=True)
        self._file = open(folder / "curve.csv", "w", newline="")
        self._rows = csv.DictWriter(self._file, self.FIELDS)
        self._rows.writeheader()
        self._start, self._cpu, self._board = time.monotonic(), time.process_time(), _board(folder)

    def add(self, iteration: int, samples: int, episodes: int, returns: Vector, best: float, success: float) -> None:
        """returns: of the iteration's episodes, or of its candidates. best: of the best ones. success: share of the episodes."""
        mean = float(np.mean(returns)) if len(returns) else float("nan")
        row: dict[str, Any] = {
            "iteration": iteration, "samples": samples, "episodes": episodes, "cpu_s": f"{time.process_time() - self._cpu:.2f}",
            "wall_s": f"{time.monotonic() - self._start:.2f}", "return": f"{mean:.6g}", "best_return": f"{best:.6g}",
            "success_rate": f"{success:.4f}"}
        self._rows.writerow(row)
        self._file.flush()
        if self._board is not None:
            for name in ("return", "best_return", "success_rate", "cpu_s"):
                self._board.add_scalar(f"train/{name}", float(row[name]), samples)
        print(f"{iteration:4}: {samples} samples, {episodes} episodes, {row['cpu_s']} s, return {mean:.4g}, best {best:.4g}, "
              f"success {success:.0%}", flush=True)

    def close(self) -> None:
        self._file.close()
        if self._board is not None:
            self._board.close()


def _board(folder: pathlib.Path) -> Any:
    """A writer for TensorBoard, None without tensorboard and one of the packages that write for it."""
    for module in ("torch.utils.tensorboard", "tensorboardX"):
        try:
            return importlib.import_module(module).SummaryWriter(str(folder))
        except ImportError:
            continue
    return None


def _save(policy: LocalPolicy | NetworkPolicy, folder: pathlib.Path, title: str) -> None:
    if isinstance(policy, LocalPolicy):
        export_policy(policy, folder / "policy.aps", title)
    if importlib.util.find_spec("onnx"):
        if isinstance(policy, LocalPolicy):
            if set(policy.inputs) - {"row", "column"} or policy.memory:
                export_onnx(policy, folder / "policy.onnx")
        else:
            policy.export(folder / "policy.onnx")


# ---- cross-entropy method


def train_cem(make: Make, how: argparse.Namespace, folder: pathlib.Path, title: str) -> LocalPolicy:
    """A LocalPolicy; how: as main() parses it."""
    envs = make(how.candidates * how.runs, threads=how.threads, copy=False)
    channels = envs.actuator_channels
    inputs = [*input_names(envs.sensor_channels), "row", "column"]
    actions = [(c.name, c.minimum, c.maximum) for c in channels]
    sizes, diagonal = (tuple(how.hidden), how.memory), how.neighbours == 8
    everything = LocalPolicy.parameters(len(inputs), len(actions), *sizes, diagonal)
    # Which numbers of a network's vector the search varies; without neighbours, the weights of the own cell and the biases.
    varied = np.arange(everything)
    if how.neighbours == 0:
        numbered = LocalPolicy.from_vector(1.0 + varied, inputs, actions, *sizes)
        varied = np.concatenate([part.ravel() for w, b in numbered.layers for part in (w[:, :, 0], b)]).astype(int) - 1
    count = len(varied)
    # Inputs of about 1, and outputs around the middle of the range of commands, for numbers of about 1.
    scales = [_scale(c.minimum, c.maximum) for c in envs.sensor_channels for _ in range(c.components)]
    scales += [2 / envs.rows, 2 / envs.columns]

    def policy(vector: Vector) -> LocalPolicy:
        numbers = np.zeros(everything)
        numbers[varied] = vector
        made = LocalPolicy.from_vector(numbers, inputs, actions, *sizes, how.substeps, diagonal)
        first, last = made.layers[0][0], made.layers[-1]
        first[:, :len(scales)] *= np.array(scales, np.float32)[:, None]
        for k, (_, low, high) in enumerate(actions):
            last[0][k] *= np.float32((high - low) / 2)
            last[1][k] = last[1][k] * np.float32((high - low) / 2) + np.float32((high + low) / 2)
        return made

    log, samples, won = Log(folder), 0, 0.0

    def scores(vectors: Vector, seeds: range) -> Vector:
        nonlocal samples, won
        policies = [policy(vector) for vector in vectors]
        envs.reset(seed=[seed for _ in policies for seed in seeds])
        planes = envs._observations  # a Task's own observation is for networks of the whole surface
        total, running, success = np.zeros(envs.num_envs), np.ones(envs.num_envs, bool), np.zeros(envs.num_envs, bool)
        commands = np.zeros(envs.action_space.shape or (), np.float32)
        while running.any():
            for k, made in enumerate(policies):
                own = slice(k * len(seeds), (k + 1) * len(seeds))
                if running[own].any():
                    sensed = dict(zip(inputs, planes[own].swapaxes(0, 1)))
                    for c, command in enumerate(made(sensed).values()):
                        commands[own, c] = command
            samples += int(running.sum())
            _, rewards, terminated, truncated, infos = envs.step(commands)
            total += np.where(running, np.nan_to_num(rewards, nan=-1e9), 0)  # a world that fails is the worst
            success |= running & infos["success"]
            running &= ~(terminated | truncated)
        won = float(success.mean())
        means: Vector = total.reshape(len(policies), -1).mean(axis=1)
        return means

    best = policy(np.zeros(count))
    for found in cem(scores, np.zeros(count), how.deviation, generations=how.iterations, candidates=how.candidates, runs=how.runs,
                     seed=how.seed):
        best = policy(found.mean)
        log.add(found.number, samples, (found.number + 1) * how.candidates * how.runs, np.array([found.mean_score]),
                found.elite_score, won)
        _save(best, folder, title)
    log.close()
    envs.close()
    return best


def _scale(low: float, high: float) -> float:
    size = max(abs(low), abs(high))
    return 1 / size if np.isfinite(size) and size > 0 else 1.0


def local_policy(layers: Sequence[tuple[NDArray[Any], NDArray[Any]]], sensors: Sequence[Channel], actuators: Sequence[Channel],
                 rows: int, columns: int) -> LocalPolicy:
    """The LocalPolicy that computes what a network of convolutions does. Its inputs are all sensor planes, each divided by the
    largest size of its channel's values, then row and column from −1 to 1; its outputs from −1 to 1 are the channels' ranges."""
    weights = [square(w).astype(np.float64) for w, _ in layers]
    biases = [np.asarray(b, np.float64) for _, b in layers]
    scales = [_scale(c.minimum, c.maximum) for c in sensors for _ in range(c.components)]
    weights[0] *= np.array([*scales, 2 / rows, 2 / columns])[:, None]
    half, middle = (np.array([c.maximum + sign * c.minimum for c in actuators]) / 2 for sign in (-1, 1))
    weights[-1] = weights[-1] * half[:, None, None]
    biases[-1] = biases[-1] * half + middle
    return LocalPolicy([*input_names(sensors), "row", "column"], [(c.name, c.minimum, c.maximum) for c in actuators],
                       list(zip(weights, biases)))


# ---- proximal policy optimization


def train_ppo(make: Make, how: argparse.Namespace, folder: pathlib.Path, title: str) -> LocalPolicy | NetworkPolicy:
    """A LocalPolicy with how.policy "local", else a NetworkPolicy, "cnn" or "mlp"; how: as main() parses it."""
    try:
        import torch
        from torch import nn
    except ImportError as error:
        raise ValueError("--method ppo needs torch: pip install torch; cem does not") from error
    torch.manual_seed(how.seed)
    torch.set_num_threads(1)  # the same bits for any number of cores
    envs = make(how.worlds, threads=how.threads, autoreset_mode=AutoresetMode.SAME_STEP)
    worlds, rows, columns = how.worlds, envs.rows, envs.columns
    channels = envs.actuator_channels
    low = np.array([c.minimum for c in channels], np.float32)[:, None, None]
    high = np.array([c.maximum for c in channels], np.float32)[:, None, None]
    shape = envs.single_observation_space.shape
    of_planes = shape == (len(envs._planes()), rows, columns)
    if shape is None or (how.policy in ("local", "cnn") and not of_planes):
        raise ValueError(f"--policy {how.policy}: the task's observation has shape {shape}: must be planes of the sensors; "
                         "--policy mlp takes any array")
    scale = np.ones(shape, np.float32)
    if of_planes:
        scale /= np.array([_scale(c.minimum, c.maximum) for c in envs.sensor_channels
                           for _ in range(c.components)], np.float32)[:, None, None]
    cells = len(channels) * rows * columns

    def hidden(layer: Callable[[int, int], Any], inputs: int) -> list[Any]:
        sizes = [inputs, *how.hidden]
        return [part for m, n in zip(sizes, sizes[1:]) for part in (layer(m, n), nn.ReLU())]

    def convolution(inputs: int, outputs: int) -> Any:
        return nn.Conv2d(inputs, outputs, 3, padding=1)

    def dense(inputs: int, outputs: int) -> Any:
        return nn.Sequential(nn.Flatten(), *hidden(nn.Linear, inputs), nn.Linear([inputs, *how.hidden][-1], outputs))

    planes = shape[0] + 2 if how.policy == "local" else shape[0]
    last_planes = [planes, *how.hidden][-1]
    if how.policy == "mlp":
        actor = dense(int(np.prod(shape)), cells)
    elif how.policy == "cnn":  # convolutions, then one layer that sees all
        actor = nn.Sequential(*hidden(convolution, planes), nn.Flatten(), nn.Linear(last_planes * rows * columns, cells))
    else:
        actor = nn.Sequential(*hidden(convolution, planes), convolution(last_planes, len(channels)))
    critic = dense(int(np.prod(shape)), 1)
    final = [part for part in actor if isinstance(part, (nn.Linear, nn.Conv2d))][-1]
    nn.init.orthogonal_(final.weight, 0.01)
    nn.init.zeros_(final.bias)
    log_std = nn.Parameter(torch.full((len(channels), 1, 1), -1.0))
    parameters = [*actor.parameters(), *critic.parameters(), log_std]
    optimizer = torch.optim.Adam(parameters, lr=how.learning_rate, eps=1e-5)
    row, column = np.mgrid[0:rows, 0:columns]
    places = torch.tensor(np.stack([(2 * row - rows + 1) / rows, (2 * column - columns + 1) / columns]), dtype=torch.float32)

    def tensor(observation: Any) -> Any:
        return torch.from_numpy(np.ascontiguousarray(observation, np.float32) / scale)

    def mean(observation: Any) -> Any:
        if how.policy == "local":
            observation = torch.cat([observation, places.expand(len(observation), *places.shape)], dim=1)
        return actor(observation).reshape(-1, len(channels), rows, columns)

    def exported() -> LocalPolicy | NetworkPolicy:
        layers = [(part.weight.detach().numpy().astype(np.float64), part.bias.detach().numpy().astype(np.float64))
                  for part in actor if isinstance(part, (nn.Linear, nn.Conv2d))]
        if how.policy != "local":
            return NetworkPolicy(layers, shape, (len(channels), rows, columns), low, high, scale)
        return local_policy(layers, envs.sensor_channels, channels, rows, columns)

    log, samples, episodes = Log(folder), 0, 0
    observation = tensor(envs.reset(seed=how.seed)[0])
    running, share = np.zeros(worlds), 1 - how.discount  # of rewards: values are then of the size of one reward
    for iteration in range(how.iterations):
        for group in optimizer.param_groups:
            group["lr"] = how.learning_rate * (1 - iteration / how.iterations)
        seen, taken, logs, values, rewards, ends = [], [], [], [], [], []
        returns: list[float] = []
        won: list[bool] = []
        for _ in range(how.horizon):
            with torch.no_grad():
                noise = torch.distributions.Normal(mean(observation), log_std.exp())
                action = noise.sample()
                seen.append(observation)
                taken.append(action)
                logs.append(noise.log_prob(action))
                values.append(critic(observation)[:, 0])
            commands = ((high + low) / 2 + (high - low) / 2 * np.clip(action.numpy(), -1, 1)).astype(np.float32)
            reward, over = np.zeros(worlds), np.zeros(worlds, np.bool_)
            for _ in range(how.hold):
                after, tick_reward, terminated, truncated, infos = envs.step(commands)
                tick_reward = np.where(over, 0, np.nan_to_num(tick_reward))  # those of the next episode count from its decision on
                reward += tick_reward / how.hold
                running += tick_reward
                samples += int((~over).sum())
                ends_now = (terminated | truncated) & ~over
                if ends_now.any():
                    returns += list(running[ends_now])
                    won += list(infos["final_info"]["success"][ends_now])
                    running[ends_now] = 0
                    cut = ends_now & truncated & ~terminated
                    if cut.any():  # an end by time is none: the value of the last state goes on
                        last = tensor(np.stack([infos["final_obs"][i] for i in np.flatnonzero(cut)]))
                        with torch.no_grad():
                            reward[cut] += how.discount * critic(last)[:, 0].numpy() / share
                    over |= ends_now
            rewards.append(torch.tensor(reward * share, dtype=torch.float32))
            ends.append(torch.tensor(over, dtype=torch.float32))
            observation = tensor(after)
        with torch.no_grad():  # generalised advantage estimation
            value, advantage, advantages = critic(observation)[:, 0], torch.zeros(worlds), []
            for t in reversed(range(how.horizon)):
                goes_on = 1 - ends[t]
                difference = rewards[t] + how.discount * value * goes_on - values[t]
                advantage = difference + how.discount * 0.95 * goes_on * advantage
                advantages.append(advantage)
                value = values[t]
            a = torch.stack(advantages[::-1]).reshape(-1)
        o, u, before = torch.cat(seen), torch.cat(taken), torch.cat(logs)
        target = a + torch.cat(values)
        for _ in range(how.epochs):
            for batch in torch.randperm(len(a)).chunk(4):
                now = torch.distributions.Normal(mean(o[batch]), log_std.exp())
                ratio = (now.log_prob(u[batch]) - before[batch]).sum(dim=1).exp()  # of each cell
                own = a[batch]
                own = ((own - own.mean()) / (own.std() + 1e-8))[:, None, None]
                loss = -torch.min(own * ratio, own * ratio.clamp(0.8, 1.2)).mean()
                loss = loss + 0.5 * ((critic(o[batch])[:, 0] - target[batch]) ** 2).mean()
                optimizer.zero_grad()
                loss.backward()
                nn.utils.clip_grad_norm_(parameters, 0.5)
                optimizer.step()
        episodes += len(returns)
        log.add(iteration, samples, episodes, np.array(returns), max(returns, default=float("nan")),
                float(np.mean(won)) if won else 0.0)
        _save(exported(), folder, title)
    log.close()
    envs.close()
    return exported()
