// Every instruction of scamp5.aps takes operands of the chip's kinds, and refuses each other kind and one
// operand more in one line that names it.
#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cctype>
#include <fstream>
#include <map>
#include <sstream>
#include <string>
#include <string_view>
#include <vector>

#include "apron/program/ScalarArithmetic.h"
#include "tests/unit/apron/compiler/CompileText.h"

namespace apron::compiler {
namespace {

// a: analogue register, x: one that is only read, d: digital register, r: analogue or digital register, v:
// direction, n: number, s: x or v.
struct Instruction {
  const char* mnemonic;
  std::vector<std::string> operands;  // of each overload
};

const std::vector<Instruction> kInstructions = {{"mov", {"ax", "axv"}},
                                                {"res", {"a", "aa"}},
                                                {"add", {"axx", "axxs"}},
                                                {"sub", {"axx", "axvx"}},
                                                {"neg", {"ax"}},
                                                {"abs", {"ax"}},
                                                {"div", {"ax", "aax", "aaax"}},
                                                {"divq", {"ax"}},
                                                {"diva", {"aaa"}},
                                                {"div2", {"ax"}},
                                                {"sneg", {"ax"}},
                                                {"addneg", {"axx"}},
                                                {"movx", {"axv"}},
                                                {"mov2x", {"axvv"}},
                                                {"addx", {"axxv"}},
                                                {"add2x", {"axxvv"}},
                                                {"subx", {"axvx"}},
                                                {"sub2x", {"axvvx"}},
                                                {"north", {"ax"}},
                                                {"bus", {"a", "ax", "axx", "axxx", "axxxx"}},
                                                {"bus2", {"aa", "aax", "aaxx"}},
                                                {"bus3", {"aaax"}},
                                                {"get_image", {"a", "aa"}},
                                                {"scamp5_get_image", {"aa", "aan"}},
                                                {"respix", {"", "a"}},
                                                {"getpix", {"ax", "aax"}},
                                                {"where", {"x", "xx", "xxx"}},
                                                {"WHERE", {"d", "dd", "ddd"}},
                                                {"all", {""}},
                                                {"ALL", {""}},
                                                {"MOV", {"dd"}},
                                                {"NOT", {"d", "dd"}},
                                                {"OR", {"dd", "ddd", "dddd", "ddddd"}},
                                                {"NOR", {"dd", "ddd", "dddd", "ddddd"}},
                                                {"AND", {"ddd"}},
                                                {"NAND", {"ddd"}},
                                                {"XOR", {"ddd"}},
                                                {"MUX", {"dddd"}},
                                                {"SET", {"d", "dd", "ddd", "dddd"}},
                                                {"CLR", {"d", "dd", "ddd", "dddd"}},
                                                {"PROP0", {""}},
                                                {"PROP1", {""}},
                                                {"DNEWS0", {"dd"}},
                                                {"DNEWS1", {"dd"}},
                                                {"REFRESH", {"d"}},
                                                {"scamp5_in", {"an", "ana"}},
                                                {"in", {"an"}},
                                                {"newsblur", {"ax", "axn"}},
                                                {"newsblurh", {"ax", "axn"}},
                                                {"gauss", {"ax", "axn"}},
                                                {"gaussh", {"ax", "axn"}},
                                                {"gaussv", {"ax", "axn"}},
                                                {"scamp5_diffuse", {"an", "ann", "annn", "annna"}},
                                                {"scamp5_load_in", {"n", "an", "ana"}},
                                                {"CLR_IF", {"dd"}},
                                                {"scamp5_load_pattern", {"dnnnn"}},
                                                {"scamp5_select_pattern", {"nnnn"}},
                                                {"scamp5_load_point", {"dnn"}},
                                                {"scamp5_load_rect", {"dnnnn"}},
                                                {"scamp5_flood", {"ddn", "ddnn"}},
                                                {"scamp5_shift", {"rnn", "rnnn"}},
                                                {"n = scamp5_global_or", {"d", "dnnnn"}},
                                                {"n = scamp5_global_count", {"d", "da", "dan"}},
                                                {"n = scamp5_global_sum_sparse", {"x", "xnnnn"}},
                                                {"n = scamp5_global_sum_fast", {"x"}},
                                                {"n = scamp5_global_sum_16", {"x"}},
                                                {"n = scamp5_global_sum_64", {"x"}},
                                                {"n = scamp5_read_areg", {"xnn"}},
                                                {"Own = scamp5.readout", {"x"}}};

const std::map<char, std::string> kExample = {
    {'a', "B"}, {'x', "IN"}, {'d', "S1"}, {'v', "east"}, {'n', "3"}};
const std::map<char, std::string> kDescription = {
    {'a', "an analogue register (A to F, NEWS)"},
    {'x', "an analogue register (A to F, NEWS, IN, XN, XE, XS, XW)"},
    {'d', "a digital register (R0 to R12, S0 to S6, FLAG)"},
    {'r', "an analogue register (A to F, NEWS) or a digital one (R0 to R12, S0 to S6, FLAG)"},
    {'v', "a direction (north, east, south, west)"},
    {'n', "a number"},
    {'s', "an analogue register (A to F, NEWS, IN, XN, XE, XS, XW) or a direction"}};
// The kinds of example that an operand of a kind may be.
const std::map<char, std::string> kFits = {{'a', "a"}, {'x', "ax"}, {'d', "d"},  {'r', "ad"},
                                           {'v', "v"}, {'n', "n"},  {'s', "axv"}};

std::string call(const std::string& mnemonic, const std::vector<std::string>& operands) {
  std::string text;
  for (const std::string& operand : operands) text += (text.empty() ? "" : ", ") + operand;
  return mnemonic + (operands.empty() ? "" : '(' + text + ')') + '\n';
}

// Digital operands are different registers, as XOR requires.
std::vector<std::string> examples(const std::string& kinds) {
  std::vector<std::string> operands;
  for (const char kind : kinds)
    operands.push_back(kind == 'd' ? "S" + std::to_string(operands.size() + 1)
                                   : kExample.at(kFits.at(kind).back()));
  return operands;
}

CompileResult compile_kernel(const std::string& text) {
  static const std::map<std::string, std::string> library = [] {
    std::map<std::string, std::string> files;
    for (const std::string name : {"scamp5.aps", "pix_source.aps"}) {
      std::ostringstream content;
      content << std::ifstream(std::string(APRON_SCRIPTS) + '/' + name).rdbuf();
      files["lib/" + name] = content.str();
    }
    return files;
  }();
  return compile_text("!include('scamp5.aps')\n!register(Own)\n" + text, library);
}

// Calls that are refused, compiled as many together as errors are reported.
class WrongCalls {
 public:
  void add(const std::string& line, std::string message) {
    lines_ += line;
    messages_.push_back(std::move(message));
    if (messages_.size() == syntax::kMaxErrors) check();
  }
  void check() {
    const CompileResult wrong = compile_kernel(lines_);
    ASSERT_EQ(wrong.diagnostics.size(), messages_.size()) << lines_ << errors(wrong);
    for (std::size_t i = 0; i < messages_.size(); ++i) {
      EXPECT_TRUE(wrong.diagnostics[i].message.starts_with(messages_[i])) << wrong.diagnostics[i].message;
      EXPECT_EQ(wrong.diagnostics[i].location.line, 3 + i);
    }
    lines_.clear();
    messages_.clear();
  }

