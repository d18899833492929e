#!/usr/bin/env python3
"""Extensions and the library, built outside the tree against an installed SmartSurf."""
import os
import pathlib
import re
import shutil
import subprocess
import sys
import tempfile

sys.path.insert(0, str(pathlib.Path(__file__).resolve().parents[1] / "programs"))
from programs import *

CMAKE = os.environ.get("SMARTSURF_CMAKE", "cmake")
CC, CXX = os.environ.get("CC", "cc"), os.environ.get("CXX", "c++")
STRICT = ["-std=c11", "-Wall", "-Wextra", "-Wpedantic", "-Werror"]


def extract(page, folder):
    """Writes every fenced block of the page whose first line is a comment with a file name, and copies the extensions that it
    names; the names."""
    text = (ROOT / page).read_text()
    names = re.findall(r"`scripts/extensions/([\w.]+)`", text)
    for name in names:
        shutil.copy(ROOT / "scripts/extensions" / name, folder)
    for block in re.findall(r"^```\w*\n(.*?)^```", text, re.DOTALL | re.MULTILINE):
        name = re.match(r"(?://|--|#) ([\w.]+\.(?:aps|c|cpp|lua|txt))\n", block)
        if name:
            (folder / name[1]).write_text(block)
            names.append(name[1])
    return names


def call(*command, **arguments):
    done = subprocess.run([*map(str, command)], capture_output=True, text=True, timeout=PATIENCE, **arguments)
    if done.returncode != 0:
        raise AssertionError(f"{' '.join(map(str, command))}\n{done.stdout}{done.stderr}")
    return done.stdout


class Installed(ProgramTest):
    """A prefix with the installed library, and the files of a page, built there."""
    PAGE = ""

    @classmethod
    def setUpClass(cls):
        cls._work = tempfile.TemporaryDirectory(prefix="smartsurf-outside-")
        cls.work = pathlib.Path(cls._work.name)
        cls.prefix = cls.work / "prefix"
        call(CMAKE, "--install", BIN.parent, "--prefix", cls.prefix, "--component", "library")
        cls.include = cls.prefix / "include/smartsurf"
        cls.library = next(cls.prefix.rglob("libsmartsurf.so"))
        cls.names = extract(cls.PAGE, cls.work)
        call(CMAKE, "-G", "Ninja", "-S", cls.work, "-B", cls.work / "built", f"-DCMAKE_PREFIX_PATH={cls.prefix}",
             f"-DCMAKE_C_COMPILER={CC}", f"-DCMAKE_CXX_COMPILER={CXX}", "-DCMAKE_BUILD_TYPE=Release",
             f"-DCMAKE_C_FLAGS={' '.join(STRICT)}", "-DCMAKE_CXX_FLAGS=-Wall -Wextra -Wpedantic -Werror")
        call(CMAKE, "--build", cls.work / "built")

    @classmethod
    def tearDownClass(cls):
        cls._work.cleanup()

    def run_simulator(self, command, file, *arguments, status=0):
        got, out, err = self.run_program(SMARTSURF, command, str(file), *map(str, arguments))
        self.assertEqual(got, status, out + err)
        return (out + err).strip()


