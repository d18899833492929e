"""What foreign code in a reader or an interpreter could do: a preloaded library (attack.c) tries it from inside."""
import ctypes
import fcntl
import re
import shutil
import struct

from programs import *

TABLE = "surface { rows = 4, columns = 4, actuator = pin {} }\nsphere { radius = 1, position = {1, 1, 3} }\n"
LANDLOCK = ctypes.CDLL(None, use_errno=True).syscall(444, None, 0, 1)
# Calls that another layer of this machine refuses anyway, with or without confinement.
FOREIGN = {"new_user_namespace", "io_ring", "read_environment"}
MESA = pathlib.Path("/usr/share/glvnd/egl_vendor.d/50_mesa.json")  # names its library
NEEDS_6_12 = {"signal_parent"}
TETRAHEDRON = """solid a
facet normal 0 0 -1\n outer loop\n vertex 0 0 0\n vertex 0 1 0\n vertex 1 0 0\n endloop\nendfacet
facet normal 0 -1 0\n outer loop\n vertex 0 0 0\n vertex 1 0 0\n vertex 0 0 1\n endloop\nendfacet
facet normal -1 0 0\n outer loop\n vertex 0 0 0\n vertex 0 0 1\n vertex 0 1 0\n endloop\nendfacet
facet normal 1 1 1\n outer loop\n vertex 1 0 0\n vertex 0 1 0\n vertex 0 0 1\n endloop\nendfacet
endsolid a
"""


# Killed as it forks its first process: before, or when there are two.
KILLED = """#define _GNU_SOURCE
#include <dlfcn.h>
#include <signal.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>
pid_t fork(void) {
  const char* when = getenv("KILLED");
  unsetenv("KILLED");
  if (when && strcmp(when, "before") == 0) kill(getpid(), SIGKILL);
  pid_t child = ((pid_t(*)(void))dlsym(RTLD_NEXT, "fork"))();
  if (when && child > 0) kill(getpid(), SIGKILL);
  return child;
}
"""


def without_proc():
    """Of the folders in / this process and its children can read the files of all but /proc."""
    libc, read_file = ctypes.CDLL(None), 1 << 2
    rules = libc.syscall(444, ctypes.create_string_buffer(struct.pack("Q", read_file)), 8, 0)
    for folder in set(pathlib.Path("/").iterdir()) - {pathlib.Path("/proc")}:
        place = os.open(folder, os.O_PATH)
        libc.syscall(445, rules, 1, ctypes.create_string_buffer(struct.pack("=Qi", read_file, place)), 0)
        os.close(place)
    libc.prctl(38, 1, 0, 0, 0)
    libc.syscall(446, rules, 0)
    os.close(rules)


