// Asks for memory before it is needed.
#pragma once

namespace common {

// Fetches the cache line of an address, which need not be valid.
inline void prefetch(const void* address) noexcept {
  __builtin_prefetch(address);
  // GCC 12 takes a function that does nothing but prefetch for one without effect and drops its calls.
  asm volatile("");
}

// The same for memory that is to be written: other cores lose the line.
inline void prefetch_to_write(const void* address) noexcept {
#if defined(__x86_64__)
  // GCC emits this instruction only for processors that are known to have it; others ignore it.
  asm volatile("prefetchw %0" : : "m"(*static_cast<const char*>(address)));
#else
  __builtin_prefetch(address, 1);
  asm volatile("");
#endif
}

}  // namespace common
