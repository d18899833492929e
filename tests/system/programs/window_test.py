"""The APRON window on a virtual display, and its screenshots and videos."""
import ctypes
import shutil

from programs import *

ENDLESS = "println('one')\nwhile(1)\nendwhile\n"
PNG = b"\x89PNG\r\n\x1a\n"


class ApronPictures(ProgramTest):
    def pictures_of_a_run(self, *flags):
        surface = self.start(SMARTSURF, "run", SORT_LUA, "--shm", self.shm, "--ticks", "30")
        status, _, err = self.run_program(APRON, "run", SORT_APS, "--shm", self.shm, *flags)
        self.assertEqual((status, err), (0, ""))
        self.assertEqual(self.finish(surface)[0], 0)

    def test_pictures_are_reproducible(self):
        seen = []
        for _ in range(2):
            self.pictures_of_a_run("--screenshot", "early.png@10", "--screenshot", "end.png", "--geometry", "800x600")
            seen.append([(self.folder / name).read_bytes() for name in ("early.png", "end.png")])
        self.assertEqual(seen[0], seen[1])
        early, end = seen[0]
        self.assertTrue(early.startswith(PNG))
        self.assertNotEqual(early, end)
        self.assertEqual(int.from_bytes(early[16:20], "big"), 800)
        self.assertEqual(sorted(p.name for p in self.folder.iterdir()), ["early.png", "end.png"])

    @unittest.skipUnless(shutil.which("ffmpeg"), "no ffmpeg")
    def test_video_follows_simulated_time(self):
        self.pictures_of_a_run("--video", "run.mp4", "--geometry", "400x300")
        told = subprocess.run(["ffprobe", "-v", "error", "-count_frames", "-show_entries", "stream=nb_read_frames",
                               "-of", "csv=p=0", "run.mp4"], cwd=self.folder, capture_output=True, text=True)
        # 30 ticks of 1/60 s at 30 frames per second.
        self.assertIn(int(told.stdout.strip().strip(",")), (15, 16))

    def test_picture_without_surface_shows_final_state(self):
        program = self.write("a.aps", "!register(A)\nA = cell.x\n")
        status, _, err = self.run_program(APRON, "run", program, "--screenshot", "a.png")
        self.assertEqual((status, err), (0, ""))
        self.assertTrue((self.folder / "a.png").read_bytes().startswith(PNG))

    def test_arrays_of_one_row_and_of_one_column_have_pictures(self):
        program = self.write("a.aps", "!register(A)\nA = cell.x + cell.y\n")
        for size in ("3000x1", "1x3000"):
            status, _, err = self.run_program(APRON, "run", program, "--size", size, "--screenshot", "a.png")
            self.assertEqual((status, err), (0, ""), size)

    def test_palettes_beside_the_program_have_names_and_errors(self):
        program = self.write("a.aps", "!register(A)\nreg.setPalette(A, 'mine')\n")
        status, _, err = self.run_program(APRON, "check", program)
        self.assertEqual(status, 2)
        self.assertIn("there is no palette 'mine'", err)
        self.write("palettes.txt", "// two\nmine #000000 #ff8000\n")
        self.assertEqual(self.run_program(APRON, "check", program)[::2], (0, ""))
        self.write("palettes.txt", "mine #000000 orange\n")
        status, _, err = self.run_program(APRON, "run", program)
        self.assertEqual((status, err.count("\n")), (2, 1))
        self.assertIn("palettes.txt:1: 'orange' is not a colour", err)
        status, _, err = self.run_program(APRON, "run", program, "--palettes", "no/such")
        self.assertEqual((status, err.count("\n")), (2, 1))

    def test_invalid_flags_report_one_line_and_leave_no_file(self):
        program = self.write("a.aps", "!register(A)\nA = 1\n")
        for flags, word in ((["--screenshot", "a.jpg"], ".png"), (["--screenshot", "a.png@x"], "TICK"),
                            (["--screenshot", "no/such/a.png"], "no folder"), (["--video", "no/such/a.mp4"], "no folder"),
                            (["--hold"], "--window"), (["--reset-layout"], "--window"), (["--show", "A"], "--window"),
                            (["--screenshot", "a.png", "--show", "B"], "no register 'B'"),
                            (["--screenshot", "a.png", "--geometry", "7"], "1280x800"),
                            (["--window", "--screenshot", "a.png"], "display")):
            status, _, err = self.run_program(APRON, "run", program, *flags)
            self.assertEqual(status, 2, flags)
            self.assertEqual(len(err.strip().splitlines()), 1, err)
            self.assertIn(word, err)
        self.assertEqual([p.name for p in self.folder.iterdir()], ["a.aps"])