@unittest.skipUnless(shutil.which("cc"), "needs a C compiler")
@unittest.skipUnless(LANDLOCK >= 3, "the kernel has no Landlock, or an old one")
class Confinement(ProgramTest):
    @classmethod
    def setUpClass(cls):
        cls.tools = tempfile.TemporaryDirectory(prefix="smartsurf-attack-")
        cls.library = pathlib.Path(cls.tools.name) / "attack.so"
        subprocess.run(["cc", "-shared", "-fPIC", "-O1", "-o", cls.library, ROOT / "tests/system/programs/attack.c", "-ldl"],
                       check=True)

    @classmethod
    def tearDownClass(cls):
        cls.tools.cleanup()

    def setUp(self):
        super().setUp()
        self.home = self.folder / "work"  # where the commands run
        self.home.mkdir()
        (self.home / "s.lua").write_text(TABLE)
        (self.home / "p.aps").write_text("!register(A)\nA = 1\nprint(globalsum(A))\n")
        self.restore()
        self.make_recording()

    def restore(self):
        """The folder that no command may write to."""
        target = self.home / "target"
        shutil.rmtree(target, ignore_errors=True)
        (target / ".git").mkdir(parents=True)
        (target / ".git/config").write_text("[core]\n")
        for name in ("kept", "moved"):
            (target / name).write_text("kept\n")
        (target / "link-to-passwd").symlink_to("/etc/passwd")
        return target

    def make_recording(self):
        status, _, err = self.run_here(SMARTSURF, "run", "s.lua", "--no-controller", "--ticks", "3", "--record", "r.h5")
        self.assertEqual(status, 0, err)

    def run_here(self, *command, container=None, **environment):
        child = subprocess.Popen([str(word) for word in command], cwd=self.home, stdout=subprocess.PIPE, stderr=subprocess.PIPE,
                                 text=True, env={**os.environ, **environment}, preexec_fn=container)
        self.children.append(child)
        return self.finish(child)

    def attack(self, command, confine="require", **environment):
        """What the attacks inside the command gave: name -> done, refused or another error."""
        target = self.restore()
        status, out, err = self.run_here(*command, LD_PRELOAD=str(self.library), ATTACK_TARGET=str(target),
                                         SMARTSURF_CONFINE=confine, **environment)
        outcomes = dict(re.findall(r"\b([a-z_0-9]+)=(done|refused|[A-Z]\w[\w ]*)", out + err))
        return status, outcomes, out + err

    COMMANDS = {
        "run": ((SMARTSURF, "run", "s.lua", "--no-controller", "--ticks", 2, "--record", "n.h5", "--stats", "n.json"), {}),
        "worlds": ((SMARTSURF, "run", "s.lua", "--no-controller", "--ticks", 2, "--worlds", 2), {}),
        "compare": ((SMARTSURF, "compare", "s.lua", "--until", 0.1, "--out", "out"), {}),
        "check": ((SMARTSURF, "check", "s.lua"), {}),
        "help": ((SMARTSURF, "run", "s.lua", "--help"), {}),
        "info": ((SMARTSURF, "info", "r.h5"), {}),
        "plot": ((SMARTSURF, "plot", "r.h5", "-o", "r.svg"), {}),
        "chart": ((SMARTSURF, "plot", "c.json", "-o", "c.svg"), {"ATTACK_CHART": "1"}),
        "export": ((SMARTSURF, "export", "r.h5", "-o", "r.html"), {}),
        "verify": ((SMARTSURF, "replay", "--verify", "r.h5"), {}),
        "mesh": ((SMARTSURF, "check", "m.lua"), {"ATTACK_MESH": "1"}),
        "apron": ((APRON, "run", "p.aps", "--save", "A=a.npy"), {"ATTACK_APRON": "1"}),
    }
    # The script's or program's own folder may be read; that of an APRON program may be written.
    PICTURES = {"executable_memory", "memory_file"}

    def commands(self):
        (self.home / "c.json").write_text('{"layers": [{"mark": "line", "x": [0, 1], "y": [0, 1]}]}')
        (self.home / "m.stl").write_text(TETRAHEDRON)
        (self.home / "m.lua").write_text(TABLE + "mesh { file = 'm.stl', position = {2, 2, 3} }\n")
        for name, (command, environment) in self.COMMANDS.items():
            if name == "compare" and not has_bullet():
                continue
            yield name, command, environment

    def test_nothing_outside_is_reached(self):
        for name, command, environment in self.commands():
            with self.subTest(command=name):
                folder = self.home / "apart" if name == "apron" else self.home
                folder.mkdir(exist_ok=True)
                if name == "apron":  # it may write below its own folder
                    shutil.copy(self.home / "p.aps", folder)
                    command = (APRON, "run", "apart/p.aps", "--save", "A=a.npy")
                status, outcomes, text = self.attack(command, **environment)
                self.assertGreater(len(outcomes), 20, text)
                allowed = self.PICTURES if name == "apron" else set()
                allowed |= NEEDS_6_12 if LANDLOCK < 6 else set()
                # Reads below the script's folder are allowed; the link leads outside.
                self.assertEqual({n for n, o in outcomes.items() if o == "done"} - allowed, set(), text)
                self.assertEqual((self.home / "target/.git/config").read_text(), "[core]\n")
                self.assertEqual((self.home / "target/kept").read_text(), "kept\n")
                if name != "mesh":  # which gives the attack's text for its result
                    self.assertEqual(status, 0, text)

    def test_unconfined_the_attacks_succeed(self):
        """The tests above can fail."""
        for name, command, environment in self.commands():
            with self.subTest(command=name):
                _, outcomes, text = self.attack(command, confine="off", **environment)
                self.assertEqual({n for n, o in outcomes.items() if o != "done"} - FOREIGN, set(), text)
                self.assertNotEqual((self.home / "target/kept").exists(), True)

    def test_another_program_ends_the_process(self):
        for name, command, environment in self.commands():
            if name not in ("run", "info", "check", "chart"):
                continue
            for attack in ("execute", "trace_itself"):
                status, outcomes, text = self.attack(command, ATTACK=attack, **environment)
                self.assertNotEqual(status, 0, text)
                self.assertEqual(outcomes, {}, text)
                if name in ("info", "chart"):
                    self.assertEqual((status, text), (2, f"smartsurf: {command[2]}: cannot be read: its reader has crashed (Bad system call)\n"))
        # Nothing is left behind by a run that ended so.
        self.assertEqual([p.name for p in self.home.iterdir() if "part" in p.name or p.name.endswith(".files")], [])

    def test_results_are_those_without_confinement(self):
        hashes = set()
        for mode in ("require", "off"):
            status, _, err = self.run_here(SMARTSURF, "run", SORT_LUA, "--controller", SORT_APS, "--ticks", "200", "--stats",
                                           "h.json", "--record", f"{mode}.h5", "--shm", self.shm, SMARTSURF_CONFINE=mode)
            self.assertEqual(status, 0, err)
            hashes.add(json.loads((self.home / "h.json").read_text())["state_hash"])
        self.assertEqual(len(hashes), 1)
        self.assertFalse(self.segment().exists())

    def test_required_confinement_is_not_left_out(self):
        for command, reason in (((SMARTSURF, "run", "s.lua", "--no-controller", "--ticks", "1", "--unsafe"), "--unsafe"),
                                ((SMARTSURF, "check", "s.lua", "--allow-extensions"), "--allow-extensions"),
                                ((SMARTSURF, "replay", "--verify", "r.h5", "--unsafe"), "--unsafe")):
            status, _, err = self.run_here(*command, SMARTSURF_CONFINE="require")
            self.assertEqual(status, 2, err)
            self.assertIn(reason, err)
            self.assertEqual(self.run_here(*command)[0], 0)
        status, _, err = self.run_here(SMARTSURF, "info", "r.h5", SMARTSURF_CONFINE="maybe")
        self.assertEqual(status, 2, err)
        self.assertIn("SMARTSURF_CONFINE", err)

    READERS = ("info", "plot", "chart", "verify", "mesh")

    def in_container(self, container, commands, confine):
        """(status, stderr) of each of the commands."""
        known = {name: command for name, command, _ in self.commands()}
        for name in commands:
            status, _, err = self.run_here(*known[name], container=container, SMARTSURF_CONFINE=confine)
            yield status, err

    @needs_call_numbers
    def test_what_cannot_be_limited_is_not_read(self):
        limits = refusing("setrlimit", "prlimit64")
        names = {path.name for path in self.home.iterdir()} | {"c.json", "m.stl", "m.lua"}
        for container, reason in ((limits, "the system refuses to set them: Operation not permitted\n"),
                                  (without_proc, "/proc/self/statm, which tells the memory in use, cannot be read: Permission denied\n")):
            for confine in ("", "require"):
                for status, err in self.in_container(container, self.READERS, confine):
                    self.assertEqual((status, err.count("\n"), err[-len(reason):]), (2, 1, reason))
            self.assertEqual({path.name for path in self.home.iterdir()}, names)
        for status, err in self.in_container(limits, self.READERS, "off"):
            self.assertEqual((status, err), (0, ""))

    @needs_call_numbers
    def test_what_a_container_refuses_is_left_out_unless_required(self):
        for call, means in (("landlock_create_ruleset", "seccomp, no Landlock: files are not confined"), ("seccomp", "no seccomp, Landlock version")):
            for status, err in self.in_container(refusing(call), ("run", "info", "mesh"), "require"):
                self.assertEqual((status, err.count("\n")), (2, 1), err)
                self.assertIn(f"SMARTSURF_CONFINE=require: this system has {means}", err)
            for status, err in self.in_container(refusing(call), ("run", "info", "mesh"), ""):
                self.assertEqual(status, 0, err)

    def test_plot_is_silent_without_a_cache_of_fonts(self):
        fonts, settings = self.folder / "fonts", self.folder / "fonts.conf"
        fonts.mkdir()
        shutil.copy("/usr/share/fonts/truetype/dejavu/DejaVuSans.ttf", fonts)
        settings.write_text(f"<fontconfig><dir>{fonts}</dir><cachedir>/dev/null/none</cachedir></fontconfig>\n")
        for confine in ("off", "require"):  # which can read no such settings
            status, out, err = self.run_here(SMARTSURF, "plot", "r.h5", "-o", "r.svg", FONTCONFIG_FILE=str(settings),
                                             SMARTSURF_CONFINE=confine)
            self.assertEqual((status, out + err), (0, ""))

    def test_killed_at_its_start_leaves_nothing(self):
        source, library = (self.folder / name for name in ("killed.c", "killed.so"))
        source.write_text(KILLED)
        subprocess.run(["cc", "-shared", "-fPIC", "-o", library, source, "-ldl"], check=True)
        names = sorted(path.name for path in self.home.iterdir())
        commands = [("run", "s.lua", "--no-controller", "--ticks", "2", "--record", "n.h5", "--record", "n.csv", "--stats", "n.json"),
                    ("run", "s.lua", "--no-controller", "--ticks", "2", "--worlds", "2", "--stats", "n.json"),
                    ("run", "s.lua", "--controller", "p.aps", "--ticks", "2")]
        if WITH_VIEW:
            commands.append(("replay", "r.h5", "--screenshot", "n.png@0"))
        for command in [(SMARTSURF, *c) for c in commands] + [(APRON, "run", "p.aps", "--ticks", "1", "--save", "A=a.npy")]:
            for when in ("before", "after"):
                with self.subTest(command=command[1:], when=when):
                    status, _, err = self.run_here(*command, LD_PRELOAD=str(library), KILLED=when)
                    self.assertEqual(status, -9, err)
                    self.wait_for(lambda: sorted(path.name for path in self.home.iterdir()) == names, "the broker")
                    self.wait_for_no_segment(self.children[-1])

    def test_killed_run_leaves_no_part_and_no_controller(self):
        controller = f"sleep {10**6 + os.getpid()}"
        (self.home / "long.lua").write_text(TABLE + "io.open('x', 'w'):write('y'):close()\n")
        child = subprocess.Popen([SMARTSURF, "run", "long.lua", "--shm", self.shm, "--record", "k.h5", "--stats", "k.json",
                                  "--controller", controller], cwd=self.home, stderr=subprocess.PIPE, text=True)
        self.children.append(child)
        self.wait_for(self.segment().exists, "the segment")
        self.assertEqual((self.home / "k.files/x").read_text(), "y")
        child.kill()
        child.wait()
        self.wait_for(lambda: not [p for p in self.home.iterdir() if ".part" in p.name], "the broker")
        self.wait_for(lambda: subprocess.run(["pgrep", "-f", controller], stdout=subprocess.DEVNULL).returncode == 1, "the controller's end")
        self.assertTrue(self.segment().exists())  # named by the user: the next run, or `clean`, removes it

    def start_unnamed(self, *flags):
        """A run with a controller, the leader of its process group, whose segment has the name that the run chooses."""
        (self.home / "p.aps").write_text("#again\nsurface.step()\njump(#again)\n")
        child = subprocess.Popen([SMARTSURF, "run", "s.lua", "--controller", "p.aps", "--until", "100000", *flags], cwd=self.home,
                                 stdout=subprocess.DEVNULL, stderr=subprocess.PIPE, text=True, process_group=0)
        self.children.append(child)
        return child

    def segments(self, child):
        return [path.name for path in pathlib.Path("/dev/shm").glob(f"smartsurf.run-{child.pid}*")]

    def wait_for_no_segment(self, child):
        self.wait_for(lambda: not self.segments(child), lambda: f"the removal of {self.segments(child)}")

    def test_killed_run_leaves_no_segment_that_nobody_named(self):
        for i in range(12):
            child = self.start_unnamed()
            time.sleep(0.05 + 0.08 * i)
            child.kill()
            child.wait()
            self.wait_for_no_segment(child)
        # All processes of the group at once; one that is not confined, without a broker; and several worlds.
        for flags, end in (((), os.killpg), (("--unsafe",), os.kill), (("--worlds", "2"), os.kill)):
            with self.subTest(flags=flags, end=end):
                child = self.start_unnamed(*flags)
                self.wait_for(lambda: len(self.segments(child)) == (2 if "--worlds" in flags else 1) and "~" not in str(self.segments(child)),
                              "the segments")
                end(child.pid, signal.SIGKILL)
                child.wait()
                self.wait_for_no_segment(child)

    def test_killed_run_leaves_no_segment_that_another_cleaner_has_locked(self):
        child = self.start_unnamed()
        self.wait_for(lambda: len(self.segments(child)) == 1 and "~" not in str(self.segments(child)), "the segment")
        with open(f"/dev/shm/{self.segments(child)[0]}", "rb") as segment:
            fcntl.flock(segment, fcntl.LOCK_EX)
            child.kill()
            child.wait()
            time.sleep(1)
            self.assertTrue(self.segments(child))
        self.wait_for_no_segment(child)

    def test_run_whose_broker_or_guardian_is_killed_leaves_no_segment(self):
        """Its children are the guardian and the broker, which has started the controller."""
        for killed in ("guardian", "broker"):
            for wait_s in (0, 0.02, 0.05, 0.5):
                with self.subTest(killed=killed, wait_s=wait_s):
                    child = self.start_unnamed("--record", "k.h5")
                    self.wait_for(lambda: len(children(child.pid)) == 2, "the processes")
                    time.sleep(wait_s)
                    guardian, broker = children(child.pid)
                    os.kill(guardian if killed == "guardian" else broker, signal.SIGKILL)
                    if killed == "guardian":  # without which an orderly end leaves nothing
                        time.sleep(0.2)
                        child.terminate()
                    status, _, err = self.finish(child)
                    if killed == "broker":
                        self.assertEqual((status, err), (1, "smartsurf: the process that names the outputs has ended\n"))
                    self.wait_for_no_segment(child)

    def test_script_writes_in_its_folder_alone(self):
        (self.home / "w.lua").write_text(TABLE + "io.open('x.csv', 'w'):write('1\\n'):close()\n")
        self.assertEqual(self.run_here(SMARTSURF, "run", "w.lua", "--no-controller", "--ticks", "2", "--record", "w.h5")[0], 0)
        self.assertEqual((self.home / "w.files/x.csv").read_text(), "1\n")
        self.assertEqual(self.run_here(SMARTSURF, "run", "s.lua", "--no-controller", "--ticks", "2", "--record", "e.h5")[0], 0)
        self.assertFalse((self.home / "e.files").exists())  # a folder without files is none

    @needs_view
    @unittest.skipUnless(shutil.which("ffmpeg"), "needs ffmpeg")
    def test_refused_run_leaves_no_part_of_a_video(self):
        (self.home / "bad.lua").write_text(TABLE + "error('bad')\n")
        self.assertEqual(self.run_here(SMARTSURF, "run", "bad.lua", "--no-controller", "--video", "a.mp4")[0], 2)
        self.assertEqual([p.name for p in self.home.iterdir() if p.name.startswith("a.")], [])

    @needs_view
    def test_pictures_are_drawn(self):
        status, outcomes, text = self.attack((SMARTSURF, "run", "s.lua", "--no-controller", "--ticks", 2, "--screenshot", "a.png"))
        self.assertEqual(status, 0, text)
        allowed = self.PICTURES | (NEEDS_6_12 if LANDLOCK < 6 else set())
        self.assertEqual({n for n, o in outcomes.items() if o == "done"} - allowed, set(), text)
        self.assertTrue((self.home / "a.png").read_bytes().startswith(b"\x89PNG"))

    @needs_view
    @unittest.skipUnless(MESA.exists(), "Mesa is not registered as a driver")
    def test_drivers_lie_where_variables_of_the_loader_say(self):
        drivers = self.folder / "drivers"
        drivers.mkdir()
        shutil.copy(MESA, drivers / "driver.json")
        status, _, err = self.run_here(SMARTSURF, "run", "s.lua", "--no-controller", "--ticks", "2", "--screenshot", "a.png",
                                       __EGL_VENDOR_LIBRARY_FILENAMES=str(drivers / "driver.json"))
        self.assertEqual(status, 0, err)
        self.assertTrue((self.home / "a.png").read_bytes().startswith(b"\x89PNG"))


if __name__ == "__main__":
    unittest.main()
