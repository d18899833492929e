// Random scenes of each situation that docs/truth.md lists, on our engine and on Bullet with five times the
// iterations: what both can be asked for without chaos is the same. SITUATION_SEEDS: scenes of each,
// otherwise one.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstdlib>
#include <functional>
#include <numeric>
#include <random>
#include <string>
#include <vector>

#include "smartsurf/world/bullet/EngineFactory.h"
#include "tests/property/ColumnDepth.h"
#include "tests/property/PhysicsFixture.h"

using namespace physics_fixture;
using namespace smartsurf;
using Eigen::Vector3d;

namespace {

constexpr int kSide = 14;
constexpr double kMiddle = 6.5;  // of the table, u

// A result of a scene, and by how much it may differ between the engines.
struct Value {
  std::string name;
  double value, tolerance;
};
using Values = std::vector<Value>;

// Draws a scene from a seed and runs it.
class Draw {
 public:
  Draw(unsigned seed_of_scene, const char* engine) : seed(seed_of_scene), random(seed) {
    fixture.scene.surface.rows = fixture.scene.surface.columns = kSide;
    fixture.scene.world.engine = engine;
    constexpr double kSteps[] = {60, 120, 240};
    fixture.scene.world.dt_s = 1.0 / kSteps[seed % 3];
    if (engine == std::string("bullet")) fixture.scene.world.iterations *= 5;
  }
  double operator()(double low, double high) {
    return std::uniform_real_distribution<double>(low, high)(random);
  }
  Vector3d draw_size(double low, double high) {
    return {(*this)(low, high), (*this)(low, high), (*this)(low, high)};
  }

  // How much the cells bear on average, mass·u/s².
  double mean_load(double seconds) {
    double impulse = 0.0;
    fixture.run(seconds, [&] {
      const auto& loads = fixture.cells().field().impulse;
      impulse += std::accumulate(loads.begin(), loads.end(), 0.0);
    });
    return impulse / seconds;
  }

