#include "smartsurf/world/field/ConvexOnField.h"

#include <algorithm>
#include <cmath>
#include <iterator>
#include <limits>
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

// A run of level cells of one grid column, merged into one Column.
struct Plateau {
  Column column;
  int row_begin, row_end, column_begin, column_end;
};

using Escape = ColumnSat::BestAxis;
using Candidates = std::vector<ManifoldCandidate>;

// Reused, because each part needs a list.
Candidates& empty_candidates() {
  thread_local Candidates candidates;
  candidates.clear();
  return candidates;
}

// Collides one convex part with the columns below it.
class PartOnField {
 public:
  PartOnField(const Columns& columns, const ConvexPart& part, const Vec3& centre, const Mat3& axes,
              float margin)
      : columns_(columns),
        part_(part),
        centre_(centre),
        axes_(axes),
        proxy_(part, centre, axes),
        margin_(margin),
        least_upright_(columns.field().has_elastic_tops ? kUprightOnElasticTops : kUpright) {
    set_bounds();
    cells_below_ =
        columns_.cells_covering(low_.x() - margin, high_.x() + margin, low_.y() - margin, high_.y() + margin);
    centre_is_free_ = columns_.is_free(centre);
  }

  // Returns all candidates. Valid until the next part is collided on this thread.
  Candidates& search() {
    collide_all();
    return candidates_;
  }

  // By how much the face that search() chose on each column is nearer than any other of the part, u, at
  // least. Infinite for parts other than hulls.
  float lead() const { return lead_; }

  // Calls take(candidate) for a separate manifold on each supporting cell, because each cell has its own
  // force limit. Cells inside a level patch, with more of the part on all four sides, get one averaged
  // contact, other cells a reduced manifold.
  template <class Take>
  void search_each_cell(Take take) {
    if (!collide_points()) return;
    ColumnSat& sat = part_sat();
    Candidates of_cell;
    for_each_plateau([&](const Plateau& p) {
      of_cell.clear();
      collide_plateau(p, sat, of_cell);
      if (columns_.field().has_force_limit() && is_outside_bounds(p.column))
        std::erase_if(of_cell, [](const ManifoldCandidate& c) { return c.normal.z() > 0.9999F; });
      const int cell = columns_.index(p.row_begin, p.column_begin);
      if (of_cell.empty())
        std::ranges::copy_if(candidates_, std::back_inserter(of_cell),
                             [&](const ManifoldCandidate& c) { return c.tag == cell; });
      ManifoldReducer here;
      for (const ManifoldCandidate& c : of_cell) here.add(c);
      if (p.column.all_bridged() && covers_surroundings(p.column, here))
        take(here.average());
      else
        here.reduce(take);
    });
  }

 private:
  void collide_all() {
    if (!collide_points()) return;
    ColumnSat& sat = part_sat();
    for_each_plateau([&](const Plateau& p) {
      if (!p.column.all_bridged()) collide_plateau(p, sat, candidates_);
    });
  }

  // True if the column lies beside the part. Its motor then bears nothing of it: the unloaded neighbours of
  // a load run ahead of it.
  bool is_outside_bounds(const Column& q) const {
    constexpr float kReach = 5e-3F;  // u
    return q.west > high_.x() + kReach || q.east < low_.x() - kReach || q.south > high_.y() + kReach ||
           q.north < low_.y() - kReach;
  }

  // True if the points are the four corners of the top and the part reaches beyond it on all sides. Other
  // cells then resist its rotation.
  bool covers_surroundings(const Column& q, const ManifoldReducer& points) const {
    constexpr float kReach = 0.1F, kCornerTolerance = 1e-3F;  // u
    bool covers = points.count() == 4 && low_.x() < q.west - kReach && high_.x() > q.east + kReach &&
                  low_.y() < q.south - kReach && high_.y() > q.north + kReach;
    points.for_each([&](const ManifoldCandidate& c) {
      covers &= std::min(c.point.x() - q.west, q.east - c.point.x()) < kCornerTolerance &&
                std::min(c.point.y() - q.south, q.north - c.point.y()) < kCornerTolerance;
    });
    return covers;
  }

