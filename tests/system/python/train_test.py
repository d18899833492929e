"""smartsurf train, its adapters, and networks that command a surface: equal commands wherever a policy runs."""
import contextlib
import copy
import csv
import importlib.util
import io
import os
import pathlib
import resource
import shutil
import signal
import subprocess
import sys
import unittest
import warnings
from unittest import mock

try:
    import gymnasium  # noqa: F401
    import numpy as np
    import smartsurf
    from smartsurf import training
except ImportError as error:
    print(f"skipped: {error}; scripts/setup --python installs it where a package index can be reached")
    sys.exit(77)
from experiments import ENDINGS, ExperimentTest

# A ball is to come to the east.
PLATE = """
surface { rows = 6, columns = 8, actuator = pin { range = {0, 3}, max_speed = 8 }, border = { height = 5 },
          sensors = { proximity { range = 4 }, colour { range = 4 } } }
local ball = sphere { radius = 0.9, position = {3, 2.5, 4}, label = 'ball', colour = 'red' }
on_reset(function() object(ball):teleport { position = {random(1, 4), random(1, 4), 3} } end)
episode { seconds = 1 }
reward(function() local x = object(ball):position() return x / 8 end)
success(function() local x = object(ball):position() return x > 6 end)
"""
TASK = """
import numpy as np
import smartsurf


class East(smartsurf.Task):
    scene = '''%s'''
    goals = {"east": (5.0, 6.0)}

    def observation(self, state):
        return np.column_stack([state.position("ball"), state.goals["east"]])
""" % PLATE
ENDLESS = """
import smartsurf


class Endless(smartsurf.Task):
    scene = "surface { rows = 2, columns = 2, actuator = pin {} }"

    def reward(self, state):
        return 0 * state.time
"""
# Fails in some episodes.
FAILING = PLATE.replace("on_reset(function()", "local bad\non_tick(function(t) if bad and t > 0.1 then error('broken') end end)\n"
                        "on_reset(function() bad = random() < 0.4")
SHORT = PLATE.replace("seconds = 1", "seconds = 0.3")
HAS_ONNX = importlib.util.find_spec("onnx") and importlib.util.find_spec("onnxruntime")
needs_onnx = unittest.skipUnless(HAS_ONNX, "onnx or onnxruntime is missing: scripts/setup --python installs them")
needs_torch = unittest.skipUnless(importlib.util.find_spec("torch"), "torch is missing: scripts/setup --learn installs it")


