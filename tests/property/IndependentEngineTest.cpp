// Compares final positions and velocities of small scenes with MuJoCo, an independent engine.
//
// The field has 8 × 8 columns without gaps. MuJoCo's contacts are compliant, so they are made as stiff as its
// time step allows.
#include <gtest/gtest.h>

#include "tests/property/PhysicsFixture.h"

#ifdef PEER_MUJOCO

#include <fmt/format.h>

#include "tests/peers/Mujoco.h"

using namespace physics_fixture;
using namespace smartsurf;

namespace {

constexpr int kCells = 8;
constexpr double kMujocoStep = 2e-4;

using Heights = std::function<double(int x, int y)>;

struct Comparison {
  std::vector<scene::ObjectSpec> objects;
  Heights height = [](int, int) { return 1.0; };
  double friction = 0.4;
};

struct FinalState {
  Eigen::Vector3d position, velocity, angular_velocity;
};

std::string to_mjcf(const scene::ObjectSpec& o) {
  const std::string geom = o.shape == scene::ShapeKind::kSphere
                               ? fmt::format("<geom type='sphere' size='{}' density='1'/>", o.radius)
                               : fmt::format("<geom type='box' size='{} {} {}' density='1'/>", o.size.x() / 2,
                                             o.size.y() / 2, o.size.z() / 2);
  const auto& q = o.orientation;
  return fmt::format("<body pos='{} {} {}' quat='{} {} {} {}'><freejoint/>{}</body>", o.position.x(),
                     o.position.y(), o.position.z(), q.w(), q.x(), q.y(), q.z(), geom);
}

std::string to_mjcf(const Comparison& c) {
  std::string out = fmt::format(
      "<mujoco><option timestep='{}' gravity='0 0 -9.81' cone='elliptic' impratio='10' solver='Newton'/>"
      "<default><geom friction='{} 0 0' condim='3' solref='0.001 1' solimp='0.99 0.999 0.001'/></default>"
      "<worldbody>",
      kMujocoStep, c.friction);
  for (int y = 0; y < kCells; ++y)
    for (int x = 0; x < kCells; ++x)
      out += fmt::format("<geom type='box' size='.5 .5 5' pos='{} {} {}'/>", x, y, c.height(x, y) - 5);
  for (const auto& o : c.objects) out += to_mjcf(o);
  return out + "</worldbody></mujoco>";
}

std::vector<FinalState> simulate_mujoco(const Comparison& c, double seconds) {
  peers::Mujoco peer(to_mjcf(c));
  for (std::size_t i = 0; i < c.objects.size(); ++i) {
    mjtNum* v = peer.velocity(static_cast<int>(i) + 1);
    for (int a = 0; a < 3; ++a) v[a] = c.objects[i].velocity[a];
    // The angular velocity of a free joint is in body axes.
    const Eigen::Vector3d spin = c.objects[i].orientation.conjugate() * c.objects[i].angular_velocity;
    for (int a = 0; a < 3; ++a) v[3 + a] = spin[a];
  }
  for (long i = 0; i < std::lround(seconds / kMujocoStep); ++i) peer.step();
  std::vector<FinalState> out;
  for (int i = 1; i <= static_cast<int>(c.objects.size()); ++i) {
    const mjtNum* v = peer.velocity(i);
    const mjtNum* q = peer.data().xquat + 4 * i;
    out.push_back({Eigen::Vector3d(peer.position(i)), Eigen::Vector3d(v),
                   Eigen::Quaterniond(q[0], q[1], q[2], q[3]) * Eigen::Vector3d(v + 3)});
  }
  return out;
}

std::vector<FinalState> simulate_smartsurf(const Comparison& c, double seconds) {
  PhysicsFixture fixture;
  fixture.scene.surface.rows = fixture.scene.surface.columns = kCells;
  fixture.scene.surface.pin.top_x = fixture.scene.surface.pin.top_y = 1.0;
  fixture.scene.materials[0].friction = c.friction;
  for (int r = 0; r < kCells; ++r)
    for (int x = 0; x < kCells; ++x)
      fixture.cells().set_target(0, r, x, static_cast<float>(c.height(x, kCells - 1 - r)));
  fixture.run(1.0);
  std::vector<scene::ObjectId> ids;
  for (const auto& o : c.objects) ids.push_back(fixture.add(o));
  fixture.run(seconds);
  std::vector<FinalState> out;
  for (const auto id : ids) {
    const auto s = fixture.world().state(id);
    out.push_back({s.position, s.velocity, s.angular_velocity});
  }
  return out;
}

struct Tolerances {
  double position, velocity, angular_velocity;
};

void expect_agreement(const Comparison& c, double seconds, const Tolerances& tolerances) {
  const auto theirs = simulate_mujoco(c, seconds), ours = simulate_smartsurf(c, seconds);
  for (std::size_t i = 0; i < ours.size(); ++i) {
    const FinalState &a = ours[i], &b = theirs[i];
    EXPECT_LT((a.position - b.position).norm(), tolerances.position)
        << i << ": " << a.position.transpose() << " | " << b.position.transpose();
    EXPECT_LT((a.velocity - b.velocity).norm(), tolerances.velocity)
        << i << ": " << a.velocity.transpose() << " | " << b.velocity.transpose();
    EXPECT_LT((a.angular_velocity - b.angular_velocity).norm(), tolerances.angular_velocity)
        << i << ": " << a.angular_velocity.transpose() << " | " << b.angular_velocity.transpose();
  }
}

}  // namespace

