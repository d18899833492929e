"""The learning tasks: experiments, policies, and their evaluation as APRON programs."""
import os
import pathlib
import re
import sys
import tempfile
from concurrent.futures import ThreadPoolExecutor

import numpy as np

HERE = pathlib.Path(__file__).resolve().parent
# An installed package first, then this checkout's build; cem and table need only the sources.
sys.path += [str(HERE.parent.parent / folder) for folder in ("build/release/python", "smartsurf/python")
             if (HERE.parent.parent / folder / "smartsurf").is_dir()]
import patch  # noqa: E402
from smartsurf.policy import LocalPolicy, export_policy  # noqa: E402
from smartsurf.run import run  # noqa: E402

# Which taps (own, north, east, south, west) share a weight. A tap in no group has the weight 0.
OWN = [[0]]
ISOTROPIC = [[0], [1, 2, 3, 4]]
NORTH_SOUTH = [[0], [1, 3], [2], [4]]
# What a decision of scripts/learn/ppo sets: the place of a funnel's mouth and its slope.
FUNNEL = ("row", "column", "slope")


def processor_time():
    """Seconds that this process and the programs that it ran have computed."""
    return sum(os.times()[:4])


class Task:
    """An experiment, its hand-written controller, and the policy that learns it.

    The experiment's metric `success` is 1 or 0; `score(metrics)` is what learning maximizes. initial and deviation: mean and
    standard deviation of the parameters at the start of the search. search: its generations, candidates per generation and
    runs per candidate. A subclass knows what the parameters mean: population(vectors, envs), whose commands(observations) is one
    tick of as many policies, and export(vector, path, method), which writes one as an APRON program."""

    def __init__(self, name, title, experiment, controller, until, initial, *, options=None, deviation=1.0, search=(20, 24, 6),
                 score=lambda metrics: metrics["score"]):
        self.name, self.title, self.until, self.score = name, title, until, score
        self.experiment, self.controller, self.options = HERE.parent / experiment, HERE.parent / controller, options or {}
        self.envs = None  # of the last call of scores
        self.initial, self.deviation, self.search = np.array(initial, float), deviation, search

    def parameters(self):
        """The number of parameters."""
        return len(self.initial)

    def evaluate(self, program, seeds, smartsurf=None, **options):
        """Runs the APRON program with consecutive seeds, in one process → the metrics of each run. options: further ones of the
        experiment."""
        stats = run(self.experiment, os.fspath(program), seeds[0], {**self.options, **options}, until=self.until, worlds=len(seeds), threads=1,
                    timeout=300, smartsurf=smartsurf)
        return [world["metrics"] for world in stats["runs"]]

    def scores(self, vectors, seeds, threads=2):
        """The score of each vector's policy: the mean over the seeds, all of them at once, in this process."""
        worlds = len(vectors) * len(seeds)
        if self.envs is None or self.envs.num_envs != worlds:
            from smartsurf import VectorEnv  # needs the compiled package and Gymnasium, unlike the rest
            self.envs = VectorEnv(self.experiment, worlds, threads, set=self.options, copy=False, strict=True, autoreset_mode="Disabled")
        population, metrics = self.population(vectors, self.envs), [None] * worlds
        observations, _ = self.envs.reset(seed=[seed for _ in vectors for seed in seeds])
        while None in metrics:
            observations, _, _, _, infos = self.envs.step(population.commands(observations))
            for world in np.flatnonzero(infos.get("_metrics", ())):
                metrics[world] = metrics[world] or metrics_of(infos, world)
        return np.reshape([self.score(m) for m in metrics], (len(vectors), -1)).mean(axis=1)


def metrics_of(info, world):
    """The metrics of the episode that has ended in a world, from the info of a VectorEnv."""
    of = info["metrics"]
    return {name: float(of[name][world]) for name in of if "_" + name in of and of["_" + name][world]}


