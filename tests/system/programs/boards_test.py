"""Programs on boards: one process per tile, against the simulator as the world."""
import pathlib
import random
import re
import shutil
import sys

from programs import *

BOARDS = str(ROOT / "scripts/boards/boards")
SEGMENTS = pathlib.Path("/dev/shm")
WORLD = """
surface { rows = 16, columns = 20, pitch = 1.0, actuator = pin { range = { 0, 4 }, max_speed = 6 }, sensors = { proximity {} } }
for i = 1, 4 do sphere { radius = 1.5, position = { 3 * i, 2 * i + 3, 6 } } end
"""


@unittest.skipUnless(shutil.which("cc"), "no C compiler")
class Boards(ProgramTest):
    def run_boards(self, experiment, program, *flags):
        status, out, err = self.run_program(sys.executable, BOARDS, experiment, program, "--bin", str(BIN), *flags)
        left = [path for path in SEGMENTS.glob("smartsurf.boards-*") if not pathlib.Path("/proc", path.name.rpartition("-")[2]).exists()]
        self.assertEqual(left, [], "segments of scripts that have ended")
        return status, out, err

    def check(self, *flags, program=str(ROOT / "scripts/case-study/sort.aps")):
        status, out, err = self.run_boards(self.write("world.lua", WORLD), program, "--ticks", "40", *flags)
        self.assertEqual(status, 0, out + err)
        return out

    def test_boards_end_in_the_state_of_the_host(self):
        out = self.check("--tile", "8x8")
        self.assertIn("6 boards, 40 ticks", out)
        self.assertIn(": equal", out)
        self.assertIn("edges lost 0, dropped 0", out)

    def test_repeated_edges_change_nothing(self):
        out = self.check("--tile", "10x8", "--repeat", "0.2")
        self.assertIn(": equal", out)
        self.assertRegex(out, r"edges lost 0, dropped [1-9]")

    def test_lost_and_late_edges_are_counted_and_repeat(self):
        runs = {self.check("--tile", "10x8", "--loss", "0.01", "--delay", "0.01", "--no-host") for _ in range(2)}
        self.assertEqual(len(runs), 1, runs)
        self.assertRegex(runs.pop(), r"edges lost [1-9]")

    def test_wide_halos(self):
        self.assertIn(": equal", self.check("--tile", "10x16", "--halo", "3",
                                            program=str(ROOT / "scripts/case-study/sort-paper.aps")))

    def test_calibrated_boards_reach_the_heights_of_their_program(self):
        draw = random.Random(4)
        gain, offset = ([[draw.uniform(*ends) for _ in range(6)] for _ in range(4)] for ends in ((0.8, 1.2), (-0.2, 0.2)))
        self.write("cells.csv", "\n".join(["row,column,channel,fault,value", *(
            f"{r},{c},height,{name},{of[r][c]}" for r in range(4) for c in range(6) for name, of in (("gain", gain), ("offset", offset)))]))
        world = self.write("pins.lua", """surface { rows = 4, columns = 6, actuator = pin { range = { 0, 5 } }, sensors = { pin_height {} } }
            faults { map = 'cells.csv' }
            on_finish(function() for r = 1, 4 do for c = 1, 6 do metric('h' .. r - 1 .. c - 1, cells:sense('pin_height', r, c)) end end end)""")
        program = self.write("steps.aps", "while(1)\n surface.actuate('height', 1 + cell.col * 0.5 + cell.row * 0.1)\n surface.step\nendwhile\n")
        zero = [[0.0] * 6] * 4
        matrices = {"zero": offset, "slope": gain, "play": zero, "sensor_zero": zero}
        text = 'actuator = "height"\nsensor = "pin_height"\n' + "".join(f"[{name}]\nvalue = {of}\n" for name, of in matrices.items())
        status, out, err = self.run_boards(world, program, "--tile", "3x2", "--ticks", "120", "--no-host", "--stats", "stats.json",
                                           "--calibration", self.write("calibration.toml", text))
        self.assertEqual(status, 0, out + err)
        metrics = json.loads((self.folder / "stats.json").read_text())["metrics"]
        for r in range(4):
            for c in range(6):
                self.assertAlmostEqual(metrics[f"h{r}{c}"], 1 + 0.5 * c + 0.1 * r, delta=1e-4)
        status, _, err = self.run_boards(world, program, "--no-host", "--calibration", self.write("small.toml", text.replace("zero", "Zero")))
        self.assertEqual(status, 1, err)
        self.assertRegex(err, r"\nboards: error: \S*small.toml: is no calibration of surface_bridge: 'zero'\n\Z")

    def test_bad_input_is_refused_in_one_line(self):
        for flag, value, reason in (("--halo", "0", "0 is not from 1 to 16"), ("--halo", "17", "17 is not from 1 to 16"),
                                    ("--loss", "2", "2.0 is no fraction, 0 to 1"), ("--repeat", "nan", "nan is no fraction, 0 to 1")):
            status, out, err = self.run_boards("world.lua", "program.aps", flag, value)
            self.assertEqual((status, out), (2, ""), err)
            self.assertEqual(err.splitlines()[-1], f"boards: error: {flag}: {reason}")
        status, _, err = self.run_boards(self.write("world.lua", WORLD), self.write("bad.aps", "A = globalsum(A)\n"))
        self.assertEqual(status, 2, err)
        self.assertNotIn("Traceback", err)


