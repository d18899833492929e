#include "smartsurf/world/ConvexOnField.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include "smartsurf/world/Feature.h"
#include "smartsurf/world/Gjk.h"
#include "smartsurf/world/SphereOnField.h"

namespace smartsurf::world {
namespace {

using scene::ShapeKind;

// A normal that leans less than this out over a bridged side is taken as leaning by rounding only.
constexpr float kLeanTolerance = 0.05F;
constexpr int kRim = 8;

// Calls each(point) for the points that touch a plane first: corners, the tip, and eight points of each rim,
// one of them the lowest. A capsule has none.
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
    case ShapeKind::kSphere:
    case ShapeKind::kCapsule:
      break;
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

// A run of level cells in line, as one column.
struct Plateau {
  Column column;
  int row_begin, row_end, column_begin, column_end;
};

struct Way {
  Vec3 normal;  // from the plateau to the piece
  float gap;
};

class PieceOnField {
 public:
  PieceOnField(const Columns& columns, const Piece& piece, const Vec3& centre, const Mat3& axes, float margin)
      : columns_(columns),
        piece_(piece),
        centre_(centre),
        axes_(axes),
        core_(piece, centre, axes),
        margin_(margin) {
    for (int i = 0; i < 3; ++i) {
      const Vec3 unit = Vec3::Unit(i);
      low_[i] = core_.farthest_outside(-unit)[i] - margin;
      high_[i] = core_.farthest_outside(unit)[i] + margin;
    }
  }

  // The few contacts that hold the piece.
  template <class Take>
  void find(Take take) {
    if (touch_points()) for_plateaus([&](const Plateau& p) {
        if (!p.column.all_bridged()) touch_plateau(p, candidates_);
      });
    candidates_.pick(take);
  }

  // The contacts of each cell that bears the piece, one cell after the other: one in the midst of a level
  // patch, else the few that hold the piece on that cell.
  template <class Take>
  void find_on_each_cell(Take take) {
    if (!touch_points()) return;
    for_plateaus([&](const Plateau& p) {
      Candidates here;
      touch_plateau(p, here);
      const int cell = columns_.index(p.row_begin, p.column_begin);
      if (here.count() == 0)
        candidates_.each([&](const Candidate& c) {
          if (c.tag == cell) here.add(c);
        });
      if (p.column.all_bridged() && here.count() > 2)
        take(here.mean());
      else
        here.pick(take);
    });
  }

 private:
  // What the piece's own points touch. Returns whether it reaches down to any cell.
  bool touch_points() {
    const float highest = highest_top() + margin_;
    for_feature_points(piece_, centre_, axes_, [&](const Vec3& p) {
      if (p.z() <= highest) touch_point(p);
    });
    if (piece_.shape.kind == ShapeKind::kCapsule) touch_capsule_ends();
    return low_.z() <= highest;
  }

  // Of the cells under the piece.
  float highest_top() const {
    const CellRange cells = columns_.covering(low_.x(), high_.x(), low_.y(), high_.y());
    float highest = surface::kNoCell;
    for (int r = cells.row_begin; r < cells.row_end; ++r)
      for (int c = cells.column_begin; c < cells.column_end; ++c)
        highest = std::max(highest, columns_.top(r, c));
    return highest;
  }

  // A point of the piece inside or above a column: the way out of it.
  void touch_point(const Vec3& p) {
    const CellRange cells = columns_.covering(p.x(), p.x(), p.y(), p.y());
    for (int r = cells.row_begin; r < cells.row_end; ++r)
      for (int c = cells.column_begin; c < cells.column_end; ++c) {
        if (p.z() > columns_.top(r, c) + margin_) continue;
        const Column q = columns_.at(r, c);
        if (!q.contains(p.x(), p.y())) continue;
        const WayOut out = way_out(q, p);
        candidates_.add({p - out.normal * out.distance, out.normal, out.distance, columns_.index(r, c)});
      }
  }

  void touch_capsule_ends() {
    const Shape& s = piece_.shape;
    const float end = std::max(0.0F, s.high - s.radius);
    std::vector<Contact> touching;
    for (const float z : {-end, end}) {
      const Vec3 at = centre_ + axes_.col(2) * z;
      touching.clear();
      touch_field_with_sphere(columns_.field(), at, s.radius, margin_, touching);
      for (const Contact& c : touching)
        candidates_.add({at - (s.radius + c.gap) * c.normal, c.normal, c.gap, c.key});
    }
  }

