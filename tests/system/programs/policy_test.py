"""smartsurf.export_policy: the APRON program of a local policy is local, and commands the same to the bit as NumPy."""
import shutil
import sys

from programs import *

sys.path.insert(0, str(ROOT / "smartsurf/python"))
try:
    import h5py
    import numpy as np
    from smartsurf.policy import LocalPolicy, cross, draw_links, export_policy, square
except ImportError:
    np = None

# Rolling balls drive spheres of three colours; all channels of the policy are in use.
TABLE = """
surface { rows = 9, columns = 14, actuator = ball { max_spin = 20 }, sensors = { proximity { range = 6 }, colour { range = 6 } } }
faults { sensor = { noise = 0.05 } }
for i = 1, 6 do
  sphere { radius = 0.8, position = { 2 * i, random(1, 7), 1.5 }, colour = ({ 'red', 'blue', 'orange' })[i % 3 + 1] }
end
record { sensors = true, actuators = true, every = 1 }
"""
INPUTS = ("proximity", "colour.r", "colour.b", "row", "column")
ACTIONS = (("spin_x", -6, 6), ("spin_y", -5.3, 7))


@unittest.skipUnless(np, "NumPy and h5py are not installed")
class Policy(ProgramTest):
    def policy(self, hidden=(6, 4), memory=3, scale=0.3, inputs=INPUTS, steps=1, diagonal=False):
        size = LocalPolicy.parameters(len(inputs), len(ACTIONS), hidden, memory, diagonal)
        vector = np.random.default_rng(5).standard_normal(size) * scale
        return LocalPolicy.from_vector(vector, inputs, ACTIONS, hidden, memory, steps, diagonal)

    def commands(self, policy, tile=None):
        """Runs the exported program, with tile on boards → sensors and commands, each channel → (ticks, rows, columns)."""
        program = str(self.folder / "policy.aps")
        export_policy(policy, program)
        status, out, err = self.run_program(APRON, "check", "--profile", "local", program)
        self.assertEqual((status, err), (0, ""), out + err)
        self.assertIn("every instruction is local", out)
        self.assertEqual(self.run_program(APRON, "fmt", "--check", program)[0], 0)
        run = (SMARTSURF, "run", self.write("table.lua", TABLE), "--controller", program) if tile is None else (
            sys.executable, str(ROOT / "scripts/boards/boards"), self.write("table.lua", TABLE), program, "--bin", str(BIN), "--tile", tile)
        status, out, err = self.run_program(*run, "--ticks", "90", "--record", "run.h5")
        self.assertEqual(status, 0, out + err)
        with h5py.File(self.folder / "run.h5") as file:
            sensors = {name: np.moveaxis(data[:], -1, 1) if data.ndim == 4 else data[:] for name, data in file["sensors"].items()}
            return sensors, {name: data[:] for name, data in file["actuators"].items()}

    def assert_same_bits(self, policy, tile=None):
        sensors, commands = self.commands(policy, tile)
        ticks = len(commands["spin_x"])
        self.assertGreater(ticks, 60)
        for tick in range(ticks - 1):  # the answer to a frame is recorded with the next one
            expected = policy({name: values[tick] for name, values in sensors.items()})
            for channel, values in expected.items():
                self.assertEqual(values.tobytes(), commands[channel][tick + 1].tobytes(), f"{channel} at tick {tick}")
        return commands

    def test_program_commands_the_same_bits(self):
        commands = self.assert_same_bits(self.policy())
        for channel, low, high in ACTIONS:
            inside = (commands[channel] > low) & (commands[channel] < high)
            self.assertGreater(inside.mean(), 0.2, f"{channel} is clamped nearly everywhere: the test would show little")

    def test_diagonal_neighbours_and_several_steps(self):
        commands = self.assert_same_bits(self.policy(hidden=(4,), memory=2, scale=0.25, steps=3, diagonal=True))
        self.assertGreater(len(np.unique(commands["spin_x"])), 100)

    def test_boards_take_diagonal_policies(self):
        program = str(self.folder / "policy.aps")
        export_policy(self.policy(hidden=(2,), memory=1, steps=2, diagonal=True), program)
        status, out, err = self.run_program(APRON, "compile", program, "--target", "c", "--size", "8x8", "--tile", "4x4", "-o", "policy.c")
        self.assertEqual(status, 0, out + err)

    @unittest.skipUnless(shutil.which("cc"), "no C compiler")
    def test_boards_command_the_same_bits(self):
        self.assert_same_bits(self.policy(), tile="7x3")
        self.assert_same_bits(self.policy(hidden=(3,), memory=2, scale=0.25, steps=2, diagonal=True), tile="7x3")

    def test_single_layer_and_sparse_kernels(self):
        kernel = np.zeros((2, 2, 3, 3), np.float32)
        kernel[0, 0, 0, 1], kernel[0, 1, 1, 0], kernel[1, 0, 2, 1], kernel[1, 1, 1, 2] = 1, -2.5, 0.1, 3  # north, west, south, east
        policy = LocalPolicy(("colour.r", "proximity"), ACTIONS, [(cross(kernel), np.array([-0.0, 0.25]))])
        self.assert_same_bits(policy)

    def test_kernels_are_oriented_as_images(self):
        image = np.zeros((3, 4), np.float32)
        image[1, 1] = 1
        for place, (row, column) in (((0, 1), (2, 1)), ((1, 2), (1, 0)), ((2, 1), (0, 1)), ((1, 0), (1, 2)), ((1, 1), (1, 1))):
            kernel = np.zeros((1, 1, 3, 3))
            kernel[0, 0, place[0], place[1]] = 1
            out = LocalPolicy(("x",), (("u", 0, 1),), [(cross(kernel), [0])])({"x": image})["u"]
            self.assertEqual([tuple(i) for i in np.argwhere(out)], [(row, column)], place)

    def test_corners_are_diagonal_neighbours(self):
        image = np.zeros((3, 4), np.float32)
        image[1, 1] = 1
        for row, column in ((0, 0), (0, 2), (2, 0), (2, 2)):
            kernel = np.zeros((1, 1, 3, 3))
            kernel[0, 0, row, column] = 1
            out = LocalPolicy(("x",), (("u", 0, 1),), [(square(kernel), [0])])({"x": image})["u"]
            self.assertEqual([tuple(i) for i in np.argwhere(out)], [(2 - row, 2 - column)])

    def test_dead_links_are_silent_in_both_directions(self):
        random = np.random.default_rng(7)
        links = draw_links(random, (3, 6, 5), 0.3, diagonal=True)
        self.assertEqual(links.shape, (3, 8, 6, 5))
        self.assertAlmostEqual(links[:, :, 1:-1, 1:-1].mean(), 0.7, delta=0.1)
        # What cell a hears of b, b hears of a: sums over all neighbours, weighted by the direction.
        image = random.random((3, 6, 5)).astype(np.float32)
        places = {1: (-1, 0), 2: (0, 1), 3: (1, 0), 4: (0, -1), 5: (-1, 1), 6: (1, 1), 7: (1, -1), 8: (-1, -1)}
        for tap, (row, column) in places.items():
            weights = np.zeros((1, 1, 9))
            weights[0, 0, tap] = 1
            heard = LocalPolicy(("x",), (("u", 0, 1),), [(weights, [0])])({"x": image}, links=links)["u"]
            for w, r, c in np.ndindex(3, 6, 5):
                inside = 0 <= r + row < 6 and 0 <= c + column < 5
                expected = image[w, r + row, c + column] if inside and links[w, tap - 1, r, c] else 0
                self.assertEqual(heard[w, r, c], expected)
                if inside:
                    back = next(t for t, place in places.items() if place == (-row, -column))
                    self.assertEqual(links[w, tap - 1, r, c], links[w, back - 1, r + row, c + column])
        with self.assertRaisesRegex(ValueError, r"links has shape \(4, 6, 5\): must be \(…, 8, rows, columns\)"):
            LocalPolicy(("x",), (("u", 0, 1),), [(weights, [0])])({"x": image}, links=np.ones((4, 6, 5), bool))

    def test_inactive_cells_keep_memory_and_commands(self):
        """A tick of three steps with masks equals the same steps by hand."""
        random, policy = np.random.default_rng(9), self.policy(inputs=("a",), hidden=(3,), memory=2, steps=3, diagonal=True)
        one = self.policy(inputs=("a",), hidden=(3,), memory=2, diagonal=True)
        kept = [np.zeros((5, 6), np.float32)] * 4
        for tick in range(4):
            image, active = random.random((5, 6)).astype(np.float32), random.random((3, 5, 6)) < 0.5
            got = policy({"a": image}, active=active)
            for step in range(3):
                one._state = list(kept)
                one({"a": image})
                kept = [np.where(active[step], new, old) for new, old in zip(one._state, kept)]
            for (channel, low, high), expected in zip(ACTIONS, kept):
                np.testing.assert_array_equal(got[channel], np.clip(expected, np.float32(low), np.float32(high)))

    def test_batches_equal_single_arrays(self):
        policy, random = self.policy(inputs=("a", "row")), np.random.default_rng(2)
        frames = random.standard_normal((4, 3, 5, 6)).astype(np.float32)  # ticks, worlds, rows, columns
        together = [policy({"a": frame})["spin_y"] for frame in frames]
        for world in range(3):
            policy.reset()
            for tick in range(4):
                self.assertEqual(policy({"a": frames[tick, world]})["spin_y"].tobytes(), together[tick][world].tobytes())

    def test_memory_carries_values_one_cell_per_tick(self):
        weights = np.zeros((2, 2, 5))
        weights[:, 0, 0] = 1  # own input
        weights[:, 1, 4] = 1  # the west neighbour's memory
        policy = LocalPolicy(("x",), (("u", 0, 1),), [(weights, np.zeros(2))], memory=1)
        pulse = np.zeros((1, 5), np.float32)
        pulse[0, 0] = 1
        self.assertEqual([policy({"x": pulse * (tick == 0)})["u"].argmax() for tick in range(5)], [0, 1, 2, 3, 4])

    def test_errors_are_one_line(self):
        kernel = np.zeros((1, 1, 3, 3))
        kernel[0, 0, 0, 0] = 1
        with self.assertRaisesRegex(ValueError, "corners of a kernel must be 0"):
            cross(kernel)
        with self.assertRaisesRegex(ValueError, r"layer 0: weights .* must be \(out, 2, 5 or 9\)"):
            LocalPolicy(("x", "y"), (("u", 0, 1),), [(np.zeros((1, 1, 5)), [0])])
        with self.assertRaisesRegex(ValueError, "the last layer has 3 outputs, not 1 actions and 1 of memory"):
            LocalPolicy(("x",), (("u", 0, 1),), [(np.zeros((3, 2, 5)), [0] * 3)], memory=1)
        with self.assertRaisesRegex(ValueError, "steps = 2: must be a whole number, at least 1, and 1 without memory"):
            LocalPolicy(("x",), (("u", 0, 1),), [(np.zeros((1, 1, 5)), [0])], steps=2)
        with self.assertRaisesRegex(ValueError, "must be finite"):
            LocalPolicy(("x",), (("u", 0, 1),), [(np.full((1, 1, 5), np.inf), [0])])
        with self.assertRaisesRegex(KeyError, "no sensor 'y' in the observation; there are x"):
            LocalPolicy(("y",), (("u", 0, 1),), [(np.zeros((1, 1, 5)), [0])])({"x": np.zeros((2, 2))})


if __name__ == "__main__":
    unittest.main()
