"""scripts/bench: the report presents the measurements."""
from programs import *

BENCH = str(ROOT / "scripts/bench")
MACHINE = {"date": "2001-02-03", "processor": "abacus, 2 cores"}


class Bench(ProgramTest):
    def setUp(self):
        super().setUp()
        os.environ["SMARTSURF"] = SMARTSURF  # draws the plots

    def measured(self, part, lines):
        (self.folder / "out").mkdir(exist_ok=True)
        (self.folder / f"out/{part}.json").write_text(json.dumps({"machine": MACHINE, "runs": [{"command": [], "lines": lines}]}))

    def report(self):
        status, out, err = self.run_program(BENCH, "--only", "none", "-o", "out")
        self.assertEqual(status, 0, out + err)
        return (self.folder / "out/report.md").read_text()

    def test_report_tables_show_values_ratios_and_gaps(self):
        def line(case, who, physics, sensors):
            return {"benchmark": "physics", "case": case, "who": who, "threads": 1, "physics_ms": physics,
                    "sensors_ms": sensors, "overlap_u": 0.02, "in_pins_u": 0.25, "lost": 0}
        self.measured("physics", [line("8x8 1", "ours", 0.25, 0.75), line("8x8 1", "naive", 2, 10), line("9x9 2", "ours", 1, 1)])
        text = self.report()
        self.assertIn("| processor | abacus, 2 cores |", text)
        self.assertIn("| naive | 2 / 10 | – |", text)
        self.assertIn("| naive | 12 × | – |", text)
        self.assertIn("| ours | 0.020 / 0.250 | 0.020 / 0.250 |", text)
        self.assertIn("(bench-physics.svg)", text)
        self.assertIn("</svg>", (self.folder / "out/bench-physics.svg").read_text())

    def test_report_of_threads_beside_busy_programs(self):
        def line(beside, threads, wall):
            return {"benchmark": "physics", "case": "8x8 1", "who": "ours", "threads": threads, "beside": beside, "wall_s": wall}
        self.measured("threads", [line(0, 1, 4), line(0, 2, 2), line(5, 1, 8), line(5, 2, 10),
                                  line(0, 1, 4), line(0, 2, 2), line(5, 1, 9), line(5, 2, 99),
                                  line(0, 1, 8), line(0, 2, 2), line(5, 1, 8), line(5, 2, 9)])
        text = self.report()
        self.assertIn("median of 3", text)
        self.assertIn("| 8x8 1 | 0 | 4 | 2 | 2 × |", text)
        self.assertIn("| 8x8 1 | 5 | 8 | 10 | 0.8 × |", text)

    def test_report_of_large_scenes(self):
        self.measured("scenes", [{"real_time_factor": factor} for factor in (1.5, 2.5, 0.5, 0.75, 3, 4)])
        text = self.report()
        self.assertRegex(text, r"falling spheres[^|]*\| 1.5 × \| 2.5 × \|")
        self.assertRegex(text, r"poured[^|]*\| 0.5 × \| 0.75 × \|")
        self.assertRegex(text, r"bricks[^|]*\| 3 × \| 4 × \|")

    def test_report_of_environments(self):
        def line(who, rate, **more):
            return {"who": who, "case": "8x8 1", "steps_per_s": rate, **more}
        self.measured("python", [line("VectorEnv, 1", 20000, python_share=0.3, mib=1),
                                 line("VectorEnv, 64", 350000, python_share=0.02, mib=7),
                                 line("VectorEnv, 1024", 300000, python_share=0.02, mib=97),
                                 {"who": "Simulation", "case": "8x8 1", "save_us": 9, "restore_us": 10, "reset_us": 40},
                                 line("MuJoCo rollout", 5000)])
        text = self.report()
        self.assertIn("| VectorEnv, 1024 | 300000 |", text)
        self.assertIn("| MuJoCo rollout | 70 × |", text)
        self.assertIn("Python takes at most 2.0 %. 1024 worlds occupy 97 MiB (8x8 1).", text)
        self.assertIn("| reset | 40 |", text)

    def test_report_flags_different_results(self):
        def line(who, us, agrees):
            return {"benchmark": "arrays", "case": "W2 64", "who": who, "least_us": us, "median_us": us, "checksum_agrees": agrees}
        self.measured("arrays", [line("apron", 2, True), line("numpy", 9, False)])
        text = self.report()
        self.assertIn("**Results differ: numpy on W2 64.**", text)
        self.assertIn("| numpy | 4.5 × |", text)

    def test_report_of_instruction_sets_and_filters(self):
        def line(who, us):
            return {"benchmark": "arrays", "case": "W1 64", "who": who, "least_us": us, "median_us": us, "checksum_agrees": True}
        def filtered(case, who, us, **opencv):
            return {"benchmark": "filters", "case": case, "who": who, "least_us": us, **opencv}
        self.measured("arrays", [line("apron", 2), line("apron avx2", 4), line("halide avx2", 6),
                                 filtered("sobel", "apron avx2", 30, opencv_us=20), filtered("near", "apron avx2", 7)])
        text = self.report()
        self.assertIn("over ours for AVX2:\n\n|  | W1 |\n| --- | --- |\n| halide avx2 | 1.5 × |", text)
        self.assertIn("| opencv | 20 | – |", text)
        self.assertIn("| apron avx2 / opencv | 1.5 | – |", text)

    def test_invalid_arguments_report_one_line(self):
        for arguments, fact in ((["--only", "warp"], "warp"), (["--only", "none"], "nothing was measured yet")):
            status, _, err = self.run_program(BENCH, *arguments, "-o", "out")
            self.assertEqual(status, 2)
            self.assertEqual(len(err.strip().splitlines()), 1, err)
            self.assertIn(fact, err)


if __name__ == "__main__":
    unittest.main()
