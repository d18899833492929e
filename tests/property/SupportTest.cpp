// A flat object loads all the cells that it covers, and each cell rubs with its own load, whether or not the
// cells have a force limit that they do not reach.
#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <numeric>
#include <random>
#include <utility>
#include <vector>

#include "tests/property/PhysicsFixture.h"

using namespace physics_fixture;
using namespace smartsurf;

namespace {

constexpr double kFriction = 0.5;

// The parameter is the force limit of the cells, 0 for none.
class Support : public testing::TestWithParam<double> {};
struct SupportFixture : PhysicsFixture {
  SupportFixture() { cell_force_limit = Support::GetParam(); }
};

double load_on(PhysicsFixture& fixture, int row, int column) {
  const auto& field = fixture.cells().field();
  return static_cast<double>(field.impulse[static_cast<std::size_t>(field.index(row, column))]) /
         fixture.scene.world.dt_s;
}

// The least impulse that counts as load: a contact of no load keeps some rounding.
float least_load(PhysicsFixture& fixture) {
  const auto& impulse = fixture.cells().field().impulse;
  return 1e-5F * std::accumulate(impulse.begin(), impulse.end(), 0.0F);
}

int loaded_cells(PhysicsFixture& fixture) {
  const auto& impulse = fixture.cells().field().impulse;
  const float least = least_load(fixture);
  return static_cast<int>(
      std::count_if(impulse.begin(), impulse.end(), [least](float i) { return i > least; }));
}

// All loaded cells bear the same share of the weight.
void expect_equal_loads(PhysicsFixture& fixture, int cells, double weight, double tolerance = 0.01) {
  EXPECT_EQ(loaded_cells(fixture), cells);
  const float least = least_load(fixture);
  for (const float impulse : fixture.cells().field().impulse)
    if (impulse > least) {
      EXPECT_NEAR(static_cast<double>(impulse) / fixture.scene.world.dt_s, weight / cells,
                  tolerance * weight / cells);
    }
}

// Cells (r, c) with x = c and y = 31 − r move with a surface velocity.
template <class Speed>
void drive(PhysicsFixture& fixture, Speed speed) {
  auto& field = fixture.cells().field();
  field.surface_velocity_x.assign(field.height.size(), 0.0F);
  field.surface_velocity_y = field.surface_velocity_x;
  for (int r = 0; r < 32; ++r)
    for (int c = 0; c < 32; ++c)
      field.surface_velocity_x[static_cast<std::size_t>(field.index(r, c))] =
          static_cast<float>(speed(c, 31 - r));
}

// Acceleration of a 7×7 plate at (15, 15) on cells of which some drive at 5 u/s, u/s².
template <class Driven>
double plate_acceleration(Driven driven) {
  SupportFixture fixture;
  const auto id = fixture.add(box({7, 7, 1}, {15, 15, 0.5}));
  fixture.run(0.2);
  drive(fixture, [&](int x, int y) {
    return std::max(std::abs(x - 15), std::abs(y - 15)) <= 3 && driven(x - 15, y - 15) ? 5.0 : 0.0;
  });
  const double duration_s = 0.5;
  fixture.run(duration_s);
  EXPECT_LT(std::abs(fixture.velocity(id).y()), 2e-3);
  return static_cast<double>(fixture.velocity(id).x()) / duration_s;
}

}  // namespace

TEST_P(Support, BoxLoadsAllItsCellsEqually) {
  SupportFixture fixture;
  fixture.add(box({5, 5, 1}, {15, 15, 0.5}));
  fixture.run(0.3);
  expect_equal_loads(fixture, 25, 25 * kGravity);
  // Asleep, and in the tick of falling asleep.
  fixture.run(1.0, [&] { ASSERT_NEAR(fixture.total_load(), 25 * kGravity, 0.01 * 25 * kGravity); });
  EXPECT_EQ(fixture.world().sleeping_count(), 1);
  expect_equal_loads(fixture, 25, 25 * kGravity);
}

