// Random programs of functions compute what a plain interpreter in this file computes: values and registers
// as parameters, which functions write in any way, local names, also those that no line or only some paths
// have written before, loops, arrays with constant and computed indices,
// matrix products, masks within and around calls. In any layout, and formatted, they compile to the same
// instructions. The check of bodies that are not called accepts them.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <functional>
#include <iterator>
#include <map>
#include <set>
#include <string>
#include <vector>

#include "apron/compiler/BodyCheck.h"
#include "apron/compiler/Compiler.h"
#include "apron/syntax/Formatter.h"
#include "tests/unit/apron/vm/TestProgram.h"

namespace apron::vm::test {
namespace {

constexpr std::size_t kWidth = 7, kHeight = 5, kCount = kWidth * kHeight;

// The registers that a call sees, by the names that they have in it, and its own masks.
struct Scope {
  std::map<std::string, Cells*> registers;
  std::map<std::string, Cells> own;
  std::map<std::string, float> numbers;
  std::vector<Cells> masks;

  Cells& at(const std::string& name) {
    const auto found = registers.find(name);
    return found != registers.end() ? *found->second : own.try_emplace(name, kCount).first->second;
  }
  void write(const std::string& name, const Cells& value) {
    Cells& cells = at(name);
    for (std::size_t i = 0; i < kCount; ++i)
      if (std::ranges::all_of(masks, [&](const Cells& mask) { return mask[i] != 0.0F; })) cells[i] = value[i];
  }
};

struct Value {
  std::string text;
  std::function<Cells(Scope&)> compute;
};
struct Statements {
  std::string text;
  std::vector<std::function<void(Scope&)>> run;
  void operator()(Scope& scope) const {
    for (const auto& one : run) one(scope);
  }
};

class RandomFunctions {
 public:
  explicit RandomFunctions(unsigned seed) : rng_(seed) {
    text =
        "!register(A, B, M, N, X, Y, G[3])\n!scalar(w[9])\nfor(i, 0, 8)\nw[i] = 0.75 - 0.25 * i\nendfor\n"
        "function u, v = pair(plane a, plane b)\nu = a + b\nv = u - 2 * b\nendfunction\n"
        "function y = ramp(plane a, number n)\ny = a\nwhere(a < n)\ny = n - a\nendwhere\nendfunction\n";
    text +=
        "function raise(register x, number d)\nx = x + d\nendfunction\n"
        "!macro_def\nswap($x, $y)\n!macro_begin\n:kept = $x\n$x = $y\n$y = :kept\n!macro_end\n"
        "!macro_def\nlift($x)\n!macro_begin\nraise($x, 2)\n!macro_end\n"
        "!macro_def\ncount($n)\n!macro_begin\n$n = $n + 1\n!macro_end\n";
    for (int i = 0; i < 3; ++i) add_function(i);
    const std::string call = "X = f2(A + X, B, 2, Y, G)\n";
    text +=
        call + "where(M, !=, 0)\n" + call + "where(N, !=, 0)\nX = f1(X, Y, 1, X, G)\nendwhere\nendwhere\n";
  }

  void run(std::map<std::string, Cells>& planes) const {
    Scope scope;
    for (auto& [name, cells] : planes) scope.registers[name] = &cells;
    const auto call = [&](int function, const std::string& a, const std::string& b, float n, const char* r) {
      Cells sum = scope.at(a);
      if (function == 2)
        for (std::size_t i = 0; i < kCount; ++i) sum[i] = scope.at("A")[i] + scope.at("X")[i];
      scope.write("X", apply(scope, function, sum, scope.at(b), n, r, "G"));
    };
    call(2, "A", "B", 2, "Y");
    scope.masks.push_back(scope.at("M"));
    call(2, "A", "B", 2, "Y");
    scope.masks.push_back(scope.at("N"));
    call(1, "X", "Y", 1, "X");
  }

  std::string text;

 private:
  // Calls the function without the caller's masks, then writes its registers under them.
  Cells apply(Scope& caller, int function, Cells a, Cells b, float n, const std::string& r,
              const std::string& q) const {
    std::map<std::string, Cells> changed;
    Scope scope;
    const auto lend = [&](const std::string& name, const std::string& inside) {
      changed.try_emplace(name, caller.at(name));
      scope.registers[inside] = &changed.at(name);
    };
    if (takes_registers(function)) lend(r, "r");
    for (int i = 0; i < 3 && takes_registers(function); ++i) lend(element(q, i), element("q", i));
    scope.own["a"] = std::move(a);
    scope.own["b"] = std::move(b);
    scope.numbers["n"] = n;
    bodies_[static_cast<std::size_t>(function)](scope);
    for (const auto& [name, cells] : changed) caller.write(name, cells);
    return scope.at("y");
  }

