"""How `smartsurf train` learns: the cross-entropy method over local policies, and what it shares with _ppo.py.

Equal arguments give equal policies, for any number of threads.
"""
from __future__ import annotations

import argparse
import csv
import functools
import hashlib
import importlib.util
import json
import os
import pathlib
import sys
import time
import zipfile
from collections.abc import Callable, Iterator, Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from ._core import __version__
from ._files import replaced
from ._network import NetworkPolicy
from ._surface import Channel, FloatArray
from ._task import Task, TaskVectorEnv
from ._tasks import TASKS, task_file
from ._vector import Flags, VectorEnv, finite_rewards
from .policy import LocalPolicy, export_onnx, export_policy, plane_names, square

Vector = NDArray[np.float64]
Make = Callable[..., VectorEnv]


TEST_SEEDS = range(10**6, 2 * 10**6)  # of which training has none


def training_seeds(first: int, count: int) -> range:
    """Seeds for any whole number `first`: those from it on, where these are seeds and none is of a test."""
    first %= 2**63 - count
    if first < TEST_SEEDS.stop and first + count > TEST_SEEDS.start:
        first += 2**62
    return range(first, first + count)


class Generation(NamedTuple):
    """What a generation of the cross-entropy method has led to: the mean score of all candidates and of the best fifth, and the
    mean of these."""
    number: int
    mean_score: float
    elite_score: float
    mean: Vector


