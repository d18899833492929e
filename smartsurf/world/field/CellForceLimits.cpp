#include "smartsurf/world/field/CellForceLimits.h"

#include <algorithm>
#include <cmath>

namespace smartsurf::world {
namespace {

// A contact whose normal has a smaller vertical component lies on a cell's side and does not load the cell.
constexpr float kMinNormalZ = 0.05F;
// Typical penetration of a resting contact, u.
constexpr float kRestingOverlap = 2e-3F;
// A cell is saturated at this fraction of its force limit.
constexpr float kSaturation = 0.99F;
// Fraction of a cell's force limit that is shared evenly. The rest is shared in proportion to the last
// impulses, so that unused shares move to the contacts that need them over a few steps.
constexpr float kEvenFraction = 0.2F;

}  // namespace

template <class List, class Each>
void CellForceLimits::for_each_limited(const surface::Field& field, List& static_contacts, Each each) const {
  for (const Manifold& m : static_contacts.manifolds)
    for (int k = m.first; k < m.first + m.count; ++k) {
      auto& c = static_contacts.contacts[static_cast<std::size_t>(k)];
      if (c.other != kField || c.normal.z() < kMinNormalZ) continue;
      const auto cell = static_cast<std::size_t>(c.feature_id);
      if (std::isfinite(field.force_limit[cell])) each(c, m, cell);
    }
}

void CellForceLimits::distribute_limits(const surface::Field& field, float dt_s,
                                        ContactList& static_contacts) {
  if (!field.has_force_limit()) return;
  load_.resize(field.height.size(), 0.0F);
  contact_count_.resize(field.height.size(), 0);
  for_each_limited(field, static_contacts, [&](const Contact& c, const Manifold&, std::size_t cell) {
    load_[cell] += c.normal_impulse * c.normal.z();
    ++contact_count_[cell];
  });
  for_each_limited(field, static_contacts, [&](Contact& c, const Manifold&, std::size_t cell) {
    const float even_share = 1.0F / static_cast<float>(contact_count_[cell]);
    const float used_share = load_[cell] > 0.0F ? c.normal_impulse * c.normal.z() / load_[cell] : even_share;
    const float share = kEvenFraction * even_share + (1.0F - kEvenFraction) * used_share;
    c.max_normal_impulse = field.force_limit[cell] * dt_s * share / c.normal.z();
  });
  for_each_limited(field, static_contacts, [&](const Contact&, const Manifold&, std::size_t cell) {
    load_[cell] = 0.0F;
    contact_count_[cell] = 0;
  });
}

void CellForceLimits::yield_overloaded_cells(const BodyStore& bodies, const ContactList& static_contacts,
                                             float dt_s, surface::Field& field) {
  if (!field.has_force_limit()) return;
  for_each_limited(field, static_contacts, [&](const Contact& c, const Manifold&, std::size_t cell) {
    load_[cell] += c.total_normal_impulse * c.normal.z();
  });
  for_each_limited(field, static_contacts, [&](const Contact& c, const Manifold& m, std::size_t cell) {
    if (c.total_normal_impulse <= 0.0F || load_[cell] < kSaturation * field.force_limit[cell] * dt_s) return;
    const DeltaPose& shift = bodies.delta_pose[static_cast<std::size_t>(m.a)];
    const Vec3 moved = Vec3(shift.translation) + Vec3(shift.rotation).cross(c.anchor);
    // The top may move as far as the body's contact point did, but must also resolve an existing penetration.
    const float remaining_separation =
        c.separation < 0.0F ? std::min(0.0F, c.separation + kRestingOverlap) : c.separation;
    const float speed_limit_distance = (remaining_separation + c.normal.dot(moved)) / c.normal.z();
    field.speed[cell] = std::min(field.speed[cell], speed_limit_distance / dt_s);
  });
  for_each_limited(field, static_contacts,
                   [&](const Contact&, const Manifold&, std::size_t cell) { load_[cell] = 0.0F; });
}

}  // namespace smartsurf::world
