"""Random sequences of the instructions of scamp5.aps against an interpreter of the chip's transfers: each instruction as the
list of `bus` and digital operations of the chip's header, with the gates FLAG and R0."""
import numpy as np

from programs import *

SIZE = 8
ANALOGUE = ["A", "B", "C", "D", "E", "F", "NEWS"]
DIGITAL = [f"R{k}" for k in range(13)]
SHIFTS = {"north": (-1, 0), "south": (1, 0), "west": (0, -1), "east": (0, 1)}
NEWS_OF = {"XN": "north", "XE": "east", "XS": "south", "XW": "west"}
ERRORS = ["cell_gain", "cell_offset", "cell_split"]


def neighbour(a, direction, beyond=0):
    """The value of that neighbour in every cell."""
    dy, dx = SHIFTS[direction]
    padded = np.pad(a, 1, constant_values=beyond)
    return padded[1 + dy:1 + dy + a.shape[0], 1 + dx:1 + dx + a.shape[1]]


class Chip:
    """The registers, and what one operation of the chip does to them."""

    def __init__(self, registers, gain=0.0, offset=0.0, cells=None, saturates=True):
        self.r = registers
        self.gain = gain + (cells["cell_gain"] if cells else 0)
        self.offset = offset + (cells["cell_offset"] if cells else 0)
        self.split = cells["cell_split"] if cells else 0.0
        self.saturates = saturates

    def store(self, y, value):
        value = value + (value * self.gain + self.offset)
        if self.saturates:
            value = np.clip(value, -128, 128 if y == "NEWS" else 127)
        self.r[y] = np.where(self.r["FLAG"] != 0, value, self.r[y])

    def value(self, a):
        return neighbour(self.r["NEWS"], NEWS_OF[a]) if a in NEWS_OF else self.r[a]

    def bus(self, y, *sources):
        self.store(y, -sum((self.value(a) for a in sources), np.zeros((SIZE, SIZE))))

    def bus2(self, y, z, *sources):
        total = sum((self.value(a) for a in sources), np.zeros((SIZE, SIZE)))
        first = total / 2 * (1 + self.split)
        second = total - first
        self.store(y, -first)
        self.store(z, -second)

    def write(self, y, bits):
        bits = np.asarray(bits, dtype=float) * np.ones((SIZE, SIZE))
        self.r[y] = np.where(self.r["R0"] != 0, bits, self.r["R12"]) if y == "R12" else bits

    # ---- the header's analogue macros
    def res(self, *targets):
        self.bus("NEWS")
        for y in targets:
            self.bus(y, "NEWS")

    def mov(self, y, a):
        self.bus("NEWS", a)
        self.bus(y, "NEWS")

    def neg(self, y, a):
        self.bus("NEWS")
        self.bus(y, "NEWS", a)

    def add(self, y, *sources):
        self.bus("NEWS", *sources)
        self.bus(y, "NEWS")

    def sub(self, y, a, b):
        self.bus("NEWS", a)
        self.bus(y, "NEWS", b)

    def abs(self, y, a):
        self.bus("NEWS")
        self.bus(y, "NEWS", a)
        self.bus("NEWS", a)
        self.where(a)
        self.bus(y, "NEWS")
        self.all()

    def divq(self, y, a):
        self.bus2(y, "NEWS", a)
        self.bus(y, "NEWS")

    def div(self, y, n, *rest):
        kept, a = rest if len(rest) == 2 else (rest[0], rest[0])
        self.bus2(y, n, a)
        self.bus("NEWS", a, n)
        self.bus(kept, "NEWS", y)
        self.bus2(y, n, kept)
        self.bus(y, n)

    def diva(self, y, n, m):
        self.bus2(n, m, y)
        self.bus("NEWS", n, y)
        self.bus(y, "NEWS", m)
        self.bus2(n, m, y)
        self.bus(y, n)

    def moved(self, direction, *sources):
        """The first half of movx and its kin: NEWS receives from that neighbour."""
        self.store("NEWS", -neighbour(sum(self.value(a) for a in sources), direction))

    def movx(self, y, a, direction):
        self.moved(direction, a)
        self.bus(y, "NEWS")

    def addx(self, y, a, b, direction):
        self.moved(direction, a, b)
        self.bus(y, "NEWS")

    def subx(self, y, a, direction, b):
        self.moved(direction, a)
        self.bus(y, "NEWS", b)

    def mov2x(self, y, a, first, second):
        self.moved(first, a)
        self.bus(y, "X" + second[0].upper())

    def add2x(self, y, a, b, first, second):
        self.moved(first, a, b)
        self.bus(y, "X" + second[0].upper())

    def sub2x(self, y, a, first, second, b):
        self.moved(first, a)
        self.bus(y, "X" + second[0].upper(), b)

    def where(self, *sources):
        self.r["FLAG"] = (sum(self.value(a) for a in sources) > 0).astype(float)

    def all(self):
        self.r["FLAG"] = np.ones((SIZE, SIZE))

    # ---- the header's digital macros
    def WHERE(self, *sources):
        self.r["FLAG"] = self.any(sources)

    def any(self, sources):
        return np.logical_or.reduce([self.r[a] != 0 for a in sources]).astype(float)

    def SET(self, *targets):
        for y in targets:
            self.write(y, 1)

    def CLR(self, *targets):
        for y in targets:
            self.write(y, 0)

    def MOV(self, y, a):
        self.write(y, self.r[a])

    def OR(self, y, *sources):
        self.write(y, self.any(sources if len(sources) > 1 else (y, *sources)))

    def NOR(self, y, *sources):
        self.write(y, 1 - self.any(sources if len(sources) > 1 else (y, *sources)))

    def NOT(self, y, *source):
        self.write(y, 1 - self.any(source or (y,)))

    def AND(self, y, a, b):
        self.SET("R0")
        self.NOT("R12", a)
        self.NOT("R0", b)
        self.NOR(y, "R0", "R12")

    def NAND(self, y, a, b):
        self.SET("R0")
        self.NOT("R12", a)
        self.NOT("R0", b)
        self.OR(y, "R0", "R12")

    def ANDX(self, y, a, b):
        self.NOT("R0", a)
        self.NOT(a, b)
        self.NOR(y, "R0", a)

    def NANDX(self, y, a, b):
        self.NOT("R0", a)
        self.NOT(a, b)
        self.OR(y, "R0", a)

    def IMP(self, y, a, b):
        self.NOT("R0", b)
        self.OR(y, a, "R0")

    def NIMP(self, y, a, b):
        self.NOT("R0", b)
        self.NOR(y, a, "R0")

    def XOR(self, y, a, b):
        self.NOT("R0", b)
        self.NOR(y, a, "R0")
        self.NOT("R0", a)
        self.NOR(a, b, "R0")
        self.OR(y, a)

    def MUX(self, y, a, b, c):
        self.SET("R0")
        self.MOV("R12", c)
        self.MOV("R0", a)
        self.MOV("R12", b)
        self.MOV(y, "R12")

    def CLR_IF(self, y, a):
        self.NOT("R0", y)
        self.NOR(y, "R0", a)

    def DNEWS0(self, y, a, beyond=0):
        parts = [neighbour(self.r[a], way, beyond) * self.r[select]
                 for select, way in (("R1", "south"), ("R2", "west"), ("R3", "north"), ("R4", "east"))]
        self.write(y, sum(parts) != 0)

    def DNEWS1(self, y, a):
        self.DNEWS0(y, a, 1)

    def PROP0(self, beyond=0):
        while True:
            near = sum(neighbour(self.r["R12"], way, beyond) for way in SHIFTS)
            grown = np.where((self.r["R0"] != 0) & (near != 0), 1.0, self.r["R12"])
            if (grown == self.r["R12"]).all():
                return
            self.r["R12"] = grown

    def PROP1(self):
        self.PROP0(1)


