#include "smartsurf/world/FieldHasher.h"

#include <algorithm>
#include <span>

namespace smartsurf::world {
namespace {

// Cells per block: few enough that the block stays in a core's cache between copying and hashing. Part of the
// hash's definition.
constexpr std::size_t kBlockCells = 4096;
constexpr double kCostPerCell_ns = 0.5;

}  // namespace

void FieldHasher::copy_and_hash(const surface::Field& field, std::vector<float>& height, StateHash& hash) {
  const std::size_t cells = field.height.size(), blocks = (cells + kBlockCells - 1) / kBlockCells;
  height.resize(cells);
  block_hashes_.resize(blocks);
  const auto work = [&](int begin, int end) {
    for (auto b = static_cast<std::size_t>(begin); b < static_cast<std::size_t>(end); ++b) {
      const std::size_t first = b * kBlockCells, count = std::min(kBlockCells, cells - first);
      const auto heights = std::span(height).subspan(first, count);
      std::copy_n(&field.height[first], count, heights.begin());
      StateHash block_hash;
      block_hash.add(heights);
      block_hash.add(std::span(field.speed).subspan(first, count));
      block_hashes_[b] = block_hash.value();
    }
  };
  if (pool_ != nullptr)
    pool_->parallel_for_rows(static_cast<int>(blocks), kCostPerCell_ns * static_cast<double>(cells), work);
  else
    work(0, static_cast<int>(blocks));
  for (const std::uint64_t block_hash : block_hashes_) {
    hash.add(static_cast<std::uint32_t>(block_hash));
    hash.add(static_cast<std::uint32_t>(block_hash >> 32U));
  }
}

}  // namespace smartsurf::world