  // Adds the contacts of the part's feature points. False if the part is above all cells.
  bool collide_points() {
    const float max_z = columns_.max_height(cells_below_) + margin_;
    if (low_.z() > max_z) return false;
    for_each_feature_point(part_, centre_, axes_, max_z, [&](const Vec3& p) { collide_point(p); });
    if (part_.shape.kind == ShapeKind::kCapsule) collide_capsule_ends();
    return true;
  }

  ColumnSat& part_sat() const {
    // Thread-local, to reuse its allocations between bodies.
    thread_local ColumnSat sat;
    sat.set(proxy_, low_, high_);
    return sat;
  }

  void set_bounds() {
    const Shape& s = part_.shape;
    if (s.kind == ShapeKind::kBox || s.kind == ShapeKind::kCylinder) {
      Vec3 extent = turned_extents(axes_, s.half_extents);
      if (s.kind == ShapeKind::kCylinder) {
        const auto along = axes_.col(2).array();
        extent = s.high * along.abs() + s.radius * (1.0F - along * along).cwiseMax(0.0F).sqrt();
      }
      low_ = centre_ - extent;
      high_ = centre_ + extent;
      return;
    }
    for (int i = 0; i < 3; ++i) {
      const Vec3 unit = Vec3::Unit(i);
      low_[i] = proxy_.sharp_support(-unit)[i];
      high_[i] = proxy_.sharp_support(unit)[i];
    }
  }

  // True if the part's centre is lower than the column's top, but in the open.
  bool is_beside(const Column& q) const { return centre_.z() < q.top && centre_is_free_; }

  // Adds a contact of a point of the part with each column that is below or around it.
  void collide_point(const Vec3& p) {
    const CellRange cells = columns_.cells_covering(p.x(), p.x(), p.y(), p.y());
    for (int r = cells.row_begin; r < cells.row_end; ++r)
      for (int c = cells.column_begin; c < cells.column_end; ++c) {
        if (p.z() > columns_.top(r, c) + margin_) continue;
        const Column q = columns_.at(r, c);
        if (!q.contains(p.x(), p.y()) || is_in_concave_corner(r, c, p)) continue;
        const EscapeDirection out = escape_direction(q, p, centre_, is_beside(q));
        if (std::isinf(out.distance)) continue;
        candidates_.push_back(
            {p - out.normal * out.distance, out.normal, out.distance, columns_.index(r, c)});
      }
  }

  void collide_capsule_ends() {
    const Shape& s = part_.shape;
    const float end = std::max(0.0F, s.high - s.radius);
    std::vector<Contact> contacts;
    for (const float z : {-end, end}) {
      const Vec3 end_centre = centre_ + axes_.col(2) * z;
      contacts.clear();
      if (const FreeCell* const cell = columns_.free_cell()) {
        if (const auto c =
                collide_sphere_with_cell(columns_.field(), *cell, end_centre, s.radius, margin_, {}))
          contacts.push_back(*c);
      } else {
        collide_sphere_with_field(columns_.field(), end_centre, s.radius, margin_, contacts);
      }
      for (const Contact& c : contacts)
        candidates_.push_back(
            {end_centre - (s.radius + c.separation) * c.normal, c.normal, c.separation, c.feature_id});
    }
  }

