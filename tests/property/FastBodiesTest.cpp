// Bodies that move far in a step against other bodies: nothing passes, and what bounces keeps Newton's law.
#include <gtest/gtest.h>

#include <array>
#include <cmath>
#include <cstdlib>
#include <memory>
#include <random>
#include <vector>

#include "smartsurf/mesh/SolidBuilder.h"
#include "smartsurf/scene/Axes.h"
#include "tests/property/PhysicsFixture.h"

using namespace physics_fixture;
using namespace smartsurf;
using Eigen::Vector3d;

namespace {

struct Draw {
  std::mt19937 random;
  explicit Draw(unsigned seed) : random(seed) {}
  double uniform(double low, double high) {
    return std::uniform_real_distribution<double>(low, high)(random);
  }
  double log_uniform(double low, double high) { return std::exp(uniform(std::log(low), std::log(high))); }
  Vector3d direction() {
    std::normal_distribution<double> normal;
    const double x = normal(random), y = normal(random), z = normal(random);
    return Vector3d(x, y, z).normalized();
  }
  Eigen::AngleAxisd rotation() {
    const double angle = uniform(0, 3);
    return Eigen::AngleAxisd(angle, direction());
  }
};

class FastBodies : public testing::TestWithParam<double> {
 protected:
  void restart(double restitution) {
    fixture = PhysicsFixture();
    fixture.scene.world.dt_s = GetParam();
    fixture.scene.world.gravity = {0, 0, 0};
    fixture.scene.materials[0].restitution = restitution;
  }
  PhysicsFixture fixture;
};
INSTANTIATE_TEST_SUITE_P(Steps, FastBodies, testing::Values(1.0 / 60, 1.0 / 120, 1.0 / 240, 1.0 / 960));

scene::ObjectSpec random_body(Draw& draw, const Vector3d& position) {
  const double size = draw.log_uniform(0.05, 0.6);
  scene::ObjectSpec o;
  switch (static_cast<int>(draw.uniform(0, 5))) {
    case 0:
      o = box({size, size * draw.uniform(0.3, 1), size * draw.uniform(0.3, 2)}, position);
      break;
    case 1:
      o = capsule(0.5 * size, size * draw.uniform(1.5, 3), position);
      break;
    case 2:
      o = cylinder(0.5 * size, size * draw.uniform(0.3, 2), position);
      break;
    case 3:
      o = cube(position, static_cast<float>(size));
      break;
    default:
      return sphere(0.5 * size, position);
  }
  o.orientation = draw.rotation();
  return o;
}

// FAST_SEEDS=6000 draws more than `usual`.
unsigned seed_count(unsigned usual) {
  const char* more = std::getenv("FAST_SEEDS");
  return more ? static_cast<unsigned>(std::atoi(more)) : usual;
}

// Hits set slender bodies spinning by turns in a step. A kind of kSlenderKinds or more is a capsule.
constexpr unsigned kSlenderKinds = 5;
scene::ObjectSpec slender_body(Draw& draw, unsigned kind, const Vector3d& position) {
  const double radius = draw.uniform(0.03, 0.1), length = radius * draw.uniform(3, 8);
  scene::ObjectSpec o;
  switch (kind) {
    case 0:
      o = box({radius, radius * draw.uniform(0.3, 2), length}, position);
      break;
    case 1:
      o = cylinder(radius, length, position);
      break;
    case 2:
      o = cylinder(0.5 * length, radius, position);
      break;
    case 3:
      o = cone(radius, length, position);
      break;
    case 4: {
      std::vector<Vector3d> corners;
      for (int i = 0; i < 8; ++i)
        corners.emplace_back((i & 1 ? 1 : -1) * radius * draw.uniform(0.3, 1),
                             (i & 2 ? 1 : -1) * radius * draw.uniform(0.3, 1),
                             (i & 4 ? 0.5 : -0.5) * length * draw.uniform(0.5, 1));
      o.shape = scene::ShapeKind::kSolid;
      o.solid = std::make_shared<scene::Solid>(mesh::build_hull_solid(corners));
      o.position = position;
      break;
    }
    default:
      o = capsule(radius, length, position);
  }
  o.orientation = draw.rotation();
  return o;
}

}  // namespace

