// Impacts against closed forms, over time steps from 1/60 to 1/960 s: friction on the rebound, chains of
// balls, flat and off-centre hits, energy over many bounces.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <random>
#include <vector>

#include "tests/property/PhysicsFixture.h"

using namespace physics_fixture;
using smartsurf::scene::ObjectId;

namespace {

constexpr double kSteps_s[] = {1.0 / 60, 1.0 / 240, 1.0 / 960};

struct ImpactFixture : PhysicsFixture {
  ImpactFixture(double dt_s, double restitution, double friction) {
    scene.world.dt_s = dt_s;
    scene.materials[0].restitution = restitution;
    scene.materials[0].friction = friction;
  }
  bool is_bullet() const { return scene.world.engine == "bullet"; }
  // Runs until the body moves upwards.
  void run_until_rebound(ObjectId id, double max_s = 2.0) {
    for (double t_s = 0; t_s < max_s && velocity(id).z() <= 0; t_s += scene.world.dt_s) run(scene.world.dt_s);
  }
};

// Balls of radius 1 in a row, without gravity; a moving one has a free path before it.
struct Row {
  std::vector<double> mass, speed;
  double gap;

  double energy(const std::vector<double>& speeds) const {
    double sum = 0;
    for (std::size_t i = 0; i < mass.size(); ++i) sum += 0.5 * mass[i] * speeds[i] * speeds[i];
    return sum;
  }
  // Elastic collisions of three balls, one after the other. `least_closing`: the least speed at which two
  // meet.
  std::vector<double> collide_in_order(double& least_closing) const {
    std::vector<double> v = speed;
    const auto hit = [&](std::size_t a) {
      const double closing = v[a] - v[a + 1],
                   impulse = 2 * closing * mass[a] * mass[a + 1] / (mass[a] + mass[a + 1]);
      v[a] -= impulse / mass[a], v[a + 1] += impulse / mass[a + 1];
      least_closing = std::min(least_closing, closing);
    };
    for (std::size_t a = 0; v[a] > v[a + 1]; a = 1 - a) hit(a);
    return v;
  }
  std::vector<double> simulate(double dt_s, double e) const {
    ImpactFixture fixture(dt_s, e, 0.0);
    fixture.scene.world.gravity = {0, 0, 0};
    std::vector<ObjectId> balls;
    for (std::size_t i = 0; i < mass.size(); ++i) {
      auto ball = sphere(1.0, {5.0 + (2.0 + gap) * static_cast<double>(i), 15, 20});
      ball.mass = mass[i];
      ball.velocity = {speed[i], 0, 0};
      if (speed[i] > 0) ball.position.x() -= 0.3;
      balls.push_back(fixture.add(ball));
    }
    fixture.run(0.5);
    std::vector<double> speeds;
    for (const ObjectId id : balls) speeds.push_back(fixture.velocity(id).x());
    return speeds;
  }
};

// Speeds of equal balls in a row after all collisions, each by pairs.
std::vector<double> collide_by_pairs(std::vector<double> speeds, double e) {
  for (bool any = true; any;) {
    any = false;
    for (std::size_t i = 0; i + 1 < speeds.size(); ++i) {
      const double a = speeds[i], b = speeds[i + 1];
      if (a - b < 1e-9) continue;
      speeds[i] = 0.5 * ((1 - e) * a + (1 + e) * b);
      speeds[i + 1] = 0.5 * ((1 + e) * a + (1 - e) * b);
      any = true;
    }
  }
  return speeds;
}

}  // namespace

