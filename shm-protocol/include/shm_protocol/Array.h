// A channel's bytes as an array of its element type.
#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <type_traits>

#include "shm_protocol/Description.h"

namespace shm_protocol {

// The dtype that a C++ element type stands for.
template <class T>
constexpr DType dtype_of() noexcept {
  static_assert(std::is_same_v<T, float> || std::is_same_v<T, std::uint32_t> ||
                std::is_same_v<T, std::uint8_t>);
  if (std::is_same_v<T, float>) return DType::kF32;
  return std::is_same_v<T, std::uint32_t> ? DType::kU32 : DType::kU8;
}

// The bytes lie at a multiple of 64 and their number is a multiple of T's size.
template <class T, class Byte>
std::span<T> as_array(std::span<Byte> bytes) noexcept {
  return {reinterpret_cast<T*>(bytes.data()), bytes.size() / sizeof(T)};
}

}  // namespace shm_protocol
