#include "smartsurf/world/CylinderOnColumn.h"

#include <algorithm>
#include <cmath>
#include <limits>

namespace smartsurf::world {
namespace {

// Cores as near as this count as overlapping, u.
constexpr float kOverlap = 1e-5F;

// A point in the cylinder's own axes, how far outside it is, and the way out. Below 0 inside, where it is a
// lower bound that is still convex.
struct Place {
  Vec3 at, normal;
  float distance = std::numeric_limits<float>::max();
};

struct Cylinder {
  float radius, half_height;
  Place place(const Vec3& p) const {
    const float across = length_of(p.x(), p.y()), side = std::copysign(1.0F, p.z());
    const float over_r = across - radius, over_z = std::abs(p.z()) - half_height;
    float out_r = std::max(0.0F, over_r), out_z = std::max(0.0F, over_z);
    float distance = length_of(out_r, out_z);
    if (distance < 1e-6F) {
      distance = std::max(over_r, over_z);
      out_r = over_r > over_z ? 1.0F : 0.0F, out_z = 1.0F - out_r;
    } else {
      out_r /= distance, out_z /= distance;
    }
    const float inward = across > 1e-9F ? out_r / across : 0.0F;
    return {p, {p.x() * inward, p.y() * inward, side * out_z}, distance};
  }
};

// The least distance along an edge. The distance is convex along it: its tangents bound it from below.
void descend(const Cylinder& cylinder, Place a, Place b, Place& best) {
  constexpr int kMostRounds = 12;
  constexpr float kPrecision = 1e-4F;
  const Vec3 along = b.at - a.at;
  float slope_a = a.normal.dot(along), slope_b = b.normal.dot(along);
  if (slope_a >= 0.0F || slope_b <= 0.0F) return;  // an end is nearest
  float from = 0.0F, to = 1.0F;
  for (int round = 0; round < kMostRounds; ++round) {
    const float width = to - from;
    // Where the tangents cross.
    const float cross =
        std::clamp((a.distance - b.distance + slope_b * width) / (slope_b - slope_a), 0.0F, width);
    if (a.distance + slope_a * cross > best.distance - kPrecision) return;
    // By turns where these cross, which finds a kink, and where the slope would vanish, which finds a
    // rounded minimum.
    const float step = round % 2 == 0 ? cross : width * slope_a / (slope_a - slope_b);
    const float share = from + step;
    const Place middle = cylinder.place(a.at + along * step);
    if (middle.distance < best.distance) best = middle;
    const float slope = middle.normal.dot(along);
    if (slope < 0.0F)
      a = middle, slope_a = slope, from = share;
    else
      b = middle, slope_b = slope, to = share;
  }
}

// The least distance to the edges around the top.
Place nearest_on_edges(const Core& core, const Column& q) {
  const Mat3& axes = core.axes;
  const Cylinder cylinder{core.piece.shape.radius - core.rounding, core.piece.shape.high - core.rounding};
  const Vec3 corner = axes.transpose() * (Vec3(q.west, q.south, q.top) - core.centre);
  const Vec3 east = axes.row(0).transpose() * (q.east - q.west);
  const Vec3 north = axes.row(1).transpose() * (q.north - q.south);
  const Place corners[4] = {cylinder.place(corner), cylinder.place(corner + east),
                            cylinder.place(corner + east + north), cylinder.place(corner + north)};
  Place best = corners[0];
  for (const Place& p : corners)
    if (p.distance < best.distance) best = p;
  for (int i = 0; i < 4; ++i) descend(cylinder, corners[i], corners[(i + 1) % 4], best);
  return best;
}

}  // namespace

std::optional<NearestPoints> nearest_on_top(const Core& core, const Column& q, float rounding) {
  const Column inner{q.west + rounding,
                     q.east - rounding,
                     q.south + rounding,
                     q.north - rounding,
                     q.top - rounding,
                     false,
                     false,
                     false,
                     false};
  const Vec3 lowest = core.farthest(Vec3(0, 0, -1));
  if (inner.contains(lowest.x(), lowest.y())) {
    const float distance = lowest.z() - inner.top;
    if (distance <= kOverlap) return std::nullopt;
    return NearestPoints{lowest, lowest - Vec3(0, 0, distance), Vec3::UnitZ(), distance, true};
  }
  const Place best = nearest_on_edges(core, inner);
  const Vec3 normal = core.axes * -best.normal;
  if (best.distance <= kOverlap || normal.z() < 0.0F) return std::nullopt;
  const Vec3 on_column = core.centre + core.axes * best.at;
  return NearestPoints{on_column + best.distance * normal, on_column, normal, best.distance, true};
}

}  // namespace smartsurf::world
