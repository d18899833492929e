// Vectors in the precision of the renderers.
#pragma once

#include <Eigen/Core>
#include <array>

namespace smartsurf::view {

template <class Vector>
std::array<float, 3> to_float3(const Eigen::MatrixBase<Vector>& v) {
  const Eigen::Vector3f f = v.template cast<float>();
  return {f.x(), f.y(), f.z()};
}

}  // namespace smartsurf::view
