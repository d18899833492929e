"""Nuisances, of vary{} and --vary: drawn from streams of their own, set in the scene, recorded, refused in one line."""
import math
import sys

from programs import *

sys.path.insert(0, str(ROOT / "scripts/tasks"))
import plan  # noqa: E402

DRAWS = """
surface { rows = 4, columns = 4 }
material { name = 'wood', friction = 0.4 }
sphere { radius = 0.5, mass = 2, position = {1, 1, 1}, material = 'wood' }
metric('script', random())
metric('stream', random_stream('friction'))
VARY
"""
RANGES = "friction = {0.5, 1.5, 'factor'}, mass = {1, 3}, latency = {0, 3}"

# On pins at rest: a ball at the height of its radius; one that comes later; a box that slides; a ball that bounces; a push.
EFFECTS = """
world { sleep = false }
surface { rows = 40, columns = 8, actuator = pin { range = {0, 4}, max_speed = 2, max_acceleration = 1e5 } }
material { name = 'own', friction = 0.3, restitution = 0.2 }
sphere { radius = 1, position = {1, 36, 1.02}, label = 'still' }
box { size = {2, 2, 1}, position = {5.5, 4, 0.5}, velocity = {0, 6, 0}, label = 'slides', friction = 0.3 }
sphere { radius = 1, position = {4, 36, 2.9}, material = 'own', label = 'drops' }
local pushed = sphere { radius = 0.5, position = {1, 20, 9}, label = 'pushed' }
local later, bounced, fastest = nil, 0, 0
at(0, function()
  later = sphere { radius = 1, position = {1, 30, 1.1} }
  object(pushed):push { force = {0, 1, 0}, seconds = 0.1 }
end)
on_tick(function(t)
  local _, _, z = object(2):position()
  local _, _, up = object(2):velocity()
  if t > 0.6 then bounced = math.max(bounced, up) end
  local _, along = object(pushed):velocity()
  if t < 0.2 then fastest = math.max(fastest, along) end
  cells:target('height', 20, 7, 4)
end)
on_finish(function()
  local function height(id) return select(3, object(id):position()) end
  metric('still', height(0))
  metric('later', height(later))
  metric('slid', select(2, object(1):position()) - 4)
  metric('bounced', bounced)
  metric('pushed', fastest)
end)
"""