def cem(scores: Callable[[Vector, range], Vector], initial: Vector, deviation: float, *, generations: int, candidates: int,
        runs: int, seed: int = 1, state: dict[str, Any] | None = None) -> Iterator[Generation]:
    """The cross-entropy method. scores(vectors, seeds): one score of each row of `vectors`, which learning maximizes, over the
    episodes with these seeds: the same for all candidates, others in each generation. state: receives the state after each
    generation; one that an earlier search has filled goes on."""
    source = np.random.default_rng(seed)
    mean, deviations, start = initial, np.full(len(initial), deviation), 0
    if state:
        mean, deviations, start = state["mean"], state["deviations"], state["generation"] + 1
        source.bit_generator.state = state["random"]
    elite = max(2, candidates // 5)
    for generation in range(start, generations):
        seeds = training_seeds(1 + (seed - 1) * 10**9 + generation * runs, runs)
        vectors = mean + deviations * source.standard_normal((candidates, len(mean)))
        values = scores(vectors, seeds)
        best = np.argsort(values)[-elite:]
        # Added noise, which decreases, keeps the deviation from collapsing early (Szita and Lőrincz 2006).
        noise = 0.3 * deviation * max(0, 1 - generation / (0.7 * generations))
        mean, deviations = vectors[best].mean(axis=0), np.sqrt(vectors[best].var(axis=0) + noise**2)
        if state is not None:
            state.update(generation=generation, mean=mean, deviations=deviations, random=source.bit_generator.state)
        yield Generation(generation, float(values.mean()), float(values[best].mean()), mean)


def find_task(name: str) -> tuple[str, Make, list[pathlib.Path]]:
    """A name for the folder, the function that makes a task's environment, and the task's files; ValueError if there is none of
    that name. The function raises it for what declares no reward or no length of its episodes."""
    path, _, member = name.partition(":")
    create: Make
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
        short, sources, create = member, [path, found.script], found().make_vec
    else:
        short, script = pathlib.Path(name).stem, name
        if not path.endswith(".lua"):
            known = {task.id[len("smartsurf/"):-len("-v0")]: task.id for task in TASKS}
            short = name.removeprefix("smartsurf/").removesuffix("-v0")
            if short not in known:
                raise ValueError(f"task {name}: must be EXPERIMENT.lua, FILE.py:CLASS or one of {', '.join(known)}")
            script = task_file(known[short])
        sources, create = [script], functools.partial(VectorEnv, script)

    def make(num_envs: int, **arguments: Any) -> VectorEnv:
        envs = create(num_envs, **arguments)
        task = envs.task if isinstance(envs, TaskVectorEnv) else Task()
        if not envs._description["has_reward"] and type(task).reward is Task.reward:
            raise ValueError(f"task {name}: has no reward: declare reward()")
        if envs._description["episode_seconds"] is None and task.episode_seconds is None:
            raise ValueError(f"task {name}: its episodes have no length: declare episode {{ seconds = … }}, or a Task's episode_seconds")
        return envs
    return short, make, [pathlib.Path(source) for source in sources if source is not None]


def input_names(channels: Sequence[Channel]) -> list[str]:
    """The names of a LocalPolicy's inputs for all planes of these channels."""
    return [name for c in channels for name in plane_names(c.name, c.components)]


def has_success(envs: VectorEnv) -> bool:
    """Whether the experiment or its Task says when the goal is reached."""
    task = envs.task if isinstance(envs, TaskVectorEnv) else Task()
    return bool(envs._description["has_success"]) or type(task).success is not Task.success


def run_episodes(envs: VectorEnv, observation: Any, command: Callable[[Any, FloatArray, Flags], None]) -> tuple[Vector, Flags]:
    """Returns and successes of the episodes that reset() has started with this observation. command(observation, commands,
    running) fills in the commands of the worlds that still run."""
    total, running, success = np.zeros(envs.num_envs), np.ones(envs.num_envs, np.bool_), np.zeros(envs.num_envs, np.bool_)
    commands = np.zeros(envs.action_space.shape or (), np.float32)
    while running.any():
        command(observation, commands, running)
        observation, rewards, terminated, truncated, infos = envs.step(commands)
        total += np.where(running, finite_rewards(rewards, infos, -1e9), 0)  # a world that fails is the worst
        success |= running & infos["success"]
        running &= ~(terminated | truncated)
    return total, success


class Tester:
    """Episodes of the TEST_SEEDS, run by a policy without exploration."""

    def __init__(self, make: Make, how: argparse.Namespace):
        self._envs, self._of_planes = make(how.test, threads=how.threads, copy=False), how.policy == "cnn"

    def __call__(self, policy: LocalPolicy | NetworkPolicy) -> tuple[float, float | None]:
        """Mean return and share of successes, None without a goal."""
        envs, inputs = self._envs, input_names(self._envs.sensor_channels)
        if isinstance(policy, LocalPolicy):
            policy.reset()

        def command(observation: Any, commands: FloatArray, running: Flags) -> None:
            if isinstance(policy, LocalPolicy):
                for c, plane in enumerate(policy(dict(zip(inputs, envs._observations.swapaxes(0, 1)))).values()):
                    commands[:, c] = plane
            else:
                commands[...] = policy(envs._observations if self._of_planes else observation)
        total, success = run_episodes(envs, envs.reset(seed=TEST_SEEDS.start)[0], command)
        return float(total.mean()), float(success.mean()) if has_success(envs) else None

    def close(self) -> None:
        self._envs.close()


class Log:
    """What a training leaves in its folder after each iteration: the policy, curve.csv with one row per iteration, TensorBoard's
    events and the checkpoint from which --resume goes on; and a line on the terminal. An older training stays until then."""
    FIELDS = ("iteration", "samples", "episodes", "cpu_s", "wall_s", "return", "best_return", "success_rate", "test_return",
              "test_success_rate")

    def __init__(self, folder: pathlib.Path, make: Make, how: argparse.Namespace, title: str, sources: Sequence[pathlib.Path]):
        """sources: the task's files."""
        self._folder, self._title, self._checkpoint = folder, title, folder / "checkpoint.npz"
        # All that the policy depends on.
        self._given = {"smartsurf": __version__, "TASK": pathlib.Path(how.task).name}
        for source in sources:
            self._given[f"SHA-256 of {source.name}"] = hashlib.sha256(source.read_bytes()).hexdigest()[:16]
        for name, value in vars(how).items():
            if name not in ("task", "out", "resume", "threads"):
                text = ",".join(map(str, value or [0])) if isinstance(value, tuple) else str(value)
                self._given[f"--{name.replace('_', '-')}"] = text
        kept: dict[str, Any] = (_read_checkpoint(self._checkpoint) or {}) if how.resume else {}
        self._require_same(kept.get("given", self._given))
        self.state: dict[str, Any] | None = kept.get("state")  # of the learner, after the latest iteration; None before the first
        self._rows: list[dict[str, Any]] = kept.get("rows", [])
        self.finished = self.iterations == how.iterations
        if how.resume:
            print(f"{folder}: has {self.iterations} of {how.iterations} iterations", flush=True)
        folder.mkdir(parents=True, exist_ok=True)
        self._tester = Tester(make, how) if how.test and not self.finished else None
        self._board: Any = None
        self._start, self._cpu = time.monotonic() - kept.get("wall_s", 0.0), time.process_time() - kept.get("cpu_s", 0.0)

    @property
    def iterations(self) -> int:
        """That are done."""
        return len(self._rows)

    def _require_same(self, kept: Mapping[str, str]) -> None:
        names = [name for name in {**kept, **self._given} if kept.get(name) != self._given.get(name)]
        if names:
            was, now = (", ".join(f"{name} {values.get(name)}" for name in names) for values in (kept, self._given))
            raise ValueError(f"--resume: {self._folder} was trained with {was}; now with {now}: give the same arguments, or train "
                             "anew without --resume")

    def add(self, samples: int, episodes: int, returns: Vector, best: float, success: float | None,
            policy: LocalPolicy | NetworkPolicy, state: dict[str, Any] | None) -> None:
        """returns: of the iteration's episodes, or of its candidates. best: of the best ones. success: share of the episodes, None
        without a goal. policy: what is learned so far, which is tested; the times are without that. state: of the learner, None if
        it cannot go on from one."""
        cpu, wall = time.process_time(), time.monotonic()
        row: dict[str, Any] = {
            "iteration": len(self._rows), "samples": samples, "episodes": episodes, "cpu_s": f"{cpu - self._cpu:.2f}",
            "wall_s": f"{wall - self._start:.2f}", "return": f"{np.mean(returns) if len(returns) else np.nan:.6g}",
            "best_return": f"{best:.6g}", "success_rate": _text(success, ".4f")}
        if self._tester is not None:
            tested, won = self._tester(policy)
            row.update(test_return=f"{tested:.6g}", test_success_rate=_text(won, ".4f"))
        self._rows.append(row)
        save_policy(policy, self._folder, self._title)
        with replaced(self._folder / "curve.csv") as part, part.open("w", newline="") as file:
            rows = csv.DictWriter(file, self.FIELDS)
            rows.writeheader()
            rows.writerows(self._rows)
        if state is None:
            self._checkpoint.unlink(missing_ok=True)
        else:
            _write_checkpoint(self._checkpoint, {"given": self._given, "rows": self._rows, "cpu_s": cpu - self._cpu,
                                                 "wall_s": wall - self._start, "state": state})
        self._write_board()
        line = (f"{row['iteration']:4}: {samples} samples, {episodes} episodes, {row['cpu_s']} s, return {float(row['return']):.4g}, "
                f"best {best:.4g}" + _text(success, ".0%", ", success "))
        if self._tester is not None:
            line += f", test {tested:.4g}" + _text(won, ".0%", ", ")
        print(line, flush=True)
        self._cpu += time.process_time() - cpu
        self._start += time.monotonic() - wall

    def _write_board(self) -> None:
        new = self._rows[-1:]
        if self._board is None:  # of which TensorBoard would draw two files as one training
            for old in self._folder.glob("events.out.tfevents.*"):
                old.unlink()
            self._board, new = _board(self._folder), self._rows
        for row in new if self._board else []:
            for name in self.FIELDS[3:]:
                if row.get(name):  # "" of a rate that is not known
                    self._board.add_scalar(f"train/{name}", float(row[name]), row["samples"])

    def close(self) -> None:
        if self._tester is not None:
            self._tester.close()
        if self._board is not None:
            self._board.close()


def _text(share: float | None, form: str, before: str = "") -> str:
    """Nothing of a share that is not known."""
    return "" if share is None else before + format(share, form)


def _write_checkpoint(path: pathlib.Path, state: dict[str, Any]) -> None:
    """state: dicts, lists, arrays and what JSON has."""
    arrays: dict[str, Any] = {}

    def packed(value: Any) -> Any:
        if isinstance(value, dict):
            return {name: packed(part) for name, part in value.items()}
        if isinstance(value, (list, tuple)):
            return [packed(part) for part in value]
        if isinstance(value, np.ndarray):
            arrays[f"array{len(arrays)}"] = value
            return {_ARRAY: f"array{len(arrays) - 1}"}
        return value
    text = json.dumps(packed(state)).encode()
    with replaced(path) as part, part.open("wb") as file:
        np.savez(file, state=np.frombuffer(text, np.uint8), **arrays)


def _read_checkpoint(path: pathlib.Path) -> Any:
    """What _write_checkpoint() was given; None without a file."""
    try:
        with np.load(path, allow_pickle=False) as file:
            arrays = {name: file[name] for name in file.files}
        return json.loads(arrays["state"].tobytes(), object_hook=lambda part: arrays[part[_ARRAY]] if _ARRAY in part else part)
    except FileNotFoundError:
        return None
    except (AttributeError, EOFError, KeyError, TypeError, ValueError, zipfile.BadZipFile) as error:
        raise ValueError(f"{path}: is no checkpoint of smartsurf train: {error}") from error


_ARRAY = "an array of the file"  # the key of a dict that stands for one


def _board(folder: pathlib.Path) -> Any:
    """A writer for TensorBoard, None without tensorboard and one of the packages that write for it."""
    for module in ("torch.utils.tensorboard", "tensorboardX"):
        try:
            return importlib.import_module(module).SummaryWriter(str(folder))
        except ImportError:
            continue
    return None


def save_policy(policy: LocalPolicy | NetworkPolicy, folder: pathlib.Path, title: str) -> None:
    """Also removes the files of an older policy that this one does not have."""
    program, model = folder / "policy.aps", folder / "policy.onnx"
    if isinstance(policy, LocalPolicy):
        export_policy(policy, program, title)
    else:
        program.unlink(missing_ok=True)
    if not importlib.util.find_spec("onnx"):
        model.unlink(missing_ok=True)
    elif isinstance(policy, NetworkPolicy):
        policy.export(model)
    elif set(policy.inputs) - {"row", "column"} or policy.memory:
        export_onnx(policy, model)
    else:
        model.unlink(missing_ok=True)


# ---- cross-entropy method


def train_cem(make: Make, how: argparse.Namespace, log: Log) -> LocalPolicy:
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

    state = log.state or {"samples": 0, "search": {}}
    samples, won = state["samples"], 0.0

    def scores(vectors: Vector, seeds: range) -> Vector:
        nonlocal won
        policies = [policy(vector) for vector in vectors]
        envs.reset(seed=[seed for _ in policies for seed in seeds])
        planes = envs._observations

        def command(_: Any, commands: FloatArray, running: Flags) -> None:
            nonlocal samples
            samples += int(running.sum())
            for k, made in enumerate(policies):
                own = slice(k * len(seeds), (k + 1) * len(seeds))
                if running[own].any():
                    sensed = dict(zip(inputs, planes[own].swapaxes(0, 1)))
                    for c, plane in enumerate(made(sensed).values()):
                        commands[own, c] = plane
        # A Task's own observation is for networks of the whole surface.
        total, success = run_episodes(envs, None, command)
        won = float(success.mean())
        means: Vector = total.reshape(len(policies), -1).mean(axis=1)
        return means

    best = policy(np.zeros(count))
    for found in cem(scores, np.zeros(count), how.deviation, generations=how.iterations, candidates=how.candidates, runs=how.runs,
                     seed=how.seed, state=state["search"]):
        best, state["samples"] = policy(found.mean), samples
        log.add(samples, (found.number + 1) * how.candidates * how.runs, np.array([found.mean_score]), found.elite_score,
                won if has_success(envs) else None, best, state)
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
