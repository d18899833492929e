#include "apron/vm/Propagation.h"

#include <algorithm>
#include <cmath>
#include <limits>

namespace apron::vm {
namespace {

// Visits the cells north to south, then south to north, each with the two neighbours visited before it, until
// a pair of sweeps changes nothing. visit(y's cell, neighbour's value) may raise the cell and says whether it
// did.
template <class Visit>
void sweep_until_stable(Plane y, const Visit& visit) noexcept {
  const std::int64_t width = y.width, height = y.height;
  const auto cell = [&](std::int64_t row, std::int64_t x) { return row * y.pitch + x; };
  for (bool changed = true; changed;) {
    changed = false;
    for (std::int64_t row = 0; row < height; ++row)
      for (std::int64_t x = 0; x < width; ++x) {
        if (row > 0) changed |= visit(row, x, y.data[cell(row - 1, x)]);
        if (x > 0) changed |= visit(row, x, y.data[cell(row, x - 1)]);
      }
    for (std::int64_t row = height - 1; row >= 0; --row)
      for (std::int64_t x = width - 1; x >= 0; --x) {
        if (row + 1 < height) changed |= visit(row, x, y.data[cell(row + 1, x)]);
        if (x + 1 < width) changed |= visit(row, x, y.data[cell(row, x + 1)]);
      }
  }
}

template <class First>
void fill(Plane y, const First& first) noexcept {
  for (std::uint32_t row = 0; row < y.height; ++row)
    for (std::uint32_t x = 0; x < y.width; ++x) y.row(row)[x] = first(row, x);
}

}  // namespace

void flood(Plane y, ConstPlane seed, ConstPlane mask) noexcept {
  fill(y, [&](std::uint32_t row, std::uint32_t x) {
    return seed.row(row)[x] != 0.0F && mask.row(row)[x] != 0.0F ? 1.0F : 0.0F;
  });
  sweep_until_stable(y, [&](std::int64_t row, std::int64_t x, float neighbour) {
    float& own = y.data[row * y.pitch + x];
    if (own != 0.0F || !(neighbour != 0.0F) || !(mask.data[row * mask.pitch + x] != 0.0F)) return false;
    own = 1.0F;
    return true;
  });
}

void distance(Plane y, ConstPlane a) noexcept {
  fill(y, [&](std::uint32_t row, std::uint32_t x) {
    if (!(a.row(row)[x] != 0.0F)) return 0.0F;
    return static_cast<float>(1 + std::min(std::min(row, y.height - 1 - row), std::min(x, y.width - 1 - x)));
  });
  sweep_until_stable(y, [&](std::int64_t row, std::int64_t x, float neighbour) {
    float& own = y.data[row * y.pitch + x];
    if (!(neighbour + 1.0F < own)) return false;
    own = neighbour + 1.0F;
    return true;
  });
}

void spread_max(Plane y, ConstPlane a, ConstPlane mask) noexcept {
  constexpr float kOut = std::numeric_limits<float>::quiet_NaN();  // loses every comparison
  fill(y, [&](std::uint32_t row, std::uint32_t x) {
    const float value = a.row(row)[x];
    if (!(mask.row(row)[x] != 0.0F)) return kOut;
    return std::isnan(value) ? -std::numeric_limits<float>::infinity() : value + 0.0F;
  });
  sweep_until_stable(y, [&](std::int64_t row, std::int64_t x, float neighbour) {
    float& own = y.data[row * y.pitch + x];
    if (!(neighbour > own)) return false;
    own = neighbour;
    return true;
  });
  fill(y, [&](std::uint32_t row, std::uint32_t x) {
    const float value = y.row(row)[x];
    return std::isnan(value) ? 0.0F : value;
  });
}

}  // namespace apron::vm
