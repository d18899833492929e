// Test fixture: a small rectangular surface with objects and sensors.
#pragma once

#include <string>
#include <vector>

#include "common/threads/ThreadPool.h"
#include "smartsurf/scene/KindRegistry.h"
#include "smartsurf/surface/SensorArray.h"

namespace smartsurf::surface {

struct SensorFixture {
  scene::SurfaceSpec spec;
  Field field;
  std::vector<scene::ObjectSpec> catalogue;
  scene::Snapshot snapshot;
  common::ThreadPool pool{1};

  explicit SensorFixture(int rows = 16, int columns = 20) {
    spec.rows = field.rows = rows;
    spec.columns = field.columns = columns;
    snapshot.height.assign(static_cast<std::size_t>(spec.cell_count()), 0.0F);
  }
  scene::SensorSpec& add_sensor(const std::string& model, const scene::ParameterValues& values = {}) {
    scene::SensorSpec sensor = scene::find_sensor_kind(model)->default_spec();
    for (const auto& [name, value] : values) sensor.values[name] = value;
    spec.sensors.push_back(sensor);
    return spec.sensors.back();
  }
  void add(scene::ObjectSpec o) {
    const auto p = o.position.cast<float>();
    const auto q = o.orientation.cast<float>();
    snapshot.id.push_back(static_cast<scene::ObjectId>(catalogue.size()));
    snapshot.position.push_back({p.x(), p.y(), p.z()});
    snapshot.orientation.push_back({q.x(), q.y(), q.z(), q.w()});
    catalogue.push_back(std::move(o));
  }
  void add_ball(double x, double y, double z, double radius, const std::string& label = "",
                scene::Colour colour = {}) {
    scene::ObjectSpec ball;
    ball.radius = radius;
    ball.position = {x, y, z};
    ball.label = label;
    ball.colour = colour;
    add(ball);
  }
  // Index of the cell at (x, y), y towards north.
  std::size_t cell(int x, int y) const { return static_cast<std::size_t>(spec.index(spec.rows - 1 - y, x)); }
  float& height(int x, int y) { return snapshot.height[cell(x, y)]; }

  SensorArray sensors(const FaultMap& map = {}, std::uint64_t seed = 1) const {
    scene::SceneSpec scene;
    scene.surface = spec;
    scene.world.seed = seed;
    return SensorArray(scene, field, map);
  }
};

// Returns the message of the InputError that f throws, or "".
template <typename F>
std::string error_message_of(F f) {
  try {
    f();
  } catch (const scene::InputError& e) {
    return e.what();
  }
  return "";
}

}  // namespace smartsurf::surface
