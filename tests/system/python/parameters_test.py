"""Domain randomisation: a parameter that is set gives the world of a script that declares the value, to the bit."""
import itertools
import pickle
import subprocess
import sys
import unittest

try:
    import gymnasium  # noqa: F401
    import numpy as np
    import smartsurf
    from gymnasium.vector import AutoresetMode
except ImportError as error:
    print(f"skipped: {error}; scripts/setup --python installs it where a package index can be reached")
    sys.exit(77)
from experiments import ACTUATORS, ExperimentTest

# What the scene below declares, by the names of the parameters.
DECLARED = {
    "world.gravity": [0, 0, -9.81], "surface.friction": 0.5, "surface.rolling_friction": 0.01, "surface.restitution": 0.2,
    "object.box.mass": 2, "object.box.friction": 0.6, "object.box.rolling_friction": 0.02, "object.box.restitution": 0.3,
    "object.box.centre_of_mass": [0, 0, 0], "object.box.position": [3.5, 3.5, 1.2], "object.box.orientation": [0, 0, 0, 1],
    "object.box.velocity": [0, 0, 0], "object.box.angular_velocity": [0, 0, 0],
    "actuator.max_speed": 8, "actuator.max_acceleration": 200, "actuator.latency": 0,
    "sensor.proximity.noise": 0, "sensor.proximity.latency": 0, "sensor.proximity.drift": 0, "sensor.proximity.dropout": 0,
    "sensor.proximity.dead": 0, "faults.sensor.quantize": 0,
    "faults.actuator.stuck": 0, "faults.actuator.dead": 0, "faults.actuator.weak": 0, "faults.actuator.weak_gain": 0.5,
    "faults.actuator.latency": 0}


def lua(value):
    return "{" + ", ".join(map(lua, value)) + "}" if np.ndim(value) else repr(float(value))


def scene(changes=(), faults_of_cells=False):
    v = {name: lua(value) for name, value in {**DECLARED, **dict(changes)}.items()}
    for name in ("actuator.latency", "sensor.proximity.latency", "faults.actuator.latency"):
        v[name] = str(int(float(v[name])))
    return f"""
world {{ gravity = {v['world.gravity']} }}
material {{ name = 'top', friction = {v['surface.friction']}, rolling_friction = {v['surface.rolling_friction']},
            restitution = {v['surface.restitution']} }}
material {{ name = 'shared', rolling_friction = 0.02, restitution = 0.3 }}
material {{ name = 'boxes', rolling_friction = {v['object.box.rolling_friction']},
            restitution = {v['object.box.restitution']} }}
surface {{ rows = 8, columns = 8, material = 'top', border = {{ height = 5 }},
  actuator = pin {{ range = {{0, 3}}, max_speed = {v['actuator.max_speed']}, latency = {v['actuator.latency']},
                    max_acceleration = {v['actuator.max_acceleration']} }},
  sensors = {{ proximity {{ range = 6, noise = {v['sensor.proximity.noise']}, latency = {v['sensor.proximity.latency']},
                            drift = {v['sensor.proximity.drift']}, dropout = {v['sensor.proximity.dropout']},
                            dead = {v['sensor.proximity.dead']} }}, pressure {{}} }} }}
faults {{ actuator = {{ stuck = {v['faults.actuator.stuck']}, dead = {v['faults.actuator.dead']},
                        latency = {v['faults.actuator.latency']},
                        weak = {{ fraction = {v['faults.actuator.weak']}, gain = {v['faults.actuator.weak_gain']} }} }},
          sensor = {{ quantize = {v['faults.sensor.quantize']} }}
          {", map = 'cells.csv'" if faults_of_cells else ""} }}
box {{ size = {{2, 1.6, 1.2}}, label = 'box', material = '{"boxes" if changes else "shared"}', mass = {v['object.box.mass']},
       friction = {v['object.box.friction']}, com = {v['object.box.centre_of_mass']},
       position = {v['object.box.position']}, orientation = {v['object.box.orientation']},
       velocity = {v['object.box.velocity']}, angular_velocity = {v['object.box.angular_velocity']} }}
sphere {{ radius = 0.8, position = {{1.5, 5.5, 1.2}}, material = 'shared' }}
sphere {{ radius = 0.7, position = {{5.2, 1.7, 1.2}}, material = 'shared' }}
local spawned
every(0.2, function() if not spawned then spawned = sphere {{ radius = 0.5, position = {{random(2, 5), 5, 7}}, material = 'shared' }} end end)
episode {{ seconds = 30 }}
"""