class NetworkTask(Task):
    """A task whose policy is a LocalPolicy, the same for every cell.

    start: added to the biases of the network's commands. shapes: what a decision of scripts/learn/ppo sets, FUNNEL or the factors
    of shapes of the whole surface. decisions: how many it trains with."""

    def __init__(self, name, title, experiment, controller, until, inputs, actions, ties, *, hidden=(), memory=0, start=0.0,
                 initial=None, shapes=("offset", "south", "east"), decisions=60_000, **more):
        self.inputs, self.actions, self.ties, self.hidden, self.memory = inputs, actions, ties, hidden, memory
        self.start, self.shapes, self.decisions = start, shapes, decisions
        sizes = self.sizes()
        # One weight per group of taps, and the biases.
        count = sum(n * (len(ties) * m + 1) for m, n in zip(sizes, sizes[1:]))
        super().__init__(name, title, experiment, controller, until, np.zeros(count) if initial is None else initial, **more)

    def sizes(self):
        return [len(self.inputs) + self.memory, *self.hidden, len(self.actions) + self.memory]

    def policy(self, vector):
        """The network with these parameters: layer by layer the weights, shape (out, in, groups), then the biases."""
        sizes, layers, at = self.sizes(), [], 0
        for m, n in zip(sizes, sizes[1:]):
            tied = np.reshape(vector[at:at + n * m * len(self.ties)], (n, m, len(self.ties)))
            weights = np.zeros((n, m, 5))
            for group, taps in enumerate(self.ties):
                weights[:, :, taps] = tied[:, :, group:group + 1]
            at += tied.size
            biases = np.array(vector[at:at + n])
            at += n
            layers.append((weights, biases))
        layers[-1][1][:len(self.actions)] += self.start
        return LocalPolicy(self.inputs, self.actions, layers, self.memory)

    def population(self, vectors, envs):
        return Population([self.policy(vector) for vector in vectors], envs)

    def export(self, vector, path, method):
        export_policy(self.policy(vector), path, f"{self.title}: learned by {method}.")


class PatchTask(Task):
    """A task of tactile pillars, whose policy shapes a patch around the load (patch.py). goal, level, period and step: as
    of patch.Patches."""

    TRAVEL = 5.5

    def __init__(self, name, title, until, initial, *, goal, level=None, period=4.0, step=0.5, **more):
        super().__init__(name, title, f"tasks/{name}.lua", f"tasks/{name}.aps", until, initial, **more)
        self.patch = (self.TRAVEL, period, goal, level, step)

    def population(self, vectors, envs):
        return patch.Patches(vectors, envs, *self.patch)

    def export(self, vector, path, method):
        patch.export(vector, path, f"{self.title}: learned by {method}.", *self.patch)


class GainTask(Task):
    """A task whose policy is the hand-written program with other constants (`!define`): gains maps their names to mean and
    standard deviation at the start. The search varies them by these deviations."""

    def __init__(self, name, title, until, gains, **more):
        self.gains = gains
        super().__init__(name, title, f"tasks/{name}.lua", f"tasks/{name}.aps", until, np.zeros(len(gains)), **more)

    def scores(self, vectors, seeds, threads=2):
        with tempfile.TemporaryDirectory(prefix="smartsurf-learn-") as folder:
            def score(number):
                program = pathlib.Path(folder, f"{number}.aps")
                self.export(vectors[number], program, "")
                return np.mean([self.score(metrics) for metrics in self.evaluate(program, seeds)])
            with ThreadPoolExecutor(threads) as pool:
                return np.array(list(pool.map(score, range(len(vectors)))))

    def export(self, vector, path, method):
        values = {name: mean + deviation * value for (name, (mean, deviation)), value in zip(self.gains.items(), vector)}
        lines = [f"// {self.title}: constants learned by {method}."]
        for line in self.controller.read_text().splitlines():
            found = re.match(r"!define\((\w+), ", line)
            value = values.pop(found[1], None) if found else None
            lines.append(line if value is None else f"!define({found[1]}, {value:.4f})")
        assert not values, f"{self.controller}: no !define of {', '.join(values)}"
        pathlib.Path(path).write_text("\n".join(lines) + "\n")