  // Calls each(plateau) for the cells under the part whose tops are above its lower bound. Level neighbours
  // along a grid column are merged, unless cells have force limits.
  template <class Each>
  void for_each_plateau(Each each) const {
    const CellRange& cells = cells_below_;
    const bool each_cell = columns_.field().has_contacts_per_cell();
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
        if (!p.column.all_bridged()) fit_concave_corners(p);
        each(p);
      }
  }

  // Neighbouring columns meet in the middle of the gap. Where the sides of one of them end in a concave
  // corner, that one reaches to the far edge of the gap, and the other begins there: the corner is filled,
  // and nothing beyond it.
  void fit_concave_corners(Plateau& p) const {
    const surface::Field& f = columns_.field();
    const float half_gap_x = 0.5F * columns_.pitch() - f.half_top_x,
                half_gap_y = 0.5F * columns_.pitch() - f.half_top_y;
    Column& q = p.column;
    const auto ends_at = [](bool side, bool neighbours_side) { return !side && neighbours_side; };
    const auto shift_y = [&](const Column& n) {
      if (ends_at(q.bridged_west, n.bridged_west) || ends_at(q.bridged_east, n.bridged_east))
        return half_gap_y;
      return ends_at(n.bridged_west, q.bridged_west) || ends_at(n.bridged_east, q.bridged_east) ? -half_gap_y
                                                                                                : 0.0F;
    };
    const auto shift_x = [&](int column) {
      const Column first = columns_.at(p.row_begin, column), last = columns_.at(p.row_end - 1, column);
      return ends_at(q.bridged_north, first.bridged_north) || ends_at(q.bridged_south, last.bridged_south)
                 ? half_gap_x
                 : 0.0F;
    };
    const Column before = q;
    if (before.bridged_north) q.north += shift_y(columns_.at(p.row_begin - 1, p.column_begin));
    if (before.bridged_south) q.south -= shift_y(columns_.at(p.row_end, p.column_begin));
    if (before.bridged_west) q.west -= shift_x(p.column_begin - 1);
    if (before.bridged_east) q.east += shift_x(p.column_begin + 1);
  }

  // True if a point of the column lies in the crossing of two gaps, beside a diagonal neighbour that is not
  // level. There is nothing under such a point.
  bool is_in_concave_corner(int row, int column, const Vec3& p) const {
    if (columns_.free_cell()) return false;
    const surface::Field& f = columns_.field();
    const float x = p.x() - columns_.x(column), y = p.y() - columns_.y(row);
    if (std::abs(x) <= f.half_top_x || std::abs(y) <= f.half_top_y) return false;
    const int r = row + (y > 0 ? -1 : 1), c = column + (x > 0 ? 1 : -1);
    return r < 0 || r >= f.rows || c < 0 || c >= f.columns ||
           columns_.top(r, c) < columns_.top(row, column) - kLevelTolerance;
  }

  void collide_plateau(const Plateau& p, ColumnSat& sat, Candidates& out) {
    Escape axis;
    if (!sat.find_best_axis(p.column, margin_, is_beside(p.column), axis)) return;
    ManifoldReducer found;
    const bool is_up = axis.normal.z() > least_upright_,
               may_sink = is_up && columns_.field().has_elastic_tops;
    const Vec3 facing = may_sink ? Vec3(Vec3::UnitZ()) : axis.normal;
    // Neighbouring level tops often yield the same normal.
    if (facing_normal_ != facing) {
      facing_normal_ = facing, facing_feature_ = support_feature(part_, centre_, axes_, -facing);
      facing_face_ = sat.find_face(facing_feature_.normal);
    }
    const SupportFeature& part_feature = facing_feature_;
    if (part_.hull && !columns_.field().has_contacts_per_cell())
      lead_ = std::min(lead_, axis.separation - sat.separation_of_other_features(facing_face_));
    if (is_up) {
      add_top_patch(part_feature, p.column, found);
      // An underside bears on the area that it shares with elastic tops, also deeper than the rounded cores
      // reach.
      if (may_sink && part_feature.is_face() && part_feature.normal.z() < -least_upright_) {
        if (found.count() == 0) add_point_of_disc(part_feature, p.column, found);
        if (found.count() > 0 || (axis.separation < 0.0F && !part_.hull)) return add(p, found, out);
      }
    } else {
      add_contact_patch(part_feature, column_feature(p.column, axis.normal), axis.normal, margin_,
                        PatchPoints::kOnB, found);
    }
    const bool is_polyhedral = part_.hull || part_.shape.kind == ShapeKind::kBox;
    // For curved parts the separation along the SAT axis is only a lower bound. An edge of a polyhedral part
    // may be deeper than the corners of its face.
    const float tolerance = is_polyhedral && !part_.hull ? kBoxEdgeTolerance : kTolerance;
    if (!(found.min_separation() <= axis.separation + tolerance)) {
      if (is_polyhedral) add(p, found, out);
      found.clear();
      // The separation along a face that does not touch is not that of any point.
      const std::optional<Escape> edge = part_.hull ? sat.nearer_edge_axis() : std::nullopt;
      if (!add_edge_crossing(edge ? support_feature(part_, centre_, axes_, -edge->normal) : part_feature,
                             p.column, edge.value_or(axis), found))
        return is_polyhedral ? add_closest(p, edge.value_or(axis), out) : collide_with_gjk(p, axis, out);
    }
    add(p, found, out);
  }

  // Adds the point of a top that is nearest to the middle of a disc, if the disc covers it. A disc's feature
  // is a polygon, beyond which it may reach over a corner of the top.
  void add_point_of_disc(const SupportFeature& face, const Column& q, ManifoldReducer& out) const {
    if (part_.hull || part_.shape.kind == ShapeKind::kBox) return;
    const Vec3 middle = 0.5F * (face.point[0] + face.point[face.count / 2]), &n = face.normal;
    Vec3 p(std::clamp(middle.x(), q.west, q.east), std::clamp(middle.y(), q.south, q.north), q.top);
    const float x = p.x() - middle.x(), y = p.y() - middle.y();
    if (x * x + y * y > part_.shape.radius * part_.shape.radius) return;
    const float separation = middle.z() - (n.x() * x + n.y() * y) / n.z() - q.top;
    if (separation <= margin_) out.add({p, Vec3::UnitZ(), separation, 0});
  }

  // Clips a face or an edge of the part to the column's top.
  void add_top_patch(const SupportFeature& part_feature, const Column& q, ManifoldReducer& out) const {
    const SupportFeature patch = clip_to_rectangle(part_feature, q.west, q.east, q.south, q.north);
    for (int i = 0; i < patch.count; ++i) {
      const Vec3& p = patch.point[i];
      if (const float separation = p.z() - q.top; separation <= margin_)
        out.add({{p.x(), p.y(), q.top}, Vec3::UnitZ(), separation, 0});
    }
  }

  // Adds the contact between an edge of the part and an edge of the top, both perpendicular to the normal. It
  // lies where the two cross in projection along the normal. False if they do not cross.
  bool add_edge_crossing(const SupportFeature& part_feature, const Column& q, const Escape& axis,
                         ManifoldReducer& out) const {
    const Vec3& n = axis.normal;
    const int along = std::abs(n.x()) < std::abs(n.y()) ? 0 : 1;
    if (std::abs(n[along]) > 1e-4F || part_feature.count < 2) return false;
    // The two points of the feature that are deepest along the normal.
    int first = 0, second = 1;
    float min_projection = n.dot(part_feature.point[0]), second_projection = n.dot(part_feature.point[1]);
    if (second_projection < min_projection)
      std::swap(first, second), std::swap(min_projection, second_projection);
    for (int i = 2; i < part_feature.count; ++i) {
      const float projection = n.dot(part_feature.point[i]);
      if (projection < min_projection)
        second_projection = min_projection, second = first, min_projection = projection, first = i;
      else if (projection < second_projection)
        second_projection = projection, second = i;
    }
    const float side = along == 0 ? (n.y() > 0 ? q.north : q.south) : (n.x() > 0 ? q.east : q.west);
    const float edge = n[1 - along] * side + n.z() * q.top;
    if (second_projection - edge > axis.separation + kTolerance) return false;
    const Vec3 &a = part_feature.point[first], &b = part_feature.point[second];
    // The part's edge crosses the line of the top's edge here, in projection along the normal.
    const Vec3 across = n.cross(Vec3::Unit(along));
    const float from = across.dot(a), to = across.dot(b);
    const float line = across[1 - along] * side + across.z() * q.top;
    const float fraction = (line - from) / (to - from);
    if (!(fraction >= 0.0F && fraction <= 1.0F)) return false;
    const Vec3 point = a + fraction * (b - a) - axis.separation * n;
    const float begin = along == 0 ? q.west : q.south, end = along == 0 ? q.east : q.north;
    if (point[along] < begin || point[along] > end) return false;
    out.add({point, n, axis.separation, 0});
    return true;
  }

  // The normal between the round cores would hold back the rim of such a disc where it comes over a top.
  bool is_level_disc() const {
    return part_.shape.kind == ShapeKind::kCylinder && std::abs(axes_.col(2).z()) > kUpright;
  }

  // Used for curved parts, where SAT gives only a lower bound.
  void collide_with_gjk(const Plateau& p, const Escape& sat_axis, Candidates& out) const {
    const ClosestPoints closest = closest_to(p.column, sat_axis.normal);
    if (!closest.separated) return resolve_penetration(p, sat_axis, out);
    if (closest.distance > max_core_distance()) return;
    // The cores round edges and corners off. The separation of the sharp shapes along any axis is a lower
    // bound.
    const float sharp_separation =
        closest.normal.dot(proxy_.sharp_support(-closest.normal)) - p.column.max_projection(closest.normal);
    Escape axis{closest.normal, std::max(sharp_separation, sat_axis.separation)};
    if (is_level_disc() && sharp_separation <= sat_axis.separation) axis.normal = sat_axis.normal;
    if (is_level_disc() && axis.normal.z() < kMaxRimNormalZ && rides_up(Vec3::Zero(), p.column.top, low_.z()))
      return;
    if (axis.separation > margin_) return;
    if (axis.normal.z() < -0.01F ||
        p.column.leans_over_bridge(axis.normal.x(), axis.normal.y(), kLeanTolerance)) {
      if (axis.separation < 0.0F) add_edge_points(p, out);
      return;
    }
    ManifoldReducer found;
    const SupportFeature part_feature = support_feature(part_, centre_, axes_, -axis.normal);
    add_contact_patch(part_feature, column_feature(p.column, axis.normal), axis.normal, margin_,
                      PatchPoints::kOnB, found);
    // A lateral surface along an upper edge touches at both ends of their overlap.
    if (found.count() == 0 && part_feature.count == 2)
      add_contact_patch(part_feature, top_edge(p.column, axis.normal), axis.normal, margin_,
                        PatchPoints::kOnB, found);
    // Samples of a rim may miss where it is deepest.
    if (found.min_separation() > axis.separation + kTolerance)
      found.add({closest.on_b + kColumnConvexRadius * axis.normal, axis.normal, axis.separation, 0});
    add(p, found, out);
  }

  // Adds the point of each free upper edge that is deepest inside the part. Used where the normal leans over
  // a bridge: the neighbour there is closer, but in a concave corner each cell would leave the part to the
  // other.
  void add_edge_points(const Plateau& p, Candidates& out) const {
    const Column& q = p.column;
    const Vec3 corner[4] = {{q.west, q.south, q.top},
                            {q.east, q.south, q.top},
                            {q.east, q.north, q.top},
                            {q.west, q.north, q.top}};
    const bool bridged[4] = {q.bridged_south, q.bridged_east, q.bridged_north, q.bridged_west};
    for (std::size_t side = 0; side < 4; ++side)
      if (!bridged[side]) add_deepest_point(p, corner[side], corner[(side + 1) % 4], out);
  }

  void add_deepest_point(const Plateau& p, const Vec3& from, const Vec3& to, Candidates& out) const {
    constexpr int kEdgeBisections = 12;
    constexpr float kMinNormalZ = 0.01F;  // a column has no way out below
    const auto point_at = [&](float t) { return Vec3(from + t * (to - from)); };
    const auto distance_at = [&](float t) {
      return signed_distance(part_, axes_.transpose() * (point_at(t) - centre_));
    };
    // The distance is convex along the edge.
    const Vec3 along = axes_.transpose() * (to - from);
    float low = 0.0F, high = 1.0F;
    for (int i = 0; i < kEdgeBisections; ++i) {
      const float middle = 0.5F * (low + high);
      float& end = distance_at(middle).normal.dot(along) > 0.0F ? high : low;
      end = middle;
    }
    const float deepest = 0.5F * (low + high);
    const SignedDistance distance = distance_at(deepest);
    const Vec3 normal = axes_ * -distance.normal;
    if (distance.distance < 0.0F && normal.z() > kMinNormalZ)
      add(p, ManifoldCandidate{point_at(deepest), normal, distance.distance, 0}, out);
  }

  // Uses the SAT axis of least penetration and the deepest point of the part, clamped to the column.
  void resolve_penetration(const Plateau& p, const Escape& axis, Candidates& out) const {
    const Column& q = p.column;
    Vec3 position = proxy_.sharp_support(-axis.normal) - axis.separation * axis.normal;
    position.x() = std::clamp(position.x(), q.west, q.east);
    position.y() = std::clamp(position.y(), q.south, q.north);
    position.z() = std::min(position.z(), q.top);
    add(p, ManifoldCandidate{position, axis.normal, axis.separation, 0}, out);
  }

  // True if a point is no farther from the top than half of its width.
  static bool is_near(const Column& q, const Vec3& p) {
    return std::abs(p.x() - 0.5F * (q.west + q.east)) < q.east - q.west &&
           std::abs(p.y() - 0.5F * (q.south + q.north)) < q.north - q.south;
  }

  // Adds one contact at the closest points, for crossing edges and for corners. What falls into the gaps is
  // guided by the sides of the columns, whatever its deepest point.
  void add_closest(const Plateau& p, const Escape& axis, Candidates& out) const {
    const ClosestPoints closest = closest_to(p.column, axis.normal);
    const Vec3& n = closest.normal;
    ManifoldCandidate candidate{closest.on_b + kColumnConvexRadius * n, axis.normal, axis.separation, 0};
    if (!closest.separated || closest.distance - proxy_.convex_radius - kColumnConvexRadius > margin_ ||
        !(n.dot(axis.normal) > 0.9F)) {
      const Vec3 deepest = proxy_.sharp_support(-axis.normal) - axis.separation * axis.normal;
      candidate.is_apart_twice = closest.separated && columns_.spans_gaps() && !is_near(p.column, deepest) &&
                                 n.dot(proxy_.sharp_support(-n)) - p.column.max_projection(n) >
                                     std::max(axis.separation, kTolerance);
      // The level neighbour is closer, and bears.
      if (candidate.is_apart_twice && p.column.leans_over_bridge(n.x(), n.y(), kLeanTolerance)) return;
      if (!candidate.is_apart_twice) candidate.point = deepest;
    }
    add(p, candidate, out);
  }

  ClosestPoints closest_to(const Column& q, const Vec3& towards_part) const {
    ClosestPoints closest;
    if (part_.shape.kind == ShapeKind::kCylinder &&
        closest_on_edges(proxy_, q, kColumnConvexRadius, towards_part, closest))
      return closest;
    const float depth = std::max(1.0F, q.top - low_.z() + 1.0F);
    Shape box;
    box.kind = ShapeKind::kBox;
    box.half_extents = {0.5F * (q.east - q.west), 0.5F * (q.north - q.south), 0.5F * depth};
    box.convex_radius = kColumnConvexRadius;
    const Vec3 position(0.5F * (q.west + q.east), 0.5F * (q.south + q.north), q.top - 0.5F * depth);
    const Mat3 upright = Mat3::Identity();
    return closest_points(proxy_, ConvexProxy(ConvexPart{box, nullptr}, position, upright),
                          max_core_distance(), towards_part);
  }

  // The sharp shapes may be within the margin up to this distance of their cores, u. The core of a cone is
  // inset by up to twice its radius more at the tip and the rim.
  float max_core_distance() const {
    const float sharpness = part_.shape.kind == ShapeKind::kCapsule ? 1.0F : 3.0F;
    return margin_ + sharpness * proxy_.convex_radius + 2.0F * kColumnConvexRadius;
  }

  // The upper edge on the side that the normal points to.
  static SupportFeature top_edge(const Column& q, const Vec3& n) {
    const int across = std::abs(n.x()) > std::abs(n.y()) ? 0 : 1;
    SupportFeature f;
    f.add({q.west, q.south, q.top});
    f.add({q.east, q.north, q.top});
    const float side = across == 0 ? (n.x() > 0 ? q.east : q.west) : (n.y() > 0 ? q.north : q.south);
    for (Vec3& end : std::span(f.point).first(2)) end[across] = side;
    return f;
  }

  // The support feature of the column: its top, or the side that the normal points to, extended to below the
  // part.
  SupportFeature column_feature(const Column& q, const Vec3& n) const {
    SupportFeature f;
    if (n.z() >= 0.7F) {
      f.normal = {0, 0, 1};
      f.add({q.west, q.south, q.top});
      f.add({q.east, q.south, q.top});
      f.add({q.east, q.north, q.top});
      f.add({q.west, q.north, q.top});
      return f;
    }
    const float down = low_.z() - 1.0F;
    const bool along_x = std::abs(n.x()) > std::abs(n.y());
    const float side = along_x ? (n.x() > 0 ? q.east : q.west) : (n.y() > 0 ? q.north : q.south);
    const float a = along_x ? q.south : q.east, b = along_x ? q.north : q.west;
    auto point = [&](float u, float z) { return along_x ? Vec3(side, u, z) : Vec3(u, side, z); };
    const bool forward = along_x ? n.x() > 0 : n.y() > 0;
    f.normal = along_x ? Vec3(forward ? 1 : -1, 0, 0) : Vec3(0, forward ? 1 : -1, 0);
    f.add(point(forward ? a : b, down));
    f.add(point(forward ? b : a, down));
    f.add(point(forward ? b : a, q.top));
    f.add(point(forward ? a : b, q.top));
    return f;
  }

  // Adds the candidates, reduced if there are more than a manifold holds.
  void add(const Plateau& p, ManifoldReducer& found, Candidates& out) const {
    constexpr int kMaxContacts = 4;  // that are kept all
    auto take = [&](const ManifoldCandidate& c) { add(p, c, out); };
    if (found.count() <= kMaxContacts)
      found.for_each(take);
    else
      found.reduce(take);
  }
  // Tags the candidate with the cell of the plateau that contains its point.
  void add(const Plateau& p, ManifoldCandidate c, Candidates& out) const {
    const int row =
        static_cast<int>(std::lround(columns_.y(0) / columns_.pitch() - c.point.y() / columns_.pitch()));
    c.tag = columns_.index(std::clamp(row, p.row_begin, p.row_end - 1), p.column_begin);
    out.push_back(c);
  }

  static constexpr float kMaxRimNormalZ = 0.75F;
  static constexpr float kColumnConvexRadius = 0.01F, kTolerance = 2e-4F, kBoxEdgeTolerance = 4e-3F;  // u
  const Columns& columns_;
  const ConvexPart& part_;
  const Vec3& centre_;
  const Mat3& axes_;
  const ConvexProxy proxy_;
  const float margin_, least_upright_;
  Vec3 low_, high_;  // bounding box of the part, world axes
  CellRange cells_below_;
  bool centre_is_free_;          // no cell reaches up to the part's centre
  Vec3 facing_normal_{0, 0, 0};  // contact normal for which facing_feature_ was computed
  SupportFeature facing_feature_;
  int facing_face_ = -1;  // see ColumnSat::find_face()
  float lead_ = std::numeric_limits<float>::infinity();
  Candidates& candidates_ = empty_candidates();
};

