#include "smartsurf/world/field/CylinderOnColumn.h"

#include <algorithm>
#include <cmath>
#include <limits>

namespace smartsurf::world {
namespace {

constexpr float kTolerance = 1e-4F;  // of the distance, u

// A cylinder in body axes.
struct CylinderProxy {
  float radius, half_height;
};

// Distance and direction from the cylinder to an exterior point; 0 for interior points.
SignedDistance exterior_distance(const CylinderProxy& c, const Vec3& p) {
  const float across = length_of(p.x(), p.y());
  const float out_r = std::max(0.0F, across - c.radius),
              out_z = std::max(0.0F, std::abs(p.z()) - c.half_height);
  const float distance = length_of(out_r, out_z);
  if (!(distance > 1e-5F)) return {Vec3::Zero(), 0.0F};
  const float along_r = out_r > 0.0F ? out_r / (distance * across) : 0.0F;
  return {Vec3(p.x() * along_r, p.y() * along_r, std::copysign(out_z / distance, p.z())), distance};
}

struct EdgePoint {
  float position = 0.0F;  // from the edge's first end, u
  SignedDistance offset{Vec3::Zero(), std::numeric_limits<float>::max()};
  float slope = 0.0F;  // of the distance along the edge
};

// The distance is convex along the edge: its minimum lies where the direction is perpendicular to the edge,
// or at an end. Regula falsi finds it; the step is clamped because the slope changes abruptly near a rim.
EdgePoint closest_on_edge(const CylinderProxy& c, const Vec3& from, const Vec3& along, float length) {
  constexpr int kMaxIterations = 16;
  constexpr float kMinFraction = 0.15F;
  auto evaluate = [&](float position) {
    EdgePoint e{position, exterior_distance(c, from + position * along)};
    e.slope = e.offset.normal.dot(along);
    return e;
  };
  EdgePoint low = evaluate(0.0F), high = evaluate(length);
  if (low.slope >= 0.0F) return low;
  if (high.slope <= 0.0F) return high;
  auto flatter_end = [&] { return -low.slope < high.slope ? low : high; };
  for (int iteration = 0; iteration < kMaxIterations; ++iteration) {
    if (std::abs(flatter_end().slope) * (high.position - low.position) <= 0.5F * kTolerance) break;
    const float fraction =
        std::clamp(low.slope / (low.slope - high.slope), kMinFraction, 1.0F - kMinFraction);
    const EdgePoint middle = evaluate(low.position + fraction * (high.position - low.position));
    (middle.slope < 0.0F ? low : high) = middle;
  }
  // Interpolates the directions at both ends to the one perpendicular to the edge.
  EdgePoint closest = flatter_end();
  closest.offset.normal = (high.slope * low.offset.normal - low.slope * high.offset.normal).normalized();
  return closest;
}

// An upper edge of the shrunk column, and the outward normal of the side below it.
struct Edge {
  Vec3 from{0, 0, 0}, along{0, 0, 0}, side{0, 0, 0};
  float length = 0.0F;
};

// Finds the edge perpendicular to a horizontal axis on the cylinder's side. False if it is on neither side.
bool edge_under_axis(const ConvexProxy& cylinder, const Column& q, float convex_radius, const Vec3& towards,
                     int axis, Edge& out) {
  const Vec3 low(q.west + convex_radius, q.south + convex_radius, q.top - convex_radius);
  const Vec3 high(q.east - convex_radius, q.north - convex_radius, q.top - convex_radius);
  float lean = towards[axis];
  if (std::abs(lean) < 1e-4F) {
    const float lowest = cylinder.support(-Vec3::UnitZ())[axis];
    lean = lowest > high[axis] ? 1.0F : lowest < low[axis] ? -1.0F : 0.0F;
  }
  out.from = low;
  if (lean > 0.0F) out.from[axis] = high[axis];
  out.along = Vec3::Unit(1 - axis);
  out.side = std::copysign(1.0F, lean) * Vec3::Unit(axis);
  out.length = out.along.dot(high - low);
  return lean != 0.0F && out.length > 0.0F;
}

}  // namespace

bool closest_on_edges(const ConvexProxy& cylinder, const Column& q, float convex_radius, const Vec3& towards,
                      ClosestPoints& out) {
  const Shape& s = cylinder.part.shape;
  const CylinderProxy proxy{s.radius - cylinder.convex_radius, s.high - cylinder.convex_radius};
  const Mat3 to_local = cylinder.axes.transpose();
  EdgePoint best;
  Edge best_edge;
  for (int axis = 0; axis < 2; ++axis) {
    Edge edge;
    if (!edge_under_axis(cylinder, q, convex_radius, towards, axis, edge)) continue;
    const EdgePoint here =
        closest_on_edge(proxy, to_local * (edge.from - cylinder.centre), to_local * edge.along, edge.length);
    if (here.offset.distance < best.offset.distance) best = here, best_edge = edge;
  }
  const float distance = best.offset.distance;
  if (best_edge.length == 0.0F || distance == 0.0F) return false;
  const Vec3 normal = cylinder.axes * -best.offset.normal;
  // If the normal points away from the top or the side, a point on that face is closer.
  if (normal.z() < 0.0F || normal.dot(best_edge.side) < 0.0F) return false;
  const Vec3 on_column = best_edge.from + best.position * best_edge.along;
  if (normal.dot(cylinder.support(-normal) - on_column) < distance - kTolerance) return false;
  out = {on_column + distance * normal, on_column, normal, distance, true};
  return true;
}

}  // namespace smartsurf::world
