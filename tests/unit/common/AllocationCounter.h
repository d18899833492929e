// Replaces the global operator new by one that counts its calls. One source file of a test program includes
// this; programs under a sanitizer keep the sanitizer's operator.
#pragma once

#if !defined(__SANITIZE_ADDRESS__) && !defined(__SANITIZE_THREAD__)
#define COUNTS_ALLOCATIONS 1

#include <atomic>
#include <cstdlib>
#include <new>

static std::atomic<std::size_t> allocations{0};
// Not inlined, because the compiler would warn about malloc paired with delete.
__attribute__((noinline)) void* operator new(std::size_t bytes) {
  allocations.fetch_add(1, std::memory_order_relaxed);
  if (void* memory = std::malloc(bytes)) return memory;
  throw std::bad_alloc();
}
__attribute__((noinline)) void operator delete(void* memory) noexcept { std::free(memory); }
__attribute__((noinline)) void operator delete(void* memory, std::size_t) noexcept { std::free(memory); }
#endif