class Compiling(ProgramTest):
    def refused(self, text, *flags):
        file = self.write("a.aps", text)
        status, out, err = self.run_program(APRON, "compile", file, "--target", "c", "-o", str(self.folder / "a.c"), *flags)
        self.assertEqual((status, out), (2, ""), err)
        self.assertFalse((self.folder / "a.c").exists())
        return err.replace(file, "a.aps")

    def test_what_boards_cannot_do_is_refused_with_its_line(self):
        for line, reason in [("A = globalsum(A)", "globalsum needs the whole array"),
                             ("A = rotate.north(A)", "rotate by (0, -1) joins opposite edges of the array"),
                             ("A = shift(A, 2, 0)", "shift by (2, 0) reaches beyond"),
                             ("boundary('wrap')", "boundary('wrap') joins opposite edges of the table"),
                             ("k = io.key", "io.key needs a host"),
                             ("A = io.image.open('a.png')", "io.image.open needs a host"),
                             ("surface.free_run(1)", "surface.free_run needs a host"),
                             ("A = stack.pop_reg", "stack.pop_reg finds the stack empty")]:
            text = "!register(A, B)\nn = 0\n" + (line.replace("A = globalsum", "n = globalsum")) + "\nsurface.actuate('height', A)\n"
            self.assertRegex(self.refused(text), r"^a\.aps:3: error: .*" + re.escape(reason), line)

    def test_recursion_and_other_sizes(self):
        self.assertRegex(self.refused("!register(A)\n#a\ncall(#a)\n"), r"a\.aps:3: error: calls are nested more than 256 deep")
        self.assertRegex(self.refused("!create('B', REGISTER, 4, 4)\nr[B] = 1\n"), r"a\.aps:2: error: the register B of 4x4")
        self.assertRegex(self.refused("!register(A)\nwhile(1)\nA = A + 1\nendwhile\n"), r"repeats forever without surface\.step")

    def test_channels_of_one_name_in_c(self):
        text = "!register(A)\nsurface.actuate('a.b', A)\nsurface.actuate('a_b', A)\nsurface.step\n"
        self.assertEqual(self.refused(text), "a.aps: error: the channels 'a.b' and 'a_b' have the same name in C, actuate_a_b\n")

    def test_a_slow_link_is_refused(self):
        flags = ["compile", SORT_APS, "--target", "c", "-o", str(self.folder / "s.c"), "--tile", "8x8"]
        status, _, err = self.run_program(APRON, *flags, "--link", "1M", "--rate", "60")
        self.assertEqual(status, 2)
        self.assertRegex(err, r"error: the edges of a tick take \S+ ms over a link of 1e\+06 baud \(46 rounds, ")
        status, out, err = self.run_program(APRON, *flags, "--link", "10M", "--rate", "60")
        self.assertEqual(status, 0, err)
        self.assertIn("46 rounds", out)

    def edges(self, text, *flags, bounded=True):
        file = self.write("a.aps", text)
        status, out, err = self.run_program(APRON, "compile", file, "--target", "c", "-o", str(self.folder / "a.c"), "--size", "16x16",
                                            "--tile", "8x8", *flags)
        self.assertEqual(status, 0, err)
        (self.folder / "a.c").unlink()
        found = re.search(r"edges of a tick, (at most|each open loop once): (\d+) rounds, (\d+) waits, (\d+) bytes in sequence\n", out)
        self.assertEqual(found[1] == "at most", bounded, out)
        return tuple(map(int, found.groups()[1:]))

    def test_a_tick_has_the_most_of_each_quantity(self):
        # Even ticks: one round of 8 floats; odd ones: twelve rounds of 8 bits.
        text = """!register(A, M)\nA = cell.x + 0.5\nM = cell.x == 3\n#frame\nif(surface.tick % 2 == 0)\n A = near.sum(A, 4) * 0.2\nelse
            repeat(12)\n M = M or near.any(M, 4)\n endrepeat\nendif
            surface.actuate('height', A)\nsurface.actuate('mask', M)\nsurface.step\njump(#frame)\n"""
        for unroll in "20000", "1":
            self.assertEqual(self.edges(text, "--unroll", unroll), (12, 12, 32))
            # Twelve frames of 15 bytes take longer than one of 46: 18 ms.
            self.edges(text, "--unroll", unroll, "--link", "110k")
            self.assertIn("18 ms", self.refused(text, "--size", "16x16", "--tile", "8x8", "--unroll", unroll, "--link", "101.5k"))

    def test_what_is_sent_in_sequence_adds_up(self):
        text = "!register(A)\nA = cell.x\n#frame\nA = near.sum(A, 8)\nsurface.actuate('height', A)\nsurface.step\njump(#frame)\n"
        # 8 floats west and east, then 10 north and south, each framed.
        self.assertEqual(self.edges(text), (1, 2, 32 + 40))
        self.edges(text, "--link", "61k")
        self.assertIn("24 ms", self.refused(text, "--size", "16x16", "--tile", "8x8", "--link", "41.75k"))

    def test_loops_of_unknown_length_have_a_bound_where_they_exchange_nothing(self):
        text = """!register(A)\n#frame\nn = surface.tick\nwhile(n > 1)\n n = n - 2\n {}\nendwhile\nrepeat(3)\n A = A + north(A) + n\nendrepeat
            surface.actuate('height', A)\nsurface.step\njump(#frame)\n"""
        self.assertEqual(self.edges(text.format(""), "--link", "1M")[0], 3)
        looping = text.format("A = north(A)")
        self.assertEqual(self.edges(looping, bounded=False)[0], 4)
        self.assertIn("a tick has no bound", self.refused(looping, "--size", "16x16", "--tile", "8x8", "--link", "1M"))

    def test_the_first_tick_counts(self):
        text = "!register(A)\nrepeat(5)\n A = 1 + north(A)\nendrepeat\n#frame\nsurface.actuate('height', A)\nsurface.step\njump(#frame)\n"
        self.assertEqual(self.edges(text)[0], 4)  # the first pass reads zeros

    def test_invalid_flags(self):
        for flags in (["--tile", "8"], ["--tile", "65x8"], ["--halo", "0"], ["--halo", "9", "--tile", "8x8"], ["--link", "fast"],
                      ["--rate", "60"], ["--name", "1x"], ["--set", "speed=1"], ["--target", "rust"]):
            self.assertIn("error: ", self.refused("!register(A)\nA = north(A)\nsurface.actuate('height', A)\n", *flags), flags)

    def test_file_names_that_c_cannot_include(self):
        file = self.write("a.aps", "!register(A)\nsurface.actuate('height', A)\n")
        for name in ('a"b.c', "a\\b.c", "a\nb.c", "a??!.c"):
            status, out, err = self.run_program(APRON, "compile", file, "--target", "c", "-o", str(self.folder / name))
            self.assertEqual((status, out), (2, ""), name)
            self.assertRegex(err, r"\Aapron: error: -o: .*: C cannot include its header.*\n\Z")

    @unittest.skipUnless(shutil.which("cc"), "no C compiler")
    def test_other_file_names_make_c_that_compiles(self):
        file = self.write("a.aps", "!register(A)\nA = north(A)\nsurface.actuate('height', A)\n")
        for name in ("table.c", "int.c", "8x8.c", "program_x.c", "a b'c.c", "@ROWS@.c", "ü.c"):
            status, _, err = self.run_program(APRON, "compile", file, "--target", "c", "--tile", "8x8", "-o", str(self.folder / name))
            self.assertEqual(status, 0, err)
            status, _, err = self.run_program("cc", "-std=c99", "-c", name, "-o", "a.o")
            self.assertEqual(status, 0, err)

    def test_print_is_left_out_with_a_warning(self):
        file = self.write("a.aps", "!register(A)\nprintln(1)\nsurface.actuate('height', A)\n")
        status, _, err = self.run_program(APRON, "compile", file, "--target", "c", "-o", str(self.folder / "a.c"))
        self.assertEqual(status, 0)
        self.assertEqual(err, f"{file}:2: warning: a board has no console: print is left out\n")


