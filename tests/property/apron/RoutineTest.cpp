// Random programs of routines that call each other within loops, conditions and macros compute what a plain
// interpreter in this file computes: a routine changes nothing that its callers hold, and a local name that
// no path has written is 0 whatever ran before.
#include <gtest/gtest.h>

#include <array>
#include <functional>
#include <random>
#include <string>
#include <utility>
#include <vector>

#include "apron/compiler/Compiler.h"
#include "tests/unit/apron/vm/TestProgram.h"

namespace apron::vm::test {
namespace {

enum class Flow { kNext, kBreak, kContinue, kReturn };

struct Number {
  std::string text;
  std::function<int()> value;
};
using Run = std::function<Flow()>;

class RandomRoutines {
 public:
  explicit RandomRoutines(unsigned seed) : rng_(seed) {
    text =
        "!macro_def\nkeep($y, $a)\n!macro_begin\n:t = $a * 2\ncall(#r1)\n$y = mod($y + :t, 97)\n!macro_end\n"
        "function y = called(number a)\nif(a > 5)\nt = a\nendif\ncall(#r1)\ny = t + a\nendfunction\n"
        "!macro_def\n$y = late($a)\n!macro_begin\ncall(#r1)\nif($a > 5)\n:t = $a + 1\nendif\n$y = "
        ":t\n!macro_end\n"
        "function y = inner(number a)\nz = (a + 2) * (a + 1)\nif(z > 20)\ny = z - a * 2\nendif\nendfunction\n"
        "function y = early(number a)\nz = (mod(a, 5) + 1) * (mod(a, 3) + 2)\nif(z > 9)\nt = z * 2\nendif\n"
        "while(z > 5)\nz = z - 4\nif(inner(z) > 8)\nu = (z + 1) * 2\nendif\nendwhile\ny = t + "
        "u\nendfunction\n";
    for (int i = 0; i < kScalars; ++i) text += "s" + std::to_string(i) + " = " + std::to_string(i + 1) + "\n";
    main_ = block(0, 3, false);
    for (int i = 0; i < kScalars; ++i) text += "println(s" + std::to_string(i) + ")\n";
    text += "end\n";
    for (int i = 1; i <= kRoutines; ++i) {
      text += "#r" + std::to_string(i) + "\n";
      routines_[i] = block(i, 2, false);
      text += "return\n";
    }
  }
  std::string output() {
    for (int i = 0; i < kScalars; ++i) s_[i] = i + 1;
    main_();
    std::string result;
    for (const int s : s_) result += std::to_string(s) + "\n";
    return result;
  }

  std::string text;

 private:
  static constexpr int kScalars = 5, kRoutines = 4;

  int below(int n) { return static_cast<int>(rng_() % n); }
  static int mod(int a, int n) { return (a % n + n) % n; }

  Number number(int depth) {
    if (depth == 0 || below(3) == 0) {
      const int i = below(kScalars + 3);
      if (i >= kScalars) return {std::to_string(i), [i] { return i; }};
      return {"s" + std::to_string(i), [this, i] { return s_[i]; }};
    }
    const Number a = number(depth - 1), b = number(depth - 1);
    const bool adds = below(2) == 0;
    return {"(" + a.text + (adds ? " + " : " * ") + b.text + ")",
            [a, b, adds] { return adds ? a.value() + b.value() : a.value() * b.value(); }};
  }

  Run block(int level, int depth, bool in_loop) {
    std::vector<Run> lines;
    for (int i = 1 + below(4); i > 0; --i) lines.push_back(line(level, depth, in_loop));
    return [lines] {
      for (const Run& run : lines)
        if (const Flow flow = run(); flow != Flow::kNext) return flow;
      return Flow::kNext;
    };
  }

  static Run repeated(const std::function<int()>& rounds, const std::function<void(int)>& count,
                      const Run& body) {
    return [=] {
      const int n = rounds();
      for (int i = 0; i < n; ++i) {
        count(i);
        const Flow flow = body();
        if (flow == Flow::kReturn) return flow;
        if (flow == Flow::kBreak) break;
      }
      return Flow::kNext;
    };
  }

