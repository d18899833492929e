#include "smartsurf/world/ConvexOnField.h"

#include <algorithm>
#include <cmath>

#include "smartsurf/world/Feature.h"
#include "smartsurf/world/Gjk.h"
#include "smartsurf/world/SphereOnField.h"

namespace smartsurf::world {
namespace {

using scene::ShapeKind;

// A normal that leans less than this out over a bridged side is taken as leaning by rounding only.
constexpr float kLeanTolerance = 0.05F;
constexpr int kRim = 8;

// Calls each(point) for the points that touch a plane first: corners, the tip, and eight points of each rim, one of
// them the lowest. A capsule has none.
template <class Each>
void for_feature_points(const Piece& piece, const Vec3& centre, const Mat3& axes, Each each) {
  const Shape& s = piece.shape;
  auto own = [&](const Vec3& p) { each(Vec3(centre + axes * p)); };
  auto rim = [&](float z) {
    Vec3 lowest(-axes(2, 0), -axes(2, 1), 0);
    lowest = lowest.squaredNorm() > 1e-10F ? Vec3(lowest.normalized()) : Vec3(1, 0, 0);
    constexpr float kDiagonal = 0.70710678F;
    static constexpr float kAlong[kRim] = {1, kDiagonal, 0, -kDiagonal, -1, -kDiagonal, 0, kDiagonal};
    for (int i = 0; i < kRim; ++i) {
      const float u = kAlong[i] * s.radius, v = kAlong[(i + 6) % kRim] * s.radius;
      own({lowest.x() * u - lowest.y() * v, lowest.y() * u + lowest.x() * v, z});
    }
  };
  switch (s.kind) {
    case ShapeKind::kSphere: case ShapeKind::kCapsule: break;
    case ShapeKind::kBox:
      for (int i = 0; i < 8; ++i)
        own(s.half.cwiseProduct(Vec3(i & 1 ? 1.0F : -1.0F, i & 2 ? 1.0F : -1.0F, i & 4 ? 1.0F : -1.0F)));
      break;
    case ShapeKind::kCylinder:
      rim(s.low);
      rim(s.high);
      break;
    case ShapeKind::kCone:
      rim(s.low);
      own({0, 0, s.high});
      break;
    case ShapeKind::kSolid:
      for (const Vec3& corner : piece.hull->piece->corners) own(corner);
      break;
  }
}

class PieceOnField {
 public:
  PieceOnField(const Columns& columns, const Piece& piece, const Vec3& centre, const Mat3& axes, float margin)
      : columns_(columns), piece_(piece), centre_(centre), axes_(axes), core_(piece, centre, axes), margin_(margin) {
    for (int i = 0; i < 3; ++i) {
      const Vec3 unit = Vec3::Unit(i);
      low_[i] = core_.farthest_outside(-unit)[i] - margin;
      high_[i] = core_.farthest_outside(unit)[i] + margin;
    }
  }

  const Candidates& find() {
    for_feature_points(piece_, centre_, axes_, [&](const Vec3& p) { touch_point(p); });
    if (piece_.shape.kind == ShapeKind::kCapsule) touch_capsule_ends();
    const CellRange cells = columns_.covering(low_.x(), high_.x(), low_.y(), high_.y());
    for (int r = cells.row_begin; r < cells.row_end; ++r)
      for (int c = cells.column_begin; c < cells.column_end; ++c)
        if (columns_.top(r, c) >= low_.z()) touch_column(r, c);
    return candidates_;
  }

 private:
  // A point of the piece inside or above a column: the way out of it.
  void touch_point(const Vec3& p) {
    const CellRange cells = columns_.covering(p.x(), p.x(), p.y(), p.y());
    for (int r = cells.row_begin; r < cells.row_end; ++r)
      for (int c = cells.column_begin; c < cells.column_end; ++c) {
        if (p.z() > columns_.top(r, c) + margin_) continue;
        const Column q = columns_.at(r, c);
        if (!q.contains(p.x(), p.y())) continue;
        const WayOut out = way_out(q, p);
        add(p - out.normal * out.distance, out.normal, out.distance, r, c);
      }
  }

  void touch_capsule_ends() {
    const Shape& s = piece_.shape;
    const float end = std::max(0.0F, s.high - s.radius);
    for (const float z : {-end, end}) {
      const Vec3 at = centre_ + axes_.col(2) * z;
      ends_.clear();
      touch_field_with_sphere(columns_.field(), at, s.radius, margin_, ends_);
      for (const Contact& c : ends_)
        add(at - (s.radius + c.gap) * c.normal, c.normal, c.gap, c.key / columns_.field().columns,
            c.key % columns_.field().columns);
    }
  }

