#include "apron/library/PlaneBlock.h"

#include <algorithm>
#include <mutex>
#include <vector>

namespace apron::library {
namespace {

constexpr std::size_t kMaxSpareBytes = std::size_t{256} << 20;

std::size_t bytes_of(const PlaneBlock& block) {
  return static_cast<std::size_t>(block.plane().pitch) * block.plane().height * block.plane().cell_bytes();
}

class SpareBlocks {
 public:
  std::unique_ptr<PlaneBlock> take(std::uint32_t width, std::uint32_t height, vm::CellType type) {
    const std::lock_guard lock(mutex_);
    const auto fits = [&](const auto& b) {
      return b->plane().width == width && b->plane().height == height && b->plane().type == type;
    };
    const auto found = std::ranges::find_if(blocks_, fits);
    if (found == blocks_.end()) return nullptr;
    std::unique_ptr<PlaneBlock> block = std::move(*found);
    blocks_.erase(found);
    bytes_ -= bytes_of(*block);
    return block;
  }
  void give(std::unique_ptr<PlaneBlock> block) {
    const std::lock_guard lock(mutex_);
    if (bytes_ + bytes_of(*block) > kMaxSpareBytes) return;
    try {
      blocks_.push_back(std::move(block));
      bytes_ += bytes_of(*blocks_.back());
    } catch (const std::bad_alloc&) {  // the block is freed
    }
  }

 private:
  std::mutex mutex_;
  std::vector<std::unique_ptr<PlaneBlock>> blocks_;
  std::size_t bytes_ = 0;
};

// Never destroyed: an array may outlive everything else at the end of its process.
SpareBlocks& spare_blocks() {
  static auto* const blocks = new SpareBlocks;
  return *blocks;
}

}  // namespace

void PlaneBlock::clear_padding() noexcept {
  if (has_zero_padding_) return;
  for (std::uint32_t y = 0; y < plane_.height; ++y) {
    std::byte* row = plane_.row_bytes(y);
    if (y == 0) std::fill(row - vm::kVectorBytes, row, std::byte{0});
    std::fill(row + plane_.width * plane_.cell_bytes(), row + plane_.pitch * plane_.cell_bytes(),
              std::byte{0});
  }
  has_zero_padding_ = true;
}

SharedBlock acquire_block(std::uint32_t width, std::uint32_t height, vm::CellType type) {
  std::unique_ptr<PlaneBlock> block = spare_blocks().take(width, height, type);
  if (!block) block = std::make_unique<PlaneBlock>(width, height, type);
  block->clear_padding();
  return {block.release(), [](PlaneBlock* used) { spare_blocks().give(std::unique_ptr<PlaneBlock>(used)); }};
}

}  // namespace apron::library
