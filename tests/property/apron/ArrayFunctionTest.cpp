// A function of arrays gives in each of its calls what a new virtual machine gives, whatever the calls before
// were.
#include "apron/library/ArrayFunction.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <random>
#include <string>

#include "common/error/UserError.h"
#include "tests/property/apron/RandomProgram.h"

namespace apron::library {
namespace {

using vm::test::bits_equal;
using vm::test::Cells;
using vm::test::Opcode;
using vm::test::RandomProgram;
using vm::test::read_cells;
using vm::test::TestProgram;
using vm::test::write_cells;

constexpr unsigned kCalls = 3;

std::vector<std::uint32_t> named_registers(const program::Program& program) {
  std::vector<std::uint32_t> registers;
  for (std::uint32_t i = 0; i < program.registers.size(); ++i)
    if (!program::is_temporary(program.registers[i].name)) registers.push_back(i);
  return registers;
}

// The cells that call number `call` gives to its inputs; empty for registers that get none.
std::vector<Cells> inputs_of(const program::Program& program, unsigned seed, unsigned call) {
  std::mt19937 rng(seed * kCalls + call);
  std::vector<Cells> inputs(program.registers.size());
  for (const std::uint32_t reg : named_registers(program))
    if (rng() % 4 != 0)
      inputs[reg] = vm::test::random_input(
          std::size_t{program.registers[reg].width} * program.registers[reg].height, seed, rng);
  return inputs;
}

std::vector<Cells> run_plainly(const program::Program& program, const std::vector<Cells>& inputs,
                               std::vector<double>& variables) {
  vm::test::FakeHost host;
  vm::VmOptions plain;
  plain.fusion.enabled = false;
  vm::Vm vm(program, plain, host);
  for (std::size_t r = 0; r < inputs.size(); ++r)
    if (!inputs[r].empty()) write_cells(vm.plane(r), inputs[r]);
  EXPECT_EQ(vm.run(), vm::Status::kEnded) << vm.error();
  std::vector<Cells> cells;
  for (const std::uint32_t reg : named_registers(program)) cells.push_back(read_cells(vm.plane(reg)));
  for (std::size_t v = 0; v < program.variables.size(); ++v) variables.push_back(vm.variable(v));
  return cells;
}

Cells cells_of(const vm::ConstPlane& plane) {
  Cells cells;
  for (std::uint32_t y = 0; y < plane.height; ++y)
    cells.insert(cells.end(), plane.row(y), plane.row(y) + plane.width);
  return cells;
}

void expect_equal(const Cells& want, const Cells& got, const std::string& what) {
  ASSERT_EQ(want.size(), got.size());
  for (std::size_t i = 0; i < want.size(); ++i)
    ASSERT_TRUE(bits_equal(want[i], got[i]))
        << what << " cell " << i << ": " << got[i] << ", not " << want[i];
}

void check_calls(const program::Program& program, const FunctionOptions& options, unsigned seed,
                 bool takes_blocks) {
  ArrayFunction function(program, options, {});
  const FunctionSignature signature = find_signature(program);
  for (unsigned call = 0; call < kCalls; ++call) {
    const std::string what = "seed " + std::to_string(seed) + ", call " + std::to_string(call);
    const std::vector<Cells> inputs = inputs_of(program, seed, call);
    std::vector<double> variables;
    const std::vector<Cells> want = run_plainly(program, inputs, variables);
    std::vector<SharedBlock> bound;
    function.start({});
    for (std::uint32_t r = 0; r < inputs.size(); ++r) {
      if (inputs[r].empty()) continue;
      const SharedBlock block =
          bound.emplace_back(acquire_block(program.registers[r].width, program.registers[r].height));
      write_cells(block->plane(), inputs[r]);
      if (!takes_blocks || !function.bind_input(r, *block)) write_cells(function.input(r), inputs[r]);
    }
    const auto is_written = [&](std::uint32_t reg) { return std::ranges::count(signature.outputs, reg) > 0; };
    std::vector<SharedBlock> results(options.results.size());
    for (std::size_t i = 0; i < results.size() && takes_blocks && call % 2 == 1; ++i) {
      const program::Register& reg = program.registers[options.results[i]];
      const SharedBlock block = acquire_block(reg.width, reg.height);
      write_cells(block->plane(), Cells(block->plane().cell_count(), 77.0F));
      if (is_written(options.results[i]) && function.bind_result(options.results[i], *block))
        results[i] = block;
      EXPECT_FALSE(results[i] && function.bind_result(options.results[0], *block)) << "one block twice";
    }
    while (function.advance()) {
    }
    for (std::size_t i = 0; i < options.results.size(); ++i) {
      const Cells got = results[i] ? read_cells(results[i]->plane())
                        : takes_blocks && is_written(options.results[i])
                            ? read_cells(function.take_result(options.results[i])->plane())
                            : cells_of(function.result(options.results[i]));
      expect_equal(want[i], got, what + " " + program.registers[options.results[i]].name);
      if (testing::Test::HasFatalFailure()) return;
    }
    for (std::size_t v = 0; v < variables.size(); ++v)
      ASSERT_TRUE(bits_equal(static_cast<float>(variables[v]), static_cast<float>(function.variable(v))))
          << what;
    function.finish();
    for (std::size_t r = 0, next = 0; r < inputs.size(); ++r)  // arguments are never changed
      if (!inputs[r].empty()) expect_equal(inputs[r], read_cells(bound[next++]->plane()), what + " argument");
  }
}

TEST(ArrayFunction, CallsEqualNewMachines) {
  const vm::test::Size kShapes[] = {{64, 64}, {1, 1}, {3, 5}, {17, 33}, {16, 2}, {130, 37}, {32, 9}};
  const auto seeds = program_seeds(120);
  for (const unsigned seed : seeds) {
    RandomProgram random(seed, kShapes[seed % std::size(kShapes)]);
    const program::Program program = random.finish();
    FunctionOptions options;
    options.results = named_registers(program);
    options.threads = seed % 5 == 0 ? 2 : 1;
    check_calls(program, options, seed, seed % 2 == 0);
    if (HasFatalFailure()) return;
  }
  count_cases(seeds.size());
}

// Masks, routines, stacks and filters that a run leaves behind do not reach the next one.
TEST(ArrayFunction, AFailureLeavesNothingBehind) {
  TestProgram build;
  const auto a = build.reg(16, 4), y = build.reg(16, 4), n = build.var(1);
  build.program.filters.push_back({"k", 3, 3, std::vector<float>(9, 0.5F)});
  const vm::test::Operand k{vm::test::OperandKind::kFilter, 0};
  build.add(Opcode::kFilterDo, y, a, k);
  build.add(Opcode::kFilterSet, {}, k, build.lit(4), build.lit(9));
  build.add(Opcode::kAdd, n, n, build.lit(1));
  build.add(Opcode::kMaskOn, {}, a);
  build.add(Opcode::kStackPush, {}, a);
  build.add(Opcode::kRandomFloat, y, build.lit(0), build.lit(1));
  build.add(Opcode::kPixelGet, n, a, build.lit(99), build.lit(0));  // fails
  const program::Program program = build.finish();
  ASSERT_EQ(program::verify(program), "");
  FunctionOptions options;
  options.results = {a.index, y.index};
  ArrayFunction function(program, options, {});
  for (int call = 0; call < 300; ++call) {  // more than the stack holds
    function.start({});
    write_cells(function.input(a.index), Cells(64, 1.0F));
    try {
      while (function.advance()) {
      }
      FAIL() << "must fail";
    } catch (const common::UserError& error) {
      ASSERT_NE(std::string(error.what()).find("test.aps:7: "), std::string::npos) << error.what();
    }
    function.finish();
    ASSERT_EQ(function.variable(n.index), 2.0);
    ASSERT_LT(function.result(y.index).row(1)[1], 1.0F);
  }
}

}  // namespace
}  // namespace apron::library
