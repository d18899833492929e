#include "smartsurf/world/field/JamRelief.h"

#include <algorithm>
#include <cmath>

#include "smartsurf/world/field/CellForceLimits.h"

namespace smartsurf::world {
namespace {

// A body in a contact deeper than kHardDepth + kJamDepthRate_ups · dt counts as jammed.
constexpr float kHardDepth = 4e-3F;  // u
constexpr float kJamDepthRate_ups = 1.0F;
// A cell retreats out of a contact deeper than that of the stall within this time, at most at
// kMaxRetreatSpeed.
constexpr float kRetreatTime_s = 0.05F;

// A cell that stalled stays so for this long.
constexpr float kHoldTime_s = 0.05F;

// A contact whose normal has a smaller vertical component lies on a cell's side.
constexpr float kMaxSideNormalZ = 0.1F;

}  // namespace

JamRelief::JamRelief(float dt_s)
    : dt_s_(dt_s),
      min_depth_(kHardDepth + kJamDepthRate_ups * dt_s),
      hold_steps_(std::max(1, static_cast<int>(std::lround(kHoldTime_s / dt_s)))) {}

bool JamRelief::hold_cells(surface::Field& field) {
  if (held_.empty()) return false;
  planned_speed_.resize(field.speed.size(), 0.0F);
  std::size_t kept = 0;
  for (const StalledCell& s : held_) {
    float& speed = field.speed[s.cell];
    planned_speed_[s.cell] = 0.0F;
    held_of_cell_[s.cell] = -1;
    if (s.steps_left == 0) continue;
    planned_speed_[s.cell] = speed;
    if (!s.descends)
      speed = std::min(speed, s.speed);
    else if (speed < 0.0F)
      speed = std::max(speed, s.speed);
    held_of_cell_[s.cell] = static_cast<std::int32_t>(kept);
    held_[kept] = s;
    --held_[kept++].steps_left;
  }
  held_.resize(kept);
  return true;
}

// Bounds the upward speed of a cell, in the coming steps too if it `holds`. Returns whether that lowers the
// speed.
bool JamRelief::slow_down(std::int32_t cell, float bound, bool holds, surface::Field& field) {
  if (holds) hold({cell, std::max(bound, 0.0F), false, hold_steps_});  // a retreat lasts one step
  float& speed = field.speed[cell];
  if (speed <= bound) return false;
  speed = bound;
  return true;
}

// The slowest of the bounds of this step replaces that of an earlier one.
void JamRelief::hold(const StalledCell& s) {
  std::int32_t& index = held_of_cell_[s.cell];
  if (index < 0) {
    index = static_cast<std::int32_t>(held_.size());
    held_.push_back(s);
    return;
  }
  StalledCell& old = held_[index];
  const bool is_of_this_step = old.steps_left == s.steps_left && old.descends == s.descends;
  const float speed = s.descends ? std::max(old.speed, s.speed) : std::min(old.speed, s.speed);
  old = s;
  if (is_of_this_step) old.speed = speed;
}

void JamRelief::spread(std::vector<JammedBody>& jammed, const ContactList& pair_contacts,
                       const BodyStore& bodies) {
  jam_.resize(bodies.id.size());
  for (const JammedBody& j : jammed) jam_[j.body].depth = j.depth;
  for (bool changed = true; changed;) {
    changed = false;
    for (const Manifold& m : pair_contacts.manifolds) {
      Jam &a = jam_[m.a], &b = jam_[m.b];
      if ((a.depth > 0.0F) == (b.depth > 0.0F)) continue;
      float impulse = 0.0F, upward = 0.0F;  // on a
      for (const Contact& c : pair_contacts.contacts_of(m))
        impulse += c.total_normal_impulse, upward += c.total_normal_impulse * c.normal.z();
      if (impulse <= 0.0F) continue;
      if (b.depth > 0.0F)
        jammed.push_back({m.a, a.depth = b.depth, upward < 0.0F});
      else
        jammed.push_back({m.b, b.depth = a.depth, upward > 0.0F});
      changed = true;
    }
  }
  for (const JammedBody& j : jammed) jam_[j.body] = {};
}

void JamRelief::archive(common::StateArchive& a) { a(held_, held_of_cell_, planned_speed_); }

bool JamRelief::stall_cells(std::span<const JammedBody> jammed, const ContactList& static_contacts,
                            std::span<const SupportPatches> supports, const BodyStore& bodies,
                            surface::Field& field) {
  if (jammed.empty()) return false;
  planned_speed_.resize(field.speed.size(), 0.0F);
  held_of_cell_.resize(field.speed.size(), -1);
  jam_.resize(bodies.id.size());
  for (const JammedBody& j : jammed) {
    Jam& jam = jam_[j.body];
    jam.depth = std::max(jam.depth, j.depth);
    jam.from_above |= j.from_above;
  }
  bool lowered = false;
  for (const Manifold& m : static_contacts.manifolds) {
    const Jam& jam = jam_[m.a];
    if (jam.depth == 0.0F) continue;
    // Spheres slip out of wedges by themselves, unless something lies on them.
    const bool may_wedge = jam.from_above || !bodies.is_sphere[m.a];
    const float fraction = std::max(0.0F, 2.0F - jam.depth / min_depth_);
    for (const Contact& c : static_contacts.contacts_of(m)) {
      if (!c.moves_with_cell()) continue;
      const bool bears = c.total_normal_impulse > 0.0F;
      if (!bears && !may_wedge) continue;
      float& speed = field.speed[c.feature_id];
      // A point that rolls passes its cell at a velocity of its own.
      const float held = planned_speed_[c.feature_id],
                  own = c.surface_acceleration.isZero(0.0F) ? c.surface_velocity.z() : speed,
                  planned = held != 0.0F ? held : own;
      if (may_wedge && planned < 0.0F && c.normal.z() < kMaxSideNormalZ) {
        const float bound = fraction * planned;
        if (!bears) continue;
        if (planned < bound) hold({c.feature_id, bound, true, hold_steps_});
        if (speed >= bound) continue;
        speed = bound;
        lowered = true;
        continue;
      }
      float bound = fraction * std::max(planned, 0.0F);
      if (!bears) bound = std::max(bound, std::max(c.separation, 0.0F) / dt_s_);
      if (planned > 0.0F && -c.separation > 2.0F * min_depth_)
        bound = -std::min((-c.separation - 2.0F * min_depth_) / kRetreatTime_s, kMaxRetreatSpeed);
      lowered |= slow_down(c.feature_id, bound, may_wedge && planned > bound, field);
    }
  }
  // The few contacts of a flat face stand for all cells that it covers.
  for (const SupportPatches& list : supports)
    for (const SupportPatch& p : list.patches) {
      const Jam& jam = jam_[p.body];
      if (jam.depth == 0.0F) continue;
      const float fraction = std::max(0.0F, 2.0F - jam.depth / min_depth_);
      for (int i = p.first; i < p.first + p.count; ++i) {
        const std::int32_t cell = list.samples.cell[i];
        const float held = planned_speed_[cell], planned = held != 0.0F ? held : field.speed[cell];
        if (planned > 0.0F) lowered |= slow_down(cell, fraction * planned, fraction < 1.0F, field);
      }
    }
  for (const JammedBody& j : jammed) jam_[j.body] = {};
  return lowered;
}

}  // namespace smartsurf::world
