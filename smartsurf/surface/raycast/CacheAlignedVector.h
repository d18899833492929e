// A vector whose memory is aligned to a cache line: a block of sixteen floats is one line, and wide loads
// rarely straddle two.
#pragma once

#include <cstddef>
#include <new>
#include <vector>

namespace smartsurf::surface {

template <class T>
struct CacheAlignedAllocator {
  using value_type = T;
  static constexpr std::align_val_t kCacheLine{64};

  CacheAlignedAllocator() = default;
  template <class U>
  CacheAlignedAllocator(const CacheAlignedAllocator<U>&) noexcept {}
  T* allocate(std::size_t n) { return static_cast<T*>(::operator new(n * sizeof(T), kCacheLine)); }
  void deallocate(T* p, std::size_t) noexcept { ::operator delete(p, kCacheLine); }
  bool operator==(const CacheAlignedAllocator&) const noexcept { return true; }
};

template <class T>
using CacheAlignedVector = std::vector<T, CacheAlignedAllocator<T>>;

}  // namespace smartsurf::surface