// A wall of any thickness and pose, fixed or moving towards the body, which may tumble.
TEST_P(FastBodies, DoNotPassWall) {
  for (unsigned seed = 1; seed <= seed_count(360); ++seed) {
    SCOPED_TRACE(seed);
    restart(seed % 3 == 0 ? 0.5 : 0.0);
    Draw draw(seed);
    const Eigen::Quaterniond pose(draw.rotation());
    const Vector3d middle(15, 15, 40), normal = pose * Vector3d::UnitX();
    auto wall = box({draw.log_uniform(0.001, 1), 30, 30}, middle);
    wall.orientation = pose;
    const bool moves = seed % 4 == 0;
    wall.fixed = !moves;
    if (moves) wall.mass = 1e5, wall.velocity = draw.uniform(0, 50) * normal;
    const auto wall_id = fixture.add(wall);
    const double aside = draw.uniform(-1, 1), up = draw.uniform(-1, 1);
    const Vector3d across = pose * Vector3d(0, aside, up);
    const Vector3d heading = (-normal + draw.uniform(0, 0.8) * across).normalized();
    const double speed = draw.uniform(5, 200), away = draw.uniform(1.5, 8);
    const Vector3d at = middle + away * normal;
    auto body = seed % 6 == 0 ? random_body(draw, at) : slender_body(draw, seed % (2 * kSlenderKinds), at);
    body.velocity = speed * heading;
    const double spin = draw.uniform(0, 60);
    body.angular_velocity = spin * draw.direction();
    const auto id = fixture.add(body);
    double least = 1e9;
    fixture.run(0.15, [&] {
      const Vector3d wall_at = fixture.position(wall_id).cast<double>();
      least = std::min(least, (fixture.position(id).cast<double>() - wall_at).dot(normal));
    });
    EXPECT_GT(least, 0.0);
  }
}

TEST_P(FastBodies, BallBouncesOffWallByNewtonsLaw) {
  for (unsigned seed = 1; seed <= 40; ++seed) {
    SCOPED_TRACE(seed);
    Draw draw(seed);
    const double e = draw.uniform(0, 1);
    restart(e);
    fixture.scene.materials[0].friction = 0.0;
    const Vector3d middle(15, 15, 40), normal = seed % 2 == 0 ? draw.direction() : Vector3d::Unit(seed % 3);
    auto wall = box({draw.log_uniform(0.001, 1), 40, 40}, middle);
    wall.orientation = smartsurf::scene::rotation_between(Vector3d::UnitX(), normal);
    wall.fixed = true;
    fixture.add(wall);
    const double radius = draw.log_uniform(0.03, 1);
    auto ball = sphere(radius, middle + draw.uniform(2, 6) * normal);
    const Vector3d tangent = normal.unitOrthogonal();
    const double speed = draw.uniform(20, 200), aside = draw.uniform(0, 20);
    ball.velocity = -speed * normal + aside * tangent;
    const auto id = fixture.add(ball);
    fixture.run(0.35);
    const Vector3d after = fixture.velocity(id).cast<double>();
    EXPECT_NEAR(after.dot(normal), e * speed, 0.002 * speed);
    EXPECT_NEAR(after.dot(tangent), aside, 0.002 * speed);
  }
}

// Two balls meet in flight. The impulse acts along the line of centres at contact.
TEST_P(FastBodies, BallsMeetInFlight) {
  for (unsigned seed = 1; seed <= 40; ++seed) {
    SCOPED_TRACE(seed);
    Draw draw(seed);
    const double e = draw.uniform(0, 1);
    restart(e);
    fixture.scene.materials[0].friction = 0.0;
    const double r1 = draw.log_uniform(0.1, 0.4), r2 = draw.log_uniform(0.1, 0.4),
                 offset = draw.uniform(0, 0.9) * (r1 + r2);
    // Slower balls are close enough when they are found.
    const double closing = std::max(draw.uniform(20, 400), 1.1 * std::min(r1, r2) / GetParam());
    const double v1 = draw.uniform(0.5, 1) * closing, v2 = v1 - closing, ratio = draw.log_uniform(0.2, 5);
    auto one = sphere(r1, {8, 15, 20}), two = sphere(r2, {8 + draw.uniform(2, 9), 15 + offset, 20});
    one.velocity = {v1, 0, 0}, two.velocity = {v2, 0, 0};
    one.mass = 1.0, two.mass = ratio;
    const auto a = fixture.add(one), b = fixture.add(two);
    fixture.run(0.6);
    const double sine = offset / (r1 + r2);
    const Vector3d normal(std::sqrt(1 - sine * sine), sine, 0);
    const double impulse = (1 + e) * (v1 - v2) * normal.x() / (1 + 1 / ratio);
    const double tolerance = 0.01 * (v1 - v2);
    EXPECT_LT((fixture.velocity(a).cast<double>() - (Vector3d(v1, 0, 0) - impulse * normal)).norm(),
              tolerance);
    EXPECT_LT((fixture.velocity(b).cast<double>() - (Vector3d(v2, 0, 0) + impulse / ratio * normal)).norm(),
              tolerance);
  }
}