TEST_P(Support, SmallBoxesLoadTheirCellsEqually) {
  for (const auto& [size_x, size_y] : {std::pair{2.0, 2.0}, {2.0, 1.0}, {5.0, 1.0}, {1.0, 3.0}, {2.0, 4.0}}) {
    SupportFixture fixture;
    const double x = 15 + 0.5 * (size_x - 1), y = 15 + 0.5 * (size_y - 1);
    fixture.add(box({size_x, size_y, 1}, {x, y, 0.5}));
    fixture.run(0.3);
    expect_equal_loads(fixture, static_cast<int>(size_x * size_y), size_x * size_y * kGravity);
  }
}

TEST_P(Support, LargePlatesLoadAllTheirCells) {
  // On a plateau of its own size every cell at its edge, and on every second cell each cell, has contact
  // points of its own: many more than a manifold's candidates.
  for (const auto& [size, every] : {std::pair{16, 1}, {20, 1}, {16, 2}, {20, 2}}) {
    SupportFixture fixture;
    for (int r = 0; r < 32; ++r)
      for (int c = 0; c < 32; ++c)
        if (c >= 4 && c < 4 + size && 31 - r >= 4 && 31 - r < 4 + size && (c + 31 - r) % every == 0)
          fixture.cells().set_target(0, r, c, 1.0F);
    fixture.run(1.0);
    const double centre = 4 + 0.5 * (size - 1);
    const auto id = fixture.add(box({1.0 * size, 1.0 * size, 1}, {centre, centre, 1.5}));
    fixture.run(0.4);
    EXPECT_NEAR(fixture.position(id).z(), 1.5, 2e-3) << size;
    EXPECT_LT(
        std::abs(fixture.snapshot().orientation[id][0]) + std::abs(fixture.snapshot().orientation[id][1]),
        2e-4);
    expect_equal_loads(fixture, size * size / every, size * size * kGravity);
  }
}

TEST_P(Support, LoadsAreLinearUnderAnOffCentreWeight) {
  // A force F at x = 1 on a 5×5 box: N = (W + F)/25 + F·x/Σx², with Σx² = 50.
  SupportFixture fixture;
  const auto id = fixture.add(box({5, 5, 1}, {15, 15, 0.5}));
  const double weight = 25 * kGravity, force = 50;
  fixture.world().apply_force(id, {0, 0, -force}, Eigen::Vector3d(16, 15, 1), 10.0);
  fixture.run(0.4);
  for (int r = 0; r < 5; ++r)
    for (int c = 0; c < 5; ++c) {
      const double expected = (weight + force) / 25 + force * (c - 2) / 50;
      EXPECT_NEAR(load_on(fixture, 31 - 13 - r, 13 + c), expected, 0.01 * expected);
    }
}

TEST_P(Support, UnloadedCellsBearNothing) {
  // Near the edge the load is a wedge: N = max(0, a + b·x) on columns −2 … 2, with its centre at x = 1.5:
  // the last three columns bear N·(1/12, 4/12, 7/12), since (0·1 + 1·4 + 2·7)/12 = 1.5.
  SupportFixture fixture;
  const auto id = fixture.add(box({5, 5, 1}, {15, 15, 0.5}));
  const double weight = 25 * kGravity, force = 3 * weight;
  fixture.world().apply_force(id, {0, 0, -force}, Eigen::Vector3d(17, 15, 1), 10.0);
  fixture.run(0.4);
  const double total = weight + force;
  for (int r = 0; r < 5; ++r)
    for (int c = 0; c < 5; ++c) {
      const double share = c < 2 ? 0.0 : (3.0 * (c - 2) + 1) / 12;
      EXPECT_NEAR(load_on(fixture, 31 - 13 - r, 13 + c), total * share / 5, 0.01 * total / 15) << c;
    }
}

TEST_P(Support, TippingBoxLoadsTheCellsAtItsEdge) {
  SupportFixture fixture;
  const auto id = fixture.add(box({5, 5, 1}, {15, 15, 0.5}));
  // The centre of the load lies beyond the outermost cells' centres, the box is about to tip.
  const double weight = 25 * kGravity, force = 20 * weight;
  fixture.world().apply_force(id, {0, 0, -force}, Eigen::Vector3d(17.4, 15, 1), 10.0);
  fixture.run(0.2);
  for (int r = 0; r < 5; ++r) {
    EXPECT_NEAR(load_on(fixture, 31 - 13 - r, 17), (weight + force) / 5, 0.02 * (weight + force) / 5);
    for (int c = 0; c < 4; ++c) EXPECT_NEAR(load_on(fixture, 31 - 13 - r, 13 + c), 0, 0.01 * force) << c;
  }
}

