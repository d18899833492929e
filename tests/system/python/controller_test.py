"""An APRON controller in every world of a VectorEnv equals the pair of processes that `smartsurf run --controller` starts."""
import resource
import sys
import unittest

try:
    import gymnasium  # noqa: F401
    import numpy as np
except ImportError:
    print("skipped: Gymnasium or NumPy is not installed")
    sys.exit(77)
import smartsurf
from experiments import ROOT, ExperimentTest

PLATE = """
local drop = option('drop', 3)
surface { rows = 12, columns = 10, border = { height = 5 }, actuator = pin { range = {0, 4}, max_speed = 12 },
          sensors = { proximity { range = 6 }, colour { range = 6 }, pressure {} } }
local ball = sphere { radius = 0.8, position = {4, 4, 6} }
on_reset(function() object(ball):teleport { position = {random(2, 8), random(2, 8), drop} } end)
reward(function() local x, y, z = object(ball):position() return z end)
episode { seconds = 1 }
"""
WAVE = """
!register(T, P, R, D)
sim.slider.add('gain', 0, 5, 1)
gain = sim.slider.get('gain')
count = 0
while(1)
  P = surface.sense('proximity')
  R = surface.sense('colour.r') + surface.sense('colour[2]')
  D = surface.sense('pressure')
  count = count + 1
  T = 2 + gain * math.sin(cell.x + 4 * surface.time) + (P < 1) - R * 0.1 + random.float.rand(0, 0.2) + D * 0.01
  where(cell.y > count % 7)
    T = T + 0.3
  endwhere
  surface.actuate('height', T)
  surface.step
endwhile
"""


