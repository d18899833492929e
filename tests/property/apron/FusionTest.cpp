// Random programs leave bit-identical registers and variables whether fused or executed one instruction at a
// time, for any tile size, number of threads and instruction set.
#include <gtest/gtest.h>

#include <string>

#include "tests/property/apron/RandomProgram.h"

namespace apron::vm::test {
namespace {

struct FusionConfig {
  std::string name;
  VmOptions options;
};

std::vector<FusionConfig> fusion_configs() {
  std::vector<FusionConfig> all;
  const auto add = [&](std::string name, unsigned threads, std::uint32_t strip, std::uint32_t rows,
                       bool jit) {
    FusionConfig& way = all.emplace_back();
    way.name = std::move(name);
    way.options.threads = threads;
    way.options.parallel_cells = 1;
    way.options.fusion.strip_columns = strip;
    way.options.fusion.block_rows = rows;
    way.options.fusion.enable_jit = jit;
    return &way;
  };
  add("whole", 1, 0, 0, true);
  add("rows of 1", 1, 0, 1, true);
  add("strips of 16, rows of 3", 1, 16, 3, true);
  add("strips of 48, three threads", 3, 48, 8, true);
  add("two threads", 2, 0, 5, true);
  add("four rows at once", 1, 0, 0, true)->options.fusion.rows_per_iteration = 4;
  add("four rows at once of 7, strips of 32", 1, 32, 7, true)->options.fusion.rows_per_iteration = 4;
  add("two rows at once of 5, two threads", 2, 0, 5, true)->options.fusion.rows_per_iteration = 2;
  add("seven slices on two threads", 2, 0, 4, true)->options.fusion.slices = 7;
  add("five slices on one thread, strips of 16", 1, 16, 0, true)->options.fusion.slices = 5;
  add("tiles", 1, 0, 0, false);
  add("tiles, strips of 32, rows of 2, two threads", 2, 32, 2, false);
  add("short traces", 1, 0, 4, true)->options.fusion.max_array_instructions = 7;
  for (const InstructionSet isa :
       {InstructionSet::kPortable, InstructionSet::kAvx2, InstructionSet::kAvx512}) {
    if (!is_supported(isa)) continue;
    const std::string name(instruction_set_name(isa));
    add(name, 1, 0, 0, true)->options.isa = isa;
    FusionConfig* rows = add(name + ", two rows at once of 6, strips of 48, two threads", 2, 48, 6, true);
    rows->options.isa = isa;
    rows->options.fusion.rows_per_iteration = 2;
  }
  for (const NamedKernelTable& target : kernel_tables()) {
    FusionConfig* way = add("tiles of " + std::string(target.name), 1, 16, 7, false);
    way->options.kernels = target.table;
  }
  return all;
}

struct RunResult {
  std::vector<Cells> registers;
  Cells variables;
  std::uint64_t executed = 0;
};

RunResult run(const RandomProgram& random, const program::Program& program, const VmOptions& options,
              unsigned seed) {
  FakeHost host;
  Vm vm(program, options, host);
  std::mt19937 rng(seed);
  for (const Operand& r : random.registers) {
    const Plane plane = vm.plane(r.index);
    write_cells(plane, random_input(plane.cell_count(), seed, rng));
  }
  EXPECT_EQ(vm.run(), Status::kEnded) << vm.error();
  RunResult result;
  for (const Operand& r : random.registers) result.registers.push_back(read_cells(vm.plane(r.index)));
  for (std::size_t v = 0; v < program.variables.size(); ++v) result.variables.push_back(vm.variable(v));
  result.executed = vm.instructions_executed();
  return result;
}

void compare(const RunResult& want, const RunResult& got, const RandomProgram& random,
             const std::string& what) {
  ASSERT_EQ(want.executed, got.executed) << what;
  for (std::size_t v = 0; v < want.variables.size(); ++v)
    ASSERT_TRUE(bits_equal(want.variables[v], got.variables[v])) << what << " variable " << v;
  for (std::size_t r = 0; r < want.registers.size(); ++r) {
    const program::Register& reg = random.program.registers[random.registers[r].index];
    if (reg.name[0] == '$') continue;
    for (std::size_t i = 0; i < want.registers[r].size(); ++i)
      ASSERT_TRUE(bits_equal(want.registers[r][i], got.registers[r][i]))
          << what << " register " << reg.name << " column " << i % reg.width << " row " << i / reg.width
          << ": " << got.registers[r][i] << ", not " << want.registers[r][i];
  }
}

constexpr unsigned kPrograms = 90U;

TEST(Fusion, MatchesUnfusedExecution) {
  const Size kShapes[] = {{64, 64}, {1, 1}, {3, 5}, {17, 33}, {100, 7}, {16, 2}, {1, 40}, {130, 37}, {33, 9}};
  const std::vector<FusionConfig> all = fusion_configs();
  const auto seeds = program_seeds(kPrograms);
  for (const unsigned seed : seeds) {
    RandomProgram random(seed, kShapes[seed % std::size(kShapes)]);
    const program::Program program = random.finish();
    ASSERT_EQ(program::verify(program), "") << seed;
    VmOptions plain;
    plain.fusion.enabled = false;
    const RunResult want = run(random, program, plain, seed);
    for (const FusionConfig& way : all) {
      compare(want, run(random, program, way.options, seed), random,
              "seed " + std::to_string(seed) + ", " + way.name);
      if (HasFatalFailure()) return;
    }
  }
  count_cases(seeds.size());
}

// One value that goes to many registers, computed or not.
TEST(Fusion, OneValueInManyRegisters) {
  for (const Opcode op : {Opcode::kCopy, Opcode::kAdd, Opcode::kRound}) {
    TestProgram build;
    const Operand a = build.reg(20, 6);
    std::vector<Operand> registers;
    for (int i = 0; i < 40; ++i) {
      registers.push_back(build.reg(20, 6));
      build.add(op, registers.back(), a, op == Opcode::kAdd ? build.lit(1) : Operand{});
    }
    const program::Program program = build.finish();
    ASSERT_EQ(program::verify(program), "");
    for (const FusionConfig& way : fusion_configs()) {
      FakeHost host;
      Vm vm(program, way.options, host);
      write_cells(vm.plane(a.index), Cells(120, 2.0F));
      ASSERT_EQ(vm.run(), Status::kEnded) << vm.error();
      for (const Operand& y : registers)
        ASSERT_EQ(read_cells(vm.plane(y.index)), Cells(120, op == Opcode::kAdd ? 3.0F : 2.0F)) << way.name;
    }
  }
}

// Arrays large enough for non-temporal stores.
TEST(Fusion, MatchesUnfusedForArraysBeyondCache) {
  TestProgram build;
  const Operand a = build.reg(2100, 1400), h = build.reg(2100, 1400), y = build.reg(2100, 1400);
  for (const auto& [to, from, dx, dy] : {std::tuple{h, a, 1, 0}, {y, h, 0, 1}}) {
    build.add(Opcode::kShift, to, from, build.lit(static_cast<float>(dx)), build.lit(static_cast<float>(dy)));
    build.add(Opcode::kAdd, to, to, from);
  }
  build.program.registers[h.index].name[0] = '$';
  const program::Program program = build.finish();
  ASSERT_EQ(program::verify(program), "");
  std::vector<Cells> results;
  for (const bool fused : {false, true}) {
    FakeHost host;
    VmOptions options;
    options.fusion.enabled = fused;
    Vm vm(program, options, host);
    std::mt19937 rng(5);
    const Plane plane = vm.plane(a.index);
    for (std::uint32_t row = 0; row < plane.height; ++row)
      for (std::uint32_t x = 0; x < plane.width; ++x) plane.row(row)[x] = static_cast<float>(rng() % 64);
    ASSERT_EQ(vm.run(), Status::kEnded) << vm.error();
    results.push_back(read_cells(vm.plane(y.index)));
  }
  EXPECT_EQ(results[0], results[1]);
}

// The budget counts instructions and a stepping debugger sees each one, so a fused trace neither exceeds the
// budget nor is entered in the middle.
TEST(Fusion, BudgetMayEndAnywhere) {
  for (const unsigned seed : program_seeds(30)) {
    RandomProgram random(seed, {20, 6});
    const program::Program program = random.finish();
    VmOptions plain;
    plain.fusion.enabled = false;
    const RunResult want = run(random, program, plain, seed);
    FakeHost host;
    Vm vm(program, {}, host);
    std::mt19937 rng(seed);
    for (const Operand& r : random.registers) {
      const Plane plane = vm.plane(r.index);
      write_cells(plane, random_input(plane.cell_count(), seed, rng));
    }
    std::uint64_t done = 0, budget = 1 + seed % 5;
    for (Status status = Status::kRunning; status == Status::kRunning;
         done += budget, budget = 1 + (budget * 7) % 90) {
      ASSERT_EQ(vm.instructions_executed(), done);
      status = vm.run(budget);
    }
    RunResult got;
    for (const Operand& r : random.registers) got.registers.push_back(read_cells(vm.plane(r.index)));
    for (std::size_t v = 0; v < program.variables.size(); ++v) got.variables.push_back(vm.variable(v));
    got.executed = vm.instructions_executed();
    compare(want, got, random, "seed " + std::to_string(seed));
    if (HasFatalFailure()) return;
  }
}

}  // namespace
}  // namespace apron::vm::test
