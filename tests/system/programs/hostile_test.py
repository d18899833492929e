"""Hostile and mistaken files, names and descriptors: nothing is lost, nothing waits, nothing escapes."""
import math
import pty
import resource
import shutil
import struct
import sys
import zipfile

from programs import *

CONTROL_CODES = ("\x1b", "\x07", "\x9b", "\u202e", "\u2028", "\u061c", "\u200e", "\u200f")
TABLE = "surface { rows = 4, columns = 4, actuator = pin {} }\nsphere { radius = 1, position = {1, 1, 3} }\n"


class Hostile(ProgramTest):
    def shell(self, text, *arguments):
        """Runs a shell command whose "$@" are the arguments."""
        return self.run_program("/bin/sh", "-c", text, "sh", *map(str, arguments))


class Streams(Hostile):
    """Descriptors 0, 1 and 2 are never files of the program."""

    def test_recording_without_standard_streams_is_readable(self):
        table = self.write("table.lua", TABLE + "every(0.1, function() print(('another '):rep(2000)) end)\n")
        for closed in ("1>&-", "2>&-", "1>&- 2>&-", "0<&- 1>&- 2>&-"):
            self.shell(f'exec "$@" {closed}', SMARTSURF, "run", table, "--no-controller", "--ticks", 50, "--record", "r.h5",
                       "--record", "r.csv", "--stats", "s.json")
            status, out, err = self.run_program(SMARTSURF, "info", "r.h5")
            self.assertEqual(status, 0, f"{closed}: {out}{err}")
            self.assertNotIn("another", (self.folder / "r.csv").read_text())
            self.assertEqual(json.loads((self.folder / "s.json").read_text())["ticks"], 50)
            (self.folder / "r.h5").unlink()

    def test_output_that_cannot_be_written_is_a_failure(self):
        table = self.write("table.lua", TABLE)
        program = self.write("p.aps", "!register(A)\nA = 1\nprint(globalsum(A))\n")
        for command in ((SMARTSURF, "check", table), (APRON, "run", program)):
            status, _, err = self.shell('exec "$@" 1>&-', *command)
            self.assertEqual(status, 1, err)

    def test_surfaces_without_standard_streams_keep_their_header(self):
        table = self.write("table.lua", TABLE + "every(0.01, function() print(('a line '):rep(2000)) end)\n")
        surfaces = (
            (SMARTSURF, "run", table, "--shm", self.shm, "--mode", "passive"),
            (str(BIN / "fake_surface"), "--shm", self.shm, "--mode", "passive", "--period-ms", "1"))
        for command in surfaces:
            child = self.start("/bin/sh", "-c", 'exec "$@" 0<&- 1>&- 2>&-', "sh", *map(str, command))
            self.wait_for(lambda: self.segment().exists() or child.poll() is not None, "the segment")
            self.assertTrue(self.segment().exists())
            time.sleep(0.5)  # of printing
            with open(self.segment(), "rb") as segment:
                self.assertEqual(segment.read(8), b"SMRTSURF")
            child.send_signal(signal.SIGTERM)
            self.finish(child)


class Terminal(Hostile):
    """Control characters of files and scripts do not reach a terminal."""

    def on_terminal(self, *command):
        """What the command shows on a terminal."""
        master, slave = pty.openpty()
        child = subprocess.Popen([str(word) for word in command], stdin=slave, stdout=slave, stderr=slave, cwd=self.folder)
        self.children.append(child)
        os.close(slave)
        shown = b""
        try:
            while block := os.read(master, 4096):
                shown += block
        except OSError:  # the end of the last process that has it open
            pass
        os.close(master)
        self.finish(child)
        return shown

    def test_the_repl_shows_no_control_characters(self):
        mark = "".join(CONTROL_CODES[3:])
        self.write("shown.aps", f"println('{mark}')\nA = '{mark}' + 1\n")
        typed = self.write("typed", f"!include('shown.aps')\nprintln('{mark}')\n")
        shown = self.on_terminal("/bin/sh", "-c", f"{APRON} repl <{typed}").decode()
        self.assertIn("?" * len(mark), shown)
        for code in CONTROL_CODES:
            self.assertNotIn(code, shown)

    def test_messages_hold_no_control_characters(self):
        self.write("a.csv", "1,\x1b]0;title\x07\n")
        self.write("layout.csv", "x,y,z\n1,\x1b[31m,0\n")
        program = self.write("p.aps", "!register(A, 2, 1)\nA = io.array.open('a.csv')\n")
        script = self.write("s.lua", "error('red \\27[31m \\194\\155 \\u{202E} \\u{2028} \\u{61C} \\u{200E} \\u{200F}')\n")
        layout = self.write("l.lua", "surface { layout = 'layout.csv', actuator = pin {} }\n")
        for command in ((APRON, "run", program), (SMARTSURF, "check", script), (SMARTSURF, "check", layout),
                        (APRON, "check", "\x1b[31m.aps"), (SMARTSURF, "info", "\x1b[31m.h5"), (SMARTSURF, "\x1b[31m"),
                        (str(BIN / "shm_dump"), "\x1b[31m"), (SMARTSURF, "run", script, "--worlds", "2", "--no-controller")):
            status, out, err = self.run_program(*command)
            self.assertNotEqual(status, 0)
            self.assertNotEqual(err, "")
            for code in CONTROL_CODES:
                self.assertNotIn(code, out + err, command)

    @unittest.skipUnless((BIN.parent / "python/smartsurf/__init__.py").exists(), "needs the Python package")
    def test_messages_of_statements_in_python_hold_no_control_characters(self):
        name = "red\x1b[31m\x9b\u202e\u2028\u061c\u200e\u200f\n"
        for command in ((SMARTSURF, "train", name + ".lua"), (SMARTSURF, "train", "x.lua", name),
                        (SMARTSURF, "identify", name + ".h5", "--experiment", "s.lua", "-o", "i.lua"),
                        (SMARTSURF, "fmu", name + ".lua", "-o", "t.fmu"), (SMARTSURF, "export", name + ".h5", "-o", "t.usda"),
                        (str(ROOT / "scripts/sweep"), name + ".lua", "--smartsurf", SMARTSURF),
                        (str(ROOT / "scripts/sweep"), self.write("s.lua", TABLE), "--smartsurf", SMARTSURF, "--set", name)):
            status, out, err = self.run_program(*command)
            self.assertNotEqual(status, 0)
            self.assertNotEqual(err, "")
            for code in CONTROL_CODES:
                self.assertNotIn(code, out + err, command)

    def test_messages_of_runs_in_a_sweep_hold_no_control_characters(self):
        script = self.write("s.lua", TABLE + "if option('x', '', '') == 'last' then error('red \\27[31m \\u{61C}') end\n"
                            "on_finish(function() metric('success', 1) end)\n")
        shown = self.on_terminal(ROOT / "scripts/sweep", script, "--smartsurf", SMARTSURF, "--until", "0.1",
                                 "--set", "x=" + "".join(CONTROL_CODES) + ",last", "-o", "out").decode()
        self.assertRegex(shown, r"(?s)x = \\x1b\\x07.* 1 of 1 succeed.*failed   x=last.*red")
        for code in CONTROL_CODES:
            self.assertNotIn(code, shown)

    def test_printed_text_is_escaped_on_terminals_alone(self):
        script = self.write("s.lua", TABLE + "print('red \\27[31m')\nprint('\u2066der\u202e')\n")
        program = self.write("p.aps", "// \u202e\nprint('green')\nprintln('\u2029neerg')\n")
        self.assertIn(b"green", self.on_terminal(APRON, "run", program))
        self.assertIn(b"?neerg", self.on_terminal(APRON, "run", program))
        self.assertIn(b"// ?", self.on_terminal(APRON, "fmt", program))
        self.assertIn("// \u202e", self.run_program(APRON, "fmt", program)[1])
        run = (SMARTSURF, "run", script, "--no-controller", "--ticks", 1)
        self.assertNotIn(b"\x1b[31m", self.on_terminal(*run))
        self.assertIn(b"red ?[31m", self.on_terminal(*run))
        self.assertIn(b"?der?", self.on_terminal(*run))
        self.assertIn("red \x1b[31m", self.run_program(*map(str, run))[1])


