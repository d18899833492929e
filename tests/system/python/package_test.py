"""The package without Gymnasium: simulations, saved states, errors, processes."""
import contextlib
import copy
import gc
import json
import multiprocessing
import os
import pathlib
import pickle
import random
import re
import signal
import subprocess
import sys
import time
import unittest

try:
    import numpy as np
except ImportError:
    print("skipped: NumPy is not installed")
    sys.exit(77)
import smartsurf
from experiments import ACTUATORS, CROWD, NOISY, ROOT, TASK_OF_EACH_ACTUATOR, VERDICT_SCENE, VERDICTS, ExperimentTest
from processes import children, ended

# Boxes and cylinders fall on each other, on faces, edges and corners.
HEAP = """
world { dt = 1/240, control_period = 1/240 }
surface { rows = 10, columns = 10, border = { height = 5 }, actuator = pin { range = {0, 2} } }
for i = 1, 12 do
  local p = { random(2, 7), random(2, 7), 1.5 + 0.6 * i }
  local turned = { roll = random(0, 6), pitch = random(0, 6), yaw = random(0, 6) }
  if i % 3 == 0 then cylinder { radius = 0.6, height = random(0.5, 1.5), position = p, orientation = turned }
  else box { size = { random(0.6, 2), random(0.6, 2), random(0.4, 1) }, position = p, orientation = turned } end
end
"""


def drive(simulation, ticks, seed=0):
    """Random targets that change every fifth tick; returns hash, rewards and readings of each tick."""
    random, trace = np.random.default_rng(seed), []
    for tick in range(ticks):
        if tick % 5 == 0:
            actions = {c.name: random.uniform(c.minimum, c.maximum, (simulation.rows, simulation.columns))
                       for c in simulation.actuator_channels}
        reward = simulation.step(actions)[0]
        trace.append((simulation.state_hash, reward, *(a.tobytes() for a in simulation.sensors.values())))
    return trace


