"""Histograms and scattered sums of random registers against NumPy, in all executions."""
import numpy as np

from programs import *


class SmallArrays(ProgramTest):
    def test_random_registers(self):
        for seed in program_seeds(12):
            random = np.random.default_rng(seed)
            width, height = random.integers(1, 70, 2)
            columns, rows = random.integers(1, 20, 2)
            bins = columns * rows
            index = random.uniform(-3, bins + 3, (height, width)).astype(np.float32)
            index[random.random(index.shape) < 0.05] = np.nan
            index[random.random(index.shape) < 0.05] = np.inf
            added = (random.normal(0, 1, index.shape) * 10.0 ** random.integers(-6, 6)).astype(np.float32)
            np.save(self.folder / "index.npy", index)
            np.save(self.folder / "added.npy", added)
            program = self.write("scatter.aps", f"""!register(I, A)
!create('H', REGISTER, {columns}, {rows})
!create('S', REGISTER, {columns}, {rows})
I = io.array.open('index.npy')
A = io.array.open('added.npy')
r[H] = histogram(I + 0)
r[S] = scatter.sum(I, A * 2)
""")
            with np.errstate(invalid="ignore"):
                inside = (index >= 0) & (index < bins)
            at = np.floor(index[inside]).astype(int)
            count, total = np.zeros(bins), np.zeros(bins)
            np.add.at(count, at, 1)
            np.add.at(total, at, (added * np.float32(2))[inside].astype(float))  # in the order of the cells
            for flags in (["--isa", "portable"], [], ["--threads", "3"], ["--profile", str(self.folder / "p.json")]):
                out = {name: self.folder / f"{name}.npy" for name in "HS"}
                status, _, err = self.finish(self.start(APRON, "run", program, "--size", f"{width}x{height}", *flags, *(
                    word for name, file in out.items() for word in ("--save", f"{name}={file}"))))
                self.assertEqual((status, err), (0, ""))
                for name, wanted in (("H", count), ("S", total)):
                    np.testing.assert_array_equal(np.load(out[name]).ravel(), wanted.astype(np.float32), f"seed {seed} {name} {flags}")

    def test_check_names_it_as_not_local(self):
        program = self.write("local.aps", "!register(A)\n!create('H', REGISTER, 4, 1)\nr[H] = histogram(A)\n")
        status, out, err = self.finish(self.start(APRON, "check", "--profile", "local", program))
        self.assertNotEqual(status, 0)
        self.assertIn("scatter.sum needs the whole array", out + err)

    def test_operands_of_two_sizes_are_refused(self):
        program = self.write("sizes.aps", "!register(A)\n!create('H', REGISTER, 4, 1)\nr[H] = scatter.sum(A, r[H])\n")
        status, out, err = self.finish(self.start(APRON, "check", program))
        self.assertEqual(status, 2, err)
        self.assertIn("sizes.aps:3", out + err)


if __name__ == "__main__":
    unittest.main()