class Controllers(ExperimentTest):
    def program(self, text, name="p.aps"):
        return self.script(text, name)

    def pair_hash(self, lua, aps, seed, until, **arguments):
        return int(smartsurf.run(str(lua), str(aps), seed=seed, until=until, **arguments)["state_hash"], 16)

    def test_tasks_equal_the_pair_of_processes(self):
        tasks = ROOT / "scripts/tasks"
        for name in ("relocate", "magnets", "arraybot_lift", "delta_align", "sheet_circle", "colour_sort", "packages", "rain"):
            lua, aps = tasks / f"{name}.lua", tasks / f"{name}.aps"
            envs = smartsurf.VectorEnv(lua, num_envs=2, threads=2, controller=aps)
            envs.reset(seed=5)
            for _ in range(40):
                _, _, terminated, truncated, _ = envs.step()
                self.assertFalse((terminated | truncated).any(), name)
            for world in range(2):
                self.assertEqual(envs.state_hash(world), self.pair_hash(lua, aps, 5 + world, 40 * envs.period), name)

    def test_every_episode_equals_a_pair(self):
        lua, aps = self.script(PLATE), self.program(WAVE)
        trace = []
        for threads in (1, 3):
            envs = smartsurf.VectorEnv(lua, num_envs=3, threads=threads, controller=aps, set={"drop": 4})
            envs.reset(seed=7)
            hashes = []
            for tick in range(150):
                _, rewards, _, _, infos = envs.step()
                hashes.append((tuple(rewards), tuple(infos["seed"]), tuple(envs.state_hash(i) for i in range(3))))
            trace.append(hashes)
        self.assertEqual(trace[0], trace[1])
        # 60 ticks, a step that resets, 60 ticks, a step that resets
        for tick in (59, 120):
            _, seeds, hashes = trace[0][tick]
            for seed, state in zip(seeds, hashes):
                self.assertEqual(state, self.pair_hash(lua, aps, int(seed), 1, set={"drop": 4}))

    def test_parameters(self):
        lua, aps = self.script(PLATE), self.program(WAVE)
        fixed = self.program(WAVE.replace("gain = sim.slider.get('gain')", "gain = 2.5"), "fixed.aps")
        states = []
        for program, parameters in ((aps, {"gain": 2.5}), (fixed, None), (aps, None)):
            envs = smartsurf.VectorEnv(lua, num_envs=1, controller=program, controller_set=parameters)
            envs.reset(seed=1)
            for _ in range(30):
                envs.step()
            states.append(envs.state_hash(0))
        self.assertEqual(states[0], states[1])
        self.assertNotEqual(states[0], states[2])
        for parameters, text in (({"gian": 1}, "gian"), ({"gain": 5.5}, "'gain' = 5.5 is not from 0 to 5"), ({"gain": "x"}, "finite"), ({"gain": float("nan")}, "finite")):
            with self.assertRaisesRegex(ValueError, text):
                smartsurf.VectorEnv(lua, controller=aps, controller_set=parameters)
        with self.assertRaisesRegex(ValueError, "needs a controller"):
            smartsurf.VectorEnv(lua, controller_set={})

    def test_a_program_that_ends(self):
        lua = self.script(PLATE)
        aps = self.program("repeat(5)\n  surface.actuate('height', surface.tick)\n  surface.step\nendrepeat\n")
        envs = smartsurf.VectorEnv(lua, num_envs=2, controller=aps)
        envs.reset(seed=3)
        for tick in range(5):
            _, _, terminated, truncated, _ = envs.step()
            self.assertFalse((terminated | truncated).any())
        moved = envs.state_hash(0)
        _, _, terminated, truncated, infos = envs.step()
        self.assertTrue(truncated.all() and not terminated.any())
        self.assertEqual(envs.state_hash(0), moved)
        self.assertEqual(moved, self.pair_hash(lua, aps, 3, 1))
        envs.step()  # resets
        self.assertFalse(envs.step()[3].any())

    def test_errors(self):
        lua = self.script(PLATE)
        for text, message in (("surface.actuate('hight', 1)\nsurface.step\n", r"p\.aps:1: error: the surface has no actuator channel 'hight'; its actuator channels: height"),
                              ("!register(A)\nA = surface.sense('colour')\nsurface.step\n", r"p\.aps:2: .*3 components"),
                              ("!register(A)\nio.array.save(A, 'a.npy')\n", r"p\.aps:2: .*files")):
            envs = smartsurf.VectorEnv(lua, num_envs=2, controller=self.program(text))
            envs.reset(seed=1)
            with self.assertRaisesRegex(smartsurf.Error, message):
                envs.step()
        with self.assertRaisesRegex(smartsurf.Error, r"p\.aps:2:5: error: .*'B'"):
            smartsurf.VectorEnv(lua, num_envs=2, controller=self.program("!register(A)\nA = B\n"))
        with self.assertRaisesRegex(ValueError, "nowhere.aps"):
            smartsurf.VectorEnv(lua, controller="nowhere.aps")
        # One world's error is that world's alone.
        aps = self.program("!register(P)\nwhile(1)\n  P = surface.sense('proximity')\n  n = globalmax(select(P < 5, cell.x, 0))\n"
                           "  if(n > 6)\n    n = pixel.get(P, 100, 0)\n  endif\n  surface.step\nendwhile\n")
        envs = smartsurf.VectorEnv(lua, num_envs=12, controller=aps, set={"drop": 2})
        envs.reset(seed=1)
        failed = np.zeros(12, bool)
        for _ in range(50):
            _, rewards, _, truncated, infos = envs.step()
            failed |= np.isnan(rewards)
        self.assertTrue(0 < failed.sum() < 12, failed)
        envs = smartsurf.VectorEnv(lua, num_envs=1, controller=self.program(WAVE))
        envs.reset(seed=1)
        with self.assertRaisesRegex(ValueError, "takes no actions"):
            envs.step(np.zeros(envs.action_space.shape, np.float32))
        for call in (lambda: envs.save(0), lambda: envs.restore(0, b"")):
            with self.assertRaisesRegex(smartsurf.Error, "controller cannot be saved"):
                call()

    def test_cost_of_a_tick(self):
        """A tick costs a small part of what a pair of processes pays for it: the exchange, and starting the processes."""
        lua = self.script(PLATE)
        aps = self.program("while(1)\n  surface.actuate('height', 1)\n  surface.step\nendwhile\n")
        envs = smartsurf.VectorEnv(lua, num_envs=32, threads=1, controller=aps)

        def seconds(who):
            usage = resource.getrusage(who)
            return usage.ru_utime + usage.ru_stime
        ratios = []
        while len(ratios) < 3 or (max(ratios) <= 10 and len(ratios) < 20):  # on a busy machine, either may cost more
            envs.reset(seed=1)
            start = seconds(resource.RUSAGE_SELF)
            for _ in range(60):
                envs.step()
            inside = (seconds(resource.RUSAGE_SELF) - start) / 32
            start = seconds(resource.RUSAGE_CHILDREN)
            smartsurf.run(lua, aps, seed=1, until=1)
            ratios.append((seconds(resource.RUSAGE_CHILDREN) - start) / inside)
        self.assertGreater(max(ratios), 10, ratios)


if __name__ == "__main__":
    unittest.main()
