// Test fixture: a shape with a pose, for narrow-phase tests.
#pragma once

#include <algorithm>
#include <limits>
#include <random>
#include <vector>

#include "smartsurf/scene/SceneSpec.h"
#include "smartsurf/world/narrowphase/ConvexPair.h"

namespace smartsurf::world {

struct PlacedBody {
  Shape shape;
  Vec3 centre;
  Mat3 axes;

  PlacedBody(const scene::ObjectSpec& of, const Vec3& at, const Quat& rotation)
      : shape(make_shape(of)), centre(at), axes(rotation.normalized().toRotationMatrix()) {}
  PlacedShape placed() const { return {shape, centre, axes}; }
};

// The deepest contact's; infinite without contacts.
inline float min_separation(const std::vector<Contact>& contacts) {
  float separation = std::numeric_limits<float>::infinity();
  for (const Contact& c : contacts) separation = std::min(separation, c.separation);
  return separation;
}

// Not normalized.
inline Quat random_rotation(std::mt19937& random) {
  std::uniform_real_distribution<float> u(-1, 1);
  const float w = u(random), x = u(random), y = u(random), z = u(random);
  return {w, x, y, z};
}

}  // namespace smartsurf::world
