#include "tests/bench/ShapeDepth.h"

#include <algorithm>
#include <numbers>

using namespace smartsurf;
using namespace smartsurf::world;

namespace {

constexpr float kHalfTop = 0.4F;

std::vector<Vec3> own_points(const Shape& shape) {
  std::vector<Vec3> points;
  if (shape.kind == scene::ShapeKind::kBox)
    for (int i = 0; i < 8; ++i)
      points.emplace_back(
          shape.half_extents.cwiseProduct(Vec3(i & 1 ? 1.0F : -1.0F, i & 2 ? 1.0F : -1.0F, i & 4 ? 1.0F : -1.0F)));
  constexpr int kAround = 32;
  if (shape.kind == scene::ShapeKind::kCylinder)
    for (int i = 0; i < 2 * kAround; ++i) {
      const float angle = static_cast<float>(i) * std::numbers::pi_v<float> / kAround;
      points.emplace_back(shape.radius * std::cos(angle), shape.radius * std::sin(angle),
                          i & 1 ? shape.low : shape.high);
    }
  for_each_part(shape, [&](const ConvexPart& piece) {
    if (piece.hull)
      points.insert(points.end(), piece.hull->hull->vertices.begin(), piece.hull->hull->vertices.end());
  });
  return points;
}

float depth_in_pin(const Vec3& p, float x, float y, float top) {
  return std::min({top - p.z(), kHalfTop - std::abs(p.x() - x), kHalfTop - std::abs(p.y() - y)});
}

}  // namespace

double depth_in_pins(const pin_scene::Workload& w, const Shape& shape, const Vec3& centre, const Mat3& axes,
                     const std::vector<float>& heights) {
  float deepest = 0.0F;
  auto inside = [&](const Vec3& p) {
    for_each_part(shape, [&](const ConvexPart& piece) {
      deepest = std::max(deepest, -signed_distance(piece, axes.transpose() * (p - centre)).distance);
    });
  };
  const std::vector<Vec3> points = own_points(shape);
  auto cell = [&w](float at) { return std::clamp(static_cast<int>(at), 0, w.n - 1); };
  for (int y = cell(centre.y() - shape.bounding_radius); y <= cell(centre.y() + shape.bounding_radius + 1); ++y)
    for (int x = cell(centre.x() - shape.bounding_radius); x <= cell(centre.x() + shape.bounding_radius + 1); ++x) {
      const float top = heights[static_cast<std::size_t>((w.n - 1 - y) * w.n + x)];
      const auto px = static_cast<float>(x), py = static_cast<float>(y);
      for (const Vec3& p : points) deepest = std::max(deepest, depth_in_pin(centre + axes * p, px, py, top));
      constexpr int kAlong = 8;
      for (int i = -kAlong; i <= kAlong; ++i) {
        const float u = kHalfTop * static_cast<float>(i) / kAlong;
        for (const float side : {-kHalfTop, kHalfTop})
          inside({px + side, py + u, top}), inside({px + u, py + side, top});
      }
    }
  return deepest;
}
