"""Every routine of the library on registers of integers: the arithmetic of C, computed anew by NumPy on random cells, or one line
that refuses. APRON_LIBRARY_SEEDS=100 tries more seeds than the test does."""
import re

import numpy as np

from programs import *

LIBRARIES = ["apron", "morphology", "automata", "cnn", "filters", "waves", "integers"]
TYPES = {"int32": np.int32, "uint16": np.uint16, "uint8": np.uint8}
RULE_B, RULE_S = 0x48, 0x0C


def moved(a, dx, dy):
    """The image moved by dx columns east and dy rows south; 0 moves in."""
    y = np.zeros_like(a)
    h, w = a.shape
    y[max(dy, 0):h + min(dy, 0), max(dx, 0):w + min(dx, 0)] = a[max(-dy, 0):h + min(-dy, 0), max(-dx, 0):w + min(-dx, 0)]
    return y


STEPS = [(0, 1), (0, -1), (1, 0), (-1, 0), (1, 1), (1, -1), (-1, 1), (-1, -1)]  # of the image: the first is the north neighbour


def near(a, count=4):
    return [moved(a, *step) for step in STEPS[:count]]


def erode(a):
    return np.minimum.reduce([a, *near(a)])


def dilate(a):
    return np.maximum.reduce([a, *near(a)])


def times(f, n):
    def repeated(a):
        for _ in range(n):
            a = f(a)
        return a
    return repeated


def total(a, count):
    return sum(n.astype(np.int64) for n in near(a, count)).astype(a.dtype)  # modulo 2^n


def flood(seed, mask):
    y = (seed != 0) & (mask != 0)
    while True:
        grown = (y | np.logical_or.reduce(near(y))) & (mask != 0)
        if (grown == y).all():
            return y
        y = grown


def distance(mask):
    d = np.zeros(mask.shape, np.int64)
    for _ in range(sum(mask.shape)):
        d = np.where(mask != 0, 1 + np.minimum.reduce(near(d)), 0)
    return d


def spread_max(a, mask, rounds):
    y = np.pad(np.where(mask != 0, a.astype(float), -np.inf), 1, constant_values=-np.inf)
    inside = np.pad(mask != 0, 1)
    for _ in range(rounds):
        y = np.where(inside, np.maximum(y, np.maximum.reduce(near(y))), -np.inf)
    return np.where(inside, y, 0)[1:-1, 1:-1].astype(a.dtype)


def edges(a):
    y = np.zeros(a.shape, bool)
    y[[0, -1], :] = y[:, [0, -1]] = True
    return y


def peel(a, n, ne, e, se, s, sw, w, nw):
    n, ne, e, se, s, sw, w, nw = (p != 0 for p in (n, ne, e, se, s, sw, w, nw))
    runs = (~n & (ne | e)).astype(int) + (~e & (se | s)) + (~s & (sw | w)) + (~w & (nw | n))
    count = sum(p.astype(int) for p in (n, ne, e, se, s, sw, w, nw))
    return (a != 0) & ~(~n & (runs == 1) & (count >= 2))


def thin(a, direction):
    ring = [moved(a, *step) for step in ((0, 1), (-1, 1), (-1, 0), (-1, -1), (0, -1), (1, -1), (1, 0), (1, 1))]  # n, ne, e, … nw
    return peel(a, *(ring[2 * direction:] + ring[:2 * direction]))


def skeleton(a):
    y, before = a != 0, None
    while before is None or y.sum() != before.sum():
        before = y
        for direction in range(4):
            y = thin(y, direction)
    return y


def totalistic(a, born=RULE_B, survive=RULE_S):
    count = total(a, 8)
    rule = np.where(a != 0, survive, born)
    return (count <= 8) & (rule >> np.minimum(count, 8).astype(int) & 1 == 1)


def census(a):
    y = 0
    for bit, (dx, dy) in enumerate(((1, 1), (0, 1), (-1, 1), (1, 0), (-1, 0), (1, -1), (0, -1), (-1, -1))):
        y = y | (moved(a, dx, dy) < a).astype(np.int64) << bit
    return y


