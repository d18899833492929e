// Many environments of one experiment, stepped together on a thread pool into contiguous arrays.
//
// World i computes the same as an Environment of its own with the same seeds, for any number of threads. One
// thread at a time. After fork() the child may go on: it gets a pool of its own.
#pragma once

#include <sys/types.h>

#include <atomic>
#include <cstddef>
#include <cstdint>
#include <memory>
#include <span>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "common/threads/ThreadPool.h"
#include "smartsurf/scene/NamedValues.h"
#include "smartsurf/simulation/Environment.h"

namespace smartsurf::simulation {

// The treatment of a world whose episode has ended (Gymnasium's AutoresetMode).
enum class Autoreset {
  kNextStep,  // the next step resets it, ignores its actions, and yields the first observation and reward 0
  kSameStep,  // the same step resets it; the last state goes to final_state
  kDisabled,  // nothing; the caller resets it
};

// The arrays of a state, world by world.
struct StateArrays {
  std::span<float> observations;              // worlds × observation_size()
  std::span<double> info;                     // worlds × info_size()
  std::span<std::uint64_t> seeds;             // of the episode
  std::span<std::uint8_t> success;            // Environment::has_succeeded()
  std::span<std::int64_t> nonfinite_actions;  // values of the step's actions that were NaN or infinite
  // worlds × object_count() × kObjectStateSize: position, orientation x y z w, velocity, angular velocity of
  // the declared objects; NaN of those that are gone.
  std::span<float> objects;
  std::span<double> time;    // since the start of the episode, s
  std::span<float> targets;  // worlds × actuator channels × rows × columns: the commands in effect, clamped
};

// The caller's arrays, world by world. An empty span is not written.
struct BatchArrays {
  std::span<const float> actions;  // worlds × actuator channels × rows × columns; unused with a controller
  StateArrays state;
  StateArrays final_state;  // kSameStep: the last one of an episode, written where one has ended
  std::span<double> rewards;
  std::span<std::uint8_t> terminated, truncated;
};

// Is told of the episodes of a batch's worlds, by the thread that computes the world: for different worlds at
// the same time. What on_start and on_step throw is an error of the world.
class EpisodeObserver {
 public:
  virtual ~EpisodeObserver() = default;
  virtual void on_start(int world, const Environment&) = 0;  // after the reset
  virtual void on_step(int world, const Environment&) = 0;
  virtual void on_intervention(int world, const Environment&) = 0;  // a change between two steps
  virtual void on_end(int world, const Environment&) = 0;           // also of an episode that is given up
};

class EnvironmentBatch {
 public:
  // One world per seed. `options.seed` and `options.threads` are ignored: a world computes on one thread, and
  // there are at most as many threads as worlds.
  // Throws as Environment does, the message preceded by the world's number, if all worlds fail or an option
  // of one is wrong. If only some worlds cannot start, they have error(), and fail in their first step.
  // Throws also if worlds differ in the surface, the channels or the fields of info{}.
  // `overrides`: besides those of the options, for each world, or empty.
  using Overrides = scene::Overrides;
  EnvironmentBatch(EnvironmentOptions options, std::span<const std::uint64_t> seeds, int threads,
                   Autoreset autoreset, std::span<const Overrides> overrides = {});
  ~EnvironmentBatch();

  int world_count() const { return static_cast<int>(worlds_.size()); }
  const Environment& world(int index) const { return *worlds_[index].environment; }
  std::size_t observation_size() const { return observation_size_; }
  std::size_t info_size() const { return info_size_; }
  static constexpr int kObjectStateSize = script::Experiment::kObjectStateSize;
  std::size_t object_count() const { return object_count_; }  // that the script of the first world declares
  int thread_count() const { return threads_; }

  // Starts new episodes in the worlds whose mask is not 0, with the given seeds. A world that cannot start
  // has error(), and fails in its next step. Throws if all fail.
  void reset(std::span<const std::uint64_t> seeds, std::span<const std::uint8_t> mask, const BatchArrays&);
  // Advances every world by one control period. A world that fails ends its episode: truncated, its reward
  // and info NaN, its observation the last one; its next reset() brings it back. Throws if all fail; then
  // only reset() of all worlds may follow. With kSameStep, a world whose next episode cannot start keeps the
  // results of the ended one, has start_error(), and fails in its next step.
  void step(const BatchArrays&);
  // Ends the episodes of the worlds whose mask is not 0, by a goal or a limit of the caller: after a step()
  // from whose end they still run. Then does with them what step() does at the end of an episode.
  void end_episodes(std::span<const std::uint8_t> mask, const BatchArrays&);
  // Updates the objects' states after changes between two steps: NaN in worlds that have failed.
  void observe_objects(const StateArrays&) const;
  // Why the world failed in the latest step() or reset(); "" if it did not.
  const std::string& error(int index) const { return worlds_[index].error; }
  // Why the running episode could not start, until its first step, which fails; "" if it did.
  const std::string& start_error(int index) const { return worlds_[index].start_error; }
  // As Environment's: true also for a world that has failed and was reset in the same step.
  bool has_running_episode(int index) const { return worlds_[index].environment->has_running_episode(); }

