#include "smartsurf/world/field/SphereOnField.h"

#include <numbers>

namespace smartsurf::world {
namespace {

struct SphereCandidate {
  Vec3 normal;
  float separation;
  int row, column;
  float order = separation;  // SphereContact::order
};

using Reducer = SphereManifoldReducer<SphereCandidate, &SphereCandidate::order>;

float gap_entered_by_sphere(float radius) { return std::numbers::sqrt2_v<float> * radius; }

Vec3 offset_from(const Column& q, const Vec3& p) {
  return p -
         Vec3(std::clamp(p.x(), q.west, q.east), std::clamp(p.y(), q.south, q.north), std::min(p.z(), q.top));
}

// Replaces the tangent plane of a column, which a sphere meets in its motion, by the one that it meets last:
// where it touches the column, or beyond the motion's end. It would bounce off the planes of edges that it
// passes. The sphere cannot touch the column before it meets a plane, so that the planes lead to the time of
// impact as tangents lead Newton's method to the root of a convex function.
void advance_to_impact(const Column& q, const Vec3& centre, float radius, const Vec3& motion,
                       SphereCandidate& plane) {
  constexpr int kNewtonSteps = 8;
  constexpr float kTouching = 1e-3F;  // of the radius
  constexpr float kFirst = 1e-6F;
  const float touching = kTouching * radius;
  float separation = plane.separation, time = 0.0F;
  if (separation <= touching) return;
  for (int i = 0; i < kNewtonSteps && separation > touching; ++i) {
    const float closing = -plane.normal.dot(motion);
    if (closing > 0.0F) time += separation / closing;
    if (!(closing > 0.0F && time < 1.0F)) {
      plane.order = plane.separation;
      return;
    }
    const Vec3 offset = offset_from(q, centre + time * motion);
    const float length = offset.norm();
    if (!(length > 0.0F) || q.leans_over_bridge(offset.x(), offset.y(), 0.0F)) break;
    plane.normal = offset / length, separation = length - radius;
    plane.separation = separation - time * plane.normal.dot(motion);
  }
  plane.order = kFirst * time;
}

// Calls found(candidate) for the column's candidate, if there is any.
template <class Found>
void collide_column(const Columns& columns, int row, int column, const Vec3& centre, float radius,
                    float reach, const SphereMotion& motion, Found found) {
  const Column q = columns.at(row, column);
  const Vec3 offset = offset_from(q, centre);
  const float distance_squared = offset.squaredNorm();
  if (distance_squared > reach * reach) return;
  if (distance_squared > 1e-12F) {
    // Beyond a bridged side the neighbour is closer and yields the contact.
    if (q.leans_over_bridge(offset.x(), offset.y(), 0.0F)) return;
    const float length = std::sqrt(distance_squared);
    SphereCandidate candidate{offset / length, length - radius, row, column};
    if (motion.dt_s > 0.0F)
      advance_to_impact(q, centre, radius, motion.over(columns.field(), columns.index(row, column)),
                        candidate);
    found(candidate);
  } else {
    const EscapeDirection out = escape_direction(q, centre, centre, false);
    if (!std::isinf(out.distance)) found(SphereCandidate{out.normal, out.distance - radius, row, column});
  }
}

void set_contact(const Columns& columns, float radius, const SphereCandidate& from, Contact& to) {
  to.normal = from.normal;
  to.anchor = -radius * from.normal;
  to.separation = from.separation;
  to.partner = Partner::kCell;
  to.feature_id = columns.index(from.row, from.column);
}

}  // namespace

void set_surface_velocity(const surface::Field& f, const Vec3& point, Contact& c) {
  const Index i = c.feature_id;
  c.surface_velocity = {0, 0, f.speed[i]};
  if (!f.has_surface_velocity()) return;
  const float spin = f.surface_spin.empty() ? 0.0F : f.surface_spin[i];
  const Eigen::Vector2f centre = f.centre(c.feature_id);
  const Vec3 cell_velocity(f.surface_velocity_x[i] - spin * (point.y() - centre.y()),
                           f.surface_velocity_y[i] + spin * (point.x() - centre.x()), 0);
  // Tangential only: the cell itself does not move horizontally.
  c.surface_velocity += cell_velocity - c.normal * c.normal.dot(cell_velocity);
  c.surface_spin = spin;
}

std::optional<SphereContact> collide_sphere_with_cell(const surface::Field& field, const FreeCell& cell,
                                                      const Vec3& centre, float radius, float margin,
                                                      const SphereMotion& motion) {
  const Columns columns(field, gap_entered_by_sphere(radius), &cell);
  std::optional<SphereContact> contact;
  collide_column(columns, 0, 0, centre, radius, radius + margin, motion, [&](const SphereCandidate& found) {
    set_contact(columns, radius, found, contact.emplace());
    contact->order = found.order;
  });
  return contact;
}

void collide_sphere_with_field(const surface::Field& field, const Vec3& centre, float radius, float margin,
                               std::vector<Contact>& out, const SphereMotion& motion) {
  const float reach = radius + margin;
  if (centre.z() - reach > field.max_height) return;
  const Columns columns(field, gap_entered_by_sphere(radius));
  const CellRange cells =
      columns.cells_covering(centre.x() - reach, centre.x() + reach, centre.y() - reach, centre.y() + reach);
  const float half_pitch = 0.5F * columns.pitch(), reach_squared = reach * reach;
  Reducer reducer;
  for (int r = cells.row_begin; r < cells.row_end; ++r) {
    const float dy = std::max(0.0F, std::abs(centre.y() - columns.y(r)) - half_pitch);
    for (int c = cells.column_begin; c < cells.column_end; ++c) {
      const float dx = std::max(0.0F, std::abs(centre.x() - columns.x(c)) - half_pitch);
      const float dz = std::max(0.0F, centre.z() - columns.top(r, c));
      if (dx * dx + dy * dy + dz * dz <= reach_squared)
        collide_column(columns, r, c, centre, radius, reach, motion,
                       [&](const SphereCandidate& found) { reducer.add(found); });
    }
  }
  reducer.reduce([&](const SphereCandidate& t) {
    Contact& c = out.emplace_back();
    set_contact(columns, radius, t, c);
    set_surface_velocity(field, centre - (radius + t.separation) * t.normal, c);
  });
}

}  // namespace smartsurf::world