class Outputs(Hostile):
    """No output replaces an input or another output, by whatever name."""

    def setUp(self):
        super().setUp()
        self.write("s.lua", TABLE + "require 'part'\n")
        self.write("part.lua", "-- required\n")
        self.program = self.write("p.aps", "!include('inner.aps')\n!register(A)\nA = 1\n")
        self.write("inner.aps", "// included\n")
        self.assertEqual(self.run_program(SMARTSURF, "run", "s.lua", "--no-controller", "--ticks", "3", "--record", "r.h5")[0], 0)

    def contents(self):
        return {p.name: p.read_bytes() for p in self.folder.iterdir() if p.is_file() and not p.is_symlink()}

    def check_refusals(self, commands, expected):
        before = self.contents()
        for command in commands:
            status, out, err = self.run_program(*map(str, command))
            self.assertEqual(status, 2, f"{command}: {out}{err}")
            self.assertRegex(err, expected, command)
            self.assertEqual(err.count("\n"), 1, err)
            self.assertEqual(self.contents(), before, command)

    def test_inputs_are_kept(self):
        for link, target in (("link.svg", "r.h5"), ("link.csv", "s.lua"), ("link.png", "part.lua"), ("link.npy", "inner.aps")):
            (self.folder / link).symlink_to(target)
        os.link(self.folder / "r.h5", self.folder / "hard.html")
        self.write("m.onnx", "a model")
        run = (SMARTSURF, "run", "s.lua", "--no-controller", "--ticks", 3)
        commands = [(*run, "--stats", "s.lua"), (*run, "--stats", "part.lua"), (*run, "--record", "link.csv"),
                    (*run, "--stats", "./../" + self.folder.name + "/s.lua"), (*run, "--worlds", 2, "--stats", "s.lua"),
                    (SMARTSURF, "run", "s.lua", "--controller", "m.onnx", "--ticks", 3, "--stats", "m.onnx"),
                    (SMARTSURF, "run", "s.lua", "--controller", "p.aps", "--ticks", 3, "--stats", "p.aps"),
                    (SMARTSURF, "run", "s.lua", "--controller", "p.aps", "--ticks", 3, "--stats", "inner.aps"),
                    (SMARTSURF, "plot", "r.h5", "-o", "link.svg"), (SMARTSURF, "export", "r.h5", "-o", "hard.html"),
                    (APRON, "run", "p.aps", "--save", "A=link.npy"), (APRON, "run", "p.aps", "--profile", "p.aps")]
        if WITH_VIEW:
            commands += [(*run, "--screenshot", "link.png", *SMALL_PICTURE)]
        self.check_refusals(commands, "would overwrite an input|is an output of this run|is the name of a program")

    def test_files_that_a_script_or_program_reads_are_kept(self):
        self.write("data.csv", "1\n")
        os.link(self.folder / "data.csv", self.folder / "hard.json")
        os.link(self.folder / "part.lua", self.folder / "module.json")
        (self.folder / "link.json").symlink_to("data.csv")
        for name, text in (("at_once", "for line in io.lines('data.csv') do end"), ("caught", "pcall(io.open, 'data.csv')"),
                           ("late", "at(0.02, function() for line in io.lines('data.csv') do end end)"),
                           ("late_caught", "at(0.02, function() pcall(io.open, 'data.csv') end)"),
                           ("late_module", "at(0.02, function() require 'part' end)")):
            self.write(name + ".lua", TABLE + text + "\n")
        for name, text in (("open", "A = io.array.open('data.csv')"), ("save", "io.array.save(A, 'data.csv')")):
            self.write(name + ".aps", f"!register(A)\n{text}\n")
        before = self.contents()
        for command in [(SMARTSURF, "run", f"{name}.lua", "--no-controller", "--ticks", 3, *output)
                        for name in ("at_once", "caught", "late", "late_caught")
                        for output in (("--stats", "data.csv"), ("--stats", "hard.json"), ("--stats", "link.json"), ("--record", "data.csv"))] + \
                       [(SMARTSURF, "run", "late_module.lua", "--no-controller", "--ticks", 3, "--stats", "module.json"),
                        (APRON, "run", "open.aps", "--size", "1x1", "--save", "A=data.csv"),
                        (APRON, "run", "open.aps", "--size", "1x1", "--profile", "hard.json"),
                        (APRON, "run", "save.aps", "--size", "1x1", "--save", "A=data.csv")]:
            status, out, err = self.run_program(*map(str, command))
            self.assertIn(status, (1, 2), f"{command}: {out}{err}")
            self.assertRegex(err, "is an output of this|reads or writes it itself", command)
            self.assertEqual(self.contents(), before, command)

    def test_what_stands_for_a_camera_is_kept(self):
        (self.folder / "cf").mkdir()
        for name in ("cam.pgm", "cf/1.pgm"):
            (self.folder / name).write_bytes(b"P5 2 2 255\n" + bytes(range(4)))
        (self.folder / "clip.y4m").write_bytes(b"YUV4MPEG2 W2 H2 Cmono\nFRAME\n" + bytes(4))
        (self.folder / "link.pgm").symlink_to("cam.pgm")
        (self.folder / "clip.csv").symlink_to("clip.y4m")
        before = {p: p.read_bytes() for p in self.folder.rglob("*") if p.is_file()}
        self.write("opens.aps", "!register(A)\nwebcam.open(0)\nA = webcam.read\n")
        before |= {self.folder / "opens.aps": (self.folder / "opens.aps").read_bytes()}
        for program in ("p.aps", "opens.aps"):
            for camera, output in (("cam.pgm", ("--save", "A=cam.pgm")), ("cam.pgm", ("--profile", "cam.pgm")), ("cam.pgm", ("--save", "A=link.pgm")),
                                   ("link.pgm", ("--save", "A=cam.pgm")), ("cf", ("--save", "A=cf/1.pgm")), ("clip.y4m", ("--save", "A=clip.csv"))):
                status, out, err = self.run_program(APRON, "run", program, "--size", "2x2", "--ticks", "1", "--camera", camera, *output)
                self.assertEqual(status, 2, (program, camera, output, out, err))
                self.assertIn("would overwrite an input", err)
                self.assertEqual({p: p.read_bytes() for p in before}, before)

    def test_a_refused_program_has_one_line(self):
        (self.folder / "prog").mkdir()
        self.write("prog/w.aps", "!register(A)\nio.array.save(A, 'prog/a.csv')\n")
        for output in (("--save", "A=prog/a.csv"), ("--profile", "prog/a.csv")):
            status, out, err = self.run_program(APRON, "run", "prog/w.aps", "--size", "1x1", *output)
            self.assertEqual(status, 2, out + err)
            self.assertRegex(err, "^[^\n]*is an output of this command\n$")

    def test_names_without_room_for_their_ending_are_refused(self):
        for name in ("r" * 249 + ".h5", "r" * 252 + ".h5"):
            status, _, err = self.run_program(SMARTSURF, "run", "s.lua", "--no-controller", "--ticks", "3", "--record", name)
            self.assertEqual(status, 2, err)
            self.assertIn("bytes shorter, because it ends in '.part' until it is complete", err)
        status, _, err = self.run_program(SMARTSURF, "run", "s.lua", "--no-controller", "--ticks", "3", "--record", "r" * 247 + ".h5")
        self.assertEqual(status, 0, err)

    def test_outputs_are_separate_files(self):
        run = (SMARTSURF, "run", "s.lua", "--no-controller", "--ticks", 3)
        self.check_refusals(((*run, "--record", "a.h5", "--stats", "a.h5"), (*run, "--record", "a.h5", "--record", "./a.h5"),
                             (*run, "--record", "a.csv", "--stats", "a.csv.part"),
                             (*run, "--worlds", 2, "--record", "a.h5", "--stats", "a-1.h5"),
                             (APRON, "run", "p.aps", "--save", "A=a.npy", "--save", "A=./a.npy")), "is the same file as")

    @needs_view
    @unittest.skipUnless(shutil.which("ffmpeg"), "needs ffmpeg")
    def test_videos_go_through_no_link_and_over_no_file(self):
        (self.folder / "q.mp4.part.mp4").symlink_to("part.lua")
        before = self.contents()
        for command in ((SMARTSURF, "run", "s.lua", "--no-controller", "--ticks", 3, *SMALL_PICTURE),
                        (SMARTSURF, "replay", "r.h5", *SMALL_PICTURE),
                        (APRON, "run", "p.aps", "--size", "2x2", "--ticks", 1, "--geometry", "320x240")):
            # The shell becomes the program, so its process id is in the part's name.
            status, out, err = self.shell('ln -s s.lua q.mp4.part$$; exec "$@"', *command, "--video", "q.mp4")
            self.assertEqual(status, 0, f"{command}: {out}{err}")
            after = self.contents()
            self.assertEqual(after.pop("q.mp4")[4:8], b"ftyp")
            self.assertEqual(after, before)

    def test_a_dangling_link_stands_for_the_file_that_it_names(self):
        (self.folder / "x.json").symlink_to("new.json")
        (self.folder / "y.json").symlink_to("new.json")
        (self.folder / "x.csv").symlink_to("new.csv")
        run = (SMARTSURF, "run", "s.lua", "--no-controller", "--ticks", 3)
        self.check_refusals(((APRON, "run", "p.aps", "--profile", "x.json", "--save", "A=x.csv", "--save", "A=new.csv"),
                             (*run, "--stats", "x.csv", "--record", "new.csv"), (*run, "--record", "x.csv", "--stats", "new.csv")),
                            "is the same file as")
        for command in ((*run, "--stats", "x.json", "--record", "x.csv"), (APRON, "run", "p.aps", "--profile", "y.json", "--save", "A=x.csv")):
            status, _, err = self.run_program(*map(str, command))
            self.assertEqual(status, 0, err)
            for name in ("new.json", "new.csv"):
                self.assertGreater((self.folder / name).stat().st_size, 0)
                (self.folder / name).unlink()
            self.assertTrue((self.folder / "x.csv").is_symlink())

    def test_devices_may_be_shared(self):
        status, _, err = self.run_program(SMARTSURF, "run", "s.lua", "--no-controller", "--ticks", "3", "--stats", "/dev/null")
        self.assertEqual(status, 0, err)

    def test_scripts_and_programs_keep_their_sources(self):
        self.write("w.lua", TABLE + "require 'part'\nio.open('part.lua', 'w'):write('gone')\n")
        self.write("w.aps", "!include('inner.aps')\n!register(A)\nio.array.save(A, 'a.csv')\n")
        os.link(self.folder / "inner.aps", self.folder / "a.csv")
        (self.folder / "x.files").mkdir()
        os.link(self.folder / "part.lua", self.folder / "x.files/part.lua")
        self.check_refusals(((SMARTSURF, "run", "w.lua", "--no-controller", "--ticks", 3, "--record", "x.h5"),), "is an input of this run")
        before = self.contents()
        status, _, err = self.run_program(APRON, "run", "w.aps")
        self.assertEqual((status, self.contents()), (2, before), err)