TEST_P(Support, LowerCellsBearNothing) {
  // Every second cell is 0.05 u lower: 13 of 25 bear.
  SupportFixture fixture;
  for (int r = 0; r < 32; ++r)
    for (int c = 0; c < 32; ++c) fixture.cells().set_target(0, r, c, (31 - r + c) % 2 == 0 ? 1.0F : 0.95F);
  fixture.run(1.0);
  fixture.add(box({5, 5, 1}, {15, 15, 1.5}));
  fixture.run(0.4);
  EXPECT_NEAR(fixture.total_load(), 25 * kGravity, 0.01 * 25 * kGravity);
  expect_equal_loads(fixture, 13, 25 * kGravity);
}

// The same block: as a box, upside down, as a hull, upside down, and as two hulls side by side.
constexpr int kWays = 5;
bool is_upside_down(int way) { return way % 2 == 1; }
scene::ObjectSpec block(const Eigen::Vector3d& size, int way) {
  const Eigen::Vector3d half(size.x() / 2, size.y(), size.z()), aside(size.x() / 4, 0, 0);
  scene::ObjectSpec o = way < 2   ? box(size, {})
                        : way < 4 ? compound({{size, {0, 0, 0}}})
                                  : compound({{half, -aside}, {half, aside}});
  o.mass = size.prod();
  const Eigen::Vector3d squares = size.cwiseAbs2();
  o.inertia =
      Eigen::Matrix3d((*o.mass / 12 * (Eigen::Vector3d::Constant(squares.sum()) - squares)).asDiagonal());
  return o;
}

// How a block lies on pins of random heights: the pose, and by cell the load, of the weight, and the distance
// from the nearest corner of the top to the plane of the underside, u.
struct Rest {
  Eigen::Vector3f position, up;
  std::vector<double> loads, gaps;
};
Rest rest_on_random_bed(unsigned seed, int way) {
  std::mt19937 random(seed);
  const auto draw = [&](double from, double to) { return std::uniform_real_distribution(from, to)(random); };
  SupportFixture fixture;
  fixture.scene.world.dt_s = std::array{1.0 / 60, 1.0 / 240, 1.0 / 960}[seed % 3];
  std::vector<float> heights(32 * 32);
  for (float& h : heights) h = static_cast<float>(draw(0.9, 1.1));
  fixture.cells().set_targets(0, heights);
  fixture.run(1.0);
  const double length = draw(2, 6), width = draw(2, 6), height = draw(0.5, 2);
  const double x = draw(14.5, 15.5), y = draw(14.5, 15.5), yaw = draw(0, 1.5);
  scene::ObjectSpec o = block({length, width, height}, way);
  o.position = {x, y, 1.15 + 0.5 * height};
  o.orientation = Eigen::AngleAxisd(yaw, Eigen::Vector3d::UnitZ()) *
                  Eigen::AngleAxisd(is_upside_down(way) ? M_PI : 0.0, Eigen::Vector3d::UnitX());
  const auto id = fixture.add(o);
  fixture.run(10.0);
  Rest rest;
  rest.position = fixture.position(id);
  const auto& q = fixture.snapshot().orientation[id];
  rest.up = Eigen::Quaternionf(q[3], q[0], q[1], q[2]) * Eigen::Vector3f(0, 0, is_upside_down(way) ? -1 : 1);
  const Eigen::Vector3d centre = rest.position.cast<double>(), up = rest.up.cast<double>();
  const auto underside = [&](double at_x, double at_y) {
    return centre.z() - (0.5 * height + (at_x - centre.x()) * up.x() + (at_y - centre.y()) * up.y()) / up.z();
  };
  for (int r = 0; r < 32; ++r)
    for (int c = 0; c < 32; ++c) {
      rest.loads.push_back(load_on(fixture, r, c) / (*o.mass * kGravity));
      double lowest = underside(c, 31 - r);
      for (const auto& [dx, dy] : {std::pair{-0.4, -0.4}, {-0.4, 0.4}, {0.4, -0.4}, {0.4, 0.4}})
        lowest = std::min(lowest, underside(c + dx, 31 - r + dy));
      rest.gaps.push_back(lowest - static_cast<double>(heights[rest.gaps.size()]));
    }
  return rest;
}

