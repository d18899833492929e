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

#include "common/error/UserError.h"
#include "smartsurf/extension/Extension.h"
#include "smartsurf/scene/KindRegistry.h"
#include "smartsurf/simulation/Environment.h"
#include "smartsurf/simulation/EnvironmentBatch.h"
#include "smartsurf/view/model/Camera.h"
#include "smartsurf/view/output/OffscreenView.h"

namespace py = pybind11;

namespace smartsurf::python {
namespace {

using simulation::Environment;
using simulation::EnvironmentBatch;
using simulation::EnvironmentOptions;

template <class T>
using Array = py::array_t<T, py::array::c_style>;
using Metrics = std::vector<std::pair<std::string, double>>;

template <class T>
std::span<T> writable(Array<T>& array) {
  return {array.mutable_data(), static_cast<std::size_t>(array.size())};
}
template <class T>
std::span<const T> readable(const Array<T>& array) {
  return {array.data(), static_cast<std::size_t>(array.size())};
}

py::dict to_dict(const Metrics& metrics) {
  py::dict out;
  for (const auto& [name, value] : metrics) out[py::str(name)] = value;
  return out;
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
  for (const auto& field : environment.experiment().info_fields())
    info.append(py::make_tuple(field.name, field.size));
  py::dict options;
  for (const scene::OptionSpec& option : scene.options) options[py::str(option.name)] = option.value;
  using namespace py::literals;
  return py::dict("rows"_a = scene.surface.rows, "columns"_a = scene.surface.columns,
                  "pitch"_a = scene.surface.pitch, "period"_a = scene.world.control_period_s,
                  "steps_per_tick"_a = scene.world.steps_per_tick(), "sensors"_a = sensors,
                  "actuators"_a = actuators, "info"_a = info, "options"_a = options,
                  "has_reward"_a = environment.experiment().has_reward(),
                  "episode_seconds"_a = environment.experiment().episode_s(),
                  "engine"_a = environment.simulation().engine().name());
}

common::Image render(const Environment& environment, std::unique_ptr<view::OffscreenView>& view, int width,
                     int height, const std::string& camera) {
  view::OffscreenView::require_available();
  const auto preset =
      camera == "iso"   ? view::CameraPreset::kIso
      : camera == "top" ? view::CameraPreset::kTop
      : camera == "side"
          ? view::CameraPreset::kSide
          : throw common::UserError("render: camera = '" + camera + "': must be 'iso', 'top' or 'side'");
  const scene::SceneSpec& scene = environment.scene();
  if (!view) view = std::make_unique<view::OffscreenView>(scene, view::Detail::kVideo);
  const auto fitted =
      view::Camera::fit_to_surface(scene.surface, preset, static_cast<double>(width) / std::max(height, 1));
  return view->render(environment.simulation().snapshot(), environment.simulation().catalogue(), fitted, {},
                      width, height);
}

py::array_t<std::uint8_t> to_array(const common::Image& image) {
  return py::array_t<std::uint8_t>({image.height, image.width, 3}, image.rgb.data());
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
    if (static_cast<std::size_t>(id_.size()) != snapshot.object_count()) allocate(snapshot.object_count());
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
    id_ = Array<std::uint32_t>(n);
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

  const Environment& environment() const { return environment_; }
  Array<float> observation() const { return observation_; }
  py::dict objects() { return objects_.get(environment_.simulation().snapshot()); }

  void set_targets(int channel, const Array<float>& values) {
    const Exclusive use(in_use_);
    environment_.set_targets(channel, readable(values));
  }
  py::tuple step() {
    const Exclusive use(in_use_);
    simulation::StepResult result;
    {
      py::gil_scoped_release release;
      result = environment_.step();
    }
    refresh();
    return py::make_tuple(result.reward, result.terminated, result.truncated, result.success);
  }
  void reset(std::uint64_t seed) {
    const Exclusive use(in_use_);
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
  py::bytes save() {
    const Exclusive use(in_use_);
    return environment_.save();
  }
  void restore(const py::bytes& state) {
    const Exclusive use(in_use_);
    environment_.restore(std::string_view(state));
    refresh();
  }
  std::vector<double> info(std::size_t size) {
    const Exclusive use(in_use_);
    std::vector<double> values(size);
    environment_.info(values);
    return values;
  }
  py::array_t<std::uint8_t> render(int width, int height, const std::string& camera) {
    const Exclusive use(in_use_);
    return to_array(python::render(environment_, view_, width, height, camera));
  }
  // The actuator targets in effect: channels × rows × columns, a copy.
  Array<float> targets() const {
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
    objects_.update(environment_.simulation().snapshot());
  }

  std::atomic_flag in_use_;
  Environment environment_;
  Array<float> observation_;  // of the latest tick: planes × rows × columns
  ObjectArrays objects_;
  std::unique_ptr<view::OffscreenView> view_;
};

// The arrays of a batch are NumPy arrays that the caller allocates once and the batch keeps.
class Batch {
 public:
  Batch(EnvironmentOptions options, const std::vector<std::uint64_t>& seeds, int threads, int autoreset)
      : batch_(
            make_batch(std::move(options), seeds, threads, static_cast<simulation::Autoreset>(autoreset))) {
    const Environment& first = batch_->world(0);
    action_shape_ = {batch_->world_count(), static_cast<py::ssize_t>(first.simulation().actuators().size()),
                     first.scene().surface.rows, first.scene().surface.columns};
  }

  const EnvironmentBatch& batch() const { return *batch_; }
  const Environment& world(int index) const { return batch_->world(check(index)); }

  // Each state: observations, info, seeds, success, actions that are not finite.
  using State =
      std::tuple<Array<float>, Array<double>, Array<std::uint64_t>, Array<std::uint8_t>, Array<std::int64_t>>;
  void bind(State state, State final_state, Array<double> rewards, Array<std::uint8_t> terminated,
            Array<std::uint8_t> truncated) {
    arrays_ = {
        {}, views(state), views(final_state), writable(rewards), writable(terminated), writable(truncated)};
    bound_ = py::make_tuple(state, final_state, rewards, terminated, truncated);
  }
  // Returns whether an episode has ended. Returns None, without a step, if the actions are not a float32
  // array of worlds × channels × rows × columns.
  py::object step(const py::object& given) {
    const Exclusive use(in_use_);
    if (!py::isinstance<Array<float>>(given)) return py::none();
    const auto actions = py::reinterpret_borrow<Array<float>>(given);
    if (actions.ndim() != 4 || !std::equal(action_shape_.begin(), action_shape_.end(), actions.shape()))
      return py::none();
    simulation::BatchArrays arrays = arrays_;
    arrays.actions = readable(actions);
    {
      py::gil_scoped_release release;
      batch_->step(arrays);
    }
    const auto any = [](std::span<const std::uint8_t> flags) {
      return std::ranges::find(flags, 1) != flags.end();
    };
    return py::bool_(any(arrays_.terminated) || any(arrays_.truncated));
  }
  void reset(const std::vector<std::uint64_t>& seeds, const std::vector<std::uint8_t>& mask) {
    const Exclusive use(in_use_);
    py::gil_scoped_release release;
    batch_->reset(seeds, mask, arrays_);
  }
  py::bytes save(int index) {
    const Exclusive use(in_use_);
    return batch_->save(check(index));
  }
  void restore(int index, const py::bytes& state) {
    const Exclusive use(in_use_);
    batch_->restore(check(index), std::string_view(state), arrays_);
  }
  py::dict final_metrics(int index) const { return to_dict(batch_->final_metrics(check(index))); }
  py::array_t<std::uint8_t> render(int index, int width, int height, const std::string& camera) {
    const Exclusive use(in_use_);
    return to_array(python::render(world(index), view_, width, height, camera));
  }

 private:
  static simulation::StateArrays views(State& state) {
    auto& [observations, info, seeds, success, nonfinite_actions] = state;
    return {writable(observations), writable(info), writable(seeds), writable(success),
            writable(nonfinite_actions)};
  }
  static std::unique_ptr<EnvironmentBatch> make_batch(EnvironmentOptions options,
                                                      const std::vector<std::uint64_t>& seeds, int threads,
                                                      simulation::Autoreset autoreset) {
    py::gil_scoped_release release;
    return std::make_unique<EnvironmentBatch>(std::move(options), seeds, threads, autoreset);
  }
  int check(int index) const {
    if (index < 0 || index >= batch_->world_count())
      throw py::index_error("world " + std::to_string(index) + ": there are " +
                            std::to_string(batch_->world_count()));
    return index;
  }

  std::atomic_flag in_use_;
  std::unique_ptr<EnvironmentBatch> batch_;
  std::array<py::ssize_t, 4> action_shape_{};
  simulation::BatchArrays arrays_;
  py::tuple bound_;  // owns the arrays that arrays_ views
  std::unique_ptr<view::OffscreenView> view_;
};

EnvironmentOptions make_options(std::string experiment, std::string engine,
                                std::vector<std::pair<std::string, std::string>> overrides,
                                std::optional<std::uint64_t> seed, int threads) {
  EnvironmentOptions options;
  options.experiment = std::move(experiment);
  options.overrides = std::move(overrides);
  options.seed = seed;
  if (!engine.empty()) options.engine = std::move(engine);
  options.threads = threads;
  return options;
}

}  // namespace

PYBIND11_MODULE(_core, m) {
  m.attr("__version__") = SMARTSURF_VERSION;
  py::register_exception<common::UserError>(m, "Error", PyExc_ValueError).doc() =
      "An error in an experiment, a value or a file, in one line.";

  m.def("load_extension", [](const std::string& path) { extension::load(path); });

  using Overrides = std::vector<std::pair<std::string, std::string>>;
  py::class_<Simulation>(m, "Simulation")
      .def(py::init([](std::string experiment, std::string engine, Overrides overrides,
                       std::optional<std::uint64_t> seed, int threads) {
        return std::make_unique<Simulation>(
            make_options(std::move(experiment), std::move(engine), std::move(overrides), seed, threads));
      }))
      .def("describe", [](const Simulation& s) { return describe(s.environment()); })
      .def_property_readonly("observation", &Simulation::observation)
      .def_property_readonly("objects", &Simulation::objects)
      .def_property_readonly("targets", &Simulation::targets)
      .def_property_readonly("metrics",
                             [](const Simulation& s) { return to_dict(s.environment().metrics()); })
      .def_property_readonly("tick",
                             [](const Simulation& s) { return s.environment().simulation().snapshot().tick; })
      .def_property_readonly(
          "time", [](const Simulation& s) { return s.environment().simulation().snapshot().time_s; })
      .def_property_readonly(
          "state_hash",
          [](const Simulation& s) { return s.environment().simulation().snapshot().state_hash; })
      .def_property_readonly("seed", [](const Simulation& s) { return s.environment().seed(); })
      .def("label",
           [](const Simulation& s, std::uint32_t id) { return s.environment().simulation().label(id); })
      .def("set_targets", &Simulation::set_targets)
      .def("step", &Simulation::step)
      .def("reset", &Simulation::reset)
      .def("finish", &Simulation::finish)
      .def("save", &Simulation::save)
      .def("restore", &Simulation::restore)
      .def("info", &Simulation::info)
      .def("render", &Simulation::render);

  py::class_<Batch>(m, "Batch")
      .def(py::init([](std::string experiment, std::string engine, Overrides overrides,
                       const std::vector<std::uint64_t>& seeds, int threads, int autoreset,
                       std::optional<std::uint64_t> max_ticks) {
        EnvironmentOptions options =
            make_options(std::move(experiment), std::move(engine), std::move(overrides), std::nullopt, 1);
        options.max_ticks = max_ticks;
        return std::make_unique<Batch>(std::move(options), seeds, threads, autoreset);
      }))
      .def("describe", [](const Batch& b) { return describe(b.world(0)); })
      .def_property_readonly("observation_size", [](const Batch& b) { return b.batch().observation_size(); })
      .def_property_readonly("info_size", [](const Batch& b) { return b.batch().info_size(); })
      .def("bind", &Batch::bind)
      .def("step", &Batch::step)
      .def("reset", &Batch::reset)
      .def("save", &Batch::save)
      .def("restore", &Batch::restore)
      .def("error", [](const Batch& b, int index) { return b.batch().error(index); })
      .def("final_metrics", &Batch::final_metrics)
      .def("metrics", [](const Batch& b, int index) { return to_dict(b.world(index).metrics()); })
      .def("state_hash",
           [](const Batch& b, int index) { return b.world(index).simulation().snapshot().state_hash; })
      .def("render", &Batch::render);
}

}  // namespace smartsurf::python
