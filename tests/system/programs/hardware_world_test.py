"""device_emulator --world: a simulation as the world under emulated boards, behind the bridge."""
import h5py
import numpy

from programs import *

BRIDGE, EMULATOR = str(BIN / "surface_bridge"), str(BIN / "device_emulator")
SCENE = """
world { control_period = 0.02, dt = 0.01 }
surface { rows = 4, columns = 6, actuator = pin { range = { 0, 4 }, max_speed = 3 }, sensors = { pin_height {}, proximity { range = 3 } } }
record { sensors = true, actuators = true }
"""


class WorldUnderBoards(ProgramTest):
    def setUp(self):
        super().setUp()
        self.shm, self.world = f"table-{os.getpid()}", f"world-{os.getpid()}"  # the bridge adds to the name

    def tearDown(self):
        super().tearDown()
        for name in (self.world, self.shm + ".boards"):
            self.segment(name).unlink(missing_ok=True)

    def simulate(self, *flags):
        return self.start(SMARTSURF, "run", self.write("world.lua", SCENE), "--shm", self.world, "--headless", *flags)

    def emulate(self, *flags):
        return self.start(EMULATOR, "--world", self.world, "--tcp", "0", *flags)

    def test_boards_move_the_cells_above_which_they_lie_and_sense_them(self):
        world = self.simulate("--ticks", "600", "--record", "world.h5")
        emulator = self.emulate("--boards", "2x2", "--size", "3x2", "--table", "table.toml")
        self.wait_for((self.folder / "table.toml").exists, "the table")
        recorder = self.start(SMARTSURF, "record", "--shm", self.shm, "-o", "live.h5", "--wait", "60")
        controller = self.start(APRON, "run", str(ROOT / "scripts/hardware/raise.aps"), "--shm", self.shm, "--wait", "60")
        bridge = self.start(BRIDGE, "--table", "table.toml", "--shm", self.shm)
        status, out, err = self.finish(emulator)
        self.assertEqual((status, err), (0, ""))
        self.assertRegex(out, r"\nworld steps 60[01]\n")
        bridge.terminate()
        for child in (bridge, controller, recorder):
            self.finish(child)
        self.assertEqual(self.finish(world)[0], 0)
        with h5py.File(self.folder / "world.h5") as inner, h5py.File(self.folder / "live.h5") as outer:
            done = inner["actuators/height"][:]
            valid = outer["sensors/valid"][:]
            # What raise.aps commands in a tick; in each tick a board obeys one of these frames, or its safe values.
            row, column, tick = numpy.mgrid[0:4, 0:6, 0:2000]
            raised = numpy.moveaxis(1 + numpy.sin((column + row * 0.5 + tick * 0.25) * 0.2), -1, 0)
            raised = numpy.concatenate([raised, numpy.zeros((1, 4, 6))])
            for rows in (slice(0, 2), slice(2, 4)):
                for columns in (slice(0, 3), slice(3, 6)):
                    far = numpy.abs(done[:, None, rows, columns] - raised[None, :, rows, columns]).max((2, 3))
                    self.assertLess(far.min(1).max(), 1e-4)
                    self.assertGreater(len(numpy.unique(far.argmin(1))), 30)
                    for name in ("pin_height", "proximity"):
                        states = {frame.tobytes() for frame in inner["sensors"][name][:, rows, columns]}
                        for frame in outer["sensors"][name][:, rows, columns][valid[:, rows, columns].all((1, 2)) == 1]:
                            self.assertIn(frame.tobytes(), states)

    def test_what_does_not_fit_is_refused(self):
        def refused(expected, status, *flags):
            found, _, err = self.finish(self.emulate(*flags))
            self.assertEqual((found, len(err.splitlines())), (status, 1), err)
            self.assertIn(expected, err)
        refused("takes the place of --device", 2, "--period-ms", "5")
        self.simulate()
        self.wait_for(self.segment(self.world).exists, "the world")
        refused("has 6x4 cells, but --boards and --size give 8x8", 2, "--boards", "2x2", "--size", "4x4")


if __name__ == "__main__":
    unittest.main()