  // Calls each(plateau) for the cells under the piece that reach up to it, level neighbours in a column of
  // cells taken as one, unless each bears a limited force of its own.
  template <class Each>
  void for_plateaus(Each each) const {
    const CellRange cells = columns_.covering(low_.x(), high_.x(), low_.y(), high_.y());
    const bool each_cell = columns_.field().yields();
    for (int c = cells.column_begin; c < cells.column_end; ++c)
      for (int r = cells.row_begin; r < cells.row_end; ++r) {
        if (columns_.top(r, c) < low_.z()) continue;
        Plateau p{columns_.at(r, c), r, r + 1, c, c + 1};
        while (!each_cell && p.row_end < cells.row_end && p.column.bridged_south) {
          const Column next = columns_.at(p.row_end, c);
          if (next.bridged_west != p.column.bridged_west || next.bridged_east != p.column.bridged_east) break;
          p.column.south = next.south;
          p.column.bridged_south = next.bridged_south;
          ++p.row_end;
        }
        r = p.row_end - 1;
        each(p);
      }
  }

  void touch_plateau(const Plateau& p, Candidates& out) const {
    Way way;
    const bool faces = piece_.hull || piece_.shape.kind == ShapeKind::kBox;
    if (!(faces ? find_way_between_faces(p.column, way) : find_way_by_gjk(p, way))) return;
    const Feature under = feature_of(p.column, way.normal);
    const Feature over = feature_towards(piece_, centre_, axes_, -way.normal);
    Candidates found;
    add_patch(over, under, way.normal, margin_, 0, found);
    found.pick([&](const Candidate& c) { add(p, c.point, c.normal, c.gap, out); });
    if (found.count() == 0) add_nearest(p, way, out);
  }

  // The axis of least overlap, or of the widest gap, of two shapes with flat faces; false when they are
  // further apart than the margin, or when the only way out leads over a bridge.
  bool find_way_between_faces(const Column& q, Way& best) const {
    best.gap = -std::numeric_limits<float>::max();
    bool apart = false;
    auto attempt = [&](const Vec3& n, float handicap) {
      if (apart || n.z() < -0.01F) return;
      const float top =
          (n.x() > 0 ? q.east : q.west) * n.x() + (n.y() > 0 ? q.north : q.south) * n.y() + q.top * n.z();
      const float gap = n.dot(core_.farthest_outside(-n)) - top;
      apart = gap > margin_;
      if (gap - handicap <= best.gap || q.leans_over_bridge(n.x(), n.y(), kLeanTolerance)) return;
      best = {n, gap - handicap};
    };
    attempt(Vec3(0, 0, 1), 0.0F);
    if (!apart) try_faces(attempt);
    for (int i = 0; i < 2 && !apart; ++i) {
      attempt(Vec3::Unit(i), 0.0F);
      attempt(-Vec3::Unit(i), 0.0F);
    }
    if (!apart) try_edges(attempt);
    return !apart && best.gap > -std::numeric_limits<float>::max();
  }

  template <class Attempt>
  void try_faces(Attempt& attempt) const {
    if (piece_.hull) {
      for (const auto& face : piece_.hull->piece->faces) attempt(Vec3(axes_ * -face.normal), 0.0F);
      return;
    }
    for (int i = 0; i < 3; ++i) attempt(axes_(2, i) > 0.0F ? Vec3(axes_.col(i)) : Vec3(-axes_.col(i)), 0.0F);
  }

  // Edges against the top's edges. They must win clearly, or the choice would change from step to step.
  template <class Attempt>
  void try_edges(Attempt& attempt) const {
    constexpr float kHandicap = 2e-3F;
    auto cross = [&](const Vec3& edge) {
      for (int i = 0; i < 2; ++i) {
        Vec3 n = edge.cross(Vec3::Unit(i));
        const float length = n.norm();
        if (length < 0.05F) continue;
        n /= n.z() < 0.0F ? -length : length;
        attempt(n, kHandicap);
      }
    };
    if (!piece_.hull)
      for (int i = 0; i < 3; ++i) cross(Vec3(axes_.col(i)));
    else
      for (const auto& e : piece_.hull->piece->edges)
        cross(axes_ * (piece_.hull->piece->corners[e[1]] - piece_.hull->piece->corners[e[0]]).normalized());
  }

  bool find_way_by_gjk(const Plateau& p, Way& way) const {
    const NearestPoints near = nearest_to(p.column);
    way = {near.normal, near.distance - core_.rounding - kColumnRounding};
    return near.apart && way.gap <= margin_ && way.normal.z() >= -0.01F &&
           !p.column.leans_over_bridge(way.normal.x(), way.normal.y(), kLeanTolerance);
  }