TEST_P(Support, UnevenCellsBearWhereTheyTouch) {
  // Some lie on the edges of tops, whose normals are oblique: friction bears a part.
  int on_edges = 0, loaded_otherwise = 0;
  for (unsigned seed = 1; seed <= 24; ++seed) {
    const Rest of_box = rest_on_random_bed(seed, 0);
    for (int way = 0; way < kWays; ++way) {
      const Rest rest = way == 0 ? of_box : rest_on_random_bed(seed, way);
      const double sum = std::accumulate(rest.loads.begin(), rest.loads.end(), 0.0);
      on_edges += std::abs(sum - 1) > 0.01 ? 1 : 0;
      for (std::size_t i = 0; i < rest.loads.size(); ++i)
        if (rest.gaps[i] > 2.5e-3) {
          EXPECT_LT(rest.loads[i], 0.005) << "seed " << seed << ", way " << way << ", gap " << rest.gaps[i];
        }
      const bool lies_as_box =
          (rest.position - of_box.position).norm() < 5e-4F && (rest.up - of_box.up).norm() < 5e-4F;
      const auto is_near = [](double a, double b) { return std::abs(a - b) <= 0.1; };
      loaded_otherwise += lies_as_box && !std::ranges::equal(rest.loads, of_box.loads, is_near) ? 1 : 0;
    }
  }
  EXPECT_LE(on_edges, 5);
  EXPECT_LE(loaded_otherwise, 3);
}

// A plate rests on three level cells, of one of which it covers a sliver. Four of the points where it touches
// them do not carry it, and loads that grow linearly over the covered areas do not balance it.
TEST_P(Support, SliversOfCellsBear) {
  for (const double sliver : {0.02, 0.005, 0.001}) {
    SupportFixture fixture;
    fixture.scene.world.sleep = false;
    for (int r = 0; r < 32; ++r)
      for (int c = 0; c < 32; ++c) {
        const int x = c, y = 31 - r;
        const bool is_high = (y == 15 && (x == 13 || x == 17)) || (y == 16 && x == 16);
        fixture.cells().set_target(0, r, c, is_high ? 1.0F : 0.9F);
      }
    fixture.run(1.0);
    const double half_top = static_cast<double>(fixture.cells().field().half_top_x);
    const double left = 13 + half_top - sliver, right = 17 + half_top, weight = (right - left) * 2 * kGravity;
    const Eigen::Vector3d at(0.5 * (left + right), 14.8, 1.5);
    const auto id = fixture.add(box({right - left, 2, 1}, at));
    fixture.run(2.0);
    EXPECT_LT((fixture.position(id).cast<double>() - at).norm(), 2e-3) << sliver;
    EXPECT_LT(fixture.velocity(id).norm() + fixture.angular_velocity(id).norm(), 2e-3F) << sliver;
    double load = 0.0, moment_x = 0.0, moment_y = 0.0;
    for (int r = 0; r < 32; ++r)
      for (int c = 0; c < 32; ++c) {
        const double of_cell = load_on(fixture, r, c);
        load += of_cell, moment_x += of_cell * (c - at.x()), moment_y += of_cell * (31 - r - at.y());
      }
    EXPECT_NEAR(load, weight, 0.01 * weight) << sliver;
    EXPECT_LT(std::abs(moment_x), half_top * weight) << sliver;
    EXPECT_LT(std::abs(moment_y), half_top * weight) << sliver;
  }
}

