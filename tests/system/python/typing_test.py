"""Type checkers see the package: mypy --strict accepts it; mypy and pyright accept a user's script, and find all mistakes planted
in it. pyright is that of the package basedpyright, which brings its JavaScript runtime as a wheel."""
import importlib.util
import json
import os
import pathlib
import re
import subprocess
import sys
import tempfile
import unittest

try:
    import gymnasium  # noqa: F401
    import mypy  # noqa: F401
    import smartsurf
except ImportError as error:
    print(f"skipped: {error}; scripts/setup --python installs it where a package index can be reached")
    sys.exit(77)
from experiments import ROOT, ExperimentTest

GOOD = """
import numpy as np
import smartsurf

simulation = smartsurf.Simulation("plate.lua", seed=3, set={"size": 4})
reward, terminated, truncated = simulation.step({"height": np.ones((4, 4))})
total: float = reward + simulation.time
near = simulation.sensors["proximity"].mean()
simulation.set_parameter("surface.friction", 0.3)
simulation.randomise({"surface.friction": (0.1, 0.9), "object.*.mass": None})
state: bytes = simulation.save()
env = smartsurf.Env("plate.lua", render_mode="rgb_array")
observation, info = env.reset(seed=1)
env.simulation.teleport("ball", position=(0.0, 1.0, 2.0))
envs = smartsurf.VectorEnv("plate.lua", 64, threads=2, set=[{"size": 1}] * 64)
observations, infos = envs.reset(seed=[1] * 64)
recorded = smartsurf.VectorEnv("plate.lua", 64, record="episodes", record_worlds=[0, 3], record_every=10)
observations, rewards, ended, cut, infos = envs.step(np.zeros((64, 1, 4, 4), np.float32))
mass: float = float(envs.get_parameter("object.#0.mass").sum()) + float(rewards.sum())


class Turn(smartsurf.Task):
    scene = "surface {}"
    goals = {"angle": (-3.0, 3.0)}

    def reward(self, state: smartsurf.State) -> object:
        return -abs(state.yaw("box") - state.goals["angle"])


learner: smartsurf.TaskVectorEnv = Turn().make_vec(64, threads=2)
smartsurf.plot({"layers": []}, "chart.svg")
"""

# Each line is wrong, alone.
MISTAKES = """
smartsurf.Simulaton("plate.lua")
smartsurf.VectorENV("plate.lua")
smartsurf.Simulation("plate.lua", sed=3)
smartsurf.Simulation(3)
smartsurf.Simulation("plate.lua", seed="three")
smartsurf.Simulation("plate.lua", threads=1.5)
simulation.stepp()
simulation.sensor["proximity"]
simulation.sensors["proximity"].maen()
simulation.sensors[3]
a: str = simulation.tick
simulation.tick = 3
b, c = simulation.step()
simulation.reset("7")
simulation.restore("state")
simulation.save().items()
simulation.randomise({"surface.friction": 0.5})
simulation.teleport("ball", place=(0, 0, 0))
simulation.push(0, forse=(0, 0, 1))
simulation.render(width="wide")
smartsurf.Env("plate.lua", render_mode=3)
smartsurf.Env(shm=4)
smartsurf.Env("plate.lua", strict="yes", sizes=3)
env.reset(sed=3)
env.simulation.objcts
env.simulation.seed + "x"
smartsurf.VectorEnv("plate.lua", num_envs="64")
smartsurf.VectorEnv("plate.lua", 64, thread=2)
smartsurf.VectorEnv("plate.lua", max_episode_steps=1.5)
envs.objects["position"].shpae
envs.set_parameter(3, 1.0)
envs.randomise([("mass", (0, 1))])
envs.save("0")
envs.get_parameters("mass")
d: int = envs.period
e: int = envs.sensor_channels[0].name
envs.sensor_channels[0].mininum
learner.task.rewrad
Turn().make_vec("64")
Turn().make_vec(num_env=64)
Turn().make_vec(64, copy="no")
Turn().make(shm=3)
Turn().make(seeds=1)
smartsurf.parallel_env("plate.lua", blocks=2)
smartsurf.LocalPolicy(["proximity"], [("height", 0)], [])
smartsurf.run("plate.lua", seed="1")
smartsurf.attach(3)
smartsurf.export_policy("policy.aps")
smartsurf.load_extension(3)
smartsurf.VectorEnv("plate.lua", 64, record=3)
envs.reset(seed="1")
smartsurf.NetworkPolicy([], (2, 4, 4), low=0, high=4)
smartsurf.MinariCollector(env)
"""