float gap_entered_by(const ConvexPart& part) {
  if (!part.hull) return least_gap_entered(part.shape.width, 2.0F * part.shape.half_extents);
  return least_gap_entered(part.hull->width, part.hull->hull->bounds_max - part.hull->hull->bounds_min);
}

// Calls visit(part_on_field) for the convex parts of a shape, unless the shape is above all cells under it. A
// part that is narrower than the gaps enters them, however wide the shape is.
template <class Visit>
void for_each_part_on_field(const surface::Field& field, const FreeCell* free_cell, const Shape& shape,
                            const Vec3& centre, const Mat3& axes, float margin, Visit visit) {
  const Columns columns(field, 0.0F, free_cell);
  const Vec3 extent = turned_extents(axes, shape.half_extents) + Vec3::Constant(margin);
  if (centre.z() - extent.z() > columns.field().max_height) return;
  const CellRange cells = columns.cells_covering(centre.x() - extent.x(), centre.x() + extent.x(),
                                                 centre.y() - extent.y(), centre.y() + extent.y());
  if (centre.z() - extent.z() > columns.max_height(cells)) return;
  for_each_part(shape, [&](const ConvexPart& part) {
    const Columns columns_of_part(field, gap_entered_by(part), free_cell);
    PartOnField part_on_field(columns_of_part, part, centre, axes, margin);
    visit(part_on_field);
  });
}

}  // namespace

