"""`apron import` against a compiler: the same text of a kernel is compiled by g++ with scamp5_reference.hpp, and imported and
run. All registers must be equal to the bit. APRON_PROGRAM_SEEDS=1000 tries more random kernels than the test does."""
import os
import random
import re
import shutil

import numpy as np

from programs import *

SIZE = 6
NAMES = ["A", "B", "C", "D", "E", "F", "NEWS"] + [f"R{k}" for k in range(13)] + ["FLAG"]
# AND overwrites R0 and R12.
ANALOGUE, DIGITAL, WAYS = "ABCDEF", [f"R{k}" for k in range(4, 12)], ["north", "east", "south", "west"]
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
                         " f(D, k * .5f); }",
    "references": "void twice(int& n){ n = n * 2; } void both(int& n, int m){ n += m; scamp5_in(B, m); n += m; }"
                  "int main(){ int n = 3; twice(n); scamp5_in(A, n); both(n, n); scamp5_in(C, n); }",
    "names of variables": "int g = 3; void f(AREG y, int n){ int& m = n; m += 2; int& k = g; k--; scamp5_in(y, n); }"
                          "int main(){ int n = 1, &r = n; r = 300; uint8_t b = n; scamp5_in(A, b); f(B, n); const int& w = g; g += 4;"
                          " scamp5_in(C, w); for (int i = 0; i < 6; i++) { int& j = i; j++; add(D, D, A); scamp5_in(A, 1); } auto& q = b; q += 250;"
                          " scamp5_in(E, b); const uint8_t& old = n; n = 7; scamp5_in(F, old); }",
    "aliases": "const areg_t& image = A; areg_t& other = B; \n#define TARGET C\n#define COPY(x, y) mov(x, y)\n"
               "dreg_t& where_it_is = S3; int main(){ auto& again = image; scamp5_in(image, 5); mov(other, image); COPY(TARGET, again);"
               " where(other); MOV(where_it_is, FLAG); all(); MOV(S4, where_it_is); }",
    "macros": "#define N 2 + 3\n#define M (N)\n#define SQUARE(x) x * x\n#define MAXIMUM(a, b) ((a) > (b) ? (a) : (b))\n"
              "#define PUT(y, v) { scamp5_in(y, v * 2); }\n#define JOIN(a, b) a##b\n#define CLEAN(x, y) { mov(x, y); add(x, x, y); }\n"
              "int main(){ scamp5_in(A, N * 2); scamp5_in(B, M * 2); scamp5_in(C, SQUARE(1 + 2)); scamp5_in(D, MAXIMUM(3, N));"
              " PUT(E, 1 + 1); JOIN(mo, v)(F, E); CLEAN(B, C); }",
    "scoped": "enum class Choice { A, B = 5, R5 }; enum struct Other { A = 7 }; int main(){ int k = (int)Choice::B; scamp5_in(A, k);"
              " scamp5_in(B, (int)Other::A); mov(C, A); add(D, B, C); if ((int)Choice::R5 == 6) { MOV(R5, FLAG); } }",
    "continued lines": "#define PUT(y, v) scamp5_in(y, v); // the comment goes on \\\n add(E, E, E);\n#define BOTH(v) scamp5_in(B, v); \\\n scamp5_in(C, v);\n"
                       "int main(){ PUT(A, 3) BOTH(4) // as does this \\\n scamp5_in(A, 9);\n scamp5_in(D, 5); }",
    "names that are joined": "#define N 5\n#define CAT(a, b) a##b\n#define JOINED(a, b) CAT(a, b)\n#define TWICE(a, b) JOINED(a, b)\nint v5 = 9, vN = 4;\n"
                             "int main(){ scamp5_in(A, JOINED(v, N)); scamp5_in(B, CAT(v, N)); scamp5_in(C, TWICE(v, N)); scamp5_in(D, N); SET(JOINED(R, N)); }",
    "endless loops": "int upto(int n){ while (1) { n += 4; if (n > 20) return n; } } int main(){ scamp5_in(A, upto(3)); int n = 0; for (;;) { n++; if (n == 7) break; add(B, B, A); }"
                     " scamp5_in(C, n); while (true) { for (int k = 0; k < 5; k++) { n++; if (k == 2) break; } if (n > 15) { break; } } scamp5_in(D, n); }",
    "conditions": "#define FAST 1\n#if +FAST && !defined(SLOW) && (3 > 2)\nint k = 1;\n#else\nint k = 2;\n#endif\n#ifdef SLOW\nint m = 9;\n"
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
    "deduced results": "auto half(float f){ return f / 2; } auto low(int n){ return (uint8_t)(n * 100); } auto wide(int n) -> unsigned { return n - 5; }"
                       " auto sign(int n){ if (n < 0) return -1; return n > 0 ? 1 : 0; } auto put(AREG y, int n) -> int { scamp5_in(y, n); return n + 1; }"
                       " auto is_large(int n){ return n > 9; } auto nothing(AREG y){ scamp5_in(y, 3); }"
                       "int main(){ scamp5_in(A, half(5) * 2); scamp5_in(B, low(3) + 200); scamp5_in(C, wide(3) % 100); scamp5_in(D, sign(-4) + put(E, 7));"
                       " nothing(F); bool q = is_large(12) + 3; add(F, F, E); scamp5_in(B, q + is_large(3)); uint8_t b = 200; auto c = b; c += 100;"
                       " scamp5_in(C, c); auto d = b + 100; scamp5_in(D, d - 250); }",
    "narrow operands": "int main(){ int n = 256; scamp5_select_pattern(n + 1, 2, 0, n); MOV(S0, SELECT); scamp5_select_point(n + 2, n + 3); MOV(S1, SELECT);"
                       " scamp5_draw_begin(S2); scamp5_draw_rect(n, n + 1, n + 2, n + 3); scamp5_draw_point(n + 1, 1); scamp5_draw_end();"
                       " scamp5_in(A, 9); scamp5_in(B, scamp5_read_areg(A, n + 1, 2) - 100); scamp5_in(C, scamp5_global_sum_sparse(A, n, 0, n + 254, 254) - 130);"
                       " scamp5_in(D, scamp5_global_or(S1, n + 2, 3, 0, n)); }",
    "switch": "enum class Mode { Idle, Run = 4, Stop }; int steps(int n){ switch (n) { case 0: return 5; case 1: n += 10; case 2: case 3: n++; break;"
              " default: n = 50; } return n; } int kind(Mode m){ int k = 0; switch (m) { default: k = 1; break; case Mode::Run: k = 2; case Mode::Stop: k += 3; } return k; }"
              "int main(){ scamp5_in(A, steps(0) + steps(1)); scamp5_in(B, steps(3) + steps(7)); scamp5_in(C, kind(Mode::Idle) * 10 + kind(Mode::Run));"
              " scamp5_in(D, kind(Mode::Stop)); int n = 0; for (int i = 0; i < 9; i++) { switch (i % 4) { case 1: continue; case 2: if (i > 5) break; n += 2; break;"
              " case 3: for (int k = 0; k < 5; k++) { if (k == 2) break; n += 3; } } n++; } scamp5_in(E, n);"
              " while (1) { switch (n) { case 7: n = 100; break; default: n--; } if (n == 100) break; } scamp5_in(F, n); uint8_t small = 255; switch (++small) { case 0: neg(F, F); } }",
    "statics": "void count(AREG y){ static int n = 3; n += 2; scamp5_in(y, n); } int main(){ static int k = 7; count(A); count(B); count(C); scamp5_in(D, k); }",
    "directions": "int main(){ scamp5_load_rect(S0, 2, 2, 3, 3); DNEWS(S1, S0, north | east); DNEWS(S2, S0, south|west, 1); DNEWS(S3, S0, alldir, true);"
                  " DNEWS(S4, S0, west); scamp5_in(A, 3); WHERE(S0); scamp5_in(A, 50); ALL(); bus(NEWS, A); bus(B, XN, XS, XE, XW); bus(C, XE, XW); }",
    "operands of macros": "#define PUT(y, v) scamp5_in(y, v);\nint main(){ float f = 2.5f; int n = 300; PUT(A, 300) PUT(B, f) PUT(C, 2.5f) PUT(D, n) }",
    "types of auto": "int main(){ uint8_t b = 200; auto c = b; c += 100; scamp5_in(A, c / 3); int n = 3; auto m = n++; scamp5_in(B, n * 10 + m);"
                     " unsigned u = 3; scamp5_in(C, u + std::max(-2.5f, -0.5f) * 4); bool q = true; auto p = +q; p = 5; scamp5_in(D, p); }",
    "comments in directives": "#define N 3 /* goes on\n res(B); */\n#define H(x) 0x##x\nint main(){ scamp5_in(A, N + \\\n 4); scamp5_in(B, H(1F)); }",
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
    """A random kernel: scalars of all types, loops, conditions, functions, macros, names of registers and instructions, in one file
    and its headers. The order in which C++ evaluates operands shows nowhere: what an expression calls changes nothing else."""

    def __init__(self, seed):
        self.random = random.Random(seed)
        self.seed = seed
        self.count = 0
        self.functions = []   # name and parameters: a analogue, d digital, n number, r int&
        self.computing = []   # name and number of parameters of functions that return an int
        self.macros = []      # the same of macros
        self.constants = []

    def pick(self, *choices):
        return self.random.choice(choices)

    @staticmethod
    def typed(name, kind):
        """The name, whose end tells a type other than int."""
        return name if kind == "int" else name + kind[0] + kind[-3]

    @staticmethod
    def integers(names):
        return [name for name in names if re.fullmatch(r"v\d_\d|[ngrq]\d+|p\d", name)]

    def value(self, names, depth=0):
        kind = self.random.random()
        if depth > 2 or kind < 0.3:
            if self.constants and self.random.random() < 0.2:
                return self.pick(*self.constants)
            number = self.random.randint(-9, 60)
            return self.pick(str(number), str(number), hex(number), f"0{abs(number):o}") if not names or self.random.random() < 0.4 \
                else self.random.choice(names)[0]
        a, b = self.value(names, depth + 1), self.value(names, depth + 1)
        if kind < 0.6:
            return f"({a} {self.pick('+', '-', '+', '-')} {b})"
        if kind < 0.63:
            return f"(({a}) % 50 * ({self.random.randint(-5, 5)}))"
        if kind < 0.66:
            return f"({a} * {b})"
        if kind < 0.76:
            return f"({a} {self.pick('/', '%')} {self.pick('3', '7', '-4', '16')})"
        if kind < 0.82:
            return f"(({a} & 31) << {self.random.randint(0, 3)})" if self.random.random() < 0.5 else f"({a} >> {self.random.randint(1, 3)})"
        if kind < 0.88:
            return f"({a} {self.pick('&', '|', '^')} {b})"
        if kind < 0.92:
            return f"({self.condition(names, depth + 1)} ? {a} : {b})"
        if kind < 0.95 and self.computing + self.macros:
            name, count = self.random.choice(self.computing + self.macros)
            return f"({name}({', '.join(self.value(names, depth + 1) for _ in range(count))}))"
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
                kind = self.pick(*TYPES)
                name = self.typed(f"v{self.random.randint(0, 3)}_{depth}" if self.random.random() < 0.5 else f"n{self.count}", kind)
                if name not in [known for known, _ in names]:
                    first = self.value(names)
                    if writable and self.random.random() < 0.2:
                        other = self.random.choice(writable)
                        first = self.pick(f"{other}++", f"--{other}", f"{other} += 3") if not other.endswith("bo") else f"{other} = 1"
                    lines.append(f"{kind} {name} = {first};")
                    names.append((name, False))
            elif kind < 0.23 and self.integers(writable):
                self.count += 1
                lines.append(f"{self.pick('int&', 'auto&', 'const int&')} r{self.count} = {self.random.choice(self.integers(writable))};")
                names.append((f"r{self.count}", "const" in lines[-1]))
            elif kind < 0.35 and writable:
                target = self.random.choice(writable)
                lines.append(self.pick(f"{target} {self.pick('=', '+=', '-=', '^=', '*=', '|=', '&=')} {self.value(names)};",
                                       f"{target} {self.pick('/= 3', '%= 37', '>>= 1', '<<= 2', '/= -7')};",
                                       f"{target} += 1;" if target.endswith("bo") else f"{target}{self.pick('++', '--')};"))
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
            elif kind < 0.59 and depth < 2:
                self.count += 1
                i, n = f"w{self.count}", self.random.randint(1, 4)
                inner = self.block(names + [(i, True)], depth + 1, registers, bits)
                lines.append(f"{{ int {i} = {n}; " + (f"while ({i} > 0) {inner[:-1]} {i}--; }} }}" if self.random.random() < 0.5
                                                      else f"do {inner} while (--{i} > 0); }}"))
            elif kind < 0.66 and self.functions:
                function, parameters = self.random.choice(self.functions)
                integers = self.integers(writable)
                arguments = [self.random.choice(registers) if p == "a" else self.random.choice(bits) if p == "d"
                             else self.value(names) if p == "n" or not integers else self.random.choice(integers) for p in parameters]
                if "r" not in parameters or integers:
                    lines.append(f"{function}({', '.join(arguments)});")
            else:
                lines.append(self.instruction(names, registers, bits))
        return "{ " + " ".join(lines) + " }"

    def function(self, name, names):
        """One with instructions."""
        parameters = [self.pick("a", "a", "n", "n", "d", "r") for _ in range(self.random.randint(1, 3))]
        words, inner, registers, bits = [], list(names), list("EF"), DIGITAL[-2:]
        for i, kind in enumerate(parameters):
            scalar = self.pick(*TYPES)
            words.append({"a": f"AREG y{i}", "d": f"DREG d{i}", "n": f"{scalar} {self.typed(f'p{i}', scalar)}", "r": f"int& q{i}"}[kind])
            if kind in "nr":
                inner.append((self.typed(f"p{i}", scalar) if kind == "n" else f"q{i}", False))
            else:
                (registers if kind == "a" else bits).append(f"{'y' if kind == 'a' else 'd'}{i}")
        start = ""
        if self.random.random() < 0.3:
            start = f" static int s = {self.random.randint(-3, 9)}; s += {self.random.randint(1, 5)};"
            inner.append(("s", False))
        if self.random.random() < 0.3:
            start += f" {self.instruction(inner, registers, bits)} if ({self.condition(inner)}) return;"
        text = f"void {name}({', '.join(words)}) {{{start} {self.block(inner, 1, registers, bits)[1:]}\n"
        self.functions.append((name, parameters))
        return text

    def computed(self, name):
        """One that returns a number and changes nothing but its own parameters."""
        count = self.random.randint(1, 3)
        names = [(f"p{i}", False) for i in range(count)]
        words = ", ".join(f"{self.pick(*TYPES, 'const int&')} p{i}" for i in range(count))
        result = self.pick("int", "int", "uint8_t", "unsigned", "bool", "auto", "auto")
        trailing = self.pick("", "", " -> uint8_t", " -> int") if result == "auto" else ""
        text = f"{result} {name}({words}){trailing} {{ int k = {self.value(names)};"
        if (result != "auto" or trailing) and self.random.random() < 0.5:  # the returns of auto are of one type
            text += f" if ({self.condition(names)}) return {self.value(names)};"
        if self.random.random() < 0.5:
            text += f" for (int i = 0; i < {self.random.randint(1, 5)}; i++) {{ k {self.pick('+=', '-=', '^=')} {self.value(names)}; if (k > 900) break; }}"
        self.computing.append((name, count))
        return text + f" return {self.pick('k', 'k % 50', 'k + p0', 'p0')}; }}\n"

    def kernel(self):
        """The text of the kernel and its headers by name."""
        seed, names, analogue, digital = self.seed, [("g0", False), ("g1", False)], list(ANALOGUE), list(DIGITAL)
        text = "".join(f"int g{k} = {self.random.randint(-5, 20)};\n" for k in range(2))
        parts = [f"enum {{ FIRST{seed} = {self.random.randint(-3, 9)}, SECOND{seed}, THIRD{seed} = SECOND{seed} * 2 }};\n"
                 f"{self.pick('const int', 'constexpr int', 'static const uint8_t')} LIMIT{seed} = THIRD{seed} * 7 - 90;\n"]
        self.constants = [f"SECOND{seed}", f"THIRD{seed}", f"LIMIT{seed}"]
        parts.append(f"#define SUM{seed} 3 + {self.random.randint(1, 9)}\n#define SQUARE{seed}(x) ((x) * (x))\n#define LESS{seed}(x, y) x - y\n"
                     f"#define MOST{seed}(x, y) ((x) > (y) ? (x) : (y))\n#define TARGET{seed} {self.pick(*ANALOGUE)}\n")
        self.constants.append(f"SUM{seed}")
        self.macros = [(f"SQUARE{seed}", 1), (f"LESS{seed}", 2), (f"MOST{seed}", 2)]
        parts.append(f"{self.pick('const areg_t&', 'areg_t&')} image = {self.pick(*ANALOGUE)};\ndreg_t& spot = {self.pick(*DIGITAL)};\n")
        for k in range(self.random.randint(0, 2)):
            parts.append(self.computed(f"c{k}"))
        for k in range(self.random.randint(0, 3)):
            parts.append(self.function(f"f{k}", names))
        analogue += [f"TARGET{seed}", "image"]
        digital.append("spot")
        cut = sorted(self.random.randint(0, len(parts)) for _ in range(2))
        inner, outer, rest = parts[:cut[0]], parts[cut[0]:cut[1]], parts[cut[1]:]
        files = {f"sub/inner{seed}.hpp": "#pragma once\n" + "".join(inner),
                 f"outer{seed}.hpp": f"#ifndef OUTER{seed}\n#define OUTER{seed}\n#include \"sub/inner{seed}.hpp\"\n" + "".join(outer) + "#endif\n"}
        text += f"#include \"outer{seed}.hpp\"\n" * self.random.randint(1, 2) + "".join(rest)
        here = self.pick("auto& here = image; ", "")
        if here:
            analogue.append("here")
        return text + f"int main() {{ {here}{self.block(names, 0, analogue, digital)} scamp5_in(E, g0); scamp5_in(F, g1); }}\n", files


