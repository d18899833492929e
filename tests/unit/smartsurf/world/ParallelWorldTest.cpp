// Small multithreaded worlds: bit-identical for any thread count, and free of races under ThreadSanitizer.
#include <gtest/gtest.h>

#include <cmath>
#include <string>

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

// Triples of a box and two smaller bodies, of which every third hangs from the table, over compliant deltas
// with limited force, or over an elastic skin: trees of joints of all kinds, and tips that several bodies
// load at once.
scene::SceneSpec linkages(bool on_skin) {
  scene::SceneSpec s;
  s.world.dt_s = 1.0 / 120;
  s.surface.rows = s.surface.columns = 44;
  scene::ActuatorSpec spec = scene::find_actuator_kind(on_skin ? "pin" : "delta")->default_spec();
  if (on_skin) {
    s.surface.skin = scene::SkinSpec{
        .kind = scene::SkinSpec::Kind::kElastic, .rows = 89, .columns = 89, .margin = 0.5, .attached = true};
  } else {
    spec.values["stiffness"] = {300};
    spec.values["max_force"] = {20};
  }
  s.surface.actuators = {spec};
  derive_pin_spec(s.surface);
  for (unsigned i = 0; i < 225; ++i) {
    // Few touch the skin within the steps of the test, because each contact with it costs a solution.
    const double height = on_skin ? 0.05 * (i % 20) : 0.01 * (i % 7);
    const Eigen::Vector3d at(1.5 + 2.9 * (i % 15), 1.5 + 2.9 * (i / 15), 0.42 + height);
    scene::ObjectSpec o;
    o.shape = scene::ShapeKind::kBox;
    o.size = {1.5, 1.5, 0.8};
    o.position = at;
    o.velocity = {3.0, 0.5 * (i % 5), 0.0};
    s.objects.push_back(o);
    o.size = {0.4, 0.4, 0.4};
    o.position.x() += 1.1;
    s.objects.push_back(o);
    o.shape = scene::ShapeKind::kSphere;
    o.radius = 0.3;
    o.position.x() += 0.6;
    s.objects.push_back(o);
    constexpr scene::JointKind kKinds[] = {scene::JointKind::kHinge, scene::JointKind::kBall,
                                           scene::JointKind::kSlider, scene::JointKind::kFixed};
    scene::JointSpec first{
        .kind = kKinds[i % 4], .a = 3 * i, .b = 3 * i + 1, .anchor = at + Eigen::Vector3d(0.9, 0, 0)};
    if (first.has_coordinate()) {
      first.spring = scene::JointSpring{.stiffness = 50.0, .damping = 0.5};
      if (i % 8 == 0) first.motor = scene::JointMotor{.speed = 2.0, .max_effort = 5.0};
    }
    s.joints.push_back(first);
    s.joints.push_back(
        {.kind = scene::JointKind::kBall, .a = 3 * i + 1, .b = 3 * i + 2, .anchor = o.position});
    if (i % 3 == 0) s.joints.push_back({.kind = scene::JointKind::kBall, .a = 3 * i, .anchor = at});
  }
  return s;
}

// Two stacks of plates that lie on each other, struck from above: blows without rebound, which reach hundreds
// of contacts. The stacks reach across the rows of several threads.
scene::SceneSpec struck_stacks() {
  scene::SceneSpec s;
  s.world.dt_s = 1.0 / 60;
  s.surface.rows = 48;
  s.surface.columns = 24;
  constexpr int kLayers = 4;
  for (int i = 0; i < 12 * 16 * kLayers; ++i) {
    const int layer = i / (12 * 16), x = i % 12, y = i / 12 % 16;
    scene::ObjectSpec o;
    o.shape = scene::ShapeKind::kBox;
    o.size = {1.9, 2.4, 0.6};
    // Each layer lies across the seams of the one below.
    o.position = {1.0 + 1.92 * x + 0.5 * (layer % 2), 2.5 + 2.5 * y + 0.6 * (layer % 2),
                  0.301 + 0.602 * layer};
    s.objects.push_back(o);
  }
  for (int i = 0; i < 8; ++i) {
    scene::ObjectSpec o;
    o.shape = scene::ShapeKind::kBox;
    o.size = {4.0, 4.0, 1.0};
    o.mass = 30.0;
    o.position = {6.0 + 9.0 * (i % 2), 5.0 + 10.0 * (i / 2), 2.95};
    o.velocity = {0, 0, -12.0};
    s.objects.push_back(o);
  }
  return s;
}

