// Cells at any place and angle, against geometry: narrow gaps between level tops are bridged, all others act
// as they are.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <numbers>
#include <random>
#include <vector>

#include "smartsurf/world/field/FieldCollider.h"
#include "tests/property/FieldPenetration.h"
#include "tests/property/PhysicsFixture.h"

using namespace physics_fixture;
using namespace smartsurf;

namespace {

struct Pose {
  double x, y, angle;
};
using Poses = std::vector<Pose>;
using Eigen::Vector2d;

constexpr double kTop = 0.8, kHalf = kTop / 2, kWidest = 0.25;  // the widest bridged gap; of a pitch of 1

class FreeLayouts : public testing::TestWithParam<int> {
 protected:
  double uniform(double low, double high) {
    return std::uniform_real_distribution<double>(low, high)(random_);
  }
  double steps_per_second() const { return std::array{60, 240, 960}[static_cast<std::size_t>(GetParam())]; }

  // Cells in rows and columns with these gaps, turned as a whole about (0, 0).
  static Poses grid(int side, double gap_x, double gap_y, double turn) {
    Poses poses;
    for (int i = 0; i < side * side; ++i) {
      const double x = (i % side - 0.5 * (side - 1)) * (kTop + gap_x),
                   y = (i / side - 0.5 * (side - 1)) * (kTop + gap_y);
      poses.push_back(
          {std::cos(turn) * x - std::sin(turn) * y, std::sin(turn) * x + std::cos(turn) * y, turn});
    }
    return poses;
  }
  // Rows of bricks, each shifted against the next one by a part of a cell.
  Poses bricks(int side, double gap) {
    Poses poses;
    for (int row = 0; row < side; ++row) {
      const double shift = uniform(0, kTop + gap);
      for (int column = 0; column < side; ++column)
        poses.push_back({(column - 0.5 * side) * (kTop + gap) + shift - 0.5 * kTop,
                         (row - 0.5 * (side - 1)) * (kTop + gap), 0.0});
    }
    return poses;
  }
  // Concentric rings, as many cells in each as have gaps of at least `gap`.
  static Poses rings(int count, double inner, double gap) {
    Poses poses;
    for (int ring = 0; ring < count; ++ring) {
      const double radius = inner + ring * (kTop + gap), at_inner_edge = radius - kHalf;
      const int cells = static_cast<int>(std::numbers::pi / std::atan((kHalf + 0.5 * gap) / at_inner_edge));
      for (int i = 0; i < cells; ++i) {
        const double angle = 2 * std::numbers::pi * i / cells;
        poses.push_back({radius * std::cos(angle), radius * std::sin(angle), angle});
      }
    }
    return poses;
  }
  // Cells at any angle whose circumscribed circles do not meet.
  Poses scattered(int count, double half_side) {
    Poses poses;
    const double apart = 2 * kHalf * std::numbers::sqrt2;
    for (int tries = 0; tries < 200 * count && std::ssize(poses) < count; ++tries) {
      const Pose p{uniform(-half_side, half_side), uniform(-half_side, half_side), uniform(-3, 3)};
      if (std::ranges::all_of(poses, [&](const Pose& q) { return std::hypot(p.x - q.x, p.y - q.y) > apart; }))
        poses.push_back(p);
    }
    return poses;
  }
  Poses random_layout() {
    switch (draw_++ % 4) {
      case 0:
        return grid(11, uniform(0, 0.4), uniform(0, 0.4), uniform(-3, 3));
      case 1:
        return bricks(11, uniform(0, 0.3));
      case 2:
        return rings(5, uniform(1, 3), uniform(0, 0.3));
      default:
        return scattered(60, 5.0);
    }
  }

  // A box, cylinder or capsule.
  scene::ObjectSpec random_body(int kind, const Eigen::Vector3d& at) {
    return kind == 0   ? box({uniform(1, 3), uniform(1, 3), uniform(0.4, 1)}, at)
           : kind == 1 ? cylinder(uniform(0.4, 1), uniform(0.8, 2.5), at)
                       : capsule(uniform(0.4, 0.8), uniform(2, 3), at);
  }
  Eigen::Quaterniond random_rotation() {
    const Eigen::Vector3d axis(uniform(-1, 1), uniform(-1, 1), uniform(-1, 1));
    return Eigen::Quaterniond(Eigen::AngleAxisd(uniform(-3, 3), axis.normalized()));
  }

