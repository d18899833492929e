// Random numbers: known answers of Philox, and independence of threads, masks and array size.
#include "apron/vm/kernels/Random.h"

#include <gtest/gtest.h>

#include "tests/unit/apron/vm/TestProgram.h"

namespace apron::vm::test {
namespace {

// Known answers from Random123, the authors' library.
TEST(Random, MatchesPhiloxKnownAnswers) {
  EXPECT_EQ(philox({0, 0, 0, 0}, {0, 0}), (RandomWords{0x6627e8d5, 0xe169c58d, 0xbc57ac4c, 0x9b00dbd8}));
  EXPECT_EQ(philox({0xffffffff, 0xffffffff, 0xffffffff, 0xffffffff}, {0xffffffff, 0xffffffff}),
            (RandomWords{0x408f276d, 0x41c83b0e, 0xa20bc7c6, 0x6d5451fd}));
  EXPECT_EQ(philox({0x243f6a88, 0x85a308d3, 0x13198a2e, 0x03707344}, {0xa4093822, 0x299f31d0}),
            (RandomWords{0xd16cfe09, 0x94fdcceb, 0x5001e420, 0x24126ea1}));
}

Cells random_numbers(Size size, unsigned threads, Opcode op) {
  TestProgram b;
  const Operand y = b.reg(size.width, size.height), v = b.var();
  b.add(Opcode::kRandomSeed, {}, b.lit(3));
  b.add(op, v, b.lit(-2), b.lit(5));
  b.add(op, y, b.lit(-2), b.lit(5));
  FakeHost host;
  VmOptions options;
  options.threads = threads;
  options.parallel_cells = 1;
  Vm vm(b.finish(), options, host);
  EXPECT_EQ(vm.run(), Status::kEnded);
  Cells cells = read_cells(vm.plane(0));
  cells.push_back(vm.variable(0));
  return cells;
}

TEST(Random, IndependentOfThreadsAndArraySize) {
  for (const Opcode op : {Opcode::kRandomFloat, Opcode::kRandomGauss, Opcode::kRandomInt}) {
    const Cells one = random_numbers({40, 30}, 1, op), three = random_numbers({40, 30}, 3, op),
                small = random_numbers({7, 5}, 2, op);
    ASSERT_EQ(one.size(), three.size());
    for (std::size_t i = 0; i < one.size(); ++i) ASSERT_TRUE(bits_equal(one[i], three[i]));
    for (std::size_t y = 0; y < 5; ++y)
      for (std::size_t x = 0; x < 7; ++x) ASSERT_TRUE(bits_equal(small[y * 7 + x], one[y * 40 + x]));
    EXPECT_TRUE(bits_equal(small.back(), one.back()));
  }
}

TEST(Random, RowsEqualSingleDraws) {
  const RandomStream draw{0x3f800000, (std::uint64_t{5} << 32U) + 9};
  std::mt19937 rng(1);
  for (const NamedKernelTable& target : kernel_tables())
    for (const Opcode op : {Opcode::kRandomFloat, Opcode::kRandomGauss, Opcode::kRandomInt}) {
      const Cells mask = random_mask(700, rng), before = random_cells(700, rng);
      Cells all = before, some = before;
      draw.fill_row(*target.table, op, 13, -2.5F, 7, all.data(), nullptr, 700);
      draw.fill_row(*target.table, op, 13, -2.5F, 7, some.data(), mask.data(), 699);
      for (std::uint32_t x = 0; x < 700; ++x) {
        const float want = draw(op, x, 13, -2.5F, 7);
        ASSERT_TRUE(bits_equal(all[x], want)) << target.name << " column " << x;
        ASSERT_TRUE(bits_equal(some[x], mask[x] != 0.0F && x < 699 ? want : before[x])) << target.name;
      }
    }
}

TEST(Random, DrawMatchesSpecification) {
  const RandomStream draw{7, (std::uint64_t{5} << 32U) + 9};
  const RandomWords words = philox({11, 13, 9, 5}, {7, 0});
  const float u = static_cast<float>(words[0] >> 8U) / 16777216.0F;
  EXPECT_EQ(draw(Opcode::kRandomFloat, 11, 13, 2, 6), 2.0F + 4.0F * u);
  EXPECT_GE(draw(Opcode::kRandomInt, 11, 13, 1.5F, 3.5F), 2.0F);
  EXPECT_LE(draw(Opcode::kRandomInt, 11, 13, 1.5F, 3.5F), 3.0F);
  EXPECT_EQ(draw(Opcode::kRandomInt, 11, 13, 4, 4), 4.0F);
}

}  // namespace
}  // namespace apron::vm::test
