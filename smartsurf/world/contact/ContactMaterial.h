// How the materials of two surfaces in contact combine.
#pragma once

#include <algorithm>

#include "smartsurf/world/body/BodyStore.h"
#include "smartsurf/world/contact/Contact.h"

namespace smartsurf::world {

// The material of what body a of the manifold touches; `field`: that of the field and the ground.
inline const SurfaceMaterial& material_of_b(const BodyStore& bodies, const SurfaceMaterial& field,
                                            const Manifold& m, const Contact& c) {
  const std::int32_t other = other_body(m, c);
  return other >= 0 ? bodies.surface_material[other] : field;
}

// Coefficients of friction combine as their geometric mean.
inline float friction_of(const SurfaceMaterial& a, const SurfaceMaterial& b) {
  return a.friction_root * b.friction_root;
}
inline float rolling_friction_of(const SurfaceMaterial& a, const SurfaceMaterial& b) {
  return a.rolling_friction_root * b.rolling_friction_root;
}

inline float restitution_of(const SurfaceMaterial& a, const SurfaceMaterial& b) {
  return std::max(a.restitution, b.restitution);
}

}  // namespace smartsurf::world
