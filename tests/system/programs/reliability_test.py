"""Supervisors, full disks, hostile neighbours and exhausted resources: one line, the documented status, nothing left."""
import ctypes
import resource
import stat

from programs import *

CLONE_NEWNS, MS_REC, MS_PRIVATE = 0x20000, 0x4000, 1 << 18
libc = ctypes.CDLL(None, use_errno=True)


def own_mounts():
    """Gives this process mounts of its own; raises OSError where that is not permitted."""
    if libc.unshare(CLONE_NEWNS) != 0:
        raise OSError(ctypes.get_errno(), "no private mounts")
    if libc.mount(b"none", b"/", None, MS_REC | MS_PRIVATE, None) == 0:
        return
    # The root of a chroot is no mount point: change the root above it, from a working directory outside.
    root = os.open("/", os.O_RDONLY)
    os.chroot("/proc")
    os.fchdir(root)
    for _ in range(100):
        os.chdir("..")
    done = libc.mount(b"none", b".", None, MS_REC | MS_PRIVATE, None) == 0
    os.fchdir(root)
    os.chroot(".")
    if not done:
        raise OSError(ctypes.get_errno(), "no private mounts")


def can_mount():
    child = os.fork()
    if child == 0:
        try:
            own_mounts()
        except OSError:
            os._exit(1)
        os._exit(0)
    return os.waitpid(child, 0)[1] == 0


class ReliabilityTest(ProgramTest):
    def run_limited(self, command, before=None, patience=30, **streams):
        """Returns (status, stderr) of a command that calls `before` in its process first."""
        child = subprocess.run(command, cwd=self.folder, preexec_fn=before, timeout=patience, text=True,
                               stderr=subprocess.PIPE, stdin=subprocess.DEVNULL, **{"stdout": subprocess.PIPE, **streams})
        return child.returncode, child.stderr

    def assert_one_line(self, err):
        self.assertEqual(len(err.strip().splitlines()), 1, err)


class Supervisor(ReliabilityTest):
    def test_two_signals_back_to_back_end_the_run_in_order(self):
        for i in range(8):
            recording = self.folder / f"t{i}.h5"
            surface = subprocess.Popen([SMARTSURF, "run", SORT_LUA, "--set", "hold=0", "--controller", SORT_APS,
                                        "--shm", self.shm, "--record", str(recording), "--until", "6000"],
                                       cwd=self.folder, start_new_session=True, stdout=subprocess.PIPE,
                                       stderr=subprocess.PIPE, text=True)
            self.children.append(surface)
            self.wait_for(recording.exists, "the first flush")
            surface.terminate()
            os.killpg(surface.pid, signal.SIGTERM)
            status, _, err = self.finish(surface, 30)
            self.assertEqual(status, 143, err)
            self.assertFalse(self.segment().exists())
            self.assertIn("stopped by the user", self.run_program(SMARTSURF, "info", str(recording))[1])

    def test_signal_ends_a_script_that_runs(self):
        # Few instructions that take long, so that the time is not over before the signal comes.
        path = self.write("loop.lua", "surface { rows = 4, columns = 4 }\non_tick(function() local a = ('x'):rep(1 << 23) "
                          "local b = a .. 'y' while true do local _ = a .. b end end)\n")
        loop = self.start(SMARTSURF, "run", path, "--no-controller", "--until", "9")
        self.wait_for_work(loop, 0.5)
        loop.terminate()
        self.assertEqual(self.finish(loop, 60)[0], 143)


class OlderRecording(ReliabilityTest):
    def test_survives_a_run_killed_while_it_waits_for_its_controller(self):
        old = self.folder / "old.h5"
        old.write_bytes(b"an older recording")
        surface = self.start(SMARTSURF, "run", SORT_LUA, "--shm", self.shm, "--record", str(old))
        self.wait_for((self.folder / "old.h5.part").exists, "the recording")
        surface.kill()
        surface.communicate()
        self.assertEqual(old.read_bytes(), b"an older recording")


@unittest.skipUnless(can_mount(), "private mounts are not permitted")
class SmallDisk(ReliabilityTest):
    def test_recording_onto_a_full_tmpfs_is_an_error_not_a_crash(self):
        mount = self.folder / "disk"
        mount.mkdir()
        for kilobytes in (4, 8, 20, 40, 80, 400):
            def mount_disk():
                own_mounts()
                if libc.mount(b"tmpfs", str(mount).encode(), b"tmpfs", 0, f"size={kilobytes}k".encode()) != 0:
                    os._exit(99)
            status, err = self.run_limited([SMARTSURF, "run", SORT_LUA, "--no-controller", "--until", "20", "--record",
                                            str(mount / "run.h5")], mount_disk)
            self.assertIn(status, (1, 2), err)
            self.assertIn("No space left on device", err)
            self.assert_one_line(err)