CHANGES = [
    {"object.box.mass": 3.7}, {"object.box.friction": 0.05}, {"object.box.rolling_friction": 0.4},
    {"object.box.restitution": 0.9}, {"object.box.centre_of_mass": [0.3, -0.2, 0.1]},
    {"object.box.position": [3.1, 3.9, 2], "object.box.orientation": [0.5, -0.5, 0.5, 0.5]},
    {"object.box.velocity": [1, 2, -1], "object.box.angular_velocity": [2, -3, 1]},
    {"world.gravity": [0.5, -0.3, -5]}, {"surface.friction": 0.02, "surface.restitution": 0.7},
    {"surface.rolling_friction": 0.3}, {"actuator.max_speed": 2.5}, {"actuator.max_acceleration": 30, "actuator.latency": 2},
    {"sensor.proximity.noise": 0.2, "sensor.proximity.latency": 3}, {"sensor.proximity.drift": 0.5, "sensor.proximity.dropout": 0.1},
    {"sensor.proximity.dead": 0.2, "faults.sensor.quantize": 0.25},
    {"faults.actuator.stuck": 0.2, "faults.actuator.dead": 0.3, "faults.actuator.weak": 0.5, "faults.actuator.weak_gain": 0.3},
    {"faults.actuator.latency": 2}]
EVERYTHING = {name: value for change in CHANGES for name, value in change.items()}


