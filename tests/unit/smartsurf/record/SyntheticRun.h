// A small synthetic run, whose values are simple functions of tick and object, and a temporary directory, for
// the unit tests of smartsurf/record.
#pragma once

#include <unistd.h>

#include <filesystem>
#include <fstream>
#include <iterator>
#include <string>
#include <vector>

#include "smartsurf/record/OpenRecorder.h"

namespace smartsurf::record {

// A temporary directory, removed by the destructor.
class OutputFolder {
 public:
  OutputFolder() {
    std::string name = (std::filesystem::temp_directory_path() / "record-test-XXXXXX").string();
    path_ = ::mkdtemp(name.data());
  }
  ~OutputFolder() { std::filesystem::remove_all(path_); }
  std::filesystem::path operator/(const std::string& name) const { return path_ / name; }

 private:
  std::filesystem::path path_;
};

inline std::string content(const std::filesystem::path& path) {
  std::ifstream file(path, std::ios::binary);
  return {std::istreambuf_iterator<char>(file), {}};
}

inline scene::ObjectSpec sphere(double radius, const std::string& label = "") {
  scene::ObjectSpec object;
  object.radius = radius;
  object.label = label;
  return object;
}

struct SyntheticRun {
  SyntheticRun() {
    spec.file = "scripts/experiment.lua";
    spec.source = "surface { rows = 4, columns = 6 }\n-- α";
    spec.world.seed = 0xFFFFFFFFFFFFFFF1u;
    spec.materials.push_back({.name = "steel", .density = 2.0});
    spec.surface.rows = 4;
    spec.surface.columns = 6;
    spec.surface.pitch = 2.0;
    spec.surface.pin.top_x = 1.5;
    spec.surface.border_height = 5.0;
    spec.options = {{"count", "3", "number of spheres"}, {"speed", "0.5", ""}};
    add(scene::ShapeKind::kSphere, "small", 2.0);
    add(scene::ShapeKind::kCylinder, "large", 4.0);
    add(scene::ShapeKind::kBox, "", 1.0);
    meta.command_line = "smartsurf run scripts/experiment.lua --seed 7";
    meta.mode = "time-step";
    meta.program_file = "sort.aps";
    meta.program_text = "!define N 3\n";
    meta.versions = {{"bullet", "3.24"}};
    meta.declares_success = false;
  }

  void add(scene::ShapeKind shape, const std::string& label, double radius) {
    scene::ObjectSpec object;
    object.shape = shape;
    object.label = label;
    object.radius = radius;
    object.height = 3.0;
    object.size = {1.0, 2.0, 3.0};
    object.position = {1.0 + static_cast<double>(spec.objects.size()), 2.0, 8.0};
    object.velocity = {0.0, 0.25, 0.0};
    object.colour = {0.5f, 0.25f, 0.125f};
    object.material = 1;
    spec.objects.push_back(object);
  }

  static float x(std::uint64_t tick, scene::ObjectId id) {
    return 0.1f * static_cast<float>(tick) + static_cast<float>(id);
  }

  // The state at a tick with the objects `live`.
  scene::Snapshot snapshot_at(std::uint64_t tick, const std::vector<scene::ObjectId>& live) const {
    scene::Snapshot shot;
    shot.tick = tick;
    shot.time_s = static_cast<double>(tick) / 60.0;
    shot.state_hash = 0x8000000000000000u + tick;
    shot.contact_count = static_cast<std::uint32_t>(tick % 5);
    shot.height.assign(spec.surface.cell_count(), static_cast<float>(tick));
    for (const scene::ObjectId id : live) {
      shot.id.push_back(id);
      shot.position.push_back({x(tick, id), 2.0f, 3.0f});
      shot.orientation.push_back({0.0f, 0.6f, 0.0f, 0.8f});
      shot.velocity.push_back({1.0f, 2.0f, static_cast<float>(tick)});
      shot.angular_velocity.push_back({0.5f * static_cast<float>(tick), static_cast<float>(id), -1.0f});
    }
    return shot;
  }

  scene::SceneSpec spec;
  RunMetadata meta;
};

}  // namespace smartsurf::record