INTEGERS = """!uint8(I, C)
!uint16(S)
!int32(D)
!register(P)
n = 0
#frame
surface.step
P = surface.sense('proximity')
I = uint8(P * 40)
S = uint16(I) * 257 + near.sum(S, 8)
D = int32(S) - int32(east(S)) * 1000 + n
D = D / 7 % 1000 + (D >> 3) ^ (D << 2)
n = (surface.tick << 3 | 5) & 127
C = sat.add(I, n) ^ (I >> 3)
where(C > 100)
  I = C
elsewhere
  I = I + 77
endwhere
surface.actuate('height', float(D & 0xFFFF) / 65536 + float(C))
jump(#frame)
"""


class CrossBuilds(ProgramTest):
    def test_programs_build_for_microcontrollers(self):
        programs = [str(ROOT / "scripts/case-study" / name) for name in ("sort.aps", "sort-paper.aps")] + [self.write("integers.aps", INTEGERS)]
        status, out, err = self.run_program(sys.executable, str(ROOT / "scripts/boards/cross"), "--bin", str(BIN), *programs)
        if status == 77:
            self.skipTest(out.strip())
        self.assertEqual(status, 0, err)
        self.assertRegex(out, r"(?m)^\| `sort-paper` \| [\d.]+ kB, [\d.]+ kB")


class Emulated(ProgramTest):
    def test_emulated_boards_give_the_bits_of_the_host(self):
        programs = [str(ROOT / "scripts" / name) for name in ("case-study/sort-paper.aps", "tasks/rain.aps")]
        programs.append(self.write("integers.aps", INTEGERS))
        status, out, err = self.run_program(sys.executable, str(ROOT / "scripts/boards/emulate"), "--bin", str(BIN), *programs)
        if status == 77:
            self.skipTest(out.strip())
        self.assertEqual(status, 0, out + err)


if __name__ == "__main__":
    unittest.main()
