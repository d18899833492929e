// Random programs leave bit-identical registers and variables whether fused or executed one instruction at a
// time, for any tile size, number of threads and instruction set.
#include <gtest/gtest.h>

#include <string>

#include "tests/unit/apron/vm/TestProgram.h"

namespace apron::vm::test {
namespace {

using program::BoundaryRule;

class RandomProgram : public TestProgram {
 public:
  RandomProgram(unsigned seed, Size size) : rng_(seed) {
    // Half of the registers are temporaries, which fusion may leave out of date at the end.
    for (int i = 0; i < kRegisters; ++i) {
      registers.push_back(reg(size.width, size.height));
      if (i >= kRegisters / 2) program.registers.back().name[0] = '$';
    }
    for (int i = 0; i < 3; ++i) variables.push_back(var(static_cast<float>(i) - 0.5F));
    for (const std::uint32_t side : {3U, 4U, 5U}) filters.push_back(make_filter(side, one_in(2) ? side : 2));
    if (one_in(2)) {
      const auto rule = static_cast<float>(rng_() % 5);
      add(Opcode::kBoundary, {}, lit(rule), lit(1.75F));
    }
    add_block(static_cast<int>(rng_() % 40) + 10, 0);
    // Read all temporaries, so that values which the program may not drop are observable.
    for (int i = kRegisters / 2; i < kRegisters; ++i)
      add(Opcode::kAdd, registers[0], registers[0], registers[i]);
  }

  std::vector<Operand> registers, variables, filters;

 private:
  static constexpr int kRegisters = 8;

  bool one_in(unsigned one_in) { return rng_() % one_in == 0; }
  Operand any_register() { return registers[rng_() % registers.size()]; }
  Operand any_literal() { return lit(static_cast<float>(static_cast<int>(rng_() % 9)) * 0.5F - 2.0F); }
  Operand any_scalar() { return one_in(2) ? variables[rng_() % variables.size()] : any_literal(); }
  Operand any_operand() { return one_in(5) ? any_scalar() : any_register(); }

  void add_block(int length, int depth) {
    for (int i = 0; i < length; ++i) add_instruction(depth);
  }

  void add_instruction(int depth) {
    switch (rng_() % 17) {
      case 16:
        return add_filter();
      case 0:
        return add_scalar_operation();
      case 1:
      case 2:
      case 3:
      case 4:
        return add_shift();
      case 5:
        return depth < 3 ? add_where(depth) : add_elementwise();
      case 6:
        return depth < 2 ? add_loop(depth) : add_elementwise();
      case 7:
        return add_other();
      case 8:
        return add_neighbours();
      default:
        return add_elementwise();
    }
  }

  void add_elementwise() {
    static const Opcode kOps[] = {
        Opcode::kCopy, Opcode::kAdd,    Opcode::kSub,    Opcode::kMul,    Opcode::kMin,  Opcode::kMax,
        Opcode::kDiv,  Opcode::kMod,    Opcode::kAbs,    Opcode::kNeg,    Opcode::kSign, Opcode::kClamp,
        Opcode::kMac,  Opcode::kSelect, Opcode::kLt,     Opcode::kLe,     Opcode::kGt,   Opcode::kGe,
        Opcode::kEq,   Opcode::kNe,     Opcode::kAnd,    Opcode::kOr,     Opcode::kXor,  Opcode::kNand,
        Opcode::kNor,  Opcode::kNot,    Opcode::kSqrt,   Opcode::kFloor,  Opcode::kCeil, Opcode::kRound,
        Opcode::kSin,  Opcode::kAtan2,  Opcode::kMin,    Opcode::kMax,    Opcode::kAdd,  Opcode::kMul,
        Opcode::kSub,  Opcode::kAdd,    Opcode::kSelect, Opcode::kSelect, Opcode::kMin,  Opcode::kMax};
    const Opcode op = kOps[rng_() % std::size(kOps)];
    const std::size_t arity = program::opcode_info(op).signature.size() - 1;
    Operand from[3] = {};
    for (std::size_t k = 0; k < arity; ++k) from[k] = any_operand();
    add(op, any_register(), from[0], from[1], from[2], !one_in(3));
  }

  void add_shift() {
    const Operand y = any_register(), a = any_register();
    if (y == a) return add_elementwise();
    static const int kFar[] = {1, 1, 1, -1, -1, -1, 0, 0, 2, -2, 3, 8, -8, 9, -17};
    const int dx = kFar[rng_() % std::size(kFar)], dy = one_in(3) ? kFar[rng_() % std::size(kFar)] : 0;
    const bool turned = one_in(2);
    add(one_in(12) ? Opcode::kRotate : Opcode::kShift, y, a, lit(static_cast<float>(turned ? dy : dx)),
        lit(static_cast<float>(turned ? dx : dy)), !one_in(3));
  }