class Simulations(ExperimentTest):
    def test_arrays_are_views_that_follow_the_simulation(self):
        s = smartsurf.Simulation(self.script(CROWD), seed=1)
        proximity, position = s.sensors["proximity"], s.objects["position"]
        self.assertEqual((proximity.shape, proximity.dtype), ((16, 16), np.float32))
        self.assertEqual(s.sensors["colour"].shape, (3, 16, 16))
        self.assertEqual((position.shape, s.objects["orientation"].shape), ((10, 3), (10, 4)))
        before, height = proximity.copy(), position[0, 2]
        for _ in range(60):
            s.step(1.0)
        self.assertIs(proximity, s.sensors["proximity"])
        self.assertTrue((proximity != before).any())
        self.assertLess(position[0, 2], height)
        np.testing.assert_allclose(s.info["first"][:3], position[0], rtol=1e-6)
        with self.assertRaises(ValueError):
            proximity[0, 0] = 1
        del s
        gc.collect()
        self.assertEqual(proximity.shape, (16, 16))  # an array outlives its simulation
        self.assertTrue(np.isfinite(proximity.sum() + position.sum()))

    def test_the_hash_is_that_of_the_tick_whatever_its_callbacks_change(self):
        scene = """
surface { rows = 6, columns = 6, actuator = pin { range = {0, 3} }, sensors = { proximity { range = 4 } } }
local ball, other = sphere { radius = 0.6, position = {2, 2, 3} }, sphere { radius = 0.5, position = {4, 4, 3} }
reward(function(t, tick) if tick == 5 then %s end return 0 end)
"""
        changes = ("object(ball):teleport { position = {3, 3, 4} }", "sphere { radius = 0.5, position = {1, 1, 4} }",
                   "object(other):remove()")
        quiet = smartsurf.Simulation(self.script(scene % "", "quiet.lua"), seed=1)
        others = [smartsurf.Simulation(self.script(scene % change, f"{k}.lua"), seed=1) for k, change in enumerate(changes)]
        for _ in range(5):
            for s in (quiet, *others):
                s.step(1.0)
        for change, s in zip(changes, others):
            with self.subTest(change):
                self.assertEqual(s.state_hash, quiet.state_hash)
        quiet.step(1.0)
        for s in others:
            s.step(1.0)
            self.assertNotEqual(s.state_hash, quiet.state_hash)

    def test_objects_have_their_ids(self):
        s = smartsurf.Simulation(self.script("""
surface { rows = 6, columns = 6, actuator = pin {} }
for i = 1, 4 do sphere { radius = 0.4, position = {i, 2, 2} } end
at(0.1, function() object(1):remove() end)
"""))
        self.assertEqual(s.objects["id"].tolist(), [0, 1, 2, 3])
        for _ in range(12):
            s.step()
        self.assertEqual(s.objects["id"].tolist(), [0, 2, 3])
        self.assertTrue(all(values.flags.c_contiguous for values in s.objects.values()))

    def test_gravity_and_axis_order(self):
        s = smartsurf.Simulation(self.script(
            "surface { rows = 6, columns = 9, actuator = pin { range = {0, 4} }, sensors = { proximity { range = 4 } } }\n"
            "sphere { radius = 0.6, position = {7, 4, 30}, velocity = {0, 0, 2} }\n"
            "sphere { radius = 0.6, position = {7, 4, 1} }"))
        row, column = np.argwhere(s.sensors["proximity_hit"] > 0).mean(axis=0)
        self.assertEqual((row, column), (6 - 1 - 4, 7))  # row 0 is north
        for _ in range(30):
            s.step()
        # Free fall for half a second.
        self.assertAlmostEqual(float(s.objects["position"][0, 2]), 30 + 2 * 0.5 - 0.5 * 9.81 * 0.25, delta=0.02)
        self.assertAlmostEqual(float(s.objects["velocity"][0, 2]), 2 - 9.81 * 0.5, delta=1e-3)

    def test_a_swing_in_a_field_of_force_keeps_its_energy(self):
        """A plate over a linear field, 0.2 u above where it floats: ω² = the sum of the forces / (reach·mass)."""
        for rate in (60, 240):
            for iterations in (2, 10, 20):
                s = smartsurf.Simulation(self.script(f"""
                    world {{ dt = 1/{rate}, control_period = 1/{rate}, iterations = {iterations} }}
                    surface {{ rows = 12, columns = 12, actuator = force_field {{ reach = 2 }} }}
                    box {{ size = {{3, 3, 0.5}}, position = {{5, 5, {2 * (1 - 9.81 * 2 / 90) + 0.25 + 0.2}}}, mass = 2 }}"""))
                heights = []
                for _ in range(12 * rate):
                    s.step({"fx": 0, "fy": 0, "fz": np.full((12, 12), 10)})
                    heights.append(s.objects["position"][0, 2])
                self.assertAlmostEqual(np.ptp(heights[-2 * rate:]) / 0.4, 1, delta=0.03, msg=f"{rate}, {iterations}")

    def test_a_reset_equals_a_new_simulation(self):
        for text in (CROWD, NOISY):
            path = self.script(text)
            used = smartsurf.Simulation(path, seed=5)
            drive(used, 90)
            for seed in (9, 5):
                self.assertEqual(used.reset(seed), seed)
                fresh = smartsurf.Simulation(path, seed=seed)
                self.assertEqual(drive(used, 60, seed), drive(fresh, 60, seed))
                self.assertEqual(used.finish(), fresh.finish())

    def test_a_reset_without_a_seed_draws_a_new_one(self):
        s = smartsurf.Simulation(self.script(CROWD))
        seeds = {s.reset() for _ in range(8)}
        self.assertEqual(len(seeds), 8)
        self.assertIn(s.seed, seeds)

    def test_threads_do_not_change_the_bits(self):
        traces = [drive(smartsurf.Simulation(self.script(NOISY), seed=3, threads=n), 60) for n in (1, 3)]
        self.assertEqual(*traces)

    def test_worlds_that_one_thread_steps_in_turn_do_not_change_each_other(self):
        path = self.script(HEAP)
        for seed in range(1, 9):
            alone, first, second = (smartsurf.Simulation(path, seed=s) for s in (seed, seed, seed + 100))
            hashes = []
            for tick in range(90):
                alone.step(0)
                hashes.append(alone.state_hash)
            for tick in range(90):
                first.step(0), second.step(0)
                self.assertEqual(first.state_hash, hashes[tick], (seed, tick))

    def test_episode_ends_by_length_success_and_stop(self):
        base = "surface { rows = 4, columns = 4, actuator = pin {} }\nlocal b = sphere { radius = 1, position = {1, 1, 9} }\n"
        for end, expected in (("episode { seconds = 0.1 }", (6, False, True)),
                              ("success(function(t, tick) return tick == 3 end)", (3, True, False)),
                              ("at(0.05, function() stop() end)", (4, True, False))):
            s, ticks, over = smartsurf.Simulation(self.script(base + end)), 0, False
            while not over:
                reward, terminated, truncated = s.step()
                ticks, over = ticks + 1, terminated or truncated
            self.assertEqual((ticks, terminated, truncated), expected, end)

    @unittest.skipIf(os.environ.get("SMARTSURF_VIEW") != "ON", "built without the view")
    def test_render(self):
        s = smartsurf.Simulation(self.script(CROWD), seed=1)
        picture = s.render(160, 120)
        self.assertEqual((picture.shape, picture.dtype), ((120, 160, 3), np.uint8))
        self.assertGreater(len(np.unique(picture.reshape(-1, 3), axis=0)), 20)
        self.assertFalse(np.array_equal(picture, s.render(160, 120, "top")))

    @unittest.skipIf(os.environ.get("SMARTSURF_VIEW") == "ON", "built with the view")
    def test_render_without_the_view(self):
        with self.assertRaisesRegex(smartsurf.Error, "without the view"):
            smartsurf.Simulation(self.script(CROWD)).render()


# One number per purpose of random numbers; nothing moves but the pins.
PURPOSES = """
world { gravity = 0 }
surface { rows = 8, columns = 8, actuator = pin { range = {0, 2}, max_speed = 100 },
          sensors = { proximity { range = 6, noise = 0.01 } } }
faults { actuator = { dead = 0.3 } }
box { size = {12, 12, 1}, position = {3.5, 3.5, 4} }
local drawn = { load = random() }
on_reset(function() drawn.reset = random() end)
on_tick(function() drawn.step, drawn.wind, drawn.wave = random(), random_stream('wind'), random_stream('wave') end)
info { load = function() return drawn.load end, reset = function() return drawn.reset end,
       step = function() return drawn.step end, wind = function() return drawn.wind end,
       wave = function() return drawn.wave end }
"""


