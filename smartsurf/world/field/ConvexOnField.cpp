#include "smartsurf/world/field/ConvexOnField.h"

#include <algorithm>
#include <cmath>
#include <span>

#include "smartsurf/world/field/ColumnSat.h"
#include "smartsurf/world/field/CylinderOnColumn.h"
#include "smartsurf/world/field/SphereOnField.h"
#include "smartsurf/world/narrowphase/FeaturePoints.h"
#include "smartsurf/world/narrowphase/Gjk.h"
#include "smartsurf/world/narrowphase/SupportFeature.h"

namespace smartsurf::world {
namespace {

using scene::ShapeKind;

// A normal that leans less than this out over a bridged side is taken as leaning by rounding only.
constexpr float kLeanTolerance = 0.05F;
// A run of level cells in line, as one column.
struct Plateau {
  Column column;
  int row_begin, row_end, column_begin, column_end;
};

using Escape = ColumnSat::BestAxis;

class PartOnField {
 public:
  PartOnField(const Columns& columns, const ConvexPart& piece, const Vec3& centre, const Mat3& axes,
              float margin)
      : columns_(columns),
        part_(piece),
        centre_(centre),
        axes_(axes),
        core_(piece, centre, axes),
        margin_(margin) {
    set_bounds();
    cells_below_ =
        columns_.covering(low_.x() - margin, high_.x() + margin, low_.y() - margin, high_.y() + margin);
  }

  // The few contacts that hold the piece.
  template <class Take>
  void search(Take take) {
    collide_all();
    candidates_.reduce(take);
  }

  // All from which these are chosen.
  template <class Take>
  void search_all(Take take) {
    collide_all();
    candidates_.for_each(take);
  }

  // The contacts of each cell that bears the piece, one cell after the other: one in the midst of a level
  // patch, else the few that hold the piece on that cell.
  template <class Take>
  void search_each_cell(Take take) {
    if (!collide_points()) return;
    ColumnSat& directions = part_directions();
    for_each_plateau([&](const Plateau& p) {
      ManifoldReducer here;
      collide_plateau(p, directions, here);
      const int cell = columns_.index(p.row_begin, p.column_begin);
      if (here.count() == 0)
        candidates_.for_each([&](const ManifoldCandidate& c) {
          if (c.tag == cell) here.add(c);
        });
      if (p.column.all_bridged() && here.count() > 2)
        take(here.average());
      else
        here.reduce(take);
    });
  }

 private:
  void collide_all() {
    if (!collide_points()) return;
    ColumnSat& directions = part_directions();
    for_each_plateau([&](const Plateau& p) {
      if (!p.column.all_bridged()) collide_plateau(p, directions, candidates_);
    });
  }

  // What the piece's own points touch. Returns whether it reaches down to any cell.
  bool collide_points() {
    const float highest = columns_.max_height(cells_below_) + margin_;
    if (low_.z() > highest) return false;
    for_each_feature_point(part_, centre_, axes_, highest, [&](const Vec3& p) { collide_point(p); });
    if (part_.shape.kind == ShapeKind::kCapsule) collide_capsule_ends();
    return true;
  }

  ColumnSat& part_directions() const {
    // One for each thread: it keeps its memory from body to body.
    thread_local ColumnSat directions;
    directions.set(core_, low_, high_);
    return directions;
  }

  void set_bounds() {
    const Shape& s = part_.shape;
    if (s.kind == ShapeKind::kBox || s.kind == ShapeKind::kCylinder) {
      Vec3 reach = axes_.cwiseAbs() * s.half_extents;
      if (s.kind == ShapeKind::kCylinder) {
        const auto along = axes_.col(2).array();
        reach = s.high * along.abs() + s.radius * (1.0F - along * along).cwiseMax(0.0F).sqrt();
      }
      low_ = centre_ - reach;
      high_ = centre_ + reach;
      return;
    }
    for (int i = 0; i < 3; ++i) {
      const Vec3 unit = Vec3::Unit(i);
      low_[i] = core_.support_with_radius(-unit)[i];
      high_[i] = core_.support_with_radius(unit)[i];
    }
  }