class RegularFiles(Hostile):
    """A pipe or a device in the place of a file is refused at once."""

    def test_pipes_are_refused(self):
        (self.folder / "device.onnx").symlink_to("/dev/zero")
        plain = self.write("plain.lua", TABLE)
        for name in ("f.lua", "f.aps", "f.onnx", "f.h5", "f.json", "f.csv", "f.png", "f.npy", "f.y4m", "f.obj", "f.urdf", "f.txt", "f.so",
                     "part.lua", "inc.aps", "palettes.txt", "video9"):
            os.mkfifo(self.folder / name)
        program = "!register(A)\n"
        for name, text in (("image.aps", "A = io.image.open('f.png')"), ("array.aps", "A = io.array.open('f.npy')"),
                           ("table.aps", "A = io.array.open('f.csv')"), ("clip.aps", "video.clip.open('f.y4m')"),
                           ("include.aps", "!include('inc.aps')"), ("camera.aps", "webcam.open(0)\nA = webcam.read"),
                           ("save.aps", "A = 1\nio.array.save(A, 'f.csv')"), ("plain.aps", "A = 1")):
            self.write(name, program + text + "\n")
        for name, text in (("require.lua", "require 'part'"), ("mesh.lua", "mesh { file = 'f.obj', position = {1, 1, 5} }"),
                           ("model.lua", "urdf { file = 'f.urdf', position = {1, 1, 5} }"), ("open.lua", "io.open('f.csv')")):
            self.write(name, TABLE + text + "\n")
        check, run = (SMARTSURF, "check"), (APRON, "run")
        for command in ((*check, "f.lua"), (*check, "require.lua"), (*check, "mesh.lua"), (*check, "model.lua"), (*check, "open.lua"),
                        (*check, "mesh.lua", "--load", "f.so"), (SMARTSURF, "info", "f.h5"), (SMARTSURF, "plot", "f.h5", "-o", "a.svg"),
                        (SMARTSURF, "plot", "f.json", "-o", "a.svg"), (*run, "f.aps"), (*run, "plain.aps", "--palettes", "f.txt"),
                        (*run, "plain.aps", "--palettes", "/dev/null", "--cost-model", "f.json", "--profile", "p.json"),
                        (APRON, "import", "f.aps"), (APRON, "fmt", "f.aps"),
                        *((SMARTSURF, "run", plain, "--controller", name) for name in ("f.aps", "f.onnx", "device.onnx"))):
            status, out, err = self.finish(self.start(*command), 20)
            self.assertEqual(status, 2, f"{command}: {out}{err}")
            self.assertRegex(err, "regular file", command)
        (self.folder / "palettes.txt").unlink()
        for name in ("image", "array", "table", "clip", "include", "save"):
            status, out, err = self.finish(self.start(*run, name + ".aps"), 20)
            self.assertEqual(status, 2, f"{name}: {out}{err}")
            self.assertRegex(err, "regular file|there is no file", name)
        status, _, err = self.finish(self.start(SMARTSURF, "run", plain, "--no-controller", "--record", "f.h5"), 20)
        self.assertEqual(status, 2, err)
        self.assertRegex(err, "f.h5: is not a regular file")
        for camera in ("video9", "f.png", "f.y4m", "/dev/null", "/dev/zero"):
            status, out, err = self.finish(self.start(*run, "camera.aps", "--camera", camera), 20)
            self.assertEqual(status, 2, f"{camera}: {out}{err}")
            self.assertRegex(err, "regular file|not a camera", camera)


