// The compiled part of the Python package `smartsurf` (docs/python.md): environments and batches as NumPy
// arrays. The classes below are private to the package; its Python files wrap them.
#include <pybind11/numpy.h>
#include <pybind11/pybind11.h>
#include <pybind11/stl.h>

#include <algorithm>
#include <array>
#include <atomic>
#include <memory>
#include <optional>
#include <stdexcept>
#include <string>
#include <tuple>
#include <utility>
#include <vector>

#include "common/controller/Controller.h"
#include "common/error/UserError.h"
#include "smartsurf/extension/Extension.h"
#include "smartsurf/python/EpisodeRecording.h"
#include "smartsurf/scene/KindRegistry.h"
#include "smartsurf/simulation/Environment.h"
#include "smartsurf/simulation/EnvironmentBatch.h"
#include "smartsurf/simulation/EpisodeRandom.h"
#include "smartsurf/view/model/Camera.h"
#include "smartsurf/view/output/OffscreenView.h"
#include "smartsurf/view/output/RangeImage.h"
#include "smartsurf/view/window/Window.h"

namespace py = pybind11;

namespace smartsurf::python {
namespace {

using simulation::EnvironmentOptions;

template <class T>
using Array = py::array_t<T, py::array::c_style>;
using Metrics = std::vector<std::pair<std::string, double>>;

template <class T>
std::span<T> writable(Array<T>& array) {
  return std::span<T>(array.mutable_data(), array.size());
}
template <class T>
std::span<const T> readable(const Array<T>& array) {
  return std::span<const T>(array.data(), array.size());
}

py::dict to_dict(const Metrics& metrics) {
  py::dict out;
  for (const auto& [name, value] : metrics) out[py::str(name)] = value;
  return out;
}

// As text.
py::dict option_values(const Environment& environment) {
  py::dict options;
  for (const scene::OptionSpec& option : environment.scene().options)
    options[py::str(option.name)] = option.value;
  return options;
}

// Describes the experiment to the Python files: rows, columns, pitch, period, channels, fields of info{}.
py::dict describe(const Environment& environment) {
  const scene::SceneSpec& scene = environment.scene();
  py::list sensors, actuators, info, positions;
  for (const scene::SensorSpec& sensor : scene.surface.sensors)
    for (const scene::SensorChannel& channel : scene::find_sensor_kind(sensor.model)->channels(sensor))
      sensors.append(
          py::make_tuple(channel.name, channel.components, channel.minimum, channel.maximum, channel.unit));
  for (const scene::ActuatorChannel& channel : scene.surface.actuator_channels())
    actuators.append(
        py::make_tuple(channel.name, channel.minimum, channel.maximum, channel.safe_value, channel.unit));
  for (const auto& field : environment.info_fields()) info.append(py::make_tuple(field.name, field.size));
  py::list extensions;
  for (const scene::Extension& extension : scene.surface.extensions()) extensions.append(extension.name);
  py::list objects;  // the labels of the declared ones
  for (const scene::ObjectSpec& object : scene.objects) objects.append(object.label);
  using namespace py::literals;
  return py::dict("rows"_a = scene.surface.rows, "columns"_a = scene.surface.columns,
                  "pitch"_a = scene.surface.pitch, "period"_a = scene.world.control_period_s,
                  "steps_per_tick"_a = scene.world.steps_per_tick(), "sensors"_a = sensors,
                  "actuators"_a = actuators, "info"_a = info, "options"_a = option_values(environment),
                  "has_reward"_a = environment.experiment().has_reward(),
                  "episode_seconds"_a = environment.experiment().episode_s(), "objects"_a = objects,
                  "extensions"_a = extensions, "engine"_a = scene.world.engine);
}

// What a picture shows: a preset or "X,Y,Z:X,Y,Z", where the camera is and its target, and the object that it
// follows, or −1.
using CameraChoice = std::pair<std::string, int>;

view::CameraView camera_view(const std::string& text) {
  view::CameraView view;
  if (text == "top" || text == "side")
    view.preset = text == "top" ? view::CameraPreset::kTop : view::CameraPreset::kSide;
  else if (text != "iso" && !(view.pose = view::parse_camera_pose(text)))
    throw common::UserError("camera = '" + text +
                            "': must be 'iso', 'top', 'side', or a position above a target");
  return view;
}

view::Camera make_camera(const Environment& environment, const CameraChoice& choice, int width, int height) {
  view::Camera camera = view::Camera::from_view(environment.scene().surface, camera_view(choice.first),
                                                static_cast<double>(width) / std::max(height, 1));
  if (choice.second < 0) return camera;
  const scene::Snapshot& snapshot = environment.simulation().snapshot();
  const auto it = std::ranges::lower_bound(snapshot.id, static_cast<scene::ObjectId>(choice.second));
  if (it == snapshot.id.end() || *it != static_cast<scene::ObjectId>(choice.second))
    throw common::UserError("camera: object " + std::to_string(choice.second) + " is not alive");
  const auto& p = snapshot.position[it - snapshot.id.begin()];
  camera.look_at({p[0], p[1], p[2]});
  return camera;
}

common::Image render(const Environment& environment, std::unique_ptr<view::OffscreenView>& view, int width,
                     int height, const CameraChoice& camera, bool fast) {
  view::OffscreenView::require_available();
  const scene::SceneSpec& scene = environment.scene();
  if (!view)
    view = std::make_unique<view::OffscreenView>(scene, fast ? view::Detail::kFast : view::Detail::kSmooth);
  return view->render(environment.simulation().snapshot(), environment.simulation().catalogue(),
                      make_camera(environment, camera, width, height), {}, width, height);
}

// (depth, segmentation)
py::tuple render_range(const Environment& environment, int width, int height, const CameraChoice& camera) {
  view::RangeImage image;
  {
    py::gil_scoped_release release;
    image = view::capture_range(environment.scene().surface,
                                {environment.simulation().snapshot(), environment.simulation().catalogue()},
                                make_camera(environment, camera, width, height), width, height);
  }
  const std::vector<py::ssize_t> shape{height, width};
  return py::make_tuple(py::array_t<float>(shape, image.depth.data()),
                        py::array_t<std::int32_t>(shape, image.segmentation.data()));
}

py::array_t<std::uint8_t> to_array(const common::Image& image) {
  return py::array_t<std::uint8_t>({image.height, image.width, 3}, image.rgb.data());
}

// ---- the parameters and the state of one world, whose arrays the Python files have checked

// (shape, the numbers, whether they are whole, whether a fault of cells)
py::tuple parameter(const Environment& environment, const std::string& name) {
  const simulation::SceneParameter found = environment.find_parameter(name);
  return py::make_tuple(found.shape(), environment.parameter(found), found.is_whole(), found.is_per_cell());
}

void set_parameter(Environment& environment, const std::string& name, std::span<const double> values) {
  const simulation::SceneParameter found = environment.find_parameter(name);
  if (values.size() != found.size())
    throw common::UserError("parameter '" + name + "' has " + std::to_string(found.size()) +
                            " numbers in this world");
  environment.set_parameter(found, values);
}

void randomise(Environment& environment, const std::string& name, std::span<const double> low,
               std::span<const double> high) {
  const simulation::SceneParameter found = environment.find_parameter(name);
  if (!low.empty() && low.size() != found.size())
    throw common::UserError("parameter '" + name + "' has " + std::to_string(found.size()) +
                            " numbers in this world");
  environment.randomise(found, low, high);
}

// What set_parameter() and randomise() have set: (name, values) and (name, low, high).
using NamedRange = std::tuple<std::string, std::vector<double>, std::vector<double>>;
using ParameterSettings = std::pair<Environment::Values, std::vector<NamedRange>>;

ParameterSettings parameter_settings(const Environment& environment) {
  auto [values, ranges] = environment.parameter_settings();
  ParameterSettings out{std::move(values), {}};
  for (auto& [name, low, high] : ranges)
    out.second.emplace_back(std::move(name), std::move(low), std::move(high));
  return out;
}

void set_parameter_settings(Environment& environment, const ParameterSettings& given) {
  Environment::ParameterSettings settings{given.first, {}};
  for (const auto& [name, low, high] : given.second) settings.ranges.push_back({name, low, high});
  environment.set_parameter_settings(std::move(settings));
}

void require_alive(bool alive, std::uint32_t id) {
  if (!alive) throw common::UserError("object " + std::to_string(id) + " is not alive");
}

void place(Environment& environment, const std::string& field, const std::vector<std::uint32_t>& ids,
           std::span<const double> values) {
  const std::size_t size = ids.empty() ? 0 : values.size() / ids.size();
  for (std::size_t i = 0; i < ids.size(); ++i) {
    const double* const v = &values[i * size];
    scene::ObjectStateUpdate update;
    if (field == "position")
      update.position = Eigen::Vector3d(v);
    else if (field == "orientation")
      update.orientation = Eigen::Quaterniond(Eigen::Vector4d(v)).normalized();
    else if (field == "velocity")
      update.velocity = Eigen::Vector3d(v);
    else
      update.angular_velocity = Eigen::Vector3d(v);
    require_alive(environment.place(ids[i], update), ids[i]);
  }
}

void set_wrenches(Environment& environment, const std::vector<std::uint32_t>& ids,
                  std::span<const double> values) {
  for (std::size_t i = 0; i < ids.size(); ++i) {
    const Eigen::Map<const Eigen::Matrix<double, 6, 1>> v(&values[i * 6]);
    const surface::Wrench wrench{v.head<3>().cast<float>(), v.tail<3>().cast<float>()};
    require_alive(environment.set_wrench(ids[i], wrench), ids[i]);
  }
}

// Held during a call: other Python threads run while worlds compute, and may not use the same worlds
// meanwhile.
class Exclusive {
 public:
  explicit Exclusive(std::atomic_flag& in_use) : in_use_(in_use) {
    if (in_use_.test_and_set())
      throw std::runtime_error("another thread is using this environment: call it from one thread at a time");
  }
  ~Exclusive() { in_use_.clear(); }
  Exclusive(const Exclusive&) = delete;
  Exclusive& operator=(const Exclusive&) = delete;

