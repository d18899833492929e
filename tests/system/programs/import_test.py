"""`apron import` against a compiler: the same text of a kernel is compiled by g++ with scamp5_reference.hpp, and imported and
run. All registers must be equal to the bit. APRON_IMPORT_KERNELS=1000 tries more random kernels than the test does."""
import os
import random
import shutil

import numpy as np

from programs import *

SIZE = 6
NAMES = ["A", "B", "C", "D", "E", "F", "NEWS"] + [f"R{k}" for k in range(13)] + ["FLAG"]
ANALOGUE, DIGITAL, WAYS = "ABCDEF", [f"R{k}" for k in range(5, 13)], ["north", "east", "south", "west"]
TYPES = ["int", "int", "int", "uint8_t", "int8_t", "uint16_t", "unsigned", "bool"]

# Each form that a kernel's text may have, once.
FORMS = {
    "integers": "int main(){ int a = 5, b = 2, c = -7; scamp5_in(A, a / b); scamp5_in(B, c / 2); scamp5_in(C, c % 3);"
                "  scamp5_in(D, a / b * 10 + 7 / 2); scamp5_in(E, (a << 3) >> 1); scamp5_in(F, c >> 1); }",
    "wrap": "int main(){ uint8_t n = 250; n += 10; scamp5_in(A, n); int8_t m = 127; m++; scamp5_in(B, m + 100); unsigned u = 3;"
            " u -= 5; scamp5_in(C, u % 100); scamp5_in(D, u > 100 ? 1 : 2); scamp5_in(E, 300); bool q = 7; scamp5_in(F, q + q); }",
    "bits": "int main(){ int a = 0x5c, b = 0b1010, c = -3; scamp5_in(A, a & b); scamp5_in(B, a | b); scamp5_in(C, (a ^ b) & 127);"
            " scamp5_in(D, ~a); scamp5_in(E, c & 0x3f); scamp5_in(F, 010 + (c | 4)); }",
    "choose": "int n = 3; int main(){ for (int i = 0; i < 6; i++) { n = n > 5 ? n - 4 : n * 2; scamp5_in(A, n); add(B, B, A);"
              " int k = i % 2 == 0 && n > 2 || i == 5; scamp5_in(C, k); add(D, D, C); } }",
    "float": "int main(){ float f = 7; int n = 0.6f * f; scamp5_in(A, n); n = 7.9; scamp5_in(B, n); n = -2.5f * 1.5f;"
             " scamp5_in(C, n); scamp5_in(D, f / 2); float g = 9 / 2; scamp5_in(E, g); scamp5_in(F, (int)(g / 4 * 3)); }",
    "value parameters": "int g = 4; void f(AREG y, int n){ n -= 1; n *= 2; g = 9; scamp5_in(y, n); }"
                        "void h(AREG y, int n){ g = 1; scamp5_in(y, n); }"
                        "int main(){ int n = 10; f(A, n); scamp5_in(B, n); f(C, g); h(D, g); f(E, n + g); scamp5_in(F, g); }",
    "narrow parameters": "void f(AREG y, uint8_t n){ scamp5_in(y, n / 3); } int main(){ f(A, 300); f(B, -1); int k = 260; f(C, k);"
                         " f(D, k * 2.5f); }",
    "references": "void twice(int& n){ n = n * 2; } void both(int& n, int m){ n += m; scamp5_in(B, m); n += m; }"
                  "int main(){ int n = 3; twice(n); scamp5_in(A, n); both(n, n); scamp5_in(C, n); }",
    "aliases": "const areg_t& image = A; areg_t& other = B; \n#define TARGET C\n#define COPY(x, y) mov(x, y)\n"
               "dreg_t& where_it_is = S3; int main(){ auto& again = image; scamp5_in(image, 5); mov(other, image); COPY(TARGET, again);"
               " where(other); MOV(where_it_is, FLAG); all(); MOV(S4, where_it_is); }",
    "macros": "#define N 2 + 3\n#define M (N)\n#define SQUARE(x) x * x\n#define MAXIMUM(a, b) ((a) > (b) ? (a) : (b))\n"
              "#define PUT(y, v) { scamp5_in(y, v * 2); }\n#define JOIN(a, b) a##b\n#define CLEAN(x, y) { mov(x, y); add(x, x, y); }\n"
              "int main(){ scamp5_in(A, N * 2); scamp5_in(B, M * 2); scamp5_in(C, SQUARE(1 + 2)); scamp5_in(D, MAXIMUM(3, N));"
              " PUT(E, 1 + 1); JOIN(mo, v)(F, E); CLEAN(B, C); }",
    "scoped": "enum class Choice { A, B = 5, R5 }; enum struct Other { A = 7 }; int main(){ int k = (int)Choice::B; scamp5_in(A, k);"
              " scamp5_in(B, (int)Other::A); mov(C, A); add(D, B, C); if ((int)Choice::R5 == 6) { MOV(R5, FLAG); } }",
    "conditions": "#define FAST 1\n#if FAST && !defined(SLOW) && (3 > 2)\nint k = 1;\n#else\nint k = 2;\n#endif\n#ifdef SLOW\nint m = 9;\n"
                  "#elif FAST == 2\nint m = 8;\n#else\nint m = 7;\n#endif\n#if 0\nbroken(\n#endif\n"
                  "int main(){ scamp5_in(A, k); scamp5_in(B, m); }",
    "scopes": "int n = 1; void f(){ int n = 5; for (int i = 0; i < 2; i++) n++; scamp5_in(B, n); }"
              "int main(){ int i = 3; for (int i = 0; i < 4; i++) f(); { int i = 8; scamp5_in(C, i); } scamp5_in(A, i + n); }",
    "reserved names": "int main(){ int end = 3, add_ = 2, max = 5, where_ = 1, E_ = 4; { int north = 6; scamp5_in(A, north); }"
                      " int all_ = end + max; scamp5_in(B, all_); for (int step = 0; step < end; step++) { scamp5_in(C, step * max); add(D, D, C); } }",
    "loops": "int main(){ int n = 0, i; for (i = 0; i < 5; i++) n += i; scamp5_in(A, i * 10 + n); for (int k = 10; k > 3; k -= 3) n += k;"
             " int b = 3; for (int k = 0; k < b; k++) { if (k == 1) b = 6; n++; } scamp5_in(B, n); for (int k = 0, m = 9; k < m; k++, m--) n += m;"
             " scamp5_in(C, n); while (n > 3) { n /= 2; if (n == 7) continue; if (n < 5) break; } scamp5_in(D, n);"
             " do { n++; if (n % 3 == 0) continue; n += 2; } while (n < 20); scamp5_in(E, n);"
             " for (uint8_t k = 3; k != 1; k++) { if (k > 200) { n = k; break; } } scamp5_in(F, n - 128);"
             " for (int k = 0; k < 10; k++) { if (k % 2) continue; k++; n = k; } add(F, F, E); scamp5_in(B, n); }",
    "effects": "int g = 2; int next(int n){ g++; return n + g; } int main(){ int n = 4; int m = n++ + 2; scamp5_in(A, m); scamp5_in(B, --n);"
               " m = next(1) * 10; scamp5_in(C, m); if (n > 100 && next(2)) n = 0; if (n < 100 || next(3)) n++; scamp5_in(D, g);"
               " scamp5_in(E, n > 0 ? next(4) : next(5)); while (next(0) < 12) n += 3; scamp5_in(F, n); }",
    "returns": "int sign(int n){ if (n < 0) return -1; if (n > 0) return 1; return 0; } void maybe(AREG y, int n){ scamp5_in(y, 1);"
               " if (n > 3) { return; } for (int i = 0; i < 9; i++) { if (i == n) return; scamp5_in(y, 10 + i); } scamp5_in(y, 99); }"
               "int main(){ scamp5_in(A, sign(-8) * 5 + sign(3)); maybe(B, 5); maybe(C, 2); maybe(D, -1); scamp5_in(E, sign(0)); }",
    "statics": "void count(AREG y){ static int n = 3; n += 2; scamp5_in(y, n); } int main(){ static int k = 7; count(A); count(B); count(C); scamp5_in(D, k); }",
    "directions": "int main(){ scamp5_load_rect(S0, 2, 2, 3, 3); DNEWS(S1, S0, north | east); DNEWS(S2, S0, south|west, 1); DNEWS(S3, S0, alldir, true);"
                  " DNEWS(S4, S0, west); scamp5_in(A, 3); WHERE(S0); scamp5_in(A, 50); ALL(); bus(NEWS, A); bus(B, XN, XS, XE, XW); bus(C, XE, XW); }",
    "enumerators": "enum { FIRST = 3, SECOND, THIRD = SECOND * 2 }; enum class Mode { off, on }; const int K = THIRD + 1; constexpr int L = -K;"
                   "int main(){ scamp5_in(A, SECOND); scamp5_in(B, THIRD); scamp5_in(C, K * 2); scamp5_in(D, L); }",
    "casts": "int main(){ int n = 300; scamp5_in(A, (uint8_t)n); scamp5_in(B, static_cast<int8_t>(200)); scamp5_in(C, int(3.99f)); scamp5_in(D, (int)-3.99f);"
             " unsigned u = 4000000000u; scamp5_in(E, (u * 3u) % 100); scamp5_in(F, (u + 400000000u) % 100); }",
    "read-out": "int main(){ scamp5_load_rect(S0, 1, 1, 3, 4); int n = scamp5_global_count(S0); scamp5_in(A, n); if (scamp5_global_or(S0) && n > 3) scamp5_in(B, n * 2);"
                " if (scamp5_global_or(S0)) n++; uint8_t k = scamp5_global_count(S0); scamp5_in(D, k); auto q = scamp5_global_or(S1); scamp5_in(E, q);"
                " CLR(S0); while (!scamp5_global_or(S0)) { n++; if (n == 15) SET(S0); } scamp5_in(C, n); }",
    "kernels": "void edge(AREG y, ASRC x){ scamp5_kernel_begin(); movx(y, x, east); sub(y, y, x); scamp5_kernel_end(); }"
               "int main(){ vs_init(); scamp5_in(A, 9); scamp5_load_rect(S5, 0, 0, 2, 2); scamp5_kernel_begin(); WHERE(S5); res(A); all(); scamp5_kernel_end();"
               " edge(B, A); edge(C, B); for (int i = 0; i < 3; i++) { scamp5_kernel_begin(); AND(S6, S5, S5); SET(RF); MOV(RP, S6); divq(D, C); add(E, E, D); scamp5_kernel_end(); } }",
}