  void touch_column(int r, int c) {
    const Column q = columns_.at(r, c);
    // A flat object on a level patch rests on its own corners or on the patch's rim: inner cells add nothing.
    if (q.all_bridged()) return;
    const Vec3 middle(0.5F * (q.west + q.east), 0.5F * (q.south + q.north), q.top);
    const float half_diagonal = 0.5F * std::hypot(q.east - q.west, q.north - q.south);
    if (outward_at(middle).distance > half_diagonal + margin_) return;
    bool found = std::find(hit_, hit_ + std::min(hits_, kHits), columns_.index(r, c)) != hit_ + std::min(hits_, kHits);
    for (const float x : {q.west, q.east})
      for (const float y : {q.south, q.north}) found |= touch_corner(q, Vec3(x, y, q.top), r, c);
    if (!found) touch_edges(q, r, c);
  }

  // A corner of the cell's top against the piece. On a bridged side the corner is a point of the patch's rim, and
  // still holds the piece; only leaning over the bridge is not its business.
  bool touch_corner(const Column& q, const Vec3& corner, int r, int c) {
    const Outward o = outward_at(corner);
    if (o.distance > margin_) return false;
    const Vec3 normal = -(axes_ * o.normal);
    if (normal.z() < -0.01F || q.leans_over_bridge(normal.x(), normal.y(), kLeanTolerance)) return false;
    add(corner, normal, o.distance, r, c);
    return true;
  }

  // Edge against edge, and everything that no corner tells: the nearest points of the piece and the column.
  void touch_edges(const Column& q, int r, int c) {
    const float depth = std::max(1.0F, q.top - low_.z() + 1.0F);
    Shape box;
    box.kind = ShapeKind::kBox;
    box.half = {0.5F * (q.east - q.west), 0.5F * (q.north - q.south), 0.5F * depth};
    box.rounding = std::min(0.03F, 0.1F * box.half.minCoeff());
    const Vec3 at(0.5F * (q.west + q.east), 0.5F * (q.south + q.north), q.top - 0.5F * depth);
    const Mat3 upright = Mat3::Identity();
    const Core column(Piece{box, nullptr}, at, upright);
    const NearestPoints near = nearest_points(core_, column);
    const float gap = near.distance - core_.rounding - column.rounding;
    const Vec3& n = near.normal;
    if (!near.apart || gap > margin_ || n.z() < -0.01F || q.leans_over_bridge(n.x(), n.y(), kLeanTolerance)) return;
    add(near.on_b + column.rounding * n, n, gap, r, c);
  }

  Outward outward_at(const Vec3& p) const { return outward_of(piece_, axes_.transpose() * (p - centre_)); }

  void add(const Vec3& point, const Vec3& normal, float gap, int r, int c) {
    const int cell = columns_.index(r, c);
    candidates_.add({point, normal, gap, cell});
    hit_[hits_++ % kHits] = cell;
  }

  static constexpr int kHits = 32;
  const Columns& columns_;
  const Piece& piece_;
  const Vec3& centre_;
  const Mat3& axes_;
  const Core core_;
  const float margin_;
  Vec3 low_, high_;
  Candidates candidates_;
  int hit_[kHits] = {};  // the cells found last
  int hits_ = 0;
  std::vector<Contact> ends_;
};

}  // namespace

void touch_field_with_shape(const surface::Field& field, const Shape& shape, const Vec3& centre, const Mat3& axes,
                            float margin, std::vector<Contact>& out) {
  const float low = centre.z() - (axes.cwiseAbs() * shape.half).z();
  if (low - margin > field.max_height) return;
  const Columns columns(field, shape.width);
  for_pieces(shape, [&](const Piece& piece) {
    PieceOnField on(columns, piece, centre, axes, margin);
    on.find().pick([&](const Candidate& c) {
      Contact& contact = out.emplace_back();
      contact.normal = c.normal;
      contact.arm = c.point + c.normal * c.gap - centre;
      contact.gap = c.gap;
      contact.other = kField;
      contact.key = c.tag;
      move_with_cell(columns, c.tag / field.columns, c.tag % field.columns, c.point, contact);
    });
  });
}

void touch_ground(const Shape& shape, const Vec3& centre, const Mat3& axes, float ground, float margin,
                  std::vector<Contact>& out) {
  for_pieces(shape, [&](const Piece& piece) {
    Candidates candidates;
    const Feature lowest = feature_towards(piece, centre, axes, Vec3(0, 0, -1));
    for (int i = 0; i < lowest.count; ++i) {
      const Vec3& p = lowest.point[static_cast<std::size_t>(i)];
      if (p.z() - ground <= margin) candidates.add({p, Vec3(0, 0, 1), p.z() - ground, 0});
    }
    candidates.pick([&](const Candidate& c) {
      Contact& contact = out.emplace_back();
      contact.normal = c.normal;
      contact.arm = c.point - centre;
      contact.gap = c.gap;
      contact.other = kGround;
    });
  });
}

}  // namespace smartsurf::world