class RandomStreams(ExperimentTest):
    def test_no_two_purposes_correlate_and_episodes_differ(self):
        simulation = smartsurf.Simulation(self.script(PURPOSES))
        column, drawn = np.arange(8), []
        for seed in range(1, 401):
            simulation.reset(seed)
            sensors = float(simulation.sensors["proximity"][3, 3])
            simulation.step(1.0)
            drawn.append({**simulation.info, "sensors": sensors})
            for _ in range(20):
                simulation.step(1.0)
            dead = simulation.sensors["proximity"] > simulation.sensors["proximity"].mean()
            self.assertEqual(int(dead.sum()), 19)
            drawn[-1]["faults"] = float((dead * column).sum())
        names = list(drawn[0])
        self.assertEqual(len(names), 7)
        values = np.array([[episode[name] for name in names] for episode in drawn])
        self.assertTrue(all(len(set(of)) > 390 for of, name in zip(values.T, names) if name != "faults"))
        self.assertGreater(len(set(values[:, names.index("faults")])), 10)
        correlation = np.corrcoef(values.T)
        for i, one in enumerate(names):
            for j, other in enumerate(names[:i]):
                with self.subTest(one=one, other=other):
                    self.assertLess(abs(correlation[i, j]), 0.2)

    def test_functions_that_observe_change_no_other_random_number(self):
        drawn = "random() + math.random() + random_stream('shared')"
        text = """surface { rows = 4, columns = 4, actuator = pin { range = {0, 1} }, sensors = { proximity { range = 4 } } }
local b = sphere { radius = 0.4, position = {1.5, 1.5, 2} }
every(0.05, function() object(b):push { force = {random(-1, 1), random_stream('shared', -1, 1), 0}, seconds = 0.1 } end)
"""
        functions = f"""info {{ a = function() return {drawn} end, b = function() return {drawn} end }}
reward(function() return {drawn} end)
success(function() return {drawn} < 0 end)
metric('drawn', function() return {drawn} end)
"""

        def start(script):
            return smartsurf.Simulation(self.script(script, "experiment.lua"), seed=3)
        plain, read, unread = start(text), start(text + functions), start(text + functions)
        hashes, seen = [], []
        for tick in range(20):
            reward, _, _ = read.step()
            info = read.info
            self.assertEqual(read.info, info)
            seen.append((reward, info["a"], info["b"], read.metrics["drawn"]))
            plain.step(), unread.step()
            hashes.append({one.state_hash for one in (plain, read, unread)})
        self.assertEqual([len(of_tick) for of_tick in hashes], [1] * 20)
        self.assertEqual(len(set(sum(seen, ()))), 80)
        state = read.save()
        copied = copy.deepcopy(read)
        expected = [(read.step(), read.info, read.metrics, read.state_hash) for _ in range(10)]
        unread.restore(state)
        for one in (copied, unread):
            self.assertEqual([(one.step(), one.info, one.metrics, one.state_hash) for _ in range(10)], expected)
        read.reset(4)
        self.assertNotEqual(read.step()[0], seen[0][0])
        # What smartsurf run does not call, or calls at other times.
        read.reset(3)
        read.record(self.folder / "drawn.h5")
        for _ in range(30):
            read.step(), read.info
        read.stop_recording()
        verified = subprocess.run([os.environ["SMARTSURF"], "replay", str(self.folder / "drawn.h5"), "--verify"],
                                  capture_output=True, text=True, timeout=120)
        self.assertEqual(verified.returncode, 0, verified.stdout + verified.stderr)

    def test_a_stream_with_a_name_does_not_depend_on_other_draws(self):
        def draws(before):
            text = PURPOSES.replace("drawn.reset = random()", f"{before} drawn.reset = random_stream('wind', 2, 3)")
            simulation = smartsurf.Simulation(self.script(text), seed=3)
            simulation.step()
            return simulation.info["reset"], simulation.info["wind"]
        plain = draws("")
        self.assertEqual(draws("random() random_stream('other')"), plain)
        self.assertTrue(2 <= plain[0] < 3 and plain[0] - 2 != plain[1])
        for call, message in (("random_stream()", r"takes random_stream\(name, low, high\)"),
                              ("random_stream('a b')", "name = 'a b'"), ("random_stream('a', 2, 1)", "low = 2 is above")):
            with self.assertRaisesRegex(smartsurf.Error, message):
                draws(call)


