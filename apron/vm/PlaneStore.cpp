#include "apron/vm/PlaneStore.h"

#include <sys/mman.h>

#include <cassert>
#include <cstdlib>
#include <cstring>
#include <new>

namespace apron::vm {
namespace {

constexpr std::size_t kAlignment = 64;
constexpr std::size_t kHugePage = std::size_t{1} << 21;

std::size_t round_up(std::size_t n, std::size_t unit) { return (n + unit - 1) / unit * unit; }

}  // namespace

Plane PlaneStore::allocate(std::uint32_t width, std::uint32_t height) {
  assert(width > 0 && height > 0);
  const std::size_t pitch = round_up(width, kLanes) + kLanes;
  // Large blocks begin on a page. Planes that all begin there would put a cell of every register into one
  // cache set, so each starts two cache lines later than the one before.
  const std::size_t lead = kLanes + 2 * kLanes * (allocations_.size() % 31);
  const std::size_t floats = lead + pitch * height + kLanes;
  // A sweep over many small pages waits for their translations: large planes ask for large pages.
  const bool large = floats * sizeof(float) >= 2 * kHugePage;
  const std::size_t bytes = round_up(floats * sizeof(float), kAlignment);
  void* memory = nullptr;
  if (posix_memalign(&memory, large ? kHugePage : kAlignment, bytes) != 0) throw std::bad_alloc();
  auto* block = static_cast<float*>(memory);
  if (large) madvise(block, bytes, MADV_HUGEPAGE);  // a refusal costs speed only
  std::memset(block, 0, bytes);
  allocations_.emplace_back(block);
  return {block + lead, width, height, static_cast<std::ptrdiff_t>(pitch)};
}

}  // namespace apron::vm