  static std::string element(const std::string& array, int index) {
    return array + '[' + std::to_string(index) + ']';
  }

  // A function without them copies no parameter that it does not write.
  static bool takes_registers(int function) { return function > 0; }

  void note_write(const std::string& name) {
    if (name[0] == 'c') named_.insert(name);
  }

  unsigned below(unsigned n) { return rng_() % n; }

  void add_function(int number) {
    functions_ = number;
    named_.clear();
    Statements body;
    body.text = "!register(t2, h[3])\n";
    const auto set = [&](const std::string& name, const Value& value) {
      body.text += name + " = " + value.text + "\n";
      body.run.push_back([name, value](Scope& scope) { scope.write(name, value.compute(scope)); });
    };
    set("t0", expression(1, false));
    set("t1", expression(1, false));
    if (below(2) == 0) set("y", expression(2, true));
    for (unsigned i = 4 + below(6); i > 0; --i) add_statement(body, 0);
    set("y", expression(2, true));
    text += "function y = f" + std::to_string(number) + "(plane a, plane b, number n" +
            (takes_registers(number) ? ", register r, register q[])\n" : ")\n") + body.text + "endfunction\n";
    bodies_.push_back(body);
  }

  void append(Statements& to, Statements what) {
    to.text += what.text;
    to.run.push_back([what = std::move(what)](Scope& scope) { what(scope); });
  }

  // The c names are first written anywhere, so that most have no value on some path.
  std::string target() {
    if (below(3) == 0) return below(2) == 0 ? "c0" : "c1";
    static const char* const kTargets[] = {"t0", "t1", "t2", "a", "b", "h[0]", "h[2]", "r", "q[1]"};
    return kTargets[below(takes_registers(functions_) ? 9 : 7)];
  }

  void add_statement(Statements& body, int depth) {
    switch (below(depth < 2 ? 15 : 4)) {
      case 13:
        return add_rounds(body, depth);
      case 14:
        return add_number(body);
      case 4:
      case 5:
        return add_where(body, depth);
      case 6:
        return add_loop(body);
      case 7:
        return add_condition(body, depth);
      case 8:
        return add_call(body);
      case 9:
        return add_product(body);
      case 10:
      case 11:
      case 12:
        return add_indirect_write(body);
      case 3: {
        body.text += "t0, t1 = pair(t1, t0)\n";
        body.run.emplace_back([](Scope& scope) {
          Cells u = scope.at("t1"), v = u;
          const Cells& b = scope.at("t0");
          for (std::size_t i = 0; i < kCount; ++i) {
            u[i] += b[i];
            v[i] = u[i] - 2.0F * b[i];
          }
          scope.write("t0", u);
          scope.write("t1", v);
        });
        return;
      }
      default: {
        const std::string name = target();
        const Value value = expression(2, true);
        body.text += name + " = " + value.text + "\n";
        body.run.emplace_back([=](Scope& scope) { scope.write(name, value.compute(scope)); });
        note_write(name);
      }
    }
  }

  // A write by a call: of a function, a macro or an instruction.
  void add_indirect_write(Statements& body) {
    static const char* const kRegisters[] = {"t0", "t1", "t2", "a", "b", "r"};
    const unsigned count = takes_registers(functions_) ? 6 : 5;
    const std::string x = kRegisters[below(count)], y = kRegisters[below(count)];
    const auto add_to_cells = [&](const std::string& line, const std::function<float(std::size_t)>& amount) {
      body.text += line + "\n";
      body.run.emplace_back([=](Scope& scope) {
        Cells cells = scope.at(x);
        for (std::size_t i = 0; i < kCount; ++i) cells[i] += amount(i);
        scope.write(x, cells);
      });
    };
    switch (below(6)) {
      case 0:
        return add_to_cells("raise(" + x + ", 3)", [](std::size_t) { return 3.0F; });
      case 1:
        return add_to_cells("lift(" + x + ")", [](std::size_t) { return 2.0F; });
      case 2:
        return add_to_cells("add(" + x + ", " + x + ", 1)", [](std::size_t) { return 1.0F; });
      case 3:
        return add_to_cells("pixel.set(" + x + ", 2, 1, pixel.get(" + x + ", 2, 1) + 4)",
                            [](std::size_t i) { return i == kWidth + 2 ? 4.0F : 0.0F; });
      case 4:
        body.text += "count(n)\n";
        body.run.emplace_back([](Scope& scope) { ++scope.numbers["n"]; });
        return;
      default:
        body.text += "swap(" + x + ", " + y + ")\n";
        body.run.emplace_back([=](Scope& scope) {
          const Cells first = scope.at(x), second = scope.at(y);
          scope.write(x, second);
          scope.write(y, first);
        });
    }
  }

