// Reductions in the order that opcodes.def specifies, bit for bit, on every instruction set and number of
// threads.
#include <gtest/gtest.h>

#include "TestProgram.h"

namespace apron::vm::test {
namespace {

// 16 interleaved partial sums per row, added pairwise 8, 4, 2, 1 apart; then the row sums in double
// precision.
float reference_sum(const Cells& cells, Size size) {
  double total = 0;
  for (std::uint32_t y = 0; y < size.height; ++y) {
    float partial[16] = {};
    for (std::uint32_t x = 0; x < size.width; ++x) partial[x % 16] += cells[y * size.width + x];
    for (int apart : {8, 4, 2, 1})
      for (int i = 0; i < apart; ++i) partial[i] += partial[i + apart];
    total = y == 0 ? partial[0] : total + partial[0];
  }
  return static_cast<float>(total);
}

float run(Opcode op, const Cells& cells, Size size, VmOptions options) {
  TestProgram b;
  const Operand v = b.var(-99), a = b.reg(size.width, size.height);
  b.add(op, v, a);
  FakeHost host;
  Vm vm(b.finish(), options, host);
  write_cells(vm.plane(a.index), cells);
  EXPECT_EQ(vm.run(), Status::kEnded);
  return vm.variable(v.index);
}

std::vector<VmOptions> all_options() {
  std::vector<VmOptions> all;
  for (const NamedKernelTable& target : kernel_tables())
    for (const unsigned threads : {1U, 2U, 3U}) {
      VmOptions options;
      options.threads = threads;
      options.parallel_cells = 1;
      options.kernels = target.table;
      all.push_back(options);
    }
  return all;
}

TEST(Reduce, SumsInSpecifiedOrder) {
  std::mt19937 rng(6 + first_program_seed());
  std::uniform_real_distribution<float> real(-1e4F, 1e4F);
  for (const Size size : kSizes) {
    Cells cells(std::size_t{size.width} * size.height);
    for (float& c : cells) c = real(rng);
    const float sum = reference_sum(cells, size);
    for (const VmOptions& options : all_options()) {
      ASSERT_TRUE(bits_equal(run(Opcode::kGlobalSum, cells, size, options), sum));
      ASSERT_TRUE(
          bits_equal(run(Opcode::kGlobalMean, cells, size, options), sum / static_cast<float>(cells.size())));
    }
  }
}

TEST(Reduce, ExtremesAndCounts) {
  std::mt19937 rng(7 + first_program_seed());
  for (const Size size : kSizes) {
    Cells cells = random_cells(std::size_t{size.width} * size.height, rng);
    float low = INFINITY, high = -INFINITY, count = 0;
    for (const float c : cells) {
      if (c < low) low = c;
      if (c > high) high = c;
      if (c != 0.0F) ++count;
    }
    for (const VmOptions& options : all_options()) {
      ASSERT_EQ(run(Opcode::kGlobalMin, cells, size, options), low);
      ASSERT_EQ(run(Opcode::kGlobalMax, cells, size, options), high);
      ASSERT_EQ(run(Opcode::kGlobalCount, cells, size, options), count);
      ASSERT_EQ(run(Opcode::kGlobalAny, cells, size, options), count > 0 ? 1.0F : 0.0F);
    }
  }
}

TEST(Reduce, UniformRegisters) {
  const Cells zeros(17 * 33, 0.0F);
  EXPECT_EQ(run(Opcode::kGlobalAny, zeros, {17, 33}, {}), 0.0F);
  EXPECT_EQ(run(Opcode::kGlobalSum, zeros, {17, 33}, {}), 0.0F);
  EXPECT_EQ(run(Opcode::kGlobalMax, Cells(15, -3.0F), {3, 5}, {}), -3.0F);
}

}  // namespace
}  // namespace apron::vm::test