TEST_P(Support, CylindersHullsAndSolidsLoadAllTheirCells) {
  const Eigen::AngleAxisd lying(M_PI / 2, Eigen::Vector3d::UnitY());
  {
    // On its side along x: six cells in a line.
    SupportFixture fixture;
    auto object = cylinder(0.9, 6, {15.5, 15, 0.9});
    object.orientation = lying;
    fixture.add(object);
    fixture.run(0.3);
    expect_equal_loads(fixture, 6, M_PI * 0.81 * 6 * kGravity);
  }
  {
    SupportFixture fixture;
    auto object = capsule(0.9, 6.8, {15, 15, 0.9});  // a straight part of 5
    object.orientation = lying;
    fixture.add(object);
    fixture.run(0.3);
    expect_equal_loads(fixture, 5, fixture.total_load());
  }
  {
    // On its flat: the 9 cells that it covers fully bear alike, the others by the area that they share with
    // the disc.
    SupportFixture fixture;
    const double radius = 2.25;
    fixture.add(cylinder(radius, 1, {15, 15, 0.5}));
    fixture.run(0.3);
    double area = 0, shared[5][5] = {};
    constexpr int kSamples = 100;
    for (int r = 0; r < 5; ++r)
      for (int c = 0; c < 5; ++c) {
        for (int i = 0; i < kSamples * kSamples; ++i) {
          const double x = c - 2 + 0.8 * ((i % kSamples + 0.5) / kSamples - 0.5),
                       y = r - 2 + 0.8 * ((i / kSamples + 0.5) / kSamples - 0.5);
          if (x * x + y * y < radius * radius) shared[r][c] += 0.64 / (kSamples * kSamples);
        }
        area += shared[r][c];
      }
    const double pressure = M_PI * radius * radius * kGravity / area;
    for (int r = 0; r < 5; ++r)
      for (int c = 0; c < 5; ++c)
        EXPECT_NEAR(load_on(fixture, 31 - 13 - r, 13 + c), pressure * shared[r][c], 0.02 * pressure * 0.64);
  }
  {
    SupportFixture fixture;
    fixture.add(cube({15, 15, 2.5}, 5.0F));
    fixture.run(0.3);
    expect_equal_loads(fixture, 25, 125 * kGravity);
  }
  {
    // Two legs, each over two cells.
    SupportFixture fixture;
    auto object = cube({15, 15, 1});
    auto solid = std::make_shared<scene::Solid>(*object.solid);
    solid->hulls.push_back(solid->hulls[0]);
    for (std::size_t i = 0; i < 2; ++i) {
      scene::ConvexHull& hull = solid->hulls[i];
      for (auto& v : hull.vertices) v.x() = 0.5F * v.x() + (i == 0 ? -2.0F : 2.0F);
      for (std::size_t f = 0; f < hull.faces.size(); ++f)
        hull.faces[f].offset =
            hull.faces[f].normal.dot(hull.vertices[hull.face_vertices[hull.faces[f].first_vertex]]);
      hull.bounds_min.x() = i == 0 ? -2.5F : 1.5F, hull.bounds_max.x() = i == 0 ? -1.5F : 2.5F;
    }
    solid->bounds_min.x() = -2.5F, solid->bounds_max.x() = 2.5F;
    solid->bounding_radius = 3.0F;
    solid->vertices = solid->hulls[0].vertices;
    solid->vertices.insert(solid->vertices.end(), solid->hulls[1].vertices.begin(),
                           solid->hulls[1].vertices.end());
    object.solid = solid;
    object.position = {15, 15.5, 1};
    fixture.add(object);
    fixture.run(0.3);
    expect_equal_loads(fixture, 4, fixture.total_load());
  }
}

TEST_P(Support, FreeLayoutsShareTheLoadToo) {
  // Cells turned by 30° about their centres, which a box turned alike covers.
  SupportFixture fixture;
  auto& field = fixture.cells().field();
  const auto angle = static_cast<float>(M_PI / 6);
  for (int i = 0; i < field.cells(); ++i) {
    const float x = static_cast<float>(i % 32) - 15, y = 16.0F - static_cast<float>(i / 32);
    field.x.push_back(15 + std::cos(angle) * x - std::sin(angle) * y);
    field.y.push_back(15 + std::sin(angle) * x + std::cos(angle) * y);
    field.angle.push_back(angle);
  }
  auto object = box({4.9, 2.9, 1}, {15, 15, 0.5});
  object.orientation = Eigen::AngleAxisd(M_PI / 6, Eigen::Vector3d::UnitZ());
  const auto id = fixture.add(object);
  fixture.run(0.3);
  expect_equal_loads(fixture, 15, 4.9 * 2.9 * kGravity);
  EXPECT_NEAR((fixture.position(id) - Eigen::Vector3f(15, 15, 0.5F)).norm(), 0, 2e-3);
}

