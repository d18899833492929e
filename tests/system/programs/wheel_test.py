"""The wheel of scripts/wheel works on a system that has Python and nothing else."""
import os
import re
import shutil
import zipfile

from programs import *

WHEELS = sorted((ROOT / "build/dist").glob("smartsurf_apron-*manylinux*.whl"))
PIP = sorted(pathlib.Path("/usr/share/python-wheels").glob("pip-*.whl"))
# What every system with Python has; the first four belong to the C library.
SYSTEM = {"libc.so.6", "libm.so.6", "libdl.so.2", "libpthread.so.0", "librt.so.1", "ld-linux-x86-64.so.2", "libgcc_s.so.1", "libstdc++.so.6"}
BARE = ("libc6", "libgcc-s1", "libstdc++6", "zlib1g", "libexpat1", "python3.11-minimal", "libpython3.11-minimal", "libpython3.11-stdlib")


@unittest.skipUnless(WHEELS, "no wheel in build/dist: scripts/wheel builds one")
@unittest.skipUnless(PIP, "pip's wheel is not installed: scripts/setup --python")
class Wheel(ProgramTest):
    @classmethod
    def setUpClass(cls):
        cls._root = tempfile.TemporaryDirectory(prefix="smartsurf-root-")
        cls.root = pathlib.Path(cls._root.name)
        cls.prefix = cls.root / "opt"
        subprocess.run(["/usr/bin/python3", "-m", "pip", "install", "--quiet", "--no-index", "--no-deps", "--ignore-installed",
                        "--prefix", str(cls.prefix), str(WHEELS[-1])], check=True,
                       env={**os.environ, "PYTHONPATH": str(PIP[-1]), "PIP_DISABLE_PIP_VERSION_CHECK": "1"}, stderr=subprocess.DEVNULL)
        cls.packages = next(cls.prefix.rglob("smartsurf/__init__.py")).parents[1]
        cls.programs = next(cls.prefix.rglob("bin/smartsurf")).parent
        if os.geteuid() == 0:
            cls.make_bare_root()

    @classmethod
    def tearDownClass(cls):
        cls._root.cleanup()

    @classmethod
    def make_bare_root(cls):
        """Python's packages, and folders for shared memory and /proc: no fonts, no X11, no OpenGL."""
        for folder in ("proc", "dev/shm", "tmp", "usr/lib", "usr/lib64", "usr/bin"):
            (cls.root / folder).mkdir(parents=True)
        for name in ("bin", "lib", "lib64"):
            (cls.root / name).symlink_to(f"usr/{name}")
        for device in ("null", "zero", "urandom", "random", "full"):
            os.mknod(cls.root / "dev" / device, 0o666 | 0o020000, os.stat(f"/dev/{device}").st_rdev)
        listed = subprocess.run(["dpkg", "-L", *BARE], text=True, stdout=subprocess.PIPE, check=True).stdout.split()
        for file in sorted({os.path.realpath(os.path.dirname(f)) + "/" + os.path.basename(f) for f in listed}):
            if not os.path.isdir(file) and "/share/" not in file:
                there = cls.root / file.lstrip("/")
                there.parent.mkdir(parents=True, exist_ok=True)
                shutil.copy2(file, there, follow_symlinks=False)

    def bare(self, *command, **environment):
        """Runs a command of the wheel in the bare root."""
        program = "/" + str((self.programs / command[0]).relative_to(self.root))
        done = subprocess.run(["/usr/bin/unshare", "--mount", "--pid", "--fork", f"--root={self.root}", "--mount-proc", program,
                               *command[1:]], text=True, capture_output=True, timeout=PATIENCE, env=environment)
        return done.returncode, done.stdout, done.stderr

    def test_needs_the_system_s_c_and_cpp_libraries_alone(self):
        binaries = [p for p in self.prefix.rglob("*") if p.is_file() and p.read_bytes()[:4] == b"\x7fELF"]
        self.assertGreaterEqual(len(binaries), 6)
        for file in binaries:
            dynamic = subprocess.run(["readelf", "-d", str(file)], text=True, capture_output=True, check=True).stdout
            self.assertEqual(set(re.findall(r"\(NEEDED\).*\[(.*)\]", dynamic)) - SYSTEM, set(), file)
            self.assertNotRegex(dynamic, r"\((RPATH|RUNPATH)\)", file)
            self.assertFalse(os.fsencode(ROOT) in file.read_bytes(), f"{file} names the folder that it was built in")

    def test_notices_name_what_is_contained(self):
        named = set(re.findall(r"(?m)^(.*) \(.*; contained\)$", (self.packages / "smartsurf/THIRD-PARTY.txt").read_text()))
        contained = {"HDF5", "FreeType", "Pixman", "GLFW", "DejaVu fonts", "Open Asset Import Library"}
        self.assertEqual(named & (contained | {"Embree"}), contained)
        with zipfile.ZipFile(WHEELS[-1]) as wheel:
            self.assertEqual([n for n in wheel.namelist() if re.search("gnutls|krb5|ldap|curl|gmp", n)], [])

    def test_brings_each_experiment_of_the_gallery(self):
        share = next(self.prefix.rglob("share/smartsurf"))
        listed = [line.split("\t")[1] for line in (share / "gallery/gallery.tsv").read_text().splitlines()]
        self.assertGreater(len(listed), 40)
        for file in listed:
            status, _, err = self.run_program(str(self.programs / "smartsurf"), "check", str(share / file))
            self.assertEqual(status, 0, f"{file}: {err}")
            self.assertEqual((ROOT / "scripts" / file).with_suffix(".aps").exists(), (share / file).with_suffix(".aps").exists())

    @unittest.skipUnless(HAS_XVFB, "Xvfb is not installed")
    def test_sorts_in_a_window(self):
        display = Display()
        self.addCleanup(display.close)
        environment = {k: v for k, v in os.environ.items() if k != "PYTHONPATH"} | {"DISPLAY": display.name}
        done = subprocess.run([str(self.programs / "smartsurf"), "demo", "--close"], text=True, capture_output=True, timeout=PATIENCE,
                              env=environment)
        self.assertEqual(done.returncode, 0, done.stderr)
        self.assertRegex(done.stderr, r"sorted: ")

    @unittest.skipUnless(os.geteuid() == 0, "only root can change the root folder")
    def test_sorts_in_a_root_with_nothing_but_python(self):
        status, out, err = self.bare("smartsurf", "demo")
        self.assertEqual(status, 0, err)
        self.assertIn("DISPLAY is not set", out)
        self.assertRegex(err, r"\Asmartsurf: [^\n]*sorted: [^\n]*\n\Z")  # and no other message

    @unittest.skipUnless(os.geteuid() == 0, "only root can change the root folder")
    def test_draws_with_its_own_font(self):
        share = "/" + str(next(self.prefix.rglob("share/smartsurf")).relative_to(self.root))
        status, _, err = self.bare("smartsurf", "run", f"{share}/case-study/sort.lua", "--controller", f"{share}/case-study/sort.aps",
                                   "--ticks", "30", "--record", "/tmp/run.h5")
        self.assertEqual(status, 0, err)
        status, _, err = self.bare("smartsurf", "plot", "/tmp/run.h5", "--what", "trajectories", "-o", "/tmp/run.svg")
        self.assertEqual((status, err), (0, ""))
        self.assertGreater((self.root / "tmp/run.svg").read_text().count("<symbol"), 10)  # the letters

    @unittest.skipUnless(os.geteuid() == 0, "only root can change the root folder")
    def test_says_what_a_window_needs(self):
        (self.root / "tmp/p.aps").write_text("print(1)\n")
        for command in (("smartsurf", "demo"), ("apron", "run", "/tmp/p.aps", "--window")):
            status, _, err = self.bare(*command, DISPLAY=":99")
            self.assertEqual((status, err.count("\n")), (2, 1), err)
            self.assertIn("install the packages", err)

    def test_same_bits_as_the_build(self):
        hashes = []
        for program in (SMARTSURF, str(self.programs / "smartsurf")):
            stats = self.folder / "stats.json"
            status, _, err = self.run_program(program, "run", SORT_LUA, "--controller", SORT_APS, "--ticks", "90", "--stats", str(stats))
            self.assertEqual(status, 0, err)
            hashes.append(json.loads(stats.read_text())["state_hash"])
        self.assertEqual(*hashes)

    def test_python_packages(self):
        script = self.write("use.py", """
import numpy, smartsurf, apron, shm_protocol, sys
s = smartsurf.Simulation(smartsurf.task_file("smartsurf/Relocate-v0"), seed=3)
for _ in range(5): s.step()
apron.compile("!register(A)\\nA = north(A)\\n")
try: import gymnasium
except ImportError: sys.exit()
v = smartsurf.VectorEnv(smartsurf.task_file("smartsurf/Relocate-v0"), num_envs=2)
v.reset(seed=1)
""")
        venv = ROOT / "build/venv/bin/python3"
        python = str(venv) if venv.exists() else "/usr/bin/python3"
        done = subprocess.run([python, "-B", script], text=True, capture_output=True, timeout=PATIENCE,
                              env={**os.environ, "PYTHONPATH": str(self.packages)})
        self.assertEqual((done.returncode, done.stderr), (0, ""), done.stderr)


if __name__ == "__main__":
    unittest.main()
