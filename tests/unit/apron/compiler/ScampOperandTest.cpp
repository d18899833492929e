// Every instruction of scamp5.aps takes operands of the chip's kinds, and refuses each other kind and one
// operand more in one line that names it.
#include <gtest/gtest.h>

#include <fstream>
#include <map>
#include <sstream>
#include <string>
#include <string_view>
#include <vector>

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

// The sequences overwrite scratch registers, and XOR its destination, before they read these operands.
TEST(ScampOperands, RegistersThatTheSequenceOverwritesAreRefused) {
  struct Case {
    const char *line, *mnemonic, *overwritten;
  };
  for (const auto& [line, mnemonic, overwritten] :
       std::initializer_list<Case>{{"AND(R5, R0, R6)", "AND", "R0"},
                                   {"AND(R5, R6, RF)", "AND", "R0"},
                                   {"NAND(R5, R6, RP)", "NAND", "R12"},
                                   {"ANDX(R5, R12, R6)", "ANDX", "R12"},
                                   {"ANDX(R5, R6, R0)", "ANDX", "R0"},
                                   {"NANDX(R5, R0, R6)", "NANDX", "R0"},
                                   {"IMP(R5, R0, R6)", "IMP", "R0"},
                                   {"NIMP(R5, R0, R6)", "NIMP", "R0"},
                                   {"XOR(R5, R5, R6)", "XOR", "R5"},
                                   {"XOR(R5, R6, R5)", "XOR", "R5"},
                                   {"XORX(S0, S0, R6)", "XOR", "R5"},
                                   {"XOR(R0, R5, R6)", "XOR", "R0"},
                                   {"XOR(R12, R5, R6)", "XOR", "R12"},
                                   {"XOR(R5, R12, R6)", "XOR", "R12"},
                                   {"XOR(R5, R6, R0)", "XOR", "R0"},
                                   {"MUX(R5, R0, R6, R7)", "MUX", "R0"},
                                   {"MUX(R5, R6, R12, R7)", "MUX", "R12"},
                                   {"MUX(R5, R6, R7, R0)", "MUX", "R0"},
                                   {"CLR_IF(R5, R0)", "CLR_IF", "R0"}}) {
    const CompileResult result = compile_kernel(line);
    ASSERT_EQ(result.diagnostics.size(), 1U) << line;
    EXPECT_EQ(result.diagnostics[0].message,
              "the sequence of " + std::string(mnemonic) +
                  " overwrites its operand: it must be another register than " + overwritten)
        << line;
  }
  const CompileResult right = compile_kernel("AND(R5, R12, R5)\nIMP(R0, R5, R0)\nMUX(R5, R5, R6, R12)\n");
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