  void add_neighbours() {
    const Operand y = any_register(), a = any_register();
    if (y == a) return add_elementwise();
    const auto op = static_cast<Opcode>(static_cast<unsigned>(Opcode::kNearSum) + rng_() % 5);
    add(op, y, a, lit(one_in(2) ? 4.0F : 8.0F), {}, !one_in(3));
  }

  Operand make_filter(std::uint32_t width, std::uint32_t height) {
    program::Filter f{"f", width, height, {}};
    for (std::uint32_t i = 0; i < width * height; ++i)
      f.coefficients.push_back(static_cast<float>(static_cast<int>(rng_() % 5)) * 0.25F - 0.5F);
    program.filters.push_back(f);
    return {program::OperandKind::kFilter, static_cast<std::uint32_t>(program.filters.size() - 1)};
  }

  // Programs modify only the last filter.
  void add_filter() {
    const Operand y = any_register(), a = any_register();
    if (y == a) return add_elementwise();
    if (one_in(6))
      add(Opcode::kFilterSet, {}, filters.back(), lit(static_cast<float>(rng_() % 5)), any_scalar());
    add(Opcode::kFilterDo, y, a, filters[rng_() % filters.size()], {}, !one_in(3));
  }

  void add_scalar_operation() {
    static const Opcode kOps[] = {Opcode::kCopy, Opcode::kAdd, Opcode::kSub, Opcode::kMul, Opcode::kMin};
    const Opcode op = kOps[rng_() % std::size(kOps)];
    add(op, variables[rng_() % variables.size()], any_scalar(),
        op == Opcode::kCopy ? Operand{} : any_scalar());
  }

  void add_where(int depth) {
    add(Opcode::kMaskPush, {}, any_register());
    add_block(static_cast<int>(rng_() % 6), depth + 1);
    if (one_in(2)) {
      add(Opcode::kMaskElse);
      add_block(static_cast<int>(rng_() % 5), depth + 1);
    }
    add(Opcode::kMaskPop);
  }

  // A counted loop; the count is a constant or a variable known only at run time.
  void add_loop(int depth) {
    const Operand counter = var();
    if (one_in(3))
      add(Opcode::kMin, counter, any_scalar(), lit(3));
    else
      add(Opcode::kCopy, counter, lit(static_cast<float>(rng_() % 5)));
    const std::size_t top = add(Opcode::kUnlessGt, {}, counter, lit(0), label(0));
    add_block(static_cast<int>(rng_() % 6) + 1, depth + 1);
    add(Opcode::kSub, counter, counter, lit(1));
    add(Opcode::kJump, {}, label(top));
    program.code[top].operands[2] = label(next_index());
  }

  void add_other() {
    switch (rng_() % 7) {
      case 0:
        add(Opcode::kMaskOn, {}, any_register());
        break;
      case 1:
        add(Opcode::kMaskOff);
        break;
      case 2:
        add(Opcode::kGlobalSum, variables[0], any_register());
        break;
      case 3:
        add(Opcode::kBoundary, {}, lit(static_cast<float>(rng_() % 5)), any_scalar());
        break;
      case 4:
        add(Opcode::kMaskPush, {}, any_scalar());
        add_elementwise();
        add(Opcode::kMaskPop);
        break;
      case 5:
        add(one_in(2) ? Opcode::kCellX : Opcode::kCellY, any_register());
        break;
      default:
        add(Opcode::kPixelSet, any_register(), lit(0), lit(0), any_scalar());
        break;
    }
  }

  std::mt19937 rng_;
};

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

// Mostly finite values: NaN propagates and hides differences.
Cells input(std::size_t n, unsigned seed, std::mt19937& rng) {
  if (rng() % 3 == 0) return random_mask(n, rng);
  if (seed % 3 == 0) return random_cells(n, rng);
  Cells cells(n);
  for (float& c : cells) c = static_cast<float>(rng() % 64) * 0.125F - 3.0F;
  return cells;
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
    write_cells(plane, input(plane.cell_count(), seed, rng));
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

#ifdef __SANITIZE_ADDRESS__
constexpr unsigned kPrograms = 45;
#else
constexpr unsigned kPrograms = 180;
#endif

TEST(Fusion, MatchesUnfusedExecution) {
  const Size kShapes[] = {{64, 64}, {1, 1}, {3, 5}, {17, 33}, {100, 7}, {16, 2}, {1, 40}, {130, 37}, {33, 9}};
  const std::vector<FusionConfig> all = fusion_configs();
  for (unsigned seed = 0; seed < kPrograms; ++seed) {
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
  for (unsigned seed = 300; seed < 330; ++seed) {
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
      write_cells(plane, input(plane.cell_count(), seed, rng));
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