class ApronFiles(Hostile):
    """A program reads and writes in its own folder and in those of --allow, and loads the modules of --module."""

    def setUp(self):
        super().setUp()
        (self.folder / "own/inner").mkdir(parents=True)
        (self.folder / "other").mkdir()

    def apron(self, text, *flags):
        self.write("own/p.aps", "!register(A)\nA = 1\n" + text + "\n")
        return self.run_program(APRON, "run", "own/p.aps", "--size", "2x2", *flags)

    def test_files_outside_the_allowed_folders_are_refused(self):
        self.write("other/secret.csv", "1,2\n3,4\n")
        (self.folder / "own/link.csv").symlink_to("../other/secret.csv")
        (self.folder / "own/folder").symlink_to("../other")
        before = {p: p.stat().st_mtime_ns for p in self.folder.rglob("*")}
        for statement in ("io.array.save(A, 'a.csv')", "io.array.save(A, 'own/../a.csv')", "io.array.save(A, 'own/folder/a.csv')",
                          "io.image.save(A, 'own/../other/a.png')", f"io.array.save(A, '{self.folder}/other/a.npy')",
                          "A = io.array.open('other/secret.csv')", "A = io.array.open('own/link.csv')", "video.clip.open('other/a.y4m')",
                          "io.image.savecount(A, 'other/f##.png', 1)"):
            status, _, err = self.apron(statement)
            self.assertEqual(status, 2, statement)
            self.assertIn("--allow", err)
            self.assertEqual({p for p in self.folder.rglob("*")}, set(before) | {self.folder / "own/p.aps"})
        _, _, err = self.apron("A = io.array.open('own/link.csv')")  # the folder where the file is
        self.assertIn(f"--allow {(self.folder / 'other').resolve()} ", err)

    def test_endless_links_and_long_names_are_called_so(self):
        (self.folder / "own/loop").symlink_to("loop")
        for name, says in (("own/loop", "Too many levels of symbolic links"), ("own/" + "x" * 300 + ".csv", "File name too long")):
            status, _, err = self.apron(f"A = io.array.open('{name}')")
            self.assertEqual(status, 2, err)
            self.assertIn(says, err)
            self.assertNotIn("--allow", err)

    def test_links_do_not_lead_outside_where_the_kernel_does_not_confine(self):
        (self.folder / "own/new.csv").symlink_to("../other/new.csv")  # which does not exist
        self.write("own/p.aps", "!register(A)\nA = 1\nio.array.save(A, 'own/new.csv')\n")
        status, _, err = self.run_program("env", "SMARTSURF_CONFINE=off", APRON, "run", "own/p.aps", "--size", "2x2")
        self.assertEqual(status, 2, err)
        self.assertIn("--allow", err)
        self.assertFalse((self.folder / "other/new.csv").exists())

    def test_allowed_folders_are_used(self):
        for statement, flags, file in (("io.array.save(A, 'own/inner/a.csv')", (), "own/inner/a.csv"),
                                       ("io.array.save(A, 'a.csv')", ("--allow", "."), "a.csv"),
                                       ("io.array.save(A, 'other/a.csv')", ("--allow", "elsewhere", "--allow", "other"), "other/a.csv")):
            status, _, err = self.apron(statement, *flags)
            self.assertEqual(status, 0, err)
            self.assertTrue((self.folder / file).exists())
        status, _, err = self.apron("", "--save", "A=other/saved.csv")  # the user's own choice
        self.assertEqual(status, 0, err)

    def test_native_code_needs_permission(self):
        self.write("evil.c", "__attribute__((constructor)) static void run(void) { fclose(fopen(\"ran\", \"w\")); }\n")
        source = self.folder / "evil.c"
        source.write_text("#include <stdio.h>\n" + source.read_text())
        subprocess.run(["cc", "-shared", "-fPIC", "-o", str(self.folder / "own/evil.so"), str(source)], check=True)
        shutil.copy(self.folder / "own/evil.so", self.folder / "other/evil.so")
        for name in ("evil", "../other/evil", "../own/evil"):
            for call in ("plugin(?, 0)", ""):
                status, _, err = self.apron(f"!module('{name}')\n{call}")
                self.assertEqual(status, 2)
                self.assertRegex(err, r"p\.aps:3: error: .*--module")
                self.assertFalse((self.folder / "ran").exists())
        _, _, err = self.apron("!module('evil')\nplugin(?, 0)", "--module", "evil")
        self.assertIn("apron_plugin_version", err)  # it was loaded

    def test_only_sources_are_included(self):
        self.write("other/notes.txt", "a secret line\n")
        (self.folder / "own/notes.aps").symlink_to("../other/notes.txt")
        for name in ("../other/notes.txt", "notes.aps", "/etc/passwd"):
            status, _, err = self.apron(f"!include('{name}')")
            self.assertEqual(status, 2)
            self.assertNotIn("secret", err)
            self.assertNotIn("root:", err)


