"""The Python client at work: the environment, the case study's twin, the example and what the page shows.

usage: python_environment_test.py [unittest's arguments]; needs SHM_PROTOCOL_LIBRARY and shm_protocol on PYTHONPATH;
SMARTSURF and APRON name the two programs, SOURCE_ROOT the source tree, SURFACE_EXAMPLE the C surface.
"""
import json
import os
import pathlib
import re
import subprocess
import sys
import tempfile
import textwrap
import threading
import unittest

from python_pair import ACTUATORS, EXAMPLES, ROOT, SENSORS, unique

import numpy as np
from shm_protocol import Surface, SurfaceEnv

sys.path.insert(0, str(EXAMPLES))


def serve(surface, ticks):
    """Publishes `distance` = tick and waits for the answers."""
    def body():
        if not surface.wait_for_controller(20):
            return
        for tick in range(ticks):
            surface.sensors["distance"][:] = tick % 8
            surface.publish(tick, tick * 0.01)
            if not surface.wait(20):
                break
        surface.close()
    thread = threading.Thread(target=body)
    thread.start()
    return thread


class Environment(unittest.TestCase):
    def test_steps_a_surface_that_runs_already(self):
        surface = Surface(unique("env"), 5, 7, 0.01, SENSORS[:1], ACTUATORS[:1])
        thread = serve(surface, 20)
        with SurfaceEnv(name=surface.description.name, reward=lambda o, a: o["distance"].sum(), max_steps=15) as env:
            self.assertEqual(env.action_space["height"].shape, (5, 7))
            self.assertTrue(env.action_space.contains(env.action_space.sample()))
            self.assertFalse(env.action_space.contains({"height": np.full((5, 7), 4.5, np.float32)}))
            with self.assertRaises(ValueError):
                env.reset(seed=1)
            observation, info = env.reset()
            self.assertTrue(env.observation_space.contains(observation))
            self.assertEqual(info["tick"], 0)
            for step in range(1, 25):
                kept = observation["distance"].copy()
                following, reward, terminated, truncated, info = env.step(env.action_space.sample())
                np.testing.assert_array_equal(observation["distance"], kept)  # an observation is a copy
                observation = following
                self.assertEqual(truncated, step >= 15 and not terminated)
                if terminated:
                    break
                self.assertEqual((info["tick"], reward), (step, 35.0 * (step % 8)))
            self.assertTrue(terminated and info["surface_closed"])
            self.assertEqual(step, 20)
        thread.join()

    def test_wrong_actions_are_named(self):
        surface = Surface(unique("env"), 5, 7, 0.01, SENSORS[:1], ACTUATORS)
        thread = serve(surface, 3)
        with SurfaceEnv(name=surface.description.name) as env:
            env.reset()
            with self.assertRaisesRegex(ValueError, "height, lamp"):
                env.step(np.zeros((5, 7)))
            with self.assertRaisesRegex(ValueError, "height, lamp"):
                env.step({"height": 1})
            with self.assertRaisesRegex(ValueError, r"action's height must be numbers of shape \(5, 7\), not shape \(3, 3\)"):
                env.step({"height": np.zeros((3, 3)), "lamp": 2})
            with self.assertRaisesRegex(ValueError, r"action's lamp must be numbers of shape .*, not 'on'"):
                env.step({"height": 1, "lamp": "on"})
            env.step({"height": 1, "lamp": 2})
        thread.join()

    def test_a_program_that_is_not_there_is_named(self):
        with self.assertRaisesRegex(RuntimeError, "cannot start ./no-smartsurf .*: put it on PATH"):
            SurfaceEnv("any.lua", smartsurf="./no-smartsurf")

    def test_a_library_that_is_not_there_is_named(self):
        run = subprocess.run([sys.executable, "-c", "import shm_protocol"], capture_output=True, text=True,
                             env=dict(os.environ, SHM_PROTOCOL_LIBRARY="/nowhere/lib.so"))
        self.assertIn("SHM_PROTOCOL_LIBRARY names /nowhere/lib.so, which does not exist", run.stderr)

    def test_a_space_says_what_it_is(self):
        surface = Surface(unique("env"), 5, 7, 0.01, SENSORS[:1], ACTUATORS[:1])
        thread = serve(surface, 1)
        with SurfaceEnv(name=surface.description.name) as env:
            env.reset()
            self.assertRegex(repr(env.action_space), r"'height': Box\(0.0, 4.0, \(5, 7\), float32\)")
            env.step({"height": 1})
        thread.join()

    @unittest.skipUnless(os.environ.get("SMARTSURF"), "the simulator was not built")
    def test_the_simulator_can_be_reset_to_a_seed(self):
        def first_frames(env, seed):
            observation, _ = env.reset(seed=seed)
            frames = [observation["proximity"]]
            for _ in range(30):
                observation, *_ = env.step(np.float32(4))
                frames.append(observation["proximity"])
            return np.array(frames)

        with SurfaceEnv(ROOT / "scripts/case-study/sort.lua", smartsurf=os.environ["SMARTSURF"]) as env:
            one, other, one_again = first_frames(env, 1), first_frames(env, 2), first_frames(env, 1)
            self.assertTrue((one == one_again).all())
            self.assertFalse((one == other).all())

    @unittest.skipUnless(os.environ.get("SMARTSURF"), "the simulator was not built")
    def test_an_experiment_that_does_not_load_is_an_error(self):
        with self.assertRaisesRegex(RuntimeError, "status 2 before there was a surface: .*at-all.lua"):
            SurfaceEnv("/nowhere/at-all.lua", smartsurf=os.environ["SMARTSURF"])

    @unittest.skipUnless(os.environ.get("SMARTSURF"), "the simulator was not built")
    def test_a_script_that_fails_later_is_an_error_and_no_end_of_the_episode(self):
        with tempfile.TemporaryDirectory() as folder:
            experiment = pathlib.Path(folder) / "fails.lua"
            experiment.write_text("surface { rows = 4, columns = 4, sensors = { proximity {} } }\n"
                                  "on_tick(function(t, tick) if tick == 3 then error('far enough') end end)\n")
            with SurfaceEnv(experiment, smartsurf=os.environ["SMARTSURF"]) as env:
                env.reset()
                with self.assertRaisesRegex(RuntimeError, "status 2 after 3 steps: .*fails.lua:2: .*far enough"):
                    for _ in range(9):
                        env.step(np.float32(1))

    @unittest.skipUnless(os.environ.get("SMARTSURF"), "the simulator was not built")
    def test_the_pages_example_runs_as_it_stands(self):
        page = (ROOT / "docs/protocol-clients.md").read_text(encoding="utf-8")
        example = re.search(r"^    from shm_protocol import SurfaceEnv\n(    .*\n)+", page, re.M).group()
        search = os.pathsep.join([str(pathlib.Path(os.environ["SMARTSURF"]).parent), os.environ["PATH"]])
        code = textwrap.dedent(example) + "print(info['tick'], reward)\n"
        done = subprocess.run([sys.executable, "-c", code], cwd=ROOT, env={**os.environ, "PATH": search},
                              capture_output=True, text=True, timeout=60)
        self.assertEqual(done.returncode, 0, done.stderr)
        self.assertRegex(done.stdout.splitlines()[-1], r"^1 \S+$")