class Neighbour(ReliabilityTest):
    def test_fifo_under_the_surface_name_is_refused_at_once(self):
        os.mkfifo(self.segment(), 0o666)
        for command in ((SMARTSURF, "run", SORT_LUA, "--shm", self.shm), (SMARTSURF, "clean", self.shm),
                        (APRON, "run", SORT_APS, "--shm", self.shm)):
            status, err = self.run_limited(command, patience=10)
            self.assertIn(status, (0, 2), err)
        self.assertTrue(stat.S_ISFIFO(os.lstat(self.segment()).st_mode))


class Resources(ReliabilityTest):
    def test_unreadable_inputs_are_errors(self):
        status, err = self.run_limited([SMARTSURF, "run", "/proc/self/mem", "--no-controller"])
        self.assertEqual(status, 2, err)
        self.assertIn("cannot be read", err)
        status, err = self.run_limited([APRON, "check", "/proc/self/mem"])
        self.assertEqual(status, 2, err)
        for command in ([APRON, "fmt", "/dev/zero"], [APRON, "check", "/dev/zero"], [SMARTSURF, "check", "/dev/zero"]):
            status, err = self.run_limited(
                command, lambda: resource.setrlimit(resource.RLIMIT_AS, (512 << 20, 512 << 20)))
            self.assertIn(status, (1, 2), err)
            self.assert_one_line(err)

    @unittest.skipUnless(os.geteuid() == 0, "only root can become a user with a limit of its own")
    def test_no_thread_to_be_had_is_an_error(self):
        # An unused user, so that its processes number one: this one.
        def limit():
            os.setgid(54321)
            resource.setrlimit(resource.RLIMIT_NPROC, (1, 1))
            os.setuid(54321)
        os.chmod(self.folder, 0o755)
        program = self.write("p.aps", "a = 1\n")
        scene = self.write("s.lua", "surface { rows = 4, columns = 4 }\n")
        for command in ([APRON, "run", program, "--threads", "4"],
                        [SMARTSURF, "run", scene, "--no-controller", "--threads", "4", "--ticks", "1"]):
            status, err = self.run_limited(command, limit)
            self.assertEqual(status, 2, err)
            self.assertIn("cannot start 4 threads", err)
            self.assert_one_line(err)

    def test_output_that_cannot_be_written_gives_status_1(self):
        printer = self.write("print.lua", "surface { rows = 4, columns = 4 }\nprint('hello')\n")
        quiet = [SMARTSURF, "run", self.write("quiet.lua", "surface { rows = 4, columns = 4 }\n"), "--no-controller", "--ticks", "1"]
        for command in ([SMARTSURF, "run", printer, "--no-controller", "--ticks", "1"], [*quiet, "--stats", "-"],
                        [*quiet, "--stats", "/dev/fd/1"], [*quiet, "--stats", "-", "--worlds", "2"], [APRON, "disasm", SORT_APS],
                        [APRON, "fmt", SORT_APS], [SMARTSURF, "--help"],
                        *([str(BIN / "shm_dump"), flag] for flag in ("--list", "--clean", "--version", "--help"))):
            with open("/dev/full", "w") as full:
                status, err = self.run_limited(command, stdout=full)
            self.assertEqual(status, 1, (command, err))
            self.assertIn("output", err)

    def test_file_size_limit_is_an_error_not_a_signal(self):
        def limit():
            resource.setrlimit(resource.RLIMIT_FSIZE, (4096, 4096))
        for name in ("run.h5", "run.csv"):
            status, err = self.run_limited([SMARTSURF, "run", SORT_LUA, "--no-controller", "--until", "20", "--record",
                                            str(self.folder / name)], limit)
            self.assertIn(status, (1, 2), err)
            self.assertIn("File too large", err)
        with open(self.folder / "listing", "w") as listing:
            status, err = self.run_limited([APRON, "disasm", SORT_APS], limit, stdout=listing)
        self.assertEqual(status, 1, err)


class Extremes(ReliabilityTest):
    def test_smallest_largest_lightest_objects_stay_finite(self):
        scene = self.write("extreme.lua", """
            surface { rows = 8, columns = 8, actuator = pin {} }
            material { name = 'm', density = option('density', 1.0) }
            local size, below, shape = option('size', 1.0), option('below', 1.0), option('shape', 'sphere')
            local function put(s, x, z)
              if shape == 'sphere' then sphere { radius = s, position = { x, 4, z }, material = 'm' }
              else box { size = { s, s, s }, position = { x, 4, z }, material = 'm' } end
            end
            put(below, 4, below + 0.1) put(size, 4 + size / 2, 2 * below + 2 * size + 0.1)
            """)
        for options in (("size=0.001",), ("size=0.001", "density=1e-9"), ("size=0.003", "shape=box"), ("density=1e-6",),
                        ("density=1e-9",), ("size=0.001", "below=1e4"), ("size=1e4",), ("size=1e4", "shape=box")):
            status, _, err = self.run_program(SMARTSURF, "run", scene, "--no-controller", "--until", "1",
                                              *(flag for option in options for flag in ("--set", option)))
            self.assertEqual(status, 0, (options, err))

    def test_spinning_needles_stay_finite(self):
        for needle in ("box { size = { 0.001, 0.003, 1e4 }, position = { 4, 4, 5003 }, angular_velocity = { 1, -100, 0 } }",
                       "cylinder { radius = 0.001, height = 1e4, position = { 4, 4, 5003 }, angular_velocity = { 1, 100, -100 } }"):
            scene = self.write("needle.lua", "surface { rows = 8, columns = 8, actuator = pin {} }\n" + needle)
            status, _, err = self.run_program(SMARTSURF, "run", scene, "--no-controller", "--until", "1")
            self.assertEqual(status, 0, (needle, err))

    def test_objects_at_one_point_end_the_run_before_they_take_memory_or_time(self):
        scene = self.write("point.lua", """
            surface { rows = 8, columns = 8, actuator = pin {} }
            local count = option('count', 4000, 'spheres')
            at(0, function() for i = 1, count do sphere { radius = 0.5, position = { 4, 4, 5 } } end end)
            """)
        for count, limit, most in (4000, resource.RLIMIT_AS, 1 << 30), (100000, resource.RLIMIT_CPU, 30):
            status, err = self.run_limited([SMARTSURF, "run", scene, "--no-controller", "--until", "1", "--set", f"count={count}"],
                                           lambda: resource.setrlimit(limit, (most, most)), patience=120)
            self.assertEqual(status, 1, err)
            self.assertEqual(err, f"smartsurf: failed at tick 1: too many of the {count} objects overlap: place them apart\n")


