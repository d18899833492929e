#include "smartsurf/world/ColumnAxes.h"

#include <limits>
#include <utility>

namespace smartsurf::world {
namespace {

using scene::ShapeKind;

// A column has no underside.
constexpr float kLowestZ = -0.01F;
constexpr float kEdgeHandicap = 2e-3F;
// A normal that leans less than this out over a bridged side is taken as leaning by rounding only.
constexpr float kLeanTolerance = 0.05F;

}  // namespace

void ColumnAxes::add(const Vec3& normal, float least, float handicap) {
  if (normal.z() >= kLowestZ) axis_.push_back({normal, least, handicap});
}

void ColumnAxes::set(const Core& core, const Vec3& low, const Vec3& high) {
  axis_.clear();
  parted_ = 0;
  add(Vec3::UnitZ(), low.z(), 0.0F);
  if (core.piece.hull)
    add_hull(core);
  else if (core.piece.shape.kind == ShapeKind::kBox)
    add_box(core);
  else
    add_round(core);
  for (int i = 0; i < 2; ++i) {
    add(Vec3::Unit(i), low[i], 0.0F);
    add(-Vec3::Unit(i), -high[i], 0.0F);
  }
}

void ColumnAxes::add_box(const Core& core) {
  const Vec3& half = core.piece.shape.half;
  auto add_upward = [&](Vec3 n, float handicap) {
    if (n.z() < 0.0F) n = -n;
    const float reach = (core.axes.transpose() * n).cwiseAbs().dot(half);
    add(n, n.dot(core.centre) - reach, handicap);
  };
  for (int i = 0; i < 3; ++i) add_upward(core.axes.col(i), 0.0F);
  for (int i = 0; i < 3; ++i)
    for (int k = 0; k < 2; ++k) {
      const Vec3 n = core.axes.col(i).cross(Vec3::Unit(k));
      if (const float length = n.norm(); length > 0.05F) add_upward(n / length, kEdgeHandicap);
    }
}

void ColumnAxes::add_hull(const Core& core) {
  const HullPiece& hull = *core.piece.hull;
  const auto& faces = hull.piece->faces;
  const Vec3 down = -core.axes.row(2).transpose();  // everything in the hull's own axes
  for (int k = 0; k < 2; ++k) along_[k].resize(faces.size());
  for (std::size_t f = 0; f < faces.size(); ++f) {
    for (int k = 0; k < 2; ++k) along_[k][f] = core.axes.row(k) * faces[f].normal;
    if (faces[f].normal.dot(down) < kLowestZ) continue;
    const Vec3 n = core.axes * -faces[f].normal;
    add(n, n.dot(core.centre) - faces[f].offset, 0.0F);
  }
  for (const HullPiece::Edge& e : hull.edges)
    for (int k = 0; k < 2; ++k) {
      // Between the two faces' normals lies one across the column's edge only if they look to both sides of
      // it.
      const float left = along_[k][e.left], right = along_[k][e.right];
      if (left * right >= 0.0F) continue;
      const Vec3 outward = faces[e.left].normal * std::abs(right) + faces[e.right].normal * std::abs(left);
      const float length = outward.norm();
      if (length < 1e-6F || outward.dot(down) < kLowestZ * length) continue;
      const Vec3 n = core.axes * (outward / -length);
      add(n, n.dot(core.centre) - outward.dot(hull.piece->corners[e.corner]) / length, kEdgeHandicap);
    }
}

void ColumnAxes::add_round(const Core& core) {
  auto add_upward = [&](Vec3 n) {
    const float length = n.norm();
    if (length < 0.05F) return;
    n /= n.z() < 0.0F ? -length : length;
    add(n, n.dot(core.farthest_outside(-n)), 0.0F);
  };
  const Vec3 along = core.axes.col(2);
  add_upward(along);
  add_upward(Vec3::UnitZ() - along * along.z());
  for (int k = 0; k < 2; ++k) add_upward(along.cross(Vec3::Unit(k)));
}

float ColumnAxes::gap(const Axis& a, const Column& q) {
  const Vec3& n = a.normal;
  return a.least -
         ((n.x() > 0 ? q.east : q.west) * n.x() + (n.y() > 0 ? q.north : q.south) * n.y() + q.top * n.z());
}

bool ColumnAxes::look(const Column& q, float margin, Widest& out) {
  // What told the last column from the piece often tells its neighbour too.
  if (gap(axis_[parted_], q) > margin) return false;
  float best = -std::numeric_limits<float>::max();
  for (std::size_t i = 0; i < axis_.size(); ++i) {
    const Axis& a = axis_[i];
    const float wide = gap(a, q);
    if (wide > margin) {
      parted_ = i;
      return false;
    }
    if (wide - a.handicap <= best || q.leans_over_bridge(a.normal.x(), a.normal.y(), kLeanTolerance))
      continue;
    best = wide - a.handicap;
    out = {a.normal, wide};
  }
  return true;
}

}  // namespace smartsurf::world
