// Base mask and nested where: random sequences against a simple model of the active cells.
#include <gtest/gtest.h>

#include "TestProgram.h"

namespace apron::vm::test {
namespace {

struct MaskModel {
  using CellMask = std::vector<char>;
  std::size_t cells;
  CellMask base;
  struct Level {
    CellMask outer, condition;
  };
  std::vector<Level> levels;

  explicit MaskModel(std::size_t n) : cells(n), base(n, 1) {}
  CellMask top() const {
    CellMask on(cells, 1);
    if (!levels.empty())
      for (std::size_t i = 0; i < cells; ++i) on[i] = levels.back().outer[i] && levels.back().condition[i];
    return on;
  }
  CellMask active() const {
    CellMask on = top();
    for (std::size_t i = 0; i < cells; ++i) on[i] = on[i] && base[i];
    return on;
  }
  void push(CellMask condition) { levels.push_back({top(), std::move(condition)}); }
  void invert() {
    for (char& c : levels.back().condition) c = !c;
  }
};

TEST(Mask, RandomNestingMatchesModel) {
  const Size size{17, 5};
  const std::size_t n = 85;
  const auto seeds = program_seeds(200);
  for (const unsigned seed : seeds) {
    std::mt19937 rng(seed);
    TestProgram b;
    const Operand y = b.reg(size.width, size.height), by = b.lit(1);
    std::vector<Operand> conditions;
    std::vector<Cells> values;
    for (int k = 0; k < 4; ++k) {
      conditions.push_back(b.reg(size.width, size.height));
      values.push_back(random_mask(n, rng));
    }
    MaskModel model(n);
    Cells want(n, 0.0F);
    const auto bits = [&](std::size_t k) {
      MaskModel::CellMask on(n);
      for (std::size_t i = 0; i < n; ++i) on[i] = values[k][i] != 0;
      return on;
    };
    for (int i = 0; i < 40; ++i) {
      const std::size_t k = rng() % 4;
      switch (rng() % 7) {
        case 0:
          b.add(Opcode::kMaskOn, {}, conditions[k]), model.base = bits(k);
          break;
        case 1:
          b.add(Opcode::kMaskOff), model.base.assign(n, 1);
          break;
        case 2:
          b.add(Opcode::kMaskPush, {}, conditions[k]), model.push(bits(k));
          break;
        case 3:
          b.add(Opcode::kMaskPush, {}, b.lit(k < 2 ? 2.0F : 0.0F)), model.push(MaskModel::CellMask(n, k < 2));
          break;
        case 4:
          if (!model.levels.empty()) b.add(Opcode::kMaskElse), model.invert();
          break;
        case 5:
          if (!model.levels.empty()) b.add(Opcode::kMaskPop), model.levels.pop_back();
          break;
        default:
          break;
      }
      b.add(Opcode::kAdd, y, y, by);
      const MaskModel::CellMask on = model.active();
      for (std::size_t c = 0; c < n; ++c) want[c] += on[c] ? 1.0F : 0.0F;
    }
    FakeHost host;
    Vm vm(b.finish(), {}, host);
    for (std::size_t k = 0; k < 4; ++k) write_cells(vm.plane(conditions[k].index), values[k]);
    ASSERT_EQ(vm.run(), Status::kEnded);
    ASSERT_EQ(read_cells(vm.plane(y.index)), want) << "seed " << seed;
  }
  count_cases(seeds.size());
}

TEST(Mask, MaskOnCopiesTheRegister) {
  TestProgram b;
  const Operand y = b.reg(2, 1), m = b.reg(2, 1);
  b.add(Opcode::kMaskOn, {}, m);
  b.add(Opcode::kCopy, m, b.lit(1), {}, {}, false);
  b.add(Opcode::kCopy, y, b.lit(5));
  FakeHost host;
  Vm vm(b.finish(), {}, host);
  write_cells(vm.plane(m.index), {0, 1});
  ASSERT_EQ(vm.run(), Status::kEnded);
  EXPECT_EQ(read_cells(vm.plane(y.index)), (Cells{0, 5}));
  EXPECT_EQ(read_cells(vm.plane(m.index)), (Cells{1, 1}));  // unmasked writes ignore the mask
}

TEST(Mask, AppliesToCoordinatesPixelsAndHostReads) {
  TestProgram b;
  const Operand x = b.reg(2, 2), row = b.reg(2, 2), p = b.reg(2, 2), s = b.reg(2, 2), m = b.reg(2, 2);
  b.add(Opcode::kMaskPush, {}, m);
  b.add(Opcode::kCellX, x);
  b.add(Opcode::kCellY, row);
  b.add(Opcode::kPixelSet, p, b.lit(0), b.lit(0), b.lit(9));
  b.add(Opcode::kPixelSet, p, b.lit(1), b.lit(1), b.lit(9));
  b.add(Opcode::kSurfaceSense, s, b.text("proximity"));
  b.add(Opcode::kMaskPop);
  FakeHost host;
  host.sensors["proximity"] = {1, 2, 3, 4};
  Vm vm(b.finish(), {}, host);
  write_cells(vm.plane(m.index), {0, 1, 0, 1});
  ASSERT_EQ(vm.run(), Status::kEnded);
  EXPECT_EQ(read_cells(vm.plane(x.index)), (Cells{0, 1, 0, 1}));
  EXPECT_EQ(read_cells(vm.plane(row.index)), (Cells{0, 0, 0, 1}));
  EXPECT_EQ(read_cells(vm.plane(p.index)), (Cells{0, 0, 0, 9}));
  EXPECT_EQ(read_cells(vm.plane(s.index)), (Cells{0, 2, 0, 4}));
}

TEST(Mask, RejectsDestinationOfAnotherSize) {
  TestProgram b;
  const Operand small = b.reg(2, 2), large = b.reg(4, 4);
  b.add(Opcode::kMaskOn, {}, small);
  b.add(Opcode::kCopy, large, b.lit(1));
  FakeHost host;
  Vm vm(b.finish(), {}, host);
  write_cells(vm.plane(small.index), {1, 1, 1, 1});
  EXPECT_EQ(vm.run(), Status::kFailed);
  EXPECT_EQ(vm.error(),
            "test.aps:2: error: the mask in force is 2x2, but the instruction writes a register of 4x4");
}

TEST(Mask, RejectsBaseMaskOfAnotherSizeThanOuterWhere) {
  TestProgram b;
  const Operand small = b.reg(2, 2), large = b.reg(4, 4);
  b.add(Opcode::kMaskPush, {}, small);
  b.add(Opcode::kMaskPush, {}, b.lit(0));
  b.add(Opcode::kMaskOn, {}, large);
  b.add(Opcode::kMaskPop);
  b.add(Opcode::kMaskPop);
  FakeHost host;
  Vm vm(b.finish(), {}, host);
  EXPECT_EQ(vm.run(), Status::kFailed);
  EXPECT_NE(vm.error().find("test.aps:3: error: "), std::string::npos) << vm.error();
}

}  // namespace
}  // namespace apron::vm::test
