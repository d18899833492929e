"""Registers of APRON programs in recordings and pictures: --record-registers, --cells apron:NAME."""
import random

import h5py
import numpy

from programs import *

SCENE = """
surface {{ rows = {rows}, columns = {columns}, actuator = pin {{}}, sensors = {{ proximity {{ range = 6 }} }} }}
record {{ sensors = true, actuators = true, every = {every} }}
sphere {{ radius = 1.1, position = {{ {x}, {y}, 4 }} }}
"""

# SEEN is what the sensors say, COUNT the number of answers, and H what the pins are told.
PROGRAM = """
!register(SEEN, COUNT, MIX, H)
COUNT = 0
while(1)
  SEEN = surface.sense('proximity')
  COUNT = COUNT + 1
  MIX = {a} * SEEN + {b} * cell.x
  H = clamp(0.1 * MIX + {c} * COUNT, 0, 2)
  surface.actuate('height', H)
  surface.step
endwhile
"""


class Registers(ProgramTest):
    def run_drawn(self, draw, names, *flags):
        """Runs a drawn table and program; returns the recording's path and `every`."""
        every = draw.choice([1, 3])
        scene = self.write("scene.lua", SCENE.format(rows=draw.randint(5, 12), columns=draw.randint(5, 12), every=every,
                                                     x=draw.uniform(1, 4), y=draw.uniform(1, 4)))
        program = self.write("program.aps", PROGRAM.format(a=round(draw.uniform(-1, 1), 3), b=round(draw.uniform(-1, 1), 3),
                                                           c=round(draw.uniform(0, 0.2), 3)))
        recording = self.folder / "run.h5"
        status, _, err = self.run_program(SMARTSURF, "run", scene, "--controller", program, "--shm", self.shm, "--ticks", "90",
                                          "--record", str(recording), "--record-registers", names, *flags)
        self.assertEqual(status, 0, err)
        return recording, every

    def test_registers_are_those_that_led_to_the_frame(self):
        for seed in range(4):
            draw = random.Random(seed)
            recording, every = self.run_drawn(draw, draw.choice(["all", "COUNT,H,SEEN"]))
            with self.subTest(seed=seed), h5py.File(recording) as file:
                ticks, registers = file["tick"][:], file["registers"]
                for name in ("COUNT", "H", "SEEN"):
                    self.assertEqual(registers[name].shape, file["sensors/proximity"].shape)
                    self.assertTrue(numpy.isnan(registers[name][0]).all(), "before the first answer")
                for frame in range(1, len(ticks)):
                    self.assertTrue((registers["COUNT"][frame] == ticks[frame]).all())
                numpy.testing.assert_array_equal(registers["H"][1:], file["actuators/height"][1:])
                if every == 1:
                    numpy.testing.assert_array_equal(registers["SEEN"][1:], file["sensors/proximity"][:-1])

    def test_plots_take_the_names_of_cells(self):
        recording, _ = self.run_drawn(random.Random(5), "all")
        plots = []
        for kind in ("H:2,3:1,1", "apron:H:2,3:1,1"):
            status, _, err = self.run_program(SMARTSURF, "plot", str(recording), "--what", kind, "-o", "h.svg")
            self.assertEqual(status, 0, err)
            plots.append((self.folder / "h.svg").read_bytes())
        self.assertEqual(*plots)
        for kind in ("apron:HH:2,3", "apron", "apron:H", "apron:H:99,0"):
            status, _, err = self.run_program(SMARTSURF, "plot", str(recording), "--what", kind, "-o", "h.svg")
            self.assertEqual((status, len(err.splitlines())), (2, 1), err)

    def test_seconds_are_those_of_the_run(self):
        scene = self.write("scene.lua", SCENE.format(rows=5, columns=5, every=1, x=2, y=2))
        _, _, said = self.run_program(SMARTSURF, "run", scene, "--no-controller", "--ticks", "7", "--record", "short.h5")
        _, told, _ = self.run_program(SMARTSURF, "info", "short.h5")
        _, _, refused = self.run_program(SMARTSURF, "replay", "short.h5", "--screenshot", "x.png@1")
        self.assertIn("0.12 s simulated", said)
        self.assertIn("7 ticks, 0.12 s simulated", told)
        self.assertIn("0 s to 0.12 s", told)
        self.assertIn("the recording ends at 0.12 s", refused)

    def test_mistakes_are_one_line(self):
        scene = self.write("scene.lua", SCENE.format(rows=5, columns=5, every=1, x=2, y=2))
        program = self.write("program.aps", PROGRAM.format(a=1, b=1, c=1))
        base = [SMARTSURF, "run", scene, "--ticks", "3"]
        controlled = [*base, "--shm", self.shm, "--controller", program]
        for command, expected in (
                ([*base, "--no-controller", "--record", "x.h5", "--record-registers", "H"], "needs --controller PROGRAM.aps"),
                ([*controlled, "--record-registers", "H"], "needs --record FILE.h5"),
                ([*controlled, "--record", "x.csv", "--record-registers", "H"], "needs --record FILE.h5"),
                ([*controlled, "--mode", "passive", "--record", "x.h5", "--record-registers", "H"], "needs --mode time-step"),
                ([*base, "--no-controller", "--screenshot", "x.png", "--cells", "apron:H"], "needs --controller PROGRAM.aps")):
            status, _, err = self.run_program(*command)
            self.assertEqual(status, 2, err)
            self.assertEqual(err.count("\n"), 1, err)
            self.assertIn(expected, err)
        status, _, err = self.run_program(*controlled, "--record", "x.h5", "--record-registers", "HH")
        self.assertEqual(status, 2, err)
        self.assertIn("--record-registers: the program has no register 'HH'", err)
        status, _, err = self.run_program(*controlled, "--record", "x.h5", "--record-registers", "")
        self.assertEqual((status, err), (2, "smartsurf: --record-registers: must not be empty (see smartsurf run --help)\n"))

    @needs_view
    def test_messages_name_the_option_that_was_given(self):
        scene = self.write("scene.lua", SCENE.format(rows=5, columns=5, every=1, x=2, y=2))
        program = self.write("program.aps", PROGRAM.format(a=1, b=1, c=1))
        run = [SMARTSURF, "run", scene, "--ticks", "3", "--shm", self.shm, "--controller", program]
        recorded = ["--record", "x.h5", "--record-registers"]
        draw = ["--screenshot", "x.png", "--picture-size", "64x40", "--quality", "low", "--cells"]
        drawn = "--cells apron:SIZ: the program has no register 'SIZ'"
        for flags, expected in (([*draw, "apron:SIZ"], drawn), ([*draw, "apron:SIZ", *recorded, "H"], drawn),
                                ([*draw, "apron:H", *recorded, "SIZ"], "--record-registers: the program has no register 'SIZ'")):
            with self.subTest(flags=flags):
                status, _, err = self.run_program(*run, *flags)
                self.assertEqual(status, 2, err)
                self.assertIn(expected, err)
        status, _, err = self.run_program(*run, *recorded, "H")
        self.assertEqual(status, 0, err)
        status, _, err = self.run_program(SMARTSURF, "replay", "x.h5", *draw, "apron:COUNT")
        self.assertEqual((status, err.count("\n")), (2, 1), err)
        self.assertIn("--record-registers COUNT keeps", err)
        self.assertNotIn("record { sensors", err)

    @needs_view
    def test_painted_cells_are_those_of_the_replay(self):
        ours, theirs = self.folder / "run.png", self.folder / "replay.png"
        look = ["--cells", "apron:MIX", "--quality", "low", "--picture-size", "320x200"]
        recording, _ = self.run_drawn(random.Random(7), "all", "--screenshot", f"{ours}@1", *look)
        status, _, err = self.run_program(SMARTSURF, "replay", str(recording), "--screenshot", f"{theirs}@1", *look)
        self.assertEqual(status, 0, err)
        self.assertEqual(ours.read_bytes(), theirs.read_bytes())


if __name__ == "__main__":
    unittest.main()