  void add_where(Statements& body, int depth) {
    const Value condition = expression(1, true);
    Statements inside, outside;
    for (unsigned i = 1 + below(3); i > 0; --i) add_statement(inside, depth + 1);
    const bool has_else = below(2) == 0;
    if (has_else) add_statement(outside, depth + 1);
    body.text += "where(" + condition.text + " > 0)\n" + inside.text +
                 (has_else ? "elsewhere\n" + outside.text : "") + "endwhere\n";
    body.run.emplace_back([=](Scope& scope) {
      Cells mask = condition.compute(scope);
      for (float& cell : mask) cell = cell > 0.0F ? 1.0F : 0.0F;
      scope.masks.push_back(mask);
      inside(scope);
      for (float& cell : scope.masks.back()) cell = 1.0F - cell;
      outside(scope);
      scope.masks.pop_back();
    });
  }

  // A loop around conditions and where blocks.
  void add_rounds(Statements& body, int depth) {
    const std::string j = "j" + std::to_string(depth);
    const std::string heads[] = {"repeat(2)\n", "for(" + j + ", 1, 2)\n",
                                 j + " = 2\nwhile(" + j + " > 0)\n" + j + " = " + j + " - 1\n"};
    static const char* const kEnds[] = {"endrepeat\n", "endfor\n", "endwhile\n"};
    const unsigned kind = below(3);
    Statements round;
    for (unsigned i = 1 + below(2); i > 0; --i) {
      if (below(2) == 0)
        add_where(round, 1);
      else
        add_condition(round, 1);
    }
    body.text += heads[kind] + round.text + kEnds[kind];
    body.run.emplace_back([=](Scope& scope) {
      round(scope);
      round(scope);
    });
  }

  // A number that some paths write, after others are computed.
  void add_number(Statements& body) {
    const int limit = static_cast<int>(5 + below(20));
    body.text +=
        "if((n + 1) * (n + 2) > " + std::to_string(limit) + ")\nm = n + 1\nendif\nn = mod(n + m, 5)\n";
    body.run.emplace_back([=](Scope& scope) {
      float &n = scope.numbers["n"], &m = scope.numbers["m"];
      if ((n + 1) * (n + 2) > static_cast<float>(limit)) m = n + 1;
      n = std::fmod(n + m, 5.0F);
    });
  }

  // A loop at run time or at compile time over an array of the function or of the caller.
  void add_loop(Statements& body) {
    const std::string array = !takes_registers(functions_) || below(2) == 0 ? "h" : "q";
    const bool unrolled = below(2) == 0;
    const Value value = expression(1, true);
    const int from = unrolled ? 2 : 0;
    body.text += (unrolled ? "!for(k, 2, 0, -1)\n" : "for(k, 0, 2)\n") + array + "[k] = " + value.text +
                 " - " + array + "[2 - k] * k\n" + (unrolled ? "!endfor\n" : "endfor\n");
    body.run.emplace_back([=](Scope& scope) {
      for (int step = 0; step < 3; ++step) {
        const int k = unrolled ? from - step : step;
        Cells cells = value.compute(scope);
        const Cells& other = scope.at(element(array, 2 - k));
        for (std::size_t i = 0; i < kCount; ++i) cells[i] = cells[i] - other[i] * static_cast<float>(k);
        scope.write(element(array, k), cells);
      }
    });
  }

  void add_product(Statements& body) {
    if (!takes_registers(functions_)) return;
    const std::string to = below(2) == 0 ? "h" : "q", from = to == "h" ? "q" : "h";
    body.text += "matrix.product(" + to + ", " + from + ", w)\n";
    body.run.emplace_back([=](Scope& scope) {
      for (int k = 0; k < 3; ++k) {
        Cells sum(kCount);
        for (int j = 0; j < 3; ++j) {
          const Cells& cells = scope.at(element(from, j));
          const float weight = 0.75F - 0.25F * static_cast<float>(3 * k + j);
          for (std::size_t i = 0; i < kCount; ++i) sum[i] += cells[i] * weight;
        }
        scope.write(element(to, k), sum);
      }
    });
  }