TEST(Impact, BlowTravelsThroughRowOfBalls) {
  if (ImpactFixture(1.0 / 60, 1, 0).is_bullet())
    GTEST_SKIP() << "Bullet solves the impacts of touching bodies as one: four balls leave together";
  for (const double dt_s : kSteps_s)
    for (const double gap : {0.0, 1e-3, 0.1})
      for (const double e : {1.0, gap > 0.01 ? 1.0 : 0.8, gap > 0.01 ? 1.0 : 0.5})
        // Wide gaps change the order of the collisions, and with it the result.
        for (const auto& speeds : {std::vector<double>{4, 0, 0, 0, 0}, {4, 4, 0, 0, 0}, {4, 4, 4, 0, 0}}) {
          const Row row{std::vector<double>(speeds.size(), 1.0), speeds, gap};
          const auto actual = row.simulate(dt_s, e), predicted = collide_by_pairs(speeds, e);
          for (std::size_t i = 0; i < speeds.size(); ++i)
            EXPECT_NEAR(actual[i], predicted[i], e == 1.0 ? 0.01 : 0.12)
                << "ball " << i << ", e " << e << ", gap " << gap << ", " << speeds[1] << ", 1/" << 1 / dt_s;
        }
}

// A light ball goes back and forth between two heavy ones up to a hundred times within a step.
TEST(Impact, LightBallBetweenHeavyOnesKeepsEnergy) {
  if (ImpactFixture(1.0 / 60, 1, 0).is_bullet()) GTEST_SKIP() << "Bullet loses energy where balls touch";
  std::mt19937 random(3);
  const auto draw = [&random](double low, double high) {
    return low * std::pow(high / low, static_cast<double>(random()) / 0x1p32);
  };
  for (const double dt_s : kSteps_s)
    for (int i = 0; i < 30; ++i) {
      const double heavy = draw(0.5, 5);
      const Row row{
          {heavy, heavy * draw(0.002, 0.1), heavy * draw(0.3, 2)}, {5, 0, 0}, i % 2 == 0 ? 0.0 : 0.01};
      double least_closing = 1e9;
      const auto actual = row.simulate(dt_s, 1.0), predicted = row.collide_in_order(least_closing);
      EXPECT_NEAR(row.energy(actual), row.energy(row.speed), 0.005 * row.energy(row.speed))
          << i << ", 1/" << 1 / dt_s;
      if (least_closing < 0.3) continue;  // slower hits are without restitution
      for (std::size_t k = 0; k < 3; ++k)
        EXPECT_NEAR(actual[k], predicted[k], 0.02) << i << ", 1/" << 1 / dt_s;
    }
}

TEST(Impact, LongRowsOfUnequalBallsKeepEnergy) {
  if (ImpactFixture(1.0 / 60, 1, 0).is_bullet()) GTEST_SKIP() << "Bullet loses energy where balls touch";
  std::mt19937 random(4);
  for (const double dt_s : kSteps_s)
    for (const double gap : {0.0, 0.01, 0.1}) {
      Row row{{5}, {5, 0, 0, 0, 0, 0}, gap};
      for (int i = 1; i < 6; ++i)
        row.mass.push_back(std::pow(30.0, 2 * static_cast<double>(random()) / 0x1p32 - 1));
      const double start = row.energy(row.speed);
      EXPECT_NEAR(row.energy(row.simulate(dt_s, 1.0)), start, 0.01 * start) << gap << ", 1/" << 1 / dt_s;
    }
}

TEST(Impact, CueBallPartsTwoBallsSymmetrically) {
  // Three balls of equal mass, two of them touching: with e = 1 each of the two leaves at 2√3/5 of the speed
  // along its line of centres, the cue ball at −1/5.
  for (const double dt_s : kSteps_s) {
    ImpactFixture fixture(dt_s, 1.0, 0.0);
    fixture.scene.world.gravity = {0, 0, 0};
    auto cue = sphere(1.0, {8, 15, 20});
    cue.velocity = {5, 0, 0};
    const auto first = fixture.add(cue);
    const auto left = fixture.add(sphere(1.0, {12, 16, 20})), right = fixture.add(sphere(1.0, {12, 14, 20}));
    fixture.run(1.0);
    const double root = std::sqrt(3.0);
    EXPECT_LT((fixture.velocity(first) - Eigen::Vector3f(-1, 0, 0)).norm(), 0.02) << 1 / dt_s;
    const Eigen::Vector3f out(static_cast<float>(3.0), static_cast<float>(root), 0);
    EXPECT_LT((fixture.velocity(left) - out).norm(), 0.02) << fixture.velocity(left).transpose();
    EXPECT_NEAR(fixture.velocity(left).y(), -fixture.velocity(right).y(), 2e-4);
  }
}

