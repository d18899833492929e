// A view of a 2-D float array, shared by the VM, its kernels and the host.
#pragma once

#include <cstddef>
#include <cstdint>
#include <string>

namespace apron::vm {

// `height` rows of `width` floats, row-major; row 0 is north, column 0 is west. Row y begins at
// data + y * pitch (pitch in floats).
template <class Float>
struct BasicPlane {
  Float* data = nullptr;
  std::uint32_t width = 0, height = 0;
  std::ptrdiff_t pitch = 0;

  Float* row(std::uint32_t y) const noexcept { return data + static_cast<std::ptrdiff_t>(y) * pitch; }
  std::size_t cell_count() const noexcept { return std::size_t{width} * height; }
};

using Plane = BasicPlane<float>;

struct ConstPlane : BasicPlane<const float> {
  ConstPlane() = default;
  ConstPlane(const float* d, std::uint32_t w, std::uint32_t h, std::ptrdiff_t p) : BasicPlane{d, w, h, p} {}
  ConstPlane(const Plane& p)
      : BasicPlane{p.data, p.width, p.height, p.pitch} {}  // NOLINT: implicit, a view of the same cells
};

template <class A, class B>
bool same_shape(const A& a, const B& b) noexcept {
  return a.width == b.width && a.height == b.height;
}

// "WIDTHxHEIGHT".
template <class P>
std::string format_shape(const P& plane) {
  return std::to_string(plane.width) + "x" + std::to_string(plane.height);
}

}  // namespace apron::vm
