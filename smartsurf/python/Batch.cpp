#include <algorithm>
#include <array>
#include <atomic>
#include <cstddef>
#include <cstdint>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <tuple>
#include <utility>
#include <vector>

#include "common/error/UserError.h"
#include "smartsurf/python/Arrays.h"
#include "smartsurf/python/Bindings.h"
#include "smartsurf/python/Description.h"
#include "smartsurf/python/EpisodeRecording.h"
#include "smartsurf/python/Exclusive.h"
#include "smartsurf/python/Options.h"
#include "smartsurf/python/Pictures.h"
#include "smartsurf/python/WorldState.h"
#include "smartsurf/simulation/EnvironmentBatch.h"

namespace smartsurf::python {
namespace {

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

  // Ends recordings that are still open with the episodes as they are.
  ~Batch() {
    if (!recorder_) return;
    batch_->observe_episodes(nullptr);
    for (int i = 0; i < batch_->world_count(); ++i) recorder_->on_destruction(i, batch_->world(i));
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

  // Each state: observations, info, seeds, success, actions that are not finite, objects, time, targets.
  // Empty arrays are not written.
  using State = std::tuple<Array<float>, Array<double>, Array<std::uint64_t>, Array<std::uint8_t>,
                           Array<std::int64_t>, Array<float>, Array<double>, Array<float>>;
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
  void fail(int index) {
    const Exclusive use(in_use_);
    batch_->fail(check(index));
  }
  // seed, started seed, whether the episode is over, and why it could not start.
  using Status = std::tuple<std::uint64_t, std::uint64_t, bool, std::string>;
  Status status(int index) const {
    const Exclusive use(in_use_);
    const EnvironmentBatch::WorldStatus& s = batch_->status(check(index));
    return {s.seed, s.started_seed, s.episode_over, s.start_error};
  }
  void set_status(int index, const Status& status) {
    const Exclusive use(in_use_);
    const auto& [seed, started_seed, episode_over, start_error] = status;
    batch_->set_status(check(index), {seed, started_seed, episode_over, start_error});
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
    auto& [observations, info, seeds, success, nonfinite_actions, objects, time, targets] = state;
    return {writable(observations),      writable(info),    writable(seeds), writable(success),
            writable(nonfinite_actions), writable(objects), writable(time),  writable(targets)};
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
  // Like for_each(), but restores the parameters of all worlds after an error.
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

}  // namespace

void bind_batch(py::module_& m) {
  py::class_<Batch>(m, "Batch")
      .def(py::init([](std::string experiment, std::string engine, const std::vector<std::uint64_t>& seeds,
                       int threads, int autoreset, std::optional<std::uint64_t> max_ticks,
                       const Batch::Overrides& of_worlds, std::optional<std::string> source,
                       const py::object& controllers) {
        EnvironmentOptions options =
            make_options(std::move(experiment), std::move(engine), {}, std::nullopt, 1, std::move(source));
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
      .def("fail", &Batch::fail)
      .def("status", &Batch::status)
      .def("set_status", &Batch::set_status)
      .def("started_seed",
           [](const Batch& b, int index) {
             return b.read(index, [](const EnvironmentBatch& batch, int i) { return batch.started_seed(i); });
           })
      .def("error",
           [](const Batch& b, int index) {
             return b.read(index, [](const EnvironmentBatch& batch, int i) { return batch.error(i); });
           })
      .def("start_error",
           [](const Batch& b, int index) {
             return b.read(index, [](const EnvironmentBatch& batch, int i) { return batch.start_error(i); });
           })
      .def("has_running_episode",
           [](const Batch& b, int index) {
             return b.read(index,
                           [](const EnvironmentBatch& batch, int i) { return batch.has_running_episode(i); });
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
