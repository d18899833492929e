// Rebounds of balls from uneven beds, of cells and of fixed boxes, against an event-driven oracle: a ball
// bounces off what it meets first, whatever else its path of the step would have met.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <optional>
#include <random>
#include <vector>

#include "tests/property/PhysicsFixture.h"

using namespace physics_fixture;
using Eigen::Vector3d;

namespace {

constexpr int kFirst = 8, kSide = 16;  // the bed within the table, cells

// Columns with rectangular tops.
struct Bed {
  double half_top;
  std::vector<double> height;  // row-major from the south

  Vector3d offset_from(int x, int y, const Vector3d& p) const {
    const auto along = [this](double u, int cell) {
      return u - std::clamp(u, cell - half_top, cell + half_top);
    };
    const double top = height[(y - kFirst) * kSide + x - kFirst];
    return {along(p.x(), x), along(p.y(), y), p.z() - std::min(p.z(), top)};
  }
  // From the nearest point of a column to p; the one below p or beside that, as their heights hardly differ.
  Vector3d offset(const Vector3d& p) const {
    Vector3d nearest = Vector3d::Constant(std::numeric_limits<double>::infinity());
    const auto below = [](double u) {
      return std::clamp(static_cast<int>(std::lround(u)), kFirst + 1, kFirst + kSide - 2);
    };
    for (int y = below(p.y()) - 1; y <= below(p.y()) + 1; ++y)
      for (int x = below(p.x()) - 1; x <= below(p.x()) + 1; ++x)
        if (const Vector3d o = offset_from(x, y, p); o.squaredNorm() < nearest.squaredNorm()) nearest = o;
    return nearest;
  }
};

struct Impact {
  double time_s;
  Vector3d normal;
};

// Conservative advancement.
std::optional<Impact> first_impact(const Bed& bed, const Vector3d& from, const Vector3d& velocity,
                                   double radius, double within_s) {
  const double speed = velocity.norm();
  for (double t = 0; t < within_s;) {
    const Vector3d offset = bed.offset(from + t * velocity);
    const double distance = offset.norm() - radius;
    if (distance < 1e-9) return Impact{t, offset.normalized()};
    t += distance / speed;
  }
  return std::nullopt;
}

class Bounces : public testing::TestWithParam<bool> {};  // whether the bed consists of fixed boxes
INSTANTIATE_TEST_SUITE_P(Bed, Bounces, testing::Bool(),
                         [](const auto& instance) { return instance.param ? "Boxes" : "Cells"; });

TEST_P(Bounces, BallsReboundFromWhatTheyMeetFirst) {
  constexpr double kMaxTravel = 0.2;  // in a step, u
  // The plane of a box is that of the step's start.
  const double max_error = GetParam() ? 0.2 : 0.05;
  const int one_in = GetParam() ? 10 : 50;
  std::mt19937 random(7);
  const auto uniform = [&](double low, double high) {
    return std::uniform_real_distribution<double>(low, high)(random);
  };
  const auto random_bed = [&](double half_top) {
    Bed bed{half_top, {}};
    for (int i = 0; i < kSide * kSide; ++i)
      bed.height.push_back(uniform(0.0, 0.005) + 0.01 * ((i + i / kSide) % 2));  // no neighbours are level
    return bed;
  };
  for (const double dt_s : {1.0 / 60, 1.0 / 240}) {
    int balls = 0, wrong = 0;
    for (int i = 0; i < 150; ++i) {
      const double restitution = uniform(0.1, 1), radius = uniform(0.2, 0.6), yaw = uniform(0, 6.28),
                   elevation = uniform(0.3, 1.4), speed = uniform(3, std::min(20.0, kMaxTravel / dt_s));
      const Bed bed = random_bed(uniform(0.3, 0.45));
      const Vector3d velocity = speed * Vector3d(std::cos(yaw) * std::cos(elevation),
                                                 std::sin(yaw) * std::cos(elevation), -std::sin(elevation));
      const double aim_x = 15.5 + uniform(-1, 1), aim_y = 15.5 + uniform(-1, 1);
      const Vector3d from =
          Vector3d(aim_x, aim_y, radius + 0.02) - 1.2 * uniform(0.9, 1.1) / speed * velocity;
      const auto impact = first_impact(bed, from, velocity, radius, 3.0);
      if (!impact) continue;
      const Vector3d expected = velocity - (1 + restitution) * impact->normal.dot(velocity) * impact->normal;
      const Vector3d at = from + impact->time_s * velocity + 1e-6 * expected;
      if (first_impact(bed, at, expected, radius, 4 * dt_s)) continue;  // a second one follows at once

      PhysicsFixture fixture;
      fixture.scene.world.dt_s = dt_s;
      fixture.scene.world.gravity = {0, 0, 0};
      fixture.scene.materials[0].restitution = restitution;
      fixture.scene.materials[0].friction = fixture.scene.materials[0].rolling_friction = 0.0;
      const double up = GetParam() ? 20.0 : 0.0;
      if (GetParam()) {
        for (int k = 0; k < kSide * kSide; ++k) {
          auto block = box({2 * bed.half_top, 2 * bed.half_top, 2},
                           Vector3d(kFirst + k % kSide, kFirst + k / kSide, up + bed.height[k] - 1));
          block.fixed = true;
          fixture.add(block);
        }
      } else {
        smartsurf::scene::SurfaceSpec& s = fixture.scene.surface;
        s.pin.max_speed = s.pin.max_acceleration = 1e6;
        s.pin.top_x = s.pin.top_y = 2 * bed.half_top;
        std::vector<float> heights(s.rows * s.columns, 0.0F);
        for (int k = 0; k < kSide * kSide; ++k)
          heights[(s.rows - 1 - kFirst - k / kSide) * s.columns + kFirst + k % kSide] =
              static_cast<float>(bed.height[k]);
        fixture.cells().set_targets(0, heights);
        fixture.run(0.2);
      }
      auto ball = sphere(radius, from + Vector3d(0, 0, up));
      ball.velocity = velocity;
      const auto id = fixture.add(ball);
      fixture.run((std::ceil(impact->time_s / dt_s) + 1) * dt_s);
      ++balls;
      wrong += (fixture.velocity(id).cast<double>() - expected).norm() > max_error * speed;
    }
    EXPECT_GT(balls, 120);
    EXPECT_LE(wrong, balls / one_in) << "of " << balls << " at " << dt_s;
  }
}

}  // namespace