@unittest.skipUnless(HAS_XVFB, "no virtual display")
class ApronWindow(ProgramTest):
    def setUp(self):
        super().setUp()
        self.display = Display("1280x800")
        os.environ["DISPLAY"] = self.display.name

    def tearDown(self):
        super().tearDown()
        self.display.close()
        os.environ.pop("DISPLAY")

    def read_line(self, child):
        line = child.stdout.readline()
        return line.strip()

    def test_reloads_saved_program_and_stops_on_signal(self):
        program = self.write("a.aps", ENDLESS)
        child = self.start(APRON, "run", program, "--window", "--size", "4x4", "--geometry", "640x480+10+10")
        self.assertEqual(self.read_line(child), "one")
        time.sleep(0.05)  # exceeds the resolution of file times
        self.write("a.aps", ENDLESS.replace("one')", "one'"))  # a program with an error is not loaded
        time.sleep(1)
        self.write("a.aps", ENDLESS.replace("one", "two"))
        self.assertEqual(self.read_line(child), "two")
        child.send_signal(signal.SIGTERM)
        status, out, err = self.finish(child)
        self.assertEqual((status, out, err), (143, "", ""))

    def test_hold_waits_and_lost_display_ends_program(self):
        program = self.write("a.aps", ENDLESS)
        child = self.start(APRON, "run", program, "--window", "--hold", "--size", "4x4")
        time.sleep(1)
        self.assertIsNone(child.poll())
        self.display.close()
        status, out, _ = self.finish(child, 30)
        self.assertNotEqual(status, 0)
        self.assertEqual(out, "")

    def test_layout_is_forgotten_on_request_and_never_in_the_current_folder(self):
        program, config = self.write("a.aps", ENDLESS), self.folder / "config"
        layout = config / "smartsurf" / "apron-window.layout"
        layout.parent.mkdir(parents=True)
        layout.write_text("wide.program 500\n")
        os.environ["XDG_CONFIG_HOME"] = str(config)
        try:
            for flags, kept in (([], True), (["--reset-layout"], False)):
                child = self.start(APRON, "run", program, "--window", "--size", "4x4", *flags)
                self.assertEqual(self.read_line(child), "one")
                child.send_signal(signal.SIGTERM)
                self.assertEqual(self.finish(child)[0], 143)
                self.assertEqual(layout.exists(), kept)
        finally:
            os.environ.pop("XDG_CONFIG_HOME")
        self.assertEqual(sorted(p.name for p in self.folder.iterdir()), ["a.aps", "config"])

    def press(self, keysym):
        """Sends a press and a release of a key to the only window of the display."""
        x = ctypes.CDLL("libX11.so.6")
        x.XOpenDisplay.restype = ctypes.c_void_p
        x.XDefaultRootWindow.argtypes, x.XDefaultRootWindow.restype = [ctypes.c_void_p], ctypes.c_ulong
        x.XCloseDisplay.argtypes = [ctypes.c_void_p]

        class Key(ctypes.Structure):
            _fields_ = [("type", ctypes.c_int), ("serial", ctypes.c_ulong), ("sent", ctypes.c_int), ("display", ctypes.c_void_p),
                        ("window", ctypes.c_ulong), ("root", ctypes.c_ulong), ("subwindow", ctypes.c_ulong), ("time", ctypes.c_ulong),
                        ("at", ctypes.c_int * 4), ("state", ctypes.c_uint), ("keycode", ctypes.c_uint), ("same_screen", ctypes.c_int),
                        ("rest", ctypes.c_char * 128)]

        display = ctypes.c_void_p(x.XOpenDisplay(None))
        root, parent, count = ctypes.c_ulong(), ctypes.c_ulong(), ctypes.c_uint()
        windows = ctypes.POINTER(ctypes.c_ulong)()
        x.XQueryTree(display, ctypes.c_ulong(x.XDefaultRootWindow(display)), ctypes.byref(root), ctypes.byref(parent),
                     ctypes.byref(windows), ctypes.byref(count))
        for window in windows[:count.value]:
            for time_ms, kind in enumerate((2, 3)):  # KeyPress, KeyRelease
                key = Key(type=kind, display=display, window=window, root=root, time=1000 + 50 * time_ms, same_screen=1,
                          keycode=x.XKeysymToKeycode(display, ctypes.c_ulong(keysym)))
                x.XSendEvent(display, ctypes.c_ulong(window), 1, ctypes.c_long(kind - 1), ctypes.byref(key))
                x.XFlush(display)
                time.sleep(0.2)
        x.XCloseDisplay(display)

    def test_f9_stops_the_boards_of_a_bridge(self):
        bridge, emulator, table = BIN / "surface_bridge", BIN / "device_emulator", self.folder / "t.toml"
        surface = f"f9-{os.getpid()}"  # leaves room for .boards
        for name in surface, f"{surface}.boards":  # of a bridge that is killed
            self.addCleanup(self.segment(name).unlink, missing_ok=True)
        self.start(str(emulator), "--tcp", "0", "--boards", "2x1", "--size", "4x4", "--period-ms", "20", "--table", str(table))
        while not table.exists():
            time.sleep(0.05)
        self.start(str(bridge), "--table", str(table), "--shm", surface)
        window = self.start(APRON, "run", str(ROOT / "scripts/hardware/raise.aps"), "--shm", surface, "--window", "--wait", "30")
        self.assert_f9_stops([surface], window)

    def assert_f9_stops(self, surfaces, window):
        def status(word, seconds=30):
            until = time.monotonic() + seconds
            while time.monotonic() < until:
                texts = [subprocess.run([BIN / "surface_bridge", "status", s], capture_output=True, text=True).stdout
                         for s in surfaces]
                if all(word in text for text in texts):
                    return True
                time.sleep(0.2)
            return False
        self.assertTrue(status("emergency_stop none"))
        for attempt in range(20):  # until the window is there
            self.press(0xFFC6)
            if status("emergency_stop by the user", 0.5):
                break
        self.assertTrue(status("emergency_stop by the user", 0.5))
        self.assertIsNone(window.poll())

    def enter_network_of_its_own(self):
        """Bridges listen in the network namespace: those of other tests are out of reach there."""
        c, before = ctypes.CDLL(None, use_errno=True), os.open("/proc/self/ns/net", os.O_RDONLY)
        self.addCleanup(os.close, before)
        if c.unshare(0x40000000) != 0:
            self.skipTest("a network namespace needs root's rights")
        self.addCleanup(c.setns, before, 0)

    def test_f9_in_the_simulator_stops_all_bridges(self):
        self.enter_network_of_its_own()
        surfaces = [f"f9-{name}-{os.getpid()}" for name in "abc"]
        for surface in surfaces:
            self.addCleanup(self.segment(surface).unlink, missing_ok=True)
            line = self.folder / surface
            self.start(str(BIN / "device_emulator"), "--pty", str(line), "--period-ms", "20")
            self.wait_for(line.exists, "the line")
            bridge = self.start(str(BIN / "surface_bridge"), str(line), "--shm", surface)
            if surface is surfaces[0]:  # it keeps the stop from no other one
                self.wait_for(self.segment(surface).exists, "the bridge")
                bridge.send_signal(signal.SIGSTOP)
                self.addCleanup(bridge.send_signal, signal.SIGCONT)
        window = self.start(SMARTSURF, "run", str(ROOT / "scripts/examples/rain.lua"), "--no-controller", "--window")
        self.assert_f9_stops(surfaces[1:], window)

    def test_f9_in_a_replay_stops_all_bridges(self):
        self.enter_network_of_its_own()
        surface, line = f"f9-{os.getpid()}", self.folder / "line"
        self.addCleanup(self.segment(surface).unlink, missing_ok=True)
        self.run_program(SMARTSURF, "run", str(ROOT / "scripts/examples/rain.lua"), "--no-controller", "--record", "run.h5", "--until", "1")
        self.start(str(BIN / "device_emulator"), "--pty", str(line), "--period-ms", "20")
        self.wait_for(line.exists, "the line")
        self.start(str(BIN / "surface_bridge"), str(line), "--shm", surface)
        self.assert_f9_stops([surface], self.start(SMARTSURF, "replay", "run.h5", "--window"))

    def test_both_windows_open_and_end_with_the_run(self):
        child = self.start(SMARTSURF, "run", SORT_LUA, "--controller", SORT_APS, "--window", "--close", "--pace", "max",
                           "--ticks", "40", "--shm", self.shm)
        status, _, err = self.finish(child)
        self.assertEqual(status, 0, err)
        self.assertRegex(err, r"^smartsurf: done: 0\.67 s simulated in .* s \(.*x real time\)$")
        self.assertFalse(self.segment().exists())

    def test_windows_stay_when_the_program_ends(self):
        # The program takes two ticks; its window then holds its registers, and the surface is free.
        program = self.write("two.aps", "!register(A)\nA = 1\nsurface.step\nsurface.step\n")
        child = self.start(SMARTSURF, "run", SORT_LUA, "--controller", program, "--window", "--stats", "stats.json")
        self.wait_for((self.folder / "stats.json").exists, "the run ends")
        self.assertEqual(json.loads((self.folder / "stats.json").read_text())["outcome"], "the controller exited")
        self.wait_for(lambda: not list(pathlib.Path("/dev/shm").glob(f"smartsurf.run-{child.pid}*")), "no segment")
        apron = subprocess.run(["pgrep", "-P", str(child.pid), "apron"], capture_output=True, text=True).stdout.split()
        self.assertEqual((child.poll(), len(apron)), (None, 1))
        child.send_signal(signal.SIGTERM)
        status, _, err = self.finish(child)
        self.assertEqual(status, 143)
        self.assertRegex(err, r"the controller exited: 0\.0\d s simulated in .*; wrote stats\.json\n")
        self.assertFalse(pathlib.Path(f"/proc/{apron[0]}").exists())

    def test_killed_controller_with_a_window_gives_status_3(self):
        """Its process ends half a second after the surface has seen it dead, as one of many threads may."""
        smartsurf = shutil.copy(SMARTSURF, self.folder)
        apron = self.write("apron", f'#!/bin/sh\n{APRON} run "$2" --shm "$4" &\nsleep 1; kill -9 $!; sleep 0.5; kill -ABRT $$\n')
        os.chmod(apron, 0o755)
        status, _, err = self.run_program(smartsurf, "run", SORT_LUA, "--controller", SORT_APS, "--window", "--close",
                                          "--set", "hold=0", "--until", "600")
        self.assertEqual(status, 3, err)
        self.assertIn("the controller was lost (signal 6)", err)

    def test_controller_that_does_not_step_is_named_by_both_programs(self):
        child = self.start(SMARTSURF, "run", SORT_LUA, "--controller", self.write("a.aps", ENDLESS), "--window")
        said = ""
        while not ("has not answered tick 0" in said and "has waited 2 s" in said):
            line = child.stderr.readline()
            self.assertTrue(line, said)
            said += line
        child.send_signal(signal.SIGTERM)
        self.finish(child)

    def test_missing_display_reports_one_line(self):
        os.environ["DISPLAY"] = ":987"
        status, _, err = self.run_program(APRON, "run", self.write("a.aps", ENDLESS), "--window")
        self.assertEqual(status, 2)
        self.assertEqual(len(err.strip().splitlines()), 1, err)
        self.assertIn("no display", err)


if __name__ == "__main__":
    unittest.main()
