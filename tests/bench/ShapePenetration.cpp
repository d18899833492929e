#include "tests/bench/ShapePenetration.h"

#include <algorithm>
#include <numbers>

using namespace smartsurf;
using namespace smartsurf::world;

namespace {

constexpr float kHalfTop = 0.4F;

std::vector<Vec3> surface_points(const Shape& shape) {
  std::vector<Vec3> points;
  if (shape.kind == scene::ShapeKind::kBox)
    for (int i = 0; i < 8; ++i)
      points.emplace_back(shape.half_extents.cwiseProduct(
          Vec3(i & 1 ? 1.0F : -1.0F, i & 2 ? 1.0F : -1.0F, i & 4 ? 1.0F : -1.0F)));
  constexpr int kRimSamples = 32;
  if (shape.kind == scene::ShapeKind::kCylinder)
    for (int i = 0; i < 2 * kRimSamples; ++i) {
      const float angle = static_cast<float>(i) * std::numbers::pi_v<float> / kRimSamples;
      points.emplace_back(shape.radius * std::cos(angle), shape.radius * std::sin(angle),
                          i & 1 ? shape.low : shape.high);
    }
  for_each_part(shape, [&](const ConvexPart& part) {
    if (part.hull)
      points.insert(points.end(), part.hull->hull->vertices.begin(), part.hull->hull->vertices.end());
  });
  return points;
}

float point_penetration(const Vec3& p, float x, float y, float top) {
  return std::min({top - p.z(), kHalfTop - std::abs(p.x() - x), kHalfTop - std::abs(p.y() - y)});
}

}  // namespace

double max_shape_penetration(const pin_scene::Workload& w, const Shape& shape, const Vec3& centre,
                             const Mat3& axes, const std::vector<float>& heights) {
  float max_depth = 0.0F;
  auto measure_edge_point = [&](const Vec3& p) {
    for_each_part(shape, [&](const ConvexPart& part) {
      max_depth = std::max(max_depth, -signed_distance(part, axes.transpose() * (p - centre)).distance);
    });
  };
  const std::vector<Vec3> points = surface_points(shape);
  auto cell = [&w](float at) { return std::clamp(static_cast<int>(at), 0, w.n - 1); };
  for (int y = cell(centre.y() - shape.bounding_radius); y <= cell(centre.y() + shape.bounding_radius + 1);
       ++y)
    for (int x = cell(centre.x() - shape.bounding_radius); x <= cell(centre.x() + shape.bounding_radius + 1);
         ++x) {
      const float top = heights[(w.n - 1 - y) * w.n + x];
      const auto px = static_cast<float>(x), py = static_cast<float>(y);
      for (const Vec3& p : points)
        max_depth = std::max(max_depth, point_penetration(centre + axes * p, px, py, top));
      constexpr int kEdgeSamples = 8;
      for (int i = -kEdgeSamples; i <= kEdgeSamples; ++i) {
        const float u = kHalfTop * static_cast<float>(i) / kEdgeSamples;
        for (const float side : {-kHalfTop, kHalfTop})
          measure_edge_point({px + side, py + u, top}), measure_edge_point({px + u, py + side, top});
      }
    }
  return max_depth;
}
