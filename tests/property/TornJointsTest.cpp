// Bodies that a teleport places away from their joints, and joints that start beyond their limits, drawn from
// a seed.
#include <gtest/gtest.h>

#include <Eigen/Geometry>
#include <algorithm>
#include <array>
#include <cmath>
#include <optional>
#include <random>
#include <string>
#include <vector>

#include "tests/property/JointFixture.h"

using namespace physics_fixture;

namespace {

class TornJoints : public testing::TestWithParam<double> {};
INSTANTIATE_TEST_SUITE_P(Steps, TornJoints, testing::Values(1.0 / 60, 1.0 / 120, 1.0 / 240, 1.0 / 960));

// Boxes of a tree with joints of all kinds, at rest on the table, or in the air without gravity.
struct TornTree : JointFixture {
  struct Member {
    Vector3d size;
    double mass;
  };
  struct Anchor {
    ObjectId a, b;
    Vector3d in_a, in_b;
  };
  std::vector<Member> members;
  std::vector<Anchor> anchors;  // of the joints that hold a point
  std::mt19937& random;

  TornTree(double dt, std::mt19937& generator, int count, bool on_table)
      : JointFixture(dt), random(generator) {
    scene.world.iterations = std::array{4, 10, 40}[random() % 3];
    scene.world.sleep = false;
    if (!on_table) scene.world.gravity = Vector3d::Zero();
    Vector3d at(10, 15, 0);
    for (int i = 0; i < count; ++i) {
      const Vector3d size(between(0.6, 1.4), between(0.6, 1.4), between(0.6, 1.4));
      auto spec = box(size, {at.x(), at.y(), on_table ? 0.5 * size.z() : 50.0});
      spec.mass = std::exp(between(-1.5, 1.5));
      members.push_back({size, *spec.mass});
      add(spec);
      if (i > 0) join_to_earlier(static_cast<ObjectId>(i), spec.position);
      at += Vector3d(1.8, between(-0.3, 0.3), 0);
    }
  }
  double between(double low, double high) { return std::uniform_real_distribution(low, high)(random); }
  void join_to_earlier(ObjectId a, const Vector3d& position) {
    const auto b = static_cast<ObjectId>(random() % static_cast<unsigned>(a));
    const Vector3d skew(between(-1, 1), between(-1, 1), 1);
    JointSpec joint{.kind = std::array{JointKind::kHinge, JointKind::kSlider, JointKind::kBall,
                                       JointKind::kFixed}[random() % 4],
                    .a = a,
                    .b = b,
                    .anchor = position - Vector3d(between(0.5, 1.0), between(-0.5, 0.5), 0),
                    .axis = std::array{Vector3d(0, 0, 1), Vector3d(0, 1, 0), skew}[random() % 3]};
    if (joint.has_coordinate() && random() % 2 == 0) joint.limits = {{-0.3, between(0.0, 0.4)}};
    if (joint.has_coordinate() && random() % 3 == 0) joint.friction = between(0, 3);
    join(joint);
    if (joint.kind == JointKind::kSlider) return;
    anchors.push_back(
        {a, b, joint.anchor - world().state(a).position, joint.anchor - world().state(b).position});
  }
  // Moves one of the bodies, turns it, or both.
  void tear(bool on_table) {
    const auto id = static_cast<ObjectId>(random() % members.size());
    const auto how = random() % 3;
    smartsurf::scene::ObjectStateUpdate update;
    if (how != 1)
      update.position = world().state(id).position +
                        Vector3d(between(-4, 4), between(-4, 4), on_table ? 0.0 : between(-3, 3));
    const double angle = random() % 3 == 0 ? M_PI : between(-3.1, 3.1);
    if (how != 0)
      update.orientation = Eigen::Quaterniond(
          Eigen::AngleAxisd(angle, how == 1 && random() % 2 == 0 ? Vector3d::UnitX() : Vector3d::UnitZ()));
    world().set_state(id, update);
  }
  double greatest_speed() {
    double greatest = 0;
    for (std::size_t i = 0; i < members.size(); ++i) {
      const auto s = world().state(static_cast<ObjectId>(i));
      greatest =
          std::max({greatest, s.velocity.norm(), 0.5 * members[i].size.norm() * s.angular_velocity.norm()});
    }
    return greatest;
  }
  double greatest_gap() {
    double greatest = 0;
    for (const Anchor& j : anchors) {
      const auto a = world().state(j.a), b = world().state(j.b);
      greatest = std::max(greatest,
                          (a.position + a.orientation * j.in_a - b.position - b.orientation * j.in_b).norm());
    }
    return greatest;
  }
  // About the middle of the surface, and the energy of motion.
  std::pair<Vector3d, double> angular_momentum_and_energy() {
    Vector3d momentum(0, 0, 0);
    double energy = 0;
    for (std::size_t i = 0; i < members.size(); ++i) {
      const auto& [size, mass] = members[i];
      const Vector3d s2 = size.cwiseAbs2();
      const Vector3d moments = mass / 12.0 * Vector3d(s2.y() + s2.z(), s2.x() + s2.z(), s2.x() + s2.y());
      const auto state = world().state(static_cast<ObjectId>(i));
      const Vector3d spin = state.orientation.conjugate() * state.angular_velocity;
      momentum += (state.position - Vector3d(15, 15, 50)).cross(mass * state.velocity) +
                  state.orientation * Vector3d(moments.cwiseProduct(spin));
      energy += 0.5 * (mass * state.velocity.squaredNorm() + moments.dot(spin.cwiseAbs2()));
    }
    return {momentum, energy};
  }
};

}  // namespace