  void add_condition(Statements& body, int depth) {
    Statements yes, no;
    const int limit = 1 + static_cast<int>(below(4));
    add_statement(yes, depth + 1);
    add_statement(no, depth + 1);
    body.text +=
        "n = n + 1\nif(n > " + std::to_string(limit) + ")\n" + yes.text + "else\n" + no.text + "endif\n";
    body.run.emplace_back(
        [=](Scope& scope) { (++scope.numbers["n"] > static_cast<float>(limit) ? yes : no)(scope); });
  }

  void add_call(Statements& body) {
    if (functions_ == 0) return;
    const int function = static_cast<int>(below(static_cast<unsigned>(functions_)));
    const std::string to = target(), array = below(2) == 0 ? "h" : "q";
    const char* const lent = below(2) == 0 ? "t2" : "r";
    const Value a = expression(1, true), b = expression(0, true);
    body.text += to + " = f" + std::to_string(function) + "(" + a.text + ", " + b.text + ", n" +
                 (takes_registers(function) ? std::string(", ") + lent + ", " + array : "") + ")\n";
    body.run.emplace_back([=, this](Scope& scope) {
      scope.write(
          to, apply(scope, function, a.compute(scope), b.compute(scope), scope.numbers["n"], lent, array));
    });
    note_write(to);
  }

  Value expression(int depth, bool with_locals) {
    if (depth == 0 || below(4) == 0) return leaf(with_locals);
    const Value left = expression(depth - 1, with_locals), right = expression(depth - 1, with_locals);
    switch (below(6)) {
      case 0:
        return binary("(" + left.text + " + " + right.text + ")", left, right,
                      [](float a, float b) { return a + b; });
      case 1:
        return binary("(" + left.text + " - " + right.text + ")", left, right,
                      [](float a, float b) { return a - b; });
      case 2:
        return binary("max(" + left.text + ", " + right.text + ")", left, right,
                      [](float a, float b) { return a > b ? a : b; });
      case 3:
        return binary("(" + left.text + " < " + right.text + ")", left, right,
                      [](float a, float b) { return a < b ? 1.0F : 0.0F; });
      case 4:
        return {"ramp(" + left.text + ", 3)", [left](Scope& scope) {
                  Cells cells = left.compute(scope);
                  for (float& cell : cells) cell = cell < 3.0F ? 3.0F - cell : cell;
                  return cells;
                }};
      default:
        return {"west(" + left.text + ")", [left](Scope& scope) {
                  Cells cells = left.compute(scope);
                  for (std::size_t i = kCount; i-- > 0;) cells[i] = i % kWidth == 0 ? 0.0F : cells[i - 1];
                  return cells;
                }};
    }
  }

  static Value binary(const std::string& text, const Value& left, const Value& right,
                      float (*op)(float, float)) {
    return {text, [=](Scope& scope) {
              Cells a = left.compute(scope);
              const Cells b = right.compute(scope);
              for (std::size_t i = 0; i < kCount; ++i) a[i] = op(a[i], b[i]);
              return a;
            }};
  }

  // Registers of the program too, which functions read.
  Value leaf(bool with_locals) {
    static const char* const kNames[] = {"r", "q[2]", "a", "b", "A", "t0", "t1", "t2", "h[1]"};
    const unsigned first = takes_registers(functions_) ? 0 : 2;
    const bool is_named = with_locals && !named_.empty() && below(4) == 0;
    const std::string name = is_named
                                 ? *std::next(named_.begin(), below(static_cast<unsigned>(named_.size())))
                                 : kNames[first + below((with_locals ? 9 : 5) - first)];
    if (name == "A") return {name, [this](Scope&) { return shared; }};
    return {name, [name](Scope& scope) { return scope.at(name); }};
  }

 public:
  Cells shared;  // A

