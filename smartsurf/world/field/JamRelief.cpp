#include "smartsurf/world/field/JamRelief.h"

#include <algorithm>

#include "smartsurf/world/field/CellForceLimits.h"

namespace smartsurf::world {
namespace {

// Deep contacts: what hard contacts may reach, u, and what cells may do at this speed in a step, u/s.
constexpr float kHardDepth = 4e-3F, kDepthPerStep = 1.0F;
// A cell retreats out of a contact deeper than that of the stall within this time, at most at kMaxRetreatSpeed.
constexpr float kRetreatTime_s = 0.05F;

// A contact whose normal has a smaller vertical component lies on a cell's side.
constexpr float kMaxSideNormalZ = 0.1F;

}  // namespace

JamRelief::JamRelief(float dt_s) : min_depth_(kHardDepth + kDepthPerStep * dt_s) {}

bool JamRelief::hold_cells(surface::Field& field) {
  for (const StalledCell& s : held_) planned_speed_[static_cast<std::size_t>(s.cell)] = 0.0F;
  held_.swap(stalled_);
  stalled_.clear();
  if (held_.empty()) return false;
  planned_speed_.resize(field.speed.size(), 0.0F);
  for (const StalledCell& s : held_) {
    const auto i = static_cast<std::size_t>(s.cell);
    if (planned_speed_[i] == 0.0F) planned_speed_[i] = field.speed[i];
    if (!s.descends)
      field.speed[i] = std::min(field.speed[i], s.speed);
    else if (planned_speed_[i] < 0.0F)
      field.speed[i] = std::max(field.speed[i], s.speed);
  }
  return true;
}

bool JamRelief::stall_cells(std::span<const DeepContact> deep_contacts, const ContactList& static_contacts,
                            const BodyStore& bodies, surface::Field& field) {
  if (deep_contacts.empty()) return false;
  planned_speed_.resize(field.speed.size(), 0.0F);
  depth_.resize(bodies.id.size(), 0.0F);
  for (const DeepContact& d : deep_contacts) {
    float& depth = depth_[static_cast<std::size_t>(d.body)];
    depth = std::max(depth, d.depth);
  }
  bool lowered = false;
  for (const Manifold& m : static_contacts.manifolds) {
    const float depth = depth_[static_cast<std::size_t>(m.a)];
    if (depth == 0.0F) continue;
    // Spheres slip out of wedges by themselves.
    const bool may_wedge = !bodies.is_sphere[static_cast<std::size_t>(m.a)];
    const float fraction = std::max(0.0F, 2.0F - depth / min_depth_);
    for (int k = m.first; k < m.first + m.count; ++k) {
      const Contact& c = static_contacts.contacts[static_cast<std::size_t>(k)];
      if ((c.other != kField && c.other != kSupportedField && c.other != kSkin) ||
          c.total_normal_impulse <= 0.0F)
        continue;
      float& speed = field.speed[static_cast<std::size_t>(c.feature_id)];
      const float held = planned_speed_[static_cast<std::size_t>(c.feature_id)],
                  planned = held != 0.0F ? held : c.surface_velocity.z();
      if (may_wedge && planned < 0.0F && c.normal.z() < kMaxSideNormalZ) {
        const float bound = fraction * planned;
        if (planned < bound) stalled_.push_back({c.feature_id, bound, true});
        if (speed >= bound) continue;
        speed = bound;
        lowered = true;
        continue;
      }
      float bound = fraction * std::max(planned, 0.0F);
      if (planned > 0.0F && -c.separation > 2.0F * min_depth_)
        bound = -std::min((-c.separation - 2.0F * min_depth_) / kRetreatTime_s, kMaxRetreatSpeed);
      if (may_wedge && planned > bound) stalled_.push_back({c.feature_id, bound, false});
      if (speed <= bound) continue;
      speed = bound;
      lowered = true;
    }
  }
  for (const DeepContact& d : deep_contacts) depth_[static_cast<std::size_t>(d.body)] = 0.0F;
  return lowered;
}

}  // namespace smartsurf::world