class Training(ExperimentTest):
    def setUp(self):
        super().setUp()
        os.environ["SMARTSURF_PYTHON"] = sys.executable

    def train(self, *arguments, folder="out"):
        """The rows of the curve of `smartsurf train`."""
        result = subprocess.run([os.environ["SMARTSURF"], "train", *map(str, arguments), "-o", str(self.folder / folder)],
                                capture_output=True, text=True, timeout=250, cwd=self.folder)
        self.assertEqual(result.returncode, 0, result.stderr[-2000:])
        with open(self.folder / folder / "curve.csv", newline="") as file:
            return list(csv.DictReader(file))

    def hash_of_run(self, script, controller, seed=5, until=1.0):
        return int(smartsurf.run(script, str(controller), seed=seed, until=until)["state_hash"], 16)

    def hash_of_policy(self, script, policy, seed=5, ticks=60):
        """policy: of (observation, sensors)."""
        simulation = smartsurf.Simulation(script, seed=seed)
        for _ in range(ticks):
            simulation.step(policy(simulation._observation, simulation.sensors))
        return simulation.state_hash

    def test_cem_learns_the_same_policy_with_any_number_of_threads(self):
        script, how = self.script(PLATE), ["--iterations", 2, "--candidates", 6, "--runs", 1, "--hidden", 2, "--neighbours", 8, "--memory", 1,
                                           "--substeps", 2]
        rows = self.train(script, *how, "--threads", 1, folder="one")
        self.assertEqual([row["episodes"] for row in rows], ["6", "12"])
        self.assertTrue(all(float(row["best_return"]) > float(row["return"]) > 0 for row in rows))
        samples = [int(row["samples"]) for row in rows]
        self.assertTrue(0 < samples[0] < samples[1] <= 12 * 60)
        again = self.train(script, *how, "--threads", 2, folder="two")
        for name in ("return", "best_return", "samples", "success_rate"):
            self.assertEqual([row[name] for row in rows], [row[name] for row in again])
        for name in ("policy.aps", *(["policy.onnx"] if HAS_ONNX else [])):
            self.assertEqual((self.folder / "one" / name).read_bytes(), (self.folder / "two" / name).read_bytes())
        check = subprocess.run([os.environ["APRON"], "check", "--local", str(self.folder / "one/policy.aps")], capture_output=True,
                               text=True)
        self.assertEqual(check.returncode, 0, check.stdout + check.stderr)
        if HAS_ONNX:  # as NumPy, so everywhere
            self.assertEqual(self.hash_of_run(script, self.folder / "one/policy.onnx"),
                             self.hash_of_run(script, self.folder / "one/policy.aps"))

    def test_without_a_goal_there_is_no_success_rate(self):
        endless = PLATE[:PLATE.index("success(")]
        for source, rate in ((PLATE, r"[01]\.\d{4}"), (endless, "")):
            path = self.script(source)
            out = subprocess.run([os.environ["SMARTSURF"], "train", path, "--iterations", "1", "--candidates", "2", "--runs", "1",
                                  "--test", "2", "-o", str(self.folder / "out")], capture_output=True, text=True, timeout=250)
            self.assertEqual(out.returncode, 0, out.stderr[-2000:])
            with open(self.folder / "out/curve.csv", newline="") as file:
                (row,) = csv.DictReader(file)
            for name in ("success_rate", "test_success_rate"):
                self.assertRegex(row[name], f"^{rate}$")
            self.assertRegex(out.stdout, r", best [-\d.e+]+, success \d+%, test [-\d.e+]+, \d+%\n" if rate else
                             r", best [-\d.e+]+, test [-\d.e+]+\n")

    def test_a_policy_reads_every_component_of_a_channel(self):
        script = self.script(PLATE.replace("sensors = {", "skin = { kind = 'kinematic' },\n          sensors = { camera { resolution = 2 }, "
                                           "skin_height { resolution = 2 },"))
        self.train(script, "--iterations", 1, "--candidates", 2, "--runs", 1, "--memory", 1)
        self.hash_of_run(script, self.folder / "out/policy.aps")
        inputs = training.input_names(smartsurf.VectorEnv(script, threads=1).sensor_channels)
        self.assertEqual(inputs, [*(f"camera[{k}]" for k in range(12)),
                                  *(f"{name}[{k}]" for name in ("camera_height", "skin_height") for k in range(4)),
                                  "proximity", "proximity_hit", "colour.r", "colour.g", "colour.b"])
        weights = np.random.default_rng(5).normal(0, 0.5, smartsurf.LocalPolicy.parameters(len(inputs) + 1, 1))
        policy = smartsurf.LocalPolicy.from_vector(weights, [*inputs, "colour[2]"], [("height", 0, 3)])
        smartsurf.export_policy(policy, self.folder / "all.aps")
        expected = self.hash_of_policy(script, lambda _, sensors: policy(sensors))
        self.assertEqual(self.hash_of_run(script, self.folder / "all.aps"), expected)
        if HAS_ONNX:
            smartsurf.export_onnx(policy, self.folder / "all.onnx")
            self.assertEqual(self.hash_of_run(script, self.folder / "all.onnx"), expected)
        sensors = {"camera": np.zeros((12, 2, 2)), "colour": np.zeros((3, 2, 2)), "proximity": np.zeros((2, 2))}
        for name in ("camera[12]", "camera.r", "colour[3]", "proximity.r", "light"):
            with self.assertRaisesRegex(KeyError, "there is no sensor"):
                smartsurf.LocalPolicy([name], [("height", 0, 3)], [(np.zeros((1, 1, 5)), [1])])(sensors)

    def network(self, convolutions, planes=5):
        random, layers, shape = np.random.default_rng(4), [], (planes, 6, 8)
        for units in convolutions:
            layers.append((random.normal(0, 0.4, (units, planes, 3, 3)), random.normal(0, 0.4, units)))
            planes = units
        layers.append((random.normal(0, 0.1, (12, planes * 48)), random.normal(0, 0.4, 12)))
        layers.append((random.normal(0, 0.6, (48, 12)), random.normal(0, 0.6, 48)))
        return smartsurf.NetworkPolicy(layers, shape, (1, 6, 8), 0, 3, np.full((shape[0], 1, 1), 4))

    @needs_onnx
    def test_networks_of_the_whole_surface_command_the_same_everywhere(self):
        from smartsurf.onnx_controller import OnnxPolicy
        script = self.script(PLATE)
        for convolutions in ((), (3,)):
            path = self.folder / "policy.onnx"
            self.network(convolutions).export(path)
            policy = OnnxPolicy(str(path), {"proximity": 1, "proximity_hit": 1, "colour": 3}, ("height",))
            observation = np.random.default_rng(2).random((5, 6, 8)).astype(np.float32)
            heights = policy(observation, {})["height"]
            self.assertEqual(heights.shape, (6, 8))
            self.assertTrue(0 <= heights.min() < heights.max() <= 3)
            self.assertEqual(self.hash_of_run(script, path), self.hash_of_policy(script, policy))

    @needs_onnx
    def test_networks_of_a_surface_with_empty_cells_command_the_same_everywhere(self):
        from smartsurf.onnx_controller import OnnxPolicy
        script = self.script(PLATE.replace("surface {", "surface { mask = function(r, c) return r < 4 or c < 6 end,"))
        path, channels = self.folder / "policy.onnx", smartsurf.Simulation(script).sensor_channels
        self.network((), sum(c.components for c in channels)).export(path)
        policy = OnnxPolicy(str(path), {c.name: c.components for c in channels}, ("height",))
        self.assertEqual(self.hash_of_run(script, path), self.hash_of_policy(script, policy))

    @needs_onnx
    def test_networks_compute_what_their_layers_say(self):
        network = self.network(())
        network.export(self.folder / "policy.onnx")
        import onnxruntime
        session = onnxruntime.InferenceSession(str(self.folder / "policy.onnx"), providers=["CPUExecutionProvider"])
        observation = np.random.default_rng(3).normal(0, 3, (4, 5, 6, 8)).astype(np.float32)
        value = (observation / 4).reshape(4, -1)
        for number, (weights, biases) in enumerate(network.layers):
            value = np.maximum(value, 0) if number else value
            value = value @ weights.T + biases
        action, = session.run(["action"], {"observation": observation})
        np.testing.assert_allclose(action, np.clip(value * 1.5 + 1.5, 0, 3).reshape(4, 1, 6, 8), rtol=0, atol=1e-4)

    def failing_run(self, controller, **environment):
        result = subprocess.run([os.environ["SMARTSURF"], "run", self.script(PLATE), "--controller", str(controller), "--until", "1"],
                                capture_output=True, text=True, timeout=120, env={**os.environ, **environment})
        self.assertNotEqual(result.returncode, 0)
        return result.stderr

    @needs_onnx
    def test_mistakes_are_one_line(self):
        policy = smartsurf.LocalPolicy(["light"], [("height", 0, 3)], [(np.zeros((1, 1, 5)), [1])])
        smartsurf.export_onnx(policy, self.folder / "wrong.onnx")
        (self.folder / "onnxruntime.py").write_text("raise ImportError('none')\n")
        self.assertIn("no such model", self.failing_run(self.folder / "none.onnx"))
        self.assertIn("its input 'light' is no sensor channel", self.failing_run(self.folder / "wrong.onnx"))
        path = os.pathsep.join([str(self.folder), os.environ["PYTHONPATH"]])
        self.assertIn("an ONNX model needs onnxruntime: pip install onnxruntime",
                      self.failing_run(self.folder / "wrong.onnx", PYTHONPATH=path))
        with self.assertRaisesRegex(ValueError, r"layer 1: weights .* do not fit its input \(12,\)"):
            smartsurf.NetworkPolicy([(np.zeros((12, 48)), np.zeros(12)), (np.zeros((48, 9)), np.zeros(48))], (1, 6, 8), (1, 6, 8), 0, 1)
        (self.folder / "numpy.py").write_text("raise SystemExit('the current folder was searched')\n")
        for task, message in (("Nowhere", "must be EXPERIMENT.lua, FILE.py:CLASS or one of SizeSort"),
                              ("none.py:A", "there is no file none.py")):
            result = subprocess.run([os.environ["SMARTSURF"], "train", task], capture_output=True, text=True, cwd=self.folder)
            self.assertEqual((result.returncode, result.stderr.count("\n")), (2, 1), result.stderr)
            self.assertIn(message, result.stderr)

    def test_what_declares_no_reward_or_length_is_one_line(self):
        for task, message in ((self.script(PLATE.replace("episode {", "-- {"), "endless.lua"), "its episodes have no length: declare"),
                              (f"{self.script(ENDLESS, 'endless.py')}:Endless", "its episodes have no length: declare"),
                              (self.script(PLATE.replace("reward(", "local none = ("), "nothing.lua"), "has no reward: declare reward()")):
            with self.subTest(task=task):
                result = subprocess.run([os.environ["SMARTSURF"], "train", task], capture_output=True, text=True, cwd=self.folder,
                                        timeout=100)
                self.assertEqual((result.returncode, result.stderr.count("\n")), (2, 1), result.stderr)
                self.assertIn(message, result.stderr)

    def test_numbers_out_of_range_are_one_line(self):
        for flag, value, right in (("--seed", "-1", "a whole number, 0 to 9223372036854775807"),
                                   ("--seed", "9223372036854775808", "a whole number, 0 to 9223372036854775807"),
                                   ("--test", "-1", "a whole number, 0 to 1000000"), ("--test", "1.5", "a whole number"),
                                   ("--memory", "-1", "a whole number, 0 to"), ("--iterations", "0", "a whole number, 1 to"),
                                   *(("--hidden", value, "numbers of units from 1, separated by commas, or 0 for no hidden") for value in ("-1", "4,0")),
                                   ("--together", "1.5", "a number, 0 to 1"),
                                   ("--entropy", "nan", "a finite number, 0 or above"), ("--entropy", "-1", "a finite number, 0 or"),
                                   *((flag, value, "a finite number above 0") for flag in ("--deviation", "--learning-rate")
                                     for value in ("nan", "-1", "0", "inf", "much"))):
            with self.subTest(flag=flag, value=value):
                result = subprocess.run([os.environ["SMARTSURF"], "train", self.script(PLATE), flag, value], capture_output=True, text=True,
                                        cwd=self.folder)
                self.assertEqual(result.returncode, 2)
                self.assertRegex(result.stderr, rf"\Asmartsurf train: {flag}: {value}: must be {right}[^\n]*\n\Z")

    def test_every_seed_trains_on_seeds_of_its_own(self):
        (self.folder / "plate.lua").write_text(SHORT)
        policies = set()
        for seed in (0, 1, 10**10, 2**63 - 1):
            self.train_here(self.folder / "plate.lua", "--iterations", 1, "--candidates", 2, "--runs", 1, "--hidden", 1, "--seed", seed)
            policies.add((self.folder / "out/policy.aps").read_text())
        self.assertEqual(len(policies), 4)
        self.assertEqual(training.training_seeds(7, 3), range(7, 10))
        for first in (-10**9, 10**6 - 2, 10**6, 2 * 10**6 - 1, 2**63 - 2, 10**19):
            seeds = training.training_seeds(first, 3)
            self.assertEqual(len(seeds), 3)
            self.assertTrue(0 <= seeds[0] and seeds[-1] < 2**63)
            self.assertFalse(set(seeds) & set(training.TEST_SEEDS))

    @needs_torch
    def test_every_seed_trains_by_ppo(self):
        (self.folder / "plate.lua").write_text(SHORT)
        for seed in (0, 2**63 - 1):
            self.train_here(self.folder / "plate.lua", "--method", "ppo", "--iterations", 1, "--worlds", 2, "--horizon", 2, "--hidden", 1,
                            "--seed", seed)

    def test_a_run_replaces_an_older_one(self):
        old = self.folder / "out/events.out.tfevents.1.there.1.0"
        old.parent.mkdir()
        old.touch()
        self.assertEqual(len(self.train(self.script(PLATE), "--iterations", 1, "--candidates", 2, "--runs", 1)), 1)
        self.assertFalse(old.exists())

    @needs_torch
    def test_minibatches_of_one_decision_leave_finite_weights(self):
        (self.folder / "plate.lua").write_text(SHORT)
        self.train_here(self.folder / "plate.lua", "--method", "ppo", "--hidden", 2, "--iterations", 2, "--worlds", 2, "--horizon", 2)
        with np.load(self.folder / "out/checkpoint.npz") as file:
            self.assertTrue(all(np.isfinite(file[name]).all() for name in file.files if file[name].dtype.kind == "f"))

    @needs_torch
    def test_a_training_that_can_leave_no_policy_says_so_first(self):
        find = importlib.util.find_spec
        (self.folder / "plate.lua").write_text(SHORT)
        with mock.patch("importlib.util.find_spec", lambda name, *more: None if name == "onnx" else find(name, *more)):
            for policy in ("cnn", "local"):
                with contextlib.redirect_stderr(io.StringIO()) as errors:
                    self.train_here(self.folder / "plate.lua", "--method", "ppo", "--policy", policy, "--hidden", 2,
                                    "--iterations", 1, "--worlds", 2, "--horizon", 2)
                self.assertEqual("--policy cnn: the policy is written as ONNX alone" in errors.getvalue(), policy == "cnn")

    def train_here(self, *arguments, folder="out"):
        """smartsurf train in this process."""
        from smartsurf import train
        with contextlib.redirect_stdout(io.StringIO()) as out:
            train.main([*map(str, arguments), "-o", str(self.folder / folder)])
        return out.getvalue()

    def result(self, folder):
        """What a training leaves: the policy and the curve without times."""
        path = self.folder / folder
        rows = [{name: text for name, text in row.items() if name not in ("cpu_s", "wall_s")}
                for row in csv.DictReader((path / "curve.csv").read_text().splitlines())]
        return rows, {name: (path / name).read_bytes() for name in ("policy.aps", "policy.onnx") if (path / name).exists()}

    def assert_goes_on(self, arguments, files, moments):
        """A training that was ended as if killed, after so many of its files took their place, ends as one that was not. files: of
        one of its 3 iterations."""
        shutil.rmtree(self.folder / "whole", ignore_errors=True)
        self.train_here(*arguments, "--threads", 2, folder="whole")
        expected, replace = self.result("whole"), pathlib.Path.replace
        for written in moments:
            with self.subTest(arguments=arguments, written=written):
                moved = 0

                def ended(path, target):
                    nonlocal moved
                    moved += 1
                    if moved > written:
                        raise KeyboardInterrupt
                    return replace(path, target)
                shutil.rmtree(self.folder / "out", ignore_errors=True)
                with mock.patch.object(pathlib.Path, "replace", ended), self.assertRaises(KeyboardInterrupt):
                    self.train_here(*arguments, "--threads", 1)
                out = self.train_here(*arguments, "--threads", 1, "--resume")
                self.assertIn(f"has {written // files} of 3 iterations", out)
                self.assertEqual(self.result("out"), expected)
                self.assertFalse(list((self.folder / "out").glob("*.part")))
        before = {path: path.stat().st_mtime_ns for path in (self.folder / "out").iterdir()}
        self.assertIn("has 3 of 3 iterations", self.train_here(*arguments, "--resume"))
        self.assertEqual({path: path.stat().st_mtime_ns for path in (self.folder / "out").iterdir()}, before)

    def test_cem_goes_on(self):
        files = 4 if HAS_ONNX else 3
        self.assert_goes_on([self.script(SHORT), "--iterations", 3, "--candidates", 3, "--runs", 1, "--hidden", 1, "--memory", 1,
                             "--substeps", 2, "--test", 1], files, [0, *range(files, 2 * files)])

    @needs_torch
    def test_ppo_goes_on(self):
        drawn = TASK.replace(PLATE, SHORT).replace("goals =", "randomise = {'object.ball.mass': (0.5, 2.0)}\n    goals =")
        script, task = self.script(SHORT), f"{self.script(drawn, 'task.py')}:East"
        small = ["--method", "ppo", "--iterations", 3, "--worlds", 3, "--horizon", 10, "--epochs", 1, "--minibatches", 2]
        for more in ([script, "--memory", 1, "--sequence", 4, "--hidden", 2], [task, "--policy", "mlp", "--hidden", 4]):
            files = 2 + ("mlp" not in more) + bool(HAS_ONNX)
            self.assert_goes_on([*more, *small], files, [2 * files - 1])

    def test_a_killed_training_goes_on(self):
        how = [self.script(PLATE), "--iterations", "4", "--candidates", "4", "--runs", "1", "--hidden", "1"]
        self.train(*how, folder="whole")
        command = [os.environ["SMARTSURF"], "train", *how, "-o", str(self.folder / "out")]
        for number in (signal.SIGKILL, signal.SIGTERM):
            with subprocess.Popen([*command, "--resume"], stdout=subprocess.PIPE, text=True) as process:
                iteration = next(line for line in process.stdout if "samples" in line)
                process.send_signal(number)
                process.wait(60)
            self.assertEqual(process.returncode, -number, iteration)
        self.train(*how, "--resume")
        self.assertEqual(self.result("out"), self.result("whole"))

    def test_only_the_same_training_goes_on(self):
        script = pathlib.Path(self.script(PLATE))
        how = [script, "--iterations", 1, "--candidates", 2, "--runs", 1]
        self.train_here(*how)
        with self.assertRaisesRegex(ValueError, "out was trained with --hidden 4, --seed 1; now with --hidden 3,2, --seed 2: give the same"):
            self.train_here(*how, "--seed", 2, "--hidden", "3,2", "--threads", 1, "--resume")
        script.write_text(PLATE + "\n")
        with self.assertRaisesRegex(ValueError, "out was trained with SHA-256 of experiment.lua "):
            self.train_here(*how, "--resume")
        task = TASK.replace("scene =", f"script = {str(script)!r}\n    text =")
        how_in_python = [f"{self.script(task, 'task.py')}:East", *how[1:]]
        self.train_here(*how_in_python)
        script.write_text(PLATE)
        with self.assertRaisesRegex(ValueError, "out was trained with SHA-256 of experiment.lua "):
            self.train_here(*how_in_python, "--resume")
        (self.folder / "out/checkpoint.npz").write_bytes(b"PK")
        with self.assertRaisesRegex(ValueError, "checkpoint.npz: is no checkpoint of smartsurf train"):
            self.train_here(*how, "--resume")
        before = self.result("out")
        script.write_text(PLATE + "error('new')")
        with self.assertRaisesRegex(ValueError, "new"):  # the old training stays
            self.train_here(*how)
        self.assertEqual(self.result("out"), before)
        script.write_text(PLATE)
        self.assertIn("0: ", self.train_here(*how, "--iterations", 2))

    def test_files_that_cannot_be_written_end_the_training_in_one_line(self):
        how = [os.environ["SMARTSURF"], "train", self.script(PLATE), "--iterations", "1000", "--candidates", "2", "--runs", "1", "-o", "out"]
        self.train(*how[2:3], "--iterations", 1, "--candidates", 2, "--runs", 1)
        before = self.result("out")
        full = subprocess.run(how, capture_output=True, text=True, cwd=self.folder, timeout=100,
                              preexec_fn=lambda: resource.setrlimit(resource.RLIMIT_FSIZE, (500, 500)))
        self.assertEqual((full.returncode, full.stderr), (2, "smartsurf train: out/policy.aps: File too large\n"))
        self.assertEqual(self.result("out"), before)
        with subprocess.Popen(how, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True, cwd=self.folder) as process:
            process.stdout.readline()
            (self.folder / "out").rename(self.folder / "gone")  # at once: the training writes into it
            error = process.communicate(timeout=100)[1]
        self.assertEqual(process.returncode, 2)
        self.assertRegex(error, r"^smartsurf train: out/[a-z.]+: No such file or directory\n$")

    @needs_torch
    def test_a_cnn_without_sensors_is_refused(self):
        script = self.script(PLATE.replace("sensors = { proximity { range = 4 }, colour { range = 4 } }", ""))
        with self.assertRaisesRegex(ValueError, "--policy cnn: the surface has no sensors"):
            self.train_here(script, "--method", "ppo", "--policy", "cnn", "--worlds", 2, "--horizon", 2, "--iterations", 1)

    @needs_torch
    def test_an_mlp_sees_the_observation_of_a_task_and_a_cnn_the_planes(self):
        """Also where both have the same shape; in training and in its tests."""
        from smartsurf import _ppo
        task = f"{self.script(TASK.replace('np.column_stack(', 'np.full((len(state.time), 5, 6, 8), 100) + 0 * len('), 'task.py')}:East"
        learn, call = _ppo.Learner.rollout, smartsurf.NetworkPolicy.__call__
        for policy in ("mlp", "cnn"):
            trained, tested = [], []

            def rollout(learner, decisions):
                trained.append(learner._seen)
                return learn(learner, decisions)

            def command(network, observation):
                tested.append(observation.copy())
                return call(network, observation)
            with self.subTest(policy=policy), mock.patch.object(_ppo.Learner, "rollout", rollout), \
                    mock.patch.object(smartsurf.NetworkPolicy, "__call__", command):
                self.train_here(task, "--method", "ppo", "--policy", policy, "--hidden", 2, "--iterations", 1, "--worlds", 2,
                                "--horizon", 2, "--test", 1)
                for seen in (trained, tested):
                    self.assertEqual({np.all(each == 100) for each in seen}, {policy == "mlp"})

    @needs_torch
    def test_failing_worlds_leave_finite_weights(self):
        """Their rewards are NaN, and so are the positions that the task's observation has."""
        import torch
        from smartsurf import _ppo
        task, learners, make = f"{self.script(TASK.replace(PLATE, FAILING), 'task.py')}:East", [], _ppo.Learner
        with mock.patch.object(_ppo, "Learner", lambda *given: learners.append(make(*given)) or learners[-1]), \
                self.assertWarnsRegex(UserWarning, "a world has failed, which ends its episode: .*broken"):
            self.train_here(task, "--method", "ppo", "--policy", "mlp", "--hidden", 4, "--iterations", 2, "--worlds", 6, "--horizon", 12,
                            "--epochs", 1, "--minibatches", 2)
        for p in learners[0]._learned:
            self.assertTrue(torch.isfinite(p).all())
        self.assertTrue(np.isfinite(learners[0]._seen).all() and np.isfinite(learners[0].moments.mean).all())

    def failing(self, mode):
        return training.find_task(f"{self.script(TASK.replace(PLATE, FAILING), 'task.py')}:East")[1](6, autoreset_mode=mode, seed=1)

    @unittest.skipUnless(importlib.util.find_spec("stable_baselines3"), "no stable-baselines3: scripts/setup --learn installs it")
    def test_failing_worlds_do_not_spoil_stable_baselines3(self):
        from stable_baselines3 import PPO
        envs = smartsurf.sb3.VecEnv(self.failing("SameStep"))
        model = PPO("MlpPolicy", envs, n_steps=16, batch_size=48, n_epochs=1, seed=1, device="cpu")
        with self.assertWarnsRegex(UserWarning, "a world has failed, which ends its episode: .*broken"):
            model.learn(96 * 3)
        self.assertTrue(all(bool(p.isfinite().all()) for p in model.policy.parameters()))
        envs.seed(1)
        envs.reset()
        failed = other = 0
        with warnings.catch_warnings(action="ignore"):
            for _ in range(80):
                observations, rewards, over, infos = envs.step(np.ones((6, 1, 6, 8), np.float32))
                self.assertTrue(np.isfinite(observations).all() and np.isfinite(rewards).all())
                for i in np.flatnonzero(over):
                    self.assertTrue(np.isfinite(infos[i]["terminal_observation"]).all())
                    self.assertEqual("error" in infos[i], "metrics" not in infos[i])
                    if "error" in infos[i]:
                        self.assertEqual((rewards[i], infos[i]["TimeLimit.truncated"]), (0, True))
                    failed, other = failed + ("error" in infos[i]), other + ("error" not in infos[i])
        self.assertTrue(failed and other)

    @unittest.skipUnless(importlib.util.find_spec("torchrl"), "torchrl is missing: scripts/setup --learn installs it")
    def test_failing_worlds_do_not_spoil_torchrl(self):
        import torch
        from torchrl.collectors import Collector
        envs = smartsurf.torchrl.Env(self.failing("Disabled"))
        value = torch.nn.Linear(4, 1)
        steps = torch.optim.SGD(value.parameters(), 0.01)
        with self.assertWarnsRegex(UserWarning, "a world has failed, which ends its episode: .*broken"):
            for data in Collector(envs, None, frames_per_batch=6 * 40, total_frames=6 * 80):
                after = data["next"]
                goes_on = ~after["terminated"]
                difference = after["reward"] + 0.9 * goes_on * value(after["observation"]).detach() - value(data["observation"])
                steps.zero_grad()
                (difference ** 2).mean().backward()
                steps.step()
        self.assertTrue(all(bool(p.isfinite().all()) for p in value.parameters()))

    def test_adapters_need_no_import_of_their_own(self):
        self.assertTrue(callable(smartsurf.formats.export))
        for name, package in (("sb3", "stable_baselines3"), ("torchrl", "torchrl")):
            if importlib.util.find_spec(package) is None:
                with self.assertRaisesRegex(ImportError, f"smartsurf.{name} needs"):
                    getattr(smartsurf, name)

    def test_every_task_is_found_by_name(self):
        for task in smartsurf.TASKS:
            self.assertEqual(training.find_task(task.id)[0], training.find_task(task.id.split("/")[1][:-3])[0])

    @needs_torch
    def test_an_actor_and_its_local_policy_command_alike(self):
        """With statistics, every neighbourhood, and memory through several ticks, up to the edges."""
        import torch
        from smartsurf import _ppo
        sensors = [smartsurf.Channel("proximity", "u", 0, 4, 1), smartsurf.Channel("colour", "", 0, 1, 3)]
        actuators = [smartsurf.Channel("a", "u", 0, 3, 1), smartsurf.Channel("b", "u", -20, 10, 1)]
        random, rows, columns = np.random.default_rng(8), 5, 7
        for neighbours, memory, hidden in ((0, 0, ()), (4, 2, (5,)), (8, 1, (4, 3)), (8, 0, ())):
            with self.subTest(neighbours=neighbours, memory=memory, hidden=hidden):
                torch.manual_seed(neighbours)
                moments = _ppo.Moments((4, rows, columns), np.full((4, 1, 1), 0.02, np.float32))
                moments.add(random.normal(1.5, 0.6, (40, 4, rows, columns)).astype(np.float32))
                actor = _ppo.Actor("local", (4, rows, columns), hidden, (2, rows, columns), memory, neighbours, moments, 0.5, 0.5)
                with torch.no_grad():
                    for layer in actor.layers:
                        layer.weight += 0.2 * torch.randn(layer.weight.shape)
                        layer.bias += 0.2 * torch.randn(layer.bias.shape)
                policy = training.local_policy(actor.layers_of(), sensors, actuators, memory)
                state, inside = torch.zeros(1, memory, rows, columns), []
                for _ in range(4):
                    sensed = random.uniform(0, 3, (4, rows, columns)).astype(np.float32)
                    with torch.no_grad():
                        mean, state, _ = actor(torch.from_numpy(sensed[None]), state)
                    commands = policy({"proximity": sensed[0], "colour": sensed[1:]})
                    expected = np.clip(mean[0].numpy(), -1, 1)
                    inside.append(np.abs(expected) < 1)
                    for plane, middle, half, channel in zip(expected, (1.5, -5), (1.5, 15), "ab"):
                        np.testing.assert_allclose(commands[channel], middle + half * plane, rtol=0, atol=2e-3)
                self.assertGreater(np.mean(inside), 0.3)

    @needs_torch
    def test_statistics_are_those_of_all_values(self):
        from smartsurf import _ppo
        random = np.random.default_rng(9)
        for shape, axes in (((3, 4, 5), (0, 2, 3)), ((7,), 0), ((), 0)):
            parts = [random.normal(2, 3, (n, *shape)).astype(np.float32) for n in (1, 5, 30)]
            moments = _ppo.Moments(shape, np.float32(1e-4))
            for part in parts:
                moments.add(part)
            every = np.concatenate(parts)
            np.testing.assert_allclose(moments.mean.ravel(), np.ravel(every.mean(axis=axes)), rtol=1e-5)
            np.testing.assert_allclose(moments.deviation.ravel(), np.ravel(every.std(axis=axes)), rtol=1e-4)

    @needs_torch
    def test_networks_of_the_whole_surface_explore_turns_of_small_objects(self):
        import torch
        from smartsurf import _ppo
        actor = _ppo.Actor("mlp", (5,), (4,), (2, 16, 16), 0, 8, _ppo.Moments((5,), 1e-4), 0.5, 0.9)
        _, _, features = actor(torch.zeros(400, 5), None)
        noise = actor.noise(actor.draw(400, torch.Generator().manual_seed(1)), features, torch.Generator()).detach().numpy()
        across = noise[:, :, 10:12, 7:9].mean(axis=(2, 3)) - noise[:, :, 4:6, 7:9].mean(axis=(2, 3))  # of an object of 6 cells
        self.assertGreater(across.std(), noise[:, :, 7:9, 7:9].mean(axis=(2, 3)).std())

    @needs_torch
    def test_a_decision_belongs_to_one_episode(self):
        """Returns and samples are those of whole episodes, of any length, and each begins with a decision of its own."""
        from smartsurf import _ppo
        for hold in (1, 4, 7, 40):
            with self.subTest(hold=hold), mock.patch.object(_ppo, "train") as called:
                self.train_here(self.script(ENDINGS), "--method", "ppo", "--hidden", 2, "--hold", hold, "--worlds", 3, "--threads", 1)
                learner = _ppo.Learner(*called.call_args.args[:2])
                learner.warm_up()  # for commands within their range
                step, running, returns, samples = learner.envs.step, learner._running.copy(), learner.returns.copy(), learner.samples
                before, over = np.zeros((3, 1, 4, 4)), np.zeros(3, bool)

                def counted(commands):
                    self.assertTrue((commands != before).any(axis=(1, 2, 3))[over].all())
                    before[...], stepped = commands, step(commands)
                    running[...], over[...] = running + stepped[1], stepped[2] | stepped[3]
                    returns.extend(running[over])
                    running[over] = 0
                    return stepped
                with mock.patch.object(learner.envs, "step", counted):
                    learner.rollout(120 // hold)
                np.testing.assert_array_equal(learner.returns, returns)
                self.assertEqual((learner.episodes, learner.samples - samples), (len(returns), 3 * hold * (120 // hold)))
                self.assertGreater(len(returns), 9)
                learner.envs.close()

    @needs_torch
    def test_the_value_sees_the_last_reward(self):
        """Else it would not know what no sensor and no object tells."""
        from unittest import mock
        from smartsurf import _ppo, train
        script = self.script("""
            surface { rows = 2, columns = 3, actuator = pin {} }
            local worth
            on_reset(function() worth = random(-1, 1) end)
            episode { seconds = 0.5 }
            reward(function() return worth end)""")
        (self.folder / "out").mkdir()
        with mock.patch.object(_ppo, "train") as called:
            train.main([script, "--method", "ppo", "--hold", "1", "--horizon", "16", "--threads", "1", "-o", str(self.folder / "out")])
        learner = _ppo.Learner(*called.call_args.args[:2])
        learner.warm_up()
        for _ in range(8):
            rollout = learner.rollout(16)
            learner.learn_statistics(rollout)
            learner.update(rollout, 1.0, policy=False)
        values = np.stack([learner.value(judged).detach().numpy() for judged in rollout["judged"]])
        known = ~np.stack([fresh.numpy() for fresh in rollout["fresh"]])
        self.assertGreater(np.corrcoef(values[known], np.array(rollout["rewards"])[known])[0, 1], 0.95)
        learner.envs.close()

    @needs_torch
    def test_convolutions_become_local_policies(self):
        import torch
        random, rows, columns = np.random.default_rng(6), 5, 7
        sensors = [smartsurf.Channel("proximity", "u", 0, 4, 1), smartsurf.Channel("colour", "", 0, 1, 3)]
        actuators = [smartsurf.Channel("a", "u", 0, 3, 1), smartsurf.Channel("b", "u", -20, 10, 1)]
        layers = [(random.normal(0, size, (n, m, 3, 3)), random.normal(0, 0.1, n)) for m, n, size in ((6, 5, 0.1), (5, 4, 0.3), (4, 2, 0.3))]
        policy = training.local_policy(layers, sensors, actuators)
        sensed = {"proximity": random.uniform(0, 4, (rows, columns)), "colour": random.random((3, rows, columns))}
        row, column = np.mgrid[0:rows, 0:columns]
        value = torch.tensor(np.stack([sensed["proximity"], *sensed["colour"], row - (rows - 1) / 2, column - (columns - 1) / 2])[None])
        for number, (weights, biases) in enumerate(layers):
            value = torch.relu(value) if number else value
            value = torch.nn.functional.conv2d(value, torch.tensor(weights), torch.tensor(biases), padding=1)
        expected = np.clip(value[0].numpy(), -1, 1)
        self.assertGreater((np.abs(expected) < 1).mean(), 0.5)
        for (_, command), middle, half, plane in zip(policy(sensed).items(), (1.5, -5), (1.5, 15), expected):
            np.testing.assert_allclose(command, middle + half * plane, rtol=0, atol=1e-4)

    @needs_torch
    def test_ppo_of_each_policy(self):
        script, task = self.script(PLATE), f"{self.script(TASK, 'task.py')}:East"
        for policy, of, more in (("local", script, []), ("cnn", script, []), ("mlp", task, []), ("local", task, ["--memory", 2])):
            with self.subTest(policy=policy, more=more):
                how = ["--method", "ppo", "--policy", policy, "--hidden", 4, "--iterations", 3, "--worlds", 4, "--horizon", 12, "--hold",
                       1 if more else 6, "--epochs", 2, "--minibatches", 2, "--test", 3, *more]
                rows = self.train(of, *how, "--threads", 1, folder=policy)
                tick = 1 if more else 6  # two first horizons are for the statistics and the value
                self.assertEqual([int(row["samples"]) for row in rows], [tick * 4 * (24 + 12 * k) for k in (1, 2, 3)])
                self.assertEqual(len({row["test_return"] for row in rows}), 3)
                if importlib.util.find_spec("tensorboard"):
                    self.assertTrue(list((self.folder / policy).glob("events.out.tfevents*")))
                again = self.train(of, *how, "--threads", 2, folder="again")
                for name in ("return", "test_return"):
                    self.assertEqual([row[name] for row in rows], [row[name] for row in again])
                if HAS_ONNX and policy != "mlp":
                    self.hash_of_run(script, self.folder / policy / "policy.onnx")
                if HAS_ONNX and policy == "local":
                    self.assertEqual(self.hash_of_run(script, self.folder / "local/policy.onnx"),
                                     self.hash_of_run(script, self.folder / "local/policy.aps"))

    @unittest.skipUnless(importlib.util.find_spec("stable_baselines3"), "no stable-baselines3: scripts/setup --learn installs it")
    def test_stable_baselines3_sees_the_same_worlds(self):
        from stable_baselines3 import PPO
        sb3 = smartsurf.sb3
        script = self.script(PLATE)
        envs = sb3.VecEnv(smartsurf.VectorEnv(script, 3, autoreset_mode="SameStep", copy=False))
        twin = smartsurf.VectorEnv(script, 3, autoreset_mode="SameStep")
        envs.seed(7)
        np.testing.assert_array_equal(envs.reset(), twin.reset(seed=[7, 8, 9])[0])
        random, ended = np.random.default_rng(1), 0
        observations, infos = None, []
        for _ in range(120):
            actions = random.uniform(0, 3, twin.action_space.shape).astype(np.float32)
            kept = copy.deepcopy((observations, infos))
            before, (observations, rewards, over, infos) = (observations, infos), envs.step(actions)
            np.testing.assert_equal(before, kept)  # the next step leaves them alone
            expected, expected_rewards, terminated, truncated, _ = twin.step(actions)
            np.testing.assert_array_equal(observations, expected)
            np.testing.assert_array_equal(rewards, expected_rewards.astype(np.float32))
            np.testing.assert_array_equal(over, terminated | truncated)
            for i in np.flatnonzero(over):
                ended += 1
                self.assertEqual(infos[i]["TimeLimit.truncated"], truncated[i])
                self.assertEqual(infos[i]["terminal_observation"].shape, (5, 6, 8))
        self.assertGreater(ended, 2)
        PPO("MlpPolicy", envs, n_steps=8, batch_size=24, seed=1, device="cpu").learn(48)
        with self.assertRaisesRegex(ValueError, "SameStep"):
            sb3.VecEnv(smartsurf.VectorEnv(script, 2))

    @unittest.skipUnless(importlib.util.find_spec("torchrl"), "torchrl is missing: scripts/setup --learn installs it")
    def test_torchrl_sees_the_same_worlds(self):
        import torch
        torchrl = smartsurf.torchrl
        from torchrl.envs.utils import check_env_specs
        script = self.script(PLATE)
        envs = torchrl.Env(smartsurf.VectorEnv(script, 3, autoreset_mode="Disabled"))
        check_env_specs(envs)
        twins = [smartsurf.Env(script) for _ in range(3)]
        envs.set_seed(7)
        state = envs.reset()
        for i, twin in enumerate(twins):
            np.testing.assert_array_equal(state["observation"][i].numpy(), twin.reset(seed=7 + i)[0])
        random, ended = np.random.default_rng(1), 0
        for _ in range(130):
            actions = random.uniform(0, 3, (3, 1, 6, 8)).astype(np.float32)
            stepped, after = envs.step_and_maybe_reset(state.set("action", torch.from_numpy(actions)))
            after_of = stepped["next"]
            for i, twin in enumerate(twins):
                observation, reward, terminated, truncated, info = twin.step(actions[i])
                np.testing.assert_array_equal(after_of["observation"][i].numpy(), observation)
                self.assertEqual(after_of["reward"][i].item(), np.float32(reward))
                self.assertEqual((after_of["terminated"][i].item(), after_of["truncated"][i].item(), after_of["success"][i].item()),
                                 (terminated, truncated, info["success"]))
                if terminated or truncated:
                    ended += 1
                    seed = envs.env._fields["seed"][i]  # the reset has drawn it
                    np.testing.assert_array_equal(after["observation"][i].numpy(), twin.reset(seed=int(seed))[0])
            state = after
        self.assertGreater(ended, 2)
        envs.close()
        with self.assertRaisesRegex(ValueError, "Disabled"):
            torchrl.Env(smartsurf.VectorEnv(script, 2))
        task = training.find_task(f"{self.script(TASK, 'task.py')}:East")[1](2, autoreset_mode="Disabled")
        self.assertEqual(torchrl.Env(task).rollout(5)["observation"].shape, (2, 5, 4))


if __name__ == "__main__":
    unittest.main()