  void set_layout(PhysicsFixture& f, const Poses& poses) const {
    f.scene.world.dt_s = 1.0 / steps_per_second();
    f.scene.surface.rows = 1, f.scene.surface.columns = static_cast<int>(poses.size());
    f.scene.surface.pin.top_x = f.scene.surface.pin.top_y = kTop;
    place(f.cells().field(), poses);
  }
  static void place(surface::Field& field, const Poses& poses) {
    field.rows = 1, field.columns = static_cast<int>(poses.size());
    field.height.resize(poses.size(), 0.0F), field.speed.resize(poses.size(), 0.0F);
    field.half_top_x = field.half_top_y = static_cast<float>(kHalf);
    for (const Pose& p : poses) {
      field.x.push_back(static_cast<float>(p.x)), field.y.push_back(static_cast<float>(p.y));
      field.angle.push_back(static_cast<float>(p.angle));
    }
  }

  std::mt19937 random_{1};
  int draw_ = 0;
};

// The horizontal distance of a point from a cell's top.
double distance_to_top(const surface::Field& f, std::size_t i, const Vector2d& p) {
  const Vector2d d = p - Vector2d(f.x[i], f.y[i]);
  const double c = std::cos(static_cast<double>(f.angle[i])), s = std::sin(static_cast<double>(f.angle[i]));
  return std::hypot(std::max(0.0, std::abs(c * d.x() + s * d.y()) - kHalf),
                    std::max(0.0, std::abs(c * d.y() - s * d.x()) - kHalf));
}

// The least distance from the corners of either top to the other.
double distance_between(const surface::Field& f, std::size_t i, std::size_t k) {
  double least = 1e9;
  for (const auto& [a, b] : {std::pair(i, k), std::pair(k, i)})
    for (int corner = 0; corner < 4; ++corner) {
      const Vector2d local(corner & 1 ? kHalf : -kHalf, corner & 2 ? kHalf : -kHalf),
          at = Vector2d(f.x[a], f.y[a]) + Eigen::Rotation2Dd(f.angle[a]) * local;
      least = std::min(least, distance_to_top(f, b, at));
    }
  return least;
}

// The height of a ball's centre that rests on a top at this horizontal distance.
double height_on(const surface::Field& f, std::size_t i, double distance, double radius) {
  const double d = std::clamp(distance, 0.0, radius);
  return static_cast<double>(f.height[i]) + std::sqrt(radius * radius - d * d);
}

std::string name_of_step(const testing::TestParamInfo<int>& step) {
  return std::array{"60", "240", "960"}[static_cast<std::size_t>(step.param)];
}

}  // namespace

// A ball's deepest contact is as deep as the tops are in it, where the gaps beside it are not bridged; and it
// is never less deep, nor deeper than in a plane.
TEST_P(FreeLayouts, BallsTouchTheTopsThatAreThere) {
  if (GetParam() > 0) GTEST_SKIP() << "nothing moves";
  constexpr float kMargin = 0.1F;
  int over_narrow_gaps = 0, in_gaps = 0;
  for (int i = 0; i < 40; ++i) {
    surface::Field field;
    place(field, random_layout());
    const bool is_level = i % 3 != 0;
    if (!is_level)
      for (float& height : field.height) height = static_cast<float>(std::floor(uniform(0, 3)) * 0.3);
    field.max_height = *std::ranges::max_element(field.height);
    const world::FieldCollider collider(field);
    for (int k = 0; k < 150; ++k) {
      const double radius = uniform(0.05, 1.2);
      const Vector2d at(uniform(-4, 4), uniform(-4, 4));
      const double bridged = std::min(kWidest, radius * std::numbers::sqrt2);
      double height = -10, over_bridges = -10;
      std::vector<std::size_t> near;
      for (std::size_t c = 0; c < field.x.size(); ++c) {
        const double d = distance_to_top(field, c, at);
        if (d < radius) height = std::max(height, height_on(field, c, d, radius));
        if (d < radius + bridged) near.push_back(c);
      }
      if (height < -5) continue;
      // The plane over a gap begins, at most, where the diagonal of the widest one ends.
      for (const std::size_t a : near)
        for (const std::size_t b : near)
          if (a != b && field.height[a] == field.height[b] && distance_between(field, a, b) < bridged + 1e-3)
            over_bridges = std::max(
                over_bridges, height_on(field, a, distance_to_top(field, a, at) - 0.75 * bridged, radius));
      // The contacts of the ball at the height at which it just touches the tops.
      std::vector<world::Contact> contacts;
      collider.collide_sphere_with_columns(
          world::Vec3(static_cast<float>(at.x()), static_cast<float>(at.y()), static_cast<float>(height)),
          static_cast<float>(radius), kMargin, {}, contacts);
      double separation = kMargin;
      for (const world::Contact& c : contacts)
        separation = std::min(separation, static_cast<double>(c.separation));
      SCOPED_TRACE(testing::Message()
                   << "layout " << i << " ball " << k << " radius " << radius << " at " << at.transpose());
      const double least = std::min(0.0, height - over_bridges);
      EXPECT_GT(separation, least - 2e-3);
      EXPECT_LT(separation, 2e-3);
      ++(least == 0.0 ? in_gaps : over_narrow_gaps);
    }
  }
  EXPECT_GT(over_narrow_gaps, 1000);
  EXPECT_GT(in_gaps, 1000);
}

