"""Nothing is loaded from the current folder: neither shared objects nor Python modules."""
import platform
import re
import shutil
import sys

from programs import *

# Besides the standard library's.
MODULES = ("apron", "gymnasium", "h5py", "mcap", "mcap_ros2", "numpy", "onnx", "onnxruntime", "packaging", "pettingzoo", "pxr", "rerun",
           "scipy", "shm_protocol", "sitecustomize", "smartsurf", "tensorboard", "torch", "typing_extensions", "usercustomize")
CMAKE = os.environ.get("SMARTSURF_CMAKE", "cmake")


def elf_files(*folders):
    """Programs and shared objects, each once."""
    found = {}
    for folder in folders:
        for path in folder.rglob("*"):
            if path.is_file() and "CMakeFiles" not in path.parts:
                with open(path, "rb") as file:
                    if file.read(4) == b"\x7fELF":
                        found[path.resolve()] = path
    return sorted(p for p in found if not p.name.endswith(".o"))


def dynamic_section(path):
    return subprocess.run(["readelf", "-d", str(path)], text=True, capture_output=True, check=True,
                          env={**os.environ, "LC_ALL": "C"}).stdout


def bad_run_paths(files):
    """Elements of run paths that are empty or relative to the current folder."""
    bad = []
    for file in files:
        for kind, paths in re.findall(r"\((RPATH|RUNPATH)\).*\[(.*)\]", dynamic_section(file)):
            bad += [f"{file}: {kind} '{paths}'" for element in paths.split(":")
                    if not element.startswith(("/", "$ORIGIN/", "${ORIGIN}/")) and element != "$ORIGIN"]
    return bad


def missing_hardening(file):
    """What the file has not of stack protectors, FORTIFY and control-flow protection."""
    symbols = subprocess.run(["readelf", "--dyn-syms", "-W", str(file)], text=True, capture_output=True, check=True).stdout
    missing = [] if "__stack_chk_fail" in symbols else ["stack protector"]
    missing += [] if re.search(r"__\w+_chk@", symbols.replace("__stack_chk_fail@", "")) else ["FORTIFY"]
    if platform.machine() == "x86_64" and file.read_bytes().count(b"\xf3\x0f\x1e\xfa") < 3:  # endbr64
        missing.append("control-flow protection")
    return missing


