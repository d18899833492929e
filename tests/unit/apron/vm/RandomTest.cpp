// Random numbers: known answers of Philox, distributions, and independence of threads, masks, array size and
// instruction set.
#include "apron/vm/kernels/Random.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <numbers>

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

const KernelTable& best_kernels() { return *kernel_tables().front().table; }

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
        const float want = draw.draw_one(best_kernels(), op, x, 13, -2.5F, 7);
        ASSERT_TRUE(bits_equal(all[x], want)) << target.name << " column " << x;
        ASSERT_TRUE(bits_equal(some[x], mask[x] != 0.0F && x < 699 ? want : before[x])) << target.name;
      }
    }
}

TEST(Random, DrawMatchesSpecification) {
  const RandomStream draw{7, (std::uint64_t{5} << 32U) + 9};
  const auto one = [&](Opcode op, float a, float b) {
    return draw.draw_one(best_kernels(), op, 11, 13, a, b);
  };
  const RandomWords words = philox({11, 13, 9, 5}, {7, 0});
  const float u = static_cast<float>(words[0] >> 8U) / 16777216.0F;
  EXPECT_EQ(one(Opcode::kRandomFloat, 2, 6), 2.0F + 4.0F * u);
  EXPECT_GE(one(Opcode::kRandomInt, 1.5F, 3.5F), 2.0F);
  EXPECT_LE(one(Opcode::kRandomInt, 1.5F, 3.5F), 3.0F);
  EXPECT_EQ(one(Opcode::kRandomInt, 4, 4), 4.0F);
}

TEST(Random, WholeNumbersAreExactWithinTheirBounds) {
  const RandomStream draw{7, 9};
  constexpr double kLow = 0x1p53 - 1001, kHigh = 0x1p53 - 1;
  for (std::uint32_t column = 0; column < 1000; ++column) {
    const double drawn = draw.draw_one(best_kernels(), Opcode::kRandomInt, column, 0, kLow, kHigh);
    ASSERT_TRUE(drawn >= kLow && drawn <= kHigh && drawn == std::trunc(drawn)) << drawn;
  }
  std::array<std::int32_t, 400> cells{};
  std::array<std::uint8_t, 400> bytes{};
  draw.fill_row(best_kernels(), Opcode::kRandomInt, 0, 2147483600, 2147483647, cells.data(), nullptr, 400);
  draw.fill_row(best_kernels(), Opcode::kRandomInt, 0, -50, 300, bytes.data(), nullptr, 400);
  for (std::uint32_t x = 0; x < 400; ++x) {
    const double want = draw.draw_one(best_kernels(), Opcode::kRandomInt, x, 0, 2147483600, 2147483647);
    const double byte = draw.draw_one(best_kernels(), Opcode::kRandomInt, x, 0, -50, 300);
    ASSERT_EQ(cells[x], want);
    ASSERT_EQ(bytes[x], std::clamp(byte, 0.0, 255.0));
  }
  EXPECT_NE(cells[0], cells[1]);
}

constexpr std::uint32_t kNormals = 1U << 18U;

Cells standard_normals(const KernelTable& kernels, std::uint32_t row) {
  Cells normals(kNormals);
  RandomStream{42, 3}.fill_row(kernels, Opcode::kRandomGauss, row, 0, 1, normals.data(), nullptr, kNormals);
  return normals;
}

TEST(Random, NormalIsBoxMullerOfTheFirstTwoWords) {
  const Cells normals = standard_normals(best_kernels(), 5);
  double error = 0;
  for (std::uint32_t x = 0; x < kNormals; ++x) {
    const RandomWords words = philox({x, 5, 3, 0}, {42, 0});
    const double u0 = (words[0] >> 8U) * 0x1p-24, u1 = (words[1] >> 8U) * 0x1p-24;
    error = std::max(error, std::fabs(normals[x] - std::sqrt(-2 * std::log(1 - u0)) *
                                                       std::cos(2 * std::numbers::pi * u1)));
  }
  EXPECT_LT(error, 1e-6);  // the documented bound
}

TEST(Random, NormalBitsDoNotDependOnTheInstructionSet) {
  const Cells best = standard_normals(best_kernels(), 6);
  for (const NamedKernelTable& target : kernel_tables()) {
    const Cells other = standard_normals(*target.table, 6);
    for (std::uint32_t x = 0; x < kNormals; ++x) ASSERT_TRUE(bits_equal(best[x], other[x])) << target.name;
  }
}

// Four standard errors of moments and tail counts, and the Kolmogorov-Smirnov statistic at its 1 % level.
TEST(Random, NormalHasTheNormalDistribution) {
  Cells normals = standard_normals(best_kernels(), 7);
  const double n = kNormals;
  std::array<double, 5> moment{};
  for (const double x : normals)
    for (int k = 1; k <= 4; ++k) moment[static_cast<std::size_t>(k)] += std::pow(x, k) / n;
  EXPECT_NEAR(moment[1], 0, 4 * std::sqrt(1 / n));
  EXPECT_NEAR(moment[2], 1, 4 * std::sqrt(2 / n));
  EXPECT_NEAR(moment[3], 0, 4 * std::sqrt(15 / n));
  EXPECT_NEAR(moment[4], 3, 4 * std::sqrt(96 / n));
  for (const float limit : {1.0F, 2.0F, 3.0F, 4.0F}) {
    const double beyond = n * std::erfc(limit / std::numbers::sqrt2);
    const auto found =
        std::count_if(normals.begin(), normals.end(), [&](float x) { return std::fabs(x) > limit; });
    EXPECT_NEAR(static_cast<double>(found), beyond, 4 * std::sqrt(beyond)) << limit;
  }
  std::sort(normals.begin(), normals.end());
  double distance = 0;
  for (std::size_t i = 0; i < normals.size(); ++i) {
    const double below = 0.5 * std::erfc(-normals[i] / std::numbers::sqrt2), rank = static_cast<double>(i);
    distance = std::max({distance, below - rank / n, (rank + 1) / n - below});
  }
  EXPECT_LT(distance * std::sqrt(n), 1.63);
}

}  // namespace
}  // namespace apron::vm::test
