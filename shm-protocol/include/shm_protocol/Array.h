// Views the bytes of a channel as an array of its element type.
#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <type_traits>

#include "shm_protocol/Description.h"

namespace shm_protocol {

// The dtype of a C++ element type.
template <class T>
constexpr DType dtype_of() noexcept {
  static_assert(std::is_same_v<T, float> || std::is_same_v<T, std::uint32_t> ||
                std::is_same_v<T, std::uint8_t>);
  if (std::is_same_v<T, float>) return DType::kF32;
  return std::is_same_v<T, std::uint32_t> ? DType::kU32 : DType::kU8;
}

constexpr std::size_t element_bytes(DType dtype) noexcept { return dtype == DType::kU8 ? 1 : 4; }

// Returns visit(T{}) for the element type T of `dtype`.
template <class Visit>
decltype(auto) with_element_type(DType dtype, Visit&& visit) {
  switch (dtype) {
    case DType::kU32:
      return visit(std::uint32_t{});
    case DType::kU8:
      return visit(std::uint8_t{});
    default:
      return visit(float{});
  }
}

// Precondition: `bytes` is 64-byte aligned and its size is a multiple of sizeof(T).
template <class T, class Byte>
std::span<T> as_array(std::span<Byte> bytes) noexcept {
  return {reinterpret_cast<T*>(bytes.data()), bytes.size() / sizeof(T)};
}

}  // namespace shm_protocol