class Extensions(Installed):
    PAGE = "docs/extending.md"

    def setUp(self):
        super().setUp()
        self.belt, self.speed = self.work / "built/belt.so", self.work / "built/speed.so"

    def test_belt_moves_a_box(self):
        out = self.run_simulator("run", self.work / "belt.lua", "--load", self.belt, "--no-controller", "--ticks", 90)
        east, north, _ = map(float, out.splitlines()[0].split())
        self.assertAlmostEqual(east, 3.0, delta=0.05)
        self.assertAlmostEqual(north, 0.0, delta=0.05)

    def test_sensor_measures_speed(self):
        out = self.run_simulator("run", self.work / "speed.lua", "--load", self.speed, "--no-controller", "--ticks", 8)
        standing, falling = map(float, out.splitlines()[0].split())
        self.assertEqual(standing, 0.0)
        self.assertAlmostEqual(falling, 9.81 * 0.1, delta=0.05)

    def test_a_module_is_built_with_the_installed_header(self):
        call(CC, *STRICT, "-shared", "-fPIC", f"-I{self.prefix}/include/apron", "-o", self.work / "example.so", self.work / "example.c", "-lm")
        self.assertEqual(self.run_program(APRON, "run", str(self.work / "example.aps"), "--module", "example"), (0, "5\n", ""))
        (self.work / "cut.so").write_bytes((self.work / "example.so").read_bytes()[:3000])
        (self.work / "cut.aps").write_text((self.work / "example.aps").read_text().replace("example", "cut"))
        status, _, err = self.run_program(APRON, "run", str(self.work / "cut.aps"), "--module", "cut")
        self.assertEqual(status, 2, err)
        self.assertIn("cut.so is cut short: it has 3000 bytes and needs ", err)

    def test_fields_are_checked_as_those_of_built_in_kinds(self):
        for text, message in (
                ("surface { actuator = belt { max_sped = 3 } }", "belt: unknown field 'max_sped' (did you mean 'max_speed'?)"),
                ("surface { actuator = belt { max_speed = -3 } }", "belt.max_speed = -3: must be in [0.001, 1000]"),
                ("surface { sensors = { speed { direction = {0, 0, 0} } } }", "speed.direction: must not be of length 0"),
                ("surface { sensors = { speed { name = 'a', noise = -1 } } }", "speed.noise = -1: must be in [0, 1000000]")):
            err = self.run_simulator("check", self.write("wrong.lua", text), "--load", self.belt, "--load", self.speed, status=2)
            self.assertIn(message, err)

    def test_faults_latency_and_noise_apply(self):
        script = """surface { rows = 8, columns = 16, actuator = belt { max_speed = 3, latency = %d }, sensors = { speed { noise = %g } } }
            faults { actuator = { dead = %d } }
            box { size = {2, 2, 1}, position = {3, 3.5, 0.5} }
            on_tick(function() for r = 1, 8 do for c = 1, 16 do cells:target('speed', r, c, 3) end end end)
            on_finish(function() print(cells:sense('speed', 5, 4) - cells:truth('speed', 5, 4), object(0):velocity()) end)"""

        def speed_and_error(latency, noise, dead, ticks=10):
            out = self.run_simulator("run", self.write("faults.lua", script % (latency, noise, dead)), "--load", self.belt,
                                     "--load", self.speed, "--no-controller", "--ticks", ticks)
            error, east, _, _ = map(float, out.splitlines()[0].split())
            return east, error
        self.assertGreater(speed_and_error(0, 0, 0)[0], 0.1)
        self.assertEqual(speed_and_error(0, 0, 0)[1], 0.0)
        self.assertAlmostEqual(speed_and_error(20, 0, 0)[0], 0.0, places=6)  # the commands have not arrived
        self.assertAlmostEqual(speed_and_error(0, 0, 1)[0], 0.0, places=6)   # all cells are dead
        self.assertNotEqual(speed_and_error(0, 0.5, 0)[1], 0.0)

    def test_a_script_loads_native_code_only_when_the_user_allows_it(self):
        script = self.work / "built/belt.lua"  # beside belt.so
        script.write_text((self.work / "belt.lua").read_text())
        err = self.run_simulator("check", script, status=2)
        self.assertRegex(err, r"belt.lua:2: extension 'belt.so': is not loaded, and a script may not load native code: give "
                              r"--load belt.so or --allow-extensions, or call load_extension\(\)$")
        self.run_simulator("check", script, "--allow-extensions")
        self.run_simulator("check", script, "--load", self.belt)
        self.run_simulator("run", script, "--unsafe", "--no-controller", "--ticks", 1)
        outside = self.write("outside.lua", f"extension '{self.belt}'\nsurface {{ actuator = belt {{}} }}")
        self.assertIn("extension", self.run_simulator("check", outside, "--allow-extensions", status=2))

    def test_names_of_other_things_are_not_replaced(self):
        text = (self.work / "belt.c").read_text().replace('.name = "belt"', '.name = "sphere"')
        (self.folder / "sphere.c").write_text(text)
        call(CC, "-shared", "-fPIC", f"-I{self.include}", "-o", self.folder / "sphere.so", self.folder / "sphere.c", "-lm")
        err = self.run_simulator("check", self.write("a.lua", "surface {}"), "--load", self.folder / "sphere.so", status=2)
        self.assertIn("the extension sphere.so adds 'sphere', which is the name of something else already", err)

    def test_a_recording_names_its_extension_and_is_verified(self):
        self.run_simulator("run", self.work / "belt.lua", "--load", self.belt, "--no-controller", "--ticks", 40, "--record", "b.h5")
        info = self.run_simulator("info", "b.h5")
        self.assertRegex(info, r"extensions +belt.so [0-9a-f]{16}\n")
        self.assertIn("pitch 1 u, belt\n", info)
        self.assertIn("identical in 41 frames", self.run_simulator("replay", "b.h5", "--verify", "--load", self.belt))
        self.assertIn("identical", self.run_simulator("replay", "b.h5", "--verify", "--load", self.belt, "--threads", 2))
        self.assertRegex(self.run_simulator("replay", "b.h5", "--verify", status=2),
                         r"^smartsurf: b.h5: cannot be run again: it needs the extension belt.so: give --load belt.so$")
        other = self.folder / "belt.so"
        other.write_bytes(self.belt.read_bytes() + b"\0")
        self.assertRegex(self.run_simulator("replay", "b.h5", "--verify", "--load", other, status=2),
                         r"recorded with an extension belt.so of hash [0-9a-f]{16}, and this one has [0-9a-f]{16}$")

    @unittest.skipUnless(os.environ.get("SMARTSURF_PACKAGE"), "the Python package is not built")
    def test_python_loads_saves_and_restores(self):
        code = f"""
import smartsurf
try:
    smartsurf.Simulation({str(self.work / 'belt.lua')!r})
    raise SystemExit("loaded without its extension")
except smartsurf.Error as error:
    assert "extension 'belt.so': is not loaded" in str(error), error
table = smartsurf.Simulation({str(self.work / 'belt.lua')!r}, extensions=[{str(self.belt)!r}])
smartsurf.load_extension({str(self.belt)!r})
for tick in range(20):
    table.step()
state, hashes = table.save(), []
for attempt in range(2):
    table.restore(state)
    for tick in range(20):
        table.step()
    hashes.append(table.state_hash)
assert hashes[0] == hashes[1], hashes
other = smartsurf.Simulation({str(self.work / 'belt.lua')!r}, threads=2)
other.restore(state)
for tick in range(20):
    other.step()
assert other.state_hash == hashes[0]
from smartsurf import fmu
try:
    fmu.pack({str(self.work / 'belt.lua')!r}, {str(self.folder / 'belt.fmu')!r})
    raise SystemExit("packed")
except fmu.FmuError as error:
    assert str(error).endswith("belt.lua: extension 'belt.so': a unit cannot hold extensions"), error
print(table.objects["velocity"][0, 0])
"""
        out = call(sys.executable, "-c", code, env={**os.environ, "PYTHONPATH": os.environ["SMARTSURF_PACKAGE"]})
        self.assertGreater(float(out), 1.0)


