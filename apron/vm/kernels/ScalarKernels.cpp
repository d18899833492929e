#include "apron/vm/kernels/ScalarKernels.h"

#include "apron/program/ScalarArithmetic.h"

namespace apron::vm {
namespace {

template <class Op, bool kMasked>
void apply(const Block& block) noexcept {
  for (std::ptrdiff_t r = 0; r < block.rows; ++r) {
    const auto operand = [&](std::size_t k, std::ptrdiff_t x) {
      return block.source[k] != nullptr ? block.source[k][r * block.source_pitch[k] + x] : block.scalar[k];
    };
    float* y = block.y + r * block.pitch;
    const float* mask = block.mask + (kMasked ? r * block.mask_pitch : 0);
    for (std::ptrdiff_t x = 0; x < block.columns; ++x)
      if (!kMasked || mask[x] != 0.0F) y[x] = Op::apply(operand(0, x), Op::kArity > 1 ? operand(1, x) : 0.0F);
  }
}

template <class Op>
void add_kernels(KernelTable& table) {
  for (unsigned scalars = 0; scalars < 1U << Op::kArity; ++scalars)
    table.elementwise[static_cast<std::size_t>(Op::kOpcode)][scalars] = {apply<Op, false>, apply<Op, true>};
}

}  // namespace

void add_scalar_kernels(KernelTable& table) {
#define APRON_LIBM(name, arity, value) add_kernels<program::libm::name>(table);
#include "apron/program/elementwise.def"
}

}  // namespace apron::vm