class ArithmeticWriter:
    """A random kernel that computes: literals of all forms, constants, scalars of all types and their conversions. A number that a
    statement gives is in a cell of its own, 24 bits of it in A, B and C. Fractions stay below 2^24, divisors are not 0."""

    KINDS = {"int": "i", "short": "i", "unsigned": "i", "uint8_t": "i", "int8_t": "i", "uint16_t": "i", "int16_t": "i", "unsigned char": "i", "char": "i",
             "bool": "i", "float": "f", "double": "f"}
    PUT = ("void put(int k, int v) { scamp5_load_point(R5, k / 6, k % 6); WHERE(R5); scamp5_in(A, v); scamp5_in(B, v >> 8); scamp5_in(C, v >> 16); ALL(); }\n"
           "void put(int k, float v, int scale) { put(k, v < 9000 && v > -9000 ? (int)(v * scale) : 0); }\n")

    def __init__(self, seed):
        self.random = random.Random(f"arithmetic {seed}")
        self.seed, self.count, self.shown = seed, 0, 0
        self.functions = []  # name, kind of the result, kinds of the parameters

    def pick(self, *choices):
        return self.random.choice(choices)

    def new(self, stem):
        self.count += 1
        return f"{stem}{self.seed}_{self.count}"

    def whole(self):
        number = self.pick(0, 1, 2, 3, 7, 10, 31, self.random.randint(0, 300))
        text = self.pick(f"{number}", f"{number}", f"{number:#x}", f"0X{number:X}", f"0{number:o}", f"{number:#b}", f"0B{number:b}", f"{number + 1000:_}".replace("_", "'"))
        return self.pick(text, text, text, text + self.pick("u", "U"), self.pick("'a'", "'Z'", "'0'", "'\\n'", "'\\0'", "'\\''", "'\"'"))

    def fraction(self):
        n = self.random.randint(0, 40)
        return self.pick(f"{n}.f", f"{n}.", f".{n}", f".{n}f", f"{n}.25", f"{n}.7F", f"{n}e-1", f"{n}E-1f", f"{n % 9}.5e+1f", f"{n}e-3", f"{n % 9}e1f", f"{n % 9}E+1",
                         f"0x{n:x}p-2", f"0X{n:X}P1f", f"0x1.8p+{n % 4}", f"0{n}.5", f"1'0{n}.75f")

    def literal(self, kind):
        sign = self.pick("", "", "", "-", "-", "+", "- ")
        return sign + (self.whole() if kind == "i" else self.fraction())

    def value(self, names, kind, depth=0):
        """An expression whose type is an integer (i) or float (f)."""
        known = [name for name, of, _ in names if of == kind]
        draw = self.random.random()
        if depth > 2 or draw < 0.2:
            if known and self.random.random() < 0.65:
                return self.random.choice(known)
            return self.literal(kind)
        one = lambda of=kind: self.value(names, of, depth + 1)
        if draw < 0.26:
            return f"{self.pick('-', '-', '+', '-', '~' if kind == 'i' else '-')}({one()})"
        if draw < 0.30 and known:
            return f"{self.pick('-', '- -', '+')}{self.random.choice(known)}"
        if draw < 0.36:
            return f"({self.condition(names, depth + 1)} ? {one()} : {one(self.pick('i', 'f') if kind == 'f' else kind)})"
        if draw < 0.41 and (calls := [f for f in self.functions if f[1] == kind]):
            name, _, kinds = self.random.choice(calls)
            return f"{name}({', '.join(one(of) for of in kinds)})"
        if draw < 0.44:
            return f"std::{self.pick('min', 'max')}({self.pick('(float)', 'float') if kind == 'f' else self.pick('(int)', 'int')}({one()}), " \
                   f"{'(float)' if kind == 'f' else '(int)'}({one()}))"
        if kind == "f":
            if draw < 0.62:
                return f"({one()} {self.pick('+', '-')} {one()})"
            if draw < 0.7:
                return f"({one()} * {self.pick('0.7f', '-1.75', '-.1f', '3', '0x1p-2', '-25e-1')})"
            if draw < 0.8:
                return f"({one()} / {self.pick('3', '-4', '-2.5f', '.75', '1e1f', '0x1p+2', '(7 / 2)')})"
            if draw < 0.9:
                return f"({one('i')} % {self.pick('100', '-7')} {self.pick('*', '+', '-', '/')} {self.pick('2.f', '-0.5f', '1.5e+1f', '.3f')})"
            return f"{self.pick('(float)', 'float', 'static_cast<float>')}({one('i')} % {self.pick('50', '-9')})"
        if draw < 0.58:
            return f"({one()} {self.pick('+', '-')} {one()})"
        if draw < 0.64:
            return f"({one()} % 99 * {self.whole()})"
        if draw < 0.72:
            return f"({one()} {self.pick('/', '%')} {self.pick('3', '-4', '7u', '0x10', '-1', '011')})"
        if draw < 0.77:
            return f"({one()} >> {self.random.randint(0, 4)})" if self.random.random() < 0.5 else f"(({one()} & 0xff) << {self.random.randint(0, 6)})"
        if draw < 0.83:
            return f"({one()} {self.pick('&', '|', '^')} {one()})"
        if draw < 0.88:
            return self.condition(names, depth + 1)
        if draw < 0.94:
            return f"(int)({one('f')})" if self.random.random() < 0.7 else f"static_cast<int>({one('f')})"
        return f"({self.pick('uint8_t', 'int8_t', 'uint16_t', 'int16_t', 'unsigned', 'int', 'bool', 'short', 'unsigned char')})({one()})"

    def condition(self, names, depth=0):
        if self.random.random() < 0.2:
            return f"!({self.value(names, self.pick('i', 'f'), depth + 1)})"
        left = self.value(names, self.pick('i', 'f'), depth + 1)
        if self.random.random() < 0.1:
            return f"({left} {self.pick('&&', '||')} {self.condition(names, depth + 1)})"
        return f"({left} {self.pick('<', '>', '<=', '>=', '==', '!=')} {self.value(names, self.pick('i', 'f'), depth + 1)})"

    def show(self, name, kind):
        if self.shown == 36:
            return ""
        self.shown += 1
        return f" put({self.shown - 1}, {name});" if kind == "i" else f" put({self.shown - 1}, {name}, {self.pick(1, 64, 1000)});"

    def within(self, name, kind):
        """Keeps the number small."""
        return f" if ({name} > 2000 || {name} < -2000) {name} = {self.literal('f')};" if kind == "f" else ""

    def declaration(self, names, is_global=False):
        word = self.pick(*self.KINDS, "int", "float", "auto")
        name = self.new("v" if word == "int" else "n")
        kind = self.KINDS.get(word) or self.pick("i", "f")
        constant = self.random.random() < 0.3
        first = self.literal(kind) if self.random.random() < 0.3 else self.value([] if is_global else names, self.pick(kind, kind, "i") if word != "auto" else kind)
        if word in ("int", "short", "int16_t") and self.random.random() < 0.25:
            first = f"{self.fraction()} * {self.pick('3', '1.5f', '-1')}"
        form = f"{name} = {first}" if word == "auto" or self.random.random() < 0.7 else f"{name}({first})"
        words = [("const " if constant else "") + f"{word} {form};"]
        names.append((name, kind, not constant))
        if kind == "f" and not constant and not is_global:
            words.append(self.within(name, kind))
        return "".join(words)

    def change(self, names):
        """An assignment to a variable."""
        writable = [(name, kind) for name, kind, is_writable in names if is_writable]
        if not writable:
            return self.declaration(names)
        name, kind = self.random.choice(writable)
        if kind == "f":
            text = self.pick(f"{name} {self.pick('=', '+=', '-=')} {self.value(names, self.pick('f', 'f', 'i'))};" if self.random.random() < 0.7 else f"{name} = {self.literal('f')};",
                             f"{name} {self.pick('*=', '/=')} {self.pick('-1.5f', '.5', '3', '-2e-1f')};", f"{self.pick('++', '--')}{name};", f"{name}{self.pick('++', '--')};")
        else:
            text = self.pick(f"{name} {self.pick('=', '+=', '-=', '^=', '|=', '&=')} {self.value(names, 'i')};", f"{name} {self.pick('%=', '/=')} {self.pick('17', '-3', '5u')};",
                             f"{name} {self.pick('=', '=', '+=')} {'' if name.startswith('v') else '(int)'}({self.value(names, 'f')});", f"{name} *= {self.pick('2', '-1', '3u', '1.5f', '-.5f')};",
                             f"{name} {self.pick('<<=', '>>=')} {self.random.randint(0, 3)};", f"{name} += 1;")
        return text + self.within(name, kind)

    def statement(self, names, depth):
        draw = self.random.random()
        if draw < 0.3:
            text = self.declaration(names)
            return text + self.show(names[-1][0], names[-1][1])
        if draw < 0.65:
            text = self.change(names)
            name, kind, _ = self.random.choice(names)
            return text + self.show(name, kind)
        if draw < 0.8 or depth > 1:
            kind = self.pick("i", "f")
            return self.show(self.value(names, kind), kind)
        if draw < 0.88:
            return f"if ({self.condition(names)}) {self.block(names, depth + 1)}" + (f" else {self.block(names, depth + 1)}" if self.random.random() < 0.5 else "")
        name, n = self.new("k"), self.random.randint(1, 4)
        head, kind = self.pick((f"int {name} = 0; {name} < {n}; {name}++", "i"), (f"int {name} = {n}; {name} >= -{n}; {name} -= 2", "i"), (f"uint8_t {name} = 254; {name} != {n}; ++{name}", "i"),
                               (f"float {name} = -{n}.5f; {name} < {n}; {name} += 1.25f", "f"), (f"float {name} = {n}; {name} > -.5; {name} -= 5e-1f", "f"),
                               (f"unsigned {name} = {n}; {name} > 0; {name}--", "i"), (f"int {name} = 0; {name} < {n} * 0.75f; {name} += 1", "i"))
        return f"for ({head}) {self.block(names + [(name, kind, False)], depth + 1)}"

    def block(self, names, depth):
        inner = list(names)
        return "{ " + " ".join(self.statement(inner, depth) for _ in range(self.random.randint(1, 3))) + " }"

    def function(self):
        name, word = self.new("f"), self.pick("int", "float", "uint8_t", "double", "bool", "unsigned")
        kind = self.KINDS[word]
        kinds = [self.pick("i", "f") for _ in range(self.random.randint(1, 2))]
        types = [self.pick("float", "double", "const float&") if of == "f" else self.pick("int", "uint8_t", "int16_t", "bool", "unsigned") for of in kinds]
        names = [(f"p{k}", of, False) for k, of in enumerate(kinds)]
        parameters = ", ".join(f"{one} p{k}" for k, one in enumerate(types))
        early = f" if ({self.condition(names, 1)}) return {self.value(names, kind, 2)};" if self.random.random() < 0.4 else ""
        result = f"({self.value(names, kind, 1)})"
        self.functions.append((name, kind, kinds))
        return f"{word} {name}({parameters}) {{{early} return {result}{' / 4' if kind == 'f' else ''}; }}\n"

    def kernel(self):
        names, text = [], self.PUT
        for _ in range(3):
            name, kind = self.new("D"), self.pick("i", "f", "f")
            text += f"#define {name} {self.pick(self.literal(kind), self.literal(kind), f'({self.value([], kind, 1)})')}\n"
            names.append((name, kind, False))
        for _ in range(3):
            text += self.declaration(names, True) + "\n"
        text += "".join(self.function() for _ in range(2))
        text += "int main() {\n"
        for _ in range(14):
            text += f"  {self.statement(names, 0)}\n"
        return text + "}\n", {}


