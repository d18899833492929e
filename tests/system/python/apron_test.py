"""The package apron: programs as functions of NumPy arrays, equal to `apron run` in every bit."""
import gc
import math
import os
import pathlib
import pickle
import random
import signal
import subprocess
import sys
import tempfile
import threading
import time
import unittest

try:
    import numpy as np
except ImportError:
    print("skipped: NumPy is not installed")
    sys.exit(77)
import apron

APRON = os.environ["APRON"]

SMOOTH = """
!include('morphology.aps')
!register(A, B, Y)
sim.slider.add('gain', 0, 10, 2)
gain = sim.slider.get('gain')
Y = max(A, north(A)) * gain + B
where(B > 0.5)
  Y = Y + near.sum(A, 8)
endwhere
total = globalsum(Y)
"""


class RandomText:
    """Random programs as text: arithmetic, neighbours, filters, masks, loops, functions, random numbers."""

    def __init__(self, seed):
        self.r = random.Random(seed)
        self.registers = ["A", "B", "C", "D", "E"]
        self.scalars = ["s", "t"]
        self.boundary = self.r.choice(["", "", "boundary('wrap')", "boundary('replicate')", "boundary(1.5)"])

    def expression(self, depth=0):
        r = self.r
        if depth > 2 or r.random() < 0.3:
            return r.choice(self.registers + self.scalars + ["0.5", "-2", "3"])
        one, two = self.expression(depth + 1), self.expression(depth + 1)
        kind = r.randrange(8)
        if kind < 3:
            return f"({one} {r.choice(['+', '-', '*', '/', '<', '>=', 'and', 'or', '%'])} {two})"
        if kind == 3:
            return f"{r.choice(['min', 'max', 'math.atan2', 'pow'])}({one}, {two})"
        if kind == 4:
            return f"{r.choice(['abs', 'neg', 'sign', 'math.sin', 'math.sqrt', 'math.exp', 'math.floor'])}({one})"
        if kind == 5:
            return f"select({one}, {two}, {r.choice(self.registers)})"
        register = r.choice(self.registers)
        return r.choice([f"north({register})", f"east({register})", f"near.sum({register}, 8)", f"near.max({register}, 4)",
                         f"filter.do({register}, 'k')", f"near.any({register}, 4)"])

    def line(self, depth=0):
        r = self.r
        kind = r.randrange(12)
        if kind == 0 and depth < 2:
            return [f"where({self.expression()} > 0)", *self.lines(3, depth + 1), "endwhere"]
        if kind == 1 and depth < 2:
            return [f"repeat({r.randrange(1, 4)})", *self.lines(3, depth + 1), "endrepeat"]
        if kind == 2:
            return [f"{r.choice(self.scalars)} = {r.choice(['globalsum', 'globalmax', 'globalcount'])}({r.choice(self.registers)})"]
        if kind == 3:
            return [f"{r.choice(self.registers)} = random.float.rand(-1, 1)"]
        if kind == 4:
            return [f"shift.{r.choice(['north', 'west'])}({r.choice('AB')}, {r.choice('CDE')}, {r.randrange(1, 9)})"]
        return [f"{r.choice(self.registers)} = {self.expression()} + 0 * A"]

    def lines(self, count, depth=0):
        return [line for _ in range(self.r.randrange(1, count + 1)) for line in self.line(depth)]

    def text(self):
        return "\n".join(["!register(A, B, C, D, E)", "filter.create('k', 3, 3)",
                          "filter.fill3x3('k', 1, -0.5, 0, 2, 0.25, 0, 1, 0, -1)", "s = 1.5", "t = -0.25", self.boundary,
                          *self.lines(12)]) + "\n"


