#include "smartsurf/world/field/ContinuousCollision.h"

#include <algorithm>
#include <cmath>

namespace smartsurf::world {
namespace {

constexpr float kAllowedPenetration = 0.005F;  // u
// How much deeper a body may get in a step that touches already. With none, one that slides into a gap stops
// wherever it is, and keeps the velocity that its contacts leave it; those push it out again.
constexpr float kAllowedGrowth = 0.0025F;  // u
constexpr int kMaxSweepSteps = 64, kBisections = 6;

// The motion of one body during the step; fraction 0 is its start, 1 its end.
class BodySweep {
 public:
  BodySweep(const FieldCollider& field, const BodyStore& bodies, std::size_t body, const DeltaPose& motion)
      : field_(field),
        shape_(*bodies.shape[body]),
        start_(bodies.position[body]),
        local_origin_(bodies.local_origin[body]),
        bounding_radius_(bodies.bounding_radius[body]),
        orientation_(bodies.orientation[body]),
        translation_(motion.translation),
        rotation_(motion.rotation) {}

  bool may_hit_field() const {
    const Vec3 to = start_ + translation_, reach = Vec3::Constant(bounding_radius_);
    return field_.may_overlap(start_.cwiseMin(to) - reach, start_.cwiseMax(to) + reach);
  }

  float penetration_at(float fraction) const {
    thread_local std::vector<Contact> touching;
    touching.clear();
    const Mat3 axes = (rotation_from_vector(fraction * rotation_) * orientation_).toRotationMatrix();
    field_.collide(shape_, start_ + fraction * translation_ + axes * local_origin_, axes, 0.0F, touching);
    float deepest = 0.0F;
    for (const Contact& c : touching) deepest = std::max(deepest, -c.separation);
    return deepest;
  }

  // The last fraction in [begin, end] with a penetration of at most `depth_allowed`, by bisection.
  float bisect_impact(float depth_allowed, float begin, float end) const {
    for (int i = 0; i < kBisections; ++i) {
      const float middle = 0.5F * (begin + end);
      (penetration_at(middle) > depth_allowed ? end : begin) = middle;
    }
    return begin;
  }

 private:
  const FieldCollider& field_;
  const Shape& shape_;
  const Vec3 &start_, &local_origin_;
  const float bounding_radius_;
  const Quat& orientation_;
  const Vec3 translation_, rotation_;
};

// Upper bound of the distance that any point of the body moves in the step.
float max_travel(const BodyStore& bodies, std::size_t body, const DeltaPose& shift) {
  return Vec3(shift.translation).norm() + Vec3(shift.rotation).norm() * bodies.bounding_radius[body];
}

}  // namespace

float fraction_until_impact(const FieldCollider& field, const BodyStore& bodies, std::size_t body,
                            const DeltaPose& motion) {
  constexpr float kAll = 1.0F;
  if (bodies.is_sphere[body]) return kAll;
  const float travel = max_travel(bodies, body, motion);
  if (!(travel > 0.25F * bodies.width[body])) return kAll;
  const BodySweep sweep(field, bodies, body, motion);
  if (!sweep.may_hit_field()) return kAll;
  // Advance by at most half a column per step, so that no column is skipped.
  const int steps = std::min(kMaxSweepSteps, 1 + static_cast<int>(travel / field.min_half_top()));
  const float allowed = std::max(kAllowedPenetration, sweep.penetration_at(0.0F) + kAllowedGrowth);
  for (int i = 1; i <= steps; ++i) {
    const float end = static_cast<float>(i) / static_cast<float>(steps);
    if (sweep.penetration_at(end) > allowed)
      return sweep.bisect_impact(allowed, static_cast<float>(i - 1) / static_cast<float>(steps), end);
  }
  return kAll;
}

bool clip_to_time_of_impact(const FieldCollider& field, BodyStore& bodies, std::size_t body) {
  DeltaPose& delta = bodies.delta_pose[body];
  const float fraction = fraction_until_impact(field, bodies, body, delta);
  if (fraction == 1.0F) return false;
  for (int axis = 0; axis < 3; ++axis) delta.translation[axis] *= fraction, delta.rotation[axis] *= fraction;
  return true;
}

}  // namespace smartsurf::world
