// Every routine of the library, under any mask, equals the routine without one, selected by the mask: for
// random planes, in every way to mask it and every way to execute it.
#include <gtest/gtest.h>

#include <map>
#include <set>
#include <string>
#include <vector>

#include "apron/compiler/Compiler.h"
#include "apron/syntax/Parser.h"
#include "tests/unit/apron/vm/TestProgram.h"

namespace apron::vm::test {
namespace {

constexpr std::uint32_t kWidth = 19, kHeight = 11;

// The library's text, with a main program in memory.
class LibraryReader final : public syntax::FileReader {
 public:
  explicit LibraryReader(std::string text) : text_(std::move(text)) {}
  std::optional<std::string> read(const std::string& path) override {
    if (path == "main.aps") return text_;
    return disk_.read(path);
  }

 private:
  std::string text_;
  syntax::DiskReader disk_;
};

syntax::SourceOptions source_options() {
  syntax::SourceOptions options;
  options.file = "main.aps";
  options.width = kWidth;
  options.height = kHeight;
  options.library_path = APRON_SCRIPTS;
  return options;
}

std::string includes(const std::vector<std::string>& files) {
  std::string text;
  for (const std::string& file : files) text += "!include('" + file + "')\n";
  return text;
}

std::vector<syntax::Macro> library_macros(const std::vector<std::string>& files) {
  LibraryReader reader(includes(files) + "end\n");
  syntax::PreprocessorOptions options{source_options()};
  syntax::SourceManager sources;
  syntax::Diagnostics diagnostics;
  syntax::Preprocessor preprocessor(options, reader, sources, diagnostics);
  syntax::Parser(preprocessor, sources, diagnostics).parse();
  EXPECT_TRUE(diagnostics.empty());
  std::vector<syntax::Macro> all;
  for (const std::string& name : preprocessor.macros().names())
    for (const bool has_result : {false, true})
      for (std::size_t count = 0; count < 20; ++count)
        if (const auto macro = preprocessor.macros().find(name, count, has_result)) all.push_back(*macro);
  return all;
}

const std::vector<std::string> kLibraries = {"apron.aps", "morphology.aps", "automata.aps",
                                             "cnn.aps",   "filters.aps",    "waves.aps"};

// A call of each routine: X is the result or changed in place, as is Y; A and B are binary, G and H grey.
const std::map<std::string, std::string> kCalls = {
    {"swap($a, $b)", "swap(X, Y)"},
    {"y = between(a, lo, hi)", "X = between(G, -1, 1)"},
    {"y = threshold(a, t)", "X = threshold(G, H)"},
    {"y = erode(a)", "X = erode(A)"},
    {"y = dilate(a)", "X = dilate(G)"},
    {"y = erode(a, n)", "X = erode(A, 2)"},
    {"y = dilate(a, n)", "X = dilate(A, 2)"},
    {"y = open(a)", "X = open(A)"},
    {"y = close(a)", "X = close(A)"},
    {"y = count_steps(a, n)", "X = count_steps(A, 3)"},
    {"y = spread_max(a, m, n)", "X = spread_max(G, A, 4)"},
    {"morphology.peel(a, n, ne, e, se, s, sw, w, nw)", "morphology.peel(X, A, B, A, B, A, B, A, B)"},
    {"y = skeleton(a)", "X = skeleton(A)"},
    {"morphology.thin(a, direction)", "morphology.thin(X, 2)"},
    {"y = clear_edge(a)", "X = clear_edge(A)"},
    {"y = fill_holes(a)", "X = fill_holes(A)"},
    {"y = label(a)", "X = label(A)"},
    {"y = label.int32(a)", "X = float(label.int32(A))"},
    {"y = areas(a)", "X = areas(A)"},
    {"y = outline(a)", "X = outline(A)"},
    {"y = outer_totalistic(a, born, survive)", "X = outer_totalistic(A, 0x08, 0x0C)"},
    {"life(a)", "life(X)"},
    {"highlife(a)", "highlife(X)"},
    {"greenberg_hastings(a, states, threshold)", "greenberg_hastings(X, 4, 1)"},
    {"forest_fire(a, grow, strike)", "forest_fire(X, 0.3, 0.2)"},
    {"y = elementary(a, rule)", "X = elementary(A, 110)"},
    {"y = cnn.output(x)", "X = cnn.output(G)"},
    {"cnn.run(x, u, a, b, z, dt, steps)", "cnn.run(X, G, 'cnn.own.A', 'cnn.edge.B', -1, 0.1, 5)"},
    {"cnn.run(x, a, z, dt, steps)", "cnn.run(X, 'cnn.components.A', 0, 0.1, 5)"},
    {"y = cnn.edge(u)", "X = cnn.edge(A)"},
    {"y = cnn.corner(u)", "X = cnn.corner(A)"},
    {"y = cnn.fill_holes(u, steps)", "X = cnn.fill_holes(A, 6)"},
    {"y = cnn.shadow(u, steps)", "X = cnn.shadow(A, 6)"},
    {"y = cnn.components(u, steps)", "X = cnn.components(A, 6)"},
    {"y = sobel.x(a)", "X = sobel.x(G)"},
    {"y = sobel.y(a)", "X = sobel.y(G)"},
    {"y = sobel(a)", "X = sobel(G)"},
    {"y = box(a)", "X = box(G)"},
    {"y = sharpen(a)", "X = sharpen(G)"},
    {"y = difference_of_gaussians(a, narrow, wide)", "X = difference_of_gaussians(G, 0.7, 1.4)"},
    {"y = median(a)", "X = median(G)"},
    {"convolve(y, x, w, inputs, side)", "convolve(Q, P, w, 2, 3)"},
    {"y = laplacian(a)", "X = laplacian(G)"},
    {"heat(a, rate)", "heat(X, 0.2)"},
    {"wave(u, v, courant, damping)", "wave(X, Y, 0.3, 0.01)"},
    {"fitzhugh_nagumo(u, w, dt, diffusion, a, b, epsilon)",
     "fitzhugh_nagumo(X, Y, 0.1, 0.5, 0.7, 0.8, 0.08)"},
    {"y = travelling_wave(amplitude, length, speed, t)", "X = travelling_wave(2, 7, 1, 0.5)"},
};

// A way to mask a call: a program with the call in place of '@', and the cells that it selects.
struct Masking {
  std::string name, program;
  bool (*selects)(bool m, bool n);
};
const std::vector<Masking> kMaskings = {
    {"where", "where(M, !=, 0)\n@\nendwhere\n", [](bool m, bool) { return m; }},
    {"elsewhere", "where(M, !=, 0)\nZ = 1\nelsewhere\n@\nendwhere\n", [](bool m, bool) { return !m; }},
    {"mask.on", "mask.on(M)\n@\nmask.off\n", [](bool m, bool) { return m; }},
    {"two wheres", "where(M, !=, 0)\nwhere(N, ==, 0)\n@\nendwhere\nendwhere\n",
     [](bool m, bool n) { return m && !n; }},
    {"mask.on and where", "mask.on(N)\nwhere(M, ==, 0)\n@\nendwhere\nmask.off\n",
     [](bool m, bool n) { return !m && n; }},
    {"a routine", "where(M, !=, 0)\ncall(#routine)\nendwhere\nend\n#routine\n@\nreturn\n",
     [](bool m, bool) { return m; }},
    {"a macro", "!macro_def\nwrapped\n!macro_begin\n@\n!macro_end\nwhere(M, !=, 0)\nwrapped\nendwhere\n",
     [](bool m, bool) { return m; }},
    {"a where in a macro",
     "!macro_def\nwrapped\n!macro_begin\n:m = M\nwhere(:m, !=, 0)\n:m = 0\n@\nendwhere\n!macro_end\n"
     "where(N, !=, 0)\nwrapped\nendwhere\n",
     [](bool m, bool n) { return m && n; }},
    {"an elsewhere in a macro",
     "!macro_def\nwrapped\n!macro_begin\nwhere(M, !=, 0)\nZ = 1\nelsewhere\n@\nendwhere\n!macro_end\n"
     "mask.on(N)\nwrapped\nmask.off\n",
     [](bool m, bool n) { return !m && n; }},
    // The target is a local register, of which all cells are changed but those that the macro excludes.
    {"a local register in a where",
     "!macro_def\nwrapped($x, $z)\n!macro_begin\n:x = $x\nwhere(M, !=, 0)\n@\nendwhere\n$x = :x\n!macro_end\n"
     "where(N, !=, 0)\nwrapped(X, Y)\nendwhere\n",
     [](bool m, bool n) { return m && n; }},
};

using Registers = std::map<std::string, Cells>;

bool compiles(const std::string& text) {
  LibraryReader reader(text);
  return compiler::compile(source_options(), reader).program.has_value();
}

std::optional<program::Program> compile_text(const std::string& text, const std::string& what) {
  LibraryReader reader(text);
  compiler::CompileResult result = compiler::compile(source_options(), reader);
  EXPECT_TRUE(result.program) << what << '\n'
                              << syntax::format_diagnostics(result.diagnostics, result.sources) << text;
  return std::move(result.program);
}

// Runs the program with the given registers; returns the registers with names.
Registers run(const program::Program& program, const Registers& initial, const VmOptions& options,
              const std::string& what) {
  FakeHost host;
  Vm vm(program, options, host);
  Registers registers;
  for (std::size_t i = 0; i < program.registers.size(); ++i)
    if (const auto found = initial.find(program.registers[i].name); found != initial.end())
      write_cells(vm.plane(i), found->second);
  EXPECT_EQ(vm.run(), Status::kEnded) << what << ": " << vm.error();
  for (std::size_t i = 0; i < program.registers.size(); ++i)
    if (program.registers[i].name[0] != '$') registers[program.registers[i].name] = read_cells(vm.plane(i));
  return registers;
}

struct Execution {
  std::string name;
  VmOptions options;
};

std::vector<Execution> executions() {
  std::vector<Execution> all(4);
  all[0].name = "interpreter";
  all[0].options.fusion.enabled = false;
  all[1].name = "tiles";
  all[1].options.fusion.enable_jit = false;
  all[2].name = "generated code";
  all[3].name = "portable kernels, two threads";
  all[3].options.isa = InstructionSet::kPortable;
  all[3].options.threads = 2;
  all[3].options.parallel_cells = 1;
  return all;
}

void compare(const Registers& want, const Registers& got, const std::string& what) {
  for (const auto& [name, cells] : want) {
    const auto found = got.find(name);
    if (found == got.end()) continue;
    for (std::size_t i = 0; i < cells.size(); ++i)
      ASSERT_TRUE(bits_equal(cells[i], found->second[i]))
          << what << ": " << name << " in column " << i % kWidth << ", row " << i / kWidth << " is "
          << found->second[i] << ", not " << cells[i];
  }
}

class LibraryMask : public testing::Test {
 protected:
  Registers random_registers(const std::vector<std::string>& binary, const std::vector<std::string>& grey) {
    Registers registers;
    for (const std::string& name : binary) registers[name] = random_mask(kWidth * kHeight, rng_);
    for (const std::string& name : grey) {
      Cells& cells = registers[name] = Cells(kWidth * kHeight);
      for (float& cell : cells) cell = static_cast<float>(rng_() % 64) * 0.125F - 3.0F;
    }
    return registers;
  }