  // Where two edges cross, or a corner meets something.
  void add_nearest(const Plateau& p, const Way& way, Candidates& out) const {
    const NearestPoints near = nearest_to(p.column);
    if (near.apart && near.distance - core_.rounding - kColumnRounding <= margin_ &&
        near.normal.dot(way.normal) > 0.9F) {
      add(p, near.on_b + kColumnRounding * near.normal, way.normal, way.gap, out);
      return;
    }
    const Vec3 lowest = core_.farthest_outside(-way.normal);
    add(p, lowest - way.gap * way.normal, way.normal, way.gap, out);
  }

  NearestPoints nearest_to(const Column& q) const {
    const float depth = std::max(1.0F, q.top - low_.z() + 1.0F);
    Shape box;
    box.kind = ShapeKind::kBox;
    box.half = {0.5F * (q.east - q.west), 0.5F * (q.north - q.south), 0.5F * depth};
    box.rounding = kColumnRounding;
    const Vec3 at(0.5F * (q.west + q.east), 0.5F * (q.south + q.north), q.top - 0.5F * depth);
    const Mat3 upright = Mat3::Identity();
    return nearest_points(core_, Core(Piece{box, nullptr}, at, upright),
                          margin_ + core_.rounding + kColumnRounding, Vec3(0, 0, 1));
  }

  // The column's top, or the side that the normal leaves it by, as far down as the piece reaches.
  Feature feature_of(const Column& q, const Vec3& n) const {
    Feature f;
    if (n.z() >= 0.7F) {
      f.normal = {0, 0, 1};
      f.add({q.west, q.south, q.top}), f.add({q.east, q.south, q.top});
      f.add({q.east, q.north, q.top}), f.add({q.west, q.north, q.top});
      return f;
    }
    const float down = low_.z() - 1.0F;
    const bool along_x = std::abs(n.x()) > std::abs(n.y());
    const float side = along_x ? (n.x() > 0 ? q.east : q.west) : (n.y() > 0 ? q.north : q.south);
    const float a = along_x ? q.south : q.east, b = along_x ? q.north : q.west;
    auto point = [&](float u, float z) { return along_x ? Vec3(side, u, z) : Vec3(u, side, z); };
    const bool forward = along_x ? n.x() > 0 : n.y() > 0;
    f.normal = along_x ? Vec3(forward ? 1 : -1, 0, 0) : Vec3(0, forward ? 1 : -1, 0);
    f.add(point(forward ? a : b, down)), f.add(point(forward ? b : a, down));
    f.add(point(forward ? b : a, q.top)), f.add(point(forward ? a : b, q.top));
    return f;
  }

  // The cell of the plateau that the point is on.
  void add(const Plateau& p, const Vec3& point, const Vec3& normal, float gap, Candidates& out) const {
    const int row =
        static_cast<int>(std::lround(columns_.y(0) / columns_.pitch() - point.y() / columns_.pitch()));
    out.add(
        {point, normal, gap, columns_.index(std::clamp(row, p.row_begin, p.row_end - 1), p.column_begin)});
  }

  static constexpr float kColumnRounding = 0.01F;
  const Columns& columns_;
  const Piece& piece_;
  const Vec3& centre_;
  const Mat3& axes_;
  const Core core_;
  const float margin_;
  Vec3 low_, high_;
  Candidates candidates_;
};

}  // namespace

void touch_field_with_shape(const surface::Field& field, const Shape& shape, const Vec3& centre,
                            const Mat3& axes, float margin, std::vector<Contact>& out) {
  const float low = centre.z() - (axes.cwiseAbs() * shape.half).z();
  if (low - margin > field.max_height) return;
  const Columns columns(field, shape.width);
  for_pieces(shape, [&](const Piece& piece) {
    PieceOnField on(columns, piece, centre, axes, margin);
    const auto take = [&](const Candidate& c) {
      Contact& contact = out.emplace_back();
      contact.normal = c.normal;
      contact.arm = c.point + c.normal * c.gap - centre;
      contact.gap = c.gap;
      contact.other = kField;
      contact.key = c.tag;
      move_with_cell(columns, c.tag / field.columns, c.tag % field.columns, c.point, contact);
    };
    if (field.yields())
      on.find_on_each_cell(take);
    else
      on.find(take);
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