TEST_P(Support, ContactsListEachLoadedCell) {
  SupportFixture fixture;
  const auto id = fixture.add(box({5, 5, 1}, {15, 15, 0.5}));
  for (const double duration_s : {0.3, 1.0}) {  // awake, asleep
    fixture.run(duration_s);
    const auto contacts = fixture.world().contacts();
    ASSERT_EQ(contacts.size(), 25U);
    for (const auto& c : contacts) {
      EXPECT_EQ(c.object, id);
      EXPECT_NEAR(static_cast<double>(c.impulse) / fixture.scene.world.dt_s, kGravity, 0.01 * kGravity);
      EXPECT_NEAR(c.point.x(), std::round(c.point.x()), 1e-3);
      EXPECT_NEAR(c.point.z(), 0, 3e-3);
    }
  }
}

TEST_P(Support, PressureOnASlopeIsTheNormalPartOfTheWeight) {
  for (const double angle : {0.1, 0.3, 0.45}) {
    SupportFixture fixture;
    fixture.scene.world.gravity = {kGravity * std::sin(angle), 0, -kGravity * std::cos(angle)};
    const auto id = fixture.add(box({5, 5, 1}, {15, 15, 0.5}));
    fixture.run(1.5);
    EXPECT_LT((fixture.position(id) - Eigen::Vector3f(15, 15, 0.5F)).norm(), 3e-3F) << angle;
    const double normal = 25 * kGravity * std::cos(angle);
    EXPECT_NEAR(fixture.total_load(), normal, 1e-3 * normal) << angle;
    // The friction's moment about the centre of mass, W·sin·½, tilts the load: N = (W/25)·(cos + sin·½·x/2).
    for (int c = 0; c < 5; ++c) {
      const double expected = kGravity * (std::cos(angle) + std::sin(angle) * 0.5 * (c - 2) / 2);
      EXPECT_NEAR(load_on(fixture, 31 - 15, 13 + c), expected, 0.01 * expected) << angle << ' ' << c;
    }
  }
}

TEST_P(Support, SpinningBoxSlowsByTheFrictionOfEachCell) {
  // Σ µ·N·r / I; over a turn the cells' mean distance is that of a uniform pressure, 0.3826 of the edge.
  SupportFixture fixture;
  auto object = box({5, 5, 1}, {15, 15, 0.5});
  object.angular_velocity = {0, 0, 10};
  const auto id = fixture.add(object);
  fixture.run(2.0);
  const double expected = kFriction * kGravity * 0.3826 * 5 * 6 / 25;  // 2.25 rad/s²
  EXPECT_NEAR((10.0 - static_cast<double>(fixture.angular_velocity(id).z())) / 2.0, expected,
              0.03 * expected);
}

TEST_P(Support, SpinningBoxSlidesInACurve) {
  // Sliding moves the centre of the load forward by µ times the height of the centre of mass. The front then
  // rubs more than the rear, which deflects a spinning box. The reference integrates a linear pressure over
  // the face.
  const Eigen::Vector2d size(3, 2);
  const double height = 0.8, mass = size.prod() * height, inertia = mass * size.squaredNorm() / 12;
  SupportFixture fixture;
  fixture.scene.surface.pin.top_x = fixture.scene.surface.pin.top_y = 1.0;
  auto object = box({size.x(), size.y(), height}, {10, 10, height / 2});
  object.velocity = {3.5, 2, 0};
  object.angular_velocity = {0, 0, 3};
  const auto id = fixture.add(object);
  fixture.run(2.0);

  Eigen::Vector2d at(10, 10), v(3.5, 2);
  double angle = 0, spin = 3;
  constexpr int kPoints = 10;
  constexpr double kStep = 2e-3;
  for (double t = 0; t < 2.0 && v.norm() > 0.01; t += kStep) {
    const Eigen::Rotation2Dd turn(angle);
    const Eigen::Vector2d along = v.normalized();
    double squares = 0;
    for (const bool sum : {false, true}) {
      Eigen::Vector2d force(0, 0);
      double torque = 0;
      for (int i = 0; i < kPoints * kPoints; ++i) {
        const Eigen::Vector2d unit((i % kPoints + 0.5) / kPoints - 0.5, (i / kPoints + 0.5) / kPoints - 0.5);
        const Eigen::Vector2d r = turn * unit.cwiseProduct(size);
        const double ahead = r.dot(along);
        if (!sum) {
          squares += ahead * ahead / (kPoints * kPoints);
          continue;
        }
        const double load =
            mass * kGravity / (kPoints * kPoints) * (1 + kFriction * height / 2 / squares * ahead);
        const Eigen::Vector2d slip = v + spin * Eigen::Vector2d(-r.y(), r.x());
        const Eigen::Vector2d f = -kFriction * load * slip / std::max(1e-9, slip.norm());
        force += f;
        torque += r.x() * f.y() - r.y() * f.x();
      }
      if (!sum) continue;
      v += kStep / mass * force;
      spin += kStep / inertia * torque;
    }
    at += kStep * v;
    angle += kStep * spin;
  }
  const Eigen::Vector2d ours = fixture.position(id).cast<double>().head<2>();
  EXPECT_LT((ours - at).norm(), 0.05 * (at - Eigen::Vector2d(10, 10)).norm())
      << ours.transpose() << " | " << at.transpose();
}

