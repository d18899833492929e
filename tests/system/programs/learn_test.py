"""scripts/learn: the searches run, and the learned programs are local and succeed on unseen seeds."""
import csv
import sys

from programs import *

LEARN = ROOT / "scripts/learn"
VENV = ROOT / "build/learn"
sys.path.insert(0, str(ROOT / "smartsurf/python"))
sys.path.insert(0, str(LEARN))
try:
    from tasks import TASKS
except ImportError:
    TASKS = {}


# Least successes of 12 runs, well below the rates of docs/learning.md.
LEAST = {"ball": 4, "box": 7, "sort": 9}


@unittest.skipUnless(TASKS, "NumPy is not installed")
class Learn(ProgramTest):
    def test_learned_programs_are_local_and_succeed(self):
        for task in TASKS.values():
            program = LEARN / f"policies/{task.name}.aps"
            for path in (program, task.controller):
                status, out, err = self.run_program(APRON, "check", "--profile", "local", str(path))
                self.assertEqual(status, 0, out + err)
            won = sum(metrics["success"] for metrics in task.evaluate(program, range(20001, 20013), SMARTSURF))
            self.assertGreaterEqual(won, LEAST[task.name], task.name)

    def test_cross_entropy_search_improves_its_policy(self):
        status, out, err = self.run_program(sys.executable, "-B", str(LEARN / "cem"), "box", "--generations", "3", "--candidates", "10",
                                            "--runs", "2", "--smartsurf", SMARTSURF, "-o", "box")
        self.assertEqual(status, 0, err)
        with open(self.folder / "box/curve.csv", newline="") as file:
            rows = list(csv.DictReader(file))
        self.assertEqual([row["episodes"] for row in rows], ["20", "40", "60"])
        self.assertTrue(all(float(row["elite_score"]) > float(row["mean_score"]) for row in rows))
        self.assertGreater(float(rows[-1]["elite_score"]), float(rows[0]["mean_score"]))
        self.assertEqual(self.run_program(APRON, "check", "--profile", "local", "box/policy.aps")[0], 0)

    @unittest.skipUnless(list(VENV.glob("lib/python3*/site-packages/stable_baselines3")), "no stable-baselines3: scripts/setup --learn")
    @unittest.skipUnless(list((BIN.parent / "python/smartsurf").glob("_core*")), "the Python package is not built")
    def test_ppo_trains_and_tests(self):
        done = subprocess.run([VENV / "bin/python", "-B", LEARN / "ppo", "ball", "--steps", "2048", "--worlds", "8", "--test", "1-4",
                               "-o", "ball"], cwd=self.folder, env={**os.environ, "PYTHONPATH": str(BIN.parent / "python")},
                              capture_output=True, text=True, timeout=PATIENCE)
        self.assertEqual(done.returncode, 0, done.stderr)
        runs = json.loads((self.folder / "ball/test.json").read_text())["runs"]
        self.assertEqual(len(runs), 4)
        self.assertTrue(all(-10 < metrics["score"] < 0 and metrics["success"] in (0, 1) for metrics in runs), runs)


if __name__ == "__main__":
    unittest.main()