bool rides_up(const Vec3& normal, float top, float lowest) {
  constexpr float kEdgeRadius = 0.004F;  // u
  constexpr float kMaxSideNormalZ = 0.1F;
  return normal.z() < kMaxSideNormalZ && lowest > top - kEdgeRadius;
}

float lowest_point(const Shape& shape, const Vec3& centre, const Mat3& axes) {
  return centre.z() - axes.row(2).cwiseAbs().dot(shape.half_extents);
}

void collide_shape_with_field(const surface::Field& field, const Shape& shape, const Vec3& centre,
                              const Mat3& axes, float margin, std::vector<Contact>& out,
                              const FreeCell* free_cell) {
  const float lowest = lowest_point(shape, centre, axes);
  const auto take = [&](const ManifoldCandidate& c) {
    if (rides_up(c.normal, field.column_height()[c.tag], lowest)) return;
    Contact& contact = out.emplace_back();
    contact.normal = c.normal;
    contact.anchor = c.point + c.normal * c.separation - centre;
    contact.separation = c.separation;
    contact.partner = Partner::kCell;
    contact.feature_id = c.tag;
    if (!free_cell) set_surface_velocity(field, c.point, contact);
  };
  for_each_part_on_field(field, free_cell, shape, centre, axes, margin, [&](PartOnField& part_on_field) {
    if (field.has_contacts_per_cell())
      part_on_field.search_each_cell(take);
    else
      reduce_planes(part_on_field.search(), take);
  });
}

