"""scripts/cluster: the examples run on Dask, Ray, Optuna and Snakemake of build/cluster, and agree with scripts/sweep."""
import csv
import getpass
import pathlib
import platform
import re
import shutil
import socket
import time

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


# One node on the loopback interface, without the daemon for authentication.
SLURM_CONF = """
ClusterName=test
SlurmctldHost={host}(127.0.0.1)
SlurmctldPort={ports[0]}
SlurmdPort={ports[1]}
SlurmUser={user}
SlurmdUser={user}
AuthType=auth/none
CredType=cred/none
PluginDir={plugins}
StateSaveLocation={folder}/state
SlurmdSpoolDir={folder}/spool
SlurmctldPidFile={folder}/slurmctld.pid
SlurmdPidFile={folder}/slurmd.pid
ProctrackType=proctrack/pgid
TaskPlugin=task/none
SelectType=select/cons_tres
SelectTypeParameters=CR_Core
ReturnToService=2
NodeName={host} NodeAddr=127.0.0.1 CPUs={cores} State=UNKNOWN
PartitionName=all Nodes=ALL Default=YES State=UP
"""
SLURMCTLD, SLURMD = (shutil.which(name, path=os.environ["PATH"] + ":/usr/sbin") for name in ("slurmctld", "slurmd"))


@unittest.skipUnless(SLURMCTLD and SLURMD, "Slurm is not installed: apt-get install slurm-wlm")
class Slurm(ProgramTest):
    """scripts/sweep on the real scheduler."""

    def setUp(self):
        super().setUp()
        host = platform.node().split(".")[0]
        sockets = [socket.create_server(("127.0.0.1", 0)) for _ in range(2)]
        ports = [s.getsockname()[1] for s in sockets]
        for s in sockets:
            s.close()
        plugins = next(pathlib.Path(SLURMCTLD).parents[1].glob("lib/*/slurm-wlm"))
        for name in ("state", "spool"):
            (self.folder / name).mkdir()
        conf = self.write("slurm.conf", SLURM_CONF.format(host=host, ports=ports, user=getpass.getuser(), plugins=plugins,
                                                          folder=self.folder, cores=os.cpu_count()))
        self.environment = {**os.environ, "SLURM_CONF": str(self.folder / conf)}
        stepd = ["-d", shutil.which("slurmstepd", path=str(pathlib.Path(SLURMD).parent))]
        for command in ([SLURMCTLD, "-D"], [SLURMD, "-D", "-N", host, *stepd]):
            daemon = subprocess.Popen(command, env=self.environment, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
            self.addCleanup(daemon.wait)
            self.addCleanup(daemon.terminate)

    def until(self, command, expected):
        deadline = time.monotonic() + PATIENCE
        while (out := subprocess.run(command, env=self.environment, capture_output=True, text=True).stdout.strip()) != expected:
            self.assertLess(time.monotonic(), deadline, f"{command}: '{out}' instead of '{expected}'")
            time.sleep(0.3)

    def test_an_array_job_is_a_sweep(self):
        self.until(["sinfo", "-h", "-o", "%t"], "idle")
        sweep = [ROOT / "scripts/sweep", ROOT / "scripts/tasks/relocate.lua", "--controller", ROOT / "scripts/tasks/relocate.aps",
                 "--seeds", "1-4", "--until", "3", "--smartsurf", SMARTSURF, "-o", "sweep"]
        submitted = subprocess.run([*sweep, "--slurm=--time=5", "--chunk", "2", "--throttle", "1"], env=self.environment,
                                   cwd=self.folder, capture_output=True, text=True)
        self.assertEqual(submitted.returncode, 0, submitted.stderr)
        self.assertIn("4 runs in 2 array tasks", submitted.stdout)
        self.until(["squeue", "-h"], "")
        gathered = subprocess.run(sweep, env={**os.environ, "PATH": "/usr/bin:/bin"}, cwd=self.folder, capture_output=True, text=True)
        self.assertEqual(gathered.returncode, 0, gathered.stderr)
        self.assertIn("4 runs, 4 done before", gathered.stdout)
        with open(self.folder / "sweep/results.csv", newline="") as file:
            self.assertEqual([(row["seed"], row["exit_status"]) for row in csv.DictReader(file)], [(f"{k}", "0") for k in range(1, 5)])


if __name__ == "__main__":
    unittest.main()