class Functions(unittest.TestCase):
    def setUp(self):
        self.folder = pathlib.Path(self.enterContext(tempfile.TemporaryDirectory(prefix="apron-function-")))
        self.random = np.random.default_rng(5)

    def cells(self, *shape):
        return self.random.uniform(-2, 2, shape).astype(np.float32)

    def run_program(self, text, shape, inputs, outputs, *options):
        """The registers after `apron run`, which reads the inputs from files."""
        for name, array in inputs.items():
            np.save(self.folder / f"{name}.npy", array)
        opens = "".join(f"{name} = io.array.open('{name}.npy')\n" for name in inputs)
        head, rest = text.split("\n", 1)
        (self.folder / "p.aps").write_text(head + "\n" + opens + rest)
        saves = [word for name in outputs for word in ("--save", f"{name}={name}.out.npy")]
        subprocess.run([APRON, "run", "p.aps", "--size", f"{shape[1]}x{shape[0]}", *saves, *options], cwd=self.folder, check=True)
        return {name: np.load(self.folder / f"{name}.out.npy") for name in outputs}

    def assert_bits(self, got, want, what=""):
        self.assertEqual((got.shape, got.dtype), (want.shape, want.dtype), what)
        same = (got.view(np.uint32) == want.view(np.uint32)) if got.flags.c_contiguous else \
            (np.ascontiguousarray(got).view(np.uint32) == np.ascontiguousarray(want).view(np.uint32))
        self.assertTrue((same | (np.isnan(got) & np.isnan(want))).all(), what)

    def test_random_programs_equal_apron_run(self):
        refused = 0
        first, count = int(os.environ.get("APRON_PROGRAM_FIRST", "0")), int(os.environ.get("APRON_PROGRAM_SEEDS", "60"))
        for seed in range(first, first + count):
            text, self.random = RandomText(seed).text(), np.random.default_rng(seed)
            shape = [(7, 9), (1, 1), (16, 64), (33, 17), (130, 144)][seed % 5]
            inputs = {"A": self.cells(*shape), "B": self.cells(*shape)}
            try:
                f = apron.compile(text, threads=1 + seed % 2)
            except apron.Error:
                refused += 1
                continue
            outputs = [name for name in f.results if name in "ABCDE"]
            want = self.run_program(text, shape, inputs, outputs)
            for call in range(2):  # the second finds what the first has left
                got = f.run({name: inputs.get(name, 0) for name in (*f.inputs, *inputs) if name in f.inputs + f.outputs})
                for name in outputs:
                    self.assert_bits(got[name], want[name], f"seed {seed}, call {call}, {name}:\n{text}")
        self.assertLess(refused, 2 + count / 5)

    def test_results_by_name_parameters_and_numbers(self):
        f = apron.compile(SMOOTH)
        self.assertEqual((f.inputs, set(f.results)), (("A", "B"), {"Y", "gain", "total"}))
        self.assertEqual(f.parameters, {"gain": (2.0, 0.0, 10.0)})
        a, b = self.cells(8, 12), self.cells(8, 12)
        one, two = f(A=a, B=b), f(a, b, gain=3)
        self.assertEqual((one["gain"], two["gain"]), (2.0, 3.0))
        self.assertFalse((one["Y"] == two["Y"]).all())
        self.assertAlmostEqual(one["total"], float(one["Y"].sum()), delta=1e-3)
        self.assert_bits(f(A=a, B=0.25)["Y"], f(A=a, B=np.full((8, 12), 0.25, np.float32))["Y"])
        only = apron.compile(SMOOTH, results=["total"])
        self.assertEqual(only(a, b), {"total": one["total"]})
        for gain in (-0.1, 10.1, np.nan, np.inf):
            with self.assertRaisesRegex(ValueError, rf"'gain' = {gain} is not from 0 to 10"):
                f(a, b, gain=gain)

    def test_layouts_and_types(self):
        f = apron.compile("!register(A, Y)\nY = A * 2\n")
        a = self.cells(40, 50)
        for view in (a, a[::2, ::3], a[::-1, ::-1], a.T, np.asfortranarray(a), a[3:, 7:], np.broadcast_to(a[0], (9, 50))):
            self.assert_bits(f(view)["Y"], view * np.float32(2))
        with np.errstate(over="ignore"):
            for array in (np.arange(-6, 6).reshape(3, 4), np.array([[True, False]]), np.uint8([[200, 255]]), np.float16([[1.5]]),
                          np.array([[2**24 + 1, 2**40 + 3]]), np.array([[1e300, math.nan, -math.inf]]), a.astype(">f4")):
                self.assert_bits(f(array)["Y"], array.astype(np.float32) * np.float32(2))
        misaligned = np.frombuffer(b"x" + a.tobytes(), np.uint8)[1:].view(np.float32).reshape(a.shape)
        self.assert_bits(f(misaligned)["Y"], a * np.float32(2))
        before = a.copy()
        g = apron.compile("!register(A)\nA = A + 1\n")  # written by the program, not in the caller's array
        self.assert_bits(g(A=a)["A"], a + np.float32(1))
        self.assert_bits(a, before)
        a.flags.writeable = False
        self.assert_bits(f(a)["Y"], a * np.float32(2))

    def test_large_arrays_without_copies(self):
        text = "!register(A, Y)\nY = A + north(A) + west(A)\n"
        f = apron.compile(text)
        a = self.cells(160, 256)
        laid_out = apron.zeros(a.shape)
        laid_out[...] = a
        want = f(a)["Y"]
        self.assert_bits(f(laid_out)["Y"], want)
        chained = f(want)["Y"]                    # a result is an input
        self.assert_bits(chained, f(np.ascontiguousarray(want))["Y"])
        kept = want.copy()
        for _ in range(5):
            f(chained)
        self.assert_bits(want, kept)              # a result stays what it was
        for wrapped in ("boundary('wrap')\n", "boundary(2)\n"):
            g = apron.compile(text.replace("Y =", wrapped + "Y ="))
            self.assert_bits(g(laid_out)["Y"], g(a)["Y"])
            self.assert_bits(f(g(laid_out)["Y"])["Y"], f(np.ascontiguousarray(g(a)["Y"]))["Y"])
        self.assert_bits(f(laid_out[:, 16:])["Y"], f(a[:, 16:])["Y"])
        self.assert_bits(f(laid_out[5:9])["Y"], f(a[5:9])["Y"])
        self.assert_bits(f(laid_out)["Y"], want)
        del f
        gc.collect()
        self.assert_bits(want, kept)              # and outlives the function

    def test_integers(self):
        for name, dtype in (("uint8", np.uint8), ("uint16", np.uint16), ("int32", np.int32)):
            f = apron.compile(f"!{name}(A, B, Y, Z)\nY = A * 3 + B\nZ = sat.add(A, north(B)) ^ (A >> 2)\nn = globalsum(A)\n")
            low, high = np.iinfo(dtype).min, np.iinfo(dtype).max
            for shape in ((5, 7), (160, 256), (130, 33)):
                a, b = (self.random.integers(low, high, shape, dtype, endpoint=True) for _ in range(2))
                north = np.vstack([np.zeros_like(b[:1]), b[:-1]]).astype(np.int64)
                want = {"Y": (a.astype(np.int64) * 3 + b).astype(dtype),
                        "Z": np.clip(a + north, low, high).astype(dtype) ^ (a >> 2)}
                laid_out = apron.empty(shape, dtype)
                laid_out[...] = a
                for given in (a, laid_out, np.asfortranarray(a), np.repeat(a, 2, axis=1)[:, ::2]):
                    got = f(given, b)
                    self.assertEqual(got["n"], a.sum(dtype=np.int64))
                    for key, value in want.items():
                        self.assertEqual(got[key].dtype, dtype)
                        np.testing.assert_array_equal(got[key], value)
                batch = f(np.stack([a, b]), b)["Y"]
                np.testing.assert_array_equal(batch[0], want["Y"])
                out = np.zeros(shape, dtype)
                f(a, b, out={"Y": out})
                np.testing.assert_array_equal(out, want["Y"])
            np.testing.assert_array_equal(f(np.array([[True, False]]), 1)["Y"], [[4, 1]])
            for wrong, error, text in ((np.zeros((2, 2)), TypeError, f"float64: must be of {name}"), (-2**31 - 1, ValueError, "whole"),
                                       (0.5, ValueError, "must be a whole number")):
                with self.assertRaisesRegex(error, text):
                    f(wrong, 1)
            with self.assertRaisesRegex(TypeError, f"of {name}"):
                f(a, b, out={"Y": np.zeros(shape, np.float32)})
        with self.assertRaisesRegex(TypeError, "float64"):
            apron.empty((2, 2), np.float64)

    def test_batches(self):
        f = apron.compile(SMOOTH)
        a, b = self.cells(21, 9, 14), self.cells(9, 14)
        singles = [f(one, b) for one in a]
        for threads in (1, 2, 5):
            g = apron.compile(SMOOTH, threads=threads)
            for _ in range(2):
                batch = g(a, b)
                self.assertEqual((batch["Y"].shape, batch["total"].shape), (a.shape, (21,)))
                for i, one in enumerate(singles):
                    self.assert_bits(batch["Y"][i], one["Y"])
                    self.assertEqual(batch["total"][i], one["total"])
        out = a.copy()  # shifted against its input, which it overwrites
        both = np.zeros((22, 9, 14), np.float32)
        both[:21] = a
        g(both[:21], b, out={"Y": both[1:]})
        self.assert_bits(both[1:], batch["Y"])
        g(out, b, out={"Y": out})
        self.assert_bits(out, batch["Y"])

    def test_out(self):
        f = apron.compile("!register(A, Y)\nY = A + 1\n")
        a = self.cells(6, 8)
        wide = np.zeros((6, 16), np.float32)
        result = f(a, out={"Y": wide[:, ::2]})
        self.assertTrue(np.shares_memory(result["Y"], wide))
        self.assert_bits(np.ascontiguousarray(wide[:, ::2]), a + np.float32(1))
        self.assertFalse(wide[:, 1::2].any())
        block = apron.empty((6, 8))
        block[...] = 9
        self.assertIs(f(a, out={"Y": block})["Y"], block)
        self.assert_bits(block.copy(), a + np.float32(1))
        f(block, out={"Y": block})  # its own argument
        self.assert_bits(block.copy(), a + np.float32(1) + np.float32(1))
        places = apron.compile("!register(A, Y)\nwhere(A > 0)\nY = A\nendwhere\n")
        places(a, out={"Y": block})
        self.assert_bits(block.copy(), np.where(a > 0, a, np.float32(0)))
        places(a)
        self.assert_bits(block.copy(), np.where(a > 0, a, np.float32(0)))
        self.assert_bits(apron.compile("!register(A, Unread, Y)\nY = A\n")(A=a)["Y"], a)
        read_only = np.zeros((6, 8), np.float32)
        read_only.flags.writeable = False
        for out, error, text in (({"Y": read_only}, ValueError, "read-only"), ({"Y": np.zeros((6, 8))}, TypeError, "float32"),
                                 ({"Y": np.zeros((6, 9), np.float32)}, ValueError, "shape"), ({"Z": a}, TypeError, "Z"),
                                 ([a], TypeError, "dict"), ({"Y": [1]}, TypeError, "float32")):
            with self.assertRaisesRegex(error, text):
                f(a, out=out)

    def test_a_path_with_a_nul_is_refused_as_by_open(self):
        for call in (lambda: apron.compile(pathlib.Path("a.aps\0.aps")), lambda: apron.compile("a\0.aps"),
                     lambda: apron.compile("!register(A)\nA = A\n", include=["folder\0"])):
            with self.assertRaisesRegex(ValueError, "^embedded null character$"):
                call()

    def test_texts_of_errors_have_no_control_characters(self):
        with self.assertRaises(apron.Error) as caught:
            apron.compile("!register(A)\nA = ('\u202eab\x9bä')\n")
        self.assertIn("('?ab?ä')\n", str(caught.exception))
        self.assertNotRegex(str(caught.exception), "[\x80-\x9f\u202e]")

    def test_errors_name_the_place(self):
        (self.folder / "wrong.aps").write_text("!register(A)\nA = B + 1\n")
        with self.assertRaises(apron.Error) as caught:
            apron.compile(self.folder / "wrong.aps")
        self.assertEqual((caught.exception.line, caught.exception.column), (2, 5))
        self.assertTrue(caught.exception.file.endswith("wrong.aps"))
        f = apron.compile("!register(A)\nn = globalmax(A)\nx = pixel.get(A, n, 0)\n")
        self.assertEqual(f(A=np.zeros((2, 2)))["x"], 0)
        for _ in range(2):
            with self.assertRaisesRegex(apron.Error, "<text>:3: error: pixel.get at column 7"):
                f(A=np.full((2, 2), 7))
        batch = np.zeros((9, 2, 2))
        batch[4:] = 8
        batch[6] = 9
        for threads in (1, 3):
            with self.assertRaisesRegex(apron.Error, "column 8"):
                apron.compile("!register(A)\nn = globalmax(A)\nx = pixel.get(A, n, 0)\n", threads=threads)(A=batch)
        self.assertEqual(f(A=np.ones((2, 2)))["x"], 1)
        g = apron.compile("!register(A, Y)\nY = A\n")
        for arguments, error, text in (({}, TypeError, "A is missing"), ({"A": [1, 2]}, TypeError, "array or a number"),
                                       ({"A": np.zeros(4)}, ValueError, r"shape \(4,\)"), ({"A": np.zeros((2, 2, 2, 2))}, ValueError, "shape"),
                                       ({"A": np.zeros((0, 3))}, ValueError, "0 rows"), ({"A": np.zeros((0, 2, 2))}, ValueError, "nothing"),
                                       ({"A": np.zeros((2, 2), complex)}, TypeError, "complex"), ({"A": np.array([["x"]])}, TypeError, "array of"),
                                       ({"A": 1, "Q": 2}, TypeError, "'Q'"), ({"A": 1, "ticks": 2}, TypeError, "argument of apron.compile"),
                                       ({"A": np.zeros((2, 2)), "Y": np.zeros((3, 2))}, ValueError, "Y has 3 rows"),
                                       ({"A": np.zeros((2, 2, 2)), "Y": np.zeros((3, 2, 2))}, ValueError, "planes")):
            with self.assertRaisesRegex(error, text):
                g.run(arguments)
        for source, arguments in (("while(1)\nendwhile\n", {}), ("!module('m')\nplugin(?, 1)\n", {}), ("n = 1\n", {"results": ["m"]}),
                                  ("n = 1\n", {"results": ["n", "n"]}), ("n = 1\n", {"isa": "mmx"}), ("nowhere.aps", {})):
            with self.assertRaises(apron.Error):
                apron.compile(source, **arguments)
        for arguments in ({"threads": 0}, {"threads": 2.5}, {"shape": (0, 4)}, {"shape": 5}, {"ticks": -1}, {"results": "Y"}):
            with self.assertRaises(ValueError):
                apron.compile("n = 1\n", **arguments)
        with self.assertRaisesRegex(apron.Error, "<text>:2: error: a program reads and writes files only in apron run"):
            apron.compile("!register(A)\nio.array.save(A, 'a.npy')\n")(A=1)

    def test_sizes(self):
        f = apron.compile("!create('K', REGISTER, 3, 2)\n!register(A, Y)\nY = A * pixel.get(r[K], 2, 1) + SURFACE_WIDTH\n")
        k = np.arange(6, dtype=np.float32).reshape(2, 3)
        for shape in [(4, 5), (64, 64), (9, 2), *((n, n + 1) for n in range(1, 40)), (4, 5)]:
            a = self.cells(*shape)
            self.assert_bits(f.run({"A": a, "K": k})["Y"], a * np.float32(5) + np.float32(shape[1]))
        fixed = apron.compile("!register(Y)\nY = cell.x\n", shape=(2, 3))
        self.assertEqual(fixed()["Y"].tolist(), [[0, 1, 2]] * 2)

    def test_frames_and_printing(self):
        f = apron.compile("#frame\nn = surface.tick\nprintln('frame ', n)\nsim.frame\njump(#frame)\n", ticks=4)
        code = "import apron, pickle, sys; pickle.loads(sys.stdin.buffer.read())()"
        out = subprocess.run([sys.executable, "-c", code], input=pickle.dumps(f), capture_output=True, check=True).stdout
        self.assertEqual(out.decode().split("\n")[:4], [f"frame {i}" for i in range(4)])
        self.assertEqual(f()["n"], 3)

    def test_dialects(self):
        script = "!register(Host)\nSET(R5)\nCLR(R6)\nR7 = R5 R6\nHost = 40 * R7 * cell.x\n"
        for original in ("scamp5c", True):
            text = script if original != True else "!register(Host)\n_nop\nHost = 40 * cell.x\n"
            f = apron.compile(text, original=original, results=["Host"], shape=(1, 3))
            for call in (f, pickle.loads(pickle.dumps(f))):
                self.assertEqual(call()["Host"].tolist(), [[0, 40, 80]])
        for original in ("scamp6", "", 1, None):
            with self.assertRaisesRegex(ValueError, "must be True, False or 'scamp5c'"):
                apron.compile(script, original=original)

    def test_several_threads(self):
        f = apron.compile(SMOOTH, threads=2)
        inputs = [(self.cells(60, 50), self.cells(60, 50)) for _ in range(8)]
        want = [f(*pair)["Y"] for pair in inputs]
        wrong = []

        def work(k):
            for i in range(150):
                k = (k + 1) % 8
                if i % 10 == 0:
                    stack = np.stack([inputs[k][0]] * 3)
                    same = (f(stack, inputs[k][1])["Y"][2] == want[k]).all()
                else:
                    same = (f(*inputs[k])["Y"] == want[k]).all()
                if not same:
                    wrong.append(k)
        threads = [threading.Thread(target=work, args=(i,)) for i in range(4)]
        for one in threads:
            one.start()
        for one in threads:
            one.join()
        self.assertEqual(wrong, [])

    def test_fork(self):
        f = apron.compile(SMOOTH, threads=2)
        a, b = self.cells(300, 200), self.cells(300, 200)
        want, batch = f(a, b)["Y"], f(np.stack([a] * 4), b)["Y"]
        child = os.fork()
        if child == 0:
            good = (f(a, b)["Y"] == want).all() and (f(np.stack([a] * 4), b)["Y"] == batch).all()
            os._exit(0 if good else 1)
        deadline = time.monotonic() + 60
        while (done := os.waitpid(child, os.WNOHANG))[0] == 0 and time.monotonic() < deadline:
            time.sleep(0.01)
        if done[0] == 0:
            os.kill(child, signal.SIGKILL)
            os.waitpid(child, 0)
        self.assertEqual(done[1], 0)
        self.assert_bits(f(a, b)["Y"], want)

    def test_an_endless_run_is_interrupted(self):
        f = apron.compile("n = 0\nwhile(n >= 0)\n  n = n + 1\n  if(n > 1000)\n    n = 1\n  endif\nendwhile\n")
        g = apron.compile("!register(A)\nwhile(globalmax(A) < 2)\n  A = A * 1\nendwhile\n", threads=2)
        for call in (f, lambda: g(A=np.zeros((5, 1, 1)))):
            with self.assertRaises(KeyboardInterrupt):
                threading.Timer(0.2, os.kill, (os.getpid(), signal.SIGINT)).start()
                call()
        self.assertEqual(apron.compile("n = 1\n")(), {"n": 1.0})

    def test_ticks_bound_a_run_without_frames(self):
        text = "!register(A)\n#again\nA = A + 1\njump(#again)\n"
        for ticks in (None, 3):
            with self.assertRaisesRegex(apron.Error, "^<text>:4: error: the program repeats forever without a frame, which ticks="):
                apron.compile(text, ticks=ticks)
        # The loop has no work per cell, so that the limit is reached soon.
        waiting = apron.compile("!register(A, N)\nn = pixel.get(A, 0, 0)\nwhile(n < 2)\n  m = m + 1\nendwhile\nN = n\nsim.frame\n", ticks=3,
                                shape=(1024, 1024))
        with self.assertRaisesRegex(apron.Error, "^<text>:[345]: error: 500000 instructions without surface.step"):
            waiting(A=0)
        self.assertEqual(waiting(A=2)["N"][0, 0], 2)

    def test_other_threads_run_meanwhile(self):
        f = apron.compile("!register(A)\nrepeat(3000)\n  A = math.sin(A) + 1\nendrepeat\n")
        ticks, stop = [], threading.Event()

        def count():
            while not stop.wait(0.001):
                ticks.append(1)
        counter = threading.Thread(target=count)
        counter.start()
        f(A=np.ones((256, 256)))
        stop.set()
        counter.join()
        self.assertGreater(len(ticks), 3)

    def test_instruction_sets_agree(self):
        a, b = self.cells(50, 70), self.cells(50, 70)
        want = apron.compile(SMOOTH, isa="portable")(a, b)
        for isa in ("avx2", "avx512"):
            try:
                f = apron.compile(SMOOTH, isa=isa)
            except apron.Error:
                continue  # not this computer's
            self.assert_bits(f(a, b)["Y"], want["Y"])


if __name__ == "__main__":
    unittest.main()