TEST(Impact, FrictionActsOnTheRebound) {
  // A ball that slides through the impact loses µ·(1 + e)·v_z; one that ends in rolling, 2/7 of its slip.
  for (const double dt_s : kSteps_s)
    for (const double e : {1.0, 0.5}) {
      struct Case {
        double slip, friction;
      };
      for (const Case& c : {Case{20.0, 0.3}, Case{2.0, 0.3}, Case{5.0, 0.05}}) {
        ImpactFixture fixture(dt_s, e, c.friction);
        auto ball = sphere(1.0, {3, 15, 2.0});
        ball.velocity = {c.slip, 0, 0};
        const auto id = fixture.add(ball);
        fixture.run_until_rebound(id);
        const double v_z = std::sqrt(2 * 9.81 * 1.0);
        const double predicted = std::min(c.friction * (1 + e) * v_z, 2.0 / 7.0 * c.slip);
        const double lost = c.slip - fixture.velocity(id).x();
        EXPECT_NEAR(lost, predicted, 0.005 * predicted)
            << "e " << e << ", slip " << c.slip << ", friction " << c.friction << ", 1/" << 1 / dt_s;
        // Angular momentum about the contact is kept.
        EXPECT_NEAR(0.4 * fixture.angular_velocity(id).y(), lost, 1e-3 * (1 + lost));
      }
    }
}

TEST(Impact, SlidingBoxAndHullKeepTheLaw) {
  // The torque of friction about the centre moves the load to the front, but not off the face: the body does
  // not turn, and loses µ·(1 + e)·v_z.
  for (const double dt_s : kSteps_s)
    for (const bool hull : {false, true}) {
      ImpactFixture fixture(dt_s, 0.0, 0.1);
      fixture.scene.materials[0].restitution = 1.0;
      auto o = hull ? cube({4, 15, 3.0}) : box({2, 2, 2}, {4, 15, 3.0});
      o.velocity = {6, 0, 0};
      const auto id = fixture.add(o);
      fixture.run_until_rebound(id);
      const double v_z = std::sqrt(2 * 9.81 * 2.0);
      EXPECT_NEAR(6 - fixture.velocity(id).x(), 0.1 * 2 * v_z, 0.01 * 0.2 * v_z) << hull << " 1/" << 1 / dt_s;
    }
}

TEST(Impact, OffCentreHitOfBox) {
  // A box tilted by 30° about y lands on its lower edge: planar rigid body, impulse at r from the centre,
  // Newton's law of the normal velocity, without friction and with friction enough to stick.
  for (const double dt_s : kSteps_s)
    for (const double e : {1.0, 0.5})
      for (const double friction : {0.0, 0.1, 3.0}) {
        ImpactFixture fixture(dt_s, e, friction);
        const double tilt = M_PI / 6;
        fixture.scene.world.gravity = {0, 0, 0};
        auto o = box({2, 2, 2}, {15, 15, 5});
        o.orientation = Eigen::AngleAxisd(tilt, Eigen::Vector3d::UnitY());
        o.velocity = {1.5, 0, -8};
        const auto id = fixture.add(o);
        fixture.run_until_rebound(id);
        // The lower edge is at the body's (+1, −1): x = cos − sin, z = −sin − cos.
        const double x = std::cos(tilt) - std::sin(tilt), z = -std::sin(tilt) - std::cos(tilt);
        const double inertia = 4.0 / 6.0;  // by mass
        const double k_nn = 1 + x * x / inertia, k_tt = 1 + z * z / inertia, k_nt = -x * z / inertia;
        // ω = (r × P)_y / I = (z·P_x − x·P_z) / I; velocity of the point: (v_x + ω·z, v_z − ω·x).
        const double v_n = -8, v_t = 1.5;
        // Stick: K·p = (0, e·8) − (v_t, v_n).
        const double determinant = k_nn * k_tt - k_nt * k_nt;
        const double b_n = -(1 + e) * v_n, b_t = -v_t;
        double p_n = (k_tt * b_n - k_nt * b_t) / determinant, p_t = (k_nn * b_t - k_nt * b_n) / determinant;
        if (std::abs(p_t) > friction * p_n) {
          // Slides in the direction that friction cannot stop.
          const double sign = p_t > 0 ? 1 : -1;
          p_n = b_n / (k_nn + sign * friction * k_nt), p_t = sign * friction * p_n;
        }
        EXPECT_NEAR(fixture.velocity(id).x(), 1.5 + p_t, 0.02) << e << " " << friction << " 1/" << 1 / dt_s;
        EXPECT_NEAR(fixture.velocity(id).z(), -8 + p_n, 0.02) << e << " " << friction << " 1/" << 1 / dt_s;
        EXPECT_NEAR(fixture.angular_velocity(id).y(), (z * p_t - x * p_n) / inertia, 0.03)
            << e << " " << friction << " 1/" << 1 / dt_s;
      }
}