class Population:
    """Many networks of equal sizes, each in the same number of worlds of a VectorEnv. Its matrix products round otherwise
    than LocalPolicy does, which suits a search; what is found is exported and tested as a program."""

    def __init__(self, policies, envs):
        first, rows, columns = policies[0], envs.rows, envs.columns
        names = [name for channel in envs.sensor_channels for name in
                 ([channel.name] if channel.components == 1 else [f"{channel.name}.{c}" for c in "rgb"])]
        self.names, self.inputs, self.actions = names, first.inputs, first.actions
        self.shape = (len(policies), envs.num_envs // len(policies), rows, columns)
        # (population, inputs × taps, outputs) and (population, 1, outputs) of each layer.
        self.layers = [(np.stack([p.layers[k][0].reshape(len(p.layers[k][1]), -1).T for p in policies]),
                        np.stack([p.layers[k][1] for p in policies])[:, None]) for k in range(len(first.layers))]
        places = np.mgrid[0:rows, 0:columns] - (np.array([rows, columns])[:, None, None] - 1) / 2
        self.places = {name: np.broadcast_to(plane.astype(np.float32), self.shape) for name, plane in zip(("row", "column"), places)}
        self.memory = np.zeros((first.memory, *self.shape), np.float32)

    def commands(self, observations):
        """One tick of all networks: worlds × planes × rows × columns → worlds × channels × rows × columns."""
        planes = [self.places[name] if name in self.places else observations[:, self.names.index(name)].reshape(self.shape)
                  for name in self.inputs]
        planes = np.concatenate([np.reshape(planes, (-1, *self.shape)), self.memory])
        for number, (weights, biases) in enumerate(self.layers):
            taps = [planes]
            for axis, step in ((3, 1), (4, -1), (3, -1), (4, 1)):  # north, east, south, west: of planes × population × seeds × …
                shifted = np.roll(planes, step, axis)
                np.moveaxis(shifted, axis, 0)[0 if step == 1 else -1] = 0
                taps.append(shifted)
            seen = np.moveaxis(np.stack(taps, axis=1).reshape(-1, self.shape[0], np.prod(self.shape[1:])), 0, 2)
            planes = np.moveaxis(seen @ weights + biases, 2, 0).reshape(-1, *self.shape)
            if number + 1 < len(self.layers):
                planes = np.maximum(planes, 0)
        self.memory = np.clip(planes[len(self.actions):], -1, 1)
        heights = [np.clip(plane, low, high).reshape(-1, *self.shape[2:]) for plane, (_, low, high) in zip(planes, self.actions)]
        return np.stack(heights, axis=1).astype(np.float32)


def approach(metrics):
    """Small distances during the run, and in its last second."""
    return metrics["score"] - metrics["error_u"]


def sorting(metrics):
    """Purity, and less time to get there."""
    return metrics["purity"] - metrics.get("time_to_95_s", 30.0) / 30.0


def succeeding(metrics):
    """The task's own score, and success."""
    return metrics["score"] + metrics["success"]


def aligning(metrics):
    """Small errors at the end, in the goal's, and less time to get there."""
    return -min(metrics["error_u"] / 0.3, 5) - min(metrics["angle_error_deg"] / 5, 5) - metrics.get("time_s", 40.0) / 20


# The ball's network at first: height, memory of the lamp, and memory of the way to it, each from the colours red and blue and
# the memories (own, neighbours of each), then the biases. Below the ball the lamp is remembered: red makes up for the bias.
# The way spreads from the lamp to neighbours, and the surface sinks with it.
FUNNEL_NETWORK = [0, 0, 0, 0, 0, 0, -5.5, 0,
                  6, 0, 12, 0, 3, 0, 0, 0,
                  0, 0, 0, 0, 0.5, 0, 0, 0.22,
                  2.5, -6, 0.5]


TASKS = {task.name: task for task in (
    NetworkTask("ball", "a ball to any target, 8×8 pins", "learn/ball.lua", "learn/ball.aps", 10,
                ("colour.r", "colour.b"), (("height", 0, 5),), ISOTROPIC, memory=2, start=2.5, initial=FUNNEL_NETWORK, deviation=0.05,
                search=(12, 32, 8), shapes=FUNNEL, decisions=200_000, score=approach),
    NetworkTask("box", "a box to a pose, 16×16 rolling balls", "learn/box.lua", "learn/box.aps", 10,
                ("row", "column", "proximity_hit"), (("spin_x", -20, 20), ("spin_y", -20, 20)), OWN),
    NetworkTask("sort", "two kinds sorted by colour, 24×24 pins", "tasks/colour_sort.lua", "tasks/colour_sort.aps", 30,
                ("colour.r", "colour.b"), (("height", 0, 6),), NORTH_SOUTH, memory=1, options={"n": 24, "count": 3, "seconds": 30},
                start=3.0, deviation=2.0, decisions=6_000_000, score=sorting),
    PatchTask("arraybot_lift", "an object lifted, 16×16 tactile pillars", 8, patch.bowl(0, 0.1, 0), goal="here", level=0.0,
              step=0.05, deviation=0.1, search=(16, 40, 24), score=succeeding),
    PatchTask("arraybot_flip", "an object turned over, 16×16 tactile pillars", 10, patch.bowl(1, 0, -1), goal="over",
              deviation=0.15, search=(8, 30, 10), score=succeeding),
    PatchTask("arraybot_relocate", "an object to any goal, 16×16 tactile pillars", 20, patch.bowl(0.5, 0.2, -0.2), goal="lamp",
              deviation=0.1, search=(12, 40, 8)),
    GainTask("delta_align", "a polygon to the middle along the rows, 8×8 delta robots", 40,
             {"STRIDE": (0.25, 0.15), "PACE": (4, 2), "LIFT": (0.1, 0.1), "MIDDLE": (1.2, 0.2), "LEAD": (0.8, 0.5), "NEAR": (3, 1.5),
              "SMOOTH": (20, 15)}, search=(8, 16, 6), score=aligning),
)}
NETWORKS = {name: task for name, task in TASKS.items() if isinstance(task, NetworkTask)}
