// The workload of the physics benchmarks: n x n pins that move as a travelling wave under k objects within
// walls.
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <memory>
#include <random>
#include <string>
#include <vector>

#include "smartsurf/mesh/SolidBuilder.h"
#include "smartsurf/scene/SceneSpec.h"

namespace pin_scene {

enum class Shapes { kSpheres, kHalfMixed, kBoxes };
// kFalling: still pins, and objects spread over the whole table, in the air while they are measured.
// kHeap: still pins, and objects of half the size that fall into a heap while they are measured.
// kTowers: still pins, and objects that are dropped onto each other in towers while they are measured.
// kAsleep: the same, measured when all sleep. kBeside: the same beside a fenced strip of pins that move as a
// wave under the first of the objects, spheres.
enum class Field { kWave, kStill, kFalling, kHeap, kTowers, kAsleep, kBeside };

struct Workload {
  int n = 64, objects = 100;
  Shapes shapes = Shapes::kSpheres;
  Field field = Field::kWave;
  bool is_border(int row, int column) const {
    return row == 0 || column == 0 || row == n - 1 || column == n - 1;
  }
  std::string name() const {
    return std::to_string(n) + "x" + std::to_string(n) + " " + std::to_string(objects) +
           (shapes == Shapes::kHalfMixed ? " mixed"
            : shapes == Shapes::kBoxes   ? " boxes"
                                         : "") +
           (field == Field::kStill     ? " still"
            : field == Field::kFalling ? " falling"
            : field == Field::kHeap    ? " heap"
            : field == Field::kTowers  ? " towers"
            : field == Field::kAsleep  ? " asleep"
            : field == Field::kBeside  ? " beside"
                                       : "");
  }
  bool has_towers() const {
    return field == Field::kTowers || field == Field::kAsleep || field == Field::kBeside;
  }
};

constexpr double kStepSeconds = 1.0 / 60, kSensorRange = 4.0, kBorderHeight = 6.0, kPinSpeed = 4.0,
                 kObjectSpacing = 6.1;
// Towers stand on squares of that many cells; the strip that moves beside them is as wide, in the west.
constexpr int kTowerCells = 12, kTowerBoxes = 12, kVisitors = 24;

inline int layer_count(const Workload& w) {
  const int side = static_cast<int>((w.n - 2) / kObjectSpacing);
  return (w.objects + side * side - 1) / (side * side);
}
// Number of steps until the objects, dropped in layers, have settled.
inline int settling_steps(const Workload& w) {
  if (w.field == Field::kFalling || w.field == Field::kHeap || w.field == Field::kTowers) return 0;
  if (w.has_towers()) return static_cast<int>(20 / kStepSeconds);
  const double height = (layer_count(w) - 1) * kObjectSpacing * 0.55;
  const double settled_s = std::max(2.0, std::sqrt(2 * height / 10.0) + 1.5);
  return static_cast<int>((w.field == Field::kStill ? settled_s + 40 : settled_s) / kStepSeconds);
}

// Target heights of all pins in u, row-major, row 0 north.
inline void compute_targets(const Workload& w, double time_s, std::vector<float>& out) {
  out.resize(static_cast<std::size_t>(w.n) * static_cast<std::size_t>(w.n));
  for (int c = 0; c < w.n; ++c) {
    const double x = c - (w.n - 1) * 0.5;
    const bool moves = w.field == Field::kWave || (w.field == Field::kBeside && c < kTowerCells);
    const bool is_fence = w.field == Field::kBeside && c == kTowerCells;
    const auto z = static_cast<float>(moves      ? 1.0 + std::sin(0.3 * x + 0.2 * time_s)
                                      : is_fence ? kBorderHeight
                                                 : 1.0);
    out[c] = z;
  }
  for (int r = 1; r < w.n; ++r) std::copy_n(out.begin(), w.n, out.begin() + r * w.n);
}

// A convex hull with twelve corners at about the given radius. Rounds to one of eight sizes, because
// experiments share solids too.
inline std::shared_ptr<const smartsurf::scene::Solid> shared_hull_solid(double radius) {
  static std::array<std::shared_ptr<const smartsurf::scene::Solid>, 8> cache;
  const int size = std::clamp(static_cast<int>((radius - 1.5) / 0.1875), 0, 7);
  auto& solid = cache[size];
  if (solid) return solid;
  std::mt19937 random(7);
  std::normal_distribution<double> normal;
  std::vector<Eigen::Vector3d> corners(12);
  for (auto& corner : corners) {
    for (double& along : corner) along = normal(random);
    corner *= (1.5 + 0.1875 * size) / corner.norm();
  }
  return solid = std::make_shared<smartsurf::scene::Solid>(smartsurf::mesh::build_hull_solid(corners));
}

// Towers of cubes, each falling onto the one below, before them, if the pins beside move, the spheres on
// those.
inline std::vector<smartsurf::scene::ObjectSpec> make_towers(const Workload& w) {
  using smartsurf::scene::ShapeKind;
  std::vector<smartsurf::scene::ObjectSpec> out;
  std::mt19937 random(1);
  std::uniform_real_distribution<double> u(0, 1);
  const int visitors = w.field == Field::kBeside ? kVisitors : 0, first = visitors > 0 ? kTowerCells : 0,
            side = (w.n - first) / kTowerCells;
  for (int i = 0; i < visitors; ++i) {
    smartsurf::scene::ObjectSpec& o = out.emplace_back();
    o.radius = 1.5;
    o.position = {0.5 * kTowerCells, (i + 0.5) * w.n / visitors, 4.5};
  }
  for (int k = 0; std::ssize(out) < w.objects; ++k) {
    const double edge = 1.5 + 1.5 * u(random),
                 x = first + kTowerCells * (k % side + 0.5) + 0.2 * u(random) - 0.1,
                 y = kTowerCells * (k / side + 0.5) + 0.2 * u(random) - 0.1;
    for (int i = 0; i < kTowerBoxes; ++i) {
      smartsurf::scene::ObjectSpec& o = out.emplace_back();
      o.shape = ShapeKind::kBox;
      o.size = {edge, edge, edge};
      o.position = {x + 0.1 * u(random) - 0.05, y + 0.1 * u(random) - 0.05,
                    1.0 + (i + 0.5) * edge + 1.5 * (i + 1)};
    }
  }
  return out;
}

// Spheres of radius 1.5 to 3 u in loose layers. In mixed workloads, every other object is a box, cylinder or
// convex hull of similar size; in workloads of boxes, every object is a box.
inline std::vector<smartsurf::scene::ObjectSpec> make_objects(const Workload& w) {
  using smartsurf::scene::ShapeKind;
  if (w.has_towers()) return make_towers(w);
  std::vector<smartsurf::scene::ObjectSpec> out;
  std::mt19937 random(12345);
  std::uniform_real_distribution<double> u(0, 1);
  const double scale = w.field == Field::kHeap ? 0.5 : 1.0, spacing = scale * kObjectSpacing;
  const int side = static_cast<int>((w.n - 2) / spacing);
  const double first = (w.n - 1) * 0.5 - (side - 1) * spacing * 0.5;
  const int spread_side = static_cast<int>(std::ceil(std::sqrt(w.objects)));
  const double spread_spacing = (w.n - 8.0) / spread_side;
  for (int i = 0; i < w.objects; ++i) {
    const int layer = i / (side * side), slot = i % (side * side);
    smartsurf::scene::ObjectSpec o;
    o.radius = scale * (1.5 + 1.5 * u(random));
    const double x = first + (slot % side) * spacing + 0.02 * (u(random) - 0.5);
    const double y = first + (slot / side) * spacing + 0.02 * (u(random) - 0.5);
    o.position = {x, y, 5.1 + layer * spacing};
    if (w.field == Field::kFalling)
      o.position = {4 + (i % spread_side + 0.9 * u(random)) * spread_spacing,
                    4 + (i / spread_side + 0.9 * u(random)) * spread_spacing, 25 + 20 * u(random)};
    const int kind = w.shapes == Shapes::kHalfMixed ? i % 6 : w.shapes == Shapes::kBoxes ? 1 : 0;
    if (kind == 1) {
      o.shape = ShapeKind::kBox;
      o.size = Eigen::Vector3d(1.2, 1.6, 1.0) * o.radius;
    } else if (kind == 3) {
      o.shape = ShapeKind::kCylinder;
      o.height = 1.2 * o.radius;
      o.radius *= 0.7;
    } else if (kind == 5) {
      o.shape = ShapeKind::kSolid;
      o.solid = shared_hull_solid(o.radius);
    }
    out.push_back(o);
  }
  return out;
}

// A wall around the table, tall enough for every layer.
struct Wall {
  Eigen::Vector3d centre, half;
};
inline std::vector<Wall> make_walls(const Workload& w) {
  const double h = w.n * 0.5, m = (w.n - 1) * 0.5;
  return {{{m + h + 2, m, 50}, {2, h + 4, 100}},
          {{m - h - 2, m, 50}, {2, h + 4, 100}},
          {{m, m + h + 2, 50}, {h + 4, 2, 100}},
          {{m, m - h - 2, 50}, {h + 4, 2, 100}}};
}

inline smartsurf::scene::SceneSpec make_scene(const Workload& w) {
  smartsurf::scene::SceneSpec s;
  s.world.gravity = {0, 0, -10};
  s.world.dt_s = s.world.control_period_s = kStepSeconds;
  s.materials[0].friction = 0.25;
  // Without rolling friction, a pile of spheres keeps creeping and never comes to rest.
  s.materials[0].rolling_friction = w.field == Field::kStill ? 0.01 : 0.0;
  s.materials[0].restitution = 0.0;
  s.surface.rows = s.surface.columns = w.n;
  s.surface.pin.max_height = kBorderHeight;
  s.surface.pin.max_speed = kPinSpeed;
  s.surface.pin.max_acceleration = 1e4;
  s.surface.border_height = kBorderHeight;
  s.objects = make_objects(w);
  for (const Wall& wall : make_walls(w)) {
    smartsurf::scene::ObjectSpec o;
    o.shape = smartsurf::scene::ShapeKind::kBox;
    o.size = 2 * wall.half;
    o.position = wall.centre;
    o.fixed = true;
    s.objects.push_back(o);
  }
  return s;
}

}  // namespace pin_scene
