#include "smartsurf/world/FieldStop.h"

#include <algorithm>
#include <cmath>

namespace smartsurf::world {
namespace {

constexpr float kDeepest = 0.005F;  // u
constexpr int kMostStrides = 64, kHalvings = 6;

// One body along its way: 0 is where the step began, 1 where it ends.
class Way {
 public:
  Way(const Detector& detector, const BodyStore& bodies, std::size_t body)
      : detector_(detector),
        shape_(*bodies.shape[body]),
        from_(bodies.position[body]),
        orientation_(bodies.orientation[body]),
        by_(bodies.shift[body].by),
        turn_(bodies.shift[body].turn) {}

  bool over_field() const {
    const Vec3 to = from_ + by_, reach = Vec3::Constant(shape_.reach);
    return detector_.field_reaches(from_.cwiseMin(to) - reach, from_.cwiseMax(to) + reach);
  }

  float depth(float share) const {
    thread_local std::vector<Contact> touching;
    touching.clear();
    const Mat3 axes = (turn_by(share * turn_) * orientation_).toRotationMatrix();
    detector_.touch_field(shape_, from_ + share * by_, axes, 0.0F, touching);
    float deepest = 0.0F;
    for (const Contact& c : touching) deepest = std::max(deepest, -c.gap);
    return deepest;
  }

  // The last place between two where it is no deeper.
  float last_above(float depth_allowed, float begin, float end) const {
    for (int i = 0; i < kHalvings; ++i) {
      const float middle = 0.5F * (begin + end);
      (depth(middle) > depth_allowed ? end : begin) = middle;
    }
    return begin;
  }

 private:
  const Detector& detector_;
  const Shape& shape_;
  const Vec3& from_;
  const Quat& orientation_;
  const Vec3 by_, turn_;
};

// No point of the body moves farther.
float way_length(const BodyStore& bodies, std::size_t body) {
  const Shift& shift = bodies.shift[body];
  return Vec3(shift.by).norm() + Vec3(shift.turn).norm() * bodies.reach[body];
}

}  // namespace

void stop_at_field(const Detector& detector, BodyStore& bodies, std::size_t body) {
  if (bodies.round[body]) return;
  const float length = way_length(bodies, body);
  if (!(length > 0.25F * bodies.width[body])) return;
  const Way way(detector, bodies, body);
  if (!way.over_field()) return;
  // Half a column at a time, so that none is passed unseen.
  const int strides = std::min(kMostStrides, 1 + static_cast<int>(length / detector.narrowest_half_top()));
  const float allowed = std::max(kDeepest, way.depth(0.0F));
  for (int i = 1; i <= strides; ++i) {
    const float end = static_cast<float>(i) / static_cast<float>(strides);
    if (way.depth(end) <= allowed) continue;
    const float share = way.last_above(allowed, static_cast<float>(i - 1) / static_cast<float>(strides), end);
    Shift& shift = bodies.shift[body];
    for (int axis = 0; axis < 3; ++axis) shift.by[axis] *= share, shift.turn[axis] *= share;
    return;
  }
}

}  // namespace smartsurf::world
