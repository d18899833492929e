// FNV-1a, 64 bits: of bytes, or of larger words as its callers define.
#pragma once

#include <cstdint>
#include <string_view>

namespace common {

inline constexpr std::uint64_t kFnvBasis = 0xCBF29CE484222325U;

constexpr std::uint64_t fnv_mix(std::uint64_t hash, std::uint64_t word) {
  return (hash ^ word) * 0x100000001B3U;
}

constexpr std::uint64_t fnv1a(std::string_view bytes) {
  std::uint64_t hash = kFnvBasis;
  for (const char c : bytes) hash = fnv_mix(hash, static_cast<unsigned char>(c));
  return hash;
}

}  // namespace common