CACHE = tempfile.TemporaryDirectory()


class Types(ExperimentTest):
    maxDiff = None

    def check(self, *arguments):
        """The lines of errors, and the output."""
        path = os.environ["PYTHONPATH"].split(os.pathsep)[0]
        result = subprocess.run(
            [sys.executable, "-m", "mypy", "--strict", "--config-file", str(ROOT / "pyproject.toml"), "--no-error-summary",
             "--cache-dir", CACHE.name, *arguments],
            capture_output=True, text=True, env={**os.environ, "MYPYPATH": os.path.abspath(path)}, cwd=self.folder)
        output = result.stdout + result.stderr
        self.assertIn(result.returncode, (0, 1), output)
        return [int(line) for line in re.findall(r"^script.py:(\d+): error", output, re.MULTILINE)], output

    def check_with_pyright(self, script):
        """As check(), of pyright's own rules."""
        config = {"typeCheckingMode": "standard", "pythonVersion": "3.11",
                  "extraPaths": [os.path.abspath(path) for path in os.environ["PYTHONPATH"].split(os.pathsep)]}
        (self.folder / "pyrightconfig.json").write_text(json.dumps(config))
        result = subprocess.run([sys.executable, "-m", "basedpyright", "--outputjson", "--pythonpath", sys.executable, script],
                                capture_output=True, text=True, cwd=self.folder)
        self.assertIn(result.returncode, (0, 1), result.stdout + result.stderr)
        errors = [d for d in json.loads(result.stdout)["generalDiagnostics"] if d["severity"] == "error"]
        lines = [d["range"]["start"]["line"] + 1 for d in errors]
        return lines, "\n".join(f"{line}: {d['message']}" for line, d in zip(lines, errors))

    def test_mypy_finds_every_planted_mistake_and_nothing_else(self):
        self.finds_every_mistake(self.check)

    @unittest.skipUnless(importlib.util.find_spec("basedpyright"), "basedpyright is missing: scripts/setup --python installs it")
    def test_pyright_finds_every_planted_mistake_and_nothing_else(self):
        self.finds_every_mistake(self.check_with_pyright)

    def finds_every_mistake(self, check):
        text = GOOD + MISTAKES.lstrip("\n")
        (self.folder / "script.py").write_text(text)
        found, output = check("script.py")
        first = GOOD.count("\n") + 1
        expected = range(first, text.count("\n") + 1)
        lines = text.splitlines()
        self.assertEqual([lines[i - 1] for i in expected if i not in found], [], "not found; " + output[:2000])
        self.assertEqual([lines[i - 1] for i in found if i not in expected], [], output)
        self.assertGreater(len(expected), 40)

    def test_the_package_itself_is_strict(self):
        package = pathlib.Path(smartsurf.__file__).parent
        _, output = self.check(str(package))
        self.assertEqual(output, "")

    def test_names_are_found_by_completion(self):
        self.assertTrue(set(smartsurf.__all__) <= set(dir(smartsurf)))
        for name in smartsurf.__all__:
            self.assertIsNotNone(getattr(smartsurf, name), name)
        self.assertTrue((pathlib.Path(smartsurf.__file__).parent / "py.typed").exists())
        stub = (ROOT / "smartsurf/python/smartsurf/_core.pyi").read_text()
        from smartsurf import _core
        for of in ("Simulation", "Batch"):
            body = stub.split(f"class {of}:")[1].split("\nclass ")[0]
            declared = set(re.findall(r"def (\w+)\(", body)) - {"__init__"}
            self.assertEqual(declared, {name for name in vars(getattr(_core, of)) if not name.startswith("_")})
        functions = set(re.findall(r"^def (\w+)\(", stub, re.MULTILINE))
        self.assertEqual(functions, {name for name, value in vars(_core).items()
                                     if not name.startswith("_") and type(value).__name__ == "builtin_function_or_method"})


if __name__ == "__main__":
    unittest.main()