class Liveness(Hostile):
    """Who lives is decided by locks that the kernel releases; every wait hears its end."""

    def start_surface(self, *flags):
        self.write("s.lua", TABLE)
        surface = self.start(SMARTSURF, "run", "s.lua", "--shm", self.shm, *flags)
        self.wait_for(lambda: self.segment().exists(), "the segment")
        return surface

    def start_controller(self):
        self.write("p.aps", "while(1)\nsurface.actuate('height', 0)\nsurface.step\nendwhile\n")
        controller = self.start(APRON, "run", "p.aps", "--shm", self.shm)
        self.wait_for_claim()
        return controller

    def elsewhere(self, *command):
        """Runs a command in a pid namespace of its own."""
        return self.run_program("unshare", "--user", "--map-root-user", "--pid", "--fork", "--mount-proc", *command)

    def setUp(self):
        super().setUp()
        self.has_namespaces = self.elsewhere("true")[0] == 0

    def test_living_surface_is_kept_across_pid_namespaces(self):
        if not self.has_namespaces:
            self.skipTest("this system has no user namespaces")
        surface = self.start_surface()
        for command in ((SMARTSURF, "clean", self.shm), (str(BIN / "shm_dump"), "--clean", self.shm)):
            status, out, err = self.elsewhere(*command)
            self.assertTrue(self.segment().exists(), out + err)
        self.start_controller()
        status, out, err = self.elsewhere(APRON, "run", "p.aps", "--shm", self.shm)
        self.assertEqual(status, 2, out + err)
        self.assertIn("already has a controller", err)
        surface.kill()
        surface.communicate()
        self.elsewhere(SMARTSURF, "clean", self.shm)
        self.assertFalse(self.segment().exists())

    def test_killed_controller_is_noticed_and_replaced(self):
        surface = self.start_surface()
        for _ in range(3):
            controller = self.start_controller()
            controller.kill()
            controller.communicate()
            self.wait_for(lambda: self.words("claim") == 0, "the surface to notice")
        self.assertIsNone(surface.poll())

    def test_a_cut_segment_ends_both_sides_with_one_line(self):
        for flags in ((), ("--unsafe",)):
            surface, controller = self.start_surface(*flags), self.start_controller()
            os.truncate(self.segment(), 0)
            for child in (surface, controller):
                status, _, err = self.finish(child)
                self.assertIn(status, (1, 3) if child is controller else (1,), err)
                self.assertRegex(err.splitlines()[-1], "another process has cut the shared memory|surface", err)
            self.assertFalse(self.segment().exists())

    def test_surface_without_its_name_advises_nothing(self):
        surface = self.start_surface()
        self.segment().unlink()
        status, _, err = self.finish(surface, 20)
        self.assertEqual(status, 1, err)
        self.assertIn("another process has removed", err.splitlines()[-1])

        surface = self.start_surface()
        controller = self.start_controller()
        self.segment().unlink()
        controller.kill()
        status, _, err = self.finish(surface, 20)
        self.assertEqual(status, 1, err)
        self.assertNotIn("waiting for a controller", err.splitlines()[-1])
        self.assertIn("another process has removed", err.splitlines()[-1])

    def test_controller_at_a_torn_frame_hears_its_stop_and_the_surface_end(self):
        for ends_surface in (False, True):
            surface = self.start_surface("--mode", "passive")
            controller = self.start_controller()
            surface.send_signal(signal.SIGSTOP)
            time.sleep(0.2)
            with open(self.segment(), "r+b") as file:  # the newest frame is one that no slot holds
                os.pwrite(file.fileno(), struct.pack("<I", self.words("sensors") % 2**32 + 1000), 640)
            time.sleep(0.2)
            if ends_surface:
                surface.kill()
                surface.communicate()
            else:
                controller.send_signal(signal.SIGTERM)
            status, _, err = self.finish(controller, 10)
            self.assertEqual(status, 3 if ends_surface else 128 + signal.SIGTERM, err)
            surface.kill()
            surface.communicate()
            self.segment().unlink(missing_ok=True)  # or the next controller might find that of the dead surface