void append_reduced(std::span<const Contact> contacts, std::vector<Contact>& out) {
  Candidates& candidates = empty_candidates();
  for (std::size_t k = 0; k < contacts.size(); ++k) {
    const Contact& c = contacts[k];
    candidates.push_back({c.anchor - c.separation * c.normal, c.normal, c.separation, static_cast<int>(k)});
  }
  reduce_planes(candidates, [&](const ManifoldCandidate& c) { out.push_back(contacts[c.tag]); });
}

float collect_field_candidates(const surface::Field& field, const Shape& shape, const Vec3& centre,
                               const Mat3& axes, float margin, std::vector<FieldCandidate>& out) {
  int part_index = 0;
  float lead = std::numeric_limits<float>::infinity();
  for_each_part_on_field(field, nullptr, shape, centre, axes, margin, [&](PartOnField& part_on_field) {
    Candidates& candidates = part_on_field.search();
    sort_by_plane(candidates, [&](const ManifoldCandidate& c, int plane) {
      out.push_back({c, part_index, plane});
    });
    lead = std::min(lead, part_on_field.lead());
    ++part_index;
  });
  return lead;
}

void collide_shape_with_ground(const Shape& shape, const Vec3& centre, const Mat3& axes, float ground_height,
                               float margin, std::vector<Contact>& out) {
  for_each_part(shape, [&](const ConvexPart& part) {
    ManifoldReducer candidates;
    const SupportFeature lowest = support_feature(part, centre, axes, Vec3(0, 0, -1));
    for (int i = 0; i < lowest.count; ++i) {
      const Vec3& p = lowest.point[i];
      if (p.z() - ground_height <= margin) candidates.add({p, Vec3(0, 0, 1), p.z() - ground_height, 0});
    }
    candidates.reduce([&](const ManifoldCandidate& c) {
      Contact& contact = out.emplace_back();
      contact.normal = c.normal;
      contact.anchor = c.point - centre;
      contact.separation = c.separation;
      contact.partner = Partner::kGround;
    });
  });
}

}  // namespace smartsurf::world
