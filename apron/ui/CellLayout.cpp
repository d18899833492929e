#include "apron/ui/CellLayout.h"

#include <algorithm>
#include <cmath>
#include <numbers>

namespace apron::ui {
namespace {

constexpr float kRowPitch = std::numbers::sqrt3_v<float> / 2.0F;
constexpr float kRadius = std::numbers::inv_sqrt3_v<float>;  // of a hexagon, to its corners

constexpr std::array<CellPoint, 6> kHexagon{{{0.0F, -kRadius},
                                             {0.5F, -kRadius / 2.0F},
                                             {0.5F, kRadius / 2.0F},
                                             {0.0F, kRadius},
                                             {-0.5F, kRadius / 2.0F},
                                             {-0.5F, -kRadius / 2.0F}}};

std::uint32_t clamped(float at, std::uint32_t most) {
  return static_cast<std::uint32_t>(std::clamp(at, 0.0F, static_cast<float>(most)));
}

}  // namespace

CellLayout CellLayout::hexagons(bool first_row_shifted) {
  CellLayout layout;
  layout.hexagonal_ = true;
  layout.first_row_shifted_ = first_row_shifted;
  return layout;
}

CellLayout CellLayout::of_surface(std::span<const std::array<float, 3>> positions, std::uint32_t rows,
                                  std::uint32_t columns, double pitch) {
  if (rows < 2 || positions.size() != std::size_t{rows} * columns) return {};
  // The southernmost row begins furthest in the west.
  const CellLayout layout = hexagons(rows % 2 == 0);
  const CellPoint origin = layout.centre({0, rows - 1});
  const std::array<float, 3>& south_west = positions[std::size_t{rows - 1} * columns];
  for (std::uint32_t y = 0; y < rows; ++y)
    for (std::uint32_t x = 0; x < columns; ++x) {
      const CellPoint right = layout.centre({x, y});
      const std::array<float, 3>& there = positions[std::size_t{y} * columns + x];
      const double east = (there[0] - south_west[0]) / pitch, south = (south_west[1] - there[1]) / pitch;
      if (std::hypot(east - (right.x - origin.x), south - (right.y - origin.y)) > 1e-3) return {};
    }
  return layout;
}

CellPoint CellLayout::extent(std::uint32_t width, std::uint32_t height) const {
  const auto w = static_cast<float>(width), h = static_cast<float>(height);
  if (!hexagonal_) return {w, h};
  return {w + (height > 1 || first_row_shifted_ ? 0.5F : 0.0F), (h - 1.0F) * kRowPitch + 2.0F * kRadius};
}

CellPoint CellLayout::centre(const debugger::Cell& cell) const {
  const auto x = static_cast<float>(cell.x), y = static_cast<float>(cell.y);
  if (!hexagonal_) return {x + 0.5F, y + 0.5F};
  return {x + (is_shifted(cell.y) ? 1.0F : 0.5F), y * kRowPitch + kRadius};
}

// Each point of the plane belongs to the hexagon of the nearest centre.
std::optional<debugger::Cell> CellLayout::cell_at(CellPoint point, std::uint32_t width,
                                                  std::uint32_t height) const {
  const int row = static_cast<int>(std::floor(hexagonal_ ? (point.y - kRadius) / kRowPitch : point.y));
  std::optional<debugger::Cell> nearest;
  float least = INFINITY;
  for (int y = row; y <= row + (hexagonal_ ? 1 : 0); ++y) {
    const bool shifted = hexagonal_ && (y % 2 == 0) == first_row_shifted_;
    const int x = static_cast<int>(std::floor(point.x - (shifted ? 0.5F : 0.0F)));
    const float east = point.x - (static_cast<float>(x) + (shifted ? 1.0F : 0.5F)),
                south = hexagonal_ ? point.y - (static_cast<float>(y) * kRowPitch + kRadius) : 0.0F;
    const float distance = std::hypot(east, south);
    if (distance >= least) continue;
    least = distance;
    const bool exists = x >= 0 && y >= 0 && x < static_cast<int>(width) && y < static_cast<int>(height);
    nearest =
        exists ? std::optional(debugger::Cell{static_cast<std::uint32_t>(x), static_cast<std::uint32_t>(y)})
               : std::nullopt;
  }
  return nearest;
}

CellRange CellLayout::cells_within(CellPoint north_west, CellPoint south_east, std::uint32_t width,
                                   std::uint32_t height) const {
  const float row = row_pitch();
  return {clamped(std::floor(north_west.x) - 1.0F, width), clamped(std::ceil(south_east.x) + 1.0F, width),
          clamped(std::floor(north_west.y / row) - 1.0F, height),
          clamped(std::ceil(south_east.y / row) + 1.0F, height)};
}

const std::array<CellPoint, 6>& CellLayout::hexagon() { return kHexagon; }

float CellLayout::row_pitch() const { return hexagonal_ ? kRowPitch : 1.0F; }

}  // namespace apron::ui