class CaseStudy(unittest.TestCase):
    TICKS = 600

    def simulate(self, name, **controller):
        """The first ticks of the case study, until objects stall and call, → the state's hash."""
        with tempfile.TemporaryDirectory() as folder:
            stats = pathlib.Path(folder) / "stats.json"
            command = [os.environ["SMARTSURF"], "run", str(ROOT / "scripts/case-study/sort.lua"), "--shm", name, "--ticks",
                       str(self.TICKS), "--seed", "3", "--stats", str(stats)]
            command += ["--controller", controller["program"]] if controller else []
            simulator = subprocess.Popen(command, stdin=subprocess.DEVNULL)
            try:
                if not controller:
                    import sort
                    sort.run(name, 30)
                self.assertEqual(simulator.wait(120), 0)
            finally:
                simulator.kill()
                simulator.wait()
            result = json.loads(stats.read_text())
            self.assertEqual(result["ticks"], self.TICKS)
            return result["state_hash"]

    @unittest.skipUnless(os.environ.get("SMARTSURF") and os.environ.get("APRON"), "the programs were not built")
    def test_numpy_and_apron_give_the_same_bits(self):
        program = str(ROOT / "scripts/case-study/sort.aps")
        by_apron = self.simulate(unique("sort"), program=program)
        by_numpy = self.simulate(unique("sort"))
        self.assertEqual(by_numpy, by_apron)

        # The comparison sees a difference: another share leads elsewhere.
        import sort
        share, sort.SHARE = sort.SHARE, 0
        try:
            self.assertNotEqual(self.simulate(unique("sort")), by_apron)
        finally:
            sort.SHARE = share


class Examples(unittest.TestCase):
    def test_the_example_controller_has_at_most_15_lines_and_serves(self):
        example = EXAMPLES / "controller.py"
        self.assertLessEqual(len(example.read_text().splitlines()), 15)
        name = unique("example")
        surface = subprocess.Popen([os.environ["SURFACE_EXAMPLE"], name])
        try:
            subprocess.run([sys.executable, str(example), name], check=True, timeout=60)
            self.assertEqual(surface.wait(60), 0)
        finally:
            surface.kill()
            surface.wait()


if __name__ == "__main__":
    unittest.main()
