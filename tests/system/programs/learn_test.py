"""scripts/learn: the searches run, and the learned programs are local and succeed on unseen seeds."""
import contextlib
import csv
import importlib.machinery
import importlib.util
import io
import re
import shutil
import sys
from types import SimpleNamespace
from unittest import mock

from programs import *

LEARN = ROOT / "scripts/learn"
VENV, GYM = ROOT / "build/learn", ROOT / "build/venv"
PYTHON = {**os.environ, "PYTHONPATH": str(BIN.parent / "python")}
COMPILED = list((BIN.parent / "python/smartsurf").glob("_core*"))
sys.path.insert(0, str(ROOT / "smartsurf/python"))
sys.path.insert(0, str(LEARN))
try:
    import numpy as np
    import patch
    from tasks import NETWORKS, TASKS, PatchTask
except ImportError:
    NETWORKS = TASKS = {}
try:
    import h5py
except ImportError:
    h5py = None


# Least successes of 12 runs, well below the rates of docs/learning.md.
LEAST = {"ball": 8, "box": 7, "sort": 9, "sort-ppo": 5, "arraybot_relocate": 8, "arraybot_flip": 8,
         "arraybot_lift": 9, "delta_align": 9}


@unittest.skipUnless(TASKS, "NumPy is not installed")
class Learn(ProgramTest):
    def test_learned_programs_succeed_and_networks_are_local(self):
        for name, least in LEAST.items():
            task, program = TASKS[name.split("-")[0]], LEARN / f"policies/{name}.aps"
            for path in (program, task.controller) if name.split("-")[0] in NETWORKS else ():
                status, out, err = self.run_program(APRON, "check", "--profile", "local", str(path))
                self.assertEqual(status, 0, out + err)
            won = sum(metrics["success"] for metrics in task.evaluate(program, range(30001, 30013), SMARTSURF))
            self.assertGreaterEqual(won, least, name)

    def test_table_shows_all_training_seeds_of_the_plan(self):
        """Each row has the successes of all seeds and the rate of their median; their programs are there, and without the
        trainings the table is made of them, with the page's row of a controller that is no program."""
        loader = importlib.machinery.SourceFileLoader("table", str(LEARN / "table"))
        table = importlib.util.module_from_spec(importlib.util.spec_from_loader("table", loader))
        loader.exec_module(table)
        page = table.on_page()
        for name, task in TASKS.items():
            for method, seeds in table.methods(name).items():
                rate, each = page[task.title, method.upper()][2:4]
                won = list(map(int, each.split(", ")))
                self.assertEqual(len(won), len(seeds), (name, method))
                self.assertEqual(int(re.match(r"(\d+) of 100 ", rate)[1]), sorted(won)[len(won) // 2], (name, method))
                programs = [seed for seed in seeds if table.kept_text(name, method, seed) is not None]
                self.assertIn(programs, [seeds, []] if method == "ppo" else [seeds], (name, method))
        output, arguments = io.StringIO(), ["table", "--no-page", "--task", "ball", "-o", "nothing", "--smartsurf", SMARTSURF]
        with mock.patch.object(table, "UNSEEN", range(10001, 10005)), mock.patch.object(sys, "argv", arguments), \
                contextlib.redirect_stdout(output):
            table.main()
        rows = [[cell.strip() for cell in line.split("|")[1:-1]] for line in output.getvalue().splitlines()]
        self.assertRegex(" ".join(rows[2][2:4]), r"^\d of 4 \(0\.\d\d…\d\.\d\d\) \d, \d, \d$")
        ball = page[TASKS["ball"].title, "PPO"]
        self.assertEqual(rows[3], ["", "PPO", ball[2].removesuffix(table.UNTESTED) + table.UNTESTED, *ball[3:]])
        self.assertEqual([row[1:] for row in rows[4:]], [row[1:] for row in list(page.values())[6:]])  # after a header of two

        lines = table.block(table.PAGE.read_text(), "faulty")[1].strip().splitlines()
        self.assertEqual(lines[0], f"| task | controller | {' | '.join(share + ' faulty' for share in table.FAULTY['faulty'])} |")
        for row in [line.split("|")[3:-1] for line in lines[3::2] if line.startswith("|")]:
            for cell in row:
                median, *each = map(int, re.match(r" (\d+) of 100 \(.*\): (\d+), (\d+), (\d+) $", cell).groups())
                self.assertEqual(median, sorted(each)[1])

    @unittest.skipUnless(list(GYM.glob("lib/python3*/site-packages/gymnasium")), "no Gymnasium: scripts/setup --python")
    @unittest.skipUnless(COMPILED, "the Python package is not built")
    def test_cross_entropy_search_improves_its_policy(self):
        done = subprocess.run([GYM / "bin/python", "-B", LEARN / "cem", "box", "--generations", "3", "--candidates", "10", "--runs", "2",
                               "--smartsurf", SMARTSURF, "-o", "box"], cwd=self.folder, env=PYTHON, capture_output=True, text=True,
                              timeout=PATIENCE)
        self.assertEqual(done.returncode, 0, done.stderr)
        with open(self.folder / "box/curve.csv", newline="") as file:
            rows = list(csv.DictReader(file))
        self.assertEqual([row["episodes"] for row in rows], ["20", "40", "60"])
        self.assertTrue(all(float(row["elite_score"]) > float(row["mean_score"]) for row in rows))
        self.assertGreater(float(rows[-1]["elite_score"]), float(rows[0]["mean_score"]))
        self.assertEqual(self.run_program(APRON, "check", "--profile", "local", "box/policy.aps")[0], 0)

    @unittest.skipUnless(h5py, "h5py is not installed")
    def test_programs_of_patches_command_what_the_search_does(self):
        """The heights that a program commands are those of NumPy from the same sensors; no weight is 0."""
        shutil.copy(ROOT / "scripts/tasks/arraybot.lua", self.folder)
        for task in (task for task in TASKS.values() if isinstance(task, PatchTask)):
            vector = patch.bowl(1, 0.2, -0.2) + np.random.default_rng(1).normal(0, 0.1, patch.PARAMETERS)
            task.export(vector, self.folder / "policy.aps", "the test")
            lua = self.write("task.lua", task.experiment.read_text() + "record { sensors = true, actuators = true, every = 1 }")
            status, _, err = self.run_program(SMARTSURF, "run", lua, "--controller", "policy.aps", "--until", "6", "--record", "run.h5")
            self.assertEqual(status, 0, err)
            with h5py.File(self.folder / "run.h5") as file:
                sensors, heights = {name: data[:] for name, data in file["sensors"].items()}, file["actuators/height"][:]
            table = SimpleNamespace(num_envs=1, rows=16, columns=16, period=0.1, sensor_channels=[SimpleNamespace(name=name) for name in sensors])
            policy, frames = task.population([vector], table), np.stack(list(sensors.values()), axis=1)
            expected = [policy.commands(frame[None])[0, 0] for frame in frames]
            # Rounding decides whether a pillar on the rim of the patch belongs to it.
            self.assertLess((np.abs(np.array(expected[:-1]) - heights[1:]) > 1e-3).mean(), 0.01, task.name)
            self.assertGreater(heights.std(axis=0).max(), 0.5, task.name)

    @unittest.skipUnless(list(VENV.glob("lib/python3*/site-packages/stable_baselines3")), "no stable-baselines3: scripts/setup --learn")
    @unittest.skipUnless(COMPILED, "the Python package is not built")
    def test_ppo_trains_and_tests(self):
        done = subprocess.run([VENV / "bin/python", "-B", LEARN / "ppo", "ball", "--steps", "2048", "--worlds", "8", "--test", "1-4",
                               "-o", "ball"], cwd=self.folder, env=PYTHON,
                              capture_output=True, text=True, timeout=PATIENCE)
        self.assertEqual(done.returncode, 0, done.stderr)
        runs = json.loads((self.folder / "ball/test.json").read_text())["runs"]
        self.assertEqual(len(runs), 4)
        self.assertTrue(all(-10 < metrics["score"] < 0 and metrics["success"] in (0, 1) for metrics in runs), runs)

    @unittest.skipUnless(list(VENV.glob("lib/python3*/site-packages/stable_baselines3")), "no stable-baselines3: scripts/setup --learn")
    @unittest.skipUnless(COMPILED, "the Python package is not built")
    def test_ppo_of_cells_writes_a_local_program(self):
        """The program computes what the network of stable-baselines3 does."""
        done = subprocess.run([VENV / "bin/python", "-B", "-c", CELLS, LEARN], cwd=self.folder, env=PYTHON, capture_output=True,
                              text=True, timeout=PATIENCE)
        self.assertEqual(done.returncode, 0, done.stderr)
        self.assertEqual(self.run_program(APRON, "check", "--profile", "local", "cells.aps")[0], 0)


# Some training; then the commands of the exported network beside those of the model, for all cells of both worlds.
CELLS = """
import sys
sys.path.insert(0, sys.argv[1])
import numpy as np
from stable_baselines3 import PPO
from torch.nn import ReLU
from cells import Cells, Idle, NEIGHBOURS, local_policy
from tasks import TASKS, export_policy
task = TASKS["sort"]
cells = Cells(task, 2, 1)
model = PPO("MlpPolicy", cells, n_steps=8, batch_size=444, n_epochs=1, seed=1, device="cpu",
            policy_kwargs={"net_arch": {"pi": [8], "vf": [8]}, "activation_fn": ReLU})
model.learn(8 * cells.num_envs, callback=Idle())
model.policy.action_net.weight.data *= 30  # untrained networks hardly act
policy = local_policy(model, task)
export_policy(policy, "cells.aps")
planes = np.random.default_rng(1).random((3, 24, 24), np.float32)
padded = np.pad(planes[[0, 2]], ((0, 0), (1, 1), (1, 1)))
seen = np.stack([padded[:, 1 + r:25 + r, 1 + c:25 + c] for r, c in NEIGHBOURS], axis=1).reshape(10, -1).T
expected = 3 + 3 * np.clip(model.predict(seen, deterministic=True)[0], -1, 1)
assert np.abs(policy({"colour": planes})["height"].reshape(-1, 1) - expected).max() < 1e-4
assert expected.std() > 0.1
# A ball that progresses is a reward for the cells around it, and for these alone.
cells.reset()
start = before = cells.progress(cells.positions(cells.env._fields))
for _ in range(30):
    cells.step_async(np.clip(-cells.places[None, :, 1] / 3, -1, 1).repeat(12, 0).reshape(-1, 1).astype(np.float32))
    _, rewards, ended, _ = cells.step_wait()
    after = cells.progress(cells.positions(cells.env._fields))
    assert ended.any() or np.allclose(rewards.reshape(2, 6, -1), (after - before)[..., None], atol=1e-4)
    before = after
way = (after - start).mean(axis=0)  # all roll east
assert way[:3].mean() > 1 and way[3:].mean() < -1, way
"""


if __name__ == "__main__":
    unittest.main()
