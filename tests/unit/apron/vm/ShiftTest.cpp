// Shifts and rotations against a cell-by-cell reference: every boundary rule, offsets within and beyond the
// array.
#include <gtest/gtest.h>

#include <cmath>
#include <limits>
#include <numeric>

#include "TestProgram.h"

namespace apron::vm::test {
namespace {

using program::BoundaryRule;

// Resolves an index on one axis by walking: reflect reverses at the edge cell, wrap re-enters on the other
// side.
int reference_index(int i, int n, BoundaryRule rule) {
  if (rule == BoundaryRule::kWrap) {
    while (i < 0) i += n;
    while (i >= n) i -= n;
  } else if (rule == BoundaryRule::kReplicate) {
    i = i < 0 ? 0 : i >= n ? n - 1 : i;
  } else if (rule == BoundaryRule::kReflect) {
    if (n == 1) return 0;
    while (i < 0 || i >= n) i = i < 0 ? -i : 2 * (n - 1) - i;
  }
  return i >= 0 && i < n ? i : -1;
}

struct Case {
  Opcode op;
  Size size;
  int dx, dy;
  BoundaryRule rule;
  bool masked;
};

void check(const Case& c, const NamedKernelTable& target, unsigned threads, std::mt19937& rng) {
  const std::size_t n = std::size_t{c.size.width} * c.size.height;
  constexpr float kValue = 7.25F;
  TestProgram b;
  const Operand y = b.reg(c.size.width, c.size.height), a = b.reg(c.size.width, c.size.height),
                mask = b.reg(c.size.width, c.size.height);
  b.add(Opcode::kBoundary, {}, b.lit(static_cast<float>(c.rule)), b.lit(kValue));
  if (c.masked) b.add(Opcode::kMaskOn, {}, mask);
  b.add(c.op, y, a, b.lit(static_cast<float>(c.dx)), b.lit(static_cast<float>(c.dy)));
  FakeHost host;
  VmOptions options;
  options.kernels = target.table;
  options.threads = threads;
  options.parallel_cells = 1;
  Vm vm(b.finish(), options, host);
  const Cells image = random_cells(n, rng), before = random_cells(n, rng);
  const Cells active = c.masked ? random_mask(n, rng) : Cells(n, 1.0F);
  write_cells(vm.plane(a.index), image);
  write_cells(vm.plane(y.index), before);
  write_cells(vm.plane(mask.index), active);
  ASSERT_EQ(vm.run(), Status::kEnded);
  const Cells after = read_cells(vm.plane(y.index));
  const int w = static_cast<int>(c.size.width), h = static_cast<int>(c.size.height);
  const BoundaryRule rule = c.op == Opcode::kRotate ? BoundaryRule::kWrap : c.rule;
  for (int row = 0; row < h; ++row)
    for (int x = 0; x < w; ++x) {
      const auto i = static_cast<std::size_t>(row * w + x);
      const int from_x = reference_index(x - c.dx, w, rule), from_y = reference_index(row - c.dy, h, rule);
      float want = rule == BoundaryRule::kValue ? kValue : 0.0F;
      if (from_x >= 0 && from_y >= 0) want = image[static_cast<std::size_t>(from_y * w + from_x)];
      if (active[i] == 0) want = before[i];
      ASSERT_TRUE(bits_equal(after[i], want))
          << target.name << " " << w << "x" << h << " by (" << c.dx << "," << c.dy << ") rule "
          << static_cast<int>(c.rule) << " masked " << c.masked << " at column " << x << " row " << row
          << ": " << after[i] << ", not " << want;
    }
}

TEST(Shift, EveryBoundaryRuleMatchesReference) {
  std::size_t checked = 0;
  std::mt19937 rng(3 + first_program_seed());
  const int kOffsets[][2] = {{0, 0},  {1, 0},   {-1, 0}, {0, 1},   {0, -1},  {1, 1},   {-2, 3},  {5, -4},
                             {16, 0}, {-16, 2}, {17, 1}, {-33, 0}, {63, -6}, {64, 64}, {-70, 9}, {150, -90}};
  for (const NamedKernelTable& target : kernel_tables())
    for (const Size size : kSizes)
      for (const auto& offset : kOffsets)
        for (const BoundaryRule rule : {BoundaryRule::kZero, BoundaryRule::kReplicate, BoundaryRule::kWrap,
                                        BoundaryRule::kReflect, BoundaryRule::kValue})
          for (const bool masked : {false, true}) {
            check({Opcode::kShift, size, offset[0], offset[1], rule, masked}, target, 1, rng);
            if (HasFatalFailure()) return;
            ++checked;
          }
  count_cases(checked);
}

TEST(Shift, RotationWrapsUnderAnyBoundaryRule) {
  std::mt19937 rng(4 + first_program_seed());
  for (const Size size : kSizes)
    for (const bool masked : {false, true})
      check({Opcode::kRotate, size, -3, 2, BoundaryRule::kValue, masked}, kernel_tables().front(), 1, rng);
}

TEST(Shift, MultithreadedMatchesReference) {
  std::mt19937 rng(5 + first_program_seed());
  for (const Size size : kSizes)
    for (const int dy : {-3, 0, 4}) {
      check({Opcode::kShift, size, 1, dy, BoundaryRule::kReflect, true}, kernel_tables().front(), 3, rng);
      check({Opcode::kShift, size, 1, dy, BoundaryRule::kZero, false}, kernel_tables().front(), 2, rng);
    }
}

// `moved` is that of a near distance with the same result.
TEST(Shift, FarRunTimeDistancesMoveAsNearOnesDo) {
  constexpr int kColumns = 5, kRows = 3;
  struct Far {
    Opcode op;
    BoundaryRule rule;
    double distance;
    int columns, rows;  // the near distances along a row and along a column
  };
  const Far cases[] = {
      {Opcode::kShift, BoundaryRule::kReplicate, -2e9, -kColumns, -kRows},
      {Opcode::kShift, BoundaryRule::kReplicate, 2e9, kColumns, kRows},
      {Opcode::kShift, BoundaryRule::kZero, -1e30, -kColumns, -kRows},
      {Opcode::kShift, BoundaryRule::kValue, 1e30, kColumns, kRows},
      {Opcode::kRotate, BoundaryRule::kZero, 1000000003.0, 3, 1},
      {Opcode::kRotate, BoundaryRule::kZero, -1000000003.0, -3, -1},
      {Opcode::kShift, BoundaryRule::kWrap, 9007199254740991.0, 1, 1},
      {Opcode::kShift, BoundaryRule::kReflect, 4000000002.0, 2, 2},  // periods 8 and 4
      {Opcode::kShift, BoundaryRule::kReflect, -4000000007.0, -7, -3},
  };
  for (const NamedKernelTable& target : kernel_tables())
    for (const Far& far : cases)
      for (const bool along_row : {true, false}) {
        TestProgram b;
        const Operand near = b.reg(kColumns, kRows), moved = b.reg(kColumns, kRows),
                      a = b.reg(kColumns, kRows), distance = b.var();
        const float columns = along_row ? static_cast<float>(far.columns) : 0.0F,
                    rows = along_row ? 0.0F : static_cast<float>(far.rows);
        b.add(Opcode::kBoundary, {}, b.lit(static_cast<float>(far.rule)), b.lit(7));
        b.add(far.op, near, a, b.lit(columns), b.lit(rows));
        b.add(far.op, moved, a, along_row ? distance : b.lit(0), along_row ? b.lit(0) : distance);
        FakeHost host;
        VmOptions options;
        options.kernels = target.table;
        Vm vm(b.finish(), options, host);
        Cells image(kColumns * kRows);
        std::iota(image.begin(), image.end(), 1.0F);
        write_cells(vm.plane(a.index), image);
        vm.variable(distance.index) = far.distance;
        ASSERT_EQ(vm.run(), Status::kEnded);
        EXPECT_EQ(read_cells(vm.plane(moved.index)), read_cells(vm.plane(near.index)))
            << target.name << " rule " << static_cast<int>(far.rule) << " by " << far.distance;
      }
}

TEST(Shift, RefusesRunTimeDistancesThatAreNotWhole) {
  const double infinity = std::numeric_limits<double>::infinity();
  for (const Opcode op : {Opcode::kShift, Opcode::kRotate})
    for (const auto& [distance, text] :
         {std::pair{infinity, "inf"}, {-infinity, "inf"}, {std::nan(""), "nan"}, {-1.5, "1.5"}}) {
      TestProgram b;
      const Operand y = b.reg(3, 3), a = b.reg(3, 3), far = b.var();
      b.add(op, y, a, b.lit(0), far);
      FakeHost host;
      Vm vm(b.finish(), {}, host);
      vm.variable(far.index) = distance;
      EXPECT_EQ(vm.run(), Status::kFailed);
      EXPECT_EQ(vm.error(),
                std::string("test.aps:1: error: the distance of a shift is a whole number, not ") + text);
    }
}

TEST(Shift, PositiveOffsetsMoveEastAndSouth) {
  TestProgram b;
  const Operand y = b.reg(3, 3), a = b.reg(3, 3);
  b.add(Opcode::kShift, y, a, b.lit(1), b.lit(0));
  FakeHost host;
  Vm vm(b.finish(), {}, host);
  write_cells(vm.plane(a.index), {1, 2, 3, 4, 5, 6, 7, 8, 9});
  vm.run();
  EXPECT_EQ(read_cells(vm.plane(y.index)), (Cells{0, 1, 2, 0, 4, 5, 0, 7, 8}));
}

}  // namespace
}  // namespace apron::vm::test
