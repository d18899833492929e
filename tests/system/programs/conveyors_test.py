#!/usr/bin/env python3
"""Conveyors against closed forms, on random belts, loads and frictions: the cases of tests/truth/conveyor.lua with other numbers."""
import math
import random
import re
import sys

from programs import *

sys.path.insert(0, str(ROOT / "tests/truth"))
from cases import G, slip_way, transfer  # noqa: E402

DRAWS = int(os.environ.get("CONVEYOR_DRAWS", "4"))


class Conveyors(ProgramTest):
    def setUp(self):
        super().setUp()
        self.random = random.Random(self._testMethodName)

    def draws(self, *names):
        """Settings with numbers drawn in the ranges of these names."""
        ranges = {"v1": (0.5, 3.0), "v2": (0.5, 3.0), "mu": (0.2, 0.8), "length": (2.0, 5.0), "width": (2.0, 4.5), "angle": (-150.0, 150.0)}
        for _ in range(DRAWS):
            yield {name: round(self.random.uniform(*ranges[name]), 3) for name in names}

    def measure(self, kind, seconds, **settings):
        stats = self.folder / "stats.json"
        words = [word for name, value in {"kind": kind, "rate": 480, **settings}.items() for word in ("--set", f"{name}={value}")]
        status, _, err = self.run_program(SMARTSURF, "run", str(ROOT / "tests/truth/conveyor.lua"), "--no-controller", "--headless",
                                          "--until", str(seconds), "--stats", str(stats), *words)
        self.assertEqual(status, 0, err)
        return json.loads(stats.read_text())["metrics"]

    def test_transfer_between_belts(self):
        for drawn in self.draws("v1", "v2", "mu", "length"):
            with self.subTest(**drawn):
                got = self.measure("transfer", 0.5 / drawn["v1"] + drawn["length"] / drawn["v1"] + 5, **drawn)
                self.assertAlmostEqual(got["v"], drawn["v2"], delta=1e-3)
                self.assertAlmostEqual(got["ahead"], transfer(**drawn), delta=0.01)

    def test_feed_from_aside(self):
        for drawn in self.draws("v1", "v2", "mu", "angle"):
            with self.subTest(**drawn):
                got, (along, aside) = self.measure("feed", 4, **drawn), slip_way(**drawn)
                self.assertAlmostEqual(got["ahead"], along, delta=0.01)
                self.assertAlmostEqual(got["aside"], aside, delta=0.01)
                self.assertAlmostEqual(got["spin"], 0, delta=1e-3)

    def test_centring_swings(self):
        for drawn in self.draws("v1", "mu", "width"):
            offset = round(self.random.uniform(0.1, 0.45) * drawn["width"], 3)
            with self.subTest(**drawn, offset=offset):
                got = self.measure("centre", 6, v2=20, offset=offset, **drawn)
                period = 2 * math.pi * math.sqrt(drawn["width"] / (2 * drawn["mu"] * G))
                self.assertAlmostEqual(got["period"], period, delta=0.01 * period)
                self.assertAlmostEqual(got["ahead"], 0, delta=0.02)

    def test_straddling_turns(self):
        for drawn in self.draws("mu", "length", "width"):
            mu, length, width = drawn["mu"], drawn["length"], drawn["width"]
            for kind, right in (("straddle", 3 * mu * G * width / (length**2 + width**2)),
                                ("straddle_disc", 16 * mu * G / (3 * math.pi * width))):
                with self.subTest(kind=kind, **drawn):
                    got = self.measure(kind, 0.05, v1=40, **drawn)
                    self.assertAlmostEqual(got["rate"], right, delta=0.02 * right)

    def test_turntable_carries(self):
        for drawn in self.draws("mu", "length", "width"):
            offset = round(self.random.uniform(0.5, 5), 3)
            rate = round(self.random.choice((-1, 1)) * math.sqrt(self.random.uniform(0.1, 0.6) * drawn["mu"] * G / offset), 3)
            with self.subTest(**drawn, offset=offset, rate=rate):
                got = self.measure("turntable", 3, v2=rate, offset=offset, **drawn)
                self.assertAlmostEqual(got["turned"], 3 * rate, delta=0.01 * abs(3 * rate))
                self.assertAlmostEqual(got["radius"], offset, delta=0.01 * offset)
                self.assertAlmostEqual(got["spin"], rate, delta=1e-3 * abs(rate))


    def test_one_belt_is_what_its_cells_are(self):
        # Cells that differ by a millionth of a unit are solved cell by cell: the second implementation.
        for drawn in self.draws("v1", "mu", "angle"):
            states = []
            for differ in (0, 1e-6):
                path = self.write("belt.lua", f"""
world {{ seed = {self.random.randrange(1, 1000) if not states else seed} }}
material {{ name = 'default', friction = {drawn['mu']}, rolling_friction = 0 }}
surface {{ rows = 32, columns = 32, actuator = conveyor {{ max_acceleration = 1e6 }} }}
for i = 0, 8 do
  box {{ size = {{ random(1, 3), random(1, 3), random(0.3, 0.8) }}, position = {{ 6 + 6 * (i % 3), 6 + 6 * (i // 3), 0.41 }},
        orientation = {{ yaw = random(-3, 3) }}, velocity = {{ random(-1, 1), random(-1, 1), 0 }}, angular_velocity = {{ 0, 0, random(-2, 2) }} }}
end
at(0, function()
  for row = 1, 32 do
    for column = 1, 32 do
      cells:target('drive_x', row, column, {drawn['v1'] * math.cos(drawn['angle'])} + {differ} * ((row + column) % 2))
      cells:target('drive_y', row, column, {drawn['v1'] * math.sin(drawn['angle'])})
    end
  end
end)
on_finish(function()
  for i = 0, 8 do
    local x, y = object(i):position()
    local _, _, z, w = object(i):orientation()
    local vx, vy = object(i):velocity()
    print(string.format('%.9f %.9f %.9f %.9f %.9f', x, y, math.abs(z * w), vx, vy))
  end
end)""")
                if not states:
                    seed = re.search(r"seed = (\d+)", pathlib.Path(path).read_text())[1]
                status, out, err = self.run_program(SMARTSURF, "run", path, "--no-controller", "--headless", "--until", "1.5")
                self.assertEqual(status, 0, err)
                states.append([float(number) for number in out.split()[:45]])
            self.assertEqual(len(states[0]), 45)
            for one, cell_by_cell in zip(*states):
                self.assertAlmostEqual(one, cell_by_cell, delta=2e-3, msg=str(drawn))


