#include "smartsurf/world/field/JamRelief.h"

#include <algorithm>

namespace smartsurf::world {
namespace {

// Deep contacts: what hard contacts may reach, u, and what cells may do at this speed in a step, u/s.
constexpr float kHardDepth = 4e-3F, kDepthPerStep = 1.0F;
// A cell retreats out of a contact deeper than that of the stall within this time, at most at this speed, u/s.
constexpr float kRetreatTime_s = 0.05F, kMaxRetreatSpeed = 1.0F;

}  // namespace

JamRelief::JamRelief(float dt_s) : min_depth_(kHardDepth + kDepthPerStep * dt_s) {}

bool JamRelief::stall_cells(std::span<const DeepContact> deep_contacts, const ContactList& static_contacts,
                            std::size_t bodies, surface::Field& field) {
  if (deep_contacts.empty()) return false;
  depth_.resize(bodies, 0.0F);
  for (const DeepContact& d : deep_contacts) {
    float& depth = depth_[static_cast<std::size_t>(d.body)];
    depth = std::max(depth, d.depth);
  }
  bool lowered = false;
  for (const Manifold& m : static_contacts.manifolds) {
    const float depth = depth_[static_cast<std::size_t>(m.a)];
    if (depth == 0.0F) continue;
    const float fraction = std::max(0.0F, 2.0F - depth / min_depth_);
    for (int k = m.first; k < m.first + m.count; ++k) {
      const Contact& c = static_contacts.contacts[static_cast<std::size_t>(k)];
      if (c.other != kField || c.total_normal_impulse <= 0.0F) continue;
      float& speed = field.speed[static_cast<std::size_t>(c.feature_id)];
      float bound = fraction * std::max(c.surface_velocity.z(), 0.0F);
      if (c.surface_velocity.z() > 0.0F && -c.separation > 2.0F * min_depth_)
        bound = -std::min((-c.separation - 2.0F * min_depth_) / kRetreatTime_s, kMaxRetreatSpeed);
      if (speed <= bound) continue;
      speed = bound;
      lowered = true;
    }
  }
  for (const DeepContact& d : deep_contacts) depth_[static_cast<std::size_t>(d.body)] = 0.0F;
  return lowered;
}

}  // namespace smartsurf::world