TEST(IndependentEngine, SpheresDroppedIntoPockets) {
  Comparison c;
  c.height = [](int x, int y) { return x % 4 == 1 && y % 4 == 2 ? 0.0 : 2.0; };
  c.objects = {sphere(0.8, {1.1, 2.05, 3.5}), sphere(0.6, {1.0, 5.9, 3.0})};
  expect_agreement(c, 3.0, {0.02, 0.05, 0.1});
}

TEST(IndependentEngine, ThrownSphereSlidesThenRolls) {
  Comparison c;
  auto o = sphere(0.9, {0.5, 3.2, 1.9});
  o.velocity = {4, 0.8, 0};
  c.objects = {o};
  expect_agreement(c, 1.2, {0.05, 0.05, 0.1});
}

TEST(IndependentEngine, SpinningBoxSlidesToRest) {
  Comparison c;
  auto o = box({1.4, 1.0, 0.6}, {1.0, 2.0, 1.3});
  o.velocity = {3.5, 2.0, 0};
  o.angular_velocity = {0, 0, 3};
  c.objects = {o};
  // MuJoCo's box bears on the corners of what it shares with each cell, so that its spin ends earlier, and
  // rocks slightly at the seams. Support.SpinningBoxSlidesInACurve has the uniform pressure.
  expect_agreement(c, 0.5, {0.06, 0.2, 1.4});
  expect_agreement(c, 2.0, {0.12, 0.01, 0.01});
}

TEST(IndependentEngine, SphereRollsOverStep) {
  Comparison c;
  c.height = [](int x, int) { return x < 4 ? 3.0 : 1.0; };
  auto o = sphere(0.7, {1.0, 3.3, 3.7});
  o.velocity = {2.5, 0, 0};
  o.angular_velocity = {0, 2.5 / 0.7, 0};
  c.objects = {o};
  expect_agreement(c, 1.5, {0.1, 0.1, 0.2});
}

TEST(IndependentEngine, SphereHitsSphereAndBox) {
  Comparison c;
  auto o = sphere(0.8, {0.6, 3.5, 1.8});
  o.velocity = {4, 0, 0};
  c.objects = {o, sphere(0.8, {3.0, 3.7, 1.8}), box({1, 2, 1}, {6.0, 3.6, 1.5})};
  expect_agreement(c, 0.6, {0.1, 0.2, 0.4});
}

TEST(IndependentEngine, BoxesDroppedFlatStackAndRest) {
  Comparison c;
  c.objects = {box({2, 2, 0.8}, {3, 3, 1.6}), box({1.2, 1.5, 0.6}, {3.2, 3.1, 2.6}),
               sphere(0.5, {6.0, 6.0, 3.0})};
  expect_agreement(c, 2.0, {0.02, 0.02, 0.02});
}

#else

TEST(IndependentEngine, MujocoIsNotInstalled) {
  GTEST_SKIP() << "MuJoCo is not installed; `scripts/setup --tests` installs it (libmujoco-dev)";
}

#endif
