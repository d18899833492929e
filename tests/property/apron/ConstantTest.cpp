// Constants of directives and arguments have the values that the same expressions have when the program runs.
#include "apron/syntax/Constant.h"

#include <fmt/format.h>
#include <gtest/gtest.h>

#include <bit>
#include <cmath>
#include <optional>
#include <random>
#include <string>
#include <vector>

#include "apron/program/ScalarArithmetic.h"
#include "apron/syntax/Lexer.h"
#include "tests/unit/apron/compiler/CompileText.h"
#include "tests/unit/apron/vm/TestProgram.h"

namespace apron::vm::test {
namespace {

// An expression of numbers, and the same of variables that have them.
struct Drawn {
  std::string numbers, variables, assignments;
};

class ExpressionSource {
 public:
  explicit ExpressionSource(unsigned seed) : random_(seed) {}

  Drawn draw() {
    Drawn drawn;
    add(drawn, static_cast<int>(random_() % 4));
    return drawn;
  }

 private:
  void add(Drawn& to, int depth) {
    static const std::vector<std::string> kOperators = {
        "+",  "-",  "*",  "/",  "%",   "&",    "|",   "^",  "<<",  ">>", "<", ">",
        "<=", ">=", "==", "!=", "and", "nand", "xor", "or", "nor", "&&", "||"};
    static const std::vector<std::string> kPrefixes = {"-", "+", "~", "!", "not "};
    if (depth == 0) return add_number(to);
    switch (random_() % 5) {
      case 0:
        write(to, kPrefixes[random_() % kPrefixes.size()]);
        return add(to, depth - 1);
      case 1:
        write(to, "(");
        add(to, depth - 1);
        return write(to, ")");
      default:
        add(to, depth - 1);
        write(to, " " + kOperators[random_() % kOperators.size()] + " ");
        add(to, static_cast<int>(random_() % depth));
    }
  }

  void add_number(Drawn& to) {
    static const std::vector<std::string> kNumbers = {"0",
                                                      "1",
                                                      "2",
                                                      "3",
                                                      "5",
                                                      "6",
                                                      "7",
                                                      "31",
                                                      "64",
                                                      "255",
                                                      "0x0F",
                                                      "0.5",
                                                      "0.1",
                                                      "1e-3",
                                                      "16777217",
                                                      "3e9",
                                                      "9007199254740991"};
    const std::string number = kNumbers[random_() % (random_() % 3 == 0 ? kNumbers.size() : 9)];
    to.assignments += fmt::format("v{} = {}\n", count_, number);
    to.numbers += number;
    to.variables += fmt::format("v{}", count_++);
  }

  static void write(Drawn& to, const std::string& text) {
    to.numbers += text;
    to.variables += text;
  }

  std::mt19937 random_;
  int count_ = 0;
};

std::optional<double> constant(const std::string& text) {
  syntax::SourceManager sources;
  syntax::Diagnostics diagnostics;
  // A line that begins with '!' is a directive.
  syntax::Tokens tokens =
      syntax::lex(sources, sources.add_file("", "y " + text, {}), diagnostics).front().tokens;
  tokens.erase(tokens.begin());
  const auto value = syntax::evaluate_constant(tokens, {}, diagnostics);
  return value ? std::optional(value->number) : std::nullopt;
}

TEST(Constants, HaveTheValuesOfTheRunningProgram) {
  std::size_t compared = 0, refused = 0;
  for (const unsigned seed : program_seeds(2000)) {
    const Drawn drawn = ExpressionSource(seed).draw();
    const std::optional<double> value = constant(drawn.numbers);
    const std::string function = "function y = g(number n)\ny = n\nendfunction\n";
    if (!value) {  // two readings, a chain of comparisons, bits of a fraction
      ++refused;
      EXPECT_FALSE(compiler::compile_text("y = " + drawn.numbers + "\n").program) << drawn.numbers;
      EXPECT_FALSE(compiler::compile_text(function + "y = g(" + drawn.numbers + ")\n").program)
          << drawn.numbers;
      continue;
    }
    const compiler::CompileResult result = compiler::compile_text(
        function + "function y = next_is_0(number n)\ny = not n + 1\nendfunction\n" + drawn.assignments +
        "y = " + drawn.variables + "\nz = g(" + drawn.numbers + ")\nt = next_is_0(" + drawn.numbers + ")\n");
    ASSERT_TRUE(result.program) << drawn.numbers << '\n' << compiler::errors(result);
    FakeHost host;
    Vm vm(*result.program, {}, host);
    ASSERT_EQ(vm.run(), Status::kEnded) << vm.error();
    for (std::size_t i = 0; i < result.program->variables.size(); ++i) {
      const std::string& name = result.program->variables[i].name;
      const double run = vm.variable(i);
      if (name == "t") {
        EXPECT_EQ(run, program::to_scalar(*value + 1.0) == 0.0) << drawn.numbers;
      }
      if (name != "y" && name != "z") continue;
      EXPECT_TRUE(std::bit_cast<std::uint64_t>(run) == std::bit_cast<std::uint64_t>(*value) ||
                  (std::isnan(run) && std::isnan(*value)))
          << drawn.numbers << ": " << name << " is " << run << ", the constant " << *value;
      ++compared;
    }
  }
  EXPECT_GT(compared, 10 * refused);
  count_cases(compared);
}

}  // namespace
}  // namespace apron::vm::test