  PhysicsFixture fixture;
  unsigned seed;
  std::mt19937 random;
};

// Where an object lies, and how it leans.
void add_pose(Values& out, PhysicsFixture& f, scene::ObjectId id, double tolerance) {
  const Eigen::Vector3f p = f.position(id);
  const auto& q = f.snapshot().orientation[id];
  for (int i = 0; i < 3; ++i)
    out.push_back({std::string("position ") + "xyz"[i], static_cast<double>(p[i]), tolerance});
  out.push_back({"cosine of the lean", 1 - 2 * static_cast<double>(q[0] * q[0] + q[1] * q[1]), tolerance});
}

Values level(Draw& draw) {
  auto o = box(draw.draw_size(1, 4), {kMiddle + draw(-1, 1), kMiddle + draw(-1, 1), 0});
  o.mass = draw(1, 50);
  o.position.z() = 0.5 * o.size.z() + draw(0, 0.2);
  const auto id = draw.fixture.add(o);
  draw.fixture.run(0.8);
  Values v{{"load", draw.mean_load(0.2), 0.005 * *o.mass * kGravity}};
  add_pose(v, draw.fixture, id, 0.01);
  return v;
}

Values uneven(Draw& draw) {
  std::vector<float> heights(kSide * kSide);
  for (float& h : heights) h = static_cast<float>(1 + draw(-0.05, 0.05));
  draw.fixture.cells().set_targets(0, heights);
  draw.fixture.run(1.0);
  auto o = box({draw(3, 5), draw(3, 5), draw(0.5, 1)}, {kMiddle, kMiddle, 0});
  o.mass = draw(5, 50);
  o.position.z() = 1.06 + 0.5 * o.size.z();
  const auto id = draw.fixture.add(o);
  draw.fixture.run(6.0);
  Values v{{"load", draw.mean_load(1.0), 0.01 * *o.mass * kGravity}};
  add_pose(v, draw.fixture, id, 0.03);
  return v;
}

Values sloping(Draw& draw) {
  const double angle = draw(0.5, 0.7);  // steeper than the friction of 0.5 holds
  draw.fixture.scene.world.gravity = {kGravity * std::sin(angle), 0, -kGravity * std::cos(angle)};
  auto o = box({draw(1, 2), draw(1, 2), draw(0.3, 0.6)}, {2, kMiddle, 0});
  o.position.z() = 0.5 * o.size.z();
  const auto id = draw.fixture.add(o);
  draw.fixture.run(1.0);
  const double right = 0.5 * kGravity * (std::sin(angle) - 0.5 * std::cos(angle));
  return {{"distance", static_cast<double>(draw.fixture.position(id).x()) - 2, 0.03 * right + 0.02}};
}

// A stack of boxes whose middles are over each other; `heaviest`: the greatest ratio of two masses.
Values stack(Draw& draw, double heaviest) {
  Values v;
  double top = 0;
  std::vector<scene::ObjectId> ids;
  const int count = 2 + static_cast<int>(draw(0, 3));
  for (int i = 0; i < count; ++i) {
    auto o = box({draw(1.5, 3), draw(1.5, 3), draw(0.5, 1.5)},
                 {kMiddle + draw(-0.3, 0.3), kMiddle + draw(-0.3, 0.3), 0});
    o.position.z() = top + 0.5 * o.size.z();
    o.mass = std::pow(heaviest, draw(0, 1));
    top += o.size.z();
    ids.push_back(draw.fixture.add(o));
  }
  draw.fixture.run(3.0);
  for (const auto id : ids) add_pose(v, draw.fixture, id, 0.02);
  return v;
}
Values between_bodies(Draw& draw) { return stack(draw, 1.0); }
Values mass_ratios(Draw& draw) { return stack(draw, 8.0); }
Values iterations(Draw& draw) {
  constexpr int kIterations[] = {4, 10, 25, 80};
  int& n = draw.fixture.scene.world.iterations;
  n = n / 10 * kIterations[draw.seed % 4];  // of the first scene 10: 80 take a minute
  return stack(draw, 2.0);
}

Values chains(Draw& draw) {
  const int links = 2 + static_cast<int>(draw(0, 4));
  const double thick = draw(0.1, 0.3), angle = draw(0.1, 0.4);
  const Vector3d pivot{kMiddle, kMiddle, 40}, along(std::sin(angle), 0, -std::cos(angle));
  std::vector<scene::ObjectId> ids;
  for (int i = 0; i < links; ++i) {
    auto o = box({thick, thick, 1}, pivot + (i + 0.5) * along);
    o.mass = 1.0;
    o.orientation = Eigen::Quaterniond(Eigen::AngleAxisd(-angle, Vector3d::UnitY()));
    ids.push_back(draw.fixture.add(o));
    draw.fixture.world().add_joint({.kind = scene::JointKind::kHinge,
                                    .a = ids.back(),
                                    .b = i == 0 ? std::nullopt : std::optional(ids[ids.size() - 2]),
                                    .anchor = pivot + i * along,
                                    .axis = Vector3d::UnitY()});
  }
  draw.fixture.run(0.6);
  Values v;
  for (const auto id : ids) {
    const Eigen::Vector3f p = draw.fixture.position(id);
    v.push_back({"east", static_cast<double>(p.x()), 0.05});
    v.push_back({"out of the plane", static_cast<double>(p.y()), 0.005});
    v.push_back({"height", static_cast<double>(p.z()), 0.05});
  }
  return v;
}

Values seams(Draw& draw) {
  double x = 0;
  while (x < 12) {
    const double length = draw(0.8, 3);
    auto o = box({length, 4, 1}, {x + 0.5 * length, kMiddle, 4.5});
    o.fixed = true;
    draw.fixture.add(o);
    x += length;
  }
  const double radius = draw(0.4, 0.8);
  auto ball = sphere(radius, {1.5, kMiddle, 5 + radius});
  ball.velocity = {draw(2, 5), 0, 0};
  ball.angular_velocity = {0, ball.velocity.x() / radius, 0};
  const auto id = draw.fixture.add(ball);
  draw.fixture.run(1.0);
  const Eigen::Vector3f p = draw.fixture.position(id);
  return {{"east", static_cast<double>(p.x()), 0.05}, {"height", static_cast<double>(p.z()), 0.01}};
}

Values speed(Draw& draw) {
  auto wall = box({draw(0.5, 1), 6, 4}, {8, kMiddle, 4});
  wall.fixed = true;
  draw.fixture.add(wall);
  auto ball = sphere(draw(0.3, 0.6), {4, kMiddle, 4});
  ball.velocity = {draw(10, 25), 0, 0};
  const auto id = draw.fixture.add(ball);
  draw.fixture.run(0.6);
  return {{"stays west of the wall", draw.fixture.position(id).x() < 8 ? 1.0 : 0.0, 0.1}};
}

Values jams(Draw& draw) {
  draw.fixture.scene.surface.border_height = 6.0;
  draw.fixture.scene.surface.pin.max_speed = 4.0;
  std::vector<scene::ObjectSpec> specs;
  std::vector<scene::ObjectId> ids;
  for (int i = 0; i < 8; ++i) {
    const Vector3d at(4 + 1.7 * (i % 4), 5 + 3 * (i / 4), 1.2);
    specs.push_back(i % 2 == 0 ? sphere(draw(0.5, 0.8), at)
                               : box({draw(0.8, 1.5), draw(0.8, 1.5), draw(0.6, 1.2)}, at));
    ids.push_back(draw.fixture.add(specs.back()));
  }
  double deepest = 0.0;
  std::vector<float> targets(kSide * kSide, 0.0F);
  const int every = std::max(1, static_cast<int>(std::lround(0.05 / draw.fixture.scene.world.dt_s)));
  for (int k = 0, step = 0; k < 8; ++k) {
    for (int i = 0; i < kSide * kSide; ++i) {
      const double distance = std::hypot(i % kSide - kMiddle, i / kSide - kMiddle);
      targets[static_cast<std::size_t>(i)] = distance > 2.5 && distance < 4.5 && k % 2 == 0 ? 2.0F : 0.0F;
    }
    draw.fixture.cells().set_targets(0, targets);
    draw.fixture.run(0.5, [&] {
      if (++step % every != 0) return;
      const scene::Snapshot& s = draw.fixture.snapshot();
      for (std::size_t i = 0; i < specs.size(); ++i)
        deepest = std::max(deepest, depth_in_columns(draw.fixture.cells().field(), specs[i], s, i));
    });
  }
  // If both engines are right to 0.05 u at 1/240 s, neither is deeper than this: pins rise by 4 u/s in a
  // step.
  const double bound = 0.04 + 4.0 * draw.fixture.scene.world.dt_s;
  return {{"stays out of the pins", std::max(0.0, deepest - bound), 0.01}};
}

struct Situation {
  const char* name;
  Values (*run)(Draw&);
};
constexpr Situation kSituations[] = {{"Level", level},
                                     {"Uneven", uneven},
                                     {"Sloping", sloping},
                                     {"BetweenBodies", between_bodies},
                                     {"Chains", chains},
                                     {"Seams", seams},
                                     {"Speed", speed},
                                     {"Jams", jams},
                                     {"MassRatios", mass_ratios},
                                     {"Iterations", iterations}};

class Situations : public testing::TestWithParam<Situation> {};

TEST_P(Situations, AreAsOnBulletWithFiveTimesTheIterations) {
  if (!world::has_bullet()) GTEST_SKIP() << "this build has no Bullet";
  const char* seeds = std::getenv("SITUATION_SEEDS");
  for (unsigned seed = 1; seed <= static_cast<unsigned>(seeds ? std::atoi(seeds) : 1); ++seed) {
    Draw ours(seed, "native"), theirs(seed, "bullet");
    const Values here = GetParam().run(ours), there = GetParam().run(theirs);
    ASSERT_EQ(here.size(), there.size());
    for (std::size_t i = 0; i < here.size(); ++i)
      EXPECT_NEAR(here[i].value, there[i].value, here[i].tolerance) << here[i].name << ", seed " << seed;
  }
}
INSTANTIATE_TEST_SUITE_P(Drawn, Situations, testing::ValuesIn(kSituations),
                         [](const auto& situation) { return std::string(situation.param.name); });

}  // namespace