TEST_P(Support, PlateFollowsTheMajorityOfItsCells) {
  const double full = kFriction * kGravity / 49;
  // 25 inner cells drive, 24 hold; the rim drives, 25 hold; 28 of 49 drive.
  EXPECT_NEAR(plate_acceleration([](int x, int y) { return std::max(std::abs(x), std::abs(y)) <= 2; }), full,
              0.03 * full);
  EXPECT_NEAR(plate_acceleration([](int x, int y) { return std::max(std::abs(x), std::abs(y)) == 3; }), 0,
              0.01 * full);
  EXPECT_NEAR(plate_acceleration([](int, int y) { return y % 2 != 0; }), 7 * full, 0.03 * 7 * full);
}

TEST_P(Support, PlateUnderASymmetricDriveMovesUniformly) {
  SupportFixture fixture;
  const auto id = fixture.add(box({7, 7, 1}, {8, 15, 0.5}));
  drive(fixture, [](int, int) { return 2.0; });
  fixture.run(3.0);
  // It slips for v/(µ·g) and moves half as far as the cells in that time.
  EXPECT_NEAR(fixture.velocity(id).x(), 2.0, 1e-3);
  EXPECT_NEAR(fixture.position(id).x(), 8 + 2.0 * (3.0 - 0.5 * 2.0 / (kFriction * kGravity)), 0.02);
  EXPECT_NEAR(fixture.position(id).y(), 15, 1e-3);
  EXPECT_NEAR(fixture.angular_velocity(id).norm(), 0, 2e-3);
}

TEST_P(Support, SlidingPlateStopsWhereCoulombSays) {
  for (const double course : {0.0, 0.6}) {
    SupportFixture fixture;
    auto object = box({5, 5, 1}, {8, 8, 0.5});
    object.velocity = 6 * Eigen::Vector3d(std::cos(course), std::sin(course), 0);
    const auto id = fixture.add(object);
    fixture.run(2.0);
    const double distance = (fixture.position(id).cast<double>() - object.position).head<2>().norm();
    EXPECT_NEAR(distance, 36 / (2 * kFriction * kGravity), 0.01 * 3.67) << course;
  }
}

TEST_P(Support, SlopesSlideFromTheAngleOfFriction) {
  for (const double offset : {-0.1, 0.1}) {
    SupportFixture fixture;
    const double angle = std::atan(kFriction) + offset * M_PI / 180;
    fixture.scene.world.gravity = {kGravity * std::sin(angle), 0, -kGravity * std::cos(angle)};
    const auto id = fixture.add(box({5, 5, 1}, {8, 15, 0.5}));
    fixture.run(2.0);
    const double moved = static_cast<double>(fixture.position(id).x()) - 8;
    const double free = 0.5 * kGravity * (std::sin(angle) - kFriction * std::cos(angle)) * 4;
    if (offset < 0)
      EXPECT_NEAR(moved, 0, 1e-3);
    else
      EXPECT_NEAR(moved, free, 0.1 * free);
  }
}