class Writer:
    """A random kernel: scalars of all types, loops, conditions, functions and instructions."""

    def __init__(self, seed):
        self.random = random.Random(seed)
        self.count = 0
        self.functions = []

    def pick(self, *choices):
        return self.random.choice(choices)

    def value(self, names, depth=0):
        kind = self.random.random()
        if depth > 2 or kind < 0.3:
            return str(self.random.randint(-9, 60)) if not names or self.random.random() < 0.4 else self.random.choice(names)[0]
        a, b = self.value(names, depth + 1), self.value(names, depth + 1)
        if kind < 0.6:
            return f"({a} {self.pick('+', '-', '+', '-')} {b})"
        if kind < 0.66:
            return f"(({a}) % 50 * ({self.random.randint(-5, 5)}))"
        if kind < 0.76:
            return f"({a} {self.pick('/', '%')} {self.pick('3', '7', '-4', '16')})"
        if kind < 0.82:
            return f"(({a} & 31) << {self.random.randint(0, 3)})" if self.random.random() < 0.5 else f"({a} >> {self.random.randint(1, 3)})"
        if kind < 0.88:
            return f"({a} {self.pick('&', '|', '^')} {b})"
        if kind < 0.94:
            return f"({self.condition(names, depth + 1)} ? {a} : {b})"
        return f"({self.pick('-', '~', '!')}({a}))" if self.random.random() < 0.6 else f"({self.pick('uint8_t', 'int8_t', 'unsigned', 'int')})({a})"

    def condition(self, names, depth=0):
        a, b = self.value(names, depth + 1), self.value(names, depth + 1)
        test = f"{a} {self.pick('<', '>', '<=', '>=', '==', '!=')} {b}"
        return f"({test})" if depth > 1 or self.random.random() < 0.6 else f"({test} {self.pick('&&', '||')} {self.condition(names, depth + 1)})"

    def instruction(self, names, registers=ANALOGUE, bits=DIGITAL):
        a, b, c = (self.random.choice(registers) for _ in range(3))
        d, e, f = (self.random.choice(bits) for _ in range(3))
        return self.pick(f"scamp5_in({a}, {self.value(names)});", f"add({a}, {b}, {c});", f"sub({a}, {b}, {c});", f"mov({a}, {b});",
                         f"movx({a}, {b}, {self.pick(*WAYS)});", f"where({a}); MOV({d}, FLAG); all();", f"divq({a}, {b});", f"OR({d}, {e}, {f});",
                         f"NOT({d}, {e});", f"AND({d}, {e}, {f});", f"neg({a}, {b});", f"WHERE({d}); add({a}, {b}, {c}); ALL();",
                         f"scamp5_load_rect({d}, {self.random.randint(0, 3)}, {self.random.randint(0, 3)}, ({self.value(names)}) & 7, 5);",
                         f"DNEWS({d}, {e}, {self.pick(*WAYS)} | {self.pick(*WAYS)});", f"bus({a}, XE, XS);", f"SET({d});")

    def block(self, names, depth, registers=ANALOGUE, bits=DIGITAL):
        names, lines = list(names), []
        for _ in range(self.random.randint(2, 5)):
            kind = self.random.random()
            writable = [name for name, is_counter in names if not is_counter]
            if kind < 0.2:
                self.count += 1
                name = f"v{self.random.randint(0, 3)}_{depth}" if self.random.random() < 0.5 else f"n{self.count}"
                if name not in [known for known, _ in names]:
                    lines.append(f"{self.pick(*TYPES)} {name} = {self.value(names)};")
                    names.append((name, False))
            elif kind < 0.35 and writable:
                target = self.random.choice(writable)
                lines.append(self.pick(f"{target} {self.pick('=', '+=', '-=', '^=')} {self.value(names)};", f"{target} += 1;", f"{target} -= 1;",
                                       f"{target} %= 37;"))
            elif kind < 0.45 and depth < 3:
                lines.append(f"if ({self.condition(names)}) {self.block(names, depth + 1, registers, bits)}"
                             + (f" else {self.block(names, depth + 1, registers, bits)}" if self.random.random() < 0.5 else ""))
            elif kind < 0.55 and depth < 2:
                self.count += 1
                i, n = f"i{self.count}", self.random.randint(1, 4)
                head = self.pick(f"int {i} = 0; {i} < {n}; {i}++", f"int {i} = {n}; {i} > 0; --{i}", f"uint8_t {i} = 1; {i} <= {2 * n}; {i} += 2")
                inner = self.block(names + [(i, True)], depth + 1, registers, bits)
                if self.random.random() < 0.3:
                    inner = inner[:-1] + f" if ({self.condition(names)}) {self.pick('break', 'continue')}; {self.instruction(names, registers, bits)} }}"
                lines.append(f"for ({head}) {inner}")
            elif kind < 0.62 and self.functions:
                function, parameters = self.random.choice(self.functions)
                arguments = [self.random.choice(registers) if p == "a" else self.random.choice(bits) if p == "d" else self.value(names) for p in parameters]
                lines.append(f"{function}({', '.join(arguments)});")
            else:
                lines.append(self.instruction(names, registers, bits))
        return "{ " + " ".join(lines) + " }"

    def kernel(self):
        text = "".join(f"int g{k} = {self.random.randint(-5, 20)};\n" for k in range(2))
        names = [("g0", False), ("g1", False)]
        for k in range(self.random.randint(0, 3)):
            parameters = [self.pick("a", "a", "n", "n", "d") for _ in range(self.random.randint(1, 3))]
            words, inner, registers, bits = [], list(names), list("EF"), DIGITAL[-2:]
            for i, kind in enumerate(parameters):
                words.append({"a": f"AREG y{i}", "d": f"DREG d{i}", "n": f"{self.pick(*TYPES)} p{i}"}[kind])
                if kind == "n":
                    inner.append((f"p{i}", False))
                else:
                    (registers if kind == "a" else bits).append(f"{'y' if kind == 'a' else 'd'}{i}")
            text += f"void f{k}({', '.join(words)}) {self.block(inner, 1, registers, bits)}\n"
            self.functions.append((f"f{k}", parameters))
        return text + f"int main() {{ {self.block(names, 0)} scamp5_in(E, g0); scamp5_in(F, g1); }}\n"


