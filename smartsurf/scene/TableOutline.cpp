#include "smartsurf/scene/TableOutline.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <numbers>
#include <utility>

namespace smartsurf::scene {
namespace {

constexpr int kMostTiles = 2048;  // along each side
constexpr int kGap = 4;           // tiles: half of the gaps that are closed
constexpr std::uint8_t kOutside = 0, kTable = 1, kEnclosed = 2;

// The cells that are there.
std::vector<CellPlace> places_of(const SurfaceSpec& surface) {
  std::vector<CellPlace> places;
  for (int r = 0; r < surface.rows; ++r)
    for (int c = 0; c < surface.columns; ++c) {
      if (surface.is_empty(r, c)) continue;
      const Eigen::Vector2d centre = surface.centre(r, c);
      const double angle =
          surface.places.empty() ? 0.0 : surface.places[static_cast<std::size_t>(surface.index(r, c))].angle;
      places.push_back({centre.x(), centre.y(), angle});
    }
  return places;
}

// How far most cells are from their nearest neighbour: the median; 0 for less than two. By a sweep from west
// to east, which looks no farther along x than the nearest found so far.
double spacing(std::vector<CellPlace> places) {
  if (places.size() < 2) return 0.0;
  std::ranges::sort(places, {}, &CellPlace::x);
  std::vector<double> nearest(places.size(), std::numeric_limits<double>::infinity());
  for (std::size_t i = 0; i < places.size(); ++i)
    for (std::size_t j = i + 1; j < places.size() && places[j].x - places[i].x < nearest[i]; ++j) {
      const double apart = std::hypot(places[j].x - places[i].x, places[j].y - places[i].y);
      nearest[i] = std::min(nearest[i], apart);
      nearest[j] = std::min(nearest[j], apart);
    }
  const auto middle = nearest.begin() + static_cast<std::ptrdiff_t>(nearest.size() / 2);
  std::ranges::nth_element(nearest, middle);
  return *middle;
}

}  // namespace

TableOutline::TableOutline(const SurfaceSpec& surface)
    : low_x_(-surface.pitch / 2.0),
      low_y_(low_x_),
      high_x_((surface.columns - 0.5) * surface.pitch),
      high_y_((surface.rows - 0.5) * surface.pitch) {
  const std::vector<CellPlace> places = places_of(surface);
  if (surface.places.empty() && places.size() == static_cast<std::size_t>(surface.cells())) return;
  const double half =
      surface.places.empty() ? surface.pitch / 2.0 : std::max(surface.pitch, spacing(places)) / 2.0;
  low_x_ = low_y_ = std::numeric_limits<double>::infinity();
  high_x_ = high_y_ = -low_x_;
  const double reach = half * std::numbers::sqrt2;
  for (const CellPlace& p : places) {
    low_x_ = std::min(low_x_, p.x - reach), high_x_ = std::max(high_x_, p.x + reach);
    low_y_ = std::min(low_y_, p.y - reach), high_y_ = std::max(high_y_, p.y + reach);
  }
  if (places.empty()) return;
  tile_ = std::max({surface.pitch / 4.0, (high_x_ - low_x_) / kMostTiles, (high_y_ - low_y_) / kMostTiles});
  constexpr int kRing = kGap + 1;  // around the table, to spread into and to fill from
  columns_ = static_cast<int>(std::ceil((high_x_ - low_x_) / tile_)) + 2 * kRing;
  rows_ = static_cast<int>(std::ceil((high_y_ - low_y_) / tile_)) + 2 * kRing;
  low_x_ -= kRing * tile_, low_y_ -= kRing * tile_;
  tiles_.assign(at(rows_, 0), kOutside);
  for (const CellPlace& place : places) cover(place, half);
  close_gaps();
  fill_holes();
}

// Every tile whose middle lies in the cell's square, and the one that the cell's centre lies in.
void TableOutline::cover(const CellPlace& place, double half) {
  const double reach = half * std::numbers::sqrt2, cosine = std::cos(place.angle),
               sine = std::sin(place.angle);
  tiles_[at(static_cast<int>((place.y - low_y_) / tile_), static_cast<int>((place.x - low_x_) / tile_))] =
      kTable;
  const double slack = half * (1.0 + 1e-9);  // where two squares meet nothing is left between them
  const int r0 = static_cast<int>((place.y - reach - low_y_) / tile_);
  const int r1 = static_cast<int>((place.y + reach - low_y_) / tile_);
  const int c0 = static_cast<int>((place.x - reach - low_x_) / tile_);
  const int c1 = static_cast<int>((place.x + reach - low_x_) / tile_);
  for (int r = r0; r <= r1; ++r)
    for (int c = c0; c <= c1; ++c) {
      const double x = low_x_ + (c + 0.5) * tile_ - place.x, y = low_y_ + (r + 0.5) * tile_ - place.y;
      if (std::abs(x * cosine + y * sine) <= slack && std::abs(y * cosine - x * sine) <= slack)
        tiles_[at(r, c)] = kTable;
    }
}

// The closing of morphology, by a square.
void TableOutline::close_gaps() {
  for (const std::uint8_t what : {kTable, kOutside})
    for (const bool along_rows : {true, false}) spread(what, along_rows);
}

void TableOutline::spread(std::uint8_t what, bool along_rows) {
  const int lines = along_rows ? rows_ : columns_, length = along_rows ? columns_ : rows_;
  const auto tile = [&](int line, int k) -> std::uint8_t& {
    return tiles_[along_rows ? at(line, k) : at(k, line)];
  };
  std::vector<std::uint8_t> before(static_cast<std::size_t>(length));
  for (int line = 0; line < lines; ++line) {
    for (int k = 0; k < length; ++k) before[static_cast<std::size_t>(k)] = tile(line, k);
    for (int k = 0; k < length; ++k)
      if (before[static_cast<std::size_t>(k)] == what)
        for (int near = std::max(0, k - kGap); near <= std::min(length - 1, k + kGap); ++near)
          tile(line, near) = what;
  }
}

// What cannot be reached from outside belongs to the table.
void TableOutline::fill_holes() {
  std::ranges::replace(tiles_, kOutside, kEnclosed);  // until it is reached
  std::vector<std::pair<int, int>> border{{0, 0}};
  tiles_[0] = kOutside;
  while (!border.empty()) {
    const auto [row, column] = border.back();
    border.pop_back();
    for (const auto& [r, c] : {std::pair(row - 1, column), std::pair(row + 1, column),
                               std::pair(row, column - 1), std::pair(row, column + 1)}) {
      if (r < 0 || c < 0 || r >= rows_ || c >= columns_ || tiles_[at(r, c)] != kEnclosed) continue;
      tiles_[at(r, c)] = kOutside;
      border.push_back({r, c});
    }
  }
  std::ranges::replace(tiles_, kEnclosed, kTable);
}

bool TableOutline::holds(double x, double y) const noexcept {
  if (!(x > low_x_ && x < high_x_ && y > low_y_ && y < high_y_)) return false;
  if (tiles_.empty()) return true;
  return tiles_[at(static_cast<int>((y - low_y_) / tile_), static_cast<int>((x - low_x_) / tile_))] == kTable;
}

}  // namespace smartsurf::scene
