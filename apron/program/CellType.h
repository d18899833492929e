// The types of a register's cells.
#pragma once

#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <string_view>

namespace apron::program {

enum class CellType : std::uint8_t { kFloat32, kInt32, kUint16, kUint8 };
inline constexpr std::size_t kCellTypeCount = 4;
constexpr std::size_t index_of(CellType type) noexcept { return static_cast<std::size_t>(type); }

constexpr bool is_integer(CellType type) noexcept { return type != CellType::kFloat32; }
constexpr std::size_t cell_bytes(CellType type) noexcept {
  return type == CellType::kUint8 ? 1 : type == CellType::kUint16 ? 2 : 4;
}
// The type's name in the language.
constexpr std::string_view cell_type_name(CellType type) noexcept {
  constexpr std::array<std::string_view, kCellTypeCount> kNames{"float", "int32", "uint16", "uint8"};
  return kNames[index_of(type)];
}
constexpr std::optional<CellType> find_cell_type(std::string_view name) noexcept {
  for (std::size_t i = 0; i < kCellTypeCount; ++i)
    if (cell_type_name(static_cast<CellType>(i)) == name) return static_cast<CellType>(i);
  return std::nullopt;
}

// The least and the largest value of an integer type.
constexpr double lowest_cell(CellType type) noexcept {
  return type == CellType::kInt32 ? -2147483648.0 : 0.0;
}
constexpr double highest_cell(CellType type) noexcept {
  return type == CellType::kInt32 ? 2147483647.0 : type == CellType::kUint16 ? 65535.0 : 255.0;
}
// True if a cell of the type can hold the scalar: always for floats, which round.
inline bool is_cell_value(CellType type, double value) noexcept {
  return !is_integer(type) ||
         (value >= lowest_cell(type) && value <= highest_cell(type) && value == std::trunc(value));
}

inline constexpr std::uint32_t kVectorBytes = 64;  // of the widest vector
// The memory of a register: a row takes whole vectors and one more, and two stand around all
// (vm/PlaneStore.h).
constexpr std::uint64_t stored_row_bytes(std::uint32_t width, CellType type) noexcept {
  return (std::uint64_t{width} * cell_bytes(type) + 2 * kVectorBytes - 1) / kVectorBytes * kVectorBytes;
}
constexpr std::uint64_t stored_bytes(std::uint32_t width, std::uint32_t height, CellType type) noexcept {
  return height * stored_row_bytes(width, type) + 2 * kVectorBytes;
}

// a and b are registers or planes.
template <class A, class B>
bool same_shape(const A& a, const B& b) noexcept {
  return a.width == b.width && a.height == b.height;
}

}  // namespace apron::program