class Refusals(Installed):
    """Damaged extensions end the program with one line and exit status 2."""
    PAGE = "docs/extending.md"

    def build(self, source, *changes):
        text = (self.work / source).read_text()
        for old, new in changes:
            self.assertIn(old, text)
            text = text.replace(old, new)
        (self.folder / source).write_text(text)
        shared = self.folder / source.replace(".c", ".so")
        call(CC, "-shared", "-fPIC", f"-I{self.include}", "-o", shared, self.folder / source, "-lm")
        return shared

    def refuse(self, source, *changes):
        return self.refusal(self.build(source, *changes))

    def refusal(self, *files):
        loads = [word for file in files for word in ("--load", file)]
        err = self.run_simulator("check", self.write("a.lua", "surface {}"), *loads, status=2)
        self.assertEqual(err.count("\n"), 0, err)
        return err

    def test_files_that_are_no_extensions(self):
        self.assertIn("none.so: cannot be read: No such file or directory", self.refusal(self.folder / "none.so"))
        self.assertIn("text.so: cannot be loaded: ", self.refusal(self.write("text.so", "text")))
        whole, cut = (self.work / "built/belt.so").read_bytes(), self.folder / "cut.so"
        for length in (len(whole) // 4, 3000, 100):
            cut.write_bytes(whole[:length])
            self.assertRegex(self.refusal(cut), rf"cut.so: is cut short: it has {length} bytes and needs \d+$")
        self.assertIn("it has no function smartsurf_plugin_get", self.refuse("belt.c", ("* smartsurf_plugin_get", "* another_get"),
                      ("#include <smartsurf_plugin.h>", '#include <smartsurf_plugin.h>\nconst smartsurf_plugin* another_get(void);')))

    def test_versions_and_sizes(self):
        self.assertIn("was built for version 2 of smartsurf_plugin.h, and this program has version 1",
                      self.refuse("belt.c", (".version = SMARTSURF_PLUGIN_VERSION", ".version = 2")))
        self.assertIn("its table has the size 4", self.refuse("belt.c", (".size = sizeof plugin", ".size = 4")))
        self.assertIn("a struct of its tables has the size 8: must be ", self.refuse("belt.c", (".size = sizeof belt", ".size = 8")))
        self.assertIn("actuator 'belt': a struct of its tables has the size 0",
                      self.refuse("belt.c", ("{sizeof(smartsurf_plugin_channel), 1", "{0, 1")))

    def test_names(self):
        self.assertIn("actuator 'pin': an actuator or sensor of this name exists already",
                      self.refuse("belt.c", ('.name = "belt"', '.name = "pin"')))
        self.assertIn("the name of its actuator: must be 1 to 27", self.refuse("belt.c", ('.name = "belt"', '.name = "my belt"')))
        self.assertIn("and no keyword of Lua", self.refuse("belt.c", ('.name = "belt"', '.name = "end"')))
        self.assertIn("and no keyword of Lua", self.refuse("belt.c", ('"max_speed"', '"group.end"')))
        for name in ("latency", "position", "max_acceleration", "max_acceleration.x"):
            self.assertIn("'belt' has two fields '", self.refuse("belt.c", ('"max_speed"', f'"{name}"')))
        for name in ("noise", "name"):
            self.assertIn(f"'speed' has two fields '{name}'", self.refuse("speed.c", ('"range"', f'"{name}"')))
        for name in ("", "my speed", ".speed", "s" * 32):
            self.assertIn("must have a name of its own, 1 to 31 letters", self.refuse("belt.c", ('1, "speed"', f'1, "{name}"')))
        self.assertIn("channel 'speed x': must", self.refuse("speed.c", ('1, "", "u/s"', '1, " x", "u/s"')))
        same = self.folder / "speed.so"
        same.write_bytes((self.work / "built/belt.so").read_bytes())
        self.assertIn("another extension of this name is loaded already", self.refusal(self.work / "built/speed.so", same))
        other = self.folder / "other.so"
        other.write_bytes((self.work / "built/belt.so").read_bytes() + b"\0")
        self.assertIn("actuator 'belt': an actuator or sensor of this name exists already",
                      self.refusal(self.work / "built/belt.so", other))

    def test_tables(self):
        self.assertIn("parameter 'max_speed': its default must be within its limits", self.refuse("belt.c", ("{2, 0, 0}", "{-2, 0, 0}")))
        self.assertIn("parameter 'max_speed': no type 77", self.refuse("belt.c", (".type = SMARTSURF_NUMBER", ".type = 77")))
        self.assertIn("no unit of at most 15 bytes", self.refuse("belt.c", ('"u/s", -1', f'"{16 * "u"}", -1')))
        self.assertIn("at most 1 components", self.refuse("belt.c", ('1, "speed"', '2, "speed"')))
        self.assertIn("default parameters, belt.configure(): refuses", self.refuse("belt.c", ("return 0;\n}\n\ntypedef", "return 1;\n}\n\ntypedef")))
        self.assertIn("default parameters, belt.min_height: must not exceed max_height",
                      self.refuse("belt.c", ("= -values[MAX_SPEED].x;", "= -values[MAX_SPEED].x;\n  configuration->max_height = -1;")))
        self.assertIn("must have 1 to 32 channels", self.refuse("belt.c", (".channel_count = 1", ".channel_count = 0")))
        self.assertIn("create and destroy must not be null", self.refuse("belt.c", (".destroy = free,", "")))
        self.assertIn("plan, and add_forces if it exerts forces, must not be null", self.refuse("belt.c", (".plan = plan,", "")))
        self.assertIn("needs a finite range that holds its neutral value", self.refuse("belt.c", ("minimum = -values", "minimum = 2 * values")))
        moves = ".flags = SMARTSURF_MOVES_SURFACE"
        self.assertIn("actuator 'belt': its flags have the bits 0x30: this program does not know them",
                      self.refuse("belt.c", (moves, f"{moves} | 0x30")))
        self.assertIn("channel 'speed': its flags have the bits 0x2: ", self.refuse("speed.c", ('"u/s", 0, 100, 0, 0', '"u/s", 0, 100, 0, 2')))
        self.assertIn("SMARTSURF_LIMITS_FORCE needs SMARTSURF_MOVES_TOPS", self.refuse("belt.c", (moves, f"{moves} | SMARTSURF_LIMITS_FORCE")))
        self.assertIn("adds no actuator and no sensor", self.refuse("belt.c", (".actuator_count = 1", ".actuator_count = 0")))

    def test_failures_during_a_run(self):
        def run(*changes):
            return "".join(self.run_program(SMARTSURF, "run", str(self.work / "belt.lua"), "--load", str(self.build("belt.c", *changes)),
                                            "--no-controller", "--ticks", "3")[1:])
        self.assertIn("belt: cannot be created: create() returns null", run(("belts* b = malloc(sizeof *b);", "return NULL;\n  belts* b = NULL;")))
        self.assertIn("failed at tick 1: the actuator of row 1, column 1 gives it a surface velocity that is not finite",
                      run(("surface_velocity_x[i] +=", "surface_velocity_x[i] = NAN +")))

    def test_an_extension_with_an_error_adds_nothing(self):
        # An extension with a good and a bad actuator adds neither; the script finds no 'belt'.
        two = (".actuators = &belt, .actuator_count = 1", ".actuators = two, .actuator_count = 2")
        array = ("static const smartsurf_plugin plugin", "static smartsurf_plugin_actuator two[2];\nstatic const smartsurf_plugin plugin")
        fill = ("(void) { return &plugin; }", "(void) { two[0] = two[1] = belt; return &plugin; }")
        self.assertIn("actuator 'belt': the extension has two of this name", self.refuse("belt.c", two, array, fill))


class Library(Installed):
    PAGE = "docs/library.md"

    def test_examples_in_c_and_cpp_agree(self):
        out = [call(self.work / "built" / program, self.work / "lift.lua") for program in ("lift_c", "lift_cpp")]
        self.assertEqual(out[0], out[1])
        height, pressure = map(float, re.fullmatch(r"2.00 s: z = ([\d.]+), pressure = ([\d.]+) mass\*u/s\^2, state [0-9a-f]{16}\n",
                                                   out[0]).groups())
        self.assertAlmostEqual(height, 2.0, delta=0.02)                      # a ball of radius 1 on pins at 1
        self.assertAlmostEqual(pressure, 4 / 3 * 3.14159 * 9.81, delta=1.0)  # its weight
        self.assertLess(len((self.work / "lift.c").read_text().splitlines()), 40)

    def test_errors_are_one_line(self):
        for program in ("lift_c", "lift_cpp"):
            done = subprocess.run([self.work / "built" / program, self.write("bad.lua", "surface { rowz = 3 }")],
                                  capture_output=True, text=True, timeout=PATIENCE)
            self.assertEqual(done.returncode, 1)
            self.assertRegex(done.stderr, r"^lift: \S*bad.lua:1: surface: unknown field 'rowz' \(did you mean 'rows'\?\)\n$")

    def test_pkg_config_builds_the_example(self):
        env = {**os.environ, "PKG_CONFIG_PATH": str(next(self.prefix.rglob("smartsurf.pc")).parent)}
        flags = call("pkg-config", "--cflags", "--libs", "smartsurf", env=env).split()
        program = self.work / "by_hand"
        call(CC, *STRICT, self.work / "lift.c", "-o", program, *flags, f"-Wl,-rpath,{self.library.parent}")
        self.assertIn("pressure", call(program, self.work / "lift.lua"))

    def test_the_interface_by_its_corners(self):
        program = self.work / "corners"
        call(CC, *STRICT, f"-I{self.include}", pathlib.Path(__file__).with_name("corners.c"), "-o", program, self.library,
             f"-Wl,-rpath,{self.library.parent}")
        self.assertEqual(call(program), "done\n")

    def test_scripts_ignore_the_locale_of_the_host(self):
        make = ["localedef", "-i", "de_DE", "-f", "UTF-8", self.folder / "de_DE.UTF-8"]
        if not shutil.which("localedef") or subprocess.run(make, capture_output=True).returncode:
            self.skipTest("no localedef, or it lacks de_DE")
        text = (self.work / "lift.c").read_text()
        self.assertIn("  const uint64_t seed", text)
        self.write("host.c", "#include <locale.h>\n" + text.replace("  const uint64_t seed", "  setlocale(LC_ALL, \"\");\n  const uint64_t seed", 1))
        call(CC, *STRICT, f"-I{self.include}", self.folder / "host.c", "-o", self.folder / "host", self.library,
             f"-Wl,-rpath,{self.library.parent}")
        script = self.write("lift.lua", (self.work / "lift.lua").read_text() +
                            "\nprint(1.5, string.format('%.2f', 2.25), tonumber('1.25'), 'B' < 'a')\n")
        out = call(self.folder / "host", script, env={**os.environ, "LOCPATH": str(self.folder), "LC_ALL": "de_DE.UTF-8"})
        self.assertTrue(out.startswith("1.5\t2.25\t1.25\ttrue\n2,00 s"), out)

    def test_exports_only_the_c_functions_and_needs_no_opengl(self):
        symbols = [line.split() for line in call("nm", "-D", "--defined-only", self.library).splitlines()]
        others = [words[2] for words in symbols if words[1] != "A" and not words[2].startswith("smartsurf_")]
        self.assertEqual(others, [])
        dynamic = call("readelf", "-d", self.library)
        self.assertIn("[libsmartsurf.so.1]", dynamic)
        self.assertNotRegex(dynamic, r"NEEDED.*(GL|glfw|X11|hdf5|cairo)")


class SubDirectory(ProgramTest):
    def test_a_project_adds_this_one(self):
        (self.folder / "CMakeLists.txt").write_text(f"""cmake_minimum_required(VERSION 3.25)
project(parent LANGUAGES C CXX)
set(BUILD_TESTING ON)
enable_testing()
add_subdirectory({ROOT} smartsurf EXCLUDE_FROM_ALL)
add_executable(app app.c)
target_link_libraries(app PRIVATE smartsurf::smartsurf)
add_library(belt MODULE app.c)
target_link_libraries(belt PRIVATE smartsurf::plugin)
get_directory_property(options COMPILE_OPTIONS)
message(STATUS "options [${{options}}] [${{CMAKE_CXX_STANDARD}}] [${{CMAKE_CXX_FLAGS}}] [${{CMAKE_RUNTIME_OUTPUT_DIRECTORY}}]")
""")
        self.write("app.c", "#include <smartsurf.h>\n#include <smartsurf_plugin.h>\nint main(void) { return 0; }\n")
        built = self.folder / "built"
        out = call(CMAKE, "-G", "Ninja", "-S", self.folder, "-B", built, f"-DCMAKE_C_COMPILER={CC}", f"-DCMAKE_CXX_COMPILER={CXX}",
                   env={k: v for k, v in os.environ.items() if k not in ("CFLAGS", "CXXFLAGS")})
        self.assertIn("options [] [] [] []", out)
        self.assertIn("Total Tests: 0", call("ctest", "--test-dir", built, "-N"))
        rules = "".join(p.read_text() for p in built.rglob("cmake_install.cmake"))
        self.assertNotRegex(rules, r"file\(INSTALL")
        self.assertIn("libsmartsurf.so", call(CMAKE, "--build", built, "--", "-t", "commands", "app"))


if __name__ == "__main__":
    unittest.main()
