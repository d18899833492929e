#include "apron/vm/kernels/Executor.h"

namespace apron::vm {

void Executor::run_parallel(Kernel kernel, const Block& block) noexcept {
  parallel_for_rows(block.rows, block.columns, [&](std::uint32_t first, std::uint32_t last) {
    Block slice = block;
    const auto rows_down = static_cast<std::ptrdiff_t>(first);
    slice.rows = last - first;
    slice.y += rows_down * block.pitch;
    for (std::size_t k = 0; k < slice.source.size(); ++k)
      if (slice.source[k] != nullptr) slice.source[k] += rows_down * block.source_pitch[k];
    if (slice.mask != nullptr) slice.mask += rows_down * block.mask_pitch;
    kernel(slice);
  });
}

}  // namespace apron::vm
