#include "smartsurf/world/FieldCopy.h"

#include <algorithm>
#include <span>

namespace smartsurf::world {
namespace {

// Cells whose heights and speeds stay in a core's own cache between copying and hashing. The hash depends on
// it.
constexpr std::size_t kBlock = 4096;
constexpr double kCost_ns = 0.5;  // of one cell

}  // namespace

void FieldCopy::take(const surface::Field& field, std::vector<float>& height, StateHash& hash) {
  const std::size_t cells = field.height.size(), blocks = (cells + kBlock - 1) / kBlock;
  height.resize(cells);
  hashes_.resize(blocks);
  const auto work = [&](int begin, int end) {
    for (auto b = static_cast<std::size_t>(begin); b < static_cast<std::size_t>(end); ++b) {
      const std::size_t first = b * kBlock, count = std::min(kBlock, cells - first);
      const auto heights = std::span(height).subspan(first, count);
      std::copy_n(&field.height[first], count, heights.begin());
      StateHash of_block;
      of_block.add(heights);
      of_block.add(std::span(field.speed).subspan(first, count));
      hashes_[b] = of_block.value();
    }
  };
  if (pool_ != nullptr)
    pool_->for_rows(static_cast<int>(blocks), kCost_ns * static_cast<double>(cells), work);
  else
    work(0, static_cast<int>(blocks));
  for (const std::uint64_t of_block : hashes_) {
    hash.add(static_cast<std::uint32_t>(of_block));
    hash.add(static_cast<std::uint32_t>(of_block >> 32U));
  }
}

}  // namespace smartsurf::world
