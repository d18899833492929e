"""scripts/truth and scripts/tasks/engines: what they measure, refuse and report."""
import csv
import importlib.machinery
import importlib.util
import math
import random
import re
import shutil
import sys

from programs import *

SCRIPT = str(ROOT / "scripts/truth")
sys.path.insert(0, str(ROOT / "tests/truth"))
sys.dont_write_bytecode = True
loader = importlib.machinery.SourceFileLoader("truth", SCRIPT)
truth = importlib.util.module_from_spec(importlib.util.spec_from_loader("truth", loader))
loader.exec_module(truth)
import cases  # noqa: E402
import overlap  # noqa: E402


class Truth(ProgramTest):
    def run_truth(self, *flags):
        return self.run_program(sys.executable, SCRIPT, "--smartsurf", SMARTSURF, "-o", "out", *flags)

    def test_errors_are_measured_recorded_and_checked(self):
        chosen = ["--case", "free_fall,rest_sphere", "--engine", "native", "--rates", "60,240", "--bounds", "bounds.csv"]
        status, out, err = self.run_truth(*chosen)
        self.assertEqual((status, err), (0, ""))
        self.assertRegex(out, r"free_fall z +native .* 0\.\d+ .*\(-g·t²/2 = -19\.62 u; tolerance 1 %\)")
        with open(self.folder / "out/results.csv", newline="") as file:
            rows = list(csv.DictReader(file))
        self.assertEqual(len(rows), 8)
        self.assertAlmostEqual(float(rows[0]["error"]), abs(float(rows[0]["measured"]) / -19.62 - 1), places=5)
        self.assertEqual(self.run_truth(*chosen, "--check")[0], 2)
        self.assertEqual(self.run_truth(*chosen, "--record")[0], 0)
        status, out, err = self.run_truth(*chosen, "--check")
        self.assertEqual((status, out), (0, "2 cases within their bounds (0 runs)\n"))
        # A smaller bound stands for a greater error.
        file = self.folder / "bounds.csv"
        file.write_text(re.sub(r"^(free_fall,z,native,60),.*$", r"\1,1e-5", file.read_text(), flags=re.MULTILINE))
        status, out, err = self.run_truth(*chosen, "--check")
        self.assertEqual((status, len(out.splitlines())), (1, 1))
        self.assertRegex(out, r"^free_fall, z, on native at 1/60: error 0\.\d+, recorded at most 1e-05 \(measured ")

    def test_mistakes_are_one_line(self):
        for flags, words in ((["--case", "no_such"], "truth: --case no_such: no such case; there are free_fall, "),
                             (["--engine", "havok"], "truth: --engine havok: there are native, bullet, mujoco"),
                             (["--rates", "50"], "truth: --rates 50: there are 60, 120, 240, 960"),
                             (["--jobs", "none"], "truth: --jobs none: must be a whole number"),
                             (["--smartsurf", "nowhere"], "truth: smartsurf: no such program"),
                             (["--speed"], "truth: unrecognized arguments: --speed")):
            status, _, err = self.run_truth(*flags)
            self.assertEqual((status, len(err.splitlines())), (2, 1), err)
            self.assertTrue(err.startswith(words), err)
        status, _, err = self.run_program(str(ROOT / "scripts/tasks/engines"), "--task", "juggle")
        self.assertEqual((status, len(err.splitlines())), (2, 1), err)
        self.assertTrue(err.startswith("engines: --task juggle: there are size_sort, "), err)

    def test_every_case_has_a_script_closed_forms_and_bounds(self):
        bounds = truth.read_bounds(truth.BOUNDS)
        used = {case.script for case in cases.CASES}
        self.assertEqual(used | {"truth"}, {path.stem for path in (ROOT / "tests/truth").glob("*.lua")})
        page = (ROOT / "docs/truth.md").read_text()
        for case in cases.CASES:
            self.assertIn(f"`{case.name}`", page)
            for q in case.quantities:
                self.assertTrue(math.isfinite(cases.error(case, q, 0.0)), f"{case.name} {q.metric}")
                for rate in (60, 240):
                    self.assertIn((case.name, q.metric, "native", rate), bounds)

    def test_flips_follow_eulers_equations(self):
        # Integrates Euler's equations to the first two zeros of the middle component.
        i1, i2, i3 = 13 / 12, 10 / 12, 5 / 12
        w, dt, zeros = [0.01, 10.0, 0.0], 1e-4, []
        rate = lambda w: ((i2 - i3) / i1 * w[1] * w[2], (i3 - i1) / i2 * w[2] * w[0], (i1 - i2) / i3 * w[0] * w[1])
        for k in range(60000):
            half = [a + dt / 2 * b for a, b in zip(w, rate(w))]
            after = [a + dt * b for a, b in zip(w, rate(half))]
            if (after[1] < 0) != (w[1] < 0):
                zeros.append(k * dt)
            w = after
        self.assertAlmostEqual(zeros[1] - zeros[0], cases.FLIPS, places=3)
        self.assertAlmostEqual(zeros[0], cases.FLIPS / 2, places=3)

    def test_order_of_convergence_is_the_slope(self):
        self.assertAlmostEqual(truth.order_of([(r, 3 / r**2) for r in (60, 120, 240, 960)]), 2)
        self.assertAlmostEqual(truth.order_of([(r, 0.1) for r in (60, 120, 240, 960)]), 0)
        self.assertIsNone(truth.order_of([(r, 1e-9) for r in (60, 120, 240, 960)]))

    def test_overlap_of_round_bodies_is_the_least_shift_that_parts_them_from_a_column(self):
        import numpy
        half, top, draw = numpy.array([0.4, 0.3]), 2.0, random.Random(3)
        def depth(shape, radius, height, p, q):
            return overlap.round_depth(shape, radius, height, numpy.array(p), overlap.axes_of(q), numpy.zeros(2), half, top, 0.0)
        level, lying = [0, 0, 0, 1], [0, math.sin(math.pi / 4), 0, math.cos(math.pi / 4)]
        self.assertAlmostEqual(depth("cylinder", 0.5, 1.0, [0, 0, 2.4], level), 0.1)
        self.assertAlmostEqual(depth("cylinder", 0.5, 1.0, [0.85, 0, 0], level), 0.05)
        self.assertAlmostEqual(depth("cylinder", 0.5, 1.0, [0.1, 0, 2.3], lying), 0.2)
        self.assertAlmostEqual(depth("cone", 0.5, 1.0, [0, 0, 2.2], level), 0.05)
        self.assertAlmostEqual(depth("cone", 0.5, 1.0, [0, 0, 2.7], [1, 0, 0, 0]), 0.05)
        self.assertEqual(depth("capsule", 0.2, 1.0, [1.0, 0, 0], level), 0.0)
        # A capsule without a cylinder is a sphere.
        for _ in range(50):
            p = [draw.uniform(-0.8, 0.8), draw.uniform(-0.8, 0.8), draw.uniform(2.0, 2.6)]
            sphere = overlap.sphere_depth(numpy.array(p), 0.5, numpy.array([-0.4, -0.3, 0.0]), numpy.array([0.8, 0.6, 2.0]))
            self.assertAlmostEqual(depth("capsule", 0.5, 1.0, p, level), max(0.0, sphere), places=3)

    def test_overlap_of_boxes_is_the_least_shift_that_parts_them(self):
        import numpy
        half, eye = numpy.array([1.0, 0.5, 0.5]), numpy.eye(3)
        self.assertAlmostEqual(overlap.box_depth(numpy.zeros(3), eye, half, numpy.array([1.9, 0.2, 0]), eye, half), 0.1)
        self.assertLess(overlap.box_depth(numpy.zeros(3), eye, half, numpy.array([2.1, 0.2, 0]), eye, half), 0)
        # A corner, turned by 45°, points at the face.
        q = overlap.axes_of([0, 0, math.sin(math.pi / 8), math.cos(math.pi / 8)])
        self.assertAlmostEqual(overlap.box_depth(numpy.zeros(3), eye, half, numpy.array([2.0, 0, 0]), q, numpy.array([1.0, 1.0, 1.0])),
                               math.sqrt(2) - 1)
        self.assertAlmostEqual(overlap.sphere_depth(numpy.array([0, 0, 1.4]), 0.5, numpy.array([-1, -1, -1]), numpy.array([2, 2, 2])), 0.1)

    def test_tasks_on_both_engines(self):
        if not has_bullet():
            self.skipTest("needs Bullet")
        words = [str(ROOT / "scripts/tasks/engines"), "--task", "magnets", "--seeds", "1", "--smartsurf", SMARTSURF, "-o", "out"]
        status, out, err = self.run_program(*words)
        self.assertEqual(status, 0, err)
        self.assertRegex(out, r"^\| `magnets`, 6 s \| pulled to, u \| \*\*1/1\*\*; 0\.\d\d \| \*\*1/1\*\*; 0\.\d\d \| \d+ × \|\n$")


if __name__ == "__main__":
    unittest.main()
