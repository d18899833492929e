// Atomic access to the words shared between processes, and the seqlock's two fences.
//
// Uses the __atomic builtins, not std::atomic: the words are members of plain C structs in mapped memory, and
// C++20's atomic_ref does not support read-only mappings.
#pragma once

#include <atomic>
#include <type_traits>

namespace shm_protocol {

template <class T>
T load_relaxed(const T& word) noexcept {
  T value;
  __atomic_load(&word, &value, __ATOMIC_RELAXED);
  return value;
}

template <class T>
T load_acquire(const T& word) noexcept {
  T value;
  __atomic_load(&word, &value, __ATOMIC_ACQUIRE);
  return value;
}

template <class T>
T load_seq_cst(const T& word) noexcept {
  T value;
  __atomic_load(&word, &value, __ATOMIC_SEQ_CST);
  return value;
}

template <class T>
void store_relaxed(T& word, std::type_identity_t<T> value) noexcept {
  __atomic_store(&word, &value, __ATOMIC_RELAXED);
}

template <class T>
void store_release(T& word, std::type_identity_t<T> value) noexcept {
  __atomic_store(&word, &value, __ATOMIC_RELEASE);
}

template <class T>
void store_seq_cst(T& word, std::type_identity_t<T> value) noexcept {
  __atomic_store(&word, &value, __ATOMIC_SEQ_CST);
}

// Returns true if the word was `expected` and is now `desired`.
template <class T>
bool compare_exchange(T& word, std::type_identity_t<T> expected, std::type_identity_t<T> desired) noexcept {
  return __atomic_compare_exchange(&word, &expected, &desired, false, __ATOMIC_SEQ_CST, __ATOMIC_SEQ_CST);
}

template <class T>
void increment(T& word) noexcept {
  __atomic_fetch_add(&word, T{1}, __ATOMIC_SEQ_CST);
}

// GCC's ThreadSanitizer does not support fences. The arrays they order are copied uninstrumented
// (FrameCopy.cpp), so a compiler barrier suffices on x86, which keeps stores and loads in order.
#ifdef __SANITIZE_THREAD__
inline void fence_release() noexcept { asm volatile("" ::: "memory"); }
inline void fence_acquire() noexcept { asm volatile("" ::: "memory"); }
#else
inline void fence_release() noexcept { std::atomic_thread_fence(std::memory_order_release); }
inline void fence_acquire() noexcept { std::atomic_thread_fence(std::memory_order_acquire); }
#endif

}  // namespace shm_protocol