class Recordings(ExperimentTest):
    """What Python records is repeated by smartsurf replay --verify."""

    def verify(self, path):
        return subprocess.run([os.environ["SMARTSURF"], "replay", str(path), "--verify"], capture_output=True, text=True,
                              timeout=120)

    def result(self, path):
        """What `smartsurf info` says of the end: outcome and success, "" without one; of metrics, the values at the end."""
        text = subprocess.run([os.environ["SMARTSURF"], "info", str(path)], capture_output=True, text=True, check=True, timeout=60).stdout
        lines = dict(line.split(None, 1) for line in text.splitlines() if line.startswith(("outcome", "success")))
        metrics = dict(re.findall(r"^metric +(\w+): (?:.*, )?(\S+) at the end$", text, re.MULTILINE))
        return lines["outcome"], lines.get("success", ""), metrics

    def test_the_end_of_an_episode_is_that_of_run(self):
        for name, body, success in VERDICTS:
            with self.subTest(name):
                path = self.script(VERDICT_SCENE + body + "\nreward(function(t) return t end) info { t = function(t) return t end }\n"
                                   "on_finish(function(t, tick) metric('t', t) metric('time', time()) metric('tick', tick) end)")
                ran = subprocess.run([os.environ["SMARTSURF"], "run", path, "--no-controller", "--until", "1", "--pace", "max", "--record",
                                      str(self.folder / "run.h5"), "--stats", str(self.folder / "run.json")], capture_output=True, timeout=60)
                self.assertEqual(ran.returncode, 2 if "error" in body else 0)
                stats = json.loads((self.folder / "run.json").read_text())
                self.assertEqual("broken" in stats["outcome"], "error" in body)
                s, over = smartsurf.Simulation(path), False
                s.record(self.folder / "python.h5")
                try:
                    while not over:
                        _, terminated, truncated = s.step()
                        s.info
                        over = truncated or (terminated and "stop" in body)  # run goes on after success()
                    s.finish()
                except smartsurf.Error as error:
                    self.assertIn("error", body, error)
                else:
                    self.assertEqual(s.info["t"], s.time)
                known = {name: None if np.isnan(value) else value for name, value in s.metrics.items()}
                self.assertEqual((s.success, known), (success, stats["metrics"]))
                s.stop_recording()
                ended = self.result(self.folder / "run.h5")
                self.assertEqual(self.result(self.folder / "python.h5"), ended)
                self.assertEqual(ended[2], {name: f"{value:g}" for name, value in stats["metrics"].items() if value is not None})

    def test_a_recorded_episode_is_repeated_to_the_bit(self):
        for text in (CROWD, NOISY):
            with self.subTest(script=text[:60]):
                s = smartsurf.Simulation(self.script(text), seed=3)
                s.reset(11)
                path = self.folder / "one.h5"
                s.record(path)
                drive(s, 50)
                s.stop_recording()
                verified = self.verify(path)
                self.assertEqual(verified.returncode, 0, verified.stderr)
                drive(s, 5)  # goes on
                s.reset(4)
                s.record(self.folder / "two.h5")
                drive(s, 20)
                s.reset(5)  # ends the recording
                self.assertEqual(self.verify(self.folder / "two.h5").returncode, 0)
                drive(s, 1)
                with self.assertRaisesRegex(smartsurf.Error, "before its first step"):
                    s.record(path)
                with self.assertRaisesRegex(smartsurf.Error, "txt"):
                    s.reset(1)
                    s.record(self.folder / "one.txt")

    def test_a_script_that_commands_its_actuators_is_repeated(self):
        text = """surface { rows = 5, columns = 5, actuator = pin { range = {0, 3} } }
sphere { radius = 1, position = {2, 2, 4} }
on_tick(function(t)
  for row = 1, 5 do for column = 1, COLUMNS do cells:target('height', row, column, 1 + math.sin(4 * t + column)) end end
end)"""
        for columns in 5, 2:  # with fewer, Python commands the others
            s = smartsurf.Simulation(self.script(text.replace("COLUMNS", str(columns))), seed=4)
            s.record(self.folder / "self.h5")
            for tick in range(30):
                s.step(1 + tick % 3) if columns < 5 else s.step()
            s.stop_recording()
            verified = self.verify(self.folder / "self.h5")
            self.assertEqual(verified.returncode, 0, verified.stderr)
            self.assertIn("identical in 31 frames", verified.stdout)

    def test_a_changed_recording_and_an_intervention_are_not_verified(self):
        s = smartsurf.Simulation(self.script(CROWD), seed=3)
        for change in (lambda: s.teleport(0, velocity=(1, 0, 0)), lambda: s.push(1, force=(0, 0, 9)),
                       lambda: (s.set_parameter("surface.friction", 0.1), s.reset(3), s.record(self.folder / "c.h5"))):
            s.reset(3)
            s.record(self.folder / "c.h5")
            if change.__code__.co_names[0] != "set_parameter":
                drive(s, 3)
            change()
            drive(s, 20)
            s.stop_recording()
            self.assertNotEqual(self.verify(self.folder / "c.h5").returncode, 0)


    def test_a_failed_episode_is_repeated_up_to_its_error(self):
        base = "surface { rows = 4, columns = 4, actuator = pin {} }\nsphere { radius = 0.5, position = {1, 1, 3} }\n"
        for line in ("reward(function(t, tick) assert(tick ~= 6, 'broken') return 0 end)",
                     "success(function(t, tick) assert(tick ~= 6, 'broken') end)", "on_tick(function(t, tick) assert(tick ~= 6, 'broken') end)"):
            with self.subTest(line):
                s = smartsurf.Simulation(self.script(base + line), seed=3)
                s.record(self.folder / "failed.h5")
                for _ in range(20):
                    with contextlib.suppress(smartsurf.Error):
                        s.step()
                s.stop_recording()
                self.assertIn("broken", self.result(self.folder / "failed.h5")[0])
                verified = self.verify(self.folder / "failed.h5")
                self.assertEqual(verified.returncode, 0, verified.stdout + verified.stderr)
                self.assertRegex(verified.stdout, "identical in [67] frames")