class Loading(ProgramTest):
    def test_release_builds_are_hardened(self):
        self.assertEqual(missing_hardening(BIN / "hardening_probe"), [])
        bare = self.folder / "bare"
        subprocess.run(["cc", "-O2", "-U_FORTIFY_SOURCE", "-fno-stack-protector", "-o", bare,
                        *(["-fcf-protection=none"] if platform.machine() == "x86_64" else []),
                        ROOT / "tests/system/programs/hardening_probe.c"], check=True)
        self.assertIn("stack protector", missing_hardening(bare))
        self.assertIn("FORTIFY", missing_hardening(bare))
        if "SMARTSURF_HARDEN:BOOL=ON" in (BIN.parent / "CMakeCache.txt").read_text():
            for file in [BIN / "smartsurf", BIN / "apron", *BIN.parent.glob("lib/libsmartsurf.so")]:
                self.assertEqual(missing_hardening(file), [], file)

    @unittest.skipUnless(platform.machine() == "x86_64" and "SMARTSURF_HARDEN:BOOL=ON" in (BIN.parent / "CMakeCache.txt").read_text(),
                         "needs a build with control-flow protection")
    def test_programs_are_marked_for_control_flow_protection_where_the_system_is(self):
        """One object without the mark takes it from the program; the C library's startup files of Debian 12 have none."""
        def marks(file):
            text = subprocess.run(["readelf", "-n", str(file)], text=True, capture_output=True, env={**os.environ, "LC_ALL": "C"}).stdout
            return text.count("IBT, SHSTK")
        for archive in BIN.parent.rglob("*.a"):
            members = subprocess.run(["ar", "t", str(archive)], text=True, capture_output=True, check=True).stdout.split()
            self.assertEqual(marks(archive), len(members), archive)
        subprocess.run(["cc", "-fcf-protection=full", "-o", self.folder / "plain", "-x", "c", "-"], input="int main(void) { return 0; }",
                       text=True, check=True)
        for name in ("smartsurf", "apron"):
            self.assertEqual(marks(BIN / name), marks(self.folder / "plain"), name)

    def test_built_and_installed_files_have_no_relative_run_path(self):
        prefix = self.folder / "prefix"
        subprocess.run([CMAKE, "--install", str(BIN.parent), "--prefix", str(prefix)], check=True, stdout=subprocess.DEVNULL)
        # The wheel holds the installed component named python.
        built = elf_files(BIN, *BIN.parent.glob("lib*"), BIN.parent / "python")
        installed = elf_files(prefix)
        self.assertGreater(len(built), 6)
        self.assertGreater(len(installed), 6)
        self.assertEqual(bad_run_paths(built + installed), [])

    def test_loaded_code_is_read_only(self):
        # Position-independent, with full RELRO, and without an executable stack.
        prefix = self.folder / "prefix"
        subprocess.run([CMAKE, "--install", str(BIN.parent), "--prefix", str(prefix)], check=True, stdout=subprocess.DEVNULL)
        for file in elf_files(prefix, BIN.parent / "python"):
            program = subprocess.run(["readelf", "-lW", "-h", str(file)], text=True, capture_output=True, check=True,
                                     env={**os.environ, "LC_ALL": "C"}).stdout
            self.assertRegex(program, r"Type: +DYN", file)
            self.assertIn("GNU_RELRO", program, file)
            self.assertRegex(program, r"GNU_STACK .* RW ", file)
            self.assertRegex(dynamic_section(file), r"BIND_NOW|FLAGS_1.*NOW", file)

    def test_programs_load_no_library_of_the_current_folder(self):
        for name in ("smartsurf", "apron", "shm_dump", "fake_surface", "surface_bridge", "device_emulator"):
            program = BIN / name
            if not program.exists():
                continue
            for library in re.findall(r"\(NEEDED\).*\[(.*)\]", dynamic_section(program)):
                (self.folder / library).write_text("not a library\n")
            status, out, err = self.run_program(str(program), "--help")
            self.assertEqual(status, 0, f"{name}: {out}{err}")

    def plant_modules(self):
        """Modules of every name that Python might import; those that are imported leave their names in `imported`."""
        for module in (*sys.stdlib_module_names, *MODULES):  # `encodings` is imported before there is open()
            self.write(f"{module}.py", f"import posix\nposix.write(posix.open({str(self.folder / 'imported')!r}, posix.O_WRONLY | posix.O_CREAT | "
                       f"posix.O_APPEND, 0o600), b'{module}\\n')\n")

    def imported(self, *command, **environment):
        """Of these modules, what the command has imported; and what it said."""
        (self.folder / "imported").unlink(missing_ok=True)
        kept = {k: v for k, v in os.environ.items() if k not in ("PYTHONPATH", "PYTHONSAFEPATH", "SMARTSURF_PYTHON")}
        child = subprocess.Popen([str(word) for word in command], cwd=self.folder, env=kept | environment, text=True,
                                 stdout=subprocess.PIPE, stderr=subprocess.STDOUT)
        self.children.append(child)
        _, out, _ = self.finish(child)
        found = self.folder / "imported"
        return sorted(set(found.read_text().split())) if found.exists() else [], out

    def test_planted_modules_would_be_seen(self):
        self.plant_modules()
        names, _ = self.imported(sys.executable, "-c", "import numpy, runpy")
        self.assertIn("numpy", names)

    def test_doctor_imports_nothing_of_the_current_folder(self):
        self.plant_modules()
        doctor = shutil.copy(ROOT / "scripts/doctor", self.folder / "doctor")
        # Python before 3.11 does not know PYTHONSAFEPATH.
        doctor.write_text(doctor.read_text().replace("PYTHONSAFEPATH", "UNKNOWN"))
        for environment in ({}, {"PYTHONPATH": "/nowhere"}, {"PYTHONPATH": "/nowhere:"}, {"PYTHONPATH": ".:/nowhere"}):
            names, out = self.imported(doctor, **environment)
            self.assertEqual(names, [], out)

    @needs_call_numbers
    def test_doctor_sees_a_container_that_refuses_what_confines(self):
        for calls, environment, told in ((("prctl",), {}, "WRONG prctl"), (("prctl",), {"SMARTSURF_CONFINE": "off"}, ""),
                                         (("setrlimit", "prlimit64"), {}, "WRONG limits"), (("prlimit64",), {"SMARTSURF_CONFINE": "off"}, ""),
                                         (("landlock_create_ruleset",), {}, "note  landlock"), (("seccomp",), {}, "note  seccomp")):
            doctor = subprocess.run([ROOT / "scripts/doctor"], preexec_fn=refusing(*calls), env=os.environ | environment,
                                    cwd=self.folder, capture_output=True, text=True)
            # Lines about confinement that report something missing.
            lines = re.findall(r"^  (?:WRONG|note ) (?:prctl|limits|landlock|seccomp)", doctor.stdout, re.MULTILINE)
            self.assertEqual([line.strip() for line in lines], [told] if told else [], doctor.stdout)

    @unittest.skipUnless((BIN.parent / "python/smartsurf/__init__.py").exists(), "needs the Python package")
    def test_statements_in_python_import_nothing_of_the_current_folder(self):
        self.write("table.lua", "surface { rows = 4, columns = 4, actuator = pin {}, sensors = { proximity {} } }\nepisode { seconds = 0.1 }\n"
                   "reward(function() return 0 end)\n")
        self.run_program(SMARTSURF, "run", "table.lua", "--no-controller", "--ticks", "3", "--record", "run.h5")
        self.write("model.onnx", "no model")
        self.plant_modules()
        statements = [("train", "table.lua", "-o", "out", "--iterations", 1, "--candidates", 2, "--runs", 1),
                      ("train", "table.lua", "-o", "out", "--iterations", 1, "--method", "ppo", "--worlds", 1),
                      ("identify", "run.h5", "--experiment", "table.lua", "-o", "identified.lua"), ("fmu", "table.lua", "-o", "table.fmu"),
                      *(("export", "run.h5", "-o", f"run.{extension}") for extension in ("usda", "usd", "rrd", "mcap")),
                      ("run", "table.lua", "--controller", "model.onnx", "--ticks", 1)]
        # The build's interpreter, which may have only what the package needs, and those with what the statements import later.
        for python in (None, ROOT / "build/venv/bin/python", ROOT / "build/formats/bin/python"):
            if python and not python.exists():
                continue
            for number, statement in enumerate(statements):
                apart = {}, {"PYTHONPATH": "/nowhere:"}, {"PYTHONPATH": ".:/nowhere"}
                for path in apart if number == 0 else ({"PYTHONPATH": ".:/nowhere:"},):
                    names, out = self.imported(SMARTSURF, *statement, **path, **({"SMARTSURF_PYTHON": str(python)} if python else {}))
                    self.assertEqual(names, [], (python, path, statement, out))
                self.assertNotIn("needs the Python package smartsurf", out)

    def test_sweeps_import_nothing_of_the_current_folder(self):
        self.write("table.lua", "surface { rows = 4, columns = 4, actuator = pin {} }\n")
        self.plant_modules()
        names, out = self.imported(ROOT / "scripts/sweep", "table.lua", "--smartsurf", SMARTSURF, "--until", "0.1", "-o", "out")
        self.assertEqual(names, [], out)
        self.assertTrue((self.folder / "out/results.csv").exists(), out)

    def test_sweeps_on_slurm_import_nothing_of_the_current_folder(self):
        table = self.write("table.lua", "surface { rows = 4, columns = 4, actuator = pin {} }\n")
        sbatch = self.folder / "bin/sbatch"
        sbatch.parent.mkdir()
        # Python before 3.11 does not know PYTHONSAFEPATH.
        sbatch.write_text("#!/bin/sh\nsed s/PYTHONSAFEPATH/UNKNOWN/ >script\nSLURM_ARRAY_TASK_ID=1 sh script\necho 4711\n")
        sbatch.chmod(0o755)
        self.plant_modules()
        names, out = self.imported(ROOT / "scripts/sweep", table, "--smartsurf", SMARTSURF, "--until", "0.1", "-o", "out", "--slurm=",
                                   PATH=f"{sbatch.parent}:{os.environ['PATH']}")
        self.assertEqual(names, [], out)
        self.assertTrue((self.folder / "out/runs/seed=1/status").exists(), out)


if __name__ == "__main__":
    unittest.main()