TEST(Impact, FlatDropLeavesStraight) {
  for (const double dt_s : kSteps_s)
    for (const double e : {0.0, 0.5, 1.0})
      for (const int where : {0, 1, 2}) {  // pins, many pins, the ground
        ImpactFixture fixture(dt_s, e, 0.5);
        // Bullet finds the points of a box on its ground plane one by one.
        if (where == 2 && fixture.is_bullet()) continue;
        if (where == 2) {
          fixture.scene.surface.rows = fixture.scene.surface.columns = 2;
        }
        const double x = where == 2 ? 30.0 : 15.3, low = where == 2 ? -2 : 0;
        auto o = box({where == 1 ? 5.0 : 2.0, where == 1 ? 5.0 : 2.0, 2}, {x, 15.2, low + 4});
        o.velocity = {0, 0, -20};
        const auto id = fixture.add(o);
        double sideways = 0, spin = 0;
        fixture.run(0.5, [&] {
          sideways = std::max(sideways, static_cast<double>(fixture.velocity(id).head<2>().norm()));
          spin = std::max(spin, static_cast<double>(fixture.angular_velocity(id).norm()));
        });
        EXPECT_LT(sideways, 0.01) << "e " << e << ", case " << where << ", 1/" << 1 / dt_s;
        EXPECT_LT(spin, 0.01) << "e " << e << ", case " << where << ", 1/" << 1 / dt_s;
      }
}

TEST(Impact, BouncesKeepEnergy) {
  for (const double dt_s : kSteps_s) {
    ImpactFixture fixture(dt_s, 1.0, 0.5);
    const auto id = fixture.add(sphere(1.0, {15.3, 15.2, 3.0}));
    fixture.run(60.0);
    const double energy = 9.81 * (fixture.position(id).z() - 1) + 0.5 * fixture.velocity(id).squaredNorm();
    // Bullet gains 1.2 % at 1/60.
    const double tolerance = fixture.is_bullet() ? 0.02 : 0.01;
    EXPECT_NEAR(energy, 9.81 * 2.0, tolerance * 9.81 * 2.0) << "1/" << 1 / dt_s;
  }
}

TEST(Impact, ApexFallsWithRestitutionSquared) {
  for (const double dt_s : kSteps_s)
    for (const double e : {0.5, 0.8}) {
      ImpactFixture fixture(dt_s, e, 0.5);
      const auto id = fixture.add(sphere(1.0, {15.3, 15.2, 4.0}));
      const double tolerance = fixture.is_bullet() ? 0.025 : 0.01;
      double apex = 0, expected = 3.0;
      int bounces = 0;
      fixture.run(4.0, [&] {
        const double v = fixture.velocity(id).z();
        if (v > 0) apex = std::max(apex, fixture.position(id).z() - 1.0);
        if (v > 0 || apex == 0) return;
        expected *= e * e;
        if (++bounces <= 3) {
          // The apex lies between two steps.
          const double between_steps = 9.81 * dt_s * dt_s / 4;
          EXPECT_NEAR(apex, expected, tolerance * expected + between_steps)
              << "e " << e << ", bounce " << bounces << ", 1/" << 1 / dt_s;
        }
        apex = 0;
      });
      EXPECT_GE(bounces, 3);
    }
}