class RecordingLoss(Hostile):
    """A recording that is removed, replaced or cut while the run writes it is not reported as written."""

    def lose(self, name, loss):
        self.write("s.lua", TABLE + "local n = 0\nevery(0.05, function() n = n + 1 end)\n")
        run = self.start(SMARTSURF, "run", "s.lua", "--no-controller", "--pace", "20", "--until", "3600", "--record", name)
        self.wait_for(lambda: (self.folder / name).exists(), "the recording's name")
        loss(self.folder / name)
        run.send_signal(signal.SIGTERM)
        status, out, err = self.finish(run)
        self.assertEqual(status, 1, f"{name}: {out}{err}")
        self.assertNotIn("wrote", err)
        return err

    def test_loss_is_a_failure(self):
        def replace(path):  # at once, or the run might see that it is removed
            (self.folder / "other").write_bytes(b"x" * 10_000_000)
            (self.folder / "other").replace(path)
        for name in ("r.h5", "r.csv"):
            for loss, word in ((pathlib.Path.unlink, "removed"), (replace, "replaced"), (lambda path: os.truncate(path, 100), "cut")):
                self.assertIn(f"was {word} while the run recorded it", self.lose(name, loss))
                (self.folder / name).unlink(missing_ok=True)


    def test_loss_of_other_outputs_is_told(self):
        self.write("s.lua", TABLE)
        outputs = {"--stats": "n.json"}
        if WITH_VIEW:
            outputs |= {"--screenshot": "n.png"} | ({"--video": "n.mp4"} if shutil.which("ffmpeg") else {})
        for flag, name in outputs.items():
            run = self.start(SMARTSURF, "run", "s.lua", "--no-controller", "--pace", "20", "--until", "3600", "--record", "n.csv",
                             flag, name, *(() if flag == "--stats" else SMALL_PICTURE))
            self.wait_for((self.folder / "n.csv").exists, "the recording's name")
            (self.folder / f"{name}.part{run.pid}").unlink()
            run.send_signal(signal.SIGTERM)
            status, out, err = self.finish(run)
            self.assertIn(status, (1, 2), f"{name}: {out}{err}")
            self.assertRegex(err, f"{name}.*its .part file was removed or replaced")
            self.assertFalse((self.folder / name).exists())
            (self.folder / "n.csv").unlink()


class ScriptFiles(Hostile):
    """A script writes into a folder of its own beside the recording, and nowhere else."""

    def run_script(self, statement, *flags):
        self.write("s.lua", TABLE + statement + "\n")
        return self.run_program(SMARTSURF, "run", "s.lua", "--no-controller", "--ticks", "2", *flags)

    def test_files_are_written_into_their_own_folder(self):
        status, out, err = self.run_script("local f = io.open('a.csv', 'w') f:write('1,2') f:close() print(io.open('a.csv'):read('a'))",
                                           "--record", "r.h5")
        self.assertEqual((status, out), (0, "1,2\n"), err)
        self.assertEqual((self.folder / "r.files/a.csv").read_text(), "1,2")
        self.assertFalse((self.folder / "a.csv").exists())

    def test_nothing_else_is_written(self):
        (self.folder / ".git").mkdir()
        before = {p for p in self.folder.rglob("*")}
        for name in ("../.git/config", "../libqhull_r.so.8.0", str(self.folder / "Makefile"), "../r.files/../x", ".git/config"):
            status, _, err = self.run_script(f"io.open('{name}', 'w'):write('[core]')", "--record", "r.h5")
            self.assertEqual(status, 2, name)
            self.assertRegex(err, "outside the output folder|nil value|attempt to index")
            kept = {p for p in self.folder.rglob("*")} - before
            self.assertLessEqual({p.name for p in kept}, {"s.lua", "r.h5", "r.files"}, name)

    def test_folder_that_is_a_link_is_refused(self):
        (self.folder / "home").mkdir()
        (self.folder / "r.files").symlink_to("home")
        status, _, err = self.run_script("io.open('.profile', 'w'):write('evil')", "--record", "r.h5")
        self.assertEqual(status, 2, err)
        self.assertEqual(list((self.folder / "home").iterdir()), [])

    def test_files_of_other_names_are_kept(self):
        (self.folder / "home").mkdir()
        (self.folder / "r.files").mkdir()
        victim = self.folder / "home/.profile"
        victim.write_text("kept")
        (self.folder / "r.files/a").hardlink_to(victim)
        for mode in "w", "a", "r+":
            status, _, err = self.run_script(f"io.open('a', '{mode}'):write('evil')", "--record", "r.h5")
            self.assertEqual((status, victim.read_text()), (2, "kept"), err)
            self.assertIn("'a' has other names", err)


