"""The learning tasks: experiments, networks, and their evaluation as APRON programs."""
import concurrent.futures
import os
import pathlib
import sys
import tempfile

import numpy as np

HERE = pathlib.Path(__file__).resolve().parent
# An installed package first, then this checkout's build; cem and table need only the sources.
sys.path += [str(HERE.parent.parent / folder) for folder in ("build/release/python", "smartsurf/python")
             if (HERE.parent.parent / folder / "smartsurf").is_dir()]
from smartsurf.policy import LocalPolicy, export_policy  # noqa: E402
from smartsurf.run import run  # noqa: E402

# Which taps (own, north, east, south, west) share a weight. A tap in no group has the weight 0.
OWN = [[0]]
ISOTROPIC = [[0], [1, 2, 3, 4]]
NORTH_SOUTH = [[0], [1, 3], [2], [4]]


class Task:
    """An experiment, its hand-written controller, and the network that learns it.

    The experiment's metric `success` is 1 or 0; `score(metrics)` is what learning maximizes. start and deviation: the
    network's outputs at first, and the standard deviation of the search. search: its generations, candidates per generation
    and runs per candidate. shapes and decisions: of the commands of scripts/learn/ppo, and how many it trains with."""

    def __init__(self, name, title, experiment, controller, until, inputs, actions, ties, *, hidden=(), memory=0, options=None,
                 start=0.0, deviation=1.0, search=(20, 24, 6), shapes=("offset", "south", "east"),
                 decisions=60_000, score=lambda metrics: metrics["score"]):
        self.name, self.title, self.until, self.score = name, title, until, score
        self.experiment, self.controller, self.options = HERE.parent / experiment, HERE.parent / controller, options or {}
        self.inputs, self.actions, self.ties, self.hidden, self.memory = inputs, actions, ties, hidden, memory
        self.start, self.deviation, self.search, self.shapes, self.decisions = start, deviation, search, shapes, decisions

    def sizes(self):
        return [len(self.inputs) + self.memory, *self.hidden, len(self.actions) + self.memory]

    def parameters(self):
        """The number of parameters: one weight per group of taps, and the biases."""
        sizes = self.sizes()
        return sum(n * (len(self.ties) * m + 1) for m, n in zip(sizes, sizes[1:]))

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

    def evaluate(self, program, seeds, smartsurf=None):
        """Runs the APRON program with consecutive seeds, in one process → the metrics of each run."""
        stats = run(self.experiment, os.fspath(program), seeds[0], self.options, until=self.until, worlds=len(seeds), threads=1,
                    timeout=300, smartsurf=smartsurf)
        return [world["metrics"] for world in stats["runs"]]

    def scores(self, vectors, seeds, smartsurf=None, jobs=2):
        """The mean score of each vector's network over the same seeds."""
        with tempfile.TemporaryDirectory(prefix="smartsurf-learn-") as folder, concurrent.futures.ThreadPoolExecutor(jobs) as pool:
            def score(k):
                program = pathlib.Path(folder, f"{k}.aps")
                export_policy(self.policy(vectors[k]), program)
                return np.mean([self.score(metrics) for metrics in self.evaluate(program, seeds, smartsurf)])
            return np.array(list(pool.map(score, range(len(vectors)))))


def approach(metrics):
    """Small distances during the run, and in its last second."""
    return metrics["score"] - metrics["error_u"]


def sorting(metrics):
    """Purity, and less time to get there."""
    return metrics["purity"] - metrics.get("time_to_95_s", 30.0) / 30.0


TASKS = {task.name: task for task in (
    Task("ball", "a ball to any target, 8×8 pins", "learn/ball.lua", "learn/ball.aps", 10, ("colour.r", "colour.b"),
         (("height", 0, 5),), ISOTROPIC, memory=1, start=2.5, deviation=0.5, search=(24, 32, 8), shapes=("bowl", "south", "east"),
         decisions=100_000,
         score=approach),
    Task("box", "a box to a pose, 16×16 rolling balls", "learn/box.lua", "learn/box.aps", 10, ("row", "column", "proximity_hit"),
         (("spin_x", -20, 20), ("spin_y", -20, 20)), OWN),
    Task("sort", "two kinds sorted by colour, 24×24 pins", "tasks/colour_sort.lua", "tasks/colour_sort.aps", 30,
         ("colour.r", "colour.b"), (("height", 0, 6),), NORTH_SOUTH, memory=1, options={"n": 24, "count": 3}, start=3.0,
         deviation=2.0, score=sorting),
)}
