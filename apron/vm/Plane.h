// A view of a 2-D array, shared by the VM, its kernels and the host.
#pragma once

#include <cassert>
#include <cstddef>
#include <cstdint>
#include <string>
#include <type_traits>

#include "apron/program/CellType.h"

namespace apron::vm {

using program::CellType;
using program::same_shape;

// `height` rows of `width` cells, row-major; row 0 is north, column 0 is west. Row y begins y * pitch cells
// after the first.
template <class Float>
struct BasicPlane {
  Float* data = nullptr;  // for another type of cells: the address of the first one
  std::uint32_t width = 0, height = 0;
  std::ptrdiff_t pitch = 0;  // in cells
  CellType type = CellType::kFloat32;

  Float* row(std::uint32_t y) const noexcept {
    assert(type == CellType::kFloat32);
    return data + static_cast<std::ptrdiff_t>(y) * pitch;
  }
  std::size_t cell_count() const noexcept { return std::size_t{width} * height; }
  std::size_t cell_bytes() const noexcept { return program::cell_bytes(type); }

  using Byte = std::conditional_t<std::is_const_v<Float>, const std::byte, std::byte>;
  // The first byte of a row.
  Byte* row_bytes(std::uint32_t y) const noexcept {
    return reinterpret_cast<Byte*>(data) +
           static_cast<std::ptrdiff_t>(y) * pitch * static_cast<std::ptrdiff_t>(cell_bytes());
  }
  // The cells of a row as integers of the plane's type.
  template <class T>
  auto* cells(std::uint32_t y) const noexcept {
    assert(sizeof(T) == cell_bytes());
    return reinterpret_cast<std::conditional_t<std::is_const_v<Float>, const T, T>*>(row_bytes(y));
  }
};

using Plane = BasicPlane<float>;

struct ConstPlane : BasicPlane<const float> {
  ConstPlane() = default;
  ConstPlane(const float* d, std::uint32_t w, std::uint32_t h, std::ptrdiff_t p) : BasicPlane{d, w, h, p} {}
  ConstPlane(const Plane& p)
      : BasicPlane{p.data, p.width, p.height, p.pitch, p.type} {
  }  // NOLINT: implicit, a view of the same cells
};

template <class A, class B>
bool same_shape_and_type(const A& a, const B& b) noexcept {
  return same_shape(a, b) && a.type == b.type;
}

// The least multiple of `unit` that is not less than n.
template <class T>
constexpr T round_up(T n, std::type_identity_t<T> unit) noexcept {
  return (n + unit - 1) / unit * unit;
}

// Calls work(T()) with the C++ type of the cells: float, std::int32_t, std::uint16_t or std::uint8_t.
template <class Work>
decltype(auto) with_cell_type(CellType type, const Work& work) {
  switch (type) {
    case CellType::kInt32:
      return work(std::int32_t());
    case CellType::kUint16:
      return work(std::uint16_t());
    case CellType::kUint8:
      return work(std::uint8_t());
    case CellType::kFloat32:
      break;
  }
  return work(float());
}

// The value of one cell, exactly.
inline double cell_value(const ConstPlane& plane, std::uint32_t x, std::uint32_t y) {
  return with_cell_type(plane.type, [&](auto cell) -> double { return plane.cells<decltype(cell)>(y)[x]; });
}
// The cell as a number that a float holds, or the nearest one to it.
inline float cell_as_float(const ConstPlane& plane, std::uint32_t x, std::uint32_t y) {
  return static_cast<float>(cell_value(plane, x, y));
}

// "WIDTHxHEIGHT".
template <class P>
std::string format_shape(const P& plane) {
  return std::to_string(plane.width) + "x" + std::to_string(plane.height);
}

}  // namespace apron::vm