class ScriptMemory(Hostile):
    """What the program keeps of a script's texts is bounded too, not only Lua's heap."""

    def test_long_texts_are_refused(self):
        long = "('x'):rep(70000)"
        for text, expected in ((f"option('o', 1, {long})", "help = .*at most 64 KiB"), (f"option('o', {long}, '')", "default = .*at most 64 KiB"),
                               (f"material {{ name = {long} }}", "at most 64 KiB"), (f"info {{ [{long}] = 0 }}", "at most 64 KiB"),
                               (f"random_stream({long})", "at most 64 KiB"),
                               ("local s = ('x'):rep(9 << 20) print(s, s)", "print: .*longer than 16 MiB"),
                               ("local s = ('x'):rep(9 << 20) io.write(s, s)", "io.write: .*longer than 16 MiB")):
            status, out, err = self.run_program(SMARTSURF, "check", self.write("s.lua", TABLE + text + "\n"))
            self.assertEqual(status, 2, text)
            self.assertRegex(err, expected)
            self.assertEqual(out, "")


class Recordings(Hostile):
    """A recording may hold anything: no reader crashes on it, and running it again reads nothing that the run did not."""

    def test_changed_recordings_are_survived(self):
        status, out, err = self.run_program(sys.executable, str(ROOT / "scripts/check-recordings"), "--changes", "28", "--bin", str(BIN),
                                            "--keep", "failed")
        self.assertEqual(status, 0, out + err)

    def record(self, script):
        (self.folder / "there").mkdir(exist_ok=True)
        self.write("there/secret.lua", "a secret line\n")
        self.write("there/part.lua", "return 1\n")
        self.write("there/s.lua", TABLE + script)
        self.assertEqual(self.run_program(SMARTSURF, "run", "there/s.lua", "--no-controller", "--ticks", "5", "--record", "r.h5")[0], 0)

    def test_stopped_readers_leave_no_part(self):
        script = self.write("s.lua", TABLE)
        self.assertEqual(self.run_program(SMARTSURF, "run", script, "--no-controller", "--ticks", "4000", "--record", "r.h5")[0], 0)
        for i in range(24):
            child = self.start(SMARTSURF, *(("plot", "r.h5", "-o", "a.svg"), ("export", "r.h5", "-o", "a.html"))[i % 2])
            time.sleep(0.03 + 0.01 * (i // 2))
            child.send_signal((signal.SIGTERM, signal.SIGXCPU)[i // 2 % 2])
            self.finish(child)
            self.assertEqual([p.name for p in self.folder.iterdir() if ".part" in p.name], [], i)

    def test_verification_reads_beside_an_unchanged_script_alone(self):
        self.record("require 'part'\n")
        self.assertEqual(self.run_program(SMARTSURF, "replay", "r.h5", "--verify")[0], 0)
        # Whoever made the recording could name any folder in it.
        self.record("if option('leak', 0, '') == 0 then return end dofile('secret.lua')\n")
        self.assertEqual(self.run_program(SMARTSURF, "run", "there/s.lua", "--no-controller", "--ticks", "5", "--record", "r.h5")[0], 0)
        self.write("there/s.lua", "-- another script\n")
        data = (self.folder / "r.h5").read_bytes().replace(b"'leak', 0,", b"'leak', 1,")
        (self.folder / "r.h5").write_bytes(data)
        status, out, err = self.run_program(SMARTSURF, "replay", "r.h5", "--verify")
        self.assertEqual(status, 2, out + err)
        self.assertNotIn("secret line", out + err)
        self.assertIn("is not beside the script", err)

    def test_many_attributes_take_no_time(self):
        import h5py
        self.record("option('count', 1, '')\n")
        with h5py.File(self.folder / "r.h5", "r+") as file:
            for name in range(6000):
                file["meta/options"].attrs[f"name{name}"] = "value"
        status, out, err = self.run_program("prlimit", "--cpu=2", SMARTSURF, "info", "r.h5")
        self.assertEqual(status, 0, err)

    def test_small_files_take_no_minutes(self):
        """The cases that HDF5 takes long for; no reader spends more than seconds on them."""
        import h5py
        self.record("")
        whole = (self.folder / "r.h5").read_bytes()

        def nest(file):
            group = file.require_group("metrics")
            for _ in range(1000):
                group = group.create_group("g")

        def fill(file):
            for i in range(20000):
                file["meta"].create_group(f"g{i}")
        for change, status, says in ((nest, 2, "has groups in more than 16 levels"), (fill, 0, "")):
            (self.folder / "h.h5").write_bytes(whole)
            with h5py.File(self.folder / "h.h5", "r+") as file:
                change(file)
            for command in (("info", "h.h5"), ("plot", "h.h5", "-o", "h.svg"), ("export", "h.h5", "-o", "h.html"), ("replay", "h.h5", "--verify")):
                found, out, err = self.run_program("prlimit", "--cpu=4", SMARTSURF, *command)
                self.assertEqual(found, status, (command, out, err))
                self.assertIn(says, err)
                self.assertEqual(err.count("\n"), status // 2, err)

    def test_irregular_ticks_are_refused(self):
        self.record("")
        data = (self.folder / "r.h5").read_bytes()
        ticks = struct.pack("<6Q", *range(6))
        self.assertEqual(data.count(ticks), 1)
        (self.folder / "r.h5").write_bytes(data.replace(ticks, struct.pack("<6Q", 0, 1, 2, 3, 4, 2**60)))
        status, out, err = self.finish(self.start(SMARTSURF, "replay", "r.h5", "--verify"), 30)
        self.assertEqual(status, 2, out + err)
        self.assertIn("instead of 5", err)


class Meshes(Hostile):
    """The importer's memory and time are limited and charged to the run, and its process ends with the run's."""

    def setUp(self):
        super().setUp()
        self.write("s.lua", TABLE + "mesh { file = 'a.ply', position = { 1, 1, 5 } }\n")

    def test_a_small_file_cannot_take_all_memory(self):
        self.write("a.ply", "ply\nformat ascii 1.0\nelement vertex 99999999999\nproperty float x\nproperty float y\n"
                   "property float z\nelement face 1\nproperty list uchar int vertex_indices\nend_header\n0 0 0\n1 0 0\n0 1 0\n3 0 1 2\n")
        before = resource.getrusage(resource.RUSAGE_CHILDREN).ru_maxrss
        child = self.start("/bin/sh", "-c", 'ulimit -v 16000000; exec "$@"', "sh", SMARTSURF, "check", "s.lua")
        status, out, err = self.finish(child, 60)
        self.assertEqual(status, 2, out + err)
        self.assertRegex(err, "the mesh importer failed|needs more memory")
        # In KiB: more than what the program itself needs, less than the file asks for.
        self.assertLess(resource.getrusage(resource.RUSAGE_CHILDREN).ru_maxrss, max(before, 2 << 20))

    def test_every_refusal_of_a_file_has_a_reason(self):
        with zipfile.ZipFile(self.folder / "a.3mf", "w") as file:
            file.writestr("3D/3dmodel.model", '<?xml version="1.0"?><model/>')  # to which no relationship leads
        self.write("s.lua", TABLE + "mesh { file = 'a.3mf', position = { 1, 1, 5 } }\n")
        status, _, err = self.run_program(SMARTSURF, "check", "s.lua")
        self.assertEqual((status, err), (2, "smartsurf: s.lua:3: mesh.file = 'a.3mf': is damaged: the importer finds no mesh in it\n"))

    def test_meshes_of_many_shells_are_refused(self):
        self.write("s.lua", TABLE + "mesh { file = 'a.stl', position = { 1, 1, 50 } }\n")
        corners = ((0, 0, 0), (1, 0, 0), (0, 1, 0), (0, 0, 1))

        def write(shells):  # tetrahedra: the first around all others
            with open(self.folder / "a.stl", "wb") as file:
                file.write(bytes(80) + struct.pack("<I", 4 * len(shells)))
                for size, *at in shells:
                    for face in ((0, 2, 1), (0, 1, 3), (0, 3, 2), (1, 2, 3)):
                        points = [a + size * c for i in face for a, c in zip(at, corners[i])]
                        file.write(struct.pack("<12fH", 0, 0, 0, *points, 0))
        for shells, expected in (([(1, 2 * (i % 40), 2 * (i // 40 % 40), 2 * (i // 1600)) for i in range(60_000)], "at most 20000"),
                                 ([(4 + 0.001 * i, 0, 0, 0) for i in range(15_000)], "too many shells within others|does not separate|edge")):
            write(shells)
            status, out, err = self.run_program(SMARTSURF, "check", "s.lua")
            self.assertEqual(status, 2, out + err)
            self.assertRegex(err, expected)

    def test_decompositions_are_kept_by_a_confined_run_and_damage_does_no_harm(self):
        # A torus, whose parts lie in the cache after the first run.
        around, across, lines = 24, 12, []
        for i in range(around):
            for j in range(across):
                a, b = 2 * math.pi * i / around, 2 * math.pi * j / across
                r = 2 + 0.7 * math.cos(b)
                lines.append(f"v {r * math.cos(a)} {r * math.sin(a)} {0.7 * math.sin(b)}")
        for i in range(around):
            for j in range(across):
                at = [1 + p % around * across + q % across for p, q in ((i, j), (i + 1, j), (i + 1, j + 1), (i, j + 1))]
                lines += [f"f {at[0]} {at[1]} {at[2]}", f"f {at[0]} {at[2]} {at[3]}"]
        self.write("a.obj", "\n".join(lines) + "\n")
        self.write("s.lua", TABLE + "mesh { file = 'a.obj', position = { 3, 3, 3 }, tolerance = 1 }\n")
        kept = self.folder / "kept"

        def run(cache):
            status, out, err = self.run_program("env", f"SMARTSURF_MESH_CACHE={cache}", SMARTSURF, "run", "s.lua", "--no-controller",
                                                "--ticks", "30", "--stats", "stats.json")
            self.assertEqual(status, 0, out + err)
            return json.loads((self.folder / "stats.json").read_text())["state_hash"]
        without = run("off")
        self.assertFalse(kept.exists())
        self.assertEqual(run(kept), without)
        file, = kept.iterdir()
        whole = file.read_bytes()
        self.assertEqual(run(kept), without)
        for damaged in (b"", whole[:1000], whole[:-100] + bytes(100), bytes(len(whole))):
            file.write_bytes(damaged)
            self.assertEqual(run(kept), without)
            self.assertEqual(file.read_bytes(), whole)
        self.assertEqual([path.name for path in kept.iterdir()], [file.name])
        kept.chmod(0o777)  # another user might write there
        file.unlink()
        self.assertEqual(run(kept), without)
        self.assertEqual(list(kept.iterdir()), [])

    def slow_mesh(self):
        # Text that is long to read.
        with open(self.folder / "a.ply", "w") as file:
            count = 700_000
            file.write(f"ply\nformat ascii 1.0\nelement vertex {count}\nproperty float x\nproperty float y\nproperty float z\n"
                       "element face 1\nproperty list uchar int vertex_indices\nend_header\n")
            file.writelines("0.123456789 0.987654321 0.555555555\n" for _ in range(count))
            file.write("3 0 1 2\n")

    def importers(self, parent):
        """Those that have let go of the parent's streams: before that a new process may not yet have asked to end with it."""
        def ready(pid):
            try:
                return os.readlink(f"/proc/{pid}/fd/1") == "/dev/null"
            except OSError:
                return False
        return [pid for pid in children(parent) if ready(pid)]

    def test_stop_and_death_end_the_importer(self):
        self.slow_mesh()
        for how in (signal.SIGTERM, signal.SIGKILL):
            run = self.start(SMARTSURF, "run", "s.lua", "--no-controller", "--ticks", "1")
            found = []
            self.wait_for(lambda: found.extend(self.importers(run.pid)) or found or run.poll() is not None, "the importer")
            self.assertIsNone(run.poll(), "the importer ended too soon to be stopped")
            importer = found[0]
            os.kill(importer, signal.SIGSTOP)  # as one that never ends
            run.send_signal(how)
            status, _, err = self.finish(run, 20)
            self.assertEqual(status, 128 + signal.SIGTERM if how == signal.SIGTERM else -signal.SIGKILL, err)
            self.wait_for(lambda: ended(importer), "the importer's end")


if __name__ == "__main__":
    unittest.main()
