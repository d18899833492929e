#include "tests/property/PhysicsBench.h"

#include <cmath>

namespace physics_bench {

using namespace smartsurf;

PhysicsBench::PhysicsBench() {
  scene.surface.rows = scene.surface.columns = 32;
  scene.materials[0].friction = 0.5;
  scene.materials[0].rolling_friction = 0.0;
  scene.materials[0].restitution = 0.0;
}

surface::ActuatorArray& PhysicsBench::cells() {
  if (!cells_) cells_ = std::make_unique<surface::ActuatorArray>(scene.surface);
  return *cells_;
}

world::World& PhysicsBench::world() {
  if (!world_) world_ = std::make_unique<world::World>(scene, cells().field());
  return *world_;
}

scene::ObjectId PhysicsBench::add(const scene::ObjectSpec& o) {
  catalogue_.push_back(o);
  return world().add(o);
}

void PhysicsBench::run(double seconds, const std::function<void()>& after_each_step) {
  const long steps = std::lround(seconds / scene.world.dt_s);
  for (long i = 0; i < steps; ++i) {
    cells().plan(scene.world.dt_s);
    if (cells().exerts_forces())
      cells().forces(scene.world.dt_s, world().bodies(), catalogue_, world().wrenches());
    world().step();
    cells().commit(scene.world.dt_s);
    if (after_each_step) after_each_step();
  }
}

const scene::Snapshot& PhysicsBench::look() {
  world().snapshot(snapshot_);
  return snapshot_;
}

Eigen::Vector3f PhysicsBench::position(scene::ObjectId id) { return Eigen::Vector3f(look().position[id].data()); }
Eigen::Vector3f PhysicsBench::velocity(scene::ObjectId id) { return Eigen::Vector3f(look().velocity[id].data()); }
Eigen::Vector3f PhysicsBench::angular_velocity(scene::ObjectId id) {
  return Eigen::Vector3f(look().angular_velocity[id].data());
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

}  // namespace physics_bench