// A body that is in a top has a contact as deep as that.
TEST_P(FreeLayouts, ContactsReportEveryPenetration) {
  if (GetParam() > 0) GTEST_SKIP() << "nothing moves";
  constexpr double kTolerance = 0.004;  // u
  int deep = 0;
  for (int i = 0; i < 400; ++i) {
    surface::Field field;
    place(field, random_layout());
    if (i % 8 < 6)
      for (float& height : field.height)
        height = static_cast<float>(uniform(0, 1) < 0.5 ? 0.0 : uniform(0, 2));
    field.max_height = *std::ranges::max_element(field.height);
    const world::FieldCollider collider(field);
    const Eigen::Vector3d at(uniform(-2, 2), uniform(-2, 2), 0);
    const world::Shape shape = world::make_shape(random_body(i % 3, at));
    const Eigen::Quaterniond rotation = random_rotation();
    scene::Snapshot pose;
    pose.position.push_back({static_cast<float>(at.x()), static_cast<float>(at.y()), 0.0F});
    const Eigen::Vector4f q = rotation.coeffs().cast<float>();
    pose.orientation.push_back({q.x(), q.y(), q.z(), q.w()});
    const double depth = lower_into_field(field, shape, 0.3F, 6.0F, uniform(kTolerance, 0.04), pose, 0);
    if (depth < kTolerance) continue;  // it jumps where an upright side meets a top
    ++deep;
    std::vector<world::Contact> contacts;
    collider.collide_columns(shape, world::Vec3(pose.position[0].data()),
                             rotation.cast<float>().toRotationMatrix(), 0.02F, contacts);
    double deepest = -1;
    for (const world::Contact& c : contacts) deepest = std::max(deepest, static_cast<double>(-c.separation));
    EXPECT_GT(deepest, depth - kTolerance) << "pose " << i << ", " << contacts.size() << " contacts";
  }
  EXPECT_GT(deep, 200);
}

// A ball between four tops touches their corners, at half the diagonal of the two gaps from its axis; balls
// that are smaller fall through.
TEST_P(FreeLayouts, BallsRestInUnequalGapsOrFallThrough) {
  for (int i = 0; i < 24; ++i) {
    const double gap_x = uniform(0.05, 0.6), gap_y = uniform(0.26, 0.6), turn = uniform(-3, 3),
                 e = 0.5 * std::hypot(gap_x, gap_y);
    const bool rests = i % 3 > 0;
    const double radius = e * (rests ? uniform(1.1, 3) : uniform(0.5, 0.97));
    SCOPED_TRACE(testing::Message() << i << " gaps " << gap_x << ' ' << gap_y << " turn " << turn
                                    << " radius " << radius);
    PhysicsFixture f;
    set_layout(f, grid(8, gap_x, gap_y, turn));
    double z = rests ? std::sqrt(radius * radius - e * e) : radius;
    const auto id = f.add(sphere(radius, {0, 0, z + 0.005}));
    f.run(2.0);
    if (!rests) {
      EXPECT_LT(f.position(id).z(), -0.5);
      continue;
    }
    const bool is_bridged = e * std::numbers::sqrt2 <= kWidest;
    const Eigen::Vector3d at = f.position(id).cast<double>();
    if (is_bridged) z = std::sqrt(radius * radius - gap_y * gap_y / 4);  // the gaps are those between rows
    EXPECT_NEAR(at.z(), z, 5e-3);
    if (!is_bridged) {
      EXPECT_LT(at.head<2>().norm(), 0.015);
    }
  }
}

