// Every element-wise instruction has one value: folded by the compiler, executed on scalars, executed on
// registers by the kernels of each instruction set, and by generated code.
#include <fmt/format.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <bit>
#include <cmath>
#include <random>
#include <string>
#include <vector>

#include "apron/compiler/Builtins.h"
#include "apron/program/ScalarArithmetic.h"
#include "tests/unit/apron/compiler/CompileText.h"
#include "tests/unit/apron/vm/TestProgram.h"

namespace apron::vm::test {
namespace {

constexpr std::size_t kTriples = 400;

// The values at which definitions differ: zeros, halves, denormals, the ends of exactness, infinities, NaN.
// The square root of 281475010265089 is 16777217, which is no 32-bit float.
constexpr double kSpecial[] = {0.0,
                               -0.0,
                               0.5,
                               -0.5,
                               1.5,
                               -1.5,
                               2.5,
                               -2.5,
                               0x1.fffffep-2,
                               1.0,
                               -1.0,
                               3.0,
                               -7.0,
                               0x1p-149,
                               -0x1.8p-130,
                               0x1p-126,
                               16777215.0,
                               16777216.0,
                               16777217.0,
                               -16777217.0,
                               8388609.0,
                               281475010265089.0,
                               9007199254740991.0,
                               9007199254740992.0,
                               0x1.fffffep127,
                               INFINITY,
                               -INFINITY,
                               NAN};

// A value that a scalar can have.
double random_scalar(std::mt19937& rng) {
  const auto uniform = [&](double low, double high) {
    return std::uniform_real_distribution<double>(low, high)(rng);
  };
  switch (rng() % 5) {
    case 0:
    case 1:
      return kSpecial[rng() % std::size(kSpecial)];
    case 2:
      return static_cast<float>(uniform(-4.0, 4.0));
    case 3:
      return std::trunc(uniform(-1e9, 1e9));
    default:
      return std::bit_cast<float>(static_cast<std::uint32_t>(rng()));
  }
}

struct Triple {
  double value[3];
};

std::vector<Triple> random_triples(unsigned seed) {
  std::mt19937 rng(seed);
  std::vector<Triple> all(kTriples);
  for (Triple& triple : all)
    for (double& value : triple.value) value = random_scalar(rng);
  for (std::size_t i = 0; i < std::size(kSpecial); ++i) all[i].value[0] = kSpecial[i];
  return all;
}

// The number in the language's own terms, which the compiler folds.
std::string source_text(double value) {
  if (std::isnan(value)) return "(0 / 0)";
  if (std::isinf(value)) return value > 0 ? "(1 / 0)" : "(-1 / 0)";
  return std::signbit(value) ? fmt::format("(-{})", -value) : fmt::format("{}", value);
}

struct Operation {
  Opcode op;
  std::size_t arity;
  std::string name;  // in the language
};

std::vector<Operation> elementwise_operations() {
  std::vector<Operation> all;
  for (std::size_t i = 0; i < program::opcode_count(); ++i) {
    const auto op = static_cast<Opcode>(i);
    const program::OpcodeInfo& info = program::opcode_info(op);
    if (info.signature.front() != 'D') continue;
    std::string name(info.mnemonic);
    if (compiler::find_builtin(name) == nullptr) name = "math." + name;
    all.push_back({op, info.signature.size() - 1, name});
  }
  return all;
}

bool same_number(double a, double b) {
  return (std::isnan(a) && std::isnan(b)) ||
         std::bit_cast<std::uint64_t>(a) == std::bit_cast<std::uint64_t>(b);
}

std::string describe(const Operation& operation, const Triple& triple) {
  std::string text = operation.name;
  for (std::size_t k = 0; k < operation.arity; ++k) text += fmt::format(" {}", triple.value[k]);
  return text;
}

program::Program compile(const std::string& text) {
  const compiler::CompileResult result = compiler::compile_text(text);
  EXPECT_TRUE(result.program) << compiler::errors(result);
  return result.program.value_or(program::Program{});
}

std::size_t index_of(const auto& named, const std::string& name) {
  const auto found = std::ranges::find(named, name, [](const auto& one) { return one.name; });
  return static_cast<std::size_t>(found - named.begin());
}

// y<i> is computed from variables when the program runs, z<i> from numbers in the source.
TEST(ElementwiseAgreement, FoldedAndRun) {
  const std::vector<Triple> triples = random_triples(11 + first_program_seed());
  std::size_t compared = 0;
  for (const Operation& operation : elementwise_operations()) {
    std::string source;
    for (std::size_t i = 0; i < triples.size(); ++i) {
      std::string variables, numbers;
      for (std::size_t k = 0; k < operation.arity; ++k) {
        source += fmt::format("v{} = {}\n", k, source_text(triples[i].value[k]));
        variables += fmt::format(", v{}", k);
        numbers += ", " + source_text(triples[i].value[k]);
      }
      source += fmt::format("y{0} = {1}({2})\nz{0} = {1}({3})\n", i, operation.name, variables.substr(2),
                            numbers.substr(2));
    }
    const program::Program program = compile(source);
    const bool folds = std::ranges::none_of(program.code, [&](const program::Instruction& in) {
      return in.op == operation.op && in.operands[0].kind == OperandKind::kLiteral &&
             operation.op != Opcode::kCopy;
    });
    EXPECT_TRUE(folds) << operation.name;
    FakeHost host;
    Vm vm(program, {}, host);
    ASSERT_EQ(vm.run(), Status::kEnded) << vm.error();
    for (std::size_t i = 0; i < triples.size(); ++i) {
      const double run = vm.variable(index_of(program.variables, fmt::format("y{}", i)));
      const double folded = vm.variable(index_of(program.variables, fmt::format("z{}", i)));
      ASSERT_TRUE(same_number(run, folded))
          << describe(operation, triples[i]) << ": run " << fmt::format("{}, folded {}", run, folded);
      ++compared;
    }
  }
  count_cases(compared);
}

struct Config {
  std::string name;
  VmOptions options;
};

std::vector<Config> configs() {
  std::vector<Config> all;
  for (const NamedKernelTable& target : kernel_tables()) {
    Config& config = all.emplace_back();
    config.name = std::string(target.name) + ", one instruction at a time";
    config.options.kernels = target.table;
    config.options.fusion.enabled = false;
  }
  for (const InstructionSet isa : {InstructionSet::kPortable, InstructionSet::kAvx2, InstructionSet::kAvx512})
    for (const bool jit : {false, true}) {
      if (!is_supported(isa)) continue;
      Config& config = all.emplace_back();
      config.name = std::string(instruction_set_name(isa)) + (jit ? ", generated code" : ", fused tiles");
      config.options.isa = isa;
      config.options.fusion.enable_jit = jit;
    }
  return all;
}

// Where no value exceeds the whole numbers of a 32-bit float, scalars and cells have the same value.
bool is_small(const Triple& triple, std::size_t arity) {
  return std::all_of(triple.value, triple.value + arity,
                     [](double value) { return !std::isfinite(value) || std::fabs(value) <= 2048.0; });
}

// The second line reads the result of the first beyond its own cell, so that generated code computes it in a
// stage of its own, in the widest vectors.
TEST(ElementwiseAgreement, ScalarsKernelsAndGeneratedCode) {
  const std::vector<Triple> triples = random_triples(12 + first_program_seed());
  const std::vector<Config> all = configs();
  std::size_t compared = 0;
  for (const Operation& operation : elementwise_operations()) {
    static constexpr std::string_view kOperands[] = {"A", "A, B", "A, B, C"};
    std::string source;
    for (const char name : {'A', 'B', 'C', 'Y', 'Z'})
      source += fmt::format("!create('{}', REGISTER, {}, 2)\n", name, kTriples / 2);
    source += fmt::format("!define(A, r[A])\n!define(B, r[B])\n!define(C, r[C])\n");
    source += fmt::format("r[Y] = {}({})\nr[Z] = r[Y] + north(r[Y])\n", operation.name,
                          kOperands[operation.arity - 1]);
    const program::Program program = compile(source);
    Cells expected;
    for (const Config& config : all) {
      FakeHost host;
      Vm vm(program, config.options, host);
      for (std::size_t k = 0; k < 3; ++k) {
        Cells cells;
        for (const Triple& triple : triples) cells.push_back(static_cast<float>(triple.value[k]));
        write_cells(vm.plane(index_of(program.registers, std::string(1, "ABC"[k]))), cells);
      }
      ASSERT_EQ(vm.run(), Status::kEnded) << vm.error();
      const Cells cells = read_cells(vm.plane(index_of(program.registers, "Y")));
      if (expected.empty()) expected = cells;
      compared += cells.size();
      for (std::size_t i = 0; i < triples.size(); ++i) {
        ASSERT_TRUE(bits_equal(cells[i], expected[i]))
            << config.name << ": " << describe(operation, triples[i]) << " = " << cells[i] << ", and "
            << all.front().name << ": " << expected[i];
        if (!is_small(triples[i], operation.arity)) continue;
        const auto& [a, b, c] = triples[i].value;
        const auto scalar = static_cast<float>(program::evaluate_scalar(operation.op, a, b, c));
        ASSERT_TRUE(bits_equal(cells[i], scalar)) << config.name << ": " << describe(operation, triples[i])
                                                  << " = " << cells[i] << ", and of scalars " << scalar;
      }
    }
  }
  count_cases(compared);
}

}  // namespace
}  // namespace apron::vm::test