// Boxes on conveyors, whose tops drive them.
scene::SceneSpec conveyors() {
  scene::SceneSpec s;
  s.world.dt_s = 1.0 / 120;
  s.surface.rows = s.surface.columns = 60;
  s.surface.actuators = {scene::find_actuator_kind("conveyor")->default_spec()};
  derive_pin_spec(s.surface);
  for (int i = 0; i < 600; ++i) {
    scene::ObjectSpec o;
    o.shape = scene::ShapeKind::kBox;
    o.size = {1.5, 1.2, 0.8};
    o.position = {2.0 + 2.3 * (i % 25), 2.0 + 2.3 * (i / 25), 0.41};
    s.objects.push_back(o);
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

// Light plates that bear boxes forty times as heavy, with a lid on a hinge, and chains of two links that fall
// across the gaps between them: joints in the islands of the direct solver, and joints and contacts that take
// turns across the table.
scene::SceneSpec loaded_linkages() {
  scene::SceneSpec s;
  s.world.dt_s = 1.0 / 60;
  s.surface.rows = s.surface.columns = 34;
  const auto add_box = [&s](const Eigen::Vector3d& size, const Eigen::Vector3d& position, double mass) {
    scene::ObjectSpec o;
    o.shape = scene::ShapeKind::kBox;
    o.size = size;
    o.position = position;
    o.mass = mass;
    s.objects.push_back(o);
    return static_cast<scene::ObjectId>(s.objects.size() - 1);
  };
  for (int i = 0; i < 11 * 11; ++i) {
    const Eigen::Vector3d at(2.0 + 2.9 * (i % 11), 2.0 + 2.9 * (i / 11), 0.0);
    add_box({2, 2, 0.4}, at + Eigen::Vector3d(0, 0, 0.2), 1.0);
    const auto loaded = add_box({1.6, 1.6, 0.8}, at + Eigen::Vector3d(0, 0, 0.8), 40.0);
    const auto lid = add_box({1, 1, 0.2}, at + Eigen::Vector3d(0, 0, 1.3), 1.0);
    s.joints.push_back({.kind = scene::JointKind::kHinge,
                        .a = lid,
                        .b = loaded,
                        .anchor = at + Eigen::Vector3d(0.5, 0, 1.2),
                        .axis = Eigen::Vector3d::UnitY(),
                        .collide = true});
    const Eigen::Vector3d middle = at + Eigen::Vector3d(1.45, 0.2, 1.42 + 0.02 * (i % 5));
    const auto first = add_box({1.6, 0.4, 0.4}, middle - Eigen::Vector3d(0.85, 0, 0), 1.0);
    const auto second = add_box({1.6, 0.4, 0.4}, middle + Eigen::Vector3d(0.85, 0, 0), 1.0);
    s.joints.push_back({.kind = i % 2 == 0 ? scene::JointKind::kBall : scene::JointKind::kHinge,
                        .a = first,
                        .b = second,
                        .anchor = middle,
                        .axis = Eigen::Vector3d::UnitY()});
  }
  return s;
}

// A floor of boxes side by side, over whose seams boxes and balls slide, and small boxes that are faster than
// they are wide fly into both: bodies that change each other's contacts, and stops at others.
scene::SceneSpec sliders_and_bullets() {
  scene::SceneSpec s;
  s.world.dt_s = 1.0 / 120;
  s.surface.rows = s.surface.columns = 48;
  for (int i = 0; i < 22 * 22; ++i) {
    scene::ObjectSpec o;
    o.shape = scene::ShapeKind::kBox;
    o.size = {2.0, 2.0, 1.0};
    o.position = {2.0 + 2.0 * (i % 22), 2.0 + 2.0 * (i / 22), 0.5};
    s.objects.push_back(o);
    if (i % 2 != 0) continue;
    const bool is_ball = i % 3 == 0;
    if (is_ball) o.shape = scene::ShapeKind::kSphere;
    o.radius = 0.6;
    o.size = {1.5, 1.2, 0.8};
    o.position = {2.0 + 2.0 * (i % 22) + 0.9, 2.0 + 2.0 * (i / 22), is_ball ? 1.6 : 1.4};
    o.velocity = {4.0 - 0.3 * (i % 20), 2.0 + 0.1 * (i % 7), 0.0};
    s.objects.push_back(o);
    if (i % 6 != 0) continue;
    o.shape = scene::ShapeKind::kBox;
    o.size = {0.1, 0.1, 0.1};
    o.position.z() = 2.6;
    o.position.x() += 0.4;
    o.velocity = {20.0, 15.0, -90.0};
    s.objects.push_back(o);
  }
  return s;
}

// Drives the first channels of some rows in each step.
std::uint64_t hash_after(const scene::SceneSpec& scene, int steps, int channels, int threads) {
  constexpr int kRowsApart = 20;
  common::ThreadPool pool(threads, 0.0);  // shares every step
  surface::ActuatorArray cells(scene.surface, {}, 1, &pool);
  world::NativeEngine world(scene, cells.field(), &pool);
  scene::Snapshot snapshot;
  for (int step = 0; step < steps; ++step) {
    for (int channel = 0; channel < channels; ++channel)
      for (int row = step % kRowsApart; row < scene.surface.rows; row += kRowsApart)
        for (int c = 0; c < scene.surface.columns; ++c)
          cells.set_target(channel, row, c, 1.0F + std::sin(0.3F * static_cast<float>(c)));
    cells.plan(scene.world.dt_s);
    // A removed body loses its contacts; an added body has none to match.
    if (step % 4 == 3) world.remove(static_cast<scene::ObjectId>(37 * step));
    if (step == 9) world.add(scene.objects[5]);
    world.step();
    cells.commit(scene.world.dt_s);
  }
  world.snapshot(snapshot, true);
  return snapshot.state_hash;
}

struct World {
  const char* name;
  scene::SceneSpec (*scene)();
  int steps, channels = 1;
};

class Threads : public testing::TestWithParam<World> {};

#if defined(__SANITIZE_ADDRESS__) || defined(__SANITIZE_THREAD__)
constexpr int kThreads[] = {2, 4};
#else
constexpr int kThreads[] = {2, 3, 8};
#endif

}  // namespace

TEST_P(Threads, SameStateHashForAnyThreadCount) {
  const scene::SceneSpec scene = GetParam().scene();
  ASSERT_EQ(scene::validate(scene.surface), "");
  ASSERT_GE(scene.objects.size(),
            512U + 20U);  // smaller worlds stay on one thread, and some objects are removed
  const auto& [name, make, steps, channels] = GetParam();
  const std::uint64_t alone = hash_after(scene, steps, channels, 1);
  RecordProperty("state_hash", std::to_string(alone));
  for (const int threads : kThreads) EXPECT_EQ(hash_after(scene, steps, channels, threads), alone) << threads;
}

INSTANTIATE_TEST_SUITE_P(Of, Threads,
                         testing::Values(World{"WideHeap", [] { return heap(24, 48); }, 20},
                                         World{"LongHeap", [] { return heap(48, 24); }, 20},
                                         World{"LinkagesOnDeltas", [] { return linkages(false); }, 6},
                                         World{"LinkagesOnASkin", [] { return linkages(true); }, 3},
                                         World{"LoadedBoxes", loaded_boxes, 20},
                                         World{"LoadedLinkages", loaded_linkages, 8},
                                         World{"StruckStacks", struck_stacks, 3},
                                         World{"Conveyors", conveyors, 8},
                                         World{"TurningConveyors", conveyors, 16, 3},
                                         World{"SlidersAndBullets", sliders_and_bullets, 4}),
                         [](const auto& world) { return std::string(world.param.name); });