 private:
  std::mt19937 rng_;
  std::vector<Statements> bodies_;
  std::set<std::string> named_;  // of c0 and c1: those that a line before writes
  int functions_ = 0;
};

constexpr unsigned kFunctionPrograms = 90U;

compiler::CompileResult compile_text(const std::string& text, bool with_bodies) {
  syntax::MemoryReader reader;
  reader.files["main.aps"] = text;
  compiler::CompileOptions options;
  options.file = "main.aps";
  options.width = kWidth;
  options.height = kHeight;
  compiler::CompileResult compiled = compiler::compile(options, reader);
  EXPECT_TRUE(compiled.program) << syntax::format_diagnostics(compiled.diagnostics, compiled.sources) << text;
  if (with_bodies) {
    const compiler::CompileResult bodies = compiler::check_macro_bodies(options, reader);
    EXPECT_EQ(syntax::format_diagnostics(bodies.diagnostics, bodies.sources), "") << text;
  }
  return compiled;
}

TEST(Function, RandomProgramsMatchAnInterpreter) {
  const auto seeds = program_seeds(kFunctionPrograms);
  for (const unsigned seed : seeds) {
    RandomFunctions functions(seed);
    const compiler::CompileResult compiled = compile_text(functions.text, true);
    ASSERT_TRUE(compiled.program) << "seed " << seed;
    std::mt19937 rng(seed);
    std::map<std::string, Cells> planes;
    for (const char* name : {"A", "B", "X", "Y", "G[0]", "G[1]", "G[2]"}) {
      planes[name] = Cells(kCount);
      for (float& cell : planes[name]) cell = static_cast<float>(rng() % 16) * 0.5F - 4.0F;
    }
    planes["M"] = random_mask(kCount, rng);
    planes["N"] = random_mask(kCount, rng);
    const std::map<std::string, Cells> start = planes;
    functions.shared = planes["A"];
    functions.run(planes);
    for (const int mode : {0, 1, 2, 3}) {  // not fused, then fused for each instruction set that is there
      static constexpr InstructionSet kSets[] = {InstructionSet::kAvx512, InstructionSet::kAvx512,
                                                 InstructionSet::kAvx2, InstructionSet::kPortable};
      const bool fused = mode > 0;
      FakeHost host;
      VmOptions vm_options;
      vm_options.fusion.enabled = fused;
      if (fused && !is_supported(kSets[mode])) continue;
      if (fused) vm_options.isa = kSets[mode];
      Vm vm(*compiled.program, vm_options, host);
      for (std::size_t i = 0; i < compiled.program->registers.size(); ++i)
        if (const auto found = start.find(compiled.program->registers[i].name); found != start.end())
          write_cells(vm.plane(i), found->second);
      ASSERT_EQ(vm.run(), Status::kEnded) << vm.error() << functions.text;
      for (std::size_t i = 0; i < compiled.program->registers.size(); ++i) {
        const auto found = planes.find(compiled.program->registers[i].name);
        if (found == planes.end()) continue;
        ASSERT_EQ(read_cells(vm.plane(i)), found->second)
            << "seed " << seed << ", " << found->first << (fused ? " fused" : "") << '\n'
            << functions.text;
      }
    }
  }
  count_cases(seeds.size());
}

// The text with other blanks, blank lines and comments.
std::string in_another_layout(const std::string& text, std::mt19937& rng) {
  static const char* const kBlanks[] = {" ", "  ", "\t", " \t "};
  std::string result;
  for (const char c : text) {
    if (c == ' ') {
      result += kBlanks[rng() % std::size(kBlanks)];
    } else if (c == '\n') {
      result += rng() % 8 == 0 ? "  // a comment (\n" : rng() % 8 == 0 ? " \n\n\n" : "\n";
    } else {
      const bool stands_alone = std::string_view("(),[]").find(c) != std::string_view::npos;
      if (stands_alone && c != '(' && c != '[' && rng() % 4 == 0) result += ' ';
      result += c;
      if (stands_alone && c != ')' && c != ']' && rng() % 4 == 0) result += "  ";
    }
  }
  return result;
}

std::string instructions_of(const std::string& text) {
  compiler::CompileResult compiled = compile_text(text, false);
  if (!compiled.program) return {};
  for (program::SourceLocation& place : compiled.program->source_locations) place = {};
  return program::disassemble(*compiled.program);
}

TEST(Function, LayoutDoesNotChangeAProgram) {
  const auto seeds = program_seeds(kFunctionPrograms);
  for (const unsigned seed : seeds) {
    const std::string text = RandomFunctions(seed).text, want = instructions_of(text);
    std::mt19937 rng(seed);
    const std::string other = in_another_layout(text, rng), formatted = syntax::format_source(other);
    ASSERT_FALSE(want.empty()) << "seed " << seed;
    ASSERT_EQ(instructions_of(other), want) << "seed " << seed << '\n' << other;
    ASSERT_EQ(instructions_of(formatted), want) << "seed " << seed << '\n' << formatted;
    ASSERT_EQ(syntax::format_source(formatted), formatted) << "seed " << seed;
  }
  count_cases(seeds.size());
}

}  // namespace
}  // namespace apron::vm::test