  // `masked` is `plain` under the mask; both start with the registers.
  void check(const std::string& head, const std::string& call, const std::string& masked,
             const Registers& initial, bool (*selects)(bool, bool), const std::string& what) {
    const auto head_program = compile_text(head + "end\n", what);
    const auto plain_program = compile_text(head + call, what);
    const auto masked_program = compile_text(head + masked, what);
    if (!head_program || !plain_program || !masked_program) return;
    VmOptions unfused;
    unfused.fusion.enabled = false;
    const Registers start = run(*head_program, initial, unfused, what);
    Registers want = run(*plain_program, initial, unfused, what);
    const Cells &m = initial.at("M"), &n = initial.at("N");
    for (auto& [name, cells] : want) {
      const auto before = start.find(name);
      for (std::size_t i = 0; i < cells.size(); ++i)
        if (!selects(m[i] != 0.0F, n[i] != 0.0F)) cells[i] = before == start.end() ? 0.0F : before->second[i];
    }
    want.erase("Z");
    for (const Execution& execution : executions()) {
      compare(want, run(*masked_program, initial, execution.options, what), what + ", " + execution.name);
      if (HasFatalFailure()) return;
    }
  }

  std::mt19937 rng_{40 + first_program_seed()};
};

std::string replace_all(std::string text, const std::string& from, const std::string& to) {
  for (std::size_t at = 0; (at = text.find(from, at)) != std::string::npos; at += to.size())
    text.replace(at, from.size(), to);
  return text;
}

TEST_F(LibraryMask, RoutinesUnderAMaskAreThoseWithoutSelected) {
  const std::string head = includes(kLibraries) +
                           "!register(A, B, G, H, M, N, X, Y, Z, P[2], Q[2])\n!scalar(w[36])\n"
                           "for(i, 0, 35)\nw[i] = 0.25 * i - 3\nendfor\n";
  std::set<std::string> called;
  for (const syntax::Macro& macro : library_macros(kLibraries)) {
    const std::string signature = syntax::signature(macro);
    if (macro.name.starts_with("original.")) continue;
    const auto call = kCalls.find(signature);
    ASSERT_NE(call, kCalls.end()) << "no call of '" << signature << "' is tested";
    called.insert(signature);
    for (const Masking& masking : kMaskings) {
      const Registers initial =
          random_registers({"A", "B", "M", "N"}, {"G", "H", "X", "Y", "P[0]", "P[1]", "Q[0]", "Q[1]"});
      const bool is_local = masking.program.find(":x") != std::string::npos;
      const std::string in_body = is_local ? replace_all(call->second, "X", ":x") : call->second;
      check(head, call->second + "\n", replace_all(masking.program, "@", in_body), initial, masking.selects,
            signature + ", " + masking.name);
      if (HasFatalFailure() || HasNonfatalFailure()) return;
    }
  }
  EXPECT_EQ(called.size(), kCalls.size()) << "a call in the table names no routine";
  count_cases(called.size() * kMaskings.size());
}

// The instructions of the vision chip, with operands drawn for their kinds.
TEST_F(LibraryMask, InstructionsOfTheChipToo) {
  const std::map<std::string, std::vector<std::string>> operands = {
      {"analogue", {"A", "B", "C", "D", "E", "F"}},
      {"source", {"A", "B", "C", "D", "E", "F"}},
      {"summand", {"A", "B", "C", "D", "E", "F"}},
      {"digital", {"R1", "R2", "R3", "R4", "R6", "R7"}},
      {"any_register", {"A", "B", "R5", "R8"}},
      {"direction", {"north", "east", "south", "west"}},
      {"direction_set", {"north", "east", "south", "west", "alldir"}},
      {"number", {"1", "2", "3"}},
      {"switch", {"off"}}};
  const std::string head =
      "!include('scamp5.aps')\n!register(M, N)\nscamp5_draw_begin(R9)\nscamp5.saturation(on)\n";
  std::size_t tried = 0;
  for (const syntax::Macro& macro : library_macros({"scamp5.aps"})) {
    const bool is_instruction =
        macro.result_parameter.empty() && !macro.parameters.empty() &&
        std::ranges::all_of(macro.parameters, [&](const syntax::MacroParameter& parameter) {
          return operands.contains(parameter.kind);
        });
    if (!is_instruction || macro.name.starts_with("scamp5.")) continue;
    const auto draw_call = [&] {
      std::string call;
      for (const syntax::MacroParameter& parameter : macro.parameters) {
        const std::vector<std::string>& choice = operands.at(parameter.kind);
        call += (call.empty() ? macro.name + "(" : ", ") + choice[rng_() % choice.size()];
      }
      return call + ")\n";
    };
    ++tried;
    // Some operands are refused, because the sequence overwrites them (ScampOperands).
    std::string call = draw_call();
    for (int draw = 0; draw < 20 && !compiles(head + call); ++draw) call = draw_call();
    // The chip's where is not the language's.
    for (const std::string& masked :
         {"mask.on(M)\n" + call + "mask.off\n", "!macro_def\nwrapped\n!macro_begin\n" + call + call +
                                                    "!macro_end\nmask.on(M)\nwrapped\nmask.off\n"}) {
      const Registers initial = random_registers({"M", "N", "R1", "R2", "R3", "R4", "R5", "R6", "R7", "R8"},
                                                 {"A", "B", "C", "D", "E", "F", "NEWS"});
      const bool is_twice = masked.find("wrapped") != std::string::npos;
      check(
          head, is_twice ? call + call : call, masked, initial, [](bool m, bool) { return m; }, call);
      if (HasFatalFailure() || HasNonfatalFailure()) return;
    }
  }
  EXPECT_GT(tried, 100U);
  count_cases(2 * tried);
}

}  // namespace
}  // namespace apron::vm::test