def command(tick, seed, shape):
    return np.random.default_rng((seed, tick // 4)).uniform(-1, 4, shape).astype(np.float32)


class Randomised(smartsurf.Task):
    scene = scene()
    parameters = {"surface.friction": 0.4}
    randomise = {"object.box.mass": (1, 2), "object.box.friction": (0.1, 0.2)}


class Parameters(ExperimentTest):
    def assert_equal_worlds(self, envs, world, other, ticks, seed):
        """other: a Simulation."""
        for tick in range(ticks):
            commands = np.broadcast_to(command(tick, seed, envs.single_action_space.shape), envs.action_space.shape)
            observations, _, _, _, _ = envs.step(np.ascontiguousarray(commands))
            other.step({"height": commands[0, 0]})
            self.assertEqual(envs.state_hash(world), other.state_hash, f"tick {tick}")
            self.assertEqual(observations[world].tobytes(), other._observation.tobytes(), f"tick {tick}")

    def test_worlds_with_other_objects_have_no_common_array(self):
        path = self.script("surface { rows = 6, columns = 6, actuator = pin {} }\n"
                           "for i = 1, option('count', 1) do sphere { radius = 0.5, position = {i, 2, 4}, label = 'ball' } end")
        envs = smartsurf.VectorEnv(path, 2, set=[{"count": 1}, {"count": 3}])
        with self.assertRaisesRegex(ValueError, "object.ball.mass has 3 numbers in world 1 and 1 in world 0"):
            envs.get_parameter("object.ball.mass")

    def test_a_world_with_a_value_equals_a_script_that_declares_it(self):
        base = self.script(scene())
        changes = [{}, *CHANGES, EVERYTHING]
        envs = smartsurf.VectorEnv(base, len(changes), 2)
        for name in DECLARED:  # all at once, each world its own value or that of the script
            before = envs.get_parameter(name)
            np.testing.assert_array_equal(before, np.broadcast_to(np.reshape(DECLARED[name], before.shape[1:]), before.shape), name)
        for name in EVERYTHING:
            worlds = [i for i, change in enumerate(changes) if name in change]
            values = [changes[i][name] for i in worlds]
            shape = envs.get_parameter(name).shape[1:]
            envs.set_parameter(name, np.reshape(values, (len(worlds), *shape)), worlds)
            got = envs.get_parameter(name)
            np.testing.assert_array_equal(got[worlds], np.reshape(values, (len(worlds), *shape)), name)
        hashes = set()
        for seed in (1, 9):
            envs.reset(seed=[seed] * len(changes))
            before = [envs.save(i) for i in range(len(changes))]
            for world, change in enumerate(changes):
                with self.subTest(seed=seed, change=change):
                    path = self.script(scene(change.items()), f"changed{world}.lua")
                    loaded = smartsurf.Simulation(path, seed=seed)
                    for i, state in enumerate(before):
                        envs.restore(i, state)
                    self.assert_equal_worlds(envs, world, loaded, 45, seed)
                    key = (seed, loaded.state_hash, hash(loaded._observation.tobytes()))
                    rolls = any("rolling" in name for name in change)  # matters to what rolls: below
                    self.assertTrue(key not in hashes or rolls)
                    hashes.add(key)
                    # Saved in the middle of the episode, restored in a world with other values.
                    state = envs.save(world)
                    self.assert_equal_worlds(envs, world, loaded, 10, seed)
                    one = smartsurf.Simulation(base, seed=77)
                    one.restore(state)
                    for tick in range(10):
                        one.step({"height": command(tick, seed, (8, 8))})
                    self.assertEqual(one.state_hash, loaded.state_hash)
                    one.reset(seed)  # its own values again
                    self.assertEqual(one.state_hash, smartsurf.Simulation(base, seed=seed).state_hash)

    def test_yaw_keeps_roll_and_pitch(self):
        tilts = {"rod": "pitch = math.pi / 2, yaw = 0.7", "rad": "roll = math.pi / 2", "any": "roll = 1, pitch = 2, yaw = 3"}
        source = "surface { rows = 8, columns = 8, actuator = pin {} }\n" + "\n".join(
            f"cylinder {{ radius = 0.4, height = 2, position = {{{2 + i}, 3, 3}}, orientation = {{ {tilt} }}, label = '{label}' }}"
            for i, (label, tilt) in enumerate(tilts.items()))
        def turned(changes=(), resets=1):
            s = smartsurf.Simulation("rods.lua", source=source)
            for k in range(resets):
                for i, label in enumerate(changes):
                    s.set_parameter(f"object.{label}.yaw", changes[label] + resets - 1 - k)
                s.reset(1)
            return s
        plain = turned()
        read = {label: plain.get_parameter(f"object.{label}.yaw") for label in tilts}
        self.assertEqual(turned(read).state_hash, plain.state_hash)
        self.assertAlmostEqual(float(read["rod"]), 0.7)
        once, later = (turned({label: yaw + 0.4 for label, yaw in read.items()}, resets) for resets in (1, 4))
        self.assertEqual(once.state_hash, later.state_hash)  # no trace of the values before
        x, y, z, w = plain.objects["orientation"].T
        c, s = np.cos(0.2), np.sin(0.2)
        np.testing.assert_allclose(once.objects["orientation"].T, (c * x - s * y, c * y + s * x, c * z + s * w, c * w - s * z), atol=1e-6)

    def test_rolling_friction(self):
        text = ("material {{ name = 'ball', rolling_friction = {} }} material {{ name = 'top', rolling_friction = {} }}\n"
                "surface {{ rows = 4, columns = 20, actuator = pin {{}}, material = 'top' }}\n"
                "sphere {{ radius = 1, position = {{2, 1.5, 1}}, velocity = {{3, 0, 0}}, material = 'ball' }}")
        plain = smartsurf.Simulation(self.script(text.format(0.01, 0.01)))
        hashes = set()
        for name, values in (("object.#0.rolling_friction", (0.3, 0.01)), ("surface.rolling_friction", (0.01, 0.2))):
            one, loaded = pickle.loads(pickle.dumps(plain)), smartsurf.Simulation(self.script(text.format(*values), "b.lua"), 1)
            one.set_parameter(name, max(values))
            one.reset(1)
            for _ in range(60):
                one.step(), loaded.step()
            self.assertEqual(one.state_hash, loaded.state_hash)
            hashes.add(one.state_hash)
        for _ in range(60):
            plain.step()
        self.assertEqual(len({plain.state_hash, *hashes}), 3)

    def test_every_parameter_of_every_actuator(self):
        compared = 0
        for model, text in ACTUATORS.items():
            script = ("surface {{ rows = 6, columns = 6, border = {{ height = 4 }}, actuator = {} }}\n"
                      "box {{ size = {{2, 1.5, 0.8}}, position = {{2.5, 2.5, 3}}, pole = 1, mass = 1 }}\n"
                      "sphere {{ radius = 0.6, position = {{4, 4, 4}} }}")
            simulation = smartsurf.Simulation(self.script(script.format(text)))
            for name in simulation.parameters:
                if not name.startswith("actuator."):
                    continue
                field, value = name.removeprefix("actuator."), simulation.get_parameter(name)
                if value.ndim or np.isnan(value):
                    continue
                value = float(value) + 1 if field == "latency" else float(value) * 0.75
                try:
                    simulation.set_parameter(name, value)
                except smartsurf.Error as error:
                    self.assertRegex(str(error), "must be|changes the range of a channel")
                    continue
                number = str(int(value)) if field == "latency" else repr(value)
                group, dot, inner = field.partition(".")
                inside = f"{group} = {{ {inner} = {number} }}" if dot else f"{field} = {number}"
                body = text[text.index("{") + 1:text.rindex("}")].strip()
                kept = [part for part in split(body) if part.split("=")[0].strip() != group]
                changed = f"{model} {{ {', '.join([*kept, inside])} }}"
                with self.subTest(model=model, parameter=field):
                    simulation.reset(5)
                    loaded = smartsurf.Simulation(self.script(script.format(changed), "loaded.lua"), seed=5)
                    for tick in range(20):
                        for one in (simulation, loaded):
                            one.step({c.name: np.full((6, 6), c.minimum + (c.maximum - c.minimum) * (0.5 + 0.5 * np.sin(tick)))
                                      for c in one.actuator_channels})
                        self.assertEqual(simulation.state_hash, loaded.state_hash)
                    compared += 1
                simulation = smartsurf.Simulation(self.script(script.format(text)))
        self.assertGreater(compared, 20)

    def test_faults_of_cells_equal_those_of_a_table(self):
        base = self.script(scene())
        random = np.random.default_rng(4)
        cells = {name: np.full((8, 8), np.nan) for name in ("height.stuck", "height.weak", "height.late", "proximity.offset",
                                                           "proximity.gain")}
        flags = {name: np.zeros((8, 8)) for name in ("height.dead", "proximity.dead", "pressure.stuck_high")}
        rows, table = random.permutation(64), ["row,column,channel,fault,value"]
        for cell, (name, value) in zip(rows, itertools.cycle(
                (*((name, v) for name, v in zip(cells, (2.5, 0.4, 3, 0.7, 1.2))), *((name, None) for name in flags)))):
            row, column = divmod(int(cell), 8)
            (flags if value is None else cells)[name][row, column] = 1 if value is None else value
            channel, fault = name.split(".")
            table.append(f"{row},{column},{channel},{fault},{'' if value is None else value}")
        self.script("\n".join(table) + "\n", "cells.csv")
        loaded = smartsurf.Simulation(self.script(scene(faults_of_cells=True), "table.lua"), seed=2)
        envs = smartsurf.VectorEnv(base, 3, 1)
        for name, values in {**cells, **flags}.items():
            envs.set_parameter(f"faults.{name}", values, worlds=[1])
            np.testing.assert_array_equal(envs.get_parameter(f"faults.{name}")[1], values)
        envs.reset(seed=[2, 2, 2])
        self.assert_equal_worlds(envs, 1, loaded, 40, 2)
        self.assertNotEqual(envs.state_hash(0), envs.state_hash(1))
        self.assertEqual(envs.state_hash(0), envs.state_hash(2))

    def test_ranges_are_drawn_from_the_seed_and_equal_values_that_are_set(self):
        path = self.script(scene())
        ranges = {"object.box.mass": (1, 4), "object.box.position": ((2, 2, 4), (5, 5, 4)), "surface.friction": (0.1, 0.9),
                  "actuator.latency": (0, 3), "faults.actuator.dead": (0, 0.3)}
        envs = smartsurf.VectorEnv(path, 40, 2)
        envs.randomise(ranges)
        envs.reset(seed=1)
        drawn = {name: envs.get_parameter(name) for name in ranges}
        for name, (low, high) in ranges.items():
            self.assertTrue((drawn[name] >= low).all() and (drawn[name] <= high).all(), name)
        self.assertEqual(set(drawn["actuator.latency"]), {0, 1, 2, 3})
        columns = np.column_stack([values.reshape(40, -1)[:, :2] for values in drawn.values()])
        correlation = np.corrcoef(columns, rowvar=False)
        self.assertLess(np.abs(correlation - np.eye(len(correlation))).max(), 0.55)
        # A world depends on its seed alone, and equals one in which the values are set.
        other = smartsurf.VectorEnv(path, 3, 1)
        other.randomise(ranges)
        other.reset(seed=[7, 40, 7])
        fixed = smartsurf.Simulation(path)
        for name in ranges:
            fixed.set_parameter(name, drawn[name][39])
        fixed.reset(40)
        self.assertEqual(other.state_hash(0), envs.state_hash(6))
        self.assert_equal_worlds(other, 1, fixed, 20, 3)
        # A curriculum is a call; None ends it.
        envs.randomise({"object.box.mass": (10, 11)}, worlds=np.arange(40) < 20)
        envs.reset(seed=1)
        mass = envs.get_parameter("object.box.mass")
        self.assertTrue((mass[:20] >= 10).all() and (mass[20:] <= 4).all())
        np.testing.assert_array_equal(mass[20:], drawn["object.box.mass"][20:])
        envs.randomise({name: None for name in ranges})
        envs.reset(seed=1)
        plain = smartsurf.VectorEnv(path, 40, 1)
        plain.reset(seed=1)
        self.assertEqual([envs.state_hash(i) for i in range(40)], [plain.state_hash(i) for i in range(40)])

    def test_threads_and_autoreset_do_not_change_randomised_worlds(self):
        path = self.script(scene().replace("seconds = 30", "seconds = 0.2"))
        for mode in AutoresetMode:
            traces = []
            for threads in (1, 4):
                envs = smartsurf.VectorEnv(path, 6, threads, autoreset_mode=mode)
                envs.randomise({"object.box.mass": (1, 4), "sensor.proximity.noise": (0, 0.3)})
                trace = [envs.reset(seed=3)[0].tobytes()]
                for tick in range(40):
                    observations, _, terminated, truncated, infos = envs.step(command(tick, 1, envs.action_space.shape))
                    trace.append((observations.tobytes(), infos["seed"].tolist()))
                    if mode == AutoresetMode.DISABLED and (terminated | truncated).any():
                        envs.reset(options={"reset_mask": terminated | truncated}, seed=[tick] * 6)
                traces.append(trace)
            self.assertEqual(*traces)

    def test_nuisances_of_a_batch_are_those_of_its_worlds_and_of_each_seed(self):
        path = self.script("vary { mass = {0.5, 2, 'factor'} }\n" + scene())
        nuisances = {"vary.friction": (0.5, 1.5, "factor"), "vary.latency": (0, 3)}
        batches = [smartsurf.VectorEnv(path, 6, threads, set=nuisances) for threads in (1, 4)]
        drawn = {}
        for seed in (3, 100):
            infos = [envs.reset(seed=seed)[1] for envs in batches]
            for name in ("varied.friction", "varied.latency", "varied.mass"):
                np.testing.assert_array_equal(infos[0][name], infos[1][name])
                drawn.setdefault(name, []).extend(infos[0][name])
            traces = [[envs.step(command(tick, 1, envs.action_space.shape))[0].tobytes() for tick in range(20)] for envs in batches]
            self.assertEqual(*traces)
            one = smartsurf.Env(path, set=nuisances)
            for k in (0, 5):
                _, info = one.reset(seed=seed + k)
                self.assertEqual([info[name] for name in drawn], [infos[0][name][k] for name in drawn])
                for tick in range(20):
                    one.step(command(tick, 1, batches[0].action_space.shape)[k])
                self.assertEqual(one.simulation.state_hash, batches[0].state_hash(k))
                self.assertAlmostEqual(one.simulation.get_parameter("object.box.mass"), 2 * info["varied.mass"])
                self.assertAlmostEqual(one.simulation.get_parameter("object.box.friction"), 0.6 * info["varied.friction"])
        self.assertEqual(len(set(drawn["varied.mass"])), 12)
        # A state belongs to its seed's draws.
        state = batches[0].save(2)
        batches[0].step(command(0, 1, batches[0].action_space.shape))
        expected = batches[0].state_hash(2)
        one.reset(seed=1)
        one.simulation.restore(state)
        self.assertEqual(one.simulation.info["varied.mass"], drawn["varied.mass"][8])
        one.step(command(0, 1, batches[0].action_space.shape)[2])
        self.assertEqual(one.simulation.state_hash, expected)
        # What is set is what a factor changes.
        one.simulation.set_parameter("object.box.mass", 3)
        _, info = one.reset(seed=9)
        self.assertAlmostEqual(one.simulation.get_parameter("object.box.mass"), 3 * info["varied.mass"])
        with self.assertRaisesRegex(smartsurf.Error, "--vary frction=0:1: no nuisance"):
            smartsurf.Env(path, set={"vary.frction": (0, 1)})

    def test_values_that_are_drawn_are_those_of_the_running_episodes(self):
        for text in (scene(), "vary { friction = {0.5, 1.5, 'factor'} }\n" + scene()):
            envs = smartsurf.VectorEnv(self.script(text), 3, 1)
            envs.set_parameter("object.box.mass", 9)
            envs.randomise({"object.*.mass": (1, 4), "object.box.restitution": (0, 0.9)})
            envs.reset(seed=1)
            mass, friction = envs.get_parameter("object.box.mass"), envs.get_parameter("surface.friction")
            self.assertTrue((mass < 4).all() and len(set(mass)) == 3)
            self.assertEqual(len(set(envs.get_parameter("object.box.restitution"))), 3)
            envs.set_parameter("object.box.velocity", (1, 2, 3))  # pending
            np.testing.assert_array_equal(envs.get_parameter("object.box.velocity"), [[1, 2, 3]] * 3)
            np.testing.assert_array_equal(envs.get_parameter("object.box.mass"), mass)
            np.testing.assert_array_equal(envs.get_parameter("surface.friction"), friction)
            self.assertEqual(len(set(friction)), 3 if "vary" in text else 1)

    def test_options_that_differ_between_worlds(self):
        path = self.script("local radius = option('radius', 1) local count = option('count', 1)\n"
                           "surface { rows = 6, columns = 6, actuator = pin {} }\n"
                           "for i = 1, count do sphere { radius = radius, position = {3, 3, 3 * i} } end")
        values = [{"radius": 0.5}, {"radius": 0.9, "count": 2}, {}]
        envs = smartsurf.VectorEnv(path, 3, 1, set=values)
        envs.reset(seed=1)
        for i, options in enumerate(values):
            one = smartsurf.Simulation(path, seed=1 + i, set=options)
            self.assertEqual(one.state_hash, envs.state_hash(i))
            self.assertEqual(one.options, envs.options[i])
        self.assertEqual(envs.objects["position"].shape, (3, 1, 3))
        drawn = smartsurf.VectorEnv(path, 30, 1, set={"radius": (0.3, 0.9), "count": (1, 3)})
        again = smartsurf.VectorEnv(path, 40, 1, set={"radius": (0.3, 0.9), "count": (1, 3)}, seed=99)
        self.assertEqual(drawn.options, again.options[:30])
        radii = [float(options["radius"]) for options in drawn.options]
        self.assertTrue(0.3 <= min(radii) < 0.45 and 0.75 < max(radii) <= 0.9)
        self.assertEqual({options["count"] for options in drawn.options}, {"1", "2", "3"})
        for wrong, message in (([{}], "one per world, 3"), ({"radius": (2, 1)}, "a range must be"), ("x", "must be a dict")):
            with self.assertRaisesRegex(ValueError, message):
                smartsurf.VectorEnv(path, 3, set=wrong)

    def test_a_range_of_a_float_option_is_drawn_as_floats(self):
        path = self.script("surface { rows = 4, columns = 4, actuator = pin {} }\n"
                           "option('mass', 1.0) option('size', 1.0, 'in u', {0.5, 3}) option('count', 1) option('stop', 'no')")
        envs = smartsurf.VectorEnv(path, 60, threads=2, set={"mass": (0, 2), "size": (1, 2), "count": (0, 2)})
        drawn = {name: [options[name] for options in envs.options] for name in ("mass", "size", "count")}
        self.assertEqual(set(drawn["count"]), {"0", "1", "2"})
        for name, low, high in (("mass", 0, 2), ("size", 1, 2)):
            values = np.array(drawn[name], float)
            self.assertEqual(len(set(values)), 60, name)
            self.assertTrue((values >= low).all() and (values < high).all() and abs(values.mean() - (low + high) / 2) < 0.2, name)
        with self.assertRaisesRegex(ValueError, "no option 'weight'"):
            smartsurf.VectorEnv(path, 2, set={"weight": (0, 2)})

    def test_teleport_and_push_equal_those_of_the_script(self):
        base = self.script(scene())
        script = self.script(scene() + """
on_tick(function(t, tick)
  if tick == 5 then object(0):teleport { position = {2.5, 3.5, 4}, velocity = {1, 0, 0} }
                    object(0):teleport { orientation = {0.1, 0, 0, 0.9} }
                    object(1):teleport { angular_velocity = {3, 1, 0} } end
  if tick >= 12 and tick < 20 then object(2):push { force = {3, -2, 8}, seconds = 1 / 60 } end
end)""", "moved.lua")
        envs = smartsurf.VectorEnv(base, 3, 2)
        envs.reset(seed=[4] * 3)
        moved = smartsurf.Simulation(script, seed=4)
        for tick in range(40):
            if tick == 5:
                envs.teleport("box", position=(2.5, 3.5, 4), velocity=(1, 0, 0), worlds=[2])
                envs.teleport(0, orientation=[[0.1, 0, 0, 0.9]], worlds=np.array([False, False, True]))
                envs.teleport([1], angular_velocity=[(3, 1, 0)], worlds=2)
                np.testing.assert_allclose(envs.objects["position"][2, 0], (2.5, 3.5, 4))
            if tick == 12:
                envs.push(2, force=(3, -2, 8), worlds=[2])
                state = envs.save(2)  # has the force
                envs.step(command(12, 4, envs.action_space.shape))
                envs.restore(2, state)
                envs.restore(0, state)
                envs.push(worlds=0)
            if tick == 20:
                envs.push(2, worlds=[2])
            commands = np.tile(command(tick, 4, (1, 8, 8)), (3, 1, 1, 1))
            envs.step(commands)
            moved.step({"height": commands[2, 0]})
            self.assertEqual(envs.state_hash(2), moved.state_hash, f"tick {tick}")
        self.assertEqual(len({envs.state_hash(i) for i in range(3)}), 3)

    def test_force_and_torque_accelerate_as_newton_says(self):
        path = self.script("world { gravity = 0 }\nsurface { rows = 4, columns = 4, actuator = pin {} }\n"
                           "sphere { radius = 0.5, position = {0, 0, 20}, mass = 2 }\n"
                           "box { size = {1, 2, 3}, position = {0, 0, 40}, mass = 3 }")
        for engine in ("native", "bullet"):
            s = smartsurf.Simulation(path, engine=engine)
            s.push(0, force=(4, 0, 2), torque=(0, 0, 0.5))
            s.push([1], torque=[(0, 0, 1.5)])
            for _ in range(30):
                s.step()
            seconds, inertia = 0.5, 3 / 12 * (1 + 4)
            np.testing.assert_allclose(s.objects["velocity"][0], np.array((4, 0, 2)) / 2 * seconds, rtol=1e-4, atol=1e-6)
            np.testing.assert_allclose(s.objects["angular_velocity"][0], (0, 0, 0.5 / (0.4 * 2 * 0.25) * seconds), rtol=1e-3)
            np.testing.assert_allclose(s.objects["angular_velocity"][1], (0, 0, 1.5 / inertia * seconds), rtol=1e-3, atol=1e-5)
            s.push()
            velocity = s.objects["velocity"].copy()
            s.step()
            np.testing.assert_array_equal(s.objects["velocity"], velocity)
            s.push(force=(1, 1, 1))
            s.reset(1)  # ends it
            s.step()
            np.testing.assert_array_equal(s.objects["velocity"], 0)

    def test_a_pickled_copy_continues_with_the_same_bits(self):
        path = self.script(scene().replace("seconds = 30", "seconds = 0.3"))
        for mode in AutoresetMode:
            envs = smartsurf.VectorEnv(path, 4, 2, autoreset_mode=mode)
            envs.set_parameter("object.box.mass", [1, 2, 3, 4])
            envs.randomise({"surface.friction": (0.1, 0.9)}, worlds=[1, 2])
            envs.reset(seed=6)
            for ticks in (3, None, 1):  # in the middle, at the end of an episode, after it
                ended = False
                for tick in range(ticks or 100):
                    _, _, terminated, truncated, _ = envs.step(command(tick, 2, envs.action_space.shape))
                    ended = (terminated | truncated).any()
                    if ticks is None and ended:
                        break
                self.assertTrue(ticks is not None or ended)
                copy = pickle.loads(pickle.dumps(envs))
                trace = [[one.step(command(tick, 3, envs.action_space.shape)) for tick in range(22)] for one in (envs, copy)]
                for a, b in zip(*trace):
                    for x, y in zip(a[:4], b[:4]):
                        np.testing.assert_array_equal(x, y)
                    np.testing.assert_array_equal(a[4]["seed"], b[4]["seed"])
                    self.assertEqual(a[4].keys(), b[4].keys())

    def test_a_pickled_copy_has_the_parameters_in_the_order_of_each_world(self):
        mass = "object.box.mass"
        envs = Randomised().make_vec(2, threads=1)
        envs.randomise({mass: None})
        envs.randomise({"object.box.friction": None}, worlds=[1])
        envs.set_parameter(mass, 7)
        plain = smartsurf.VectorEnv(self.script(scene()), 2, 1)
        plain.set_parameter(mass, 7, worlds=[0])
        plain.set_parameter("object.*.mass", 6, worlds=[0])
        plain.set_parameter("object.*.mass", 5, worlds=[1])
        plain.set_parameter(mass, 8, worlds=[1])
        ranges = smartsurf.VectorEnv(self.script(scene()), 2, 1)
        one = smartsurf.Simulation(self.script(scene()))
        for world in (0, 1):
            for name, limits in ((("object.*.mass", (1, 2)), (mass, (20, 30)), ("object.*.mass", (3, 4)))[world:]):
                ranges.randomise({name: limits}, worlds=[world])
                if world == 0:
                    one.randomise({name: limits})
        for env, expected in ((envs, [7, 7]), (plain, [6, 8]), (ranges, None)):
            copied = pickle.loads(pickle.dumps(pickle.loads(pickle.dumps(env))))
            for other in (env, copied):
                other.reset(seed=5)
                if expected:
                    self.assertEqual(other.get_parameter(mass).tolist(), expected)
            for name in env.parameters:
                if name.startswith(("object.box", "surface")):
                    np.testing.assert_array_equal(env.get_parameter(name), copied.get_parameter(name), name)
            self.assertEqual([env.state_hash(i) for i in range(2)], [copied.state_hash(i) for i in range(2)])
        copied = pickle.loads(pickle.dumps(one))
        one.reset(5), copied.reset(5)
        self.assertTrue(3 <= one.get_parameter(mass) < 4)
        self.assertEqual(one.get_parameter(mass), copied.get_parameter(mass))

    def test_refusals_are_one_line_and_change_nothing(self):
        path = self.script(scene())
        s, envs = smartsurf.Simulation(path), smartsurf.VectorEnv(path, 3, 1)
        for name, value, message in (
                ("object.ball.mass", 1, "no 'ball'"), ("object.#7.mass", 1, "no object #7; the script declares 3"),
                ("object.box.mas", 1, "no 'mas' .did you mean 'mass'"), ("object.box.mass", -1, "mass = -1: must be in"),
                ("object.box.mass", np.nan, "must be finite"), ("object.box.mass", [1, 2], "must be a number or an array"),
                ("surface.restitution", 2, "restitution = 2: must be in"), ("sensor.pressure.nois", 1, "did you mean 'noise'"),
                ("sensor.sonar.noise", 1, "no 'sonar'"), ("actuator.range", (0, 2), "changes the range of a channel"),
                ("sensor.proximity.range", 3, "changes the range of a channel"), ("actuator.top", 0.5, "no 'top'"),
                ("faults.height.stuck", 9, r"of cell \(0, 0\)"), ("faults.height.broken", 1, "no 'broken'"),
                ("faults.height.dead", 0.3, r"faults.height.dead = 0.3 of cell .0, 0.: must be 0 or 1; faults.actuator.dead is a fraction"),
                ("faults.proximity.stuck_low", 2, "must be 0 or 1; faults.sensor.stuck_low is a fraction"),
                ("faults.height.late", 1.5, r"of cell .0, 0.: value of 'late' = 1.5: must be a whole number, 0 to 1000"),
                ("faults.actuator.dead", 1.5, "must be in"), ("actuator.latency", 0.5, "must be a whole number"),
                ("faults.actuator.latency", -1, "whole number, 0 to 1000"), ("gravity", 1, "no 'gravity'"),
                ("object.box.orientation", (0, 0, 0, 0), "orientation: must be a rotation")):
            for one in (s, envs):
                with self.subTest(name=name, value=value), self.assertRaisesRegex(ValueError, message) as raised:
                    one.set_parameter(name, value)
                self.assertNotIn("\n", str(raised.exception))
        for call, message in ((lambda: envs.randomise({"object.box.mass": 3}), r"must be \(low, high\) or None"),
                              (lambda: envs.randomise({"object.box.mass": (3, 2)}), "low must not be above high"),
                              (lambda: envs.randomise({"actuator.latency": (0, 1.5)}), "must be whole numbers"),
                              (lambda: envs.randomise({"faults.height.stuck": (0, 1)}), "a value for each cell"),
                              (lambda: envs.randomise({"object.box.mass": (-1, 2)}), "mass = -1"),
                              (lambda: envs.randomise("object.box.mass"), "must be a dict"),
                              (lambda: envs.set_parameter("object.box.mass", 1, worlds=[3]), "numbers of worlds, 0 to 2"),
                              (lambda: envs.teleport("cup", position=(0, 0, 0)), "no object is called 'cup'; labels: box"),
                              (lambda: envs.teleport(9, position=(0, 0, 0)), "must be 0 to 2"),
                              (lambda: envs.teleport(0, orientation=(0, 0, 0, 0)), "a quaternion x y z w that is not 0"),
                              (lambda: s.push(0, force=(0, np.inf, 0)), "force: must be finite")):
            with self.assertRaisesRegex(ValueError, message) as raised:
                call()
            self.assertNotIn("\n", str(raised.exception))
        # An error in one world leaves all as they were.
        masses = envs.get_parameter("object.box.mass").tolist()
        for call in (lambda: envs.set_parameter("object.box.mass", [5, 6, -1]),
                     lambda: envs.randomise({"object.box.mass": ([5, 6, -1], [7, 8, 9])})):
            with self.assertRaisesRegex(smartsurf.Error, "world 2: .*mass = -1"):
                call()
            envs.reset(seed=1)
            self.assertEqual(envs.get_parameter("object.box.mass").tolist(), masses)
        # Each range by itself is valid; both are not, whatever the seed draws, until one is smaller.
        for one in (s, envs):
            one.randomise({"faults.actuator.dead": (0, 0.6), "faults.actuator.stuck": (0, 0.6)})
            with self.assertRaisesRegex(smartsurf.Error, "stuck, dead and weak add up to 1.2 of the cells"):
                one.reset(seed=1)
            one.randomise({"faults.actuator.stuck": (0, 0.7), "faults.actuator.dead": (0, 0.3)})
            one.reset(seed=1)
            one.randomise({"faults.actuator.stuck": None, "faults.actuator.dead": None})
        s.reset(1)
        self.assertEqual(s.state_hash, smartsurf.Simulation(path, seed=1).state_hash)

    def test_a_reset_of_a_randomised_world_does_not_load_the_script_again(self):
        path = self.script("""
print('loaded')
surface { rows = 8, columns = 8, actuator = pin { range = {0, 4} }, sensors = { proximity { range = 6 } }, border = { height = 6 } }
local ball = sphere { radius = 0.8, position = {3, 3, 5}, label = 'ball' }
on_reset(function() object(ball):teleport { position = {random(2, 5), random(2, 5), 5} } end)""")
        code = f"""
import smartsurf
envs = smartsurf.VectorEnv({str(path)!r}, 4, 1)
envs.randomise({{"object.ball.mass": (1, 3), "object.ball.friction": (0.1, 0.9), "surface.friction": (0.1, 0.9),
                "actuator.max_speed": (5, 20), "faults.actuator.dead": (0, 0.1)}})
for seed in range(5):
    envs.reset(seed=seed)
"""
        out = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True).stdout
        self.assertEqual(out.split(), ["loaded"] * 4)


def split(text):
    """At the commas outside of braces."""
    parts, depth = [""], 0
    for character in text:
        depth += (character == "{") - (character == "}")
        if character == "," and depth == 0:
            parts.append("")
        else:
            parts[-1] += character
    return [part.strip() for part in parts if part.strip()]


if __name__ == "__main__":
    unittest.main()