 private:
  std::string lines_;
  std::vector<std::string> messages_;
};

TEST(ScampOperands, EveryKindButTheRightOneIsRefused) {
  std::string every_right_call;
  WrongCalls wrong;
  for (const Instruction& instruction : kInstructions) {
    const std::string name = instruction.mnemonic;
    const std::string bare = name.substr(name.rfind(' ') + 1);
    for (const std::string& kinds : instruction.operands) {
      every_right_call += call(name, examples(kinds));
      for (std::size_t i = 0; i < kinds.size(); ++i) {
        for (const auto& [kind, example] : kExample) {
          if (kFits.at(kinds[i]).find(kind) != std::string::npos) continue;
          std::vector<std::string> operands = examples(kinds);
          operands[i] = example;
          wrong.add(call(name, operands), "operand " + std::to_string(i + 1) + " of '" + bare + "' must be " +
                                              kDescription.at(kinds[i]) + ", not '" +
                                              (example == "S1" ? "R6" : example) + "'");
          if (HasFatalFailure()) return;
        }
      }
    }
    std::vector<std::string> too_many = examples(instruction.operands.back());
    too_many.resize(too_many.size() + 3, "B");
    wrong.add(call(name, too_many), "no macro '" + bare + "' takes ");
    if (HasFatalFailure()) return;
  }
  wrong.check();
  const CompileResult right = compile_kernel(every_right_call);
  EXPECT_TRUE(right.program) << errors(right);
}

TEST(ScampOperands, MessagesNameTheOtherKindOrTheNearestName) {
  const auto message = [](const std::string& line) { return first_line(errors(compile_kernel(line))); };
  EXPECT_EQ(message("add(A, B, R5)"),
            "main.aps:3:11: error: operand 3 of 'add' must be an analogue register (A to F, NEWS, IN, XN, "
            "XE, XS, XW), not 'R5', a "
            "digital register (R0 to R12, S0 to S6, FLAG)");
  EXPECT_EQ(message("mov(A, b)"),
            "main.aps:3:8: error: operand 2 of 'mov' must be an analogue register (A to F, NEWS, IN, XN, XE, "
            "XS, XW), not 'b'; did "
            "you mean 'B'?");
  EXPECT_EQ(
      message("add(A, B, C, D, E)"),
      "main.aps:3:1: error: no macro 'add' takes 5 arguments without a result; there is add($y, $a, $b) "
      "and add($y, $a, $b, $c)");
  EXPECT_EQ(message("DNEWS(R5, R6, up, 0)"),
            "main.aps:3:15: error: operand 3 of 'DNEWS' must be a direction (north, east, south, west) or "
            "alldir, not 'up'");
  EXPECT_EQ(
      message("scamp5_scan_events(R5, A)"),
      "main.aps:3:24: error: operand 2 of 'scamp5_scan_events' must be a register of your own, not 'A', an "
      "analogue register (A to F, NEWS)");
}

// ---- the sequences of the digital instructions ----

// Operands y, r, s, t and registers by number; of each step, the destination comes first.
struct Sequence {
  const char *mnemonic, *operands, *steps;
  bool (*formula)(bool y, bool r, bool s, bool t);
};

const std::vector<Sequence> kSequences = {
    {"AND", "yrs", "SET 0|NOT 12 r|NOT 0 s|NOR y 0 12", [](bool, bool r, bool s, bool) { return r && s; }},
    {"NAND", "yrs", "SET 0|NOT 12 r|NOT 0 s|OR y 0 12", [](bool, bool r, bool s, bool) { return !(r && s); }},
    {"ANDX", "yrs", "NOT 0 r|NOT r s|NOR y 0 r", [](bool, bool r, bool s, bool) { return r && s; }},
    {"NANDX", "yrs", "NOT 0 r|NOT r s|OR y 0 r", [](bool, bool r, bool s, bool) { return !(r && s); }},
    {"IMP", "yrs", "NOT 0 s|OR y r 0", [](bool, bool r, bool s, bool) { return r || !s; }},
    {"NIMP", "yrs", "NOT 0 s|NOR y r 0", [](bool, bool r, bool s, bool) { return !r && s; }},
    {"XOR", "yrs", "NOT 0 s|NOR y r 0|NOT 0 r|NOR r s 0|OR y y r",
     [](bool, bool r, bool s, bool) { return r != s; }},
    {"MUX", "yrst", "SET 0|MOV 12 t|MOV 0 r|MOV 12 s|MOV y 12",
     [](bool, bool r, bool s, bool t) { return r ? s : t; }},
    {"CLR_IF", "ys", "NOT 0 y|NOR y 0 s", [](bool y, bool, bool s, bool) { return y && !s; }}};

// R0 and R12, which the sequences use, and as many others as an instruction has operands.
constexpr std::array kUsed = {0, 12, 5, 6, 7, 8};
constexpr unsigned kStates = 1U << kUsed.size();
using Digital = std::array<bool, 13>;
using Choice = std::map<char, int>;  // the register of each operand

Digital digital_state(unsigned state) {
  Digital registers{};
  for (std::size_t i = 0; i < kUsed.size(); ++i)
    registers[static_cast<std::size_t>(kUsed[i])] = (state >> i & 1U) != 0;
  return registers;
}

bool wanted(const Sequence& sequence, Choice choice, const Digital& before) {
  const auto value = [&](char operand) {
    const auto found = choice.find(operand);
    return found != choice.end() && before[static_cast<std::size_t>(found->second)];
  };
  return sequence.formula(value('y'), value('r'), value('s'), value('t'));
}

// What the chip does: R12 is written where R0 is 1.
bool computed(const Sequence& sequence, const Choice& choice, Digital registers) {
  std::istringstream steps(sequence.steps);
  for (std::string step; std::getline(steps, step, '|');) {
    std::istringstream words(step);
    std::string name, word;
    words >> name;
    std::vector<std::size_t> at;
    while (words >> word)
      at.push_back(static_cast<std::size_t>(
          std::isdigit(static_cast<unsigned char>(word[0])) != 0 ? std::stoi(word) : choice.at(word[0])));
    bool any = name == "SET";
    for (std::size_t i = 1; i < at.size(); ++i) any = any || registers[at[i]];
    if (at[0] != 12 || registers[0]) registers[at[0]] = any != (name == "NOT" || name == "NOR");
  }
  return registers[static_cast<std::size_t>(choice.at('y'))];
}

// All choices of registers but those that differ in the names of R5 to R8 alone.
std::vector<Choice> choices(const std::string& operands) {
  std::vector<Choice> all{{}};
  for (const char operand : operands) {
    std::vector<Choice> longer;
    for (const Choice& choice : all) {
      int next = 5;
      for (const auto& [other, number] : choice)
        if (number != 12) next = std::max(next, number + 1);
      for (const int number : kUsed) {
        if (number != 12 && number > next) continue;
        longer.push_back(choice);
        longer.back()[operand] = number;
      }
    }
    all = longer;
  }
  return all;
}

std::string sequence_call(const Sequence& sequence, const Choice& choice) {
  std::vector<std::string> words;
  for (const char* operand = sequence.operands; *operand != 0; ++operand)
    words.push_back("R" + std::to_string(choice.at(*operand)));
  return call(sequence.mnemonic, words);
}

// The registers after a program of element-wise instructions, one cell for each state of the registers b0 to
// b5.
std::map<std::string, std::vector<double>> run_elementwise(const program::Program& program) {
  std::vector<std::vector<double>> registers(program.registers.size(), std::vector<double>(kStates)),
      variables(program.variables.size(), std::vector<double>(kStates));
  for (std::size_t i = 0; i < registers.size(); ++i)
    if (const std::string& name = program.registers[i].name; name.size() == 2 && name[0] == 'b')
      for (unsigned state = 0; state < kStates; ++state) registers[i][state] = state >> (name[1] - '0') & 1U;
  const auto cells = [&](const program::Operand& operand) -> std::vector<double> {
    if (operand.kind == program::OperandKind::kRegister) return registers[operand.index];
    if (operand.kind == program::OperandKind::kVariable) return variables[operand.index];
    return std::vector<double>(
        kStates, operand.kind == program::OperandKind::kLiteral ? program.literals[operand.index] : 0.0);
  };
  for (const program::Instruction& in : program.code) {
    if (in.op == program::Opcode::kEnd) break;
    const auto a = cells(in.operands[0]), b = cells(in.operands[1]), c = cells(in.operands[2]);
    auto& to = in.destination.kind == program::OperandKind::kRegister ? registers[in.destination.index]
                                                                      : variables[in.destination.index];
    for (unsigned state = 0; state < kStates; ++state)
      to[state] = program::evaluate_scalar(in.op, a[state], b[state], c[state]);
  }
  std::map<std::string, std::vector<double>> named;
  for (std::size_t i = 0; i < registers.size(); ++i) named[program.registers[i].name] = registers[i];
  return named;
}

// All choices of operands: those that leave a wrong y in some state of the registers are refused, the others
// leave the right one.
TEST(ScampOperands, SequencesThatWouldComputeAWrongResultAreRefused) {
  WrongCalls wrong;
  std::string declared = "!register(b0, b1, b2, b3, b4, b5)\n", lines;
  std::vector<std::pair<const Sequence*, Choice>> right;
  for (const Sequence& sequence : kSequences) {
    for (const Choice& choice : choices(sequence.operands)) {
      bool is_right = true;
      for (unsigned state = 0; state < kStates; ++state)
        is_right = is_right && computed(sequence, choice, digital_state(state)) ==
                                   wanted(sequence, choice, digital_state(state));
      if (!is_right) {
        wrong.add(sequence_call(sequence, choice), sequence.mnemonic + std::string("("));
        if (HasFatalFailure()) return;
        continue;
      }
      const std::string result = "y" + std::to_string(right.size());
      declared += "!register(" + result + ")\n";
      for (std::size_t i = 0; i < kUsed.size(); ++i)
        lines += "R" + std::to_string(kUsed[i]) + " = b" + std::to_string(i) + "\n";
      lines += sequence_call(sequence, choice) + result + " = R" + std::to_string(choice.at('y')) + "\n";
      right.emplace_back(&sequence, choice);
    }
  }
  wrong.check();
  const CompileResult result = compile_kernel(declared + lines);
  ASSERT_TRUE(result.program) << errors(result);
  const auto registers = run_elementwise(*result.program);
  for (std::size_t k = 0; k < right.size(); ++k)
    for (unsigned state = 0; state < kStates; ++state)
      ASSERT_EQ(registers.at("y" + std::to_string(k))[state] != 0.0,
                wanted(*right[k].first, right[k].second, digital_state(state)))
          << sequence_call(*right[k].first, right[k].second) << digital_state(state)[0];
}

TEST(ScampOperands, RegistersThatOtherSequencesOverwriteAreRefused) {
  for (const auto& [line, message] : std::initializer_list<std::pair<const char*, std::string>>{
           {"XORX(S0, S0, R6)",
            "XOR(y, r, s) computes in y, r and R0: y must be none of r, s, R0 and R12, r neither R0 nor R12, "
            "s "
            "not R0"},
           {"DNEWS(R5, RW, north)", "DNEWS(y, r, …) sets R1 to R4 first: r must be none of them"},
           {"scamp5_flood(R0, R5, 0)",
            "scamp5_flood(y, mask, …) computes in R0 and R12: y must not be R0, mask neither R0 nor R12"},
           {"scamp5_flood(R5, R12, 1)",
            "scamp5_flood(y, mask, …) computes in R0 and R12: y must not be R0, mask neither R0 nor R12"}}) {
    const CompileResult result = compile_kernel(line);
    ASSERT_EQ(result.diagnostics.size(), 1U) << line;
    EXPECT_EQ(result.diagnostics[0].message, message) << line;
  }
  const CompileResult right = compile_kernel("DNEWS(R1, R5, north)\nscamp5_flood(R12, R5, 0)\n");
  EXPECT_TRUE(right.program) << errors(right);
}

// Only instructions pass values between the machine's registers, a copy in a register of one's own is a
// host's read.
TEST(ScampOperands, AssignmentsBetweenRegistersOfTheChipAreRefused) {
  for (const std::string name : {"R5", "FLAG", "PIX"}) {
    EXPECT_EQ(
        first_line(errors(compile_kernel(name + " = A"))),
        "main.aps:3:" + std::to_string(name.size() + 4) + ": error: '" + name +
            "' is a register of scamp5.aps too: only instructions pass values between its registers; write "
            "where(…) or MOV(…)");
  }
  EXPECT_TRUE(compile_kernel("Own = A").program);
  EXPECT_TRUE(compile_kernel("R5 = cell.x < 3").program);
}

}  // namespace
}  // namespace apron::compiler
