#include "FrameCopy.h"

#include <algorithm>
#include <cmath>
#include <cstring>

#ifdef __SSE2__
#include <immintrin.h>
#endif

namespace shm_protocol {
namespace {

constexpr std::size_t kBlock = 4096;  // bytes copied, then checked while still in the L1 cache

// Function multiversioning: the loader selects the variant for the CPU. It is disabled under sanitizers,
// which are not initialised when the resolvers run.
#if defined(__x86_64__) && !defined(__clang__) && !defined(__SANITIZE_THREAD__) && \
    !defined(__SANITIZE_ADDRESS__)
#define FOR_EACH_MACHINE __attribute__((target_clones("default", "avx2", "avx512f")))
#else
#define FOR_EACH_MACHINE
#endif

// Returns whether every value is within the range; false for NaN. Reads only, so that the common case, in
// which nothing is replaced, costs little more than the copy.
FOR_EACH_MACHINE bool all_within(const float* values, std::size_t count, float lowest,
                                 float highest) noexcept {
  std::int32_t outside = 0;
  for (std::size_t i = 0; i < count; ++i)
    outside |= static_cast<std::int32_t>(!(values[i] >= lowest)) |
               static_cast<std::int32_t>(!(values[i] <= highest));
  return outside == 0;
}

std::uint64_t sanitize_values(std::span<float> values, float lowest, float highest, float safe) noexcept {
  if (all_within(values.data(), values.size(), lowest, highest)) return 0;
  std::uint64_t replaced = 0;
  for (float& value : values) {
    if (value >= lowest && value <= highest) continue;
    value = std::isnan(value) ? safe : value < lowest ? lowest : highest;
    ++replaced;
  }
  return replaced;
}

template <class T>
std::uint64_t sanitize_values(std::span<T> values, T lowest, T highest) noexcept {
  std::uint32_t replaced = 0;
  for (T& value : values) {
    const T v = value;
    value = std::clamp(v, lowest, highest);
    replaced += static_cast<std::uint32_t>(value != v);
  }
  return replaced;
}

std::uint64_t sanitize_block(std::byte* block, std::size_t bytes, const ssp_channel& c) noexcept {
  if (c.dtype == SSP_F32)
    return sanitize_values({reinterpret_cast<float*>(block), bytes / sizeof(float)},
                           static_cast<float>(c.minimum), static_cast<float>(c.maximum),
                           static_cast<float>(c.safe));
  if (c.dtype == SSP_U32)
    return sanitize_values(std::span(reinterpret_cast<std::uint32_t*>(block), bytes / sizeof(std::uint32_t)),
                           static_cast<std::uint32_t>(c.minimum), static_cast<std::uint32_t>(c.maximum));
  return sanitize_values(std::span(reinterpret_cast<std::uint8_t*>(block), bytes),
                         static_cast<std::uint8_t>(c.minimum), static_cast<std::uint8_t>(c.maximum));
}

}  // namespace

#ifdef __SANITIZE_THREAD__
// The data race is intended (seqlock reader). ThreadSanitizer would report it, and it intercepts memcpy.
__attribute__((no_sanitize("thread"))) void copy_frame(std::byte* to, const std::byte* from,
                                                       std::size_t bytes) noexcept {
  const volatile std::byte* source = from;
  for (std::size_t i = 0; i < bytes; ++i) to[i] = source[i];
}
#else
void copy_frame(std::byte* to, const std::byte* from, std::size_t bytes) noexcept {
  std::memcpy(to, from, bytes);
}
#endif

#if defined(__SSE2__) && !defined(__SANITIZE_THREAD__)
namespace {

// Copies lines of 64 bytes; `to` is 64-byte aligned.
void stream_lines(std::byte* to, const std::byte* from, std::size_t lines) noexcept {
  for (std::size_t at = 0; at < 64 * lines; at += sizeof(__m128i))
    _mm_stream_si128(reinterpret_cast<__m128i*>(to + at),
                     _mm_loadu_si128(reinterpret_cast<const __m128i*>(from + at)));
}
void copy_lines(std::byte* to, const std::byte* from, std::size_t lines) noexcept {
  std::memcpy(to, from, 64 * lines);
}

// The same, one full line per store.
__attribute__((target("avx512f"))) void stream_wide_lines(std::byte* to, const std::byte* from,
                                                          std::size_t lines) noexcept {
  for (std::size_t at = 0; at < 64 * lines; at += sizeof(__m512i))
    _mm512_stream_si512(reinterpret_cast<__m512i*>(to + at), _mm512_loadu_si512(from + at));
}
__attribute__((target("avx512f"))) void copy_wide_lines(std::byte* to, const std::byte* from,
                                                        std::size_t lines) noexcept {
  for (std::size_t at = 0; at < 64 * lines; at += sizeof(__m512i))
    _mm512_store_si512(to + at, _mm512_loadu_si512(from + at));
}

}  // namespace

void stream_frame(std::byte* to, const std::byte* from, std::size_t bytes, bool non_temporal) noexcept {
  if (bytes < 128) {
    std::memcpy(to, from, bytes);
    return;
  }
  static const bool wide = __builtin_cpu_supports("avx512f");
  const std::size_t head = (64 - reinterpret_cast<std::uintptr_t>(to) % 64) % 64;
  const std::size_t lines = (bytes - head) / 64, end = head + 64 * lines;
  std::memcpy(to, from, head);
  if (non_temporal)
    (wide ? stream_wide_lines : stream_lines)(to + head, from + head, lines);
  else
    (wide ? copy_wide_lines : copy_lines)(to + head, from + head, lines);
  std::memcpy(to + end, from + end, bytes - end);
  if (non_temporal) _mm_sfence();  // a release store does not order non-temporal stores
}
#else
void stream_frame(std::byte* to, const std::byte* from, std::size_t bytes, bool) noexcept {
  copy_frame(to, from, bytes);
}
#endif

std::uint64_t copy_sanitized(std::byte* to, const std::byte* from, std::size_t total_bytes,
                             const ssp_channel& c) noexcept {
  std::uint64_t replaced = 0;
  for (std::size_t at = 0; at < total_bytes; at += kBlock) {
    const std::size_t bytes = std::min(kBlock, total_bytes - at);
    copy_frame(to + at, from + at, bytes);
    // The compiler must not check a value by loading it again from shared memory.
    asm volatile("" ::: "memory");
    replaced += sanitize_block(to + at, bytes, c);
  }
  return replaced;
}

}  // namespace shm_protocol