def filtered(*elements):
    """By rows of the filter, modulo 2^n."""
    side = int(len(elements) ** 0.5)
    return wrapped(lambda G: sum(e * moved(G, side // 2 - k % side, side // 2 - k // side) for k, e in enumerate(elements)))


def areas(values, mask):
    """The sum of each 4-connected component of the mask."""
    label = spread_max(np.arange(1, mask.size + 1).reshape(mask.shape), mask, mask.size)
    sums = np.zeros(mask.size + 1, np.int64)
    np.add.at(sums, label.ravel(), values.astype(np.int64).ravel())
    return np.where(mask != 0, sums[label], 0)


def largest(values, mask):
    """The largest value of each 4-connected component of the mask."""
    label = spread_max(np.arange(1, mask.size + 1).reshape(mask.shape), mask, mask.size)
    best = np.full(mask.size + 1, np.iinfo(np.int64).min)
    np.maximum.at(best, label.ravel(), values.astype(np.int64).ravel())
    return np.where(mask != 0, best[label], 0)


def wrapped(f):
    """f computed without bounds, from which the type's bits remain."""
    return lambda *planes: f(*(p.astype(np.int64) for p in planes)).astype(np.int64)


# The call, and its value from the planes that it names. A and B are binary, G and H any cells, L small numbers.
CALLS = {
    "swap(X, Y)": None,  # see the test
    "X = between(G, 3, 60)": lambda G: (G >= 3) & (G <= 60),
    "X = threshold(G, H)": lambda G, H: G >= H,
    "X = erode(G)": erode, "X = dilate(G)": dilate, "X = erode(A, 2)": times(erode, 2), "X = dilate(A, 3)": times(dilate, 3),
    "X = open(G)": lambda G: dilate(erode(G)), "X = close(A)": lambda A: erode(dilate(A)),
    "X = count_steps(A, 3)": lambda A: sum(times(erode, n)((A != 0).astype(int)) for n in range(4)),
    "X = spread_max(G, A, 4)": lambda G, A: spread_max(G, A, 4),
    "X = skeleton(A)": skeleton, "X = A\nmorphology.thin(X, 2)": lambda A: thin(A, 2),
    "X = G\nmorphology.peel(X, A, B, A, B, A, B, A, B)": lambda G, A, B: peel(G, A, B, A, B, A, B, A, B),
    "X = clear_edge(A)": lambda A: (A != 0) & ~flood(edges(A), A),
    "X = fill_holes(A)": lambda A: ~flood(edges(A), A == 0),
    "X = outline(A)": lambda A: (A != 0) & ~(erode(A) != 0),
    f"X = outer_totalistic(A, {RULE_B}, {RULE_S})": totalistic,
    "X = A\nlife(X)": lambda A: totalistic(A, 0x08, 0x0C), "X = A\nhighlife(X)": totalistic,
    "X = L\ngreenberg_hastings(X, 4, 1)": lambda L: np.where(L == 0, total((L == 1).astype(int), 4) >= 1, (L.astype(int) + 1) % 4),
    "X = elementary(A, 110)": lambda A: 110 >> (4 * moved(A, 1, 0).astype(int) + 2 * A + moved(A, -1, 0)) & 1,
    "X = median(G)": lambda G: np.median([G, *near(G)], axis=0),
    "X = laplacian(G)": wrapped(lambda G: sum(near(G)) - 4 * G),
    "X = census(G)": census,
    "X = filter.do(G, 'own')": filtered(-3, 0, 7, 2, -1, 11, 255, 1, -70000), "X = filter.stock3x3.edge(G)": filtered(-1, -1, -1, -1, 8, -1, -1, -1, -1),
    "X = sobel.x(G)": filtered(-1, 0, 1, -2, 0, 2, -1, 0, 1), "X = sobel.y(G)": filtered(-1, -2, -1, 0, 0, 0, 1, 2, 1),
    "X = sharpen(G)": filtered(0, -1, 0, -1, 5, -1, 0, -1, 0),
    "X = spread.max(G, A)": largest, "X = spread.max(G, F)": largest,
    "X = areas(A)": lambda A: areas(A != 0, A), "X = spread.sum(G, A)": areas, "X = spread.sum(G, F)": areas,
    "X = hamming8(G, H)": lambda G, H: np.vectorize(lambda v: int(v & 0xFF).bit_count())((G ^ H).astype(np.int64)),
    "X = flood(L, A)": flood, "X = flood(F, A)": flood,
    "X = distance(A)": distance,
    "X = cell.x": lambda A: np.broadcast_to(np.arange(A.shape[1]), A.shape),
    "X = cell.row": lambda A: np.broadcast_to(np.arange(A.shape[0])[:, None], A.shape),
}
# The same numbers as a register of floats draws.
DRAWN = ["random.int.rand(2, 120)", "random.int.white", "random.int.gauss(100, 5)"]
ONLY = {  # of some types
    "X = nine_of_sixteen(G)": (("uint16",), lambda G: np.vectorize(lambda v: "1" * 9 in f"{int(v):016b}" * 2)(G)),
    "X = label.int32(A)": (("int32",), lambda A: spread_max(np.arange(1, A.size + 1).reshape(A.shape), A, A.size)),
    "X = fast9(G, 25)": (("uint8",), None),  # compared in tests/apron/library-integers.aps
}
REFUSED = {
    "X = label(A)": "float", "forest_fire(X, 0.3, 0.2)": "gives floats",
    "X = filter.gauss.fast(G, 1)": "write float(…)", "X = filter.gauss.ani(G, 1, 2, 0.3)": "write float(…)", "X = sobel(G)": "write float(…)",
    "X = difference_of_gaussians(G, 0.7, 1.4)": "write float(…)",
    "X = travelling_wave(2, 7, 1, 0.5)": "float", "X = random.float.rand(0, 9)": "gives floats", "X = math.sqrt(G)": "write float(…)",
    "X = pow(G, 2)": "write float(…)", "X = random.int.rand(0, 5000000000)": "a whole number from",
}
# Of int32 at run time, where the step in time is a fraction; -1 is no uint8.
CNN = ["X = cnn.edge(A)", "X = cnn.corner(A)", "X = cnn.fill_holes(A, 6)", "X = cnn.shadow(A, 6)", "X = cnn.components(A, 6)",
       "cnn.run(X, G, 'cnn.own.A', 'cnn.edge.B', -1, 0.1, 5)"]
AT_RUN_TIME = {"X = box(G)": "0.11111111", "heat(X, 0.2)": "0.2", "wave(X, Y, 0.3, 0.01)": "0.3", "fitzhugh_nagumo(X, Y, 0.1, 0.5, 0.7, 0.8, 0.08)": "0."}
ELSEWHERE = {"cnn.output": "a clamp from -1 to 1",  # of int32 only, as clamp is
             "convolve": "matrix.product refuses what is no float"}


class LibraryTypes(ProgramTest):
    def run_calls(self, kind, calls, planes):
        """What each call leaves in X, by one program."""
        for name, plane in planes.items():
            np.save(self.folder / f"{name}.npy", plane)
        floats = [name for name, plane in planes.items() if plane.dtype == np.float32]
        text = "".join(f"!include('{name}.aps')\n" for name in LIBRARIES)
        text += "filter.create('own', 3, 3)\nfilter.fill3x3('own', -3, 0, 7, 2, -1, 11, 255, 1, -70000)\n"
        text += f"!register({', '.join(floats)})\n!{kind}(X, Y, {', '.join(name for name in planes if name not in floats)}, out[{len(calls)}])\n"
        text += "".join(f"{name} = io.array.open('{name}.npy')\n" for name in planes)
        text += "".join(f"X = 0\nY = 0\n{call}\nout[{k}] = X\nio.array.save(out[{k}], 'out{k}.npy')\n" for k, call in enumerate(calls))
        h, w = planes["A"].shape
        status, _, err = self.run_program(APRON, "run", self.write("all.aps", text), "--size", f"{w}x{h}", "--allow", str(self.folder))
        self.assertEqual((status, err), (0, ""))
        return [np.load(self.folder / f"out{k}.npy") for k in range(len(calls))]

    def test_values(self):
        for seed in range(int(os.environ.get("APRON_LIBRARY_SEEDS", "3"))):
            for kind, dtype in TYPES.items():
                random = np.random.default_rng([seed, len(kind)])
                shape = (int(random.integers(3, 24)), int(random.integers(3, 40)))
                limits = np.iinfo(dtype)
                binary = [(random.random(shape) < random.choice([0.3, 0.5, 0.8])).astype(dtype) for _ in range(2)]
                any_cells = [random.integers(limits.min, limits.max, shape, dtype, endpoint=True) for _ in range(2)]
                planes = {"A": binary[0], "B": binary[1], "G": any_cells[0], "H": any_cells[1],
                          "L": random.integers(0, 4, shape, dtype), "F": (random.random(shape) < 0.1).astype(np.float32)}
                wanted = {call: f for call, f in CALLS.items() if f is not None}
                wanted |= {call: f for call, (kinds, f) in ONLY.items() if kind in kinds and f is not None}
                got = self.run_calls(kind, [*wanted, "X = G\nY = H\nswap(X, Y)"], planes)
                np.testing.assert_array_equal(got.pop(), planes["H"])
                for (call, f), x in zip(wanted.items(), got):
                    names = [n for n in re.findall(r"\b[A-H]\b|\bL\b", call.replace("X = L\n", "L ").replace("X = A\n", "A ").replace("X = G\n", "G "))]
                    names = list(dict.fromkeys(names)) or ["A"]
                    value = np.asarray(f(*(planes[n] for n in names)))
                    if call == "X = distance(A)":
                        value = np.minimum(value, limits.max)
                    np.testing.assert_array_equal(x, value.astype(dtype), f"seed {seed}, {kind}: {call}")

    def test_numbers_are_those_of_floats(self):
        for kind in TYPES:
            lines = "".join(f"random.seed(7)\nX = {call}\nrandom.seed(7)\nF = {call}\nprintln(globalcount(float(X) != F), ' ', globalmax(X) > globalmin(X))\n"
                            for call in DRAWN)
            status, out, err = self.run_program(APRON, "run", self.write("d.aps", f"!{kind}(X)\n!register(F)\n{lines}"), "--size", "20x9")
            self.assertEqual((status, out, err), (0, "0 1\n" * len(DRAWN), ""))
        for kind in ("uint8", "uint16"):
            status, out, err = self.run_program(APRON, "run", self.write(
                "h.aps", f"!{kind}(I)\n!create('H', REGISTER, 5, 1)\nI = random.int.rand(0, 6)\nr[H] = histogram(I)\nprintln(r[H])\n"
                f"println(globalcount(I == 0), ' ', globalcount(I == 1), ' ', globalcount(I == 2), ' ', globalcount(I == 3), ' ', globalcount(I == 4))\n"))
            self.assertEqual((status, err), (0, ""))
            self.assertEqual(*out.splitlines())

    def test_small_arrays(self):
        for seed in range(int(os.environ.get("APRON_LIBRARY_SEEDS", "3"))):
            for kind, dtype in (TYPES | {"register": np.float32}).items():
                for index_kind, index_type in (TYPES | {"register": np.float32}).items():
                    random = np.random.default_rng([seed, len(kind), len(index_kind)])
                    shape, cells = (int(random.integers(1, 20)), int(random.integers(1, 30))), int(random.integers(1, 9))
                    low = 0 if index_kind.startswith("uint") else -2
                    at = random.integers(low, cells + 3, shape).astype(index_type)
                    limits = np.iinfo(dtype if kind != "register" else np.int16)
                    values = random.integers(limits.min, limits.max, shape, endpoint=True).astype(dtype)
                    np.save(self.folder / "at.npy", at)
                    np.save(self.folder / "values.npy", values)
                    type_name = "float" if kind == "register" else kind
                    program = self.write("s.aps", f"!{index_kind}(I)\n!{kind}(V)\n!create('H', REGISTER, {cells}, 1{'' if kind == 'register' else ', ' + kind})\n"
                                         "I = io.array.open('at.npy')\nV = io.array.open('values.npy')\n" +
                                         "".join(f"r[H] = {call}\nio.array.save(r[H], 'h{k}.npy')\n"
                                                 for k, call in enumerate(("scatter.sum(I, V)", "scatter.sum(I, 3)", "histogram(I)"))))
                    status, _, err = self.run_program(APRON, "run", program, "--size", f"{shape[1]}x{shape[0]}", "--allow", str(self.folder))
                    self.assertEqual((status, err), (0, ""), f"{type_name} at {index_kind}")
                    inside = (at >= 0) & (at < cells)
                    for k, added in enumerate((values, np.full(shape, 3), np.ones(shape))):
                        sums = np.zeros(cells, np.float64 if kind == "register" else np.int64)
                        np.add.at(sums, at[inside].astype(int), added[inside].astype(sums.dtype))
                        np.testing.assert_array_equal(np.load(self.folder / f"h{k}.npy").ravel(), sums.astype(dtype), f"seed {seed}: {kind} at {index_kind}")
        for text, message in (("!uint8(V)\n!create('H', REGISTER, 4, 1, int32)\nr[H] = scatter.sum(V, V)\n", "one type"),
                              ("!uint8(V)\n!create('H', REGISTER, 4, 1, uint8)\nr[H] = scatter.sum(V, 300)\n", "300 is no uint8")):
            status, _, err = self.run_program(APRON, "check", self.write("s.aps", text))
            self.assertEqual((status, err.count("error:")), (2, 1), err)
            self.assertIn(message, err)

    def test_the_others_refuse_in_one_line(self):
        self.write("filters.npy", "")
        for kind in TYPES:
            head = "".join(f"!include('{name}.aps')\n" for name in LIBRARIES) + f"!{kind}(X, Y, A, G)\n"
            cnn_reasons = dict.fromkeys(CNN, "0.1" if kind == "int32" else "-1 is no uint")
            for call, reason in (REFUSED | (cnn_reasons if kind != "int32" else {})).items():
                program = self.write("r.aps", head + call + "\n")
                status, _, err = self.run_program(APRON, "run", program)
                self.assertEqual(status, 2, f"{kind}: {call}")
                self.assertRegex(err.splitlines()[0], r"^\S+\.aps:\d+:\d+: error: ", f"{kind}: {call}")
                self.assertIn(reason, err, f"{kind}: {call}")
            for call, number in (AT_RUN_TIME | (cnn_reasons if kind == "int32" else {})).items():
                status, _, err = self.run_program(APRON, "run", self.write("r.aps", head + call + "\n"))
                self.assertEqual((status, err.count("\n")), (1, 1), f"{kind}: {call}\n{err}")
                self.assertRegex(err, rf"^\S+\.aps:\d+: error: {re.escape(number)}.* is no ({kind}|int32)", f"{kind}: {call}")
        program = self.write("r.aps", "!uint8(X)\nX = cell.x\n")
        status, _, err = self.run_program(APRON, "check", program, "--size", "300x2")
        self.assertIn("299 is no uint8", err)

    def test_no_routine_is_missing(self):
        tried = "\n".join([*CALLS, *ONLY, *REFUSED, *CNN, *AT_RUN_TIME, *ELSEWHERE])
        for library in LIBRARIES:
            text = (ROOT / f"scripts/apron/{library}.aps").read_text()
            names = re.findall(r"^function (?:[\w, ]+ = )?([\w.]+)\(", text, re.M) + re.findall(r"!macro_def\n(?:\$\w+ = )?([\w.]+)", text)
            for name in names:
                self.assertIn(name, tried, f"{library}.aps")


if __name__ == "__main__":
    unittest.main()