// Bodies of all shapes come to rest in touch with the tops that are there, and not in them.
TEST_P(FreeLayouts, BodiesRestOnTheTopsThatAreThere) {
  int resting = 0;
  for (int i = 0; i < 32; ++i) {
    const Poses poses = random_layout();
    PhysicsFixture f;
    f.scene.materials[0].rolling_friction = 0.05;
    set_layout(f, poses);
    const surface::Field& field = f.cells().field();
    if (i % 8 < 4) {
      std::vector<float> heights(poses.size());
      for (float& height : heights) height = static_cast<float>(0.1 * std::floor(uniform(0, 4)));
      f.cells().set_targets(0, heights);
      f.run(1.0);
    }
    const Eigen::Vector3d at(uniform(-2, 2), uniform(-2, 2), 1.6);
    auto body = i % 4 == 0 ? sphere(uniform(0.5, 1), at) : random_body(i % 4 - 1, at);
    if (i % 4 > 0) body.orientation = random_rotation();
    const auto id = f.add(body);
    f.run(4.0);
    const Eigen::Vector3f end = f.position(id);
    if (end.z() < 0.0F || f.velocity(id).norm() > 0.02F) continue;  // it left the cells, or still rolls
    ++resting;
    SCOPED_TRACE(testing::Message() << i << " at " << end.transpose());
    const world::Shape shape = world::make_shape(body);
    EXPECT_LT(penetration_into_field(field, shape, f.snapshot(), id), 0.01);
    EXPECT_LT(distance_to_field(field, shape, f.snapshot(), id), 0.03);
  }
  EXPECT_GT(resting, 16);
}

// Balls and cylinders roll over a level layout of narrow gaps as over a plane.
TEST_P(FreeLayouts, RoundBodiesRollStraightOverNarrowGaps) {
  for (int i = 0; i < 12; ++i) {
    const double gap = uniform(0.01, 0.24), radius = uniform(0.35, 1.2), speed = uniform(0.5, 3),
                 heading = uniform(-3, 3);
    const Vector2d along(std::cos(heading), std::sin(heading));
    PhysicsFixture f;
    const int kind = i % 3;
    set_layout(f, kind == 0   ? grid(15, gap, uniform(0.01, 0.24), uniform(-3, 3))
                  : kind == 1 ? bricks(15, gap)
                              : rings(5, 6.0, uniform(0.01, 0.1)));
    const Vector2d from = kind == 2 ? Vector2d(0.0, 7.8) - along : Vector2d(-2.5 * along);
    const double way =
        speed * f.scene.world.dt_s * std::round((kind == 2 ? 2.0 : 5.0) / (speed * f.scene.world.dt_s));
    SCOPED_TRACE(testing::Message() << i << " gap " << gap << " radius " << radius << " speed " << speed
                                    << " heading " << heading);
    auto ball = i % 2 == 0 ? sphere(radius, {from.x(), from.y(), radius})
                           : cylinder(radius, 1.5, {from.x(), from.y(), radius});
    if (i % 2 == 1)
      ball.orientation = Eigen::AngleAxisd(-std::numbers::pi / 2, Eigen::Vector3d(along.x(), along.y(), 0));
    ball.velocity = {speed * along.x(), speed * along.y(), 0};
    ball.angular_velocity = speed / radius * Eigen::Vector3d(-along.y(), along.x(), 0);
    const auto id = f.add(ball);
    double highest = 0, lowest = 10;
    f.run(way / speed, [&] {
      const auto z = static_cast<double>(f.position(id).z());
      highest = std::max(highest, z), lowest = std::min(lowest, z);
    });
    const Eigen::Vector3d end = f.position(id).cast<double>();
    const Vector2d moved = end.head<2>() - from;
    EXPECT_NEAR(moved.dot(along), way, 0.005 * way);
    EXPECT_LT((moved - moved.dot(along) * along).norm(), 0.02);
    EXPECT_LT(highest - radius, 2e-3);
    EXPECT_GT(lowest - radius, -3e-3);
  }
}

INSTANTIATE_TEST_SUITE_P(Steps, FreeLayouts, testing::Values(0, 1, 2), name_of_step);
