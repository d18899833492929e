#include "FrameCopy.h"

#include <algorithm>
#include <cmath>
#include <cstring>

#ifdef __SSE2__
#include <emmintrin.h>
#endif

namespace shm_protocol {
namespace {

constexpr std::size_t kBlock = 4096;  // bytes copied and then checked while they are in the nearest cache

// Four floats at once in any build, by the compilers' vector extension.
using Floats = float __attribute__((vector_size(16)));
using Masks = std::int32_t __attribute__((vector_size(16)));

// Whether every value is within the range; false with any NaN. Reads only, so that the usual case, nothing to
// replace, costs little more than the copy.
bool all_within(std::span<const float> values, float lowest, float highest) noexcept {
  const Floats low = {lowest, lowest, lowest, lowest}, high = {highest, highest, highest, highest};
  Masks inside[4] = {{-1, -1, -1, -1}, {-1, -1, -1, -1}, {-1, -1, -1, -1}, {-1, -1, -1, -1}};
  std::size_t i = 0;
  for (; i + 16 <= values.size(); i += 16) {
    Floats v[4];
    std::memcpy(v, &values[i], sizeof v);
    for (int k = 0; k < 4; ++k) inside[k] &= (v[k] >= low) & (v[k] <= high);
  }
  const Masks all = inside[0] & inside[1] & inside[2] & inside[3];
  bool rest = (all[0] & all[1] & all[2] & all[3]) != 0;
  for (; i < values.size(); ++i) rest &= values[i] >= lowest && values[i] <= highest;
  return rest;
}

std::uint64_t check_values(std::span<float> values, float lowest, float highest, float safe) noexcept {
  if (all_within(values, lowest, highest)) return 0;
  std::uint64_t replaced = 0;
  for (float& value : values) {
    if (value >= lowest && value <= highest) continue;
    value = std::isnan(value) ? safe : value < lowest ? lowest : highest;
    ++replaced;
  }
  return replaced;
}

template <class T>
std::uint64_t check_values(std::span<T> values, T lowest, T highest) noexcept {
  std::uint32_t replaced = 0;
  for (T& value : values) {
    const T v = value;
    value = std::clamp(v, lowest, highest);
    replaced += static_cast<std::uint32_t>(value != v);
  }
  return replaced;
}

std::uint64_t check_block(std::byte* block, std::size_t bytes, const ssp_channel& c) noexcept {
  if (c.dtype == SSP_F32)
    return check_values({reinterpret_cast<float*>(block), bytes / sizeof(float)},
                        static_cast<float>(c.minimum), static_cast<float>(c.maximum),
                        static_cast<float>(c.safe));
  if (c.dtype == SSP_U32)
    return check_values(std::span(reinterpret_cast<std::uint32_t*>(block), bytes / sizeof(std::uint32_t)),
                        static_cast<std::uint32_t>(c.minimum), static_cast<std::uint32_t>(c.maximum));
  return check_values(std::span(reinterpret_cast<std::uint8_t*>(block), bytes),
                      static_cast<std::uint8_t>(c.minimum), static_cast<std::uint8_t>(c.maximum));
}

}  // namespace

#ifdef __SANITIZE_THREAD__
// The race is meant: a seqlock's reader. ThreadSanitizer would report it, and it watches memcpy too.
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
void stream_frame(std::byte* to, const std::byte* from, std::size_t bytes, bool past_caches) noexcept {
  if (!past_caches || bytes < 128) {
    std::memcpy(to, from, bytes);
    return;
  }
  const std::size_t head = (64 - reinterpret_cast<std::uintptr_t>(to) % 64) % 64;
  std::memcpy(to, from, head);
  std::size_t at = head;
  for (; at + 64 <= bytes; at += 64)
    for (std::size_t k = 0; k < 64; k += sizeof(__m128i))
      _mm_stream_si128(reinterpret_cast<__m128i*>(to + at + k),
                       _mm_loadu_si128(reinterpret_cast<const __m128i*>(from + at + k)));
  std::memcpy(to + at, from + at, bytes - at);
  _mm_sfence();  // streaming stores are ordered by nothing else, the release store that follows included
}
#else
void stream_frame(std::byte* to, const std::byte* from, std::size_t bytes, bool) noexcept {
  copy_frame(to, from, bytes);
}
#endif

std::uint64_t copy_checked(std::byte* to, const std::byte* from, std::size_t all,
                           const ssp_channel& c) noexcept {
  std::uint64_t replaced = 0;
  for (std::size_t at = 0; at < all; at += kBlock) {
    const std::size_t bytes = std::min(kBlock, all - at);
    copy_frame(to + at, from + at, bytes);
    // The copy above is complete before the first value is judged: without this the compiler might fetch
    // again.
    asm volatile("" ::: "memory");
    replaced += check_block(to + at, bytes, c);
  }
  return replaced;
}

}  // namespace shm_protocol