class Reproducible(ReliabilityTest):
    def test_text_of_values_does_not_differ_between_runs(self):
        path = self.write("address.lua", "surface { rows = 4, columns = 4, actuator = pin {} }\n"
                          "local text = tostring({}) .. string.format('%p %s', {}, print)\n"
                          "local x = 0\nfor i = 1, #text do x = (x * 31 + text:byte(i)) % 1000 end\n"
                          "sphere { radius = 1, position = { 2 + x / 1000, 2, 3 } }\n")
        hashes = set()
        for i in range(3):
            stats = self.folder / f"s{i}.json"
            status, _, err = self.run_program(SMARTSURF, "run", path, "--no-controller", "--ticks", "5", "--stats",
                                              str(stats), "--record", "run.h5")
            self.assertEqual(status, 0, err)
            hashes.add(json.loads(stats.read_text())["state_hash"])
        self.assertEqual(len(hashes), 1)
        self.assertEqual(self.run_program(SMARTSURF, "replay", "run.h5", "--verify")[0], 0)


class HostileRecording(ReliabilityTest):
    """A recording whose script turns hostile when it runs again: a file beside it, which the sandbox lets it read, says how."""
    ATTACKS = {
        "instructions": "while true do pcall(function() while true do end end) end",
        "a length that a metamethod returns": "table.insert(huge, 1, 0)",
        "a loop of a library function": "table.concat(huge)",
        "keys in order": "local t = {} for i = 1, 1e5 do t[i] = i end while true do next(t) end",
        "a pattern": "('b'):rep(1e6):find('[' .. ('a'):rep(1e6) .. ']')",
        "a replacement": "('x'):rep(1e6):gsub('.*', ('%0'):rep(1e6))",
        "a comparison": "local t = {} for i = 1, 1e6 do t[i] = -i end while true do table.sort(t, function() return true end) end",
        "coroutines": "local function f() return coroutine.wrap(f)() end while true do pcall(f) end",
    }
    # One assignment that takes minutes: the keys collide in the table's next size.
    ENDLESS = "local t, step = {}, (1 << 20) - 1 for i = 1, (1 << 19) + 1 do t[i * step] = true end"

    def setUp(self):
        super().setUp()
        attacks = "".join(f"function() {code} end, " for code in (*self.ATTACKS.values(), self.ENDLESS))
        scene = self.write("later.lua", "surface { rows = 4, columns = 4, actuator = pin {} }\n"
                           "local huge = setmetatable({}, {__len = function() return math.maxinteger - 1 end, "
                           "__index = function() return '' end})\n"
                           f"local attacks = {{ {attacks} }}\n"
                           "on_tick(function(t) local file = t > 0.1 and io.open('attack.txt') "
                           "if file then attacks[file:read('n')]() end end)\n")
        status, _, err = self.run_program(SMARTSURF, "run", scene, "--no-controller", "--ticks", "20", "--record", "run.h5")
        self.assertEqual(status, 0, err)

    def test_replaying_it_ends_with_one_line(self):
        for number, name in enumerate(self.ATTACKS, 1):
            self.write("attack.txt", str(number))
            status, err = self.run_limited([SMARTSURF, "replay", "run.h5", "--verify"], patience=120)
            self.assertEqual(status, 2, (name, err))
            self.assertIn("later.lua:", err)
            self.assert_one_line(err)

    def test_signal_ends_an_operation_that_cannot_be_interrupted(self):
        self.write("attack.txt", str(len(self.ATTACKS) + 1))
        replay = self.start(SMARTSURF, "replay", "run.h5", "--verify")
        self.wait_for_work(replay, 1)
        replay.terminate()
        status, _, err = self.finish(replay, 60)
        self.assertEqual(status, 143, err)


if __name__ == "__main__":
    unittest.main()