class SavedStates(ExperimentTest):
    def check_replay(self, path, warm_up, ticks, **arguments):
        s = smartsurf.Simulation(path, seed=11, **arguments)
        drive(s, warm_up)
        state, readings = s.save(), {n: a.copy() for n, a in s.sensors.items()}
        expected = drive(s, ticks, 1)
        metrics = s.finish()
        s.restore(state)
        self.assertEqual(s.tick, warm_up)
        for name, array in readings.items():
            np.testing.assert_array_equal(array, s.sensors[name])
        self.assertEqual(drive(s, ticks, 1), expected)
        self.assertEqual(s.finish(), metrics)
        # In another simulation, after another history with another seed, and with other threads.
        other = smartsurf.Simulation(path, seed=12, **{**arguments, "threads": 2})
        drive(other, 17)
        other.restore(pickle.loads(pickle.dumps(state)))
        self.assertEqual(other.seed, 11)
        self.assertEqual(drive(other, ticks, 1), expected)
        self.assertEqual(other.finish(), metrics)

    def test_a_replay_has_the_same_bits(self):
        for text in (CROWD, NOISY):
            for warm_up in (0, 40, 200):
                with self.subTest(warm_up=warm_up):
                    self.check_replay(self.script(text), warm_up, 80)

    def random_commands(self, random):
        """A script that commands its actuators and creates objects, its commands by tick, and the caller's writes by tick:
        each (channel, row, column, value)."""
        rows, columns, ticks = *random.integers(1, 4, 2), 12
        text = (f"surface {{ rows = {rows}, columns = {columns}, actuator = delta {{ latency = {random.integers(3)} }}, "
                f"sensors = {{ joint_position {{}}, proximity {{}} }} }}\n"
                f"faults {{ actuator = {{ weak = {{ fraction = 0.3, gain = 0.5 }}, latency = {random.integers(2)} }} }}\n")
        names = [c.name for c in smartsurf.Simulation("x.lua", source=text).actuator_channels]
        commands, writes = {}, {}
        for tick in range(ticks):
            for of, count in (commands, random.integers(3)), (writes, random.integers(3)):
                of[tick] = [(str(random.choice(names)), int(random.integers(rows)), int(random.integers(columns)),
                             float(random.choice([-9, 0, 0.5, 9, random.uniform(-2, 2)]))) for _ in range(count)]
            if random.random() < 0.3:
                writes[tick].append((names[0], 0, 0, np.nan))
            lines = [f"cells:target('{name}', {r + 1}, {c + 1}, {value!r})" for name, r, c, value in commands[tick]]
            if random.random() < 0.3:
                lines.append(f"sphere {{ radius = 0.4, position = {{ {random.uniform(0, columns)}, {random.uniform(0, rows)}, 3 }} }}")
            text += f"at({tick} / 60, function() {' '.join(lines)} end)\n"
        return text, commands, writes

    def test_targets_stand_until_they_are_written_also_in_a_restored_state(self):
        def same(s):
            s.restore(s.save())
            return s

        def another(s):
            other = smartsurf.Simulation("x.lua", seed=9, source=s._arguments["source"])
            other.step({c.name: c.maximum for c in other.actuator_channels})
            other.actuators[other.actuator_channels[0].name][...] = 1
            other.restore(s.save())
            return other

        for seed in range(12):
            text, commands, writes = self.random_commands(np.random.default_rng(seed))
            traces = []
            for carried in (lambda s: s, same, another, lambda s: pickle.loads(pickle.dumps(s)), copy.deepcopy):
                s, trace = smartsurf.Simulation("x.lua", seed=1, source=text), []
                channels = {c.name: c for c in s.actuator_channels}
                expected = {name: a.copy() for name, a in s.actuators.items()}
                for tick in range(len(writes)):
                    for name, row, column, value in writes[tick]:
                        s.actuators[name][row, column] = value
                    for name, row, column, value in writes[tick] + commands[tick]:
                        c = channels[name]
                        value = c.safe if np.isnan(value) else value
                        expected[name][row, column] = value if name in "xy" else np.clip(value, c.minimum, c.maximum)
                    beyond = np.maximum(np.hypot(expected["x"], expected["y"]) / channels["x"].maximum, 1)  # of the workspace's disc
                    for name in "xy":
                        expected[name] /= beyond
                    s = carried(s)
                    s.step()
                    for name, array in expected.items():
                        np.testing.assert_allclose(s.actuators[name], array, 1e-5, 0, err_msg=f"seed {seed}, tick {tick}")
                    trace.append((s.state_hash, *(a.tobytes() for a in s.sensors.values())))
                traces.append(trace)
            self.assertEqual(traces, traces[:1] * len(traces), f"seed {seed}")

    def test_sleeping_bodies(self):
        path = self.script(CROWD)
        s = smartsurf.Simulation(path, seed=2)
        for _ in range(400):
            s.step(0.0)
        state = s.save()
        expected = drive(s, 60)
        s.reset(2)
        s.restore(state)
        self.assertEqual(drive(s, 60), expected)

    def test_every_actuator(self):
        for name, actuator in ACTUATORS.items():
            with self.subTest(actuator=name):
                self.check_replay(self.script(TASK_OF_EACH_ACTUATOR % actuator, name + ".lua"), 30, 40)

    def test_equal_states_have_equal_bytes_in_every_process(self):
        program = ("import hashlib, sys, smartsurf\n"
                   "s = smartsurf.Simulation(sys.argv[1], seed=1, set={'count': 100, 'cells': 16})\n"
                   "for _ in range(60): s.step()\nprint(hashlib.sha256(s.save()).hexdigest())")
        command = [sys.executable, "-B", "-c", program, ROOT / "scripts/examples/pour.lua"]
        digests = {subprocess.run(command, check=True, capture_output=True).stdout for _ in range(3)}
        self.assertEqual(len(digests), 1)

    def test_tasks_can_be_saved(self):
        for task in smartsurf.TASKS:
            with self.subTest(task=task.id):
                s = smartsurf.Simulation(smartsurf.task_file(task.id), seed=1)
                drive(s, 5)
                state = s.save()
                twin = smartsurf.Simulation(smartsurf.task_file(task.id), seed=1)
                start = twin.save()
                drive(twin, 5)
                self.assertTrue(twin.save() == state, "equal states give other bytes")
                expected = drive(s, 5, 1)
                for earlier in (start, state):
                    s.restore(earlier)
                    self.assertTrue(s.save() == earlier, "a restored state gives other bytes")
                self.assertEqual(drive(s, 5, 1), expected)

    def test_tables_keep_identity_cycles_and_metatables(self):
        path = self.script(CROWD.split("on_reset")[0] + """
            local Counter = {}; Counter.__index = Counter
            function Counter:add(n) self.sum = self.sum + n return self.sum end
            shared = setmetatable({ sum = 0 }, Counter)
            local alias, loop, keys = shared, {}, {}
            loop.me = loop
            at(0.05, function() keys[object(0)] = 'zero' loop.later = { alias } loop.handle = next(keys) end)
            on_tick(function() shared:add(1) assert(loop.me == loop) end)
            reward(function(t)
              assert(not loop.later or (loop.later[1] == shared and keys[loop.handle] == 'zero'))
              return alias.sum + (math.type(alias.sum) == 'integer' and 0.5 or 0)
            end)""")
        s = smartsurf.Simulation(path)
        for _ in range(10):
            s.step()
        state = s.save()
        self.assertEqual(s.step()[0], 11.5)
        self.assertEqual(s.step()[0], 12.5)
        s.restore(state)
        self.assertEqual(s.step()[0], 11.5)

    def test_what_cannot_be_saved_is_refused(self):
        base = CROWD.split("on_reset")[0]
        for late, message in (
                ("at(0.03, function()\n at(9, function() end) end)", r"a function \(.*experiment.lua:\d+\), created while"),
                ("on_tick(function() x = coroutine.create(print) end) x = 1", "a coroutine"),
                ("at(0.03, function() hull { points = {{0,0,0},{1,0,0},{0,1,0},{0,0,1}}, position = {5,5,9} } end)",
                 "created from a mesh or hull during the run")):
            s = smartsurf.Simulation(self.script(base + late))
            for _ in range(5):
                s.step()
            before = s.state_hash
            with self.assertRaisesRegex(smartsurf.Error, message):
                s.save()
            s.step()  # it goes on
            s.reset(1)
            self.assertNotEqual(s.state_hash, before)

    def test_wrong_bytes_change_nothing(self):
        path = self.script(CROWD)
        s = smartsurf.Simulation(path, seed=1)
        drive(s, 20)
        state, before = s.save(), s.state_hash
        damaged = bytearray(state)
        damaged[len(state) // 2] ^= 1
        other = smartsurf.Simulation(self.script(NOISY, "other.lua"), seed=1).save()
        for wrong, message in ((b"", "not a saved state"), (b"x" * 1000, "not a saved state"),
                               (bytes(damaged), "damaged"), (state[:-10], "damaged"), (other, "another experiment")):
            with self.assertRaisesRegex(smartsurf.Error, message):
                s.restore(wrong)
            self.assertEqual(s.state_hash, before)
        trace = drive(s, 20)
        s.restore(state)
        self.assertEqual(drive(s, 20), trace)

    def test_bullet_says_that_it_cannot(self):
        try:
            s = smartsurf.Simulation(self.script(CROWD), engine="bullet")
        except smartsurf.Error as error:
            self.skipTest(str(error))
        with self.assertRaisesRegex(smartsurf.Error, "engine 'bullet' cannot be saved"):
            s.save()


class Errors(ExperimentTest):
    def test_one_line_each(self):
        path = self.script(CROWD)
        for arguments, message in (
                ({"experiment": "nowhere.lua"}, "nowhere.lua: the experiment does not exist"),
                ({"experiment": self.script("surface { rows = 'x' }", "a.lua")}, r"a.lua:1: surface.rows = 'x'"),
                ({"experiment": path, "set": {"n": 3}}, "no option 'n'"),
                ({"experiment": path, "engine": "warp"}, "warp"),
                ({"experiment": path, "seed": -1}, "seed = -1: must be"),
                ({"experiment": path, "seed": 1.5}, "seed = 1.5: must be"),
                ({"experiment": path, "seed": True}, "seed = True: must be"),
                ({"experiment": path, "set": ["n"]}, r"set = \['n'\]: must be a dict"),
                ({"experiment": path, "engine": 3}, "engine = 3: must be"),
                ({"experiment": path, "threads": 2**40}, "threads = 1099511627776: must be"),
                ({"experiment": path, "threads": "2"}, "threads = '2': must be"),
                ({"experiment": path, "threads": 0}, "threads = 0: must be")):
            with self.assertRaisesRegex(ValueError, message) as raised:
                smartsurf.Simulation(**arguments)
            self.assertNotIn("\n", str(raised.exception))
        s = smartsurf.Simulation(path)
        for actions, message in (({"hight": 1}, "no actuator channel 'hight'; known: height"),
                                 (np.zeros(3), r"actions\['height'\] has shape \(3,\): must be"),
                                 ([[1], [1, 2]], "has rows of different lengths: must be"),
                                 ({"height": "up"}, "has values of type <U2: must be real numbers")):
            with self.assertRaisesRegex(ValueError, message):
                s.step(actions)
        for call, message in ((lambda: s.restore("state"), "a str is not a saved state"),
                              (lambda: s.label(10), "object 10: must be 0 to 9, of the 10 objects so far"),
                              (lambda: s.label(10**30), "object 10{30}: must be 0 to 9"),
                              (lambda: s.label(-1), "object -1: must be 0 to 9"),
                              (lambda: s.label("ball"), "object 'ball': must be 0 to 9"),
                              (lambda: s.render(0, 100), "width = 0: must be"),
                              (lambda: s.render(100.5, 100), "width = 100.5: must be")):
            with self.assertRaisesRegex(ValueError, message) as raised:
                call()
            self.assertNotIn("\n", str(raised.exception))

    def test_a_path_with_a_nul_is_refused_as_by_open(self):
        path = self.script(CROWD)
        s = smartsurf.Simulation(path)
        for call in (lambda: smartsurf.Simulation(path + "\0.lua"), lambda: smartsurf.Simulation(path, extensions=["a.so\0b"]),
                     lambda: smartsurf.load_extension(pathlib.Path("a.so\0b")), lambda: s.record(self.folder / "a.h5\0.h5")):
            with self.assertRaisesRegex(ValueError, "^embedded null character$"):
                call()
        self.assertEqual(list(self.folder.glob("a.h5*")), [])

    def test_entries_of_fault_maps_that_no_channel_takes_are_refused(self):
        def load(entry, sensors):
            self.script(f"row,column,channel,fault,value\n0,0,height,dead,\n{entry}\n", "faults.csv")
            return smartsurf.Simulation(self.script(f"surface {{ rows = 4, columns = 4, actuator = pin {{}}, sensors = {{ {sensors} }} }} "
                                                    "faults { map = 'faults.csv' }"))
        for entry in ("1,1,,gain,0.5", "1,1,,offset,1"):  # of all sensors
            load(entry, "proximity {}")
            with self.assertRaisesRegex(smartsurf.Error, r"faults.csv:3: channel is empty: fault '(gain|offset)' of an actuator must name"):
                load(entry, "")
        load("1,1,,stuck_low,", "proximity {}")
        with self.assertRaisesRegex(smartsurf.Error, "faults.csv:3: fault 'stuck_low': not a fault of an actuator"):
            load("1,1,,stuck_low,", "")
        with self.assertRaisesRegex(smartsurf.Error, r"faults.csv:3: value of 'late' = 1.5: must be a whole number, 0 to 1000"):
            load("1,1,,late,1.5", "")
        load("1,1,,late,1000", "")

    def test_policies_name_what_is_wrong(self):
        layers = [(np.zeros((1, 1, 5)), [0])]
        for inputs, actions, memory, message in (
                (["x') y"], [("height", 0, 4)], 0, "not the name of a channel"),
                (["proximity"], [("height", 4, 0)], 0, "the range 4 … 0 must be finite and ascending"),
                (["proximity"], [("height", 0, np.nan)], 0, "must be finite"),
                (["proximity"], [("height", 0, 4)], -1, "memory = -1: must be"),
                (["proximity", "row"], [("height", 0, 4)], 0, r"must be \(out, 2, 5 or 9\)")):
            with self.assertRaisesRegex(ValueError, message):
                smartsurf.LocalPolicy(inputs, actions, layers, memory)
        with self.assertRaisesRegex(ValueError, r"'proximity' has shape \(4,\)"):
            smartsurf.LocalPolicy(["proximity"], [("height", 0, 4)], layers)({"proximity": np.zeros(4)})
        for observation, message in (({}, "the observation is empty: it must have a sensor"),
                                     ({"proximity": np.zeros(4)}, r"'proximity' has shape \(4,\)")):
            with self.assertRaisesRegex(ValueError, message):
                smartsurf.LocalPolicy(["row"], [("height", 0, 4)], layers)(observation)

    def test_an_episode_that_cannot_start(self):
        for place in ("on_reset(function() assert(luck > 0.5, 'bad luck') end)", "success(function() assert(luck > 0.5, 'bad luck') end)"):
            with self.subTest(place):
                self.check_bad_luck("surface { rows = 4, columns = 4, actuator = pin {} }\nlocal luck\n"
                                    "on_reset(function() luck = random() end)\n" + place)

    def check_bad_luck(self, text):
        s = smartsurf.Simulation(self.script(text), seed=1)
        lucky, seed, objects = s.state_hash, 1, s.objects
        for seed in range(2, 40):
            try:
                s.reset(seed)
            except smartsurf.Error as error:
                self.assertIn("bad luck", str(error))
                break
        for call in (s.step, s.save, s.finish, lambda: s.objects, lambda: s.state_hash, lambda: s.info):
            with self.assertRaisesRegex(smartsurf.Error, "reset it"):
                call()
        s.reset(1)
        self.assertEqual(s.state_hash, lucky)
        s.step()

    def test_texts_of_errors_have_no_control_characters(self):
        source = random.Random(8)
        marks = [*range(0x7f, 0xa0), *range(0x2028, 0x202f), *range(0x2066, 0x206a), 0x61c, 0x200e, 0x200f]
        for _ in range(20):
            codes = [source.choice((source.randrange(1, 0x20), source.choice(marks), source.randrange(0x20, 0x7f), 0xe4, 0x1f642)) for _ in range(30)]
            text = "".join("\\u{%x}" % code for code in codes)
            shown = "".join(" " if code < 0x20 or code == 0x7f else "?" if code in marks else chr(code) for code in codes)
            with self.assertRaises(smartsurf.Error) as caught:
                smartsurf.Simulation(self.script(f'error("{text}|")\nsurface {{ rows = 4, columns = 4 }}\n'))
            self.assertTrue(str(caught.exception).endswith(f"experiment.lua:1: {shown}|"), (str(caught.exception), shown))

    def test_errors_of_the_running_script(self):
        base = "surface { rows = 4, columns = 4, actuator = pin {} }\n"
        for line, message in (("on_tick(function() error('no') end)", "experiment.lua:2: no"),
                              ("reward(function() return 'much' end)", "experiment.lua:2: reward returned string"),
                              ("reward(function() return 0/0 end)", "reward returned nan"),
                              ("on_tick(function() while true do end end)", "endless loop"),
                              ("success(function(t) assert(t == 0, 'no') end)", "experiment.lua:2: no"),
                              ("metric('m', function(t) assert(t == 0, 'no') end)", "experiment.lua:2: no")):
            s = smartsurf.Simulation(self.script(base + line))
            with self.assertRaisesRegex(smartsurf.Error, message):
                s.step()
            for call in (s.step, s.save, s.finish, lambda: s.info):
                with self.assertRaisesRegex(smartsurf.Error, "the episode has failed: reset it"):
                    call()
            s.reset(1)
        for line, call in (("on_finish(function() error('no') end)", lambda s: s.finish()),
                           ("info { x = function() error('no') end }", lambda s: s.info)):
            s = smartsurf.Simulation(self.script(base + line))
            with self.assertRaisesRegex(smartsurf.Error, "experiment.lua:2: no"):
                call(s)
            with self.assertRaisesRegex(smartsurf.Error, "the episode has failed: reset it"):
                s.step()
        for line, message in (("info { x = 'y' }", "info.x = 'y': must be"), ("info { x = 0 }", "info.x = 0: there is no such object"),
                              *((f"info {{ ['{name}'] = function() return 1 end }}",
                                 f"experiment.lua:2: info.{name}: infos have another value of this name")
                                for name in ("seed", "success", "nonfinite_actions", "metrics", "error", "final_obs", "final_info",
                                             "_seed", "varied.friction")),
                              ("episode { seconds = 0 }", r"episode.seconds = 0: must be"),
                              ("reward(3)", "reward: function = 3: must be a function"),
                              ("reward(print) reward(print)", "reward: already declared"),
                              ("on_reset(function() error('early') end)", "early")):
            with self.assertRaisesRegex(smartsurf.Error, message):
                smartsurf.Simulation(self.script(base + line))


def fork_hash(path, results):
    s = smartsurf.Simulation(path, seed=4)
    drive(s, 20)
    results.put(s.state_hash)


def eventually(condition, patience_s=20):
    """The first true value of condition(). The promise is two seconds; a busy machine may need more."""
    deadline = time.monotonic() + patience_s
    while time.monotonic() < deadline:
        if value := condition():
            return value
        time.sleep(0.02)
    raise AssertionError(f"not within {patience_s} s")


class Processes(ExperimentTest):
    def test_fork_and_spawn(self):
        path = self.script(CROWD)
        expected = smartsurf.Simulation(path, seed=4)
        drive(expected, 20)
        for method in ("fork", "spawn"):
            context = multiprocessing.get_context(method)
            results = context.Queue()
            workers = [context.Process(target=fork_hash, args=(path, results)) for _ in range(2)]
            for worker in workers:
                worker.start()
            self.assertEqual([results.get(timeout=60) for _ in workers], [expected.state_hash] * 2, method)
            for worker in workers:
                worker.join(20)
                self.assertEqual(worker.exitcode, 0)

    def test_a_forked_simulation(self):
        for threads in (1, 2):
            s = smartsurf.Simulation(self.script(CROWD), seed=1, threads=threads)
            pid = os.fork()
            if pid == 0:
                try:
                    s.step()
                    os._exit(0)
                except RuntimeError:
                    os._exit(7)
            self.assertEqual(os.waitstatus_to_exitcode(os.waitpid(pid, 0)[1]), 0 if threads == 1 else 7)

    def test_a_forked_child_leaves_the_recording_to_its_parent(self):
        program = """
import os, sys
import smartsurf
path, file, end, ticks = sys.argv[1], sys.argv[2], sys.argv[3], int(sys.argv[4])
s = smartsurf.Simulation(path, seed=1)
s.record(file)
for _ in range(ticks):
    s.step(1.0)
pid = os.fork()
if pid == 0:
    for _ in range(100):
        s.step(2.0)
    if end == "reset":
        s.reset(2)
        s.record(os.path.join(os.path.dirname(file), "childs.h5"))
        s.step()
        s.stop_recording()
    sys.stdout.flush()
    if end == "_exit":
        os._exit(0)
    sys.exit(0)
if end != "reset":  # while the child runs
    for _ in range(70):
        s.step(1.0)
assert os.waitstatus_to_exitcode(os.waitpid(pid, 0)[1]) == 0
for _ in range(200 - ticks - 70 * (end != "reset")):
    s.step(1.0)
s.stop_recording()
"""
        script, expected = self.script(CROWD), None
        for ending in ("csv", "h5"):
            for end in ("none", "_exit", "exit", "reset"):
                for ticks in (0, 100):  # before and after the file has its name
                    with self.subTest(ending=ending, end=end, ticks=ticks):
                        file = self.folder / f"{end}-{ticks}.{ending}"
                        if end == "none":
                            s = smartsurf.Simulation(script, seed=1)
                            s.record(file)
                            for _ in range(200):
                                s.step(1.0)
                            s.stop_recording()
                            expected = file.read_bytes()
                            continue
                        done = subprocess.run([sys.executable, "-c", program, script, file, end, str(ticks)], capture_output=True,
                                              text=True, timeout=120)
                        self.assertEqual((done.returncode, done.stdout + done.stderr), (0, ""))
                        if ending == "csv":
                            self.assertEqual(file.read_bytes(), expected)
                        else:
                            for one, frames in ((file, 201), (self.folder / "childs.h5", 2))[:1 + (end == "reset")]:
                                verified = subprocess.run([os.environ["SMARTSURF"], "replay", one, "--verify"], capture_output=True,
                                                          text=True, timeout=120)
                                self.assertEqual(verified.returncode, 0, verified.stdout + verified.stderr)
                                text = subprocess.run([os.environ["SMARTSURF"], "info", "--datasets", one], capture_output=True,
                                                      text=True, timeout=60).stdout
                                self.assertRegex(text, rf"(?m)^/tick +{frames}$")
        self.assertEqual(list(self.folder.glob("*.part")), [])

    def test_killed_python_leaves_neither_the_simulator_nor_the_controller_of_a_run(self):
        path, controller = self.script(CROWD), self.script("while(1)\n  surface.step\nendwhile\n", "idle.aps")
        program = f"from smartsurf.run import run\nrun({path!r}, {controller!r}, until=1e9)"
        for victim in ("python", "simulator"):
            with self.subTest(killed=victim):
                learner = subprocess.Popen([sys.executable, "-c", program], stderr=subprocess.DEVNULL)
                segment = None
                try:
                    simulator = eventually(lambda: children(learner.pid))[0]
                    below = eventually(lambda: len(children(simulator)) > 1 and children(simulator))  # guardian and broker
                    segment = pathlib.Path(f"/dev/shm/smartsurf.run-{simulator}")
                    eventually(segment.exists)
                    os.kill(learner.pid if victim == "python" else simulator, signal.SIGKILL)
                    killed = time.monotonic()
                    eventually(lambda: all(map(ended, [simulator, *below])))
                    print(f"{victim} killed: both ended after {time.monotonic() - killed:.2f} s", flush=True)
                    self.assertFalse(segment.exists())
                finally:
                    learner.kill()
                    learner.wait()
                    if segment:
                        segment.unlink(missing_ok=True)

    def test_environments_open_no_files_and_no_threads(self):
        def resources():
            return len(os.listdir("/proc/self/fd")), len(os.listdir("/proc/self/task"))
        path = self.script(CROWD)
        smartsurf.Simulation(path)
        gc.collect()
        before, segments = resources(), set(os.listdir("/dev/shm"))
        simulations = [smartsurf.Simulation(path, threads=2) for _ in range(3)]
        self.assertEqual(resources(), (before[0], before[1] + 3))
        del simulations
        gc.collect()
        self.assertEqual(resources(), before)
        self.assertEqual([n for n in set(os.listdir("/dev/shm")) - segments if re.search(rf"(?<!\d){os.getpid()}(?!\d)", n)], [])


if __name__ == "__main__":
    unittest.main()