  Run line(int level, int depth, bool in_loop) {
    const int y = below(kScalars);
    const std::string target = "s" + std::to_string(y);
    const Number a = number(2);
    const int kind = below(level < kRoutines ? 11 : 6);
    if (depth > 0 && kind == 0) {
      text += "repeat(mod(" + a.text + ", 4))\n";
      const Run body = block(level, depth - 1, true);
      text += "endrepeat\n";
      return repeated([a] { return mod(a.value(), 4); }, [](int) {}, body);
    }
    if (depth > 0 && kind == 1) {
      const std::string i = "i" + std::to_string(loops_++);
      const int step = 1 + below(2);
      text += "for(" + i + ", 1, mod(" + a.text + ", 5), " + (below(2) == 0 ? "" : "0 * " + target + " + ") +
              std::to_string(step) + ")\n" + target + " = mod(" + target + " + " + i + ", 97)\n";
      const Run body = block(level, depth - 1, true);
      text += "endfor\n";
      return repeated([a, step] { return (mod(a.value(), 5) + step - 1) / step; },
                      [this, y, step](int round) { s_[y] = mod(s_[y] + 1 + round * step, 97); }, body);
    }
    if (depth > 0 && kind == 2) {
      text += "if(mod(" + a.text + ", 3) == 1)\n";
      const Run body = block(level, depth - 1, in_loop);
      text += "endif\n";
      return [a, body] { return mod(a.value(), 3) == 1 ? body() : Flow::kNext; };
    }
    if ((in_loop || level > 0) && kind == 3) {
      const Flow flow = !in_loop ? Flow::kReturn : below(2) == 0 ? Flow::kBreak : Flow::kContinue;
      text += "if(mod(" + a.text + ", 7) == 3)\n";
      text += flow == Flow::kReturn ? "return\n" : flow == Flow::kBreak ? "break\n" : "continue\n";
      text += "endif\n";
      return [a, flow] { return mod(a.value(), 7) == 3 ? flow : Flow::kNext; };
    }
    if (kind == 6) {
      const int r = level + 1 + below(kRoutines - level);
      text += "call(#r" + std::to_string(r) + ")\n";
      return [this, r] { return call(r); };
    }
    if (kind == 7 && level == 0) {
      text += "keep(" + target + ", " + a.text + ")\n";
      return [this, a, y] {
        const int t = a.value() * 2;
        call(1);
        s_[y] = mod(s_[y] + t, 97);
        return Flow::kNext;
      };
    }
    if (kind == 8 && level == 0) {
      text += target + " = mod(" + target + " * 3 + called(" + a.text + "), 97)\n";
      return [this, a, y] {
        const int product = s_[y] * 3, argument = a.value();
        call(1);
        s_[y] = mod(product + argument + (argument > 5 ? argument : 0), 97);
        return Flow::kNext;
      };
    }
    if (kind == 9 && level == 0) {
      text += target + " = mod(" + target + " * 3 + late(" + a.text + " + 0), 97)\n";
      return [this, a, y] {
        const int product = s_[y] * 3, argument = a.value();
        call(1);
        s_[y] = mod(product + (argument > 5 ? argument + 1 : 0), 97);
        return Flow::kNext;
      };
    }
    if (kind == 10 && level == 0) {
      text += target + " = mod(" + target + " + early(" + a.text + "), 97)\n";
      return [this, a, y] {
        s_[y] = mod(s_[y] + early(a.value()), 97);
        return Flow::kNext;
      };
    }
    text += target + " = mod(" + a.text + ", 97)\n";
    return [this, a, y] {
      s_[y] = mod(a.value(), 97);
      return Flow::kNext;
    };
  }

  static int inner(int a) {
    const int z = (a + 2) * (a + 1);
    return z > 20 ? z - a * 2 : 0;
  }
  static int early(int a) {
    int z = (mod(a, 5) + 1) * (mod(a, 3) + 2), u = 0;
    const int t = z > 9 ? z * 2 : 0;
    while (z > 5) {
      z -= 4;
      if (inner(z) > 8) u = (z + 1) * 2;
    }
    return t + u;
  }

  Flow call(int routine) {
    routines_[routine]();
    return Flow::kNext;
  }

  std::mt19937 rng_;
  std::array<int, kScalars> s_{};
  Run main_;
  std::array<Run, kRoutines + 1> routines_;
  int loops_ = 0;
};

TEST(Routine, RandomProgramsMatchAnInterpreter) {
  const auto seeds = program_seeds(400);
  for (const unsigned seed : seeds) {
    RandomRoutines routines(seed);
    syntax::MemoryReader reader;
    reader.files["routines.aps"] = routines.text;
    compiler::CompileOptions options;
    options.file = "routines.aps";
    options.width = options.height = 1;
    const compiler::CompileResult compiled = compiler::compile(options, reader);
    ASSERT_TRUE(compiled.program) << format_diagnostics(compiled.diagnostics, compiled.sources)
                                  << routines.text;
    FakeHost host;
    VmOptions vm_options;
    vm_options.refuse_endless_ticks = true;
    Vm vm(*compiled.program, vm_options, host);
    ASSERT_EQ(vm.run(), Status::kEnded) << vm.error() << routines.text;
    ASSERT_EQ(host.console, routines.output()) << "seed " << seed << '\n' << routines.text;
  }
  count_cases(seeds.size());
}

}  // namespace
}  // namespace apron::vm::test