// What flies past does not touch.
TEST_P(FastBodies, PassBesidePole) {
  for (unsigned seed = 1; seed <= 40; ++seed) {
    SCOPED_TRACE(seed);
    restart(0.5);
    Draw draw(seed);
    const double pole = draw.log_uniform(0.005, 0.2), radius = draw.log_uniform(0.05, 0.5);
    auto o = cylinder(pole, 10, {15, 15, 20});
    o.fixed = true;
    fixture.add(o);
    const double clear = pole + radius + draw.uniform(0.03, 0.3), speed = draw.uniform(20, 200);
    auto ball = sphere(radius, {15 - draw.uniform(2, 6), 15 + clear, 20});
    ball.velocity = {speed, 0, 0};
    const auto id = fixture.add(ball);
    fixture.run(0.4);
    EXPECT_EQ(fixture.velocity(id).x(), static_cast<float>(speed));
    EXPECT_EQ(fixture.velocity(id).y(), 0.0F);
  }
}

// A body that spins fast beside a fixed one, at any depth of their overlap, goes on moving: it is let apart,
// or in by a little. It may creep for a while.
TEST_P(FastBodies, SpinningMoveOn) {
  for (unsigned seed = 1; seed <= seed_count(300); ++seed) {
    SCOPED_TRACE(seed);
    restart(0.0);
    Draw draw(seed);
    const auto large_body = [&draw](const Vector3d& position) {
      const double a = draw.uniform(0.8, 2.5), b = draw.uniform(0.8, 2.5), c = draw.uniform(0.8, 2.5);
      auto o = draw.uniform(0, 2) < 1 ? box({a, b, c}, position) : cylinder(0.5 * a, b, position);
      o.orientation = draw.rotation();
      o.mass = 1.0;
      return o;
    };
    const Vector3d middle(15, 15, 40), heading = draw.direction();
    auto fixed = large_body(middle);
    fixed.fixed = true;
    fixture.add(fixed);
    const double speed = draw.uniform(10, 40), aside = draw.uniform(0, 1), spin = draw.uniform(0, 45);
    auto body = large_body(middle - 3 * heading + aside * draw.direction());
    body.velocity = speed * heading, body.angular_velocity = spin * draw.direction();
    const auto id = fixture.add(body);
    Vector3d before = body.position;
    int hanging_steps = 0, most = 0;
    fixture.run(0.6, [&] {
      const Vector3d now = fixture.position(id).cast<double>();
      const double fast = fixture.velocity(id).cast<double>().norm();
      hanging_steps = fast > 5 && (now - before).norm() < 0.02 * fast * GetParam() ? hanging_steps + 1 : 0;
      most = std::max(most, hanging_steps);
      before = now;
    });
    EXPECT_LT(most * GetParam(), 0.25);
    EXPECT_EQ(hanging_steps, 0);
  }
}

// Boxes that tumble beside a ball out of their reach. Much nearer, the straight paths of their corners may
// hit it.
TEST_P(FastBodies, TumblingBesideOthersKeepsItsEnergy) {
  Draw draw(13);
  for (int i = 0; i < 30; ++i) {
    SCOPED_TRACE(i);
    restart(0.0);
    fixture.scene.world.sleep = false;
    const Vector3d size(1, draw.uniform(0.1, 0.5), draw.uniform(0.1, 0.5)), at(15, 15, 50);
    auto tumbling = box(size, at);
    tumbling.orientation = draw.rotation();
    tumbling.angular_velocity = draw.uniform(5, 20) * draw.direction();
    const Vector3d squares = size.cwiseAbs2();
    tumbling.mass = 1;
    const Vector3d moments = 1.0 / 12 * (Vector3d::Constant(squares.sum()) - squares);
    const scene::ObjectId id = fixture.add(tumbling);
    auto ball = sphere(0.05, at + (0.5 * size.norm() + 0.05 + draw.uniform(0.05, 0.15)) * draw.direction());
    ball.fixed = true;
    fixture.add(ball);
    const auto energy = [&] {
      const auto state = fixture.world().state(id);
      return moments.dot((state.orientation.conjugate() * state.angular_velocity).cwiseAbs2());
    };
    const double before = energy();
    fixture.run(1.0);
    EXPECT_NEAR(energy() / before, 1.0, 0.01);
    EXPECT_LT(fixture.velocity(id).norm(), 1e-4F);
  }
}

// Balls that fly over the edges of cells, however near, keep their velocity; a wall of cells stops them.
enum class Rows { kRectangular, kTurned, kShifted };  // every second row: by 90°, by half a pitch