 private:
  std::atomic_flag& in_use_;
};

// Views of the object states of the latest tick. An array that the caller holds stays valid: it follows the
// simulation while the number of objects does not change.
class ObjectArrays {
 public:
  void update(const scene::Snapshot& snapshot) {
    if (!requested_) return;
    if (id_.size() != std::ssize(snapshot.id)) allocate(snapshot.object_count());
    std::ranges::copy(snapshot.id, id_.mutable_data());
    copy(snapshot.position, position_);
    copy(snapshot.orientation, orientation_);
    copy(snapshot.velocity, velocity_);
    copy(snapshot.angular_velocity, angular_velocity_);
  }
  py::dict get(const scene::Snapshot& snapshot) {
    if (!std::exchange(requested_, true)) allocate(snapshot.object_count());
    update(snapshot);
    using namespace py::literals;
    return py::dict("id"_a = id_, "position"_a = position_, "orientation"_a = orientation_,
                    "velocity"_a = velocity_, "angular_velocity"_a = angular_velocity_);
  }

 private:
  void allocate(std::size_t count) {
    const auto n = static_cast<py::ssize_t>(count);
    id_ = Array<std::uint32_t>(std::vector{n});  // from a number, pybind11 makes an array without a stride
    const auto make = [n](py::ssize_t width) { return Array<float>({n, width}); };
    position_ = make(3);
    orientation_ = make(4);
    velocity_ = make(3);
    angular_velocity_ = make(3);
  }
  template <std::size_t size>
  static void copy(const std::vector<std::array<float, size>>& from, Array<float>& to) {
    std::memcpy(to.mutable_data(), from.data(), from.size() * sizeof from[0]);
  }