class ConveyorKinds(ProgramTest):
    """The mechanisms of scripts/conveyors, each in a scene of its own."""

    def run_scene(self, scene, seconds):
        """Runs a scene that uses the library, and returns the numbers it prints."""
        (self.folder / "conveyors.lua").write_text((ROOT / "scripts/conveyors/conveyors.lua").read_text())
        path = self.write("scene.lua", "local conveyors = require 'conveyors'\n" + scene)
        status, out, err = self.run_program(SMARTSURF, "run", path, "--no-controller", "--headless", "--until", str(seconds))
        self.assertEqual(status, 0, err)
        return [float(number) for number in re.findall(r"-?\d+\.\d+(?:e-?\d+)?", out)]

    def test_hexagons_of_three_wheels_carry_and_turn(self):
        draw = random.Random(7)
        for _ in range(DRAWS):
            x, y, turn = (round(draw.uniform(-1, 1), 3) for _ in range(3))
            with self.subTest(x=x, y=y, turn=turn):
                # All hexagons together move as one plate does about the table's middle.
                got = self.run_scene(f"""
surface {{ rows = 20, columns = 20, layout = 'hex', actuator = conveyor {{ top = 0.8 }} }}
local id = box {{ size = {{ 4, 4, 1 }}, position = {{ 9.75, 8.2, 0.5 }} }}
at(0, function()
  for row = 1, 20 do
    for column = 1, 20 do
      local cx, cy = cells:centre(row, column)
      local dx, dy = {x} - {turn} * (cy - 8.2), {y} + {turn} * (cx - 9.75)
      conveyors.run({{ row, column, row, column }}, conveyors.omni(0.3, conveyors.wheel_speeds(0.3, dx, dy, {turn})))
    end
  end
end)
at(0.7, function()
  local vx, vy = object(id):velocity()
  local px, py = object(id):position()
  local _, _, w = object(id):angular_velocity()
  print(string.format('%.6f %.6f %.6f', vx + {turn} * (py - 8.2), vy - {turn} * (px - 9.75), w))
end)""", 0.8)
                for value, right in zip(got, (x, y, turn)):
                    self.assertAlmostEqual(value, right, delta=0.01)

    def test_pop_up_wheels_lift_and_drive_across(self):
        vx, vy, z = self.run_scene("""
surface { rows = 8, columns = 24, actuators = { r = conveyor { top = 0.9 }, p = conveyor { top = 0.9, lift = { 0, 0.05 } } },
          cells = { 'rp', 'rp' } }
local id = box { size = { 4, 3, 1 }, position = { 4, 3.5, 0.5 } }
at(0, function() conveyors.run({ 1, 1, 8, 24 }, conveyors.belt(0, 1)) end)
at(2, function() conveyors.run(function(_, column) return column % 2 == 0 end, conveyors.pop_up(math.pi / 2, 0.5, 0.05)) end)
on_finish(function()
  local vx, vy = object(id):velocity()
  local _, _, z = object(id):position()
  print(string.format('%.6f %.6f %.6f', vx, vy, z))
end)""", 3.5)
        self.assertAlmostEqual(vx, 0, delta=1e-3)
        self.assertAlmostEqual(vy, 0.5, delta=1e-3)
        self.assertAlmostEqual(z, 0.55, delta=0.002)

    def test_neighbours_in_a_hexagonal_layout(self):
        # docs/actuators.md: which rows are shifted, and which of the eight array neighbours touch.
        for rows in (5, 6):
            numbers = self.run_scene(f"""
surface {{ rows = {rows}, columns = 6, layout = 'hex' }}
on_finish(function()
  for row = 1, {rows} do for column = 1, 6 do print(string.format('%.6f %.6f', cells:centre(row, column))) end end
end)""", 0.05)
            at = {divmod(i, 6): numbers[2 * i:2 * i + 2] for i in range(rows * 6)}
            for row in range(1, rows - 1):
                shifted = row % 2 == (0 if rows % 2 == 0 else 1)
                self.assertAlmostEqual(at[row, 0][0], 0.5 if shifted else 0, places=5)
                apart = {(r, c): math.dist(at[row, 2], at[row + r, 2 + c]) for r in (-1, 0, 1) for c in (-1, 0, 1) if (r, c) != (0, 0)}
                far = {(-1, -1), (1, -1)} if shifted else {(-1, 1), (1, 1)}
                for neighbour, distance in apart.items():
                    self.assertAlmostEqual(distance, math.sqrt(3) if neighbour in far else 1, places=5)

    def test_all_on_one_table(self):
        status, out, err = self.run_program(SMARTSURF, "run", str(ROOT / "scripts/conveyors/sorter.lua"), "--no-controller", "--headless",
                                            "--until", "30")
        self.assertEqual(status, 0, err)
        self.assertIn("4 of 4", out)


if __name__ == "__main__":
    unittest.main()
