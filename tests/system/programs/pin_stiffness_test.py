#!/usr/bin/env python3
"""Plates on pins of finite stiffness against independent springs at the corners of what they cover: the loads of a
complementarity problem that least squares without negative loads solves, and the swing of a mass on a spring."""
import math
import random
import re

import numpy
from scipy.optimize import nnls

from programs import *

DRAWS = int(os.environ.get("STIFFNESS_DRAWS", "3"))
STACKS = int(os.environ.get("STIFFNESS_STACKS", "40"))
G = 9.81
RATES = (60, 120, 240, 960)


class PinStiffness(ProgramTest):
    def setUp(self):
        super().setUp()
        self.random = random.Random(self._testMethodName)

    def run_scene(self, scene, seconds, *words):
        path = self.write("scene.lua", scene)
        status, out, err = self.run_program(SMARTSURF, "run", path, "--no-controller", "--headless", "--until", str(seconds), *words)
        self.assertEqual(status, 0, err)
        return out

    def bed(self):
        """A plate over pins of random heights: what the scene needs, and what each pin must bear."""
        u = self.random.uniform
        size = numpy.array([u(2.5, 6.5), u(2.5, 6.5)]).round(3)
        at = numpy.array([u(4.8, 6.2), u(4.8, 6.2)]).round(3)
        mass, uneven = round(10 ** u(-0.5, 2.5), 3), 10 ** u(-4, -2.5)
        rider = round(mass * u(0.2, 2), 3)  # a box beside the plate's middle
        pins = size.prod()
        sink = 10 ** u(-3.3, -2) + uneven  # of the plate, u
        stiffness = float(f"{(mass + rider) * G / pins / sink:.4g}")
        offset = (size * numpy.array([u(-0.15, 0.15), u(-0.15, 0.15)])).round(3)
        heights = numpy.array([[round(1 + u(-uneven, uneven), 6) for _ in range(12)] for _ in range(12)])
        return {"size": size, "at": at, "mass": mass, "rider": rider, "stiffness": stiffness, "offset": offset, "heights": heights, "sink": sink}

    def loads(self, b):
        """By row and column, from the north: least squares of the loads' distances from those of springs held at the pins' heights."""
        places, shares, tops, cells = [], [], [], []
        for row in range(12):
            for column in range(12):
                low, high = [], []
                for middle, centre, size in zip((column, 11 - row), b["at"], b["size"]):
                    low.append(max(middle - 0.4, centre - size / 2))
                    high.append(min(middle + 0.4, centre + size / 2))
                area = max(0, high[0] - low[0]) * max(0, high[1] - low[1])
                for x in (low[0], high[0]):
                    for y in (low[1], high[1]):
                        places.append([1, x, y])
                        shares.append(area / 0.64 / 4)
                        tops.append(b["heights"][row][column])
                        cells.append(12 * row + column)
        places, stiffness = numpy.array(places), b["stiffness"] * numpy.array(shares)
        under = stiffness > 0
        places, tops, root = places[under], numpy.array(tops)[under] - 1, numpy.sqrt(stiffness[under])
        # N = k·(h − z): min Σ (N/√k − √k·h)² with Σ N·(1, x, y) given, N ≥ 0. Unknown: N/√k.
        weight = (b["mass"] + b["rider"]) * G
        given = weight * numpy.array([1, *(b["at"] + b["offset"] * b["rider"] / (b["mass"] + b["rider"]))])
        hard = 1e5 / weight * root.max()
        scaled, _ = nnls(numpy.vstack([numpy.eye(len(root)), hard * places.T * root]), numpy.concatenate([root * tops, hard * given]), maxiter=10000)
        all_loads = numpy.zeros(144)
        numpy.add.at(all_loads, numpy.array(cells)[under], scaled * root)
        return all_loads.reshape(12, 12)

    def scene(self, b, rate, drop=0.0):
        rows = ", ".join("{" + ", ".join(map(str, row)) + "}" for row in b["heights"])
        x, y = b["at"]
        return f"""
world {{ dt = 1 / {rate}, control_period = 1 / {rate} }}
material {{ name = 'default', friction = 0.5, restitution = 0 }}
surface {{ rows = 12, columns = 12, sensors = {{ pressure {{ range = 1e9 }} }},
          actuator = pin {{ range = {{ 0, 2 }}, max_speed = 20, max_acceleration = 1000, stiffness = {b['stiffness']} }} }}
local heights = {{ {rows} }}
at(0, function()
  for row = 1, 12 do for column = 1, 12 do cells:target('height', row, column, heights[row][column]) end end
end)
local id
at(0.5, function()
  id = box {{ size = {{ {b['size'][0]}, {b['size'][1]}, 0.5 }}, mass = {b['mass']}, position = {{ {x}, {y}, {1.25 + drop} }} }}
  box {{ size = {{ 1, 1, 0.5 }}, mass = {b['rider']}, position = {{ {x + b['offset'][0]}, {y + b['offset'][1]}, {1.75 + drop} }} }}
end)
on_finish(function()
  for row = 1, 12 do for column = 1, 12 do print(string.format('%.9g', cells:truth('pressure', row, column))) end end
  local vx, vy, vz = object(id):velocity()
  print(string.format('%.9g', math.sqrt(vx * vx + vy * vy + vz * vz)))
end)"""

    def measured(self, out):
        numbers = [float(number) for number in out.split()[:145]]
        return numpy.array(numbers[:144]).reshape(12, 12), numbers[144]

    def test_loads_are_those_of_springs(self):
        for draw in range(DRAWS):
            b = self.bed()
            right = self.loads(b)
            for rate in RATES:
                with self.subTest(draw=draw, rate=rate, **{name: b[name] for name in ("size", "at", "mass", "rider", "stiffness", "offset")}):
                    got, speed = self.measured(self.run_scene(self.scene(b, rate), 4))
                    weight = (b["mass"] + b["rider"]) * G
                    self.assertAlmostEqual(got.sum(), weight, delta=1e-3 * weight)
                    self.assertLess(abs(got - right).max(), 0.01 * weight)
                    self.assertEqual(speed, 0)  # asleep

    def stack(self):
        """Bodies at rest on each other on level pins, and the pins' stiffness."""
        u = self.random.uniform
        spread = self.random.choice((0.3, 3))  # of the masses, in powers of ten
        masses = [10 ** u(0, spread) for _ in range(self.random.randint(1, 5))]
        bodies, z = [], 0
        for level, mass in enumerate(masses):
            width, height, shape = round(u(2.5, 4.5) if level == 0 else u(1.5, 3.5), 3), round(u(0.4, 1.2), 3), self.random.choice(("box", "cylinder", "hull"))
            corners = ", ".join(f"{{{width / 2 * math.cos(k * math.pi / 3)}, {width / 2 * math.sin(k * math.pi / 3)}, {side * height / 2}}}" for k in range(6) for side in (-1, 1))
            of_shape = {"box": f"size = {{ {width}, {width}, {height} }}", "cylinder": f"radius = {width / 2}, height = {height}", "hull": f"points = {{ {corners} }}"}[shape]
            bodies.append(f"{shape} {{ {of_shape}, mass = {mass}, position = {{ x, y, {z + height / 2} }} }}")
            z += height
        # A softer bed sinks by more than 0.1 u.
        stiffness = max(10 ** u(3, 12), 20 * sum(masses))
        return {"bodies": bodies, "weight": sum(masses) * G, "stiffness": stiffness, "rate": self.random.choice(RATES), "iterations": self.random.choice((4, 10, 20, 80)),
                "at": (round(5.5 + u(-0.5, 0.5), 3), round(5.5 + u(-0.5, 0.5), 3))}

    def rest(self, s, pins):
        """How far any body of a stack has risen in 4 s; then the greatest speed, the load and by how much the lowest body has sunk."""
        lines = self.run_scene(f"""
world {{ dt = 1 / {s['rate']}, control_period = 1 / {s['rate']}, iterations = {s['iterations']} }}
material {{ name = 'default', friction = 0.5, restitution = 0 }}
surface {{ rows = 12, columns = 12, sensors = {{ pressure {{ range = 1e12 }} }}, actuator = pin {{ {pins} }} }}
local x, y = {s['at'][0]}, {s['at'][1]}
local ids, starts, risen = {{ {', '.join(s['bodies'])} }}, {{}}, 0
local function height(i) return select(3, object(ids[i]):position()) end
at(0, function() for i = 1, #ids do starts[i] = height(i) end end)
on_tick(function() for i = 1, #ids do risen = math.max(risen, height(i) - starts[i]) end end)
on_finish(function()
  local speed, load = 0, 0
  for i = 1, #ids do for _, v in ipairs({{ object(ids[i]):velocity() }}) do speed = math.max(speed, math.abs(v)) end end
  for row = 1, 12 do for column = 1, 12 do load = load + cells:truth('pressure', row, column) end end
  print(string.format('%.9g %.9g %.9g %.9g', risen, speed, load, starts[1] - height(1)))
end)""", 4)
        return [float(number) for number in lines.split()[:4]]

    def test_stacks_rest(self):
        for draw in range(STACKS):
            s = self.stack()
            with self.subTest(draw=draw, **{name: s[name] for name in s}):
                risen, speed, load, sunk = self.rest(s, f"stiffness = {s['stiffness']}")
                if self.rest(s, "")[1] > 0.002:
                    continue  # rigid pins do not bring it to rest either
                self.assertLess(risen, 1e-4)
                self.assertLess(speed, 0.002)
                self.assertAlmostEqual(load, s["weight"], delta=0.01 * s["weight"])
                # Between the depth on all pins that the lowest body may cover, and that on the smallest base.
                softest, stiffest = s["weight"] / s["stiffness"] / 2, s["weight"] / s["stiffness"] / 25
                self.assertGreater(sunk, 0.98 * stiffest if stiffest > 0.002 else -1e-4)
                self.assertLess(sunk, 1.02 * softest + 0.003)

    def swing(self, rate, stiffness, damping, drop, seconds):
        """The heights of a plate of mass 25 over 36 level pins, from where it touches them or `drop` above, and its weight's depth."""
        out = self.run_scene(f"""
world {{ dt = 1 / {rate}, control_period = 1 / {rate} }}
surface {{ rows = 12, columns = 12, actuator = pin {{ stiffness = {stiffness}, damping = {damping} }} }}
local id = box {{ size = {{ 5.8, 5.8, 0.5 }}, mass = 25, position = {{ 5.5, 5.5, {0.25 + drop} }} }}
on_tick(function() local _, _, z = object(id):position() print(string.format('%.9g', z - 0.25)) end)""", seconds)
        return numpy.array([float(number) for number in re.findall(r"^-?[\d.e-]+$", out, re.M)])

    def test_swings_like_a_mass_on_a_spring(self):
        for draw in range(DRAWS):
            sink = 10 ** self.random.uniform(-3, -1.7)  # of the weight at rest, u
            stiffness, period = 25 * G / 36 / sink, 2 * math.pi * math.sqrt(sink / G)
            decrement = self.random.uniform(0, 0.3)
            # Of a period with the damping ratio ζ: 2πζ/√(1 − ζ²).
            ratio = decrement / math.hypot(decrement, 2 * math.pi)
            damping = 2 * ratio * math.sqrt(25 * 36 * stiffness) / 36
            for rate in (120, 240, 960):
                with self.subTest(draw=draw, sink=sink, decrement=decrement, rate=rate):
                    z = self.swing(rate, stiffness, damping, 0, 6.2 * period)
                    at = [i for i in range(1, len(z) - 1) if (z[i] > z[i - 1]) != (z[i + 1] > z[i])]
                    peaks = [z[i] - (z[i + 1] - z[i - 1]) ** 2 / (8 * (z[i + 1] - 2 * z[i] + z[i - 1])) for i in at]
                    swings = numpy.abs(numpy.diff(peaks))
                    got = 2 * math.log(swings[0] / swings[-1]) / (len(swings) - 1)
                    added = math.pi * (2 * math.pi / (period * rate * 5)) ** 5
                    self.assertAlmostEqual(got, decrement, delta=added + 0.002 + 0.01 * decrement)
                    self.assertAlmostEqual((at[-1] - at[0]) / rate * 2 / (len(at) - 1), period / math.sqrt(1 - ratio**2), delta=0.01 * period)

    def test_dropped_plates_gain_nothing(self):
        for draw in range(DRAWS):
            drop, sink = self.random.uniform(0.05, 0.5), 10 ** self.random.uniform(-7, -1.7)
            for rate in RATES:
                with self.subTest(draw=draw, drop=drop, sink=sink, rate=rate):
                    z = self.swing(rate, 25 * G / 36 / sink, 0, drop, 3)
                    touched = int(numpy.argmax(z < 0.01))
                    self.assertLess(z[touched:].max(), drop + 0.005)
                    self.assertGreater(z.min(), -1.02 * (sink + math.sqrt(sink**2 + 2 * sink * drop)) - 1e-4 - G / rate**2)

    def test_nuisances_change_stiffness(self):
        scene = self.write("scene.lua", """
surface { rows = 12, columns = 12, actuator = pin { stiffness = 1e3 } }
local id = box { size = { 5.8, 5.8, 0.5 }, mass = 25, position = { 5.5, 5.5, 0.25 } }
on_finish(function() local _, _, z = object(id):position() print(25 * 9.81 / 36 / (0.25 - z)) end)""")
        for word, low, high in (("2e3", 2e3, 2e3), ("0.5:2:factor", 500, 2e3), ("100:900:offset", 1100, 1900)):
            with self.subTest(word):
                out = self.run_program(SMARTSURF, "run", scene, "--no-controller", "--headless", "--until", "3", "--vary", f"actuator.stiffness={word}")[1]
                self.assertTrue(0.999 * low <= float(out) <= 1.001 * high, out)
        for word, line in (("stiffness=0", "pin.stiffness = 0: must be greater than 0"), ("stiffness=nan", "nan: must be a finite number"), ("stiffness=1e3:inf", "inf: must be a finite number"), ("damping=-1:5", "pin.damping = -1: must be in [0, 1e+12]")):
            with self.subTest(word):
                status, _, err = self.run_program(SMARTSURF, "check", scene, "--vary", f"actuator.{word}")
                self.assertEqual((status, err), (2, f"smartsurf: {scene}: --vary actuator.{word}: {line}\n"))

    def test_same_bits_with_two_threads(self):
        b = self.bed()
        self.assertEqual(*(self.run_scene(self.scene(b, 240, 0.1), 1, "--threads", threads) for threads in ("1", "2")))


if __name__ == "__main__":
    unittest.main()
