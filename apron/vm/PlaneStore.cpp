#include "apron/vm/PlaneStore.h"

#include <sys/mman.h>

#include <cassert>
#include <cstring>
#include <new>

namespace apron::vm {
namespace {

constexpr std::size_t kAlignment = 64;
constexpr std::size_t kHugePage = std::size_t{1} << 21;

}  // namespace

Plane PlaneStore::allocate(std::uint32_t width, std::uint32_t height, CellType type) {
  assert(width > 0 && height > 0);
  const std::size_t pitch = round_up<std::size_t>(width, lanes(type)) + lanes(type);  // in cells
  // Large allocations begin on a page boundary. If every plane did too, the same cell of all registers would
  // map to one cache set, so each plane starts two cache lines later than the previous one.
  const std::size_t lead = kLanes + 2 * kLanes * (allocations_.size() % 31);
  const std::size_t floats = lead + pitch * program::cell_bytes(type) * height / sizeof(float) + kLanes;
  // Huge pages avoid TLB misses when sweeping large planes.
  const bool large = floats * sizeof(float) >= 2 * kHugePage;
  const std::size_t bytes = round_up(floats * sizeof(float), kAlignment);
  void* memory = nullptr;
  if (posix_memalign(&memory, large ? kHugePage : kAlignment, bytes) != 0) throw std::bad_alloc();
  auto* block = static_cast<float*>(memory);
  if (large) madvise(block, bytes, MADV_HUGEPAGE);  // best effort
  std::memset(block, 0, bytes);
  allocations_.emplace_back(block);
  return {block + lead, width, height, static_cast<std::ptrdiff_t>(pitch), type};
}

}  // namespace apron::vm