  bool requested_ = false;
  Array<std::uint32_t> id_{py::ssize_t{0}};
  Array<float> position_, orientation_, velocity_, angular_velocity_;
};

class Simulation {
 public:
  explicit Simulation(EnvironmentOptions options) : environment_(std::move(options)) {
    const scene::SurfaceSpec& surface = environment_.scene().surface;
    observation_ =
        Array<float>({static_cast<py::ssize_t>(environment_.observation_size()) / surface.cell_count(),
                      static_cast<py::ssize_t>(surface.rows), static_cast<py::ssize_t>(surface.columns)});
    refresh();
  }

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

  // targets: channels × rows × columns.
  py::tuple step(const Array<float>& targets) {
    const Exclusive use(in_use_);
    simulation::StepResult result;
    const std::span<const float> all = readable(targets);
    const std::size_t cells = environment_.scene().surface.cell_count();
    {
      py::gil_scoped_release release;
      for (std::size_t first = 0; first < all.size(); first += cells)
        environment_.set_targets(static_cast<int>(first / cells), all.subspan(first, cells));
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
  py::bytes save() {
    const Exclusive use(in_use_);
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
  // The actuator targets in effect: channels × rows × columns, a copy.
  Array<float> targets() const {
    const Exclusive use(in_use_);
    const auto channels = environment_.simulation().actuators();
    const scene::SurfaceSpec& surface = environment_.scene().surface;
    Array<float> out({static_cast<py::ssize_t>(channels.size()), static_cast<py::ssize_t>(surface.rows),
                      static_cast<py::ssize_t>(surface.columns)});
    float* to = out.mutable_data();
    for (const scene::ChannelData& channel : channels) to = std::ranges::copy(channel.values, to).out;
    return out;
  }

 private:
  void refresh() {
    environment_.observe(writable(observation_));
    objects_.update(environment_.simulation().partial_snapshot());
  }

  mutable std::atomic_flag in_use_;
  Environment environment_;
  Array<float> observation_;  // of the latest tick: planes × rows × columns
  ObjectArrays objects_;
  std::unique_ptr<view::OffscreenView> view_, fast_view_;
  EpisodeRecording recording_;
};

// The simulator's window, which shows a simulation that Python steps. Main thread only, one per process.
class Window {
 public:
  Window(const Simulation& simulation, const std::string& title, int width, int height,
         const CameraChoice& camera)
      : window_(simulation.environment().scene(), title, width, height) {
    view::ViewSettings settings;
    settings.camera = camera_view(camera.first);
    window_.apply(settings);
  }
  // False once the user has closed it or the display is lost; then it must not be called again.
  bool show(const Simulation& simulation) {
    return simulation.read([this](const Environment& environment) {
      view::Status status;
      status.mode = "Python";
      status.metrics = environment.metrics();
      const view::Commands commands = window_.render_frame(
          {environment.simulation().snapshot(), environment.simulation().catalogue()}, status);
      return !commands.quit && !commands.display_lost;
    });
  }

 private:
  view::Window window_;
};

// The arrays of a batch are NumPy arrays that the caller allocates once and the batch keeps.
class Batch {
 public:
  using Overrides = std::vector<EnvironmentBatch::Overrides>;
  Batch(EnvironmentOptions options, const std::vector<std::uint64_t>& seeds, int threads, int autoreset,
        const Overrides& overrides)
      : has_controller_(options.controller != nullptr),
        batch_(make_batch(std::move(options), seeds, threads, static_cast<simulation::Autoreset>(autoreset),
                          overrides)) {
    const Environment& first = batch_->world(0);
    const scene::SurfaceSpec& surface = first.scene().surface;
    action_shape_ = {batch_->world_count(), static_cast<py::ssize_t>(surface.actuator_channels().size()),
                     surface.rows, surface.columns};
  }

  // For what does not change after construction: another thread may be using the worlds.
  const EnvironmentBatch& batch() const { return *batch_; }
  const Environment& world(int index) const { return batch_->world(check(index)); }
  // get(batch, index) of a world that no other thread is using.
  template <class Get>
  auto read(int index, const Get& get) const {
    const Exclusive use(in_use_);
    return get(*batch_, check(index));
  }

  // Each state: observations, info, seeds, success, actions that are not finite, objects, time. Empty arrays
  // are not written.
  using State = std::tuple<Array<float>, Array<double>, Array<std::uint64_t>, Array<std::uint8_t>,
                           Array<std::int64_t>, Array<float>, Array<double>>;
  void bind(State state, State final_state, Array<double> rewards, Array<std::uint8_t> terminated,
            Array<std::uint8_t> truncated) {
    arrays_ = {
        {}, views(state), views(final_state), writable(rewards), writable(terminated), writable(truncated)};
    bound_ = py::make_tuple(state, final_state, rewards, terminated, truncated);
  }
  // Returns whether an episode has ended. Without a controller it returns None, and makes no step, if the
  // actions are not a float32 array of worlds × channels × rows × columns.
  py::object step(const py::object& given) {
    const Exclusive use(in_use_);
    simulation::BatchArrays arrays = arrays_;
    if (!has_controller_) {
      if (!py::isinstance<Array<float>>(given)) return py::none();
      const auto actions = py::reinterpret_borrow<Array<float>>(given);
      if (actions.ndim() != 4 || !std::equal(action_shape_.begin(), action_shape_.end(), actions.shape()))
        return py::none();
      arrays.actions = readable(actions);
    }
    {
      py::gil_scoped_release release;
      batch_->step(arrays);
    }
    const auto any = [](std::span<const std::uint8_t> flags) {
      return std::ranges::find(flags, 1) != flags.end();
    };
    return py::bool_(any(arrays_.terminated) || any(arrays_.truncated));
  }
  // Returns the worlds that could not start.
  std::vector<int> reset(const std::vector<std::uint64_t>& seeds, const std::vector<std::uint8_t>& mask) {
    const Exclusive use(in_use_);
    py::gil_scoped_release release;
    batch_->reset(seeds, mask, arrays_);
    std::vector<int> failed;
    for (int i = 0; i < batch_->world_count(); ++i)
      if (!batch_->error(i).empty()) failed.push_back(i);
    return failed;
  }
  py::bytes save(int index) {
    const Exclusive use(in_use_);
    return batch_->save(check(index));
  }
  void restore(int index, const py::bytes& state) {
    const Exclusive use(in_use_);
    batch_->restore(check(index), std::string_view(state), arrays_);
  }
  void end_episodes(const std::vector<std::uint8_t>& mask) {
    const Exclusive use(in_use_);
    py::gil_scoped_release release;
    batch_->end_episodes(mask, arrays_);
  }
  // ---- parameters and states of some worlds; `worlds` are indices, the values' first axis

  py::list parameter(const std::string& name) {
    const Exclusive use(in_use_);
    py::list out;
    for (int i = 0; i < batch_->world_count(); ++i)
      out.append(python::parameter(batch_->mutable_world(i), name));
    return out;
  }
  void set_parameter(const std::string& name, const std::vector<int>& worlds, const Array<double>& values) {
    const Exclusive use(in_use_);
    change_parameters(worlds, values.size(), [&](int world, std::size_t row, std::size_t size) {
      python::set_parameter(batch_->mutable_world(world), name, readable(values).subspan(row * size, size));
    });
  }
  void randomise(const std::string& name, const std::vector<int>& worlds, const Array<double>& low,
                 const Array<double>& high) {
    const Exclusive use(in_use_);
    change_parameters(worlds, low.size(), [&](int world, std::size_t row, std::size_t size) {
      python::randomise(batch_->mutable_world(world), name, readable(low).subspan(row * size, size),
                        readable(high).subspan(row * size, size));
    });
  }
  ParameterSettings parameter_settings(int index) const {
    const Exclusive use(in_use_);
    return python::parameter_settings(world(index));
  }
  void set_parameter_settings(int index, const ParameterSettings& settings) {
    const Exclusive use(in_use_);
    python::set_parameter_settings(batch_->mutable_world(check(index)), settings);
  }
  // values: worlds × ids × numbers of the field.
  void place(const std::string& field, const std::vector<int>& worlds, const std::vector<std::uint32_t>& ids,
             const Array<double>& values) {
    const Exclusive use(in_use_);
    for_each(worlds, values.size(), [&](int world, std::size_t row, std::size_t size) {
      python::place(batch_->mutable_world(world), field, ids, readable(values).subspan(row * size, size));
    });
    batch_->observe_objects(arrays_.state);
    mark_intervention(worlds);
  }
  // values: worlds × ids × 6, force and torque.
  void set_wrenches(const std::vector<int>& worlds, const std::vector<std::uint32_t>& ids,
                    const Array<double>& values) {
    const Exclusive use(in_use_);
    for_each(worlds, values.size(), [&](int world, std::size_t row, std::size_t size) {
      python::set_wrenches(batch_->mutable_world(world), ids, readable(values).subspan(row * size, size));
    });
    mark_intervention(worlds);
  }
  // Records the episodes of these worlds from the next resets on.
  void record(const std::string& folder, const std::string& command_line, const std::vector<int>& worlds,
              std::uint64_t every, const Overrides& overrides) {
    const Exclusive use(in_use_);
    for (const int world : worlds) check(world);
    recorder_ = std::make_unique<BatchRecorder>(folder, command_line, worlds, every, overrides);
    batch_->observe_episodes(recorder_.get());
  }
  void stop_recording() {
    const Exclusive use(in_use_);
    batch_->observe_episodes(nullptr);
    if (!recorder_) return;
    for (int i = 0; i < batch_->world_count(); ++i) recorder_->on_end(i, batch_->world(i));
    recorder_.reset();
  }
  void observe_objects() {
    const Exclusive use(in_use_);
    batch_->observe_objects(arrays_.state);
  }
  py::array_t<std::uint8_t> render(int index, int width, int height, const CameraChoice& camera) {
    const Exclusive use(in_use_);
    return to_array(python::render(world(index), view_, width, height, camera, /*fast=*/true));
  }

 private:
  static simulation::StateArrays views(State& state) {
    auto& [observations, info, seeds, success, nonfinite_actions, objects, time] = state;
    return {writable(observations),      writable(info),    writable(seeds), writable(success),
            writable(nonfinite_actions), writable(objects), writable(time)};
  }
  static std::unique_ptr<EnvironmentBatch> make_batch(EnvironmentOptions options,
                                                      const std::vector<std::uint64_t>& seeds, int threads,
                                                      simulation::Autoreset autoreset,
                                                      const Overrides& overrides) {
    py::gil_scoped_release release;
    return std::make_unique<EnvironmentBatch>(std::move(options), seeds, threads, autoreset, overrides);
  }
  // Calls work(world, row of the values, numbers in a row) for each world; an error gets its number.
  template <class Work>
  void for_each(const std::vector<int>& worlds, std::size_t numbers, const Work& work) {
    for (std::size_t row = 0; row < worlds.size(); ++row) {
      const int world = check(worlds[row]);
      try {
        work(world, row, numbers / worlds.size());
      } catch (const common::UserError& error) {
        throw common::UserError("world " + std::to_string(world) + ": " + error.what());
      }
    }
  }
  // As for_each(), for parameters: after an error all worlds have those from before.
  template <class Work>
  void change_parameters(const std::vector<int>& worlds, std::size_t numbers, const Work& work) {
    std::vector<Environment::ParameterSettings> before;
    for (const int world : worlds) before.push_back(batch_->world(check(world)).parameter_settings());
    try {
      for_each(worlds, numbers, work);
    } catch (const common::UserError&) {
      for (std::size_t row = 0; row < worlds.size(); ++row)
        batch_->mutable_world(worlds[row]).set_parameter_settings(std::move(before[row]));
      throw;
    }
  }
  void mark_intervention(const std::vector<int>& worlds) {
    if (!recorder_) return;
    for (const int world : worlds) recorder_->on_intervention(world, batch_->world(world));
  }
  int check(int index) const {
    if (index < 0 || index >= batch_->world_count())
      throw py::index_error("world " + std::to_string(index) + ": there are " +
                            std::to_string(batch_->world_count()));
    return index;
  }

  mutable std::atomic_flag in_use_;
  bool has_controller_;
  std::unique_ptr<EnvironmentBatch> batch_;
  std::array<py::ssize_t, 4> action_shape_{};
  simulation::BatchArrays arrays_;
  std::unique_ptr<BatchRecorder> recorder_;
  py::tuple bound_;  // owns the arrays that arrays_ views
  std::unique_ptr<view::OffscreenView> view_;
};

// Row i: the numbers of seed i.
Array<double> draw_uniform(const std::vector<std::uint64_t>& seeds, const std::string& purpose, int count) {
  Array<double> out({static_cast<py::ssize_t>(seeds.size()), static_cast<py::ssize_t>(count)});
  const std::span<double> numbers = writable(out);
  for (std::size_t i = 0; i < seeds.size(); ++i)
    simulation::draw_uniform(seeds[i], purpose, numbers.subspan(i * count, count));
  return out;
}

EnvironmentOptions make_options(std::string experiment, std::string engine,
                                std::vector<std::pair<std::string, std::string>> overrides,
                                std::optional<std::uint64_t> seed, int threads,
                                std::optional<std::string> source) {
  EnvironmentOptions options;
  options.source = std::move(source);
  options.experiment = std::move(experiment);
  options.overrides = std::move(overrides);
  options.seed = seed;
  if (!engine.empty()) options.engine = std::move(engine);
  options.threads = threads;
  options.fixed_channels = true;
  return options;
}

// What a capsule of the package `apron` holds; null for None.
std::shared_ptr<const common::ControllerFactory> controller_factory(const py::object& capsule) {
  if (capsule.is_none()) return nullptr;
  void* const factory = PyCapsule_GetPointer(capsule.ptr(), common::kControllerCapsule);
  if (factory == nullptr) {
    PyErr_Clear();
    throw py::type_error("the packages apron and smartsurf are of different versions: install them together");
  }
  return *static_cast<std::shared_ptr<const common::ControllerFactory>*>(factory);
}

}  // namespace

PYBIND11_MODULE(_core, m) {
  m.attr("__version__") = SMARTSURF_VERSION;
  py::register_exception<common::UserError>(m, "Error", PyExc_ValueError).doc() =
      "An error in an experiment, a value or a file, in one line.";

  m.def("load_extension", [](const std::string& path) { extension::load(path); });
  m.def("next_seed", &simulation::next_seed);
  m.def("draw_uniform", &draw_uniform);

  using Overrides = std::vector<std::pair<std::string, std::string>>;
  m.def("option_values", [](std::string experiment, Overrides overrides, std::optional<std::string> source) {
    return option_values(Environment(
        make_options(std::move(experiment), "", std::move(overrides), std::nullopt, 1, std::move(source)),
        Environment::Start::kLater));
  });
  py::class_<Simulation>(m, "Simulation")
      .def(py::init([](std::string experiment, std::string engine, Overrides overrides,
                       std::optional<std::uint64_t> seed, int threads, std::optional<std::string> source) {
        return std::make_unique<Simulation>(make_options(std::move(experiment), std::move(engine),
                                                         std::move(overrides), seed, threads,
                                                         std::move(source)));
      }))
      .def("describe", [](const Simulation& s) { return describe(s.environment()); })
      .def_property_readonly("observation", &Simulation::observation)
      .def_property_readonly("objects", &Simulation::objects)
      .def_property_readonly("targets", &Simulation::targets)
      .def_property_readonly("metrics",
                             [](const Simulation& s) {
                               return s.read([](const Environment& e) { return to_dict(e.metrics()); });
                             })
      .def_property_readonly(
          "tick",
          [](const Simulation& s) {
            return s.read([](const Environment& e) { return e.simulation().partial_snapshot().tick; });
          })
      .def_property_readonly(
          "time",
          [](const Simulation& s) {
            return s.read([](const Environment& e) { return e.simulation().partial_snapshot().time_s; });
          })
      .def_property_readonly(
          "state_hash",
          [](const Simulation& s) {
            return s.read([](const Environment& e) { return e.simulation().snapshot().state_hash; });
          })
      .def_property_readonly(
          "seed", [](const Simulation& s) { return s.read([](const Environment& e) { return e.seed(); }); })
      .def_property_readonly(
          "success",
          [](const Simulation& s) { return s.read([](const Environment& e) { return e.has_succeeded(); }); })
      .def_property_readonly(
          "object_count",
          [](const Simulation& s) {
            return s.read([](const Environment& e) { return e.simulation().catalogue().size(); });
          })
      .def("label",
           [](const Simulation& s, std::uint32_t id) {
             return s.read([id](const Environment& e) { return e.simulation().label(id); });
           })
      .def_property_readonly("has_running_episode",
                             [](const Simulation& s) {
                               return s.read([](const Environment& e) { return e.has_running_episode(); });
                             })
      .def("step", &Simulation::step)
      .def("reset", &Simulation::reset)
      .def("fail", &Simulation::fail)
      .def("finish", &Simulation::finish)
      .def("record", &Simulation::record)
      .def("stop_recording", &Simulation::stop_recording)
      .def("save", &Simulation::save)
      .def("restore", &Simulation::restore)
      .def("info", &Simulation::info)
      .def("parameter_names",
           [](const Simulation& s) { return simulation::SceneParameter::names(s.environment().scene()); })
      .def("parameter", &Simulation::parameter)
      .def("set_parameter", &Simulation::set_parameter)
      .def("randomise", &Simulation::randomise)
      .def("parameter_settings", &Simulation::parameter_settings)
      .def("set_parameter_settings", &Simulation::set_parameter_settings)
      .def("place", &Simulation::place)
      .def("set_wrenches", &Simulation::set_wrenches)
      .def("render", &Simulation::render)
      .def("render_range", &Simulation::render_range);

  py::class_<Window>(m, "Window")
      .def(py::init<const Simulation&, const std::string&, int, int, const CameraChoice&>())
      .def("show", &Window::show);

  py::class_<Batch>(m, "Batch")
      .def(py::init([](std::string experiment, std::string engine, Overrides overrides,
                       const std::vector<std::uint64_t>& seeds, int threads, int autoreset,
                       std::optional<std::uint64_t> max_ticks, const Batch::Overrides& of_worlds,
                       std::optional<std::string> source, const py::object& controllers) {
        EnvironmentOptions options = make_options(std::move(experiment), std::move(engine),
                                                  std::move(overrides), std::nullopt, 1, std::move(source));
        options.max_ticks = max_ticks;
        options.controller = controller_factory(controllers);
        return std::make_unique<Batch>(std::move(options), seeds, threads, autoreset, of_worlds);
      }))
      .def("describe", [](const Batch& b) { return describe(b.world(0)); })
      .def_property_readonly("observation_size", [](const Batch& b) { return b.batch().observation_size(); })
      .def_property_readonly("info_size", [](const Batch& b) { return b.batch().info_size(); })
      .def_property_readonly("object_count", [](const Batch& b) { return b.batch().object_count(); })
      .def_property_readonly("thread_count", [](const Batch& b) { return b.batch().thread_count(); })
      .def("options", [](const Batch& b, int index) { return option_values(b.world(index)); })
      .def("end_episodes", &Batch::end_episodes)
      .def("parameter_names",
           [](const Batch& b) { return simulation::SceneParameter::names(b.world(0).scene()); })
      .def("parameter", &Batch::parameter)
      .def("set_parameter", &Batch::set_parameter)
      .def("randomise", &Batch::randomise)
      .def("parameter_settings", &Batch::parameter_settings)
      .def("set_parameter_settings", &Batch::set_parameter_settings)
      .def("place", &Batch::place)
      .def("set_wrenches", &Batch::set_wrenches)
      .def("record", &Batch::record)
      .def("stop_recording", &Batch::stop_recording)
      .def("observe_objects", &Batch::observe_objects)
      .def("bind", &Batch::bind)
      .def("step", &Batch::step)
      .def("reset", &Batch::reset)
      .def("save", &Batch::save)
      .def("restore", &Batch::restore)
      .def("started_seed",
           [](const Batch& b, int index) {
             return b.read(index, [](const EnvironmentBatch& batch, int i) { return batch.started_seed(i); });
           })
      .def("error",
           [](const Batch& b, int index) {
             return b.read(index, [](const EnvironmentBatch& batch, int i) { return batch.error(i); });
           })
      .def("has_running_episode",
           [](const Batch& b, int index) {
             return b.read(index,
                           [](const EnvironmentBatch& batch, int i) { return batch.has_running_episode(i); });
           })
      .def("episode_over",
           [](const Batch& b, int index) {
             return b.read(index, [](const EnvironmentBatch& batch, int i) { return batch.episode_over(i); });
           })
      .def("final_metrics",
           [](const Batch& b, int index) {
             return b.read(
                 index, [](const EnvironmentBatch& batch, int i) { return to_dict(batch.final_metrics(i)); });
           })
      .def("metrics",
           [](const Batch& b, int index) {
             return b.read(index, [](const EnvironmentBatch& batch, int i) {
               return to_dict(batch.world(i).metrics());
             });
           })
      .def("state_hash",
           [](const Batch& b, int index) {
             return b.read(index, [](const EnvironmentBatch& batch, int i) {
               return batch.world(i).simulation().snapshot().state_hash;
             });
           })
      .def("render", &Batch::render);
}

}  // namespace smartsurf::python
