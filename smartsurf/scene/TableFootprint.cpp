#include "smartsurf/scene/TableFootprint.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <numbers>
#include <utility>

namespace smartsurf::scene {
namespace {

constexpr int kMaxTilesPerSide = 2048;
constexpr int kClosingRadius = 4;  // tiles; closes gaps up to twice as wide
constexpr std::uint8_t kOutside = 0, kInside = 1, kEnclosed = 2;

// The poses of all cells that are not empty.
std::vector<CellPose> collect_cell_poses(const SurfaceSpec& surface) {
  std::vector<CellPose> poses;
  for (int r = 0; r < surface.rows; ++r)
    for (int c = 0; c < surface.columns; ++c) {
      if (surface.is_empty(r, c)) continue;
      const Eigen::Vector2d centre = surface.centre(r, c);
      const double angle = surface.cell_poses.empty() ? 0.0 : surface.cell_poses[surface.index(r, c)].angle;
      poses.push_back({centre.x(), centre.y(), angle});
    }
  return poses;
}

// The median distance of cells from their nearest neighbours; 0 for fewer than two cells. The sweep along x
// stops at the nearest distance found so far.
double median_cell_spacing(std::vector<CellPose> poses) {
  if (poses.size() < 2) return 0.0;
  std::ranges::sort(poses, {}, &CellPose::x);
  std::vector<double> nearest(poses.size(), std::numeric_limits<double>::infinity());
  for (std::size_t i = 0; i < poses.size(); ++i)
    for (std::size_t j = i + 1; j < poses.size() && poses[j].x - poses[i].x < nearest[i]; ++j) {
      const double distance = std::hypot(poses[j].x - poses[i].x, poses[j].y - poses[i].y);
      nearest[i] = std::min(nearest[i], distance);
      nearest[j] = std::min(nearest[j], distance);
    }
  const auto median = nearest.begin() + nearest.size() / 2;
  std::ranges::nth_element(nearest, median);
  return *median;
}

}  // namespace

TableFootprint::TableFootprint(const SurfaceSpec& surface)
    : min_x_(-surface.pitch / 2.0),
      min_y_(min_x_),
      max_x_((surface.columns - 0.5) * surface.pitch),
      max_y_((surface.rows - 0.5) * surface.pitch) {
  const std::vector<CellPose> poses = collect_cell_poses(surface);
  // A skin lies over the empty cells too.
  if (surface.cell_poses.empty() && (surface.skin || std::ssize(poses) == surface.cell_count())) return;
  const double half_side = surface.cell_poses.empty()
                               ? surface.pitch / 2.0
                               : std::max(surface.pitch, median_cell_spacing(poses)) / 2.0;
  min_x_ = min_y_ = std::numeric_limits<double>::infinity();
  max_x_ = max_y_ = -min_x_;
  const double circumradius = half_side * std::numbers::sqrt2;
  for (const CellPose& p : poses) {
    min_x_ = std::min(min_x_, p.x - circumradius), max_x_ = std::max(max_x_, p.x + circumradius);
    min_y_ = std::min(min_y_, p.y - circumradius), max_y_ = std::max(max_y_, p.y + circumradius);
  }
  if (poses.empty()) return;
  tile_size_ = std::max(
      {surface.pitch / 4.0, (max_x_ - min_x_) / kMaxTilesPerSide, (max_y_ - min_y_) / kMaxTilesPerSide});
  constexpr int kMargin = kClosingRadius + 1;  // for dilation, plus a ring from which fill_holes() starts
  columns_ = static_cast<int>(std::ceil((max_x_ - min_x_) / tile_size_)) + 2 * kMargin;
  rows_ = static_cast<int>(std::ceil((max_y_ - min_y_) / tile_size_)) + 2 * kMargin;
  min_x_ -= kMargin * tile_size_, min_y_ -= kMargin * tile_size_;
  tiles_.assign(tile_index(rows_, 0), kOutside);
  for (const CellPose& pose : poses) rasterize_cell(pose, half_side);
  close_gaps();
  fill_holes();
}

// Marks all tiles whose centre is inside the cell's square, and the tile that contains the cell's centre.
void TableFootprint::rasterize_cell(const CellPose& pose, double half_side) {
  const double circumradius = half_side * std::numbers::sqrt2, cosine = std::cos(pose.angle),
               sine = std::sin(pose.angle);
  tiles_[tile_index(static_cast<int>((pose.y - min_y_) / tile_size_),
                    static_cast<int>((pose.x - min_x_) / tile_size_))] = kInside;
  const double tolerance = half_side * (1.0 + 1e-9);  // leaves no gap between adjacent squares
  const int r0 = static_cast<int>((pose.y - circumradius - min_y_) / tile_size_);
  const int r1 = static_cast<int>((pose.y + circumradius - min_y_) / tile_size_);
  const int c0 = static_cast<int>((pose.x - circumradius - min_x_) / tile_size_);
  const int c1 = static_cast<int>((pose.x + circumradius - min_x_) / tile_size_);
  for (int r = r0; r <= r1; ++r)
    for (int c = c0; c <= c1; ++c) {
      const double x = min_x_ + (c + 0.5) * tile_size_ - pose.x, y = min_y_ + (r + 0.5) * tile_size_ - pose.y;
      if (std::abs(x * cosine + y * sine) <= tolerance && std::abs(y * cosine - x * sine) <= tolerance)
        tiles_[tile_index(r, c)] = kInside;
    }
}

// Morphological closing with a square structuring element: dilation, then erosion.
void TableFootprint::close_gaps() {
  for (const std::uint8_t label : {kInside, kOutside})
    for (const bool along_rows : {true, false}) dilate(label, along_rows);
}

void TableFootprint::dilate(std::uint8_t label, bool along_rows) {
  const int lines = along_rows ? rows_ : columns_, length = along_rows ? columns_ : rows_;
  const auto tile = [&](int line, int k) -> std::uint8_t& {
    return tiles_[along_rows ? tile_index(line, k) : tile_index(k, line)];
  };
  std::vector<std::uint8_t> previous(length);
  for (int line = 0; line < lines; ++line) {
    for (int k = 0; k < length; ++k) previous[k] = tile(line, k);
    for (int k = 0; k < length; ++k)
      if (previous[k] == label)
        for (int neighbour = std::max(0, k - kClosingRadius);
             neighbour <= std::min(length - 1, k + kClosingRadius); ++neighbour)
          tile(line, neighbour) = label;
  }
}

// Flood fill from a corner of the raster. Tiles that it does not reach belong to the table.
void TableFootprint::fill_holes() {
  std::ranges::replace(tiles_, kOutside, kEnclosed);  // until reached from outside
  std::vector<std::pair<int, int>> frontier{{0, 0}};
  tiles_[0] = kOutside;
  while (!frontier.empty()) {
    const auto [row, column] = frontier.back();
    frontier.pop_back();
    for (const auto& [r, c] : {std::pair(row - 1, column), std::pair(row + 1, column),
                               std::pair(row, column - 1), std::pair(row, column + 1)}) {
      if (r < 0 || c < 0 || r >= rows_ || c >= columns_ || tiles_[tile_index(r, c)] != kEnclosed) continue;
      tiles_[tile_index(r, c)] = kOutside;
      frontier.push_back({r, c});
    }
  }
  std::ranges::replace(tiles_, kEnclosed, kInside);
}

bool TableFootprint::contains(double x, double y) const noexcept {
  if (!(x > min_x_ && x < max_x_ && y > min_y_ && y < max_y_)) return false;
  if (tiles_.empty()) return true;
  return tiles_[tile_index(static_cast<int>((y - min_y_) / tile_size_),
                           static_cast<int>((x - min_x_) / tile_size_))] == kInside;
}

}  // namespace smartsurf::scene