TEST(Impact, HeapOfElasticBallsGainsNoEnergy) {
  for (const double dt_s : {1.0 / 60, 1.0 / 240}) {
    ImpactFixture fixture(dt_s, 1.0, 0.5);
    std::vector<ObjectId> balls;
    for (int i = 0; i < 60; ++i)
      balls.push_back(fixture.add(
          sphere(0.8, {12 + 1.7 * (i % 4) + 0.03 * i, 12 + 1.7 * (i / 4 % 4), 1.5 + 1.7 * (i / 16)})));
    auto energy = [&] {
      double sum = 0;
      for (const ObjectId id : balls) {
        const auto ball = fixture.world().state(id);
        sum += 9.81 * ball.position.z() + 0.5 * ball.velocity.squaredNorm() +
               0.2 * 0.64 * ball.angular_velocity.squaredNorm();
      }
      return sum;
    };
    const double start = energy();
    double greatest = start;
    fixture.run(3.0, [&] { greatest = std::max(greatest, energy()); });
    EXPECT_LT(greatest, 1.01 * start) << "1/" << 1 / dt_s;
  }
}

TEST(Impact, BallInClosingWedgeIsNotThrown) {
  // Pins rise at w against a lid within the friction cones. A ball that bounces between both gains w per
  // round and loses by e: it tends to w/(1 − e). Without rebound it jams; the push-out then moves it at 4 u/s
  // at most.
  for (const double dt_s : {1.0 / 60, 1.0 / 240})
    for (const double e : {0.0, 0.2, 0.5})
      for (const double tilt : {5.0, 15.0}) {
        ImpactFixture fixture(dt_s, e, 1.0);
        fixture.scene.surface.pin.max_speed = 1.5;
        auto lid = box({12, 12, 1}, {15.3, 15.2, 4.2});
        lid.fixed = true;
        lid.orientation = Eigen::AngleAxisd(tilt * M_PI / 180, Eigen::Vector3d::UnitY());
        fixture.add(lid);
        const auto id = fixture.add(sphere(1.0, {15.3, 15.2, 1.0}));
        fixture.cells().set_targets(0, std::vector<float>(32 * 32, 6.0F));
        double fastest = 0;
        fixture.run(2.0, [&] { fastest = std::max(fastest, fixture.world().state(id).velocity.norm()); });
        EXPECT_LT(fastest, e > 0 ? 1.05 * 1.5 / (1 - e) : 4.5)
            << "e " << e << ", tilt " << tilt << ", 1/" << 1 / dt_s;
      }
}

TEST(Impact, HeavyBoxOnFourLightOnesComesToRest) {
  ImpactFixture fixture(1.0 / 60, 0.2, 0.5);
  std::vector<ObjectId> boxes;
  for (int i = 0; i < 4; ++i) {
    auto o = box({1, 1, 1}, {14.3 + 2 * (i % 2), 14.2 + 2 * (i / 2), 0.5});
    o.mass = 1.0;
    boxes.push_back(fixture.add(o));
  }
  auto heavy = box({4, 4, 1}, {15.3, 15.2, 1.5});
  heavy.mass = 100.0;
  boxes.push_back(fixture.add(heavy));
  fixture.run(3.0);
  const Eigen::Vector3f before = fixture.position(boxes.back());
  fixture.run(5.0);
  EXPECT_LT((fixture.position(boxes.back()) - before).norm(), fixture.is_bullet() ? 0.002F : 0.001F);
  // Nothing sleeps on Bullet.
  EXPECT_EQ(fixture.world().sleeping_count(), fixture.is_bullet() ? 0 : 5);
}
