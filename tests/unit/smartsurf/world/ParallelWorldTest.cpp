// Small multithreaded worlds: bit-identical for any thread count, and free of races under ThreadSanitizer.
#include <gtest/gtest.h>

#include <cmath>

#include "common/threads/ThreadPool.h"
#include "smartsurf/scene/KindRegistry.h"
#include "smartsurf/surface/ActuatorArray.h"
#include "smartsurf/world/NativeEngine.h"

using namespace smartsurf;

namespace {

// Spheres, every fifth body a box, and one large sphere: enough bodies for the step to run in parallel.
scene::SceneSpec heap(double width, double depth) {
  scene::SceneSpec s;
  s.world.dt_s = 1.0 / 60;
  s.materials[0].restitution = 0.2;
  s.surface.rows = static_cast<int>(depth);
  s.surface.columns = static_cast<int>(width);
  s.surface.border_height = 6.0;
  s.surface.pin.max_height = 6.0;
  s.surface.pin.max_speed = 4.0;
  const int across = static_cast<int>(width / 2.2), along = static_cast<int>(depth / 2.2);
  for (int i = 0; i < 600; ++i) {
    scene::ObjectSpec o;
    o.radius = 0.8 + 0.05 * (i % 7);
    if (i % 5 == 0) {
      o.shape = scene::ShapeKind::kBox;
      o.size = {1.2, 1.5, 1.0};
    }
    o.position = {1.0 + 2.2 * (i % across), 1.0 + 2.2 * (i / across % along),
                  2.0 + 2.2 * (i / (across * along))};
    s.objects.push_back(o);
  }
  scene::ObjectSpec large;
  large.radius = 8.0;
  large.position = {0.5 * width, 0.5 * depth, 40.0};
  large.velocity = {0, 0, -60.0};
  s.objects.push_back(large);
  return s;
}

// Boxes with a sphere on a hinge or a ball joint each, over compliant deltas or over an elastic skin: what
// one thread solves while the others solve contacts.
scene::SceneSpec linkages(bool on_skin) {
  scene::SceneSpec s;
  s.world.dt_s = 1.0 / 120;
  s.surface.rows = s.surface.columns = 32;
  scene::ActuatorSpec spec = scene::find_actuator_kind(on_skin ? "pin" : "delta")->default_spec();
  if (on_skin)
    s.surface.skin = scene::SkinSpec{
        .kind = scene::SkinSpec::Kind::kElastic, .rows = 65, .columns = 65, .margin = 0.5, .attached = true};
  else
    spec.values["stiffness"] = {300};
  s.surface.actuators = {spec};
  derive_pin_spec(s.surface);
  for (unsigned i = 0; i < 100; ++i) {
    const Eigen::Vector3d at(2.0 + 3.0 * (i % 10), 2.0 + 3.0 * (i / 10), 2.0 + 0.02 * (i % 7));
    scene::ObjectSpec o;
    o.shape = scene::ShapeKind::kBox;
    o.size = {0.8, 0.8, 0.8};
    o.position = at;
    s.objects.push_back(o);
    o.shape = scene::ShapeKind::kSphere;
    o.radius = 0.4;
    o.position.x() += 1.0;
    s.objects.push_back(o);
    s.joints.push_back({.kind = i % 2 == 0 ? scene::JointKind::kHinge : scene::JointKind::kBall,
                        .a = 2 * i,
                        .b = 2 * i + 1,
                        .anchor = at + Eigen::Vector3d(0.5, 0, 0)});
  }
  return s;
}

// Boxes that bear others fifty times as heavy: islands that a direct solver takes.
scene::SceneSpec loaded_boxes() {
  scene::SceneSpec s;
  s.world.dt_s = 1.0 / 60;
  s.surface.rows = s.surface.columns = 60;
  for (int i = 0; i < 600; ++i) {
    scene::ObjectSpec o;
    o.shape = scene::ShapeKind::kBox;
    o.size = {1.5, 1.5, 1.0};
    o.mass = i % 2 == 0 ? 1.0 : 50.0;
    o.position = {2.0 + 3.0 * (i / 2 % 19), 2.0 + 3.0 * (i / 2 / 19), 0.5 + 1.0 * (i % 2)};
    s.objects.push_back(o);
  }
  return s;
}

std::uint64_t hash_after(const scene::SceneSpec& scene, int steps, int threads) {
  common::ThreadPool pool(threads);
  surface::ActuatorArray cells(scene.surface, {}, 1, &pool);
  world::NativeEngine world(scene, cells.field(), &pool);
  scene::Snapshot snapshot;
  for (int step = 0; step < steps; ++step) {
    for (int c = 0; c < scene.surface.columns; ++c)
      cells.set_target(0, step % scene.surface.rows, c, 1.0F + std::sin(0.3F * static_cast<float>(c)));
    cells.plan(scene.world.dt_s);
    // A removed body loses its contacts; an added body has none to match.
    if (step % 4 == 3) world.remove(static_cast<scene::ObjectId>(37 * step));
    if (step == 9) world.add(scene.objects[5]);
    world.step();
    cells.commit(scene.world.dt_s);
  }
  world.snapshot(snapshot);
  return snapshot.state_hash;
}

}  // namespace

TEST(Threads, SameStateHashForAnyThreadCount) {
  for (const scene::SceneSpec& scene :
       {heap(24, 48), heap(48, 24), linkages(false), linkages(true), loaded_boxes()}) {
    ASSERT_EQ(scene::validate(scene.surface), "");
    const std::uint64_t alone = hash_after(scene, 20, 1);
    for (const int threads : {2, 3}) EXPECT_EQ(hash_after(scene, 20, threads), alone) << threads;
  }
}