// Where they meet each other or the table on the way back, contacts give them speeds of the correction.
TEST_P(TornJoints, TreesComeTogetherSlowly) {
  const bool is_fine = GetParam() < 0.002;
  for (const bool on_table : {false, true}) {
    const unsigned draws = is_fine ? 3 : 16;
    unsigned together = 0;
    for (unsigned seed = 0; seed < draws; ++seed) {
      SCOPED_TRACE(testing::Message() << (on_table ? "on the table" : "in the air") << ", seed " << seed);
      std::mt19937 random(seed);
      TornTree tree(GetParam(), random, 2 + static_cast<int>(random() % 3), on_table);
      tree.run(0.1);
      tree.tear(on_table);
      double greatest = 0;
      tree.run(2.0, [&] { greatest = std::max(greatest, tree.greatest_speed()); });
      EXPECT_LT(greatest, on_bullet() ? 16.0 : 8.0);
      if (on_table && !on_bullet()) {
        EXPECT_LT(tree.greatest_speed(), 3.0);
      }
      together += tree.greatest_gap() < 0.01 ? 1 : 0;
    }
    EXPECT_GE(4 * together, 3 * draws);
  }
}

// The correction leaves no speed: then they move as if they had never been apart.
TEST_P(TornJoints, PairsKeepTheirMomentum) {
  if (on_bullet()) GTEST_SKIP() << "what Bullet corrects moves on";
  for (unsigned seed = 0; seed < (GetParam() < 0.002 ? 6 : 24); ++seed) {
    SCOPED_TRACE(seed);
    std::mt19937 random(seed);
    TornTree pair(GetParam(), random, 2, false);
    pair.run(0.1);
    pair.tear(false);
    pair.run(2.0);
    EXPECT_LT(pair.angular_momentum_and_energy().second, 1e-6);
    EXPECT_LT(pair.greatest_gap(), 0.01);
    smartsurf::scene::ObjectStateUpdate spin;
    spin.angular_velocity = {1, -1, 2};
    pair.world().set_state(1, spin);
    pair.run(GetParam());  // the joint takes what it does not allow
    const auto [momentum, energy] = pair.angular_momentum_and_energy();
    pair.run(1.0);
    const auto [momentum_after, energy_after] = pair.angular_momentum_and_energy();
    EXPECT_LT((momentum_after - momentum).norm(), 2e-3 * momentum.norm() + 1e-5);
    EXPECT_LT(energy_after, 1.01 * energy);
  }
}

TEST_P(TornJoints, StartBeyondTheirLimits) {
  for (const JointKind kind : {JointKind::kHinge, JointKind::kSlider})
    for (const double sign : {-1.0, 1.0}) {
      SCOPED_TRACE(testing::Message() << static_cast<int>(kind) << ' ' << sign);
      JointFixture fixture(GetParam());
      fixture.scene.world.gravity = Vector3d::Zero();
      const ObjectId a = fixture.add(box({1, 1, 1}, {15, 15, 50}));
      const ObjectId b = fixture.add(box({1, 1, 1}, {16.5, 15, 50}));
      const JointId joint = fixture.join({.kind = kind,
                                          .a = a,
                                          .b = b,
                                          .anchor = {15.75, 15, 50},
                                          .axis = {0, sign, 0},
                                          .limits = {{1.0, 2.0}}});
      double greatest = 0;
      fixture.run(2.0, [&] { greatest = std::max(greatest, std::abs(fixture.speed(joint))); });
      EXPECT_LT(greatest, on_bullet() ? 7.0 : 0.01);
      EXPECT_GT(fixture.coordinate(joint), 0.99);
      EXPECT_LT(fixture.coordinate(joint), on_bullet() ? 2.01 : 1.01);
    }
}