@unittest.skipUnless(shutil.which("g++"), "needs g++")
class Import(ProgramTest):
    def compiled(self, kernels):
        """The registers that each kernel leaves, by the compiler."""
        parts = ['#include "scamp5_reference.hpp"\n#define main kernel_main\n']
        for k, (_, text) in enumerate(kernels):
            (self.folder / f"kernel{k}.cpp").write_text(text)
            parts.append(f'namespace kernel{k} {{\n#include "kernel{k}.cpp"\n}}\n'
                         "#undef N\n#undef M\n#undef SQUARE\n#undef TARGET\n#undef FAST\n#undef PUT\n#undef COPY\n#undef JOIN\n#undef CLEAN\n#undef MAXIMUM\n")
        parts.append("#undef main\nint main() {\n" + "".join(
            f"  model::reset(); kernel{k}::kernel_main(); model::print();\n" for k in range(len(kernels))) + "}\n")
        self.write("all.cpp", "".join(parts))
        status, _, err = self.finish(self.start("g++", "-std=c++20", "-O0", "-w", "-fwrapv", "-I", str(ROOT / "tests/system/programs"), "-o",
                                                str(self.folder / "all"), str(self.folder / "all.cpp")))
        self.assertEqual(status, 0, err)
        status, out, err = self.finish(self.start(str(self.folder / "all")))
        self.assertEqual(status, 0, err)
        return [np.array(line.split(), dtype=float).reshape(len(NAMES), SIZE, SIZE) for line in out.splitlines()]

    def imported(self, index, label, text):
        program = self.folder / f"kernel{index}.aps"
        status, _, err = self.finish(self.start(APRON, "import", str(self.folder / f"kernel{index}.cpp"), "--output", str(program)))
        self.assertEqual(status, 0, f"{label}: {err}\n{text}")
        saves = [word for name in NAMES for word in ("--save", f"{name}={self.folder}/{name}.npy")]
        status, _, err = self.finish(self.start(APRON, "run", str(program), "--size", f"{SIZE}x{SIZE}", *saves))
        self.assertEqual((status, err), (0, ""), f"{label}\n{text}\n{program.read_text()}")
        return np.array([np.load(self.folder / f"{name}.npy") for name in NAMES]), program.read_text()

    def compare(self, kernels):
        for k, ((label, text), wanted) in enumerate(zip(kernels, self.compiled(kernels))):
            got, program = self.imported(k, label, text)
            for name, a, b in zip(NAMES, got, wanted):
                np.testing.assert_array_equal(a, b, f"{label}: {name}\n{text}\n{program}")

    def test_forms(self):
        self.compare(list(FORMS.items()))

    def test_random_kernels(self):
        count = int(os.environ.get("APRON_IMPORT_KERNELS", "30"))
        for first in range(0, count, 50):
            self.compare([(f"seed {seed}", Writer(seed).kernel()) for seed in range(first, min(first + 50, count))])

    def check_status(self, text, wanted, message, files=()):
        for name, content in files:
            self.write(name, content)
        kernel, program = self.write("one.cpp", text), self.folder / "one.aps"
        program.unlink(missing_ok=True)
        status, _, err = self.finish(self.start(APRON, "import", kernel, "--output", str(program)))
        self.assertEqual(status, wanted, f"{err}\n{text}")
        self.assertIn(message, err)
        self.assertEqual(program.exists(), wanted != 2)

    def test_what_cannot_be_resolved_is_an_error(self):
        main = "int main(){ scamp5_in(A, 1); %s }"
        self.check_status(main % "DREG_load_centered_rect(S0, 1, 2, 3, 4);", 2, "one.cpp:1: error: 'DREG_load_centered_rect'")
        self.check_status(main % "switch (k) { case 1: res(A); }", 2, "error: 'switch' has no counterpart")
        self.check_status(main % "objects[2].draw(S1);", 2, "error: ")
        self.check_status("void f(AREG y){ res(y); } " + main % "f(regs[1]);", 2, "error: ")
        self.check_status("void f(AREG y){ res(y); } void f(DREG y){ CLR(y); } " + main % "f(A);", 2, "another function 'f'")
        self.check_status("void add(AREG y, AREG a, AREG b){ add(y, a, b); } " + main % "add(C, A, B);", 2, "'add' calls itself: rename it")
        self.check_status("class Pen { void draw(){ res(B); } }; " + main % "", 2, "the class 'Pen' is left out")
        self.check_status("void show(DREG y, vs_handle display){ SET(y); scamp5_output_image(y, display); } int main(){ auto d = vs_gui_add_display(\"a\");"
                          " show(S0, d); vs_on_gui_update(3, [&](int32_t v){ res(A); }); }", 0, "left out: 'vs_gui_add_display'")
        self.check_status(main % "vs_post_text(\"x\"); scamp5_output_events(S0);", 0, "left out")
        self.check_status("int main(){ scamp5_in(A, 1); add(B, A, A); }", 0, "warning: the chip connects 'A' once in 'add'")

    def test_local_includes_are_followed(self):
        rect = ("#pragma once\n#include \"deep/limits.hpp\"\ninline void DREG_load_centered_rect(DREG y, int x, int r, int w){\n"
                "  scamp5_load_rect(y, r - w / 2, x - w / 2, r + w / 2, LAST); }\n")
        text = '#include <scamp5.hpp>\n#include "rect.hpp"\n#include "rect.hpp"\nint main(){ DREG_load_centered_rect(S0, 2, 3, 3); }'
        files = [("rect.hpp", rect), ("deep/limits.hpp", "#define LAST 4\n#include \"more.hpp\"\n"), ("deep/more.hpp", "int more = 1;\n")]
        (self.folder / "deep").mkdir()
        self.check_status(text, 0, "", files)
        status, out, err = self.finish(self.start(APRON, "run", str(self.folder / "one.aps"), "--size", "6x6", "--save",
                                                  f"R5={self.folder}/rect.npy"))
        self.assertEqual((status, err), (0, ""))
        wanted = np.zeros((6, 6))
        wanted[2:5, 1:5] = 1
        np.testing.assert_array_equal(np.load(self.folder / "rect.npy"), wanted)
        self.check_status('#include "gone.hpp"\nint main(){ scamp5_in(A, 1); helper(S0); }', 2, "'gone.hpp' is not there")
        self.check_status(text, 2, "rect.hpp:3: error: 'gone' runs", [("rect.hpp", "inline void DREG_load_centered_rect(DREG y, int x, int r, int w){\n SET(y);\n gone(y); }\n")])


if __name__ == "__main__":
    unittest.main()