@unittest.skipUnless(shutil.which("g++"), "needs g++")
class Import(ProgramTest):
    def compiled(self, kernels):
        """The registers that each kernel leaves, by the compiler, and None where a signed integer overflows, which C++ leaves undefined."""
        parts = ['#include "scamp5_reference.hpp"\n#define main kernel_main\n#define double float\n']
        (self.folder / "sub").mkdir(exist_ok=True)
        for k, (_, text, files) in enumerate(kernels):
            for name, content in {**files, f"kernel{k}.cpp": text}.items():
                self.write(name, content)
            parts.append(f'namespace kernel{k} {{\n#include "kernel{k}.cpp"\n}}\n'
                         "#undef N\n#undef M\n#undef SQUARE\n#undef TARGET\n#undef FAST\n#undef PUT\n#undef COPY\n#undef JOIN\n#undef CLEAN\n#undef MAXIMUM\n")
        parts.append("#undef main\nint main() {\n" + "".join(
            f"  model::reset(); kernel{k}::kernel_main(); model::print();\n" for k in range(len(kernels))) + "}\n")
        self.write("all.cpp", "".join(parts))
        status, _, err = self.finish(self.start("g++", "-std=c++20", "-O0", "-w", "-fsingle-precision-constant",
                                                "-fsanitize=signed-integer-overflow,float-cast-overflow,shift,integer-divide-by-zero", "-I", str(ROOT / "tests/system/programs"), "-o",
                                                str(self.folder / "all"), str(self.folder / "all.cpp")))
        self.assertEqual(status, 0, err)
        status, out, err = self.finish(self.start(str(self.folder / "all")))
        self.assertEqual(status, 0, err)
        overflows = set(re.findall(r"([\w.]+):\d+:\d+: runtime error: ", err))
        return [None if overflows & {f"kernel{k}.cpp", *map(os.path.basename, files)} else
                np.array(line.split(), dtype=float).reshape(len(NAMES), SIZE, SIZE)
                for k, (line, (_, _, files)) in enumerate(zip(out.splitlines(), kernels, strict=True))]

    def imported(self, index, label, text):
        program = self.folder / f"kernel{index}.aps"
        status, _, err = self.finish(self.start(APRON, "import", str(self.folder / f"kernel{index}.cpp"), "--output", str(program)))
        self.assertEqual(status, 0, f"{label}: {err}\n{text}")
        saves = [word for name in NAMES for word in ("--save", f"{name}={self.folder}/{name}.npy")]
        status, _, err = self.finish(self.start(APRON, "run", str(program), "--size", f"{SIZE}x{SIZE}", *saves))
        self.assertEqual((status, err), (0, ""), f"{label}\n{text}\n{program.read_text()}")
        return np.array([np.load(self.folder / f"{name}.npy") for name in NAMES]), program.read_text()

    def compare(self, kernels):
        for k, ((label, text, files), wanted) in enumerate(zip(kernels, self.compiled(kernels))):
            text += "".join(f"// {name}\n{content}" for name, content in files.items())
            got, program = self.imported(k, label, text)
            if wanted is None and label not in FORMS:
                continue
            for name, a, b in zip(NAMES, got, wanted):
                np.testing.assert_array_equal(a, b, f"{label}: {name}\n{text}\n{program}")

    def test_forms(self):
        self.compare([(label, text, {}) for label, text in FORMS.items()])

    def test_random_kernels(self):
        seeds = program_seeds(30)
        for first in range(0, len(seeds), 50):
            self.compare([(f"seed {seed}", *Writer(seed).kernel()) for seed in seeds[first:first + 50]])

    def test_random_arithmetic(self):
        seeds = program_seeds(20)
        for first in range(0, len(seeds), 50):
            self.compare([(f"seed {seed}", *ArithmeticWriter(seed).kernel()) for seed in seeds[first:first + 50]])

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
        self.check_status(main % "int k = 1; switch (k) { case k: res(A); }", 2, "error: the label of a 'case' is no constant")
        self.check_status(main % "goto end; end: ;", 2, "error: 'goto' has no counterpart")
        self.check_status(main % "objects[2].draw(S1);", 2, "error: ")
        self.check_status("void f(AREG y){ res(y); } " + main % "f(regs[1]);", 2, "error: ")
        self.check_status("void f(AREG y){ res(y); } void f(DREG y){ CLR(y); } " + main % "f(A);", 2, "another function 'f'")
        self.check_status("void add(AREG y, AREG a, AREG b){ add(y, a, b); } " + main % "add(C, A, B);", 2, "'add' calls itself: rename it")
        self.check_status("class Pen { void draw(){ res(B); } }; " + main % "", 2, "the class 'Pen' is left out")
        self.check_status("void show(DREG y, vs_handle display){ SET(y); scamp5_output_image(y, display); } int main(){ auto d = vs_gui_add_display(\"a\");"
                          " show(S0, d); vs_on_gui_update(3, [&](int32_t v){ res(A); }); }", 0, "left out: 'vs_gui_add_display'")
        self.check_status(main % "vs_post_text(\"x\"); scamp5_output_events(S0);", 0, "left out")
        self.check_status("int main(){ scamp5_in(A, 1); add(B, A, A); }", 0, "warning: the chip connects 'A' once in 'add'")

    def test_an_endless_loop_that_the_host_ends_runs_for_its_frames(self):
        self.check_status("int main(){ while (1) { if (button()) break; scamp5_in(A, 3); } }", 0, "'button' runs on the controller or host")
        self.assertIn("repeat(FRAMES)\n", (self.folder / "one.aps").read_text())

    def test_a_limit_is_an_error(self):
        self.check_status("#if " + "(" * 300 + "1" + ")" * 300 + "\nint main(){ scamp5_in(A, 1); }\n#endif", 2, "one.cpp:1: error: the condition is nested too deeply")
        macros = "#define M0(x) x\n" + "".join(f"#define M{k}(x) {f'M{k - 1}(x) ' * 10}\n" for k in range(1, 7))
        self.check_status(macros + "int main(){ M6(res(A);) }", 2, "expand to more than 300000 words")
        doubling = "#define A0 1\n" + "".join(f"#define A{k} A{k - 1} + A{k - 1}\n" for k in range(1, 60))
        self.check_status(doubling + "int main(){ scamp5_in(A, A59); }", 2, "expand to more than 300000 words")

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
