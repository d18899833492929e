// Recordings of the episodes of environments that Python steps.
#pragma once

#include <fmt/format.h>

#include <cstdint>
#include <memory>
#include <mutex>
#include <optional>
#include <span>
#include <string>
#include <utility>
#include <vector>

#include "common/error/UserError.h"
#include "smartsurf/record/OpenRecorder.h"
#include "smartsurf/record/Ownership.h"
#include "smartsurf/simulation/Environment.h"
#include "smartsurf/simulation/EnvironmentBatch.h"

namespace smartsurf::python {

using simulation::Environment;
using simulation::EnvironmentBatch;

// The recording of one episode of an environment, from its start to its end.
class EpisodeRecording {
 public:
  using Overrides = EnvironmentBatch::Overrides;

  // Before the episode's first step. overrides: the options that were given.
  void start(const std::string& path, const Environment& environment, const std::string& command_line,
             std::span<const Overrides::value_type> overrides) {
    if (environment.simulation().snapshot().tick != 0)
      throw common::UserError(path +
                              ": a recording starts with an episode: call record() before its first step");
    stop(environment);
    record::RunMetadata meta;
    meta.command_line = command_line;
    meta.mode = "time-step";
    meta.driver = environment.has_controller() ? "controller" : "python";
    for (const auto& [name, value] : overrides) meta.overrides.push_back({name, value});
    meta.varied = environment.simulation().nuisances();
    meta.declares_success = environment.experiment().declares_success();
    meta.versions = {{"physics", environment.simulation().engine().version()}};
    for (const scene::Extension& extension : environment.scene().surface.extensions())
      meta.extensions.push_back({extension.name, extension.hash});
    owner_ = record::Owner();
    recorder_ = record::open_recorder(path, meta, environment.scene());
    record_frame(environment);
    if (environment.has_parameters()) recorder_->mark_user_interaction(0);
  }
  // After a step.
  void add(const Environment& environment) {
    if (recorder_) record_frame(environment);
  }
  // The script does not repeat what Python has changed.
  void mark_intervention(const Environment& environment) {
    if (recorder_) recorder_->mark_user_interaction(environment.simulation().snapshot().tick);
  }
  void stop(const Environment& environment) {
    if (!recorder_) return;
    const std::unique_ptr<record::Recorder> recorder = std::move(recorder_);
    if (owner_.is_child()) return;
    const scene::Snapshot& last = environment.simulation().snapshot();
    const simulation::Verdict verdict = environment.verdict();
    recorder->close({environment.outcome(), last.tick, last.time_s, last.state_hash, verdict.success,
                     verdict.success_s, environment.metrics()});
  }
  // For destructors, which cannot report errors.
  void stop_quietly(const Environment& environment) noexcept try {
    stop(environment);
  } catch (const std::exception&) {
  }

 private:
  void record_frame(const Environment& environment) {
    const simulation::Simulation& s = environment.simulation();
    const scene::RecordSpec& spec = s.scene().record;
    recorder_->record_inputs(s.actuators());
    recorder_->record_frame(
        s.snapshot(), s.catalogue(),
        spec.sensors != scene::SensorRecording::kNever ? s.sensors() : std::span<const scene::ChannelData>{},
        spec.actuators ? s.actuators() : std::span<const scene::ChannelData>{}, environment.metrics());
  }

  record::Owner owner_;
  std::unique_ptr<record::Recorder> recorder_;
};

// Records episodes of some worlds of a batch, one file for each. Worlds run on several threads, HDF5 on one
// at a time. Records nothing in a child of fork().
class BatchRecorder final : public simulation::EpisodeObserver {
 public:
  // worlds: which; every: the episodes 1, 1 + every, … of each. overrides: the options of each world.
  BatchRecorder(std::string folder, std::string command_line, const std::vector<int>& worlds,
                std::uint64_t every, std::vector<EnvironmentBatch::Overrides> overrides)
      : folder_(std::move(folder)),
        command_line_(std::move(command_line)),
        every_(every),
        overrides_(std::move(overrides)),
        worlds_(overrides_.size()) {
    for (const int world : worlds) worlds_.at(world) = std::make_unique<World>();
  }

  void on_start(int world, const Environment& environment) override {
    if (!records(world)) return;
    World& own = *worlds_[world];
    if (own.episodes++ % every_ != 0) return;
    const std::scoped_lock lock(mutex_);
    own.recording.start(fmt::format("{}/world-{:04}-episode-{:06}.h5", folder_, world, own.episodes),
                        environment, command_line_, overrides_[world]);
  }
  void on_step(int world, const Environment& environment) override {
    with(world, [&](EpisodeRecording& recording) { recording.add(environment); });
  }
  void on_intervention(int world, const Environment& environment) override {
    with(world, [&](EpisodeRecording& recording) { recording.mark_intervention(environment); });
  }
  void on_end(int world, const Environment& environment) override {
    with(world, [&](EpisodeRecording& recording) { recording.stop(environment); });
  }
  void on_destruction(int world, const Environment& environment) noexcept {
    with(world, [&](EpisodeRecording& recording) { recording.stop_quietly(environment); });
  }

 private:
  struct World {
    std::uint64_t episodes = 0;  // that have started
    EpisodeRecording recording;
  };
  bool records(int world) const { return worlds_[world] && !owner_.is_child(); }
  template <class Work>
  void with(int world, const Work& work) {
    if (!records(world)) return;
    const std::scoped_lock lock(mutex_);
    work(worlds_[world]->recording);
  }

  record::Owner owner_;
  std::string folder_, command_line_;
  std::uint64_t every_;
  std::vector<EnvironmentBatch::Overrides> overrides_;
  std::vector<std::unique_ptr<World>> worlds_;  // null: not recorded
  std::mutex mutex_;
};

}  // namespace smartsurf::python