TEST_P(Support, TurningCellsTurnAPlate) {
  // Every cell turns: it drags the plate about its own centre, and the neighbours' torques add up.
  SupportFixture fixture;
  auto& field = fixture.cells().field();
  field.surface_velocity_x.assign(field.height.size(), 0.0F);
  field.surface_velocity_y = field.surface_velocity_x;
  field.surface_spin.assign(field.height.size(), 3.0F);
  const auto id = fixture.add(box({5, 5, 1}, {15, 15, 0.5}));
  fixture.run(0.5);
  EXPECT_GT(fixture.angular_velocity(id).z(), 0.05F);
  EXPECT_NEAR((fixture.position(id) - Eigen::Vector3f(15, 15, 0.5F)).norm(), 0, 5e-3);
}

TEST_P(Support, SameBitsForAnyNumberOfThreads) {
  std::uint64_t hashes[2];
  for (const int threads : {1, 3}) {
    SupportFixture fixture;
    fixture.threads = threads;
    drive(fixture, [](int x, int y) { return ((x / 5) + (y / 7)) % 2 ? 3.0 : -2.0; });
    for (int i = 0; i < 600; ++i) {
      auto object =
          i % 3 == 0 ? cylinder(0.6, 0.4, {0, 0, 0}) : box({1.2 + 0.01 * (i % 50), 1.1, 0.4}, {0, 0, 0});
      object.position = {1.0 + 1.4 * (i % 21), 1.0 + 1.4 * ((i / 21) % 21), 0.21 + 0.5 * (i / 441)};
      fixture.add(object);
    }
    fixture.run(0.4);
    hashes[threads == 1 ? 0 : 1] = fixture.snapshot().state_hash;
  }
  EXPECT_EQ(hashes[0], hashes[1]);
}

// Bodies tumble on level cells without friction: those that a blow reaches bear what it gives the body,
// whether or not its face lies on them, and where it does.
TEST(SupportLoads, AreTheMomentumThatABodyGains) {
  for (const double dt_s : {1.0 / 60.0, 1.0 / 240.0}) {
    SCOPED_TRACE(testing::Message() << "step " << dt_s);
    for_random_fixtures(41, 30, dt_s, [dt_s](PhysicsFixture& fixture, auto draw) {
      const Eigen::Vector3d at(draw(14, 17), draw(14, 17), 3);
      const std::array shapes{box({2, 1.5, 1}, at), capsule(0.6, 2, at), cone(1, 1.5, at),
                              cylinder(0.9, 0.8, at), wedge(at)};
      auto object = shapes[static_cast<std::size_t>(draw(0, 5))];
      object.orientation =
          Eigen::AngleAxisd(draw(0, 3), Eigen::Vector3d(draw(-1, 1), draw(-1, 1), draw(-1, 1)).normalized());
      object.mass = 3.0;
      object.inertia = Eigen::Matrix3d::Identity();  // then the angular momentum is the angular velocity
      fixture.scene.materials[0].restitution = draw(0, 1) < 0.3 ? 0.0 : 0.2;
      fixture.scene.materials[0].friction = 0.0;
      const auto id = fixture.add(object);
      Eigen::Vector3f before(0, 0, 0), spin_before(0, 0, 0), position = fixture.position(id);
      fixture.run(1.5, [&] {
        const auto& field = fixture.cells().field();
        double load = 0.0;
        Eigen::Vector2d moment(0, 0);
        for (std::size_t cell = 0; cell < field.impulse.size(); ++cell) {
          if (field.impulse[cell] == 0.0F) continue;
          const double impulse = field.impulse[cell], x = static_cast<double>(cell % 32),
                       y = 31.0 - static_cast<double>(cell / 32);
          load += impulse;
          moment += impulse * Eigen::Vector2d(y - position.y(), position.x() - x);
        }
        const Eigen::Vector3f velocity = fixture.velocity(id), spin = fixture.angular_velocity(id);
        EXPECT_NEAR(load, *object.mass * (velocity.z() - before.z() + kGravity * dt_s), 3e-3);
        // A load acts anywhere on its cell, and the body moves in the step.
        const Eigen::Vector2d gained = (spin - spin_before).cast<double>().head<2>();
        EXPECT_LT((gained - moment).norm(), 1.2 * load + 3e-3);
        before = velocity, spin_before = spin, position = fixture.position(id);
      });
    });
  }
}

INSTANTIATE_TEST_SUITE_P(CellsWithAndWithoutForceLimit, Support, testing::Values(0.0, 1e5));
