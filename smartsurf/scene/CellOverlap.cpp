#include "smartsurf/scene/CellOverlap.h"

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <limits>
#include <vector>

namespace smartsurf::scene {
namespace {

constexpr double kMaxCoordinate = 1e6, kMinTop = 1e-3;
constexpr double kRelativeTolerance = 1e-6;  // of a top's diagonal

// Axes of a top, and its half extents along them.
struct Top {
  explicit Top(const CellPose& p)
      : centre(p.x, p.y), u(std::cos(p.angle), std::sin(p.angle)), v(-u.y(), u.x()) {}
  Eigen::Vector2d centre, u, v;
  double radius_along(const Eigen::Vector2d& axis, const Eigen::Vector2d& half) const {
    return half.x() * std::abs(u.dot(axis)) + half.y() * std::abs(v.dot(axis));
  }
};

// The least overlap along the sides' normals (separating axes); ≤ 0 if the tops are disjoint.
double overlap_depth(const Top& a, const Top& b, const Eigen::Vector2d& half) {
  double depth = std::numeric_limits<double>::infinity();
  for (const Eigen::Vector2d& axis : {a.u, a.v, b.u, b.v})
    depth = std::min(depth, a.radius_along(axis, half) + b.radius_along(axis, half) -
                                std::abs(axis.dot(b.centre - a.centre)));
  return depth;
}

struct BucketedCell {
  std::int64_t row, column;
  int cell;
  auto operator<=>(const BucketedCell&) const = default;
};

// All cells with a top, sorted by the bucket of their centre. A bucket is as wide as a top's diagonal.
std::vector<BucketedCell> sort_into_buckets(const SurfaceSpec& s, double width) {
  std::vector<BucketedCell> all;
  for (int i = 0; i < s.cell_count(); ++i) {
    const CellPose& p = s.cell_poses[i];
    if (s.is_empty(i / s.columns, i % s.columns)) continue;
    all.push_back({static_cast<std::int64_t>(std::floor(p.y / width)),
                   static_cast<std::int64_t>(std::floor(p.x / width)), i});
  }
  std::ranges::sort(all);
  return all;
}

}  // namespace

std::optional<CellOverlap> find_overlap(const SurfaceSpec& s) {
  if (s.cell_poses.empty()) return std::nullopt;
  const Eigen::Vector2d half(0.5 * s.pin.top_x, 0.5 * s.pin.top_y);
  if (!(half.minCoeff() >= 0.5 * kMinTop && half.maxCoeff() <= kMaxCoordinate)) return std::nullopt;
  for (const CellPose& p : s.cell_poses)
    if (!(std::abs(p.x) <= kMaxCoordinate && std::abs(p.y) <= kMaxCoordinate && std::isfinite(p.angle)))
      return std::nullopt;
  const double diagonal = 2.0 * half.norm();
  const std::vector<BucketedCell> cells = sort_into_buckets(s, diagonal);
  const auto test = [&](int a, int b) -> std::optional<CellOverlap> {
    const double depth = overlap_depth(Top(s.cell_poses[a]), Top(s.cell_poses[b]), half);
    if (depth <= kRelativeTolerance * diagonal) return std::nullopt;
    return CellOverlap{std::min(a, b), std::max(a, b), depth};
  };
  // Each pair of neighbouring buckets is visited once: a cell is tested against the later cells of its own
  // bucket, the next bucket of its row and three buckets of the next row.
  constexpr int kFirst = std::numeric_limits<int>::min();
  for (auto it = cells.begin(); it != cells.end(); ++it) {
    const auto in_reach = [&](auto other, std::int64_t row) {
      return other != cells.end() && other->row == row && other->column <= it->column + 1;
    };
    for (auto other = it + 1; in_reach(other, it->row); ++other)
      if (const auto overlap = test(it->cell, other->cell)) return overlap;
    for (auto other = std::ranges::lower_bound(cells, BucketedCell{it->row + 1, it->column - 1, kFirst});
         in_reach(other, it->row + 1); ++other)
      if (const auto overlap = test(it->cell, other->cell)) return overlap;
  }
  return std::nullopt;
}

}  // namespace smartsurf::scene
