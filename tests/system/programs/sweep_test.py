"""scripts/sweep: each grid point runs once, results form one table, interrupted sweeps resume."""
import csv
import shutil

from programs import *

SWEEP = str(ROOT / "scripts/sweep")

TABLE = """
local weight, seed_digit = option('weight', 1.0, 'a number'), random(0, 1)
surface { rows = 4, columns = 4, actuator = pin {} }
if weight < 0 then error('no such weight') end
on_finish(function() metric('product', weight * 10) metric('chance', seed_digit) end)
"""


@unittest.skipUnless(shutil.which("parallel"), "GNU parallel is not installed")
class Sweep(ProgramTest):
    def sweep(self, *arguments):
        return self.run_program(SWEEP, self.experiment, "--smartsurf", SMARTSURF, "--until", "0.1", "-o", "out",
                                *arguments)

    def setUp(self):
        super().setUp()
        self.experiment = self.write("table.lua", TABLE)

    def results(self):
        with open(self.folder / "out/results.csv", newline="") as file:
            return list(csv.DictReader(file))

    def test_every_point_has_a_row(self):
        status, out, err = self.sweep("--set", "weight=1,2.5", "--seeds", "1-2,7")
        self.assertEqual(status, 0, out + err)
        rows = self.results()
        self.assertEqual([(r["weight"], r["seed"], r["exit_status"], float(r["product"])) for r in rows],
                         [("1", "1", "0", 10), ("1", "2", "0", 10), ("1", "7", "0", 10),
                          ("2.5", "1", "0", 25), ("2.5", "2", "0", 25), ("2.5", "7", "0", 25)])
        # Random numbers depend on the seed only, not on options.
        self.assertEqual(len({r["chance"] for r in rows}), 3)
        self.assertEqual(rows[0]["chance"], rows[3]["chance"])

    def test_reruns_only_unfinished_and_failed_points(self):
        self.assertEqual(self.sweep("--set", "weight=1", "--seeds", "1-3")[0], 0)
        runs = self.folder / "out/runs"
        (runs / "weight=1,seed=1/status").unlink()          # as if interrupted
        (runs / "weight=1,seed=2/status").write_text("1")   # as if failed
        untouched = (runs / "weight=1,seed=3/stats.json").stat().st_mtime_ns
        status, out, err = self.sweep("--set", "weight=1", "--seeds", "1-3")
        self.assertEqual(status, 0, err)
        self.assertIn("3 runs, 1 done before", out)
        self.assertEqual(untouched, (runs / "weight=1,seed=3/stats.json").stat().st_mtime_ns)
        self.assertEqual([r["exit_status"] for r in self.results()], ["0", "0", "0"])

    def test_reruns_points_after_changes(self):
        self.write("shared.lua", "return 10")
        self.write("table.lua", TABLE.replace("weight * 10", "weight * require('shared')"))
        self.assertEqual(self.sweep("--set", "weight=1,2")[0], 0)
        self.assertIn("2 runs, 2 done before", self.sweep("--set", "weight=1,2")[1])
        self.write("shared.lua", "return 100")   # required by the experiment
        status, out, err = self.sweep("--set", "weight=1,2")
        self.assertEqual(status, 0, err)
        self.assertIn("2 runs, 0 done before", out)
        self.assertEqual([float(r["product"]) for r in self.results()], [100, 200])

    def sbatch(self, text):
        """Installs the text as sbatch and returns an environment that finds it."""
        (self.folder / "bin").mkdir(exist_ok=True)
        path = self.folder / "bin/sbatch"
        path.write_text(text)
        path.chmod(0o755)
        return {**os.environ, "PATH": f"{self.folder / 'bin'}:{os.environ['PATH']}"}

    def on_slurm(self, environment, *arguments):
        done = subprocess.run([SWEEP, self.experiment, "--smartsurf", SMARTSURF, "--until", "0.1", "-o", "out",
                               "--slurm=--time=10", *arguments], cwd=self.folder, env=environment, capture_output=True,
                              text=True, timeout=60)
        return done.returncode, done.stdout, done.stderr

    def test_slurm_array_runs_each_point_once(self):
        environment = self.sbatch("""#!/bin/sh
# Like Slurm, reads the script from standard input and runs it once per array task.
script=$(mktemp) && cat >"$script"
for word in "$@"; do case $word in --array=1-*) last=${word#--array=1-} ;; esac; done
for task in $(seq "$last"); do SLURM_ARRAY_TASK_ID=$task sh "$script"; done
rm "$script"
echo 4711
""")
        status, out, err = self.on_slurm(environment, "--set", "weight=1,2", "--seeds", "1-2")
        self.assertEqual(status, 0, err)
        self.assertIn("job 4711: 4 runs", out)
        status, out, err = self.on_slurm(environment, "--set", "weight=1,2", "--seeds", "1-2")
        self.assertEqual(status, 0, err)
        self.assertIn("4 runs, 4 done before", out)
        self.assertEqual([(r["weight"], r["seed"], float(r["product"])) for r in self.results()],
                         [("1", "1", 10), ("1", "2", 10), ("2", "1", 20), ("2", "2", 20)])

    def test_slurm_errors_report_one_line(self):
        environment = self.sbatch("#!/bin/sh\necho 'sbatch: error: invalid partition specified: x' >&2\nexit 1\n")
        status, _, err = self.on_slurm(environment)
        self.assertEqual(status, 2)
        self.assertEqual(err, "sweep: --slurm: sbatch refuses the job: sbatch: error: invalid partition specified: x\n")

    def test_failing_point_is_named_and_others_are_kept(self):
        status, _, err = self.sweep("--set", "weight=1,-1", "--seeds", "1")
        self.assertEqual(status, 1)
        self.assertIn("weight=-1,seed=1", err)
        self.assertIn("no such weight", err)
        self.assertEqual([r["exit_status"] for r in self.results()], ["0", "2"])

    @unittest.skipUnless(shutil.which("gnuplot"), "gnuplot is not installed")
    def test_plot_shows_metric(self):
        status, _, err = self.sweep("--set", "weight=1,2,3", "--seeds", "1-2", "--y", "product")
        self.assertEqual(status, 0, err)
        drawing = (self.folder / "out/results.svg").read_text()
        self.assertIn("product", drawing)
        self.assertIn("median", drawing)

    def test_invalid_arguments_report_one_line(self):
        for arguments, message in (
                (("--seeds", "3-1"), "sweep: --seeds 3-1: must be like 1-10 or 1,2,5"),
                (("--set", "weight"), "sweep: --set weight: must be NAME=VALUE or NAME=VALUE,VALUE,…"),
                (("--jobs", "0"), "sweep: --jobs 0: must be a whole number from 1"),
                (("--set", "weigth=1"), "did you mean 'weight'?"),
                (("--x", "size"), "sweep: --x size: must be seed or one of the options of --set (none given)")):
            status, _, err = self.sweep(*arguments)
            self.assertEqual(status, 2, arguments)
            self.assertIn(message, err)
            self.assertEqual(len(err.strip().splitlines()), 1, err)


if __name__ == "__main__":
    unittest.main()
