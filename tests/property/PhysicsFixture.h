// Test fixture: a world on a small surface, for experiments with closed-form results.
//
// Lengths in u, times in s; z is up. The surface and the world are created on first use; change `scene`,
// `threads` and `cell_force_limit` before that.
#pragma once

#include <array>
#include <functional>
#include <memory>
#include <random>

#include "common/threads/ThreadPool.h"
#include "smartsurf/scene/Snapshot.h"
#include "smartsurf/surface/ActuatorArray.h"
#include "smartsurf/world/Engine.h"

namespace physics_fixture {

inline constexpr double kGravity = 9.81;  // the scene's by default, u/s²

class PhysicsFixture {
 public:
  // A level 32 × 32 surface at height 0 without a border. The environment's PHYSICS_ENGINE names the engine.
  PhysicsFixture();

  smartsurf::scene::SceneSpec scene;

  smartsurf::scene::ObjectId add(const smartsurf::scene::ObjectSpec&);
  void run(double seconds, const std::function<void()>& after_each_step = {});
  // Continues with a new engine, from the state that the present one saves.
  void take_over();
  // The current state; valid until the next call of this or of an accessor below.
  const smartsurf::scene::Snapshot& snapshot();

  int threads = 1;                // of the world's pool
  double cell_force_limit = 0.0;  // of every cell, mass·u/s²; 0: none

  smartsurf::surface::ActuatorArray& cells();
  smartsurf::world::Engine& world();

  Eigen::Vector3f position(smartsurf::scene::ObjectId);
  Eigen::Vector3f velocity(smartsurf::scene::ObjectId);
  Eigen::Vector3f angular_velocity(smartsurf::scene::ObjectId);
  // The vertical component of the object's axis.
  double upright(smartsurf::scene::ObjectId);
  // The sum of all cells' loads in the last step, mass·u/s².
  double total_load();

 private:
  std::unique_ptr<smartsurf::surface::ActuatorArray> cells_;
  std::vector<smartsurf::scene::ObjectSpec> objects_;
  std::unique_ptr<common::ThreadPool> pool_;
  std::unique_ptr<smartsurf::world::Engine> world_;
  smartsurf::scene::Snapshot snapshot_;
};

// Calls run(fixture, draw) for `draws` fixtures with this step, at 4, 10 and 40 iterations in turn; draw(low,
// high) is uniform, of the seed.
template <class Run>
void for_random_fixtures(unsigned seed, int draws, double dt_s, Run run) {
  std::mt19937_64 random(seed);
  const auto draw = [&random](double low, double high) {
    return low + (high - low) * (static_cast<double>(random()) / 0x1p64);
  };
  for (int i = 0; i < draws; ++i) {
    PhysicsFixture fixture;
    fixture.scene.world.dt_s = dt_s;
    fixture.scene.world.iterations = std::array{4, 10, 40}[static_cast<std::size_t>(i) % 3];
    run(fixture, draw);
  }
}

// Commands all pins to the height, u.
void raise_all(PhysicsFixture&, float height);

smartsurf::scene::ObjectSpec sphere(double radius, const Eigen::Vector3d& position);
smartsurf::scene::ObjectSpec box(const Eigen::Vector3d& size, const Eigen::Vector3d& position);
smartsurf::scene::ObjectSpec cylinder(double radius, double height, const Eigen::Vector3d& position);
smartsurf::scene::ObjectSpec capsule(double radius, double height, const Eigen::Vector3d& position);
smartsurf::scene::ObjectSpec cone(double radius, double height, const Eigen::Vector3d& position);
// Convex-hull solids: a cube, and a triangular prism of edge 2 resting on one side.
smartsurf::scene::ObjectSpec cube(const Eigen::Vector3d& position, float edge = 2.0F);
smartsurf::scene::ObjectSpec wedge(const Eigen::Vector3d& position);

struct Block {
  Eigen::Vector3d size, centre;
};
// A solid of one convex hull a block; without mass and inertia.
smartsurf::scene::ObjectSpec compound(const std::vector<Block>&);

}  // namespace physics_fixture