  // A point of the piece inside or above a column: the way out of it.
  void collide_point(const Vec3& p) {
    const CellRange cells = columns_.covering(p.x(), p.x(), p.y(), p.y());
    for (int r = cells.row_begin; r < cells.row_end; ++r)
      for (int c = cells.column_begin; c < cells.column_end; ++c) {
        if (p.z() > columns_.top(r, c) + margin_) continue;
        const Column q = columns_.at(r, c);
        if (!q.contains(p.x(), p.y())) continue;
        const EscapeDirection out = escape_direction(q, p);
        candidates_.add({p - out.normal * out.distance, out.normal, out.distance, columns_.index(r, c)});
      }
  }

  void collide_capsule_ends() {
    const Shape& s = part_.shape;
    const float end = std::max(0.0F, s.high - s.radius);
    std::vector<Contact> touching;
    for (const float z : {-end, end}) {
      const Vec3 at = centre_ + axes_.col(2) * z;
      touching.clear();
      collide_sphere_with_field(columns_.field(), at, s.radius, margin_, touching);
      for (const Contact& c : touching)
        candidates_.add({at - (s.radius + c.separation) * c.normal, c.normal, c.separation, c.feature_id});
    }
  }

  // Calls each(plateau) for the cells under the piece that reach up to it, level neighbours in a column of
  // cells taken as one, unless each bears a limited force of its own.
  template <class Each>
  void for_each_plateau(Each each) const {
    const CellRange& cells = cells_below_;
    const bool each_cell = columns_.field().has_force_limit();
    for (int c = cells.column_begin; c < cells.column_end; ++c)
      for (int r = cells.row_begin; r < cells.row_end; ++r) {
        if (columns_.top(r, c) < low_.z() - margin_) continue;
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

  void collide_plateau(const Plateau& p, ColumnSat& directions, ManifoldReducer& out) {
    Escape way;
    if (!directions.find_best_axis(p.column, margin_, way)) return;
    ManifoldReducer found;
    // Level tops beside each other face the same side.
    if (clipped_ != way.normal)
      clipped_ = way.normal, facing_faces_ = support_feature(part_, centre_, axes_, -way.normal);
    const SupportFeature& over = facing_faces_;
    if (way.normal.z() > 0.9999F)
      add_above(over, p.column, found);
    else
      add_contact_patch(over, cached_feature(p.column, way.normal), way.normal, margin_, 0, found);
    const bool flat = part_.hull || part_.shape.kind == ShapeKind::kBox;
    // Between curved sides the gap may be wider than it was told.
    const bool told = found.count() > 0 && (flat || found.min_separation() <= way.separation + kPrecision);
    if (!told) {
      found.clear();
      if (!add_crossing(over, p.column, way, found))
        return flat ? add_nearest(p, way, out) : collide_with_gjk(p, way, out);
    }
    add(p, found, out);
  }

  // What of a face or an edge lies over the top.
  void add_above(const SupportFeature& over, const Column& q, ManifoldReducer& out) const {
    const SupportFeature patch = clip_to_rectangle(over, q.west, q.east, q.south, q.north);
    for (int i = 0; i < patch.count; ++i) {
      const Vec3& p = patch.point[static_cast<std::size_t>(i)];
      if (const float gap = p.z() - q.top; gap <= margin_) out.add({p, Vec3::UnitZ(), gap, 0});
    }
  }

  // An edge of the piece across an edge of the top, both square to the normal: where they cross, the two are
  // nearest.
  bool add_crossing(const SupportFeature& over, const Column& q, const Escape& way,
                    ManifoldReducer& out) const {
    const Vec3& n = way.normal;
    const int along = std::abs(n.x()) < std::abs(n.y()) ? 0 : 1;
    if (std::abs(n[along]) > 1e-4F || over.count < 2) return false;
    // The two of the feature that reach farthest.
    int first = 0, second = 1;
    float least = n.dot(over.point[0]), next = n.dot(over.point[1]);
    if (next < least) std::swap(first, second), std::swap(least, next);
    for (int i = 2; i < over.count; ++i) {
      const float reach = n.dot(over.point[static_cast<std::size_t>(i)]);
      if (reach < least)
        next = least, second = first, least = reach, first = i;
      else if (reach < next)
        next = reach, second = i;
    }
    const float side = along == 0 ? (n.y() > 0 ? q.north : q.south) : (n.x() > 0 ? q.east : q.west);
    const float edge = n[1 - along] * side + n.z() * q.top;
    if (next - edge > way.separation + kPrecision) return false;
    const Vec3 &a = over.point[static_cast<std::size_t>(first)],
               &b = over.point[static_cast<std::size_t>(second)];
    // Seen against the normal: where the piece's edge passes over the line of the top's edge.
    const Vec3 across = n.cross(Vec3::Unit(along));
    const float from = across.dot(a), to = across.dot(b);
    const float line = across[1 - along] * side + across.z() * q.top;
    const float share = (line - from) / (to - from);
    if (!(share >= 0.0F && share <= 1.0F)) return false;
    const Vec3 on = a + share * (b - a) - way.separation * n;
    const float begin = along == 0 ? q.west : q.south, end = along == 0 ? q.east : q.north;
    if (on[along] < begin || on[along] > end) return false;
    out.add({on, n, way.separation, 0});
    return true;
  }

  void collide_with_gjk(const Plateau& p, const Escape& told, ManifoldReducer& out) const {
    const ClosestPoints near = closest_to(p.column, told.normal);
    if (!near.separated) return resolve_penetration(p, told, out);
    const Escape way{near.normal, near.distance - core_.convex_radius - kColumnRounding};
    if (way.separation > margin_ || way.normal.z() < -0.01F ||
        p.column.leans_over_bridge(way.normal.x(), way.normal.y(), kLeanTolerance))
      return;
    ManifoldReducer found;
    const SupportFeature over = support_feature(part_, centre_, axes_, -way.normal);
    add_contact_patch(over, cached_feature(p.column, way.normal), way.normal, margin_, 0, found);
    // A mantle along an upper edge bears on both ends of what they share.
    if (found.count() == 0 && over.count == 2)
      add_contact_patch(over, top_edge(p.column, way.normal), way.normal, margin_, 0, found);
    if (found.count() == 0)
      found.add({near.on_b + kColumnRounding * near.normal, way.normal, way.separation, 0});
    add(p, found, out);
  }

  // Deeper than GJK can tell: the way of the least overlap, at what of the piece reaches in farthest over the
  // column.
  void resolve_penetration(const Plateau& p, const Escape& way, ManifoldReducer& out) const {
    const Column& q = p.column;
    Vec3 at = core_.support_with_radius(-way.normal) - way.separation * way.normal;
    at.x() = std::clamp(at.x(), q.west, q.east);
    at.y() = std::clamp(at.y(), q.south, q.north);
    at.z() = std::min(at.z(), q.top);
    add(p, ManifoldCandidate{at, way.normal, way.separation, 0}, out);
  }

  // Where two edges cross, or a corner meets something.
  void add_nearest(const Plateau& p, const Escape& way, ManifoldReducer& out) const {
    const ClosestPoints near = closest_to(p.column, way.normal);
    if (near.separated && near.distance - core_.convex_radius - kColumnRounding <= margin_ &&
        near.normal.dot(way.normal) > 0.9F)
      return add(p,
                 ManifoldCandidate{near.on_b + kColumnRounding * near.normal, way.normal, way.separation, 0},
                 out);
    const Vec3 lowest = core_.support_with_radius(-way.normal);
    add(p, ManifoldCandidate{lowest - way.separation * way.normal, way.normal, way.separation, 0}, out);
  }

  ClosestPoints closest_to(const Column& q, const Vec3& towards_piece) const {
    ClosestPoints near;
    if (part_.shape.kind == ShapeKind::kCylinder &&
        closest_on_edges(core_, q, kColumnRounding, towards_piece, near))
      return near;
    const float depth = std::max(1.0F, q.top - low_.z() + 1.0F);
    Shape box;
    box.kind = ShapeKind::kBox;
    box.half_extents = {0.5F * (q.east - q.west), 0.5F * (q.north - q.south), 0.5F * depth};
    box.convex_radius = kColumnRounding;
    const Vec3 at(0.5F * (q.west + q.east), 0.5F * (q.south + q.north), q.top - 0.5F * depth);
    const Mat3 upright = Mat3::Identity();
    return closest_points(core_, ConvexProxy(ConvexPart{box, nullptr}, at, upright),
                          margin_ + core_.convex_radius + kColumnRounding, towards_piece);
  }

  // The upper edge that the normal leans out over.
  static SupportFeature top_edge(const Column& q, const Vec3& n) {
    const int across = std::abs(n.x()) > std::abs(n.y()) ? 0 : 1;
    SupportFeature f;
    f.add({q.west, q.south, q.top}), f.add({q.east, q.north, q.top});
    const float side = across == 0 ? (n.x() > 0 ? q.east : q.west) : (n.y() > 0 ? q.north : q.south);
    for (Vec3& end : std::span(f.point).first(2)) end[across] = side;
    return f;
  }

  // The column's top, or the side that the normal leaves it by, as far down as the piece reaches.
  SupportFeature cached_feature(const Column& q, const Vec3& n) const {
    SupportFeature f;
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

  void add(const Plateau& p, ManifoldReducer& found, ManifoldReducer& out) const {
    constexpr int kFew = 4;  // no more than would be picked
    auto take = [&](const ManifoldCandidate& c) { add(p, c, out); };
    found.count() <= kFew ? found.for_each(take) : found.reduce(take);
  }
  // On the cell of the plateau where the point is.
  void add(const Plateau& p, ManifoldCandidate c, ManifoldReducer& out) const {
    const int row =
        static_cast<int>(std::lround(columns_.y(0) / columns_.pitch() - c.point.y() / columns_.pitch()));
    c.tag = columns_.index(std::clamp(row, p.row_begin, p.row_end - 1), p.column_begin);
    out.add(c);
  }

  static constexpr float kColumnRounding = 0.01F, kPrecision = 2e-4F;
  const Columns& columns_;
  const ConvexPart& part_;
  const Vec3& centre_;
  const Mat3& axes_;
  const ConvexProxy core_;
  const float margin_;
  Vec3 low_, high_;  // its bounds
  CellRange cells_below_;
  Vec3 clipped_{0, 0, 0};  // the normal against which the piece turns `facing_`
  SupportFeature facing_faces_;
  ManifoldReducer candidates_;
};

// Calls look(piece on the field) for the pieces of a shape, where any cell under it reaches up to it.
template <class Look>
void for_each_part_on_field(const Columns& columns, const Shape& shape, const Vec3& centre, const Mat3& axes,
                            float margin, Look look) {
  const Vec3 reach = Vec3(axes.cwiseAbs() * shape.half_extents) + Vec3::Constant(margin);
  if (centre.z() - reach.z() > columns.field().max_height) return;
  const CellRange under = columns.covering(centre.x() - reach.x(), centre.x() + reach.x(),
                                           centre.y() - reach.y(), centre.y() + reach.y());
  if (centre.z() - reach.z() > columns.max_height(under)) return;
  for_each_part(shape, [&](const ConvexPart& piece) {
    PartOnField on(columns, piece, centre, axes, margin);
    look(on);
  });
}

}  // namespace

void collide_shape_with_field(const surface::Field& field, const Shape& shape, const Vec3& centre,
                              const Mat3& axes, float margin, std::vector<Contact>& out) {
  const Columns columns(field, shape.width);
  const auto take = [&](const ManifoldCandidate& c) {
    Contact& contact = out.emplace_back();
    contact.normal = c.normal;
    contact.anchor = c.point + c.normal * c.separation - centre;
    contact.separation = c.separation;
    contact.other = kField;
    contact.feature_id = c.tag;
    set_surface_velocity(columns, c.tag / field.columns, c.tag % field.columns, c.point, contact);
  };
  for_each_part_on_field(columns, shape, centre, axes, margin, [&](PartOnField& on) {
    field.has_force_limit() ? on.search_each_cell(take) : on.search(take);
  });
}

void collect_field_candidates(const surface::Field& field, const Shape& shape, const Vec3& centre,
                              const Mat3& axes, float margin, std::vector<FieldCandidate>& out) {
  const Columns columns(field, shape.width);
  int piece = 0;
  for_each_part_on_field(columns, shape, centre, axes, margin, [&](PartOnField& on) {
    on.search_all([&](const ManifoldCandidate& c) { out.push_back({c, piece}); });
    ++piece;
  });
}

}  // namespace smartsurf::world