class FastBallsOverCells : public FastBodies {
 protected:
  void lay_out(Rows rows) {
    auto& field = fixture.cells().field();
    for (int row = 0; row < field.rows && rows != Rows::kRectangular; ++row)
      for (int column = 0; column < field.columns; ++column) {
        const bool is_second = row % 2 == 1;
        field.x.push_back(static_cast<float>(column) + (is_second && rows == Rows::kShifted ? 0.5F : 0.0F));
        field.y.push_back(static_cast<float>(field.rows - 1 - row));
        field.angle.push_back(is_second && rows == Rows::kTurned ? 1.5707963F : 0.0F);
      }
  }
  void restart_on_cells(Draw& draw, Rows rows) {
    restart(0.0);
    scene::SurfaceSpec& s = fixture.scene.surface;
    s.pin.max_speed = s.pin.max_acceleration = 1e6;
    s.pin.top_x = s.pin.top_y = draw.uniform(0.1, 0.95);
    std::vector<float> heights;
    for (int i = 0; i < s.rows * s.columns; ++i)
      heights.push_back(static_cast<float>(draw.uniform(0, kHighest)) * (i % s.columns < kWall));
    for (int row = 0; row < s.rows; ++row)
      for (int column = kWall; column < s.columns; ++column) heights[row * s.columns + column] = 6.0F;
    lay_out(rows);
    fixture.cells().set_targets(0, heights);
    fixture.run(0.1);
  }
  static constexpr double kHighest = 1.0;
  static constexpr int kWall = 24;  // first column of it
};
INSTANTIATE_TEST_SUITE_P(Steps, FastBallsOverCells, testing::Values(1.0 / 60, 1.0 / 240, 1.0 / 960));

TEST_P(FastBallsOverCells, PassEdgesAndMeetWalls) {
  const char* const seed = std::getenv("FAST_BALLS_SEED");
  Draw draw(seed ? std::atoi(seed) : 31);
  for (int i = 0; i < 90; ++i) {
    SCOPED_TRACE(i);
    const Rows rows = std::array{Rows::kRectangular, Rows::kTurned, Rows::kShifted}[i % 3];
    restart_on_cells(draw, rows);
    // Of two planes in a quadrant that a ball meets in a step, as in the notches of shifted rows, one is
    // kept.
    const double farthest = rows == Rows::kShifted ? 0.5 : 1.0,
                 speed = draw.log_uniform(5, std::min(200.0, farthest / GetParam())),
                 top = fixture.scene.surface.pin.top_x, gap = 1.0 - top;
    const double radius = std::max(draw.log_uniform(0.05, 1.0), gap);  // the wall holds it back
    const double face = kWall - 0.5 * top, dip = radius - std::sqrt(radius * radius - gap * gap / 4),
                 recess = rows == Rows::kShifted ? 0.5 : 0.0;  // of the wall, in every second row
    auto ball = sphere(radius, {3, draw.uniform(8, 24), kHighest + radius + draw.log_uniform(0.001, 0.5)});
    const Vector3d velocity = speed * Vector3d{1, draw.uniform(-0.2, 0.2), draw.uniform(0, 0.05)};
    ball.velocity = velocity;
    const auto id = fixture.add(ball);
    bool has_met = false;
    fixture.run(1.2 * (face + recess) / speed, [&] {
      const double x = static_cast<double>(fixture.position(id).x());
      ASSERT_LT(x, face + recess - radius + dip + 0.05);
      has_met |= x + radius + 1.1 * speed * GetParam() > face;
      if (!has_met) {
        ASSERT_LT((fixture.velocity(id).cast<double>() - velocity).norm(), 1e-5 * speed);
      }
    });
    EXPECT_TRUE(has_met);
  }
}

TEST(FastBodiesSleep, WakeWhatTheyHit) {
  for (const double dt_s : {1.0 / 60, 1.0 / 240}) {
    PhysicsFixture fixture;
    fixture.scene.world.dt_s = dt_s;
    const auto resting = fixture.add(box({1, 1, 1}, {20, 15, 0.5}));
    fixture.run(2.0);
    ASSERT_EQ(fixture.world().sleeping_count(), 1);
    auto bullet = sphere(0.1, {10, 15, 0.6});
    bullet.velocity = {150, 0, 0}, bullet.mass = 1.0;
    const auto id = fixture.add(bullet);
    fixture.run(0.2);
    EXPECT_LT(fixture.position(id).x(), fixture.position(resting).x());
    EXPECT_GT(fixture.position(resting).x(), 20.1F);
  }
}
