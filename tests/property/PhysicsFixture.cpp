#include "tests/property/PhysicsFixture.h"
#include "common/threads/ThreadPool.h"

#include <cmath>
#include <cstdlib>
#include <numeric>

#include "smartsurf/mesh/SolidBuilder.h"
#include "smartsurf/world/bullet/EngineFactory.h"

namespace physics_fixture {

using namespace smartsurf;

PhysicsFixture::PhysicsFixture() {
  if (const char* engine = std::getenv("PHYSICS_ENGINE")) scene.world.engine = engine;
  scene.surface.rows = scene.surface.columns = 32;
  scene.materials[0].friction = 0.5;
  scene.materials[0].rolling_friction = 0.0;
  scene.materials[0].restitution = 0.0;
}

surface::ActuatorArray& PhysicsFixture::cells() {
  if (cells_) return *cells_;
  cells_ = std::make_unique<surface::ActuatorArray>(scene.surface);
  if (cell_force_limit > 0.0) {
    surface::Field& field = cells_->field();
    field.force_limit.assign(field.height.size(), static_cast<float>(cell_force_limit));
    field.no_load_speed.assign(field.height.size(), static_cast<float>(scene.surface.pin.max_speed));
  }
  return *cells_;
}

world::Engine& PhysicsFixture::world() {
  if (!pool_) pool_ = std::make_unique<common::ThreadPool>(threads, 0.0);  // shares every step
  if (!world_) world_ = world::make_engine(scene, cells().field(), pool_.get());
  return *world_;
}

scene::ObjectId PhysicsFixture::add(const scene::ObjectSpec& o) {
  objects_.push_back(o);
  return world().add(o);
}

void PhysicsFixture::run(double seconds, const std::function<void()>& after_each_step) {
  const long steps = std::lround(seconds / scene.world.dt_s);
  for (long i = 0; i < steps; ++i) {
    cells().plan(scene.world.dt_s);
    if (cells().exerts_forces())
      cells().add_forces(scene.world.dt_s, world().bodies(), objects_, world().wrenches());
    world().step();
    cells().commit(scene.world.dt_s);
    if (after_each_step) after_each_step();
  }
}

void PhysicsFixture::take_over() {
  std::string bytes;
  common::StateArchive saved(bytes);
  world().archive(saved, objects_, 0);
  world_ = world::make_engine(scene, cells().field(), pool_.get());
  common::StateArchive restored{std::string_view(bytes)};
  world_->archive(restored, objects_, 0);
}

const scene::Snapshot& PhysicsFixture::snapshot() {
  world().snapshot(snapshot_);
  return snapshot_;
}

Eigen::Vector3f PhysicsFixture::position(scene::ObjectId id) {
  return Eigen::Vector3f(snapshot().position[id].data());
}
Eigen::Vector3f PhysicsFixture::velocity(scene::ObjectId id) {
  return Eigen::Vector3f(snapshot().velocity[id].data());
}
Eigen::Vector3f PhysicsFixture::angular_velocity(scene::ObjectId id) {
  return Eigen::Vector3f(snapshot().angular_velocity[id].data());
}

double PhysicsFixture::upright(scene::ObjectId id) {
  return (world().state(id).orientation * Eigen::Vector3d::UnitZ()).z();
}

double PhysicsFixture::total_load() {
  const auto& impulse = cells().field().impulse;
  return std::accumulate(impulse.begin(), impulse.end(), 0.0) / scene.world.dt_s;
}

void raise_all(PhysicsFixture& fixture, float height) {
  fixture.cells().set_targets(0, std::vector<float>(fixture.cells().field().height.size(), height));
}

scene::ObjectSpec sphere(double radius, const Eigen::Vector3d& position) {
  scene::ObjectSpec o;
  o.radius = radius;
  o.position = position;
  return o;
}

scene::ObjectSpec box(const Eigen::Vector3d& size, const Eigen::Vector3d& position) {
  scene::ObjectSpec o;
  o.shape = scene::ShapeKind::kBox;
  o.size = size;
  o.position = position;
  return o;
}

scene::ObjectSpec cylinder(double radius, double height, const Eigen::Vector3d& position) {
  scene::ObjectSpec o;
  o.shape = scene::ShapeKind::kCylinder;
  o.radius = radius;
  o.height = height;
  o.position = position;
  return o;
}

scene::ObjectSpec capsule(double radius, double height, const Eigen::Vector3d& position) {
  scene::ObjectSpec o = cylinder(radius, height, position);
  o.shape = scene::ShapeKind::kCapsule;
  return o;
}

scene::ObjectSpec cone(double radius, double height, const Eigen::Vector3d& position) {
  scene::ObjectSpec o = cylinder(radius, height, position);
  o.shape = scene::ShapeKind::kCone;
  return o;
}

namespace {

using Corners = std::vector<Eigen::Vector3f>;
using Faces = std::vector<std::vector<std::uint16_t>>;

scene::ObjectSpec make_solid(const Corners& corners, const Faces& faces, double volume,
                             const Eigen::Vector3d& moments, const Eigen::Vector3d& position) {
  auto solid = std::make_shared<scene::Solid>();
  scene::ConvexHull hull;
  hull.vertices = solid->vertices = corners;
  hull.bounds_min = hull.bounds_max = corners[0];
  for (const auto& corner : corners) {
    hull.bounds_min = hull.bounds_min.cwiseMin(corner);
    hull.bounds_max = hull.bounds_max.cwiseMax(corner);
    solid->bounding_radius = std::max(solid->bounding_radius, corner.norm());
  }
  for (const auto& face : faces) {
    scene::ConvexHull::Face f;
    f.normal = (corners[face[1]] - corners[face[0]]).cross(corners[face[2]] - corners[face[0]]).normalized();
    f.offset = f.normal.dot(corners[face[0]]);
    f.first_vertex = static_cast<std::uint32_t>(hull.face_vertices.size());
    f.vertex_count = static_cast<std::uint32_t>(face.size());
    hull.faces.push_back(f);
    hull.face_vertices.insert(hull.face_vertices.end(), face.begin(), face.end());
  }
  solid->bounds_min = hull.bounds_min;
  solid->bounds_max = hull.bounds_max;
  solid->hulls = {hull};
  solid->volume = volume;
  solid->inertia = (volume * moments).asDiagonal();
  scene::ObjectSpec o;
  o.shape = scene::ShapeKind::kSolid;
  o.solid = solid;
  o.position = position;
  return o;
}

}  // namespace

scene::ObjectSpec cube(const Eigen::Vector3d& position, float edge) {
  const float half = 0.5F * edge;
  Corners corners;
  for (int i = 0; i < 8; ++i)
    corners.emplace_back(i & 1 ? half : -half, i & 2 ? half : -half, i & 4 ? half : -half);
  return make_solid(corners,
                    {{0, 2, 3, 1}, {4, 5, 7, 6}, {0, 1, 5, 4}, {2, 6, 7, 3}, {0, 4, 6, 2}, {1, 3, 7, 5}},
                    std::pow(edge, 3.0), Eigen::Vector3d::Constant(edge * edge / 6.0), position);
}

scene::ObjectSpec wedge(const Eigen::Vector3d& position) {
  // An equilateral triangle of edge 2 in the x-z plane, extruded along y. Its centroid is at a third of the
  // height.
  const auto height = static_cast<float>(std::sqrt(3.0)), low = -height / 3, high = 2 * height / 3;
  const Corners corners = {{-1, -1, low}, {1, -1, low}, {0, -1, high},
                           {-1, 1, low},  {1, 1, low},  {0, 1, high}};
  auto o = make_solid(corners, {{0, 1, 2}, {3, 5, 4}, {0, 3, 4, 1}, {1, 4, 5, 2}, {0, 2, 5, 3}},
                      2 * std::sqrt(3.0), {1.0 / 6 + 1.0 / 3, 1.0 / 3, 1.0 / 6 + 1.0 / 3}, position);
  return o;
}

scene::ObjectSpec compound(const std::vector<Block>& blocks) {
  auto solid = std::make_shared<scene::Solid>();
  for (const Block& b : blocks) {
    std::vector<Eigen::Vector3d> corners;
    for (int i = 0; i < 8; ++i)
      corners.push_back(b.centre + 0.5 * b.size.cwiseProduct(Eigen::Vector3d(i & 1 ? 1 : -1, i & 2 ? 1 : -1,
                                                                             i & 4 ? 1 : -1)));
    // The builder moves the origin to the middle.
    scene::ConvexHull hull = mesh::build_hull_solid(corners).hulls.front();
    for (Eigen::Vector3f& v : hull.vertices) v += b.centre.cast<float>();
    solid->hulls.push_back(with_vertices(hull, hull.vertices));
    solid->vertices.insert(solid->vertices.end(), hull.vertices.begin(), hull.vertices.end());
  }
  scene::compute_bounds(*solid);
  scene::ObjectSpec o;
  o.shape = scene::ShapeKind::kSolid;
  o.solid = solid;
  return o;
}

}  // namespace physics_fixture