class Nuisances(ProgramTest):
    def stats(self, experiment, *flags):
        file = self.folder / "stats.json"
        status, _, err = self.run_program(SMARTSURF, "run", experiment, "--no-controller", "--stats", str(file), *flags)
        self.assertEqual(status, 0, err)
        return json.loads(file.read_text())

    def draws(self, vary, *flags):
        """Of 256 seeds, the values drawn and those of the script, by name."""
        experiment = self.write("draws.lua", DRAWS.replace("VARY", f"vary {{ {vary} }}" if vary else ""))
        runs = self.stats(experiment, "--worlds", "256", "--ticks", "1", "--seed", "1000", *flags)["runs"]
        return {name: [{**run["metrics"], **run.get("varied", {})}[name] for run in runs]
                for name in {**runs[0]["metrics"], **runs[0].get("varied", {})}}

    def test_draws_are_uniform_and_correlate_with_nothing(self):
        drawn = self.draws(RANGES)
        self.assertEqual(sorted(drawn), ["friction", "latency", "mass", "script", "stream"])
        for name, low, high in (("friction", 0.5, 1.5), ("mass", 1, 3), ("script", 0, 1)):
            shares = sorted((value - low) / (high - low) for value in drawn[name])
            self.assertTrue(0 <= shares[0] and shares[-1] < 1, name)
            # Kolmogorov's distance: above 1.95/√n with a probability of 0.1 %.
            self.assertLess(max(abs((i + 0.5) / 256 - share) for i, share in enumerate(shares)), 1.95 / 16, name)
        self.assertEqual(set(drawn["latency"]), {0, 1, 2, 3})

        def correlation(a, b):
            mean_a, mean_b = sum(a) / len(a), sum(b) / len(b)
            products = [sum((x - mean_a) * (y - mean_b) for x, y in zip(first, second)) for first, second in ((a, b), (a, a), (b, b))]
            return products[0] / math.sqrt(products[1] * products[2])
        names = sorted(drawn)
        for i, name in enumerate(names):
            self.assertLess(abs(correlation(drawn[name][1:], drawn[name][:-1])), 0.22, f"{name} of consecutive seeds")
            for other in names[:i]:
                self.assertLess(abs(correlation(drawn[name], drawn[other])), 0.22, f"{name} and {other}")

    def test_a_nuisance_changes_no_other_number_that_is_drawn(self):
        drawn, alone, without = self.draws(RANGES), self.draws("friction = {0.5, 1.5, 'factor'}"), self.draws("")
        self.assertEqual(drawn["friction"], alone["friction"])
        for name in ("script", "stream"):
            self.assertEqual(drawn[name], without[name])
        self.assertEqual(self.draws("", "--vary", "friction=0.5:1.5:factor")["friction"], alone["friction"])
        # The command line takes the place of the script's.
        self.assertEqual(set(self.draws(RANGES, "--vary", "mass=7")["mass"]), {7})

    def test_runs_are_the_same_alone_in_worlds_and_on_threads(self):
        experiment = self.write("draws.lua", DRAWS.replace("VARY", f"vary {{ {RANGES}, size = {{0.9, 1.1, 'factor'}} }}"))
        runs = self.stats(experiment, "--worlds", "3", "--ticks", "90", "--seed", "5")["runs"]
        for seed, world in zip((5, 6, 7), runs):
            for threads in ("1", "2"):
                alone = self.stats(experiment, "--ticks", "90", "--seed", str(seed), "--threads", threads)
                self.assertEqual([alone[key] for key in ("state_hash", "varied")], [world[key] for key in ("state_hash", "varied")])
        self.assertEqual(len({run["state_hash"] for run in runs}), 3)

    def test_each_nuisance_does_what_its_name_says(self):
        experiment = self.write("effects.lua", EFFECTS)

        def metrics(*vary):
            return self.stats(experiment, "--until", "3", *(word for text in vary for word in ("--vary", text)))["metrics"]
        declared = metrics()
        # A box that slides: v²/2μg; the contact's friction is the mean of that of the box, 0.3, and that of the table, 0.5.
        distance = 36 / (2 * math.sqrt(0.3 * 0.5) * 9.81)
        self.assertAlmostEqual(declared["slid"], distance, delta=0.05 * distance)
        self.assertAlmostEqual(metrics("friction=0.8:factor")["slid"], distance / 0.8, delta=0.05 * distance)
        self.assertAlmostEqual(metrics("friction=0.6")["slid"], 36 / (2 * 0.6 * 9.81), delta=0.05 * distance)
        larger = metrics("size=1.25:factor")
        for name in ("still", "later"):
            self.assertAlmostEqual(declared[name], 1, delta=0.02)
            self.assertAlmostEqual(larger[name], 1.25, delta=0.02)
        # A drop from 1.9 u above rest: it bounces with the contact's restitution.
        self.assertLess(declared["bounced"], 2.5)
        self.assertAlmostEqual(metrics("restitution=0.8")["bounced"], 0.8 * math.sqrt(2 * 9.81 * 1.9), delta=0.5)
        ball = math.pi / 6
        for vary, mass in (("mass=2:factor", 2 * ball), ("mass=5", 5), ("mass=1:offset", ball + 1)):
            self.assertAlmostEqual(metrics(vary)["pushed"], 0.1 / mass, delta=0.02 * 0.1 / mass)
        self.assertAlmostEqual(declared["pushed"], 0.1 / ball, delta=0.02 * 0.1 / ball)

    def test_a_factor_of_errors_changes_the_sensors_that_have_one(self):
        experiment = self.write("noisy.lua", """
            surface { rows = 8, columns = 8, sensors = { proximity { range = 8, noise = 0.01 }, pin_height {} } }
            sphere { radius = 4, position = {3.5, 3.5, 6}, fixed = true }
            local function worst(channel)
              local greatest = 0
              for row = 1, 8 do
                for column = 1, 8 do
                  local error = math.abs(cells:sense(channel, row, column) - cells:truth(channel, row, column))
                  if error < 4 then greatest = math.max(greatest, error) end
                end
              end
              return greatest
            end
            on_finish(function() metric('near', worst('proximity')) metric('pins', worst('pin_height')) end)
            """)
        declared, tenfold = (self.stats(experiment, "--until", "0.2", *flags)["metrics"] for flags in ((), ("--vary", "sensor_noise=10:factor")))
        self.assertAlmostEqual(tenfold["near"], 10 * declared["near"], delta=0.1 * tenfold["near"])
        self.assertEqual([declared["pins"], tenfold["pins"]], [0, 0])

    def test_recordings_know_them_and_repeat_them(self):
        experiment = self.write("draws.lua", DRAWS.replace("VARY", "vary { friction = {0.5, 1.5, 'factor'}, size = {0.8, 1.2, 'factor'} }"))
        stats = self.stats(experiment, "--vary", "mass=1:3", "--ticks", "60", "--record", "run.h5")
        status, out, err = self.run_program(SMARTSURF, "info", "run.h5")
        self.assertEqual(status, 0, err)
        line = next(line for line in out.splitlines() if line.startswith("varied"))
        for name, range in (("friction", "0.5:1.5:factor"), ("mass", "1:3"), ("size", "0.8:1.2:factor")):
            self.assertIn(f"{name} = {stats['varied'][name]:.6g} ({range})", line)
        status, out, err = self.run_program(SMARTSURF, "replay", "run.h5", "--verify")
        self.assertEqual(status, 0, err)

    def test_mistakes_are_one_line_and_status_2(self):
        scene = "surface { rows = 4, columns = 4 SURFACE }\nsphere { radius = 0.5, position = {1, 1, 1} }\n"
        for surface, vary, message in (
                ("", "frction = {0, 1}", "x.lua:3: vary.frction: no nuisance or parameter 'frction' (did you mean 'friction'?)"),
                ("", "friction = {2, 1}", "x.lua:3: vary.friction: low = 2 is above high = 1"),
                ("", "friction = {0, 1/0}", "vary.friction[2] = inf: must be finite"),
                ("", "friction = {0, 1, 'times'}", "vary.friction[3] = 'times': must be 'absolute', 'factor' or 'offset'"),
                ("", "friction = 1", "vary.friction = 1: must be {low, high} or {low, high, 'factor' or 'offset'}"),
                ("", "friction = {1}", "vary.friction = a table: must be {low, high} or"),
                ("", "{0, 1}", "must be by name: vary{friction = {0.5, 1.5, 'factor'}}"),
                ("", "friction = {-1, 1}", "vary.friction: material.friction = -1"),
                ("", "restitution = {0, 1.5}", "vary.restitution: material.restitution = 1.5: must be in [0, 1]"),
                ("", "size = {0.5, 1}", "vary.size: must be a 'factor'"),
                ("", "latency = {0, 1.5}", "vary.latency: must have whole numbers"),
                ("", "gravity = {-10, -9}", "vary.gravity: is a vector: must be a 'factor'"),
                ("", "sensor_latency = {0, 1e30}", "vary.sensor_latency: faults.sensor.latency = 9.00719925474e+15: must be in [0, 100]"),
                ("", "sensor_noise = {1, 2, 'factor'}", "vary.sensor_noise: the script declares no value for a 'factor' or an 'offset'"),
                ("", "stuck = {0, 2}", "vary.stuck: faults.actuator.stuck = 2: must be in [0, 1]"),
                ("", "stuck = {0, 0.6}, dead = {0, 0.6}", "vary.stuck: faults.actuator: stuck, dead and weak add up to 1.2 of the cells"),
                ("", "['faults.height.stuck'] = {0, 1}", "is a value of each cell"),
                (", actuator = wheels {}", "pin_speed = {1, 2}", "vary.pin_speed: no actuator of the surface has a max_speed"),
                (", actuator = wheels {}", "['actuator.max_spin'] = {1, 2}", "changes the range of a channel"),
                ("", "friction = {0, 1} } vary { mass = {1, 2}", "vary: already declared at")):
            self.write("x.lua", scene.replace("SURFACE", surface) + f"vary {{ {vary} }}\n")
            for command in ("check", "run"):
                flags = ["--no-controller", "--ticks", "1"] if command == "run" else []
                status, _, err = self.run_program(SMARTSURF, command, "x.lua", *flags)
                self.assertEqual((status, err.count("\n")), (2, 1), f"{vary}: {err}")
                self.assertIn(message, err)
        self.write("x.lua", scene.replace("SURFACE", ""))
        for vary, message in (("friction", "--vary friction: must be NAME=LOW:HIGH[:MODE]"),
                              ("friction=1:2:3", "x.lua: --vary friction=1:2:3: must be VALUE or LOW:HIGH"),
                              ("friction=2:1", "x.lua: --vary friction=2:1: low = 2 is above high = 1"),
                              ("friction=nan", "nan: must be a finite number"),
                              ("masss=1", "x.lua: --vary masss=1: no nuisance or parameter 'masss' (did you mean 'mass'?)")):
            status, _, err = self.run_program(SMARTSURF, "run", "x.lua", "--no-controller", "--ticks", "1", "--vary", vary)
            self.assertEqual((status, err.count("\n")), (2, 1), err)
            self.assertIn(message, err)

    def test_every_task_takes_the_distribution_of_the_plan(self):
        words = [word for text in plan.load()["vary"]["common"] for word in ("--vary", text)]
        self.assertGreaterEqual(len(words), 10)
        for task in plan.load()["tasks"]:
            status, _, err = self.run_program(SMARTSURF, "check", str(ROOT / f"scripts/tasks/{task}.lua"), *words)
            self.assertEqual((status, err), (0, ""), task)

    def test_a_sweep_draws_success_over_a_nuisance(self):
        experiment = self.write("draws.lua", DRAWS.replace("VARY", "on_finish(function() metric('success', random_stream('won') < 0.5 and 1 or 0) end)"))
        status, out, err = self.run_program(str(ROOT / "scripts/sweep"), experiment, "--until", "0.1", "--seeds", "1-4", "--vary",
                                            "friction=0.5,1:factor", "--vary", "mass=1:3", "--smartsurf", SMARTSURF, "-o", "swept")
        self.assertEqual(status, 0, err)
        lines = (self.folder / "swept/results.csv").read_text().splitlines()
        self.assertEqual(len(lines), 9)
        self.assertTrue(lines[0].startswith("vary.friction,vary.mass,seed,"), lines[0])
        self.assertTrue({"varied.friction", "varied.mass"} < set(lines[0].split(",")), lines[0])
        self.assertIn("0.5:factor,1:3,1,", lines[1])
        self.assertIn("</svg>", (self.folder / "swept/rates.svg").read_text())
        status, _, err = self.run_program(str(ROOT / "scripts/sweep"), experiment, "--vary", "friction=", "--smartsurf", SMARTSURF)
        self.assertEqual((status, err), (2, "sweep: --vary friction=: must be NAME=V,V,…[:MODE] or NAME=LOW:HIGH[:MODE]\n"))


if __name__ == "__main__":
    unittest.main()
