#include "smartsurf/scene/Axes.h"

#include <gtest/gtest.h>

#include <random>

namespace smartsurf::scene {
namespace {

using Eigen::Matrix3d;
using Eigen::Vector3d;

class Axes : public testing::Test {
 protected:
  Vector3d vector() {
    std::normal_distribution<double> normal;
    return {normal(random_), normal(random_), normal(random_)};
  }

  std::mt19937_64 random_{7};
};

TEST_F(Axes, RotationsTakeOneDirectionToTheOtherTheShortWay) {
  for (int i = 0; i < 1000; ++i) {
    const Vector3d from = vector().normalized();
    // Every third pair is opposite, every second of these only to within about 10⁻⁸.
    const Vector3d to =
        i % 3 == 0 ? Vector3d(-from + (i % 2) * 1e-8 * vector()).normalized() : vector().normalized();
    const Eigen::Quaterniond q = rotation_between(from, to);
    EXPECT_NEAR(q.norm(), 1.0, 1e-12);
    EXPECT_LT((q * from - to).norm(), 1e-7);
    EXPECT_NEAR(q.vec().dot(from), 0.0, 1e-7);  // no turn about the direction itself
  }
}

TEST_F(Axes, PrincipalAxesMakeTheMatrixDiagonal) {
  for (int i = 0; i < 1000; ++i) {
    Matrix3d root;
    root << vector(), vector(), vector();
    const Matrix3d symmetric = root + root.transpose();
    const auto [moments, axes] = principal_axes(symmetric);
    EXPECT_LE(moments[0], moments[1]);
    EXPECT_LE(moments[1], moments[2]);
    EXPECT_TRUE((axes.transpose() * axes).isIdentity(1e-12));
    EXPECT_TRUE((axes * moments.asDiagonal() * axes.transpose()).isApprox(symmetric, 1e-12));
  }
}

}  // namespace
}  // namespace smartsurf::scene
