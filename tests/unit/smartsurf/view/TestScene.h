// Builds small scenes for the tests of smartsurf/view.
#pragma once

#include "smartsurf/scene/SceneSpec.h"
#include "smartsurf/scene/Snapshot.h"
#include "smartsurf/view/model/Signal.h"

namespace smartsurf::view {

struct TestScene {
  scene::SceneSpec spec;
  scene::Snapshot snapshot;

  // rows × columns pins of length 2 and travel 0 to 6, all at `height`.
  explicit TestScene(int rows, int columns, float height = 4.0f) {
    spec.surface.rows = rows;
    spec.surface.columns = columns;
    snapshot.height.assign(spec.surface.cell_count(), height);
  }

  void add(const scene::ObjectSpec& object) {
    snapshot.id.push_back(static_cast<scene::ObjectId>(spec.objects.size()));
    const Eigen::Vector3f p = object.position.cast<float>();
    const Eigen::Quaternionf q = object.orientation.cast<float>();
    snapshot.position.push_back({p.x(), p.y(), p.z()});
    snapshot.orientation.push_back({q.x(), q.y(), q.z(), q.w()});
    snapshot.velocity.push_back({});
    snapshot.angular_velocity.push_back({});
    spec.objects.push_back(object);
  }

  void add_sphere(double x, double y, double z, double radius, const scene::Colour& colour) {
    scene::ObjectSpec sphere;
    sphere.position = {x, y, z};
    sphere.radius = radius;
    sphere.colour = colour;
    add(sphere);
  }
};

// A history of given snapshots. Its metric "frame" is the number of the frame.
struct StoredFrames final : History {
  std::vector<scene::Snapshot> frames;
  std::uint64_t first = 0;  // number of frames.front()
  double metric_start = 0.0, metric_step = 1.0;

  std::uint64_t begin() const override { return first; }
  std::uint64_t end() const override { return first + frames.size(); }
  double time_s(std::uint64_t frame) const override { return snapshot(frame).time_s; }
  const scene::Snapshot& snapshot(std::uint64_t frame) const override {
    return frames[static_cast<std::size_t>(frame - first)];
  }
  void read(const Signal& signal, std::uint64_t from, std::span<double> values) const override {
    for (std::size_t i = 0; i < values.size(); ++i)
      values[i] = signal.kind == Signal::Kind::kObject
                      ? object_value(signal, snapshot(from + i))
                      : metric_start + metric_step * static_cast<double>(from + i);
  }
  std::vector<Signal> run_signals() const override { return {{Signal::Kind::kMetric, "frame", 0, 0, 0}}; }
};

}  // namespace smartsurf::view
