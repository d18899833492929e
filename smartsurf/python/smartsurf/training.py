"""How `smartsurf train` learns: the cross-entropy method over local policies, and what it shares with _ppo.py.

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
        first = 1 + (seed - 1) * 10**9 + generation * runs
        seeds = range(first, first + runs)
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


class Tester:
    """Episodes of seeds that no training uses, run by a policy without exploration."""
    FIRST_SEED = 10**6

    def __init__(self, make: Make, episodes: int, threads: int):
        self._envs = make(episodes, threads=threads, copy=False)

    def __call__(self, policy: LocalPolicy | NetworkPolicy) -> tuple[float, float]:
        """Mean return and share of successes."""
        envs, inputs = self._envs, input_names(self._envs.sensor_channels)
        observation, _ = envs.reset(seed=self.FIRST_SEED)
        total, running, success = np.zeros(envs.num_envs), np.ones(envs.num_envs, bool), np.zeros(envs.num_envs, bool)
        commands = np.zeros(envs.action_space.shape or (), np.float32)
        of_planes = isinstance(policy, NetworkPolicy) and policy.observation_shape == envs._observations.shape[1:]
        if isinstance(policy, LocalPolicy):
            policy.reset()
        while running.any():
            if isinstance(policy, LocalPolicy):
                for c, command in enumerate(policy(dict(zip(inputs, envs._observations.swapaxes(0, 1)))).values()):
                    commands[:, c] = command
            else:
                commands[...] = policy(envs._observations if of_planes else observation)
            observation, rewards, terminated, truncated, infos = envs.step(commands)
            total += np.where(running, np.nan_to_num(rewards, nan=-1e9), 0)
            success |= running & infos["success"]
            running &= ~(terminated | truncated)
        return float(total.mean()), float(success.mean())

    def close(self) -> None:
        self._envs.close()


class Log:
    """curve.csv, TensorBoard and the terminal: one row per iteration."""
    FIELDS = ("iteration", "samples", "episodes", "cpu_s", "wall_s", "return", "best_return", "success_rate", "test_return",
              "test_success_rate")

    def __init__(self, folder: pathlib.Path, make: Make, how: argparse.Namespace):
        folder.mkdir(parents=True, exist_ok=True)
        for old in folder.glob("events.out.tfevents.*"):  # TensorBoard would draw both runs as one
            old.unlink()
        self._tester = Tester(make, how.test, how.threads) if how.test else None
        self._file = open(folder / "curve.csv", "w", newline="")
        self._rows = csv.DictWriter(self._file, self.FIELDS)
        self._rows.writeheader()
        self._start, self._cpu, self._board = time.monotonic(), time.process_time(), _board(folder)

    def add(self, iteration: int, samples: int, episodes: int, returns: Vector, best: float, success: float,
            policy: LocalPolicy | NetworkPolicy) -> None:
        """returns: of the iteration's episodes, or of its candidates. best: of the best ones. success: share of the episodes.
        policy: what is learned so far, which is tested; the times are without that."""
        cpu, wall = time.process_time(), time.monotonic()
        row: dict[str, Any] = {
            "iteration": iteration, "samples": samples, "episodes": episodes, "cpu_s": f"{cpu - self._cpu:.2f}",
            "wall_s": f"{wall - self._start:.2f}", "return": f"{np.mean(returns) if len(returns) else np.nan:.6g}",
            "best_return": f"{best:.6g}", "success_rate": f"{success:.4f}"}
        if self._tester is not None:
            tested, won = self._tester(policy)
            row.update(test_return=f"{tested:.6g}", test_success_rate=f"{won:.4f}")
        self._rows.writerow(row)
        self._file.flush()
        if self._board is not None:
            for name in self.FIELDS[3:]:
                if name in row:
                    self._board.add_scalar(f"train/{name}", float(row[name]), samples)
        print(f"{iteration:4}: {samples} samples, {episodes} episodes, {row['cpu_s']} s, return {float(row['return']):.4g}, best "
              f"{best:.4g}, success {success:.0%}" + (f", test {tested:.4g}, {won:.0%}" if self._tester is not None else ""), flush=True)
        self._cpu += time.process_time() - cpu
        self._start += time.monotonic() - wall

    def close(self) -> None:
        self._file.close()
        if self._tester is not None:
            self._tester.close()
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


def save_policy(policy: LocalPolicy | NetworkPolicy, folder: pathlib.Path, title: str) -> None:
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
    scales = [channel_scale(c.minimum, c.maximum) for c in envs.sensor_channels for _ in range(c.components)]
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

    log, samples, won = Log(folder, make, how), 0, 0.0

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
                found.elite_score, won, best)
        save_policy(best, folder, title)
    log.close()
    envs.close()
    return best


def channel_scale(low: float, high: float) -> float:
    size = max(abs(low), abs(high))
    return 1 / size if np.isfinite(size) and size > 0 else 1.0


def local_policy(layers: Sequence[tuple[NDArray[Any], NDArray[Any]]], sensors: Sequence[Channel], actuators: Sequence[Channel],
                 memory: int = 0) -> LocalPolicy:
    """The LocalPolicy that computes what a network of convolutions does. Its inputs are all sensor planes, row and column, in
    their units, then the memory; its outputs from −1 to 1 are the channels' ranges, then the memory."""
    weights = [square(w).astype(np.float64) for w, _ in layers]
    biases = [np.array(b, np.float64) for _, b in layers]
    half, middle = (np.array([c.maximum + sign * c.minimum for c in actuators]) / 2 for sign in (-1, 1))
    commands = slice(len(actuators))
    weights[-1][commands] *= half[:, None, None]
    biases[-1][commands] = biases[-1][commands] * half + middle
    return LocalPolicy([*input_names(sensors), "row", "column"], [(c.name, c.minimum, c.maximum) for c in actuators],
                       list(zip(weights, biases)), memory)
