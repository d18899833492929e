#pragma once

#include <algorithm>
#include <atomic>
#include <cstdint>
#include <memory>
#include <span>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "smartsurf/python/Arrays.h"
#include "smartsurf/python/EpisodeRecording.h"
#include "smartsurf/python/Exclusive.h"
#include "smartsurf/python/ObjectArrays.h"
#include "smartsurf/python/Pictures.h"
#include "smartsurf/python/WorldState.h"
#include "smartsurf/simulation/Environment.h"

namespace smartsurf::python {

// An experiment that Python steps (smartsurf/python/smartsurf/_simulation.py).
class Simulation {
 public:
  explicit Simulation(simulation::EnvironmentOptions options) : environment_(std::move(options)) {
    const scene::SurfaceSpec& surface = environment_.scene().surface;
    observation_ =
        Array<float>({static_cast<py::ssize_t>(environment_.observation_size()) / surface.cell_count(),
                      static_cast<py::ssize_t>(surface.rows), static_cast<py::ssize_t>(surface.columns)});
    targets_ =
        Array<float>({static_cast<py::ssize_t>(environment_.simulation().actuators().size()),
                      static_cast<py::ssize_t>(surface.rows), static_cast<py::ssize_t>(surface.columns)});
    refresh();
  }
  // Ends a recording that is still open with the episode as it is.
  ~Simulation() { recording_.stop_quietly(environment_); }

  // For what does not change after construction: another thread may be using the environment.
  const Environment& environment() const { return environment_; }
  // get(environment) of an environment that no other thread is using.
  template <class Get>
  auto read(const Get& get) const {
    const Exclusive use(in_use_);
    return get(environment_);
  }
  Array<float> observation() const { return observation_; }
  py::dict objects() {
    const Exclusive use(in_use_);
    return objects_.get(environment_.simulation().partial_snapshot());
  }

  // channels × rows × columns: the caller writes those of the next step, and each step, reset and restore
  // writes those in effect, the script's included.
  Array<float> targets() const { return targets_; }

  py::tuple step() {
    const Exclusive use(in_use_);
    simulation::StepResult result;
    {
      py::gil_scoped_release release;
      send_targets();
      result = environment_.step();
    }
    refresh();
    recording_.add(environment_);
    return py::make_tuple(result.reward, result.terminated, result.truncated);
  }
  void reset(std::uint64_t seed) {
    const Exclusive use(in_use_);
    recording_.stop(environment_);
    {
      py::gil_scoped_release release;
      environment_.reset(seed);
    }
    refresh();
  }
  void finish() {
    const Exclusive use(in_use_);
    environment_.finish();
  }
  void fail() {
    const Exclusive use(in_use_);
    environment_.fail();
  }
  // Records from the start of an episode to stop_recording(), or its end by reset() or restore().
  void record(const std::string& path, const std::string& command_line,
              const EpisodeRecording::Overrides& overrides) {
    const Exclusive use(in_use_);
    recording_.start(path, environment_, command_line, overrides);
  }
  void stop_recording() {
    const Exclusive use(in_use_);
    recording_.stop(environment_);
  }
  // The saved state includes the targets of the next step.
  py::bytes save() {
    const Exclusive use(in_use_);
    send_targets();
    return environment_.save();
  }
  void restore(const py::bytes& state) {
    const Exclusive use(in_use_);
    recording_.stop(environment_);
    environment_.restore(std::string_view(state));
    refresh();
  }
  py::tuple parameter(const std::string& name) {
    const Exclusive use(in_use_);
    return python::parameter(environment_, name);
  }
  void set_parameter(const std::string& name, const Array<double>& values) {
    const Exclusive use(in_use_);
    python::set_parameter(environment_, name, readable(values));
  }
  void randomise(const std::string& name, const Array<double>& low, const Array<double>& high) {
    const Exclusive use(in_use_);
    python::randomise(environment_, name, readable(low), readable(high));
  }
  ParameterSettings parameter_settings() const {
    const Exclusive use(in_use_);
    return python::parameter_settings(environment_);
  }
  void set_parameter_settings(const ParameterSettings& settings) {
    const Exclusive use(in_use_);
    python::set_parameter_settings(environment_, settings);
  }
  void place(const std::string& field, const std::vector<std::uint32_t>& ids, const Array<double>& values) {
    const Exclusive use(in_use_);
    python::place(environment_, field, ids, readable(values));
    recording_.mark_intervention(environment_);
    objects_.update(environment_.simulation().partial_snapshot());
  }
  void set_wrenches(const std::vector<std::uint32_t>& ids, const Array<double>& values) {
    const Exclusive use(in_use_);
    python::set_wrenches(environment_, ids, readable(values));
    recording_.mark_intervention(environment_);
  }
  std::vector<double> info(std::size_t size) {
    const Exclusive use(in_use_);
    std::vector<double> values(size);
    environment_.info(values);
    return values;
  }
  py::array_t<std::uint8_t> render(int width, int height, const CameraChoice& camera, bool fast) {
    const Exclusive use(in_use_);
    return to_array(python::render(environment_, fast ? fast_view_ : view_, width, height, camera, fast));
  }
  py::tuple render_range(int width, int height, const CameraChoice& camera) {
    const Exclusive use(in_use_);
    return python::render_range(environment_, width, height, camera);
  }

 private:
  void send_targets() {
    const std::span<const float> all = readable(targets_);
    const std::size_t cells = environment_.scene().surface.cell_count();
    for (std::size_t first = 0; first < all.size(); first += cells)
      environment_.set_targets(static_cast<int>(first / cells), all.subspan(first, cells));
  }
  void refresh() {
    environment_.observe(writable(observation_));
    float* to = targets_.mutable_data();
    for (const scene::ChannelData& channel : environment_.simulation().actuators())
      to = std::ranges::copy(channel.values, to).out;
    objects_.update(environment_.simulation().partial_snapshot());
  }

  mutable std::atomic_flag in_use_;
  Environment environment_;
  Array<float> observation_;  // of the latest tick: planes × rows × columns
  Array<float> targets_;
  ObjectArrays objects_;
  std::unique_ptr<view::OffscreenView> view_, fast_view_;
  EpisodeRecording recording_;
};

}  // namespace smartsurf::python
