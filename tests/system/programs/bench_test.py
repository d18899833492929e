"""scripts/bench: the report presents the measurements."""
import argparse
import shutil
import sys
import unittest.mock
from importlib.machinery import SourceFileLoader

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
                    "sensors_ms": sensors, "cpu_ms": 7.5, "overlap_u": 0.02, "in_pins_u": 0.25, "lost": 0}
        self.measured("physics", [line("8x8 1", "ours", 0.25, 0.75), line("8x8 1", "naive", 2, 10), line("9x9 2", "ours", 1, 1),
                                  dict(line("8x8 1", "ours", 0.2, 0.4), threads=2)])
        text = self.report()
        self.assertIn("| processor | abacus, 2 cores |", text)
        self.assertIn("| naive | 2/10 | – |", text)
        self.assertIn("Over ours: ours, 2 threads 0.6; naive 12.", text)
        self.assertIn("| ours | 7.5 | 7.5 |", text)
        self.assertIn("No peer is ahead of ours here.", text)
        self.assertIn("| ours | 0.020/0.250 | 0.020/0.250 |", text)
        self.assertIn("(bench-physics.svg)", text)
        self.assertIn("</svg>", (self.folder / "out/bench-physics.svg").read_text())

    def test_report_of_threads_beside_busy_programs(self):
        def line(beside, threads, wall, twin=False):
            return {"benchmark": "physics", "case": "8x8 1", "who": "ours", "threads": threads, "beside": beside, "wall_ms": wall,
                    "cpu_ms": threads, "twin": twin}
        self.measured("threads", [line(0, 1, 4), line(0, 2, 2), line(0, 1, 5, True), line(5, 1, 8), line(5, 2, 10),
                                  line(0, 1, 4), line(0, 2, 2), line(0, 1, 5, True), line(5, 1, 9), line(5, 2, 99),
                                  line(0, 1, 8), line(0, 2, 2), line(0, 1, 9, True), line(5, 1, 8), line(5, 2, 9)])
        text = self.report()
        self.assertIn("median of 3", text)
        self.assertIn("| 8x8 1 | 0 | 4 | 2 | 2 | 1.6 | 1 | 2 |", text)
        self.assertIn("| 8x8 1 | 5 | 8 | 10 | 0.8 | – | 1 | 2 |", text)

    def test_report_of_large_scenes(self):
        self.measured("scenes", [{"real_time_factor": factor} for factor in (1.5, 2.5, 0.5, 0.75, 3, 4)])
        text = self.report()
        self.assertRegex(text, r"falling spheres[^|]*\| 1.5 \| 2.5 \|")
        self.assertRegex(text, r"poured[^|]*\| 0.5 \| 0.75 \|")
        self.assertRegex(text, r"bricks[^|]*\| 3 \| 4 \|")

    def test_report_of_hardening(self):
        def line(hardened, physics, arrays):
            return [{"benchmark": "physics", "case": "8x8 1", "who": "ours", "cpu_ms": physics, "hardened": hardened},
                    {"benchmark": "arrays", "case": "W1 8", "who": "apron", "least_us": arrays, "hardened": hardened},
                    {"benchmark": "arrays", "case": "W1 8", "who": "apron, 2 threads", "least_us": 99, "hardened": hardened}]
        self.measured("hardening", line(True, 3, 1) + line(False, 2, 2) + line(True, 2.5, 1) + line(False, 2, 8) + line(True, 9, 1) + line(False, 9, 1.25))
        text = self.report()
        self.assertIn("the least of 3", text)
        self.assertIn("| 8x8 1, ms a step | 2.5 | 2 | +25.0 % |", text)
        self.assertIn("| W1 8, µs a run | 1 | 1.25 | -20.0 % |", text)

    def test_report_of_environments(self):
        def line(who, rate, threads=1, **more):
            return {"who": who, "case": "8x8 1", "threads": threads, "steps_per_s": rate, "steps_per_cpu_s": rate / threads, **more}
        self.measured("python", [line("VectorEnv, 1", 20000, python_share=0.3, mib=1),
                                 line("VectorEnv, 64", 350000, python_share=0.02, mib=7),
                                 line("VectorEnv, 1024", 300000, python_share=0.02, mib=97),
                                 line("MuJoCo", 5000, options="CG, elliptic"), line("MuJoCo, 1 step", 700000),
                                 line("VectorEnv, 64", 400000, threads=2, python_share=0.02, mib=7),
                                 line("MuJoCo", 8000, threads=2, options="CG, elliptic"),
                                 {"who": "Simulation", "case": "8x8 1", "save_us": 9, "restore_us": 10, "reset_us": 40},
                                 {"who": "attach", "case": "8x8 1", "steps_per_s": 9}])
        text = self.report()
        self.assertIn("| VectorEnv, 1024 | 300000 |", text)
        self.assertIn("VectorEnv, 64 over peers: MuJoCo 70; MuJoCo, 1 step 0.5.", text)
        self.assertIn("**Ahead of VectorEnv, 64**: MuJoCo, 1 step (8x8 1).", text)
        self.assertIn("VectorEnv, 64, 2 threads over peers: MuJoCo, 2 threads 50.\n\nNo peer is ahead of VectorEnv, 64, 2 threads here.", text)
        self.assertIn("| VectorEnv, 64, 2 threads | 200000 |", text)  # a second of processor time
        self.assertIn("in a trial (CG, elliptic)", text)
        self.assertIn("Python accounts for at most 2.0 % of a step of 64 or 1024 worlds.", text)
        self.assertIn("| MiB | 97 |", text)
        self.assertIn("| reset | 40 |", text)

    def test_report_of_wheels_says_where_a_peer_is_ahead(self):
        def line(who, case, ms, **more):
            return {"who": who, "case": case, "ms": ms, **more}
        self.measured("wheels", [line("ours", "swirl 9", 0.5), line("MuJoCo, a box a cell", "swirl 9", 2, options="CG, pyramidal"),
                                 line("ours", "belt 9", 1), line("MuJoCo, a box a cell", "belt 9", 0.98, options="CG, pyramidal"),
                                 line("MuJoCo, one belt", "belt 9", 0.75, options="Newton, elliptic")])
        text = self.report()
        self.assertIn("Over ours: MuJoCo, a box a cell 0.98 to 4; MuJoCo, one belt 0.75.", text)
        self.assertIn("**Ahead of ours**: MuJoCo, one belt (belt 9).", text)

    def test_page_needs_committed_sources_and_an_idle_machine(self):
        def bench(*arguments):
            return self.run_program(str(self.folder / "tree/scripts/bench"), "--page", "--only", "none", *arguments)
        self.measured("study", [{"real_time_factor": 2, "ms_per_tick": {"wait": {"median": 1}}}])
        tree = self.folder / "tree"
        for name in ("scripts/bench", "docs/performance.md"):
            (tree / name).parent.mkdir(parents=True, exist_ok=True)
            shutil.copy(ROOT / name, tree / name)
        (tree / "smartsurf").symlink_to(ROOT / "smartsurf")
        git = ["git", "-C", str(tree), "-c", "user.name=n", "-c", "user.email=e"]
        for command in (["init", "-q"], ["add", "."], ["commit", "-qm", "all"]):
            subprocess.run(git + command, check=True)
        shutil.copytree(self.folder / "out", tree / "out/bench")
        (tree / ".git/info/exclude").write_text("out\n")
        status, out, err = bench()
        self.assertEqual(status, 0, out + err)
        self.assertIn("Measured 2001-02-03", (tree / "docs/performance.md").read_text())
        status, out, err = bench()  # the page itself may differ
        self.assertEqual(status, 0, out + err)
        (tree / "new.cpp").write_text("")
        status, _, err = bench()
        self.assertEqual((status, len(err.splitlines())), (2, 1), err)
        self.assertIn("changes are not committed: new.cpp", err)
        self.assertEqual(bench("--force")[0], 0)
        (tree / "new.cpp").unlink()
        kept = json.loads((tree / "out/bench/study.json").read_text())
        kept["machine"]["commit"] = "abc-dirty"
        (tree / "out/bench/study.json").write_text(json.dumps(kept))
        status, _, err = bench()
        self.assertEqual((status, len(err.splitlines())), (2, 1), err)
        self.assertIn("study was measured with changes", err)

    def test_page_notices_busy_processes(self):
        bench = SourceFileLoader("bench", BENCH).load_module()
        self.start(sys.executable, "-c", "while True: pass")
        bench.SAMPLE_S = 0.5
        bench.slowdown = lambda: 0.0
        (fault,) = bench.faults_of_machine()
        self.assertIn("the machine is busy", fault)
        with self.assertRaisesRegex(bench.Mistake, "--force"):
            bench.refused([fault], argparse.Namespace(force=False))

    def test_page_notices_a_varying_speed(self):
        bench = SourceFileLoader("bench", BENCH).load_module()
        bench.use_by_others = lambda: 0.0
        for slow, faults in ((20, 0), (40, 1)):  # of the 300 pieces, which take half as long again as the others
            took = [1.5] * slow + [1.0] * (bench.PIECES - slow)
            clock = iter([t for piece in took for t in (0.0, piece)])
            with unittest.mock.patch.object(bench.time, "perf_counter", lambda: next(clock)):
                found = bench.faults_of_machine()
            self.assertEqual(len(found), faults, found)
        self.assertIn("a tenth of equal pieces of work take 50% longer than their median", found[0])

    def test_report_flags_different_results(self):
        def line(who, us, agrees):
            return {"benchmark": "arrays", "case": "W2 64", "who": who, "least_us": us, "median_us": us, "checksum_agrees": agrees}
        self.measured("arrays", [line("apron", 2, True), line("numpy", 9, False)])
        text = self.report()
        self.assertIn("**Results differ: numpy on W2 64.**", text)
        self.assertIn("| numpy / apron | 4.5 |", text)

    def test_report_of_instruction_sets_and_filters(self):
        def line(who, us):
            return {"benchmark": "arrays", "case": "W1 64", "who": who, "least_us": us, "median_us": us, "checksum_agrees": True}
        def filtered(case, who, us, **opencv):
            return {"benchmark": "filters", "case": case, "who": who, "least_us": us, **opencv}
        self.measured("arrays", [line("apron", 2), line("apron avx2", 4), line("halide avx2", 6),
                                 filtered("sobel", "apron avx2", 30, opencv_us=20), filtered("near", "apron avx2", 7)])
        text = self.report()
        self.assertIn("| halide avx2 / apron avx2 | 1.5 |", text)
        self.assertIn("| opencv | 20 | – |\n\n**Ahead of apron avx2**: opencv (sobel).", text)

    def test_report_of_kernels(self):
        def line(who, case, us, agrees=True):
            return {"benchmark": "kernels", "case": case, "who": who, "least_us": us, "agrees": agrees}
        self.measured("kernels", [line("apron", "sobel 64", 2), line("numpy", "sobel 64", 9), line("c++", "sobel 64", 3),
                                  line("apron", "life 64", 8), line("c++", "life 64", 4, False)])
        text = self.report()
        self.assertIn("| c++ / apron | 1.5 | 0.5 |\n\n**Ahead of apron**: c++ (life).", text)
        self.assertIn("**Results differ: c++ on life 64.**", text)

    def test_peers_of_the_kernels_agree(self):
        """At sizes of several vectors, of less than one, and between."""
        os.environ["PYTHONPATH"] = str(BIN.parent / "python")
        if self.run_program(sys.executable, "-c", "import apron")[0]:
            self.skipTest("needs the package apron and NumPy")
        status, out, err = self.run_program(sys.executable, "-B", str(ROOT / "tests/bench/bench_kernels.py"), "--json", "--sizes",
                                            "16,36,68", "--seconds", "0.001")
        self.assertEqual(status, 0, err)
        lines = [json.loads(line) for line in out.splitlines()]
        self.assertEqual([line for line in lines if not line["agrees"]], [])
        for who in ("apron", "c++"):
            self.assertEqual(len([line for line in lines if line["who"] == who]), 3 * 9, err)

    def test_invalid_arguments_report_one_line(self):
        for arguments, fact in ((["--only", "warp"], "warp"), (["--only", "none"], "nothing was measured yet")):
            status, _, err = self.run_program(BENCH, *arguments, "-o", "out")
            self.assertEqual(status, 2)
            self.assertEqual(len(err.strip().splitlines()), 1, err)
            self.assertIn(fact, err)


if __name__ == "__main__":
    unittest.main()
