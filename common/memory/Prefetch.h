// Asks for memory before it is needed.
#pragma once

namespace common {

// Fetches the cache line of an address, which need not be valid.
inline void prefetch(const void* address) noexcept {
  __builtin_prefetch(address);
  // GCC 12 takes a function that does nothing but prefetch for one without effect and drops its calls.
  asm volatile("");
}
// The same, and takes it away from other cores.
inline void prefetch_to_write(const void* address) noexcept {
  __builtin_prefetch(address, 1);
  asm volatile("");
}

}  // namespace common
