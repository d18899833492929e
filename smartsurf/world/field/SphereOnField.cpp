#include "smartsurf/world/field/SphereOnField.h"

#include <numbers>

#include "smartsurf/world/field/SphereManifoldReducer.h"

namespace smartsurf::world {
namespace {

struct SphereCandidate {
  Vec3 normal;
  float separation;
  int row, column;
  float order = separation;  // what the sphere meets in the step comes before all that it passes
};

// The motion of a sphere in the step.
struct SphereMotion {
  Vec3 velocity;
  float dt_s;

  // Relative to the cell's top.
  Vec3 over(const surface::Field& f, Index cell) const {
    return dt_s * (velocity - Vec3(0, 0, f.speed[cell]));
  }
};

using Reducer = SphereManifoldReducer<SphereCandidate, &SphereCandidate::order>;

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
  constexpr int kMaxAdvances = 8;
  constexpr float kTouching = 1e-3F;  // of the radius
  constexpr float kFirst = 1e-6F;
  const float touching = kTouching * radius;
  float separation = plane.separation, time = 0.0F;
  if (separation <= touching) return;
  for (int i = 0; i < kMaxAdvances && separation > touching; ++i) {
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

void collide_column(const Columns& columns, int row, int column, const Vec3& centre, float radius,
                    float reach, const SphereMotion& motion, Reducer& reducer) {
  const Column q = columns.at(row, column);
  const Vec3 offset = offset_from(q, centre);
  const float distance_squared = offset.squaredNorm();
  if (distance_squared > reach * reach) return;
  if (distance_squared > 1e-12F) {
    // Beyond a bridged side the neighbour is closer and yields the contact.
    if (q.leans_over_bridge(offset.x(), offset.y(), 0.0F)) return;
    const float length = std::sqrt(distance_squared);
    SphereCandidate found{offset / length, length - radius, row, column};
    if (motion.dt_s > 0.0F)
      advance_to_impact(q, centre, radius, motion.over(columns.field(), columns.index(row, column)), found);
    reducer.add(found);
  } else {
    const EscapeDirection out = escape_direction(q, centre, centre, false);
    if (!std::isinf(out.distance)) reducer.add({out.normal, out.distance - radius, row, column});
  }
}

}  // namespace

void set_surface_velocity(const Columns& columns, int row, int column, const Vec3& point, Contact& c) {
  const surface::Field& f = columns.field();
  const Index i = columns.index(row, column);
  c.surface_velocity = {0, 0, f.speed[i]};
  if (!f.has_surface_velocity()) return;
  const float spin = f.surface_spin.empty() ? 0.0F : f.surface_spin[i];
  const Vec3 cell_velocity(f.surface_velocity_x[i] - spin * (point.y() - columns.y(row)),
                           f.surface_velocity_y[i] + spin * (point.x() - columns.x(column)), 0);
  // Tangential only: the cell itself does not move horizontally.
  c.surface_velocity += cell_velocity - c.normal * c.normal.dot(cell_velocity);
  c.surface_spin = spin;
}

void collide_sphere_with_field(const surface::Field& field, const Vec3& centre, float radius, float margin,
                               std::vector<Contact>& out, const Vec3& velocity, float dt_s) {
  const float reach = radius + margin;
  if (centre.z() - reach > field.max_height) return;
  const Columns columns(field, std::numbers::sqrt2_v<float> * radius);
  const CellRange cells =
      columns.cells_covering(centre.x() - reach, centre.x() + reach, centre.y() - reach, centre.y() + reach);
  const float half_pitch = 0.5F * columns.pitch(), reach_squared = reach * reach;
  const SphereMotion motion{velocity, dt_s};
  Reducer reducer;
  for (int r = cells.row_begin; r < cells.row_end; ++r) {
    const float dy = std::max(0.0F, std::abs(centre.y() - columns.y(r)) - half_pitch);
    for (int c = cells.column_begin; c < cells.column_end; ++c) {
      const float dx = std::max(0.0F, std::abs(centre.x() - columns.x(c)) - half_pitch);
      const float dz = std::max(0.0F, centre.z() - columns.top(r, c));
      if (dx * dx + dy * dy + dz * dz <= reach_squared)
        collide_column(columns, r, c, centre, radius, reach, motion, reducer);
    }
  }
  reducer.reduce([&](const SphereCandidate& t) {
    Contact& contact = out.emplace_back();
    contact.normal = t.normal;
    contact.anchor = -radius * t.normal;
    contact.separation = t.separation;
    contact.partner = Partner::kCell;
    contact.feature_id = columns.index(t.row, t.column);
    set_surface_velocity(columns, t.row, t.column, centre - (radius + t.separation) * t.normal, contact);
  });
}

}  // namespace smartsurf::world
