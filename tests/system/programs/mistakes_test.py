"""Invalid input: one line on stderr, exit status 2, and no partial output files."""
import re
import resource
import shlex
import shutil
import struct

from programs import *

TABLE = "surface { rows = 8, columns = 8, actuator = pin {}, sensors = { proximity {} } }\n"


class Mistakes(ProgramTest):
    def refused(self, command, *facts):
        status, _, err = self.run_program(*command)
        lines = err.strip().splitlines()
        self.assertEqual(status, 2, err)
        self.assertEqual(len(lines), 1, err)
        for fact in facts:
            self.assertIn(fact, lines[0])

    def test_experiments(self):
        self.write("open.obj", "v 0 0 0\nv 1 0 0\nv 0 1 0\nv 0 0 1\nf 1 3 2\nf 1 2 4\nf 1 4 3\n")
        for text, *facts in [
            (TABLE + "spere { radius = 1, position = {1, 1, 1} }", ":2:", "spere", "sphere"),
            (TABLE + "sphere { raduis = 1, position = {1, 1, 1} }", ":2:", "raduis", "radius"),
            (TABLE + "sphere { radius = 0/0, position = {1, 1, 1} }", ":2:", "radius"),
            (TABLE + "sphere { radius = -1, position = {1, 1, 1} }", ":2:", "radius", "-1"),
            (TABLE + "sphere { radius = 1, position = {1, 1/0, 1} }", ":2:", "position"),
            (TABLE + "world { dt = 'fast' }", ":2:", "dt", "fast"),
            (TABLE + "if then", ":2:"),
            (TABLE + "while true do end", ":2:", "instructions"),
            (TABLE + "mesh { file = 'none.stl', position = {1, 1, 1} }", ":2:", "none.stl", "does not exist"),
            (TABLE + "mesh { file = 'wrong.lua', position = {1, 1, 1} }", ":2:", "wrong.lua", ".stl"),
            (TABLE + "mesh { file = 'open.obj', position = {1, 1, 1} }", ":2:", "open.obj", "3 edges", "(1, 0, 0)"),
            (TABLE + "hull { points = {{0, 0, 0}}, position = {1, 1, 1} }", ":2:", "points", "four"),
            ("world {}\n", "surface"),
            ("surface { positions = {{0, 0}, {0.5, 0}} }\n",
             "positions[1] = {0, 0} and positions[2] = {0.5, 0} overlap by 0.3 u"),
        ]:
            path = self.write("wrong.lua", text)
            self.refused([SMARTSURF, "check", path], "wrong.lua", *facts)
            self.refused([SMARTSURF, "run", path, "--no-controller", "--ticks", "1"], "wrong.lua", *facts)

    def test_options_out_of_their_range(self):
        for declared, given, fact in [
            ("'n', 20, 'balls', {1, 100}", "0", "option 'n': --set n=0: must be a whole number, 1 to 100 (default 20)"),
            ("'n', 20, 'balls', {1, 100}", "0.5", "must be a whole number, 1 to 100 (default 20)"),
            ("'n', 20, 'balls', {1, 100}", "9223372036854775807", "must be a whole number, 1 to 100"),
            ("'n', 1.5, 's', {0.5, 1e3}", "-1", "option 'n': --set n=-1: must be 0.5 to 1000 (default 1.5)"),
            ("'n', 1.5, 's', {0.5, 1e3}", "nan", "option 'n': --set n=nan: must be a number (default 1.5)"),
            ("'n', 1.5, 's', {0.5, 1e3}", "no such", "option 'n': --set n=no such: must be a number (default 1.5)"),
            ("'n', 'a', 'kind', {'a', 'b'}", "c", "option 'n': --set n=c: must be one of a, b (default 'a')"),
            ("'n', 20, 'balls', {30, 100}", "", "option 'n': default = 20: must be a whole number, 30 to 100"),
            ("'n', 20, 'balls', {100, 1}", "", "option 'n': range: low = 100 is above high = 1"),
            ("'n', 20, 'balls', {1}", "", "option 'n': range = a table of 1 values: must be {low, high}"),
            ("'n', 20, 'balls', {1, 1/0}", "", "option 'n': range[2] = inf: must be finite"),
            ("'n', 'a', 'kind', {}", "", "option 'n': choice = a table: must be a list of strings, {'one', 'two'}"),
            ("'n', 'a', 'kind', {1}", "", "option 'n': choice[1] = 1: must be a string"),
            ("'n', true, '', {true}", "", "option 'n': choice = a table: must be left out: true or false is one"),
        ]:
            path = self.write("wrong.lua", f"{TABLE}local n = option({declared})\n")
            self.refused([SMARTSURF, "check", path, *(["--set", f"n={given}"] if given else [])], "wrong.lua:2: ", fact)
        path = self.write("right.lua", TABLE + "local n = option('n', 20, 'balls', {1, 100})\nprint(math.type(n), n)\n")
        for given in ("1", "100", "7.0"):
            status, out, err = self.run_program(SMARTSURF, "run", path, "--no-controller", "--ticks", "1", "--set", f"n={given}")
            self.assertEqual((status, out), (0, f"integer\t{float(given):.0f}\n"), err)
        status, out, err = self.run_program(SMARTSURF, "run", path, "--help")
        self.assertIn("n = 20                      balls; 1 to 100\n", out)

    def test_shipped_scripts_refuse_nonsense_in_every_option(self):
        count = 0
        for script in sorted((ROOT / "scripts").rglob("*.lua")):
            _, listed, _ = self.run_program(SMARTSURF, "run", str(script), "--help")
            for name in re.findall(r"^  (\w+) = ", listed.partition("\nOptions of ")[2], re.MULTILINE):
                for value in ("-1e18", "1e18"):  # of a range of its own; of what is no number, test_options_out_of_their_range
                    if name == "known" or (name, value) == ("seed", "1e18"):  # a file; a seed like any other
                        continue
                    count += 1
                    self.refused([SMARTSURF, "check", str(script), "--set", f"{name}={value}"], ".lua:")
        self.assertGreater(count, 125)

    def test_failing_script_keeps_recording(self):
        path = self.write("late.lua", TABLE + "at(0.5, function()\n  local x = nil + 1\nend)\n")
        self.refused([SMARTSURF, "run", path, "--no-controller", "--ticks", "100", "--record",
                      str(self.folder / "late.h5")], "late.lua:3:")
        status, out, _ = self.run_program(SMARTSURF, "info", str(self.folder / "late.h5"))
        self.assertEqual(status, 0)
        self.assertIn("late.lua:3:", out)

    def test_flags(self):
        path = self.write("ok.lua", TABLE)
        run = [SMARTSURF, "run", path, "--no-controller", "--ticks", "1"]
        self.refused([SMARTSURF, "run", str(self.folder / "none.lua")], "none.lua")
        self.refused([SMARTSURF, "run"], "EXPERIMENT.lua")
        self.refused([SMARTSURF, "fly"], "fly")
        self.refused(["env", "-u", "DISPLAY", "-u", "WAYLAND_DISPLAY", SMARTSURF])  # on a display: the start screen
        self.refused(run + ["--spede", "2"], "--spede", "(see smartsurf run --help)")
        self.refused([SMARTSURF, "run", path, "--untill", "5"], "unknown flag '--untill'; did you mean '--until'?")
        self.refused(run + ["--verify"], "'--verify'; it is a flag of smartsurf replay")
        self.refused([SMARTSURF, "--versoin"], "did you mean '--version'?")
        self.refused([SMARTSURF, path], f"the command comes first: smartsurf run {path}")
        recording = self.folder / "ok.h5"
        recording.write_bytes(b"\x89HDF\r\n\x1a\n")
        for program in (SMARTSURF, APRON):
            self.refused([program, str(recording)], f"the command comes first: smartsurf replay {recording}")
            self.refused([program, SORT_APS], f"the command comes first: apron run {SORT_APS}")
            self.refused([program, path], f"the command comes first: smartsurf run {path}")
        self.refused([APRON, "run", SORT_APS, "--tick", "5"], "did you mean '--ticks'?", "(see apron run --help)")
        for flag in ("--until", "--stats", "--pace", "--controller", "--cells", "--picture-size", "--shm"):
            self.refused([SMARTSURF, "run", path, flag, ""], f"{flag}: must not be empty (see smartsurf run --help)")
        self.refused([SMARTSURF, "compare", path, "--until", ""], "--until: must not be empty")
        self.refused([APRON, "run", SORT_APS, "--shm", ""], "--shm: must not be empty (see apron run --help)")
        self.refused([str(BIN / "shm_dump"), self.shm, "--channel", ""], "--channel: must not be empty")
        self.refused([str(BIN / "surface_bridge"), "/dev/null", "--shm", ""], "--shm: must not be empty")
        self.refused(run + ["--close"], "--close", "needs --window")
        self.refused(run + ["--camera", "1,2,3"], "--camera 1,2,3", "X,Y,Z:X,Y,Z")
        self.refused(run + ["--camera", "0,0,1:0,0,5"], "--camera 0,0,1:0,0,5", "the lower point")
        self.refused(run + ["--plot", "purity"], "--plot", "needs --window")
        self.refused(run + ["--window", "--plot", "sped:3"], "--plot sped:3", "CHANNEL:ROW,COLUMN")
        self.refused(run + ["--pace", "fast"], "--pace", "fast")
        self.refused(run + ["--pace", "-1"], "--pace", "-1")
        self.refused(run + ["--mode", "both"], "both")
        self.refused(run + ["--set", "x"], "--set", "NAME=VALUE")
        self.refused(run + ["--set", "size=3"], "size")
        self.refused(run + ["--controller-set", "gain=3"], "--controller-set", "--controller PROGRAM.aps")
        self.refused(run + ["--record", "run.txt"], "run.txt")
        self.refused(run + ["--record", "/nowhere/run.h5"], "/nowhere")
        self.refused(run + ["--stats", "/nowhere/run.json"], "/nowhere")
        self.refused(run + ["--screenshot", "a.jpg"], "a.jpg", ".png")
        self.refused(run + ["--screenshot", "a.png@late"], "late")
        self.refused(run + ["--video", "a.avi"], "a.avi", ".mp4")
        self.refused(run + ["--video", "/nowhere/a.mp4"], "/nowhere")
        self.refused([SMARTSURF, "run", path, "--until", "nan"], "--until")
        self.refused([SMARTSURF, "run", path, "--no-controller", "--until", "1e300"], "--until", "1e300", "at most 1e9")
        for flag in ("--ticks", "--seed"):
            for value in ("-1", "1.5", "18446744073709551616"):
                self.refused([SMARTSURF, "run", path, "--no-controller", flag, value], flag, value)
        self.refused([SMARTSURF, "run", path, "--controller", "none.aps"], "none.aps")
        self.refused([SMARTSURF, "run", path, "--shm", "no/such/name"], "no/such/name")
        self.refused([SMARTSURF, "info", path], "ok.lua")
        self.refused([SMARTSURF, "plot", path, "-o", "x.svg"], "ok.lua")
        self.refused([APRON, "run", str(self.folder / "none.aps")], "none.aps")
        self.refused([APRON, "run", SORT_APS, "--shm", "nobody", "--wait", "0"], "nobody")
        self.refused([APRON, "run", SORT_APS, "--size", "0x5"], "0x5")
        self.refused([APRON, "run", SORT_APS, "--profile", "/nowhere/p.json"], "--profile", "/nowhere")
        self.refused([APRON, "chekc", SORT_APS], "no command 'chekc'", "did you mean 'check'")

    def test_unwritable_output_is_refused_before_the_run(self):
        path = self.write("says.lua", TABLE + "on_finish(function() print('ran') end)\n")
        for flag, file, fact in (("--stats", ".", "is a folder"), ("--stats", "none/s.json", "no folder none"),
                                 ("--screenshot", "none/a.png", "no folder none"), ("--video", "-", "no file's name"),
                                 ("--video", "none/a.mp4", "no folder none")):
            command = [SMARTSURF, "run", path, "--no-controller", "--ticks", "1", flag, file]
            self.refused(command, flag, file, fact)
            self.assertEqual(self.run_program(*command)[1], "")

    def limited(self, limit, bytes_, *command):
        """Like run_program(), with a resource limit: on memory, or on file size, which exercises the error handling
        for a full disk."""
        def limit_it():
            signal.signal(signal.SIGXFSZ, signal.SIG_IGN)
            resource.setrlimit(limit, (bytes_, bytes_))
        child = subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True, cwd=self.folder,
                                 preexec_fn=limit_it)
        self.children.append(child)
        status, out, err = self.finish(child)
        self.assertEqual(len(err.strip().splitlines()), 1, err)
        return status, err

    def test_disk_full_during_run_keeps_recorded_frames(self):
        recording = self.folder / "run.h5"
        command = [SMARTSURF, "run", str(ROOT / "scripts/examples/wave.lua"), "--no-controller", "--record", str(recording)]
        status, err = self.limited(resource.RLIMIT_FSIZE, 2 << 20, *command)
        self.assertEqual(status, 1, err)
        self.assertRegex(err, r"^smartsurf: .*run\.h5: cannot be written: File too large$")
        status, out, err = self.run_program(SMARTSURF, "info", str(recording))
        self.assertEqual(status, 0, err)
        self.assertRegex(out, r"frames +[1-9]")

    def test_full_disk_leaves_no_empty_file(self):
        path = self.write("table.lua", TABLE)
        for flag, name in (("--record", "run.h5"), ("--record", "run.csv"), ("--stats", "stats.json")):
            status, err = self.limited(resource.RLIMIT_FSIZE, 0, SMARTSURF, "run", path, "--no-controller", "--ticks", "1",
                                       flag, name)
            self.assertIn(status, (1, 2), err)
            self.assertRegex(err, f"{name}: cannot be written: File too large$")
        self.assertEqual([p.name for p in self.folder.iterdir()], ["table.lua"])

    def test_stats_can_be_written_to_stdout_and_links(self):
        path = self.write("table.lua", TABLE)
        (self.folder / "link.json").symlink_to("real.json")
        (self.folder / "real.json").write_text("")
        run = [SMARTSURF, "run", path, "--no-controller", "--ticks", "1", "--stats"]
        for stdout in "/dev/stdout", "-":
            self.assertEqual(json.loads(self.run_program(*run, stdout)[1])["ticks"], 1)
        self.assertEqual(self.run_program(*run, "link.json")[0], 0)
        self.assertTrue((self.folder / "link.json").is_symlink())
        self.assertEqual(json.loads((self.folder / "real.json").read_text())["ticks"], 1)

    def test_stats_follow_what_was_written_to_a_redirected_stdout(self):
        path = self.write("says.lua", TABLE + "on_finish(function() print('ran') end)\n")
        run = [SMARTSURF, "run", path, "--no-controller", "--ticks", "1", "--stats"]
        output = self.folder / "output.txt"
        for mode in "w", "a":
            for stdout in "/dev/stdout", "-":
                output.write_text("old\n")
                with open(output, mode) as file:
                    file.write("before\n")
                    file.flush()
                    self.assertEqual(subprocess.run([*run, stdout], stdout=file, stderr=subprocess.DEVNULL).returncode, 0)
                    os.write(file.fileno(), b"after\n")
                before, _, text = output.read_text().rpartition("ran\n")
                self.assertEqual(before, "before\n" if mode == "w" else "old\nbefore\n")
                self.assertEqual(json.loads(text.removesuffix("after\n"))["ticks"], 1)

    def test_missing_apron_error_lists_searched_places(self):
        lonely = shutil.copy(SMARTSURF, self.folder / "smartsurf")
        child = subprocess.Popen([lonely, "run", SORT_LUA, "--controller", SORT_APS, "--ticks", "1"], text=True,
                                 stderr=subprocess.PIPE, env={**os.environ, "PATH": str(self.folder)})
        status, _, err = self.finish(child)
        self.assertEqual(status, 2, err)
        self.assertIn("cannot start apron: it is neither beside smartsurf nor on PATH", err)

    def test_unwritable_stdout_is_reported(self):
        path = self.write("table.lua", TABLE)
        self.run_program(SMARTSURF, "run", path, "--no-controller", "--ticks", "1", "--record", "run.h5")
        with open("/dev/full", "w") as full:
            child = subprocess.Popen([SMARTSURF, "info", "run.h5"], stdout=full, stderr=subprocess.PIPE, text=True,
                                     cwd=self.folder)
            status, _, err = self.finish(child)
        self.assertEqual((status, err), (1, "smartsurf: cannot write the output: No space left on device\n"))

    def test_out_of_memory_reports_one_line(self):
        path = self.write("large.lua", "surface { rows = 4096, columns = 4096, actuator = pin {} }\n")
        status, err = self.limited(resource.RLIMIT_AS, 256 << 20, SMARTSURF, "run", path, "--no-controller", "--ticks", "1")
        self.assertEqual(status, 1, err)
        self.assertIn("not enough memory", err)

    def test_recording_that_needs_more_memory_than_there_is(self):
        path = self.write("table.lua", TABLE)
        self.run_program(SMARTSURF, "run", path, "--no-controller", "--ticks", "1", "--record", "run.h5")
        refusal = "smartsurf: run.h5: needs more memory than a reader of recordings may have\n"
        found = set()
        for mib in range(90, 180, 4):  # from what the program itself needs to what HDF5 does
            child = subprocess.run([SMARTSURF, "info", "run.h5"], capture_output=True, text=True, cwd=self.folder,
                                   preexec_fn=lambda: resource.setrlimit(resource.RLIMIT_AS, (mib << 20, mib << 20)))
            if "not enough memory" in child.stderr or "shared" in child.stderr or child.returncode < 0:
                continue  # the program does not start
            found.add((child.returncode, child.stderr))
        self.assertEqual(found, {(0, ""), (2, refusal)})

    def test_controller_set(self):
        experiment = self.write("ok.lua", TABLE)
        program = self.write("gain.aps", "sim.slider.add('gain', 0, 9, 1)\nprintln('gain ', sim.slider.get('gain'))\n")
        run = [SMARTSURF, "run", experiment, "--controller", program]
        status, out, err = self.run_program(*run, "--controller-set", "gain=3")
        self.assertEqual(status, 0, err)
        self.assertIn("gain 3", out)
        status, _, err = self.run_program(*run, "--controller-set", "gian=3")
        self.assertEqual(status, 2)
        self.assertIn("apron: error: --set: the program has no slider or switch 'gian'; it has gain", err)
        status, _, err = self.run_program(*run, "--set", "gain=3")
        self.assertEqual(status, 2)
        self.assertIn("no option 'gain'", err)

    def test_a_value_outside_of_a_slider(self):
        program = self.write("gain.aps", "sim.slider.add('gain', -0.5, 9, 1)\nsim.switch.add('on')\nprintln(sim.slider.get('gain'))\nsurface.step\n")
        for value, problem in (("gain=9.001", "'gain' = 9.001 is not from -0.5 to 9"), ("gain=-1", "'gain' = -1 is not from -0.5 to 9"),
                               ("on=0.5", "the switch 'on' is 0 or 1, not 0.5"), ("on=2", "the switch 'on' is 0 or 1, not 2")):
            for command in (["run"], ["debug"], ["compile", "--target", "c", "--size", "8x8", "-o", "gain.c"]):
                status, out, err = self.run_program(APRON, *command, program, "--set", value)
                self.assertEqual((status, out, err), (2, "", f"apron: error: --set: {problem}\n"), command)
        for value in ("gain=9", "gain=-.5", "on=1"):
            self.assertEqual(self.run_program(APRON, "run", program, "--set", value)[0], 0, value)

    def test_programs(self):
        path = self.write("wrong.aps", "!register(SIGNAL)\nSIGNAL = SIGNL + 1\n")
        for command in ("check", "run"):
            status, _, err = self.run_program(APRON, command, path)
            self.assertEqual(status, 2)
            first = err.strip().splitlines()
            self.assertIn("wrong.aps:2:10: error:", first[0])
            self.assertIn("SIGNL", first[0])
            self.assertIn("SIGNAL", err)
            self.assertIn("^", err)

    def test_nonlocal_program_is_reported(self):
        path = self.write("global.aps", "!register(A)\nA = globalsum(A)\n")
        for flags in (["--local"], ["--profile", "local"]):
            status, out, err = self.run_program(APRON, "check", *flags, path)
            self.assertEqual((status, err), (1, ""))
            self.assertIn("global.aps:2: not local: globalsum", out)
        self.refused([APRON, "check", "--profile", "global", path], "'global' is unknown; known: local")

    def test_new_writes_a_pair_that_runs_and_overwrites_nothing(self):
        status, out, err = self.run_program(SMARTSURF, "new", "mine")
        self.assertEqual((status, err), (0, ""))
        self.assertIn("smartsurf run mine.lua --controller mine.aps", out)
        status, _, err = self.run_program(SMARTSURF, "run", "mine.lua", "--controller", "mine.aps", "--until", "12", "--stats", "s.json")
        self.assertEqual(status, 0, err)
        self.assertGreater(json.loads((self.folder / "s.json").read_text())["metrics"]["mean_x"], 19)  # at the east wall
        self.assertEqual(self.run_program(APRON, "check", "--local", "mine.aps")[0], 0)
        self.refused([SMARTSURF, "new", "mine"], "mine.lua exists")
        self.refused([SMARTSURF, "new", "none/mine"], "no folder none")
        for name in ("", "none/", "."):
            self.refused([SMARTSURF, "new", name], "must be a name")

    def test_a_pair_whose_names_need_quotes(self):
        (self.folder / "n w").mkdir()
        status, out, err = self.run_program(SMARTSURF, "new", "n w/it's ä $b")
        self.assertEqual((status, err), (0, ""))
        command = shlex.split(out.splitlines()[1])
        self.assertEqual(command, [SMARTSURF, "run", "n w/it's ä $b.lua", "--controller", "n w/it's ä $b.aps", "--until", "10", "--window"])
        status, _, err = self.run_program(*command[:5], "--ticks", "5", "--record", "run.h5")
        self.assertEqual(status, 0, err)
        self.assertIn("program     n w/it's ä $b.aps", self.run_program(SMARTSURF, "info", "run.h5")[1])

    def test_waiting_names_the_program_beside_the_experiment(self):
        for name, shown in ("mine", r"mine\.aps"), ("my own", r"'my own\.aps'"):
            self.run_program(SMARTSURF, "new", name)
            surface = self.start(SMARTSURF, "run", f"{name}.lua", "--shm", self.shm, "--ticks", "2")
            command = surface.stderr.readline().strip().partition("attach one with: ")[2]
            self.assertRegex(command, rf"^(.*/)?apron run {shown} --shm {self.shm}$")  # without a folder where apron is on PATH
            self.assertEqual(self.run_program(*shlex.split(command))[0], 0)
            self.assertEqual(self.finish(surface)[0], 0)

    def test_usage_lines_carry_the_program_name(self):
        for command in ([SMARTSURF, "run"], [SMARTSURF, "info"], [APRON, "check"]):
            out = self.run_program(*command, "--help")[1]
            self.assertIn(f"Usage: {pathlib.Path(command[0]).name} {command[1]} ", out)

    def test_objects_thrown_by_huge_forces_leave_and_run_continues(self):
        path = self.write("fling.lua", """
surface { rows = 8, columns = 8 }
for i = 1, 6 do
  sphere { radius = 1, position = {i, 4, 4 + 2 * i}, mass = 1e-9 }
  box { size = {1, 1, 1}, position = {i, 2, 4 + 2 * i}, mass = 1e-9 }
end
local left = 0
on_tick(function()
  for id = 0, 11 do
    object(id):push { force = {random(-5e11, 5e11), random(-5e11, 5e11), random(-5e11, 5e11)}, point = {1e6, 1e6, 1e6} }
  end
end)
on_leave(function(id) left = left + 1 end)
on_finish(function() metric('left', left) end)""")
        status, _, err = self.run_program(SMARTSURF, "run", path, "--no-controller", "--until", "1", "--stats", "fling.json")
        self.assertEqual(status, 0, err)
        self.assertGreaterEqual(json.loads((self.folder / "fling.json").read_text())["metrics"]["left"], 12)

    def test_controller_error_gives_status_2(self):
        path = self.write("wrong.aps", "x = surface.sense('pressure')\n")
        status, _, err = self.run_program(SMARTSURF, "run", SORT_LUA, "--controller", path, "--ticks", "10")
        self.assertEqual(status, 2, err)
        self.assertIn("wrong.aps:1", err)

    def test_non_finite_heights_are_clamped_and_counted(self):
        path = self.write("nan.aps", "!register(H)\nH = 0\nH = H / 0\nwhile(1)\n  surface.actuate('height', H)\n"
                                     "  surface.step\nendwhile\n")
        stats = self.folder / "stats.json"
        status, _, err = self.run_program(SMARTSURF, "run", SORT_LUA, "--controller", path, "--ticks", "20",
                                          "--stats", str(stats))
        self.assertEqual(status, 0, err)
        # Border cells have no actuator.
        self.assertEqual(json.loads(stats.read_text())["actuator_values_clamped"], 20 * 62 * 62)

    def test_a_file_for_another_program_is_recognised(self):
        self.write("plain.lua", "surface { rows = 4, columns = 4, actuator = pin {} }")
        self.write("named.txt", "-- An experiment.\nsurface { rows = 4, columns = 4, actuator = pin {} }")
        self.write("program.aps", "println(1)")
        self.write("commented.txt", "// A program.\nprintln(1)")
        self.assertEqual(self.run_program(SMARTSURF, "run", "plain.lua", "--no-controller", "--until", "0.1", "--record", "run.h5")[0], 0)
        for command, message in (
                ((SMARTSURF, "run", "run.h5"), "smartsurf: run.h5: is a recording, not an experiment: smartsurf replay run.h5 shows it"),
                ((SMARTSURF, "check", "program.aps"), "smartsurf: program.aps: is an APRON program, not an experiment: apron run program.aps runs it, "
                                                      "or smartsurf run EXPERIMENT.lua --controller program.aps"),
                ((SMARTSURF, "check", "commented.txt"), "smartsurf: commented.txt: is an APRON program, not an experiment: apron run commented.txt "
                                                        "runs it, or smartsurf run EXPERIMENT.lua --controller commented.txt"),
                ((SMARTSURF, "info", "plain.lua"), "smartsurf: plain.lua: is an experiment, not a recording: smartsurf run plain.lua --record FILE.h5 "
                                                   "makes one"),
                ((APRON, "run", "plain.lua"), "apron: error: plain.lua: is an experiment, not a program: smartsurf run plain.lua runs it"),
                ((APRON, "check", "named.txt"), "apron: error: named.txt: is an experiment, not a program: smartsurf run named.txt runs it"),
                ((APRON, "run", "run.h5"), "apron: error: run.h5: is a recording, not a program: smartsurf info run.h5 describes it")):
            status, _, err = self.run_program(*command)
            self.assertEqual((status, err), (2, message + "\n"))
        self.write("tet.obj", "v 0 0 0\nv 1 0 0\n")
        self.write("arm.txt", "<robot name='arm'></robot>")
        (self.folder / "picture").write_bytes(b"\x89PNG\r\n\x1a\n")
        for command, facts in (
                ((SMARTSURF, "run", "tet.obj"), "tet.obj: is a mesh, not an experiment, in which mesh { file = 'tet.obj', ... }"),
                ((SMARTSURF, "check", "arm.txt"), "arm.txt: is a robot description, not an experiment, in which model { file = 'arm.txt'"),
                ((SMARTSURF, "run", "picture"), "picture: is a picture, not an experiment"),
                ((SMARTSURF, "info", "picture"), "picture: is a picture, not a recording"),
                ((SMARTSURF, "export", "tet.obj", "-o", "x.html"), "tet.obj: is a mesh, not a recording"),
                ((APRON, "check", "arm.txt"), "arm.txt: is a robot description, not a program"),
                ((APRON, "run", "picture"), "picture: is a picture, not a program"),
                ((SMARTSURF, "run", "plain.lua", "--controller", "plain.lua"),
                 "--controller plain.lua: is an experiment, not an APRON program, a policy or a command"),
                ((SMARTSURF, "run", "plain.lua", "--controller", "run.h5"), "--controller run.h5: is a recording, not"),
                ((SMARTSURF, "run", "plain.lua", "--controller", "commented.txt"),
                 "--controller commented.txt: is an APRON program, whose name must end in .aps")):
            self.refused(command, facts)

    @needs_view
    def test_pictures_after_the_end_are_refused_or_named(self):
        self.write("table.lua", TABLE + "at(0.3, function() stop('enough') end)\n")
        run = [SMARTSURF, "run", "table.lua", "--no-controller", "--picture-size", "64x40", "--quality", "low"]
        self.refused([*run, "--until", "0.2", "--screenshot", "a.png@5"], "--screenshot a.png@5: the run ends before, --until 0.2")
        self.assertFalse((self.folder / "a.png").exists())
        status, _, err = self.run_program(*run, "--screenshot", "a.png@5", "--screenshot", "b.png@0.1")
        self.assertEqual(status, 0, err)
        self.assertRegex(err, r"a\.png shows the end at 0\.3\d* s: the run did not reach 5 s")
        self.assertNotIn("b.png shows", err)

    @needs_view
    def test_apron_pictures_after_the_end_are_refused_or_named(self):
        self.write("p.aps", "!register(A)\nA = 1\nsim.frame\nA = 2\nsim.frame\n")
        run = [APRON, "run", "p.aps", "--size", "2x2"]
        self.refused([*run, "--ticks", "5", "--screenshot", "a.png@9"], "--screenshot: 'a.png@9': the run ends before, --ticks 5")
        self.refused([*run, "--video", "a.mp4", "--geometry", "641x480"], "--geometry: '641x480': a video needs even numbers")
        self.assertEqual({p.name for p in self.folder.iterdir()}, {"p.aps"})
        status, _, err = self.run_program(*run, "--ticks", "9", "--screenshot", "a.png@9", "--screenshot", "b.png@1", "--screenshot", "c.png")
        self.assertEqual((status, err), (0, "apron: a.png shows the end at tick 2: the run did not reach tick 9\n"))
        status, _, err = self.run_program(*run, "--ticks", "2", "--screenshot", "a.png@2", "--geometry", "641x481")
        self.assertEqual((status, err), (0, ""))
        self.assertEqual(struct.unpack(">II", (self.folder / "a.png").read_bytes()[16:24]), (641, 481))

    def test_unlikely_placements_and_clamped_commands_are_told(self):
        self.write("table.lua", """
            surface { rows = 8, columns = 8, actuator = pin { range = {0, 2} } }
            sphere { radius = 1, position = {4, 4, 3} }
            sphere { radius = 1, position = {4.5, 4, 3}, label = 'twin' }
            sphere { radius = 1, position = {40, 4, 3} }
            on_tick(function(t, tick) if tick < 2 then cells:target('height', 1, 1, 7) end end)""")
        warnings = ["smartsurf: warning: object 2 at (40, 4, 3) is beside the table (x -0.5 … 7.5, y -0.5 … 7.5) and will fall",
                    "smartsurf: warning: object 0 at (4, 4, 3) is inside object 1 'twin': they will be thrown apart"]
        status, out, err = self.run_program(SMARTSURF, "check", "table.lua")
        self.assertEqual((status, err.splitlines()), (0, warnings))
        status, out, err = self.run_program(SMARTSURF, "run", "table.lua", "--no-controller", "--until", "0.1")
        self.assertEqual((status, err.splitlines()[:2]), (0, warnings))
        self.assertRegex(out + err, r"warning: [12] commands were outside their channel's range and clamped to it")
        # Those of a program as well.
        self.write("table.lua", "surface { rows = 8, columns = 8, actuator = pin { range = {0, 2} } }")
        self.write("up.aps", "!register(UP)\nUP = 7\nwhile(1)\n  surface.actuate('height', UP)\n  surface.step\nendwhile\n")
        status, out, err = self.run_program(SMARTSURF, "run", "table.lua", "--controller", "up.aps", "--ticks", "3", "--stats", "s.json")
        clamped = json.loads((self.folder / "s.json").read_text())["actuator_values_clamped"]
        self.assertGreaterEqual(clamped, 2 * 64)
        self.assertIn(f"warning: {clamped} commands were outside", err)
        self.assertNotIn("NaN", err)

    def test_unlikely_objects_that_are_added_are_told_once(self):
        self.write("table.lua", """
            surface { rows = 8, columns = 8, actuator = pin { range = {0, 2} } }
            sphere { radius = 1, position = {4, 4, 0.3} }
            on_tick(function(t, tick)
              if tick == 2 or tick == 3 then
                sphere { radius = 1, position = {2, 2, -9}, label = 'low' }
                sphere { radius = 50, position = {2, 2, 60} }
              elseif tick == 4 then
                sphere { radius = 1, position = {2, 2, 5} }
                sphere { radius = 1, position = {90, 2, 5}, velocity = {-9, 0, 0} }
                object(sphere { radius = 1, position = {95, 2, 5} }):remove()
              end
            end)""")
        partly = "smartsurf: warning: object 0 at (4, 4, 0.3) is 0.7 u deep inside the cells, whose tops are at z = 0 or higher"
        status, _, err = self.run_program(SMARTSURF, "check", "table.lua")
        self.assertEqual((status, err.splitlines()), (0, [partly]))
        status, _, err = self.run_program(SMARTSURF, "run", "table.lua", "--no-controller", "--until", "0.2")
        self.assertEqual((status, [line for line in err.splitlines() if "warning" in line]), (0, [
            partly,
            "smartsurf: warning: object 1 'low' at (2, 2, -9) is below the cells, whose feet are at z = -2",
            "smartsurf: warning: object 2 at (2, 2, 60) is larger than the table"]))

    @needs_view
    def test_speed_leaves_out_the_pictures(self):
        self.write("table.lua", TABLE)
        status, _, err = self.run_program(SMARTSURF, "run", "table.lua", "--no-controller", "--ticks", "10", "--screenshot", "a.png@0.1",
                                          "--quality", "high", "--picture-size", "400x300", "--stats", "s.json")
        self.assertEqual(status, 0, err)
        stats = json.loads((self.folder / "s.json").read_text())
        self.assertLess(stats["wall_s"], 0.5 * stats["ms_per_tick"]["render"]["total_s"])
        self.assertAlmostEqual(stats["real_time_factor"], stats["simulated_s"] / stats["wall_s"])
        self.assertIn(f" s simulated in {stats['wall_s']:.1f} s ({stats['real_time_factor']:.3g}x real time)", err)

    @needs_view
    def test_no_picture_stays_of_a_program_that_is_refused(self):
        self.write("table.lua", TABLE)
        self.write("surface.aps", "!register(A)\nA = surface.sense('proximity')\n")
        self.write("wrong.aps", "A = no_such_instruction(1)\n")
        pictures = ["--screenshot", "a.png", "--screenshot", "b.png@7"]
        run = [SMARTSURF, "run", "table.lua", "--until", "1", "--picture-size", "64x40", "--quality", "low", *pictures]
        for command in ([APRON, "run", "--size", "8x8", *pictures[:2], "surface.aps"], [*run, "--controller", "wrong.aps"],
                        [*run, "--controller", "exit 2"]):
            with self.subTest(command=command):
                status, _, err = self.run_program(*command)
                self.assertEqual(status, 2, err)
                self.assertNotIn("shows the end", err)
                self.assertEqual(sorted(path.name for path in self.folder.iterdir() if "png" in path.name), [])

    def test_nan_commands_are_told_apart_from_clamped_ones(self):
        self.write("table.lua", "surface { rows = 8, columns = 8, actuator = pin { range = {0, 2} } }")
        for value, nan, clamped in (("math.sqrt(-1 - cell.x)", 64, 0), ("1 / (0 * cell.x)", 0, 64),
                                    ("math.sqrt(cell.x - 3.5) + 9", 32, 32)):
            self.write("up.aps", f"!register(UP)\nUP = {value}\nwhile(1)\n  surface.actuate('height', UP)\n  surface.step\nendwhile\n")
            status, _, err = self.run_program(SMARTSURF, "run", "table.lua", "--controller", "up.aps", "--ticks", "3",
                                              "--stats", "s.json")
            self.assertEqual(status, 0, err)
            stats = json.loads((self.folder / "s.json").read_text())
            with self.subTest(value=value):
                nan_found = stats["actuator_values_nan"]
                for count, found, said in (
                        (nan, nan_found, "commands were NaN and replaced by their channel's safe value"),
                        (clamped, stats["actuator_values_clamped"] - nan_found, "commands were outside their channel's range and clamped to it")):
                    self.assertIn(found, (3 * count, 4 * count))  # the last answer may come too late
                    self.assertEqual(f"warning: {found} {said}" in err, count > 0, err)

    def test_shipped_experiments_are_told_nothing(self):
        for folder in ("case-study", "tasks", "examples"):
            for experiment in sorted((ROOT / "scripts" / folder).glob("*.lua")):
                if experiment.with_suffix('.aps').exists() or folder != "tasks":  # not a module
                    status, _, err = self.run_program(SMARTSURF, "check", str(experiment))
                    self.assertEqual((status, err), (0, ""), experiment.name)


if __name__ == "__main__":
    unittest.main()
