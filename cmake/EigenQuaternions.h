// For WebAssembly, where Eigen has no vectors: products of quaternions in the order of its vectors on x86-64.
#pragma once

#include <Eigen/Geometry>

namespace Eigen::internal {

template <class A, class B>
struct quat_product<Architecture::Target, A, B, float> {
  static Quaternion<float> run(const QuaternionBase<A>& a, const QuaternionBase<B>& b) {
    return {(a.w() * b.w() - a.x() * b.x()) - (a.z() * b.z() + a.y() * b.y()),
            (a.x() * b.w() - a.z() * b.y()) + (a.y() * b.z() + a.w() * b.x()),
            (a.y() * b.w() - a.x() * b.z()) + (a.z() * b.x() + a.w() * b.y()),
            (a.z() * b.w() - a.y() * b.x()) + (a.x() * b.y() + a.w() * b.z())};
  }
};

template <class A, class B>
struct quat_product<Architecture::Target, A, B, double> {
  static Quaternion<double> run(const QuaternionBase<A>& a, const QuaternionBase<B>& b) {
    return {(a.w() * b.w() - a.y() * b.y()) - (a.z() * b.z() + a.x() * b.x()),
            (a.w() * b.x() + a.y() * b.z()) - (a.z() * b.y() - a.x() * b.w()),
            (a.w() * b.y() + a.y() * b.w()) + (a.z() * b.x() - a.x() * b.z()),
            (a.w() * b.z() - a.y() * b.x()) + (a.z() * b.w() + a.x() * b.y())};
  }
};

}  // namespace Eigen::internal
