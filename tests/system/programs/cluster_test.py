"""scripts/cluster: the examples run on Dask, Ray, Optuna and Snakemake of build/cluster, and agree with scripts/sweep."""
import csv
import re
import shutil

from programs import *

CLUSTER = ROOT / "scripts/cluster"
VENV = ROOT / "build/cluster"


def needs(package):
    there = list(VENV.glob(f"lib/python3*/site-packages/{package}/__init__.py"))
    return unittest.skipUnless(there, f"{package} is not installed: scripts/setup --cluster")


class Cluster(ProgramTest):
    def on_cluster(self, program, *arguments):
        done = subprocess.run([VENV / "bin" / program, *arguments], cwd=self.folder, capture_output=True, text=True, timeout=PATIENCE,
                              env={**os.environ, "PYTHONPATH": str(ROOT / "smartsurf/python"), "SMARTSURF": SMARTSURF, "HOME": str(self.folder),
                                   "PYTHONDONTWRITEBYTECODE": "1", "RAY_USAGE_STATS_ENABLED": "0"})
        self.assertEqual(done.returncode, 0, done.stdout + done.stderr)
        return done.stdout

    def successes(self, seeds):
        """Share of dead pins, in percent → number of successes, by scripts/sweep."""
        status, _, err = self.run_program(str(ROOT / "scripts/sweep"), str(ROOT / "scripts/tasks/relocate.lua"), "--controller",
                                          str(ROOT / "scripts/tasks/relocate.aps"), "--until", "30", "--seeds", f"1-{seeds}",
                                          "--set", "dead=0,0.05,0.2", "--smartsurf", SMARTSURF)
        self.assertEqual(status, 0, err)
        with open(self.folder / "out/sweep/summary.csv", newline="") as file:
            return [round(float(row["success_rate"]) * seeds) for row in csv.DictReader(file)]

    @needs("distributed")
    def test_dask(self):
        out = self.on_cluster("python", str(CLUSTER / "dask_sweep.py"), "--seeds", "3")
        self.assertEqual([int(n) for n in re.findall(r": (\d) of 3 succeed", out)], self.successes(3))

    @needs("ray")
    def test_ray(self):
        out = self.on_cluster("python", str(CLUSTER / "ray_sweep.py"), "--seeds", "3")
        self.assertEqual([int(n) for n in re.findall(r": (\d) of 3 succeed", out)], self.successes(3))

    @needs("optuna")
    def test_optuna(self):
        words = (str(CLUSTER / "optuna_search.py"), "--trials", "2", "--storage", f"sqlite:///{self.folder}/study.db")
        self.assertRegex(self.on_cluster("python", *words), r"^after 2 trials: [\d.]+ u/s with amplitude")
        self.assertRegex(self.on_cluster("python", *words), "^after 4 trials")

    @needs("snakemake")
    def test_snakemake(self):
        words = ("-s", str(CLUSTER / "Snakefile"), "-d", "flow", "--cores", "2", "--quiet", "--config", "seeds=2", "dead=0.2")
        self.on_cluster("snakemake", *words)
        with open(self.folder / "flow/success.csv", newline="") as file:
            (row,) = csv.DictReader(file)
        self.assertEqual(float(row["success_rate"]) * 2, self.successes(2)[2])

    @needs("pyarrow")
    def test_parquet(self):
        table = self.write("table.lua", "surface { rows = 4, columns = 4, actuator = pin {} }\nlocal n = option('n', 1)\n"
                                        "on_finish(function() metric('double', 2 * n) metric('half', n / 2) end)\n")
        self.on_cluster("python", str(ROOT / "scripts/sweep"), table, "--smartsurf", SMARTSURF, "--until", "0.1", "--set",
                        "n=1,3", "--format", "csv,parquet", "-o", "out")
        shown = self.on_cluster("python", "-c", "import json, pyarrow.parquet as p; t = p.read_table('out/results.parquet'); "
                                "print(t['n'].to_pylist(), t['seed'].to_pylist(), t['double'].to_pylist(), t['half'].to_pylist(), "
                                "json.loads(t.schema.metadata[b'smartsurf.provenance'])['version'].split()[0])")
        self.assertEqual(shown, "[1.0, 3.0] [1, 1] [2.0, 6.0] [0.5, 1.5] smartsurf\n")

    def test_parquet_without_library_reports_one_line(self):
        table = self.write("table.lua", "surface { rows = 4, columns = 4, actuator = pin {} }\n")
        done = subprocess.run(["/usr/bin/env", "-i", shutil.which("python3", path="/usr/bin"), "-I", str(ROOT / "scripts/sweep"), table,
                               "--smartsurf", SMARTSURF, "--format", "parquet"], cwd=self.folder, capture_output=True, text=True)
        if done.returncode == 0:
            self.skipTest("the system's Python has pyarrow")
        self.assertEqual((done.returncode, done.stderr), (2, "sweep: --format parquet: needs pyarrow: pip install pyarrow\n"))

    def test_apptainer_recipe_names_what_is_there(self):
        recipe = (CLUSTER / "smartsurf.def").read_text()
        sections = re.findall(r"^%(\w+)\n((?:    .*\n|\n)*)", recipe, re.MULTILINE)
        self.assertEqual([name for name, _ in sections], ["files", "post", "environment", "test", "runscript"])
        for name, text in sections:
            if name != "files":
                done = subprocess.run(["sh", "-n"], input=text, capture_output=True, text=True)
                self.assertEqual(done.returncode, 0, f"%{name}: {done.stderr}")
        for path in re.findall(r"(?:/opt/smartsurf/|\s)((?:scripts|smartsurf|shm-protocol)(?:/[\w/.-]*\w)?)(?!\w)", recipe):
            self.assertTrue((ROOT / path).exists(), path)
        if not shutil.which("apptainer"):
            self.skipTest("apptainer is not installed: the recipe is read, not built")


if __name__ == "__main__":
    unittest.main()
