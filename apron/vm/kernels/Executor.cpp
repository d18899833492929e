#include "apron/vm/kernels/Executor.h"

namespace apron::vm {

void Executor::run_parallel(Kernel kernel, const Block& block) noexcept {
  parallel_for_rows(block.rows, block.columns, [&](std::uint32_t first, std::uint32_t last) {
    Block slice = block;
    const auto rows_down = static_cast<std::ptrdiff_t>(first);
    slice.rows = last - first;
    const auto move = [&](auto*& cells, std::ptrdiff_t pitch, std::uint8_t cell_bytes) {
      if (cells != nullptr) cells += rows_down * pitch * cell_bytes / std::ptrdiff_t{sizeof(float)};
    };
    move(slice.y, block.pitch, block.cell_bytes);
    for (std::size_t k = 0; k < slice.source.size(); ++k)
      move(slice.source[k], block.source_pitch[k], block.source_bytes);
    move(slice.mask, block.mask_pitch, block.cell_bytes);
    kernel(slice);
  });
}

void convert_plane(Executor& executor, Plane y, ConstPlane a, bool saturated, const float* mask) noexcept {
  Block block(y, mask);
  block.source[0] = a.data;
  block.source_pitch.fill(a.pitch);
  block.source_bytes = static_cast<std::uint8_t>(a.cell_bytes());
  const KernelTable& kernels = executor.kernels();
  executor.run_kernel(a.type == y.type ? kernels.kernel(program::Opcode::kCopy, 0, mask != nullptr, y.type)
                                       : kernels.conversion(a.type, y.type, saturated, mask != nullptr),
                      block);
}

}  // namespace apron::vm
