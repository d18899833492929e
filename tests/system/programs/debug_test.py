"""apron debug, by commands from its standard input."""
import random
import re

from programs import *

PROGRAM = """!macro_def
$y = twice($a)
!macro_begin
:t = $a
$y = :t + $a
!macro_end
!register(A, B)
n = 0
while(n < 5)
  n = n + 1
  A = cell.x * n
  B = twice(A)
  call(#routine)
  surface.step
endwhile
end
#routine
B = B + 100
return
"""


class Debug(ProgramTest):
    def setUp(self):
        super().setUp()
        self.write(PROGRAM)

    def write(self, text):
        (self.folder / "p.aps").write_text(text)

    def debug(self, *commands, status=0, options=("--size", "4x3")):
        run = subprocess.run([APRON, "debug", "p.aps", *options], input="\n".join(commands) + "\n", cwd=self.folder,
                             capture_output=True, text=True, timeout=60)
        self.assertEqual(run.returncode, status, run.stdout + run.stderr)
        return run.stdout.splitlines()

    def test_lines_of_a_file_with_crlf(self):
        (self.folder / "p.aps").write_bytes(b"n = 1\r\nn = 2\r\n\r\nn = 3\r\n")
        run = subprocess.run([APRON, "debug", "p.aps"], input=b"next\nlist\n", cwd=self.folder, capture_output=True, timeout=60)
        self.assertEqual(run.stdout, b"p.aps:1: n = 1\np.aps:2: n = 2\n  1  n = 1\n> 2  n = 2\n  3  \n  4  n = 3\n")

    def test_a_session(self):
        out = self.debug("break 12", "c", "print n", "plane A", "c", "print A 3 1", "delete 1", "c")
        self.assertEqual(out, ["p.aps:8: n = 0", "breakpoint 1: p.aps:12", "breakpoint 1", "p.aps:4: :t = $a", "n = 1",
                               "0 1 2 3", "0 1 2 3", "0 1 2 3", "breakpoint 1", "p.aps:4: :t = $a", "A(3, 1) = 6",
                               "the program has ended"])

    def test_local_names_are_those_of_the_macro_that_runs(self):
        self.write("!register(A, B)\nm = 3\nfunction y = inner(plane t)\n  m2 = globalsum(t)\n  t = t + m2\n  y = t\nendfunction\n"
                   "function y = f(a, number k)\n  t = a * k\n  n = k + 1\n  y = inner(t + n)\n  y = y + t\nendfunction\n"
                   "A = cell.x\nB = f(A, m)\nB = f(A + 1, 7)\n")
        prints = ["print n", "print k", "print t 1 0", "print a 2 0"]
        out = self.debug("break 12", "break 6", "c", "print m2", "plane t", "save t t.csv", "c", *prints, "print m2", "delete", "break 12", "c",
                         *prints, "names", status=2)
        values = [line for line in out if "=" in line and not line.startswith("p.aps")]
        self.assertEqual(values, ["m2 = 102", "n = 4", "k = 3", "t(1, 0) = 3", "a(2, 0) = 2", "n = 8", "k = 7", "t(1, 0) = 14", "a(2, 0) = 3",
                                  "n = 8", "k = 7", "m = 3"])
        self.assertEqual((self.folder / "t.csv").read_text().split()[0].split(",")[1], "109")
        self.assertIn("106 109 112 115", out)
        self.assertIn("error: the program has no register 'm2'", "\n".join(out))

    def test_parameters_of_macros_have_their_sign(self):
        self.write("!register(A)\n!macro_def\nm($x, $k, $e)\n!macro_begin\n$x = $x * $k + $e\n!macro_end\nn = 5\nA = 2\nm(A, n, n + 1)\n")
        out = self.debug("break 5", "c", "print $k", "print k", "print $x 0 0", "print $e")
        self.assertEqual(out[-4:], ["$k = 5", "k = 5", "$x(0, 0) = 2", "$e = 6"])

    def test_parameters_are_what_the_body_reads(self):
        # Random arguments through macros and functions, where the program has scalars and registers of the parameters' names: the debugger
        # shows what the stopped line is about to print.
        draw = random.Random(11)
        numbers = ["n", "i", "7", "-3", "(2 + 3)", "w[1]", "w[2 - 1]", "w[i]", "v[n]", "n * 2", "w[i] + n", "w[i + 1]", "w[n - 2]"]
        planes = ["A", "cell.x", "cell.row", "ch[2]", "ch[i]", "ch[1 + 2]", "r[Q]", "r[1]", "A + i", "ch[i] * 2", "ch[i + 1]", "+A", "cell.x + n"]
        kinds = {"n": ("println('> ', {})", numbers, "print {}"), "p": ("println('> ', pixel.get({}, 3, 1))", planes, "print {} 3 1")}
        for _ in range(8):
            text = "!register(A, b)\n!create('Q', REGISTER, 4, 3)\n!register(ch[4])\n!scalar(w[3])\n"
            prints = {}  # the command, by the line
            for kind, (show, arguments, command) in kinds.items():
                for level in range(3):
                    for is_function in (False, True):
                        name, sigil = f"{kind}{level}{'f' if is_function else 'm'}", "" if is_function else "$"
                        type_ = {"n": "number ", "p": "plane "}[kind] if is_function else ""
                        text += f"function y = {name}(" if is_function else f"!macro_def\n$y = {name}("
                        text += f"{type_}{sigil}a, {type_}{sigil}b)\n" + ("" if is_function else "!macro_begin\n")
                        for parameter in draw.sample("ab", 2):
                            text += show.format(sigil + parameter) + "\n"
                            prints[text.count("\n")] = command.format(parameter)
                        for _ in range(level and 2):
                            inner = [draw.choice([f"{sigil}a", f"{sigil}b", f"{sigil}a + {sigil}b", draw.choice(arguments)]) for _ in range(2)]
                            text += f"{'t' if is_function else ':t'} = {kind}{level - 1}{draw.choice('mf')}({', '.join(inner)})\n"
                        text += f"{sigil}y = {sigil}a + {sigil}b\n" + ("endfunction\n" if is_function else "!macro_end\n")
            text += "a = 1000\nb = 2000\ny = 3000\nn = 2\ni = 1\nA = cell.x * 10 + cell.y\nr[Q] = A * 3\n".replace("b = 2000", "b = cell.x + 2000")
            text += "".join(f"ch[{k}] = A + {100 * k}\n" for k in range(4)) + "".join(f"w[{k}] = {5 + k}\n" for k in range(3))
            for _ in range(4):
                kind = draw.choice("np")
                arguments = ", ".join(draw.choice(kinds[kind][1]) for _ in range(2))
                call = f"{kind}2{draw.choice('mf')}({arguments})"
                text += {"n": draw.choice([f"s = {call}\n", f"s = 1 + {call}\n"]), "p": draw.choice([f"b = {call}\n", f"b = 1 + {call}\n"])}[kind]
            self.write(text)
            breaks = [f"break {line}" for line in prints]
            stops = [int(line.split(":")[1]) for line in self.debug(*breaks, *["c"] * 200, status=2) if line.startswith("p.aps:")][1:]
            out = self.debug(*breaks, *[command for line in stops for command in ("c", prints[line])], "c")
            shown = [line.split(" = ")[1] for line in out if re.match(r"[ab](\(3, 1\))? = ", line)]
            self.assertEqual(shown, [line[2:] for line in out if line.startswith("> ")], text)
            self.assertEqual(len(shown), len(stops))
            self.assertGreater(len(stops), 20)

    def test_parameters_without_a_value(self):
        self.write("!register(ch[2], A)\n!macro_def\nm($a, $op, $t, $l)\n!macro_begin\n:n = $a\n$l = $a\n!macro_end\n"
                   "function y = f(plane a[], integer n)\nx = a[n]\ny = x\nendfunction\n"
                   "a = 5\nop = 6\nt = 7\nl = 8\nx = 9\nn = 4\nk = 5\nch[1] = cell.x\nm(surface.tick, +, 'text', z)\nA = f(ch, -1 + 2)\n")
        out = self.debug("b 5", "b 9", "c", "p a", "p op", "p t", "p l", "p :n", "s", "p :n", "c", "p a", "p a[1] 3 0", "p n", "p x", "p a[2]", "names",
                         status=2)
        self.assertEqual([line for line in out if not line.startswith(("p.aps", "breakpoint"))],
                         ["error: 'a' is surface.tick here, which no register or scalar holds", "error: 'op' is + here, which no register or scalar holds",
                          "error: 't' is 'text' here, which no register or scalar holds", "l = 0", "error: ':n' has no value yet", ":n = 0",
                          "error: 'a' is an array: a[0] is its first element", "a[1](3, 0) = 3", "n = 1", "error: 'x' has no value yet",
                          "error: the program has no register 'a[2]'", "y 4x3", "n = 1", "ch[0] 4x3", "ch[1] 4x3", "A 4x3", "a = 5", "op = 6", "t = 7", "l = 8",
                          "x = 9", "n = 4", "k = 5", "z = 0"])
        self.write("!register(ch[2])\n!macro_def\nm($a)\n!macro_begin\nprintln('here')\n!macro_end\nk = 5\nm(ch[k])\n")
        self.assertEqual(self.debug("b 5", "c", "p a 0 0", status=2)[-1], "error: 'a' is an element of an array of 2, and there is no number 5")

    def test_a_changed_cell_stops_the_program(self):
        # Drawn writes to single cells: the program stops where the watched one gets another value, and nowhere else.
        draw = random.Random(5)
        for _ in range(8):
            writes = [(draw.randrange(4), draw.randrange(3), draw.randrange(3)) for _ in range(40)]
            self.write("!register(A)\n" + "".join(f"pixel.set(A, {x}, {y}, {v})\n" for x, y, v in writes) + "surface.step\n")
            x, y = draw.randrange(4), draw.randrange(3)
            value, expected = 0, []
            for line, (i, j, written) in enumerate(writes, 2):
                if (i, j) == (x, y) and written != value:
                    value = written
                    expected.append((line + 1, value))
            out = self.debug(f"break change A {x} {y}", *["c", f"print A {x} {y}"] * (len(expected) + 1))
            self.assertEqual(out[1], f"breakpoint 1: change pixel.get(A, {x}, {y})")
            stops = [(int(at.split(":")[1]), float(told.split(" = ")[1])) for hit, at, told in zip(out, out[1:], out[2:]) if hit == "breakpoint 1"]
            self.assertEqual(stops, expected)

    def test_a_changed_value_stops_the_program(self):
        out = self.debug("break change globalsum(A) > 20", *["c", "print n"] * 2)
        self.assertEqual([line for line in out if line.startswith("n =")], ["n = 2", "n = 5"])
        self.assertRegex(self.debug("break change Z 1 1", status=2)[-1], "Z")
        self.debug("break change", status=2)

    def lines(self, out):
        return [int(line.split(":")[1]) for line in out if line.startswith("p.aps:")]

    def test_step_and_next(self):
        self.assertEqual(self.lines(self.debug("b 11", "c", *["next"] * 6)), [8, 11, 12, 13, 14, 15, 9, 10])
        self.assertEqual(self.lines(self.debug("b 12", "c", *["step"] * 6)), [8, 4, 5, 13, 18, 19, 14, 15])
        out = self.debug("b 4", "c", "where")
        self.assertEqual(out[-2:], ["p.aps:4: :t = $a", "  in twice, used at p.aps:12"])
        out = self.debug("b 18", "c", "where", "next", "next")
        self.assertIn("  in a routine, 1 calls deep", out)
        self.assertEqual(self.lines(out)[-2:], [19, 14])

    def test_next_is_the_next_line_of_what_runs(self):
        # Random functions and macros that use each other: after each number of steps, `next` stops where the lines that `step` visits, each
        # counted to the line in the running function, or in one around it, that leads to it, first are another line.
        draw = random.Random(3)
        for _ in range(4):
            text = "!register(A)\nn = 0\n"
            for level in range(3):
                for kind in "fm":
                    sigil, local = ("", "") if kind == "f" else ("$", ":")
                    text += (f"function y = f{level}(plane p)\n" if kind == "f" else f"!macro_def\n$y = m{level}($p)\n!macro_begin\n")
                    text += f"{local}t = {sigil}p + 1\n"
                    for _ in range(3):
                        text += draw.choice([f"{local}t = {local}t * 2\n"] + [f"{local}t = {draw.choice('fm')}{level - 1}({local}t)\n"] * 2
                                            if level else [f"{local}t = {local}t + {sigil}p\n"])
                    text += f"{sigil}y = {local}t\n" + ("endfunction\n" if kind == "f" else "!macro_end\n")
            text += "".join(draw.choice(["A = f2(A)\n", "A = m2(A)\n", "A = A + m1(A)\n", "for(i, 1, 2)\nA = f1(A)\nendfor\n"]) for _ in range(3))
            self.write(text)
            trace = []  # the line of each step, and those that lead to it, from the outside
            for line in self.debug("where", *["step", "where"] * 400, status=2)[1:]:
                if line.startswith("p.aps:"):
                    trace.append((int(line.split(":")[1]), []))
                elif line.startswith("  in "):
                    trace[-1][1].insert(0, int(line.split(":")[1]))
            trace = trace[::2]
            self.assertLess(len(trace), 390)

            def counted_to(at, running):
                line, callers = at
                shared = 0
                while shared < len(callers) and callers[:shared + 1] == running[:shared + 1]:
                    shared += 1
                return (line if shared == len(callers) else callers[shared]), callers[:shared]

            starts = draw.sample(range(len(trace)), 40)
            expected = []
            for position in starts:
                at = trace[position]
                for _ in range(3):
                    running = at[1]
                    position = next((i for i in range(position, len(trace)) if counted_to(trace[i], running) != at), None)
                    if position is None:
                        break
                    at = counted_to(trace[position], running)
                    expected.append(at[0])
            out = self.debug(*[command for start in starts for command in ("restart", *["step"] * start, *["next", "p n"] * 3)], "restart now", status=2)
            stops = [line for line, after in zip(out, out[1:]) if after == "n = 0"]
            self.assertEqual([int(line.split(":")[1]) for line in stops if line.startswith("p.aps:")], expected, text)

    def test_steps_of_instructions_report_the_breakpoints_that_they_reach(self):
        for breakpoint, stops in (("b 11", [11, 11]), ("break if n == 2", [11]), ("break change n", [11, 11]), ("break tick 1", [15])):
            out = self.debug(breakpoint, *["stepi"] * 20, "p n")
            self.assertEqual(out[-1], "n = 2")
            self.assertEqual([int(at.split(":")[1]) for hit, at in zip(out, out[1:]) if hit == "breakpoint 1"], stops, breakpoint)

    def test_ticks_conditions_and_restart(self):
        out = self.debug("break tick 3", "c", "print n", "restart", "print n", "break if n == 2", "delete 1", "c", "print n", "breakpoints")
        self.assertEqual([line for line in out if line.startswith("n = ")], ["n = 3", "n = 0", "n = 2"])
        self.assertEqual(out[-1], "2  if n == 2")
        self.assertEqual(self.debug("break if globalmax(B) > 110", "c", "print B 3 0")[-1], "B(3, 0) = 112")
        self.assertEqual(self.debug("tick", "tick", "p n")[-1], "n = 2")

    def test_a_breakpoint_keeps_its_number(self):
        out = self.debug("b 10", "b 11", "b 12", "b if n > 2", "delete 2", "breakpoints", "delete 2", "delete 3", "c", "delete 1", "c", "delete",
                         "b 15", "breakpoints", status=2)
        self.assertEqual(out[5:8], ["1  p.aps:10", "3  p.aps:12", "4  if n > 2"])
        self.assertEqual(out[8], "error: there is no breakpoint '2'")
        self.assertEqual([line for line in out[9:] if line.startswith("breakpoint")], ["breakpoint 1", "breakpoint 4", "breakpoint 5: p.aps:15"])
        self.assertEqual(out[-1], "5  p.aps:15")

    def test_conditions_of_arrays(self):
        self.write("!uint8(ch[3])\n!scalar(w[2])\nfor(i, 0, 2)\n  ch[i] = uint8(cell.x * i)\n  w[1] = w[1] + i\nendfor\nch[0] = 7\nsurface.step\n")
        for condition, stops in (("if pixel.get(ch[2], 3, 0) == 6", [5]), ("change ch[1] 2 0", [5]), ("change w[1]", [6, 6]), ("if w[1] + w[0] > 2", [6]),
                                 ("if globalmax(ch[0] + ch[1]) > 9", [8]), ("if pixel.get(ch[i], 3, 0) == 3", [5])):
            out = self.debug("break " + condition, *["c"] * (len(stops) + 1))
            self.assertEqual([int(line.split(":")[1]) for line in out[2:] if line.startswith("p.aps:")], stops, condition)
        self.assertIn("numbered from 0", self.debug("break if w[2] > 1", status=2)[-1])

    def test_values(self):
        out = self.debug("tick", "plane B 1 0 2 2", "picture A", "names", "save B b.csv", "save A a.png")
        self.assertIn("102 104", out)
        self.assertIn("A 4x3", out)
        self.assertIn("n = 1", out)
        self.assertEqual((self.folder / "b.csv").read_text().splitlines()[0], "100,102,104,106")
        self.assertTrue((self.folder / "a.png").read_bytes().startswith(b"\x89PNG"))
        self.assertTrue(any(set(line) <= set(" .:-=+*#%@") and "@" in line for line in out), out)

    def test_stepping_changes_no_result(self):
        whole = self.debug("c", "plane B", "p n")[2:]
        random_ = random.Random(1)
        for _ in range(8):
            commands = [random_.choice(["step", "next", "stepi", "tick"]) for _ in range(random_.randrange(5, 60))]
            self.assertEqual(self.final(commands), whole)

    def final(self, commands):
        """The values at the end, wherever the commands have led; those after the end are refused."""
        run = subprocess.run([APRON, "debug", "p.aps", "--size", "4x3"], input="\n".join([*commands, "c", "plane B", "p n"]) + "\n",
                             cwd=self.folder, capture_output=True, text=True, timeout=60)
        return run.stdout.splitlines()[-4:]

    def test_mistakes(self):
        for command, text in (("fly", "no command 'fly'"), ("print X", "no register 'X'"), ("print A 9 9", "outside a register of 4x3"),
                              ("plane A 0 0", "plane takes"), ("print A -1 0", "not a whole number"), ("break 999", "has instructions"),
                              ("break q.aps:1", "no file 'q.aps'"), ("break if X > 1", "X"), ("break if A", "'A'"),
                              ("break change A 9 9", "column 9, row 9 is outside a register of 4x3"), ("break if A > 1", "a condition takes a scalar, and this is a register"), ("break tick 0", "number of a tick"),
                              ("delete 3", "no breakpoint"), ("save A a.xyz", "must end in"), ("save Q a.npy", "'Q'"), ("print", "other arguments"),
                              ("step now", "other arguments")):
            out = self.debug(command, "p n", status=2)
            self.assertIn(text, out[1], command)
            self.assertTrue(out[1].startswith("error: "), out)
            self.assertEqual(out[2], "n = 0")  # the session goes on
        self.assertIn("restart", self.debug("c", "step", status=2)[-1])
        self.write("!register(A)\nx = pixel.get(A, 99, 0)\n")
        self.assertIn("p.aps:2: error: pixel.get", self.debug("c", status=1)[-1])
        self.write("A = 1 +\n")
        self.debug(status=2)
        self.debug(status=2, options=("--set", "speed=1"))

    def test_an_endless_loop_is_interrupted(self):
        self.write("n = 0\nwhile(n < 9)\n  n = n * 1\nendwhile\n")
        process = subprocess.Popen([APRON, "debug", "p.aps"], stdin=subprocess.PIPE, stdout=subprocess.PIPE, cwd=self.folder, text=True)
        self.children.append(process)
        process.stdin.write("c\np n\nq\n")
        process.stdin.flush()
        self.wait_for_work(process, 0.5)
        process.send_signal(signal.SIGINT)
        out = self.finish(process)[1]
        self.assertEqual((process.returncode, out.splitlines()[-1], "interrupted" in out), (0, "n = 0", True))


if __name__ == "__main__":
    unittest.main()