class ScampSequences(ProgramTest):
    FORMS = {  # y: a destination, a: another analogue register, x: a source, d: a digital register, w: a direction
        "res": ["y", "yy"], "mov": ["yx"], "neg": ["yx"], "add": ["yxx", "yxxx"], "sub": ["yxx"], "abs": ["ya"], "divq": ["yx"],
        "div": ["yyy", "yyyx"], "diva": ["yyy"], "movx": ["ysw"], "mov2x": ["ysww"], "addx": ["yssw"], "add2x": ["yssww"],
        "subx": ["yswx"], "sub2x": ["yswwx"], "bus": ["y", "yx", "yxx", "yxxx", "yxxxx"], "bus2": ["yyx", "yyxx"],
        "where": ["x", "xx", "xxx"], "all": [""], "WHERE": ["d", "dd", "ddd"], "SET": ["d", "dd"], "CLR": ["d", "dddd"],
        "MOV": ["dd"], "OR": ["dd", "ddd", "dddd", "ddddd"], "NOR": ["dd", "ddd", "dddd", "ddddd"], "NOT": ["d", "dd"],
        "AND": ["ddd"], "NAND": ["ddd"], "ANDX": ["ddd"], "NANDX": ["ddd"], "IMP": ["ddd"], "NIMP": ["ddd"], "XOR": ["ddd"],
        "MUX": ["dddd"], "CLR_IF": ["dd"], "DNEWS0": ["dd"], "DNEWS1": ["dd"], "PROP0": [""], "PROP1": [""]}

    # Registers that an operand must not be, because the sequence overwrites or does not write them, by operand.
    OVERWRITTEN = {"AND": ["R12", "R0", "R0 R12"], "NAND": ["", "R0", "R0 R12"], "ANDX": ["R12", "R0 R12", "R0"],
                   "NANDX": ["R12", "R0 R12", "R0"], "IMP": ["R12", "R0", ""], "NIMP": ["R12", "R0", ""],
                   "XOR": ["R0 R12", "R0 R12", "R0"], "MUX": ["", "R0 R12", "R0 R12", "R0"], "CLR_IF": ["R12", "R0"]}

    def is_refused(self, name, words):
        return (any(word in kept.split() for word, kept in zip(words, self.OVERWRITTEN.get(name, [])))
                or (name == "XOR" and words[0] in words[1:]))

    def instruction(self, random):
        while self.is_refused(*(drawn := self.draw_instruction(random))):
            pass
        return drawn

    def draw_instruction(self, random):
        name = random.choice(list(self.FORMS))
        words, targets = [], []
        for kind in random.choice(self.FORMS[name]):
            if kind == "d":
                words.append(random.choice(DIGITAL))
            elif kind == "w":
                words.append(random.choice(list(SHIFTS)))
            elif kind in "ya":  # the destinations of one instruction differ
                words.append(random.choice([r for r in ANALOGUE[:6] if r not in targets]))
                targets.append(words[-1])
            else:
                words.append(random.choice(ANALOGUE + (list(NEWS_OF) if kind == "x" else [])))
        return str(name), [str(word) for word in words]

    def run_both(self, seed, errors):
        random = np.random.default_rng(seed)
        program = ["!include('scamp5.aps')"]
        registers = {"FLAG": np.ones((SIZE, SIZE))}
        for name in DIGITAL:
            registers[name] = random.integers(0, 2, (SIZE, SIZE)).astype(float)
            np.save(self.folder / f"{name}.npy", registers[name].astype(np.float32))
            program.append(f"{name} = io.array.open('{name}.npy')")
        for name in ANALOGUE[:6]:  # light of the full range gives a register any value
            np.save(self.folder / f"{name}.npy", random.integers(0, 256, (SIZE, SIZE)).astype(np.float32))
            program += [f"PIX = io.array.open('{name}.npy')", f"get_image({name}, NEWS)"]
        if errors:
            program += ["scamp5.errors(on)", f"scamp5.mismatch({seed}, 0.01, 0.5, 0.05)", "scamp5.noise = 0", "scamp5.decay = 0",
                        "scamp5.gain_error = 0.02", "scamp5.offset = 1"]
        start = {name: f"START{name}" for name in ANALOGUE}
        program.append("!register(" + ", ".join(start.values()) + ")")
        program += [f"{kept} = {name}" for name, kept in start.items()]
        steps = [self.instruction(random) for _ in range(120)]
        program += [f"{name}({', '.join(words)})" if words else name for name, words in steps]
        file = self.write("sequence.aps", "\n".join(program) + "\n")
        names = ANALOGUE + DIGITAL + ["FLAG"] + list(start.values()) + [f"scamp5.{name}" for name in ERRORS]
        saves = [word for k, name in enumerate(names) for word in ("--save", f"{name}={self.folder}/out{k}.npy")]
        status, _, err = self.finish(self.start(APRON, "run", file, "--size", f"{SIZE}x{SIZE}", *saves))
        self.assertEqual((status, err), (0, ""), "\n".join(program))
        got = {name: np.load(self.folder / f"out{k}.npy").astype(float) for k, name in enumerate(names)}
        for name, kept in start.items():
            registers[name] = got[kept]
        cells = {name: got[f"scamp5.{name}"] for name in ERRORS}
        chip = Chip(registers, 0.02, 1.0, cells) if errors else Chip(registers)
        for name, words in steps:
            getattr(chip, name)(*words)
        listing = "\n".join(f"{name} {' '.join(words)}" for name, words in steps)
        for name in ANALOGUE + DIGITAL + ["FLAG"]:
            tolerance = 2e-3 if errors and name in ANALOGUE else 1e-9
            np.testing.assert_allclose(got[name], chip.r[name], atol=tolerance, rtol=0, err_msg=f"seed {seed}: {name}\n{listing}")

    def test_sequences_without_errors(self):
        for seed in program_seeds(25):
            self.run_both(seed, False)

    def test_sequences_with_errors(self):
        for seed in program_seeds(25):
            self.run_both(seed, True)

    def test_published_figures(self):
        """An offset of 1 on a value of 10, and the third result of diva on 100 where the split is -0.135."""
        program = self.write("figures.aps", "!include('scamp5.aps')\nscamp5.errors(on)\nscamp5.mismatch(1, 0, 0, 0)\n"
                             "scamp5.gain_error = 0\nscamp5.noise = 0\nscamp5.decay = 0\nscamp5.offset = 1\nscamp5_in(A, 10)\n"
                             "mov(B, A)\nprintln(pixel.get(B, 0, 0))\nscamp5.offset = 0\nscamp5.cell_split = -0.135\n"
                             "scamp5_in(A, 100)\ndiva(A, B, C)\nprintln(pixel.get(C, 0, 0), ' ', pixel.get(B, 0, 0))\n")
        status, out, err = self.finish(self.start(APRON, "run", program, "--size", "4x4"))
        self.assertEqual((status, err), (0, ""))
        moved, third, second = map(float, out.split())
        self.assertEqual(moved, 11)
        self.assertAlmostEqual(third, -50 * 1.135**2, 3)
        self.assertAlmostEqual(second, -50 * (1 - 0.135**2), 3)


if __name__ == "__main__":
    unittest.main()