  // The seed of the latest episode that the world started itself. The next episode's seed follows from it, so
  // that worlds to which one state was restored draw different ones.
  std::uint64_t started_seed(int index) const { return worlds_[index].started_seed; }

  // Call those of the world's Environment. restore() also writes the world's state.
  std::string save(int index) { return worlds_[index].environment->save(); }
  void restore(int index, std::string_view state, const BatchArrays&);
  void fail(int index);

  // All of a world that save() does not have. A world to which state and status of another one were restored,
  // or that was failed and has its status, goes on as that one.
  struct WorldStatus {
    std::uint64_t seed = 0;          // of the episode, also of one that could not start
    std::uint64_t started_seed = 0;  // of the latest one that was not restored
    bool episode_over = false;       // the next step() resets the world, unless with kDisabled
    std::string start_error;         // of an episode that could not start, which its first step reports
  };
  const WorldStatus& status(int index) const { return worlds_[index]; }
  void set_status(int index, WorldStatus);

  // Null removes the observer, which must outlive its use.
  void observe_episodes(EpisodeObserver* observer) { observer_ = observer; }

  // For changes to a world between two steps.
  Environment& mutable_world(int index) { return *worlds_[index].environment; }

  // The metrics of the last episode that ended in the world.
  const scene::Metrics& final_metrics(int index) const { return worlds_[index].final_metrics; }

 private:
  struct World : WorldStatus {
    std::unique_ptr<Environment> environment;
    scene::Metrics final_metrics;
    // Address of the episode's simulation, for the prefetch. The thread of the world before may read it while
    // a reset moves it.
    std::atomic<const std::byte*> simulation = nullptr;
    std::string error;
    void locate_simulation() {
      simulation.store(reinterpret_cast<const std::byte*>(&environment->simulation()),
                       std::memory_order_relaxed);
    }
  };
  // The worlds of a thread, which its cache holds from step to step. A thread that has done its own takes
  // chunks of those of the others.
  struct alignas(128) Band {
    std::atomic<std::size_t> next_chunk;
    std::size_t end_chunk;
  };
  // Runs the work for every world. Afterwards the worlds whose work has thrown have an error.
  template <class Work>
  void run_worlds(const Work&);
  void write_objects(std::size_t, const StateArrays&) const;
  void write_no_objects(std::size_t, const StateArrays&) const;
  void write_targets(std::size_t, const StateArrays&) const;
  void copy_observation(std::size_t, const StateArrays& from, const StateArrays& to) const;
  void copy_state(std::size_t, const StateArrays& from, const StateArrays& to) const;
  [[noreturn]] void throw_error(std::size_t) const;
  void throw_if_all_failed() const;
  void collapse_huge_pages() const;
  std::size_t prefetched_bytes() const;
  // The memory that the step of the next world touches, apart from its script; empty if it is in the cache.
  std::span<const std::byte> memory_of_next(std::size_t i) const {
    if (i + 1 == worlds_.size()) return {};
    const std::byte* const next = worlds_[i + 1].simulation.load(std::memory_order_relaxed);
    return {next, next == nullptr ? 0 : prefetched_bytes_};
  }
  void start_episode(std::size_t, std::uint64_t seed, const BatchArrays&);
  void start_next_episode(std::size_t, const BatchArrays&);
  void restart_in_same_step(std::size_t, const BatchArrays&);
  void fail_to_start(std::size_t, const std::string& error, const StateArrays&);
  void end_observed(std::size_t);
  void step_world(std::size_t, const BatchArrays&);
  void end_failed_episode(std::size_t, const BatchArrays&);
  void write_failed_state(std::size_t, const StateArrays&) const;
  void write_state(std::size_t, std::int64_t nonfinite_actions, const StateArrays&);
  bool finish_episode(std::size_t);  // runs on_finish; returns whether the episode has succeeded

  EnvironmentOptions options_;
  Autoreset autoreset_;
  EpisodeObserver* observer_ = nullptr;
  int threads_;
  std::unique_ptr<common::ThreadPool> pool_;
  pid_t process_;                  // that has the pool's threads
  std::unique_ptr<Band[]> bands_;  // one per thread
  std::vector<World> worlds_;
  std::size_t observation_size_ = 0, info_size_ = 0, action_size_ = 0, cells_ = 0, object_count_ = 0;
  std::size_t prefetched_bytes_ = 0;  // of a world
};

}  // namespace smartsurf::simulation
