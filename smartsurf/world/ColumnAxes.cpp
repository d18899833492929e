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
  if (normal.z() >= kLowestZ) axes_.add(normal, least, handicap);
}

void ColumnAxes::set(const Core& core, const Vec3& low, const Vec3& high) {
  axes_.clear();
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
  auto add_both_ways = [&](const Vec3& n, float handicap) {
    const float reach = (core.axes.transpose() * n).cwiseAbs().dot(half), at = n.dot(core.centre);
    add(n, at - reach, handicap);
    add(-n, -at - reach, handicap);
  };
  for (int i = 0; i < 3; ++i) add_both_ways(core.axes.col(i), 0.0F);
  for (int i = 0; i < 3; ++i)
    for (int k = 0; k < 2; ++k) {
      const Vec3 n = core.axes.col(i).cross(Vec3::Unit(k));
      if (const float length = n.norm(); length > 0.05F) add_both_ways(n / length, kEdgeHandicap);
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
      add(n, n.dot(core.centre) - outward.dot(hull.piece->vertices[e.corner]) / length, kEdgeHandicap);
    }
}

void ColumnAxes::add_round(const Core& core) {
  auto add_both_ways = [&](const Vec3& along) {
    const float length = along.norm();
    if (length < 0.05F) return;
    for (const Vec3& n : {Vec3(along / length), Vec3(along / -length)})
      if (n.z() >= kLowestZ) add(n, n.dot(core.farthest_outside(-n)), 0.0F);
  };
  const Vec3 along = core.axes.col(2);
  add_both_ways(along);
  add_both_ways(Vec3::UnitZ() - along * along.z());
  for (int k = 0; k < 2; ++k) add_both_ways(along.cross(Vec3::Unit(k)));
}

void ColumnAxes::Axes::clear() {
  for (auto* v : {&x, &y, &z, &least, &handicap}) v->clear();
}

void ColumnAxes::Axes::add(const Vec3& normal, float least_of_piece, float handicap_of_kind) {
  x.push_back(normal.x()), y.push_back(normal.y()), z.push_back(normal.z());
  least.push_back(least_of_piece);
  handicap.push_back(handicap_of_kind);
}

inline float ColumnAxes::Axes::gap(std::size_t i, const Column& q) const {
  return least[i] -
         ((x[i] > 0 ? q.east : q.west) * x[i] + (y[i] > 0 ? q.north : q.south) * y[i] + q.top * z[i]);
}

bool ColumnAxes::look(const Column& q, float margin, Widest& out) {
  // What told the last column from the piece often tells its neighbour too.
  if (axes_.gap(parted_, q) > margin) return false;
  const std::size_t count = axes_.size();
  gap_.resize(count);
  for (std::size_t i = 0; i < count; ++i) gap_[i] = axes_.gap(i, q);
  float best = -std::numeric_limits<float>::max();
  std::size_t chosen = 0;
  for (std::size_t i = 0; i < count; ++i) {
    if (gap_[i] > margin) {
      parted_ = i;
      return false;
    }
    if (gap_[i] - axes_.handicap[i] <= best || q.leans_over_bridge(axes_.x[i], axes_.y[i], kLeanTolerance))
      continue;
    best = gap_[i] - axes_.handicap[i];
    chosen = i;
  }
  out = {Vec3(axes_.x[chosen], axes_.y[chosen], axes_.z[chosen]), gap_[chosen]};
  return true;
}

}  // namespace smartsurf::world
