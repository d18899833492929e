// How an opaque surface reflects light: a diffuse part under microfacets (GGX), with the parameters of the
// looks. It never reflects more than it receives.
#pragma once

#include <Eigen/Core>

#include "smartsurf/view/model/StageModel.h"

namespace smartsurf::view {

// Two unit vectors that span a right-handed frame with the unit vector n.
struct ShadingFrame {
  explicit ShadingFrame(const Eigen::Vector3f& n);
  Eigen::Vector3f to_world(const Eigen::Vector3f& v) const { return v.x() * x + v.y() * y + v.z() * z; }
  Eigen::Vector3f to_local(const Eigen::Vector3f& v) const { return {v.dot(x), v.dot(y), v.dot(z)}; }
  Eigen::Vector3f x, y, z;
};

// Light goes from `in` to `out`, unit vectors away from the surface whose normal is z.
class Reflection {
 public:
  Reflection(const Eigen::Vector3f& albedo, const Finish& finish, const Eigen::Vector3f& out);

  struct Value {
    // Reflected share of the radiance, times the cosine of incidence; mirrored: the microfacets' part.
    Eigen::Vector3f all = Eigen::Vector3f::Zero(), mirrored = Eigen::Vector3f::Zero();
    float density = 0.0F;  // with which sample() chooses `in`, 1/sr
  };
  Value evaluate(const Eigen::Vector3f& in) const;
  // A direction `in`; below the surface where it is not reflected. u: uniform in the unit square; choice: in
  // [0, 1).
  Eigen::Vector3f sample(const Eigen::Vector2f& u, float choice) const;

 private:
  Eigen::Vector3f fresnel(float cosine) const;

  Eigen::Vector3f out_, head_on_, grazing_, diffuse_;
  float alpha_;         // of GGX
  float mirror_share_;  // of the samples
};

}  // namespace smartsurf::view
