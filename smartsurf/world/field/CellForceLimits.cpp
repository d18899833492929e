#include "smartsurf/world/field/CellForceLimits.h"

#include <algorithm>
#include <cmath>

namespace smartsurf::world {
namespace {

// A contact whose normal has a smaller vertical component lies on a cell's side and does not load the cell.
constexpr float kMinLoadNormalZ = 0.05F;
// Penetration up to which a yielding cell moves on, u: the contact solver resists it with all that the cell
// can give.
constexpr float kYieldingOverlap = 3e-3F;
// A body uses up its share from this fraction on.
constexpr float kUsedUp = 0.999F;
// Fraction of a deeper penetration that a yielding cell resolves in a step.
constexpr float kResolvedPerStep = 0.1F;
// Fraction of a cell's force limit that its bodies share evenly. The rest is shared by demand.
constexpr float kEvenFraction = 0.02F;
// Below it products of impulses underflow. A cell without any force bears this: its contacts need an impulse
// to make it yield.
constexpr float kLeastForce = 1e-30F;  // in the units of the field

float force_limit_of(const surface::Field& field, std::size_t cell) {
  return std::max(field.force_limit[cell], kLeastForce);
}

}  // namespace

template <class List, class Each>
void CellForceLimits::for_each_limited(const surface::Field& field, List& static_contacts, const Manifold& m,
                                       Each each) const {
  for (int k = m.first; k < m.first + m.count; ++k) {
    auto& c = static_contacts.contacts[k];
    if (!c.touches_cell() || c.normal.z() < kMinLoadNormalZ) continue;
    if (std::isfinite(field.force_limit[c.feature_id])) each(c, k);
  }
}

void CellForceLimits::collect_bodies_on_cells(const surface::Field& field, int substeps,
                                              const ContactList& static_contacts) {
  bodies_on_cells_.clear();
  body_of_contact_.resize(static_contacts.contacts.size());
  for (const Manifold& m : static_contacts.manifolds) {
    const std::size_t first_body = bodies_on_cells_.size();
    for_each_limited(field, static_contacts, m, [&](const Contact& c, int k) {
      const std::size_t cell = c.feature_id;
      std::int32_t& first = first_contact_[cell];
      if (first < 0) {
        first = k;
        body_of_contact_[k] = static_cast<std::int32_t>(bodies_on_cells_.size());
        bodies_on_cells_.push_back({cell, k});
        ++body_count_[cell];
      }
      const std::int32_t body = body_of_contact_[first];
      body_of_contact_[k] = body;
      BodyOnCell& on_cell = bodies_on_cells_[body];
      on_cell.demand += c.normal_impulse * c.normal.z();
      if (std::isfinite(c.max_cell_impulse))
        on_cell.last_share = std::max(on_cell.last_share, c.max_cell_impulse);
      ++on_cell.contact_count;
      limits_[k] = {field.no_load_speed[cell], field.speed[cell], first - k};
    });
    for (std::size_t b = first_body; b < bodies_on_cells_.size(); ++b) {
      BodyOnCell& body = bodies_on_cells_[b];
      first_contact_[body.cell] = -1;
      if (body.last_share > 0.0F && body.demand * static_cast<float>(substeps) >= kUsedUp * body.last_share)
        body.demand *= 2.0F;
      load_[body.cell] += body.demand;
    }
  }
  for (const Manifold& m : static_contacts.manifolds)
    for_each_limited(field, static_contacts, m, [&](const Contact&, int i) {
      limits_[i].point_count = bodies_on_cells_[body_of_contact_[i]].contact_count;
    });
}

void CellForceLimits::distribute_limits(const surface::Field& field, float dt_s, int substeps,
                                        ContactList& static_contacts) {
  limits_.clear();
  if (!field.has_force_limit()) return;
  limits_.resize(static_contacts.contacts.size());
  load_.resize(field.height.size(), 0.0F);
  body_load_.resize(load_.size(), 0.0F);
  body_count_.resize(load_.size(), 0);
  first_contact_.resize(load_.size(), -1);
  capacity_.resize(load_.size(), 0.0F);
  collect_bodies_on_cells(field, substeps, static_contacts);
  for (const Manifold& m : static_contacts.manifolds)
    for_each_limited(field, static_contacts, m, [&](Contact& c, int k) {
      const BodyOnCell& body = bodies_on_cells_[body_of_contact_[k]];
      c.max_cell_impulse = force_limit_of(field, body.cell) * dt_s;
      if (body_count_[body.cell] == 1) return;
      const float even_share = 1.0F / static_cast<float>(body_count_[body.cell]);
      const float by_demand = load_[body.cell] > 0.0F ? body.demand / load_[body.cell] : even_share;
      c.max_cell_impulse *= kEvenFraction * even_share + (1.0F - kEvenFraction) * by_demand;
    });
  for (const BodyOnCell& body : bodies_on_cells_) {
    load_[body.cell] = 0.0F;
    body_count_[body.cell] = 0;
  }
}

void CellForceLimits::yield_overloaded_cells(const BodyStore& bodies, const ContactList& static_contacts,
                                             float dt_s, surface::Field& field) {
  if (!field.has_force_limit()) return;
  auto cell_of = [](const Contact& c) { return c.feature_id; };
  auto capacity_of = [this](const BodyOnCell& body) { return limits_[body.first_contact].capacity; };
  auto impulse_on_cell = [](const Contact& c) { return c.total_normal_impulse * c.normal.z(); };
  for (const Manifold& m : static_contacts.manifolds)
    for_each_limited(field, static_contacts, m,
                     [&](const Contact& c, int) { load_[cell_of(c)] += impulse_on_cell(c); });
  for (const BodyOnCell& body : bodies_on_cells_) capacity_[body.cell] += capacity_of(body);
  for (const Manifold& m : static_contacts.manifolds) {
    for_each_limited(field, static_contacts, m,
                     [&](const Contact& c, int) { body_load_[cell_of(c)] += impulse_on_cell(c); });
    for_each_limited(field, static_contacts, m, [&](const Contact& c, int k) {
      const std::size_t cell = cell_of(c);
      const BodyOnCell& body = bodies_on_cells_[body_of_contact_[k]];
      if (c.total_normal_impulse <= 0.0F) return;
      const float room = c.separation + kYieldingOverlap;
      // Out of a deep penetration the cell retreats under any load, and lifts the body from there.
      if (room < -kYieldingOverlap)
        field.speed[cell] =
            std::min(field.speed[cell], std::max(kResolvedPerStep * room / dt_s, -kMaxRetreatSpeed));
      const DeltaPose& shift = bodies.delta_pose[m.a];
      const Vec3 moved = Vec3(shift.translation) + Vec3(shift.rotation).cross(c.anchor);
      const float following =
          ((room < 0.0F ? kResolvedPerStep * room : room) + c.normal.dot(moved)) / (c.normal.z() * dt_s);
      const bool yields = body_load_[cell] >= kYieldingLoad * capacity_of(body) &&
                          load_[cell] >= kYieldingLoad * capacity_[cell];
      const float motor_speed =
          field.no_load_speed[cell] * (1.0F - load_[cell] / (force_limit_of(field, cell) * dt_s));
      if (yields) field.speed[cell] = std::min(field.speed[cell], std::max(motor_speed, 0.0F));
      // A cell does not rise into its load, whose other cells may bear all that it needs.
      field.speed[cell] = std::min(field.speed[cell], yields ? following : std::max(following, 0.0F));
    });
    for_each_limited(field, static_contacts, m,
                     [&](const Contact& c, int) { body_load_[cell_of(c)] = 0.0F; });
  }
  for (const BodyOnCell& body : bodies_on_cells_) load_[body.cell] = capacity_[body.cell] = 0.0F;
}

}  // namespace smartsurf::world
