// Against the dense solution of the same equations, for graphs drawn from a seed: trees, and trees with
// loops.
#include "smartsurf/world/solver/JointEquations.h"

#include <gtest/gtest.h>

#include <Eigen/Dense>
#include <algorithm>
#include <random>
#include <string>
#include <vector>

using smartsurf::world::JointEquations;
using Vector6 = JointEquations::Vector6;
using Matrix6 = JointEquations::Matrix6;

namespace {

struct System {
  int bodies;
  std::vector<std::array<std::int32_t, 2>> joints;
};

// Joints connect each body with an earlier one or with what is fixed; `loops` more connect any two.
System random_system(std::mt19937& random, int bodies, int loops) {
  System s{bodies, {}};
  auto below = [&](int n) { return static_cast<std::int32_t>(random() % static_cast<unsigned>(n)); };
  for (std::int32_t i = 0; i < bodies; ++i) {
    const std::int32_t parent = below(i + 1) - 1;
    s.joints.push_back({i, parent < 0 ? JointEquations::kFixed : parent});
    if (below(2) == 0) std::swap(s.joints.back()[0], s.joints.back()[1]);
  }
  for (int k = 0; k < loops; ++k) {
    const std::int32_t a = below(bodies), b = below(bodies);
    s.joints.push_back({a, a == b ? JointEquations::kFixed : b});
  }
  std::shuffle(s.joints.begin(), s.joints.end(), random);
  return s;
}

Matrix6 random_matrix(std::mt19937& random) {
  std::normal_distribution<double> normal;
  return Matrix6::NullaryExpr([&] { return normal(random); });
}

void expect_solution_of(const System& s, std::mt19937& random) {
  const int n = 6 * s.bodies, m = 6 * static_cast<int>(s.joints.size());
  Eigen::MatrixXd matrix = Eigen::MatrixXd::Zero(n + m, n + m);
  Eigen::VectorXd right = Eigen::VectorXd::Zero(n + m);
  JointEquations equations;
  equations.set_structure(s.bodies, s.joints);
  for (std::size_t t = 0; t < equations.trees().size(); ++t) equations.begin(static_cast<std::int32_t>(t));
  for (int i = 0; i < s.bodies; ++i) {
    const Matrix6 a = random_matrix(random), mass = a * a.transpose() + Matrix6::Identity();
    equations.mass(i) = matrix.block<6, 6>(6 * i, 6 * i) = mass;
    equations.of_body(i).setZero();
  }
  for (std::size_t k = 0; k < s.joints.size(); ++k) {
    const auto joint = static_cast<std::int32_t>(k);
    const int row = n + 6 * joint;
    const Matrix6 compliance = 1e-3 * Matrix6::Identity();
    equations.compliance(joint) = compliance;
    matrix.block<6, 6>(row, row) = compliance;
    for (const int side : {0, 1}) {
      const std::int32_t body = s.joints[k][static_cast<std::size_t>(side)];
      const Matrix6 jacobian = random_matrix(random);
      equations.set_jacobian(joint, side, jacobian);
      if (body == JointEquations::kFixed) continue;
      matrix.block<6, 6>(row, 6 * body) = jacobian;
      matrix.block<6, 6>(6 * body, row) = -jacobian.transpose();
    }
    const Vector6 wanted = random_matrix(random).col(0);
    equations.of_joint(joint) = right.segment<6>(row) = wanted;
  }
  for (std::size_t t = 0; t < equations.trees().size(); ++t) {
    equations.factor(static_cast<std::int32_t>(t));
    equations.solve(static_cast<std::int32_t>(t));
  }
  const Eigen::VectorXd expected = matrix.fullPivLu().solve(right);
  const double tolerance = 1e-9 * (1.0 + expected.cwiseAbs().maxCoeff());
  for (int i = 0; i < s.bodies; ++i)
    EXPECT_LT((equations.of_body(i) - expected.segment<6>(6 * i)).cwiseAbs().maxCoeff(), tolerance)
        << "body " << i;
  for (std::size_t k = 0; k < s.joints.size(); ++k)
    EXPECT_LT(
        (equations.of_joint(static_cast<std::int32_t>(k)) - expected.segment<6>(n + 6 * static_cast<int>(k)))
            .cwiseAbs()
            .maxCoeff(),
        tolerance)
        << "joint " << k;
}

}  // namespace

TEST(JointEquations, HaveTheDenseSolution) {
  for (unsigned seed = 0; seed < 60; ++seed) {
    SCOPED_TRACE("seed " + std::to_string(seed));
    std::mt19937 random(seed);
    const int bodies = 1 + static_cast<int>(random() % 12);
    expect_solution_of(random_system(random, bodies, static_cast<int>(seed % 4)), random);
  }
}

// A chain whose ends are both fixed is a loop, too.
TEST(JointEquations, FindTreesAndLoops) {
  constexpr std::int32_t kFixed = JointEquations::kFixed;
  const std::vector<std::array<std::int32_t, 2>> joints = {
      {3, 1}, {0, kFixed}, {1, 4}, {4, 3}, {2, kFixed}, {5, 6}, {6, kFixed}, {5, kFixed}};
  JointEquations equations;
  equations.set_structure(7, joints);
  const auto trees = equations.trees();
  ASSERT_EQ(trees.size(), 4U);
  const std::vector<int> bodies = {1, 3, 1, 2}, joint_counts = {1, 3, 1, 3};
  const std::vector<bool> loops = {false, true, false, true};
  for (std::size_t t = 0; t < 4; ++t) {
    EXPECT_EQ(trees[t].body_count, bodies[t]);
    EXPECT_EQ(trees[t].joint_count, joint_counts[t]);
    EXPECT_EQ(trees[t].has_loop, loops[t]);
  }
}
