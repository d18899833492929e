#include "smartsurf/scene/UnlikelyPlacements.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <numbers>
#include <random>

namespace smartsurf::scene {
namespace {

ObjectSpec sphere_at(double x, double y, double z, double radius) {
  ObjectSpec o;
  o.shape = ShapeKind::kSphere;
  o.radius = radius;
  o.position = {x, y, z};
  return o;
}

ObjectSpec box_at(const Eigen::Vector3d& position, const Eigen::Vector3d& size) {
  ObjectSpec o;
  o.shape = ShapeKind::kBox;
  o.size = size;
  o.position = position;
  return o;
}

SceneSpec scene_of(std::vector<ObjectSpec> objects) {
  SceneSpec scene;
  scene.surface.rows = scene.surface.columns = 10;
  scene.objects = std::move(objects);
  return scene;
}

bool tells(const SceneSpec& scene, const std::string& text) {
  return std::ranges::any_of(unlikely_placements(scene),
                             [&](const std::string& line) { return line.find(text) != line.npos; });
}

TEST(UnlikelyPlacements, NamesTheFirstOfEachKind) {
  SceneSpec scene = scene_of({sphere_at(4, 4, 3, 1), sphere_at(40, 4, 3, 1), sphere_at(50, 4, 3, 1),
                              sphere_at(4, 4, -20, 1), sphere_at(4, 4, 100, 60)});
  scene.objects[1].label = "lost";
  const std::vector<std::string> lines = unlikely_placements(scene);
  ASSERT_EQ(lines.size(), 3U);
  EXPECT_EQ(lines[0], "object 4 at (4, 4, 100) is larger than the table");
  EXPECT_EQ(lines[1],
            "object 1 'lost' at (40, 4, 3) is beside the table (x -0.5 … 9.5, y -0.5 … 9.5) and will fall; "
            "and 1 more");
  EXPECT_TRUE(lines[2].starts_with("object 3 at (4, 4, -20) is below the cells")) << lines[2];
}

TEST(UnlikelyPlacements, FixedJoinedAndMovingObjectsMayBeAnywhere) {
  SceneSpec scene = scene_of({sphere_at(40, 4, 3, 1), sphere_at(60, 4, 3, 1), sphere_at(80, 4, 3, 1)});
  scene.objects[0].fixed = true;
  scene.objects[1].velocity = {-5, 0, 0};
  JointSpec joint;
  joint.a = 2;
  scene.joints.push_back(joint);
  EXPECT_TRUE(unlikely_placements(scene).empty());
}

// Spheres, and boxes along the axes, against the closed form.
TEST(UnlikelyPlacements, ReportsTheOverlapsAndNoOthers) {
  std::mt19937 random(7);
  std::uniform_real_distribution<double> place(3, 6), size(0.4, 2);
  int overlapping = 0;
  for (int round = 0; round < 4000; ++round) {
    const auto position = [&] { return Eigen::Vector3d(place(random), place(random), place(random)); };
    const Eigen::Vector3d p = position(), q = position();
    const Eigen::Vector3d edges_a(size(random), size(random), size(random)),
        edges_b(size(random), size(random), size(random));
    const double radius = size(random) / 2;
    double depth = 0, smallest = 0;
    std::vector<ObjectSpec> pair;
    const Eigen::Vector3d gap = (p - q).cwiseAbs() - edges_a / 2;
    switch (round % 3) {
      case 0:
        pair = {sphere_at(p.x(), p.y(), p.z(), edges_a.x() / 2), sphere_at(q.x(), q.y(), q.z(), radius)};
        depth = edges_a.x() / 2 + radius - (p - q).norm();
        smallest = std::min(edges_a.x(), 2 * radius);
        break;
      case 1:
        pair = {box_at(p, edges_a), box_at(q, edges_b)};
        depth = -(gap - edges_b / 2).maxCoeff();
        smallest = std::min(edges_a.minCoeff(), edges_b.minCoeff());
        break;
      default:
        pair = {box_at(p, edges_a), sphere_at(q.x(), q.y(), q.z(), radius)};
        depth = gap.maxCoeff() > 0 ? radius - gap.cwiseMax(0).norm() : radius - gap.maxCoeff();
        smallest = std::min(edges_a.minCoeff(), 2 * radius);
    }
    if (std::abs(depth - 0.25 * smallest) < 1e-3) continue;
    overlapping += depth > 0.25 * smallest;
    EXPECT_EQ(tells(scene_of(pair), "is inside object"), depth > 0.25 * smallest)
        << "round " << round << " depth " << depth;
  }
  EXPECT_GT(overlapping, 400);
}

// Spheres at drawn places of a table with a border, against the table's description.
TEST(UnlikelyPlacements, TellsOfCellsBorderAndGaps) {
  std::mt19937 random(5);
  std::uniform_real_distribution<double> place(-0.4, 11.4), height(-3, 8), size(0.02, 1.2);
  int among = 0, walled = 0, small = 0;
  for (int round = 0; round < 2000; ++round) {
    const double x = place(random), y = place(random), z = height(random), radius = size(random);
    SceneSpec scene = scene_of({sphere_at(x, y, z, radius)});
    SurfaceSpec& s = scene.surface;
    s.rows = s.columns = 12;
    s.border_height = 3.0;
    s.pin.top_x = s.pin.top_y = 0.75;
    const double feet = s.pin.min_height - s.pin.length;
    const long column = std::lround(x), row = std::lround(y);
    const bool in_cells = z > feet && z < s.pin.min_height + radius / 2,
               at_border = column == 0 || row == 0 || column == 11 || row == 11,
               in_border = !in_cells && z >= s.pin.min_height && z < 3.0 && at_border;
    EXPECT_EQ(tells(scene, "inside the cells"), in_cells) << x << ' ' << y << ' ' << z;
    EXPECT_EQ(tells(scene, "is inside the border"), in_border) << x << ' ' << y << ' ' << z;
    const bool falls =
        z >= s.pin.min_height && !in_cells && !in_border && 2 * radius < 0.25 * std::numbers::sqrt2;
    EXPECT_EQ(tells(scene, "is smaller than the holes"), falls) << radius;
    among += in_cells, walled += in_border, small += falls;
  }
  EXPECT_GT(among, 100);
  EXPECT_GT(walled, 100);
  EXPECT_GT(small, 50);
}

// A box a share of its edge deep in the lowest cells: of pins with a base, of the default ones with a base,
// or of a lower border.
TEST(UnlikelyPlacements, MeasuresFromTheLowestTop) {
  std::mt19937 random(9);
  std::uniform_real_distribution<double> height(-2, 5), share(0, 0.5);
  for (int round = 0; round < 300; ++round) {
    SceneSpec scene = scene_of({box_at({4, 4, 0}, {2, 2, 1})});
    SurfaceSpec& s = scene.surface;
    double lowest = 0.0;
    if (round % 3 == 0) s.actuators = {make_pin_actuator({.min_height = lowest = height(random)})};
    double least = 9.0;
    for (int i = 0; i < s.cell_count(); ++i) {
      s.base_heights.push_back(static_cast<float>(height(random)));
      least = std::min(least, static_cast<double>(s.base_heights.back()));
    }
    lowest += least;
    if (round % 5 == 0) lowest = *(s.border_height = lowest - 0.5);
    derive_pin_spec(s);
    const double depth = share(random);
    scene.objects[0].position.z() = lowest + 0.5 - depth;
    if (std::abs(depth - 0.25) > 1e-3) {
      EXPECT_EQ(tells(scene, "inside the cells"), depth > 0.25) << depth;
    }
  }
}

TEST(UnlikelyPlacements, TestsConesByABall) {
  ObjectSpec cone = sphere_at(4, 4, 4, 1);
  cone.shape = ShapeKind::kCone;
  cone.height = 2;
  ObjectSpec twin = cone;
  twin.position.x() += 0.2;
  EXPECT_TRUE(tells(scene_of({cone, twin}), "is inside object"));
  twin.position.x() += 1.7;
  EXPECT_FALSE(tells(scene_of({cone, twin}), "is inside object"));
}

// Turned together, two boxes overlap as before.
TEST(UnlikelyPlacements, DoNotDependOnTheAxes) {
  std::mt19937 random(11);
  std::uniform_real_distribution<double> shift(-1, 1), size(0.4, 1.5);
  for (int round = 0; round < 1000; ++round) {
    const Eigen::Vector3d p(4, 4, 4), offset(shift(random), shift(random), shift(random));
    ObjectSpec a = box_at(p, {size(random), size(random), size(random)}),
               b = box_at(p + offset, {size(random), size(random), size(random)});
    const double depth = -((offset.cwiseAbs() - a.size / 2) - b.size / 2).maxCoeff(),
                 least = std::min(a.size.minCoeff(), b.size.minCoeff());
    if (std::abs(depth - 0.25 * least) < 1e-3) continue;
    const Eigen::Quaterniond turn =
        Eigen::Quaterniond(shift(random), shift(random), shift(random), 1.5 + shift(random)).normalized();
    a.orientation = b.orientation = turn;
    b.position = p + turn * offset;
    EXPECT_EQ(tells(scene_of({a, b}), "is inside object"), depth > 0.25 * least) << round;
  }
}

}  // namespace
}  // namespace smartsurf::scene
