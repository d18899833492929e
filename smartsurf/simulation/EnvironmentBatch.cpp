#include "smartsurf/simulation/EnvironmentBatch.h"

#include <fmt/format.h>
#include <sys/mman.h>
#include <unistd.h>

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <exception>
#include <limits>
#include <utility>

#include "smartsurf/simulation/EpisodeRandom.h"

namespace smartsurf::simulation {
namespace {

constexpr std::size_t kChunksPerThread = 8;  // evens out worlds of different cost

std::int64_t count_nonfinite(std::span<const float> values) {
  std::int32_t count = 0;  // of the width of a float, so that the loop becomes one of vectors
  for (const float v : values) count += std::abs(v) <= std::numeric_limits<float>::max() ? 0 : 1;
  return count;
}

// Copies the values of world i, `size` in number, if both arrays are there.
template <class T>
void copy_world(std::size_t i, std::size_t size, std::span<T> from, std::span<T> to) {
  if (!from.empty() && !to.empty())
    std::ranges::copy(from.subspan(i * size, size), to.subspan(i * size, size).begin());
}

constexpr std::uintptr_t kHugePageBytes = 2U << 20U;

// Makes one huge page of the memory around an address, where the system can. A step of many small worlds
// touches a few lines in each of many pages, more than the processor keeps translations of.
void collapse_huge_page(std::uintptr_t page) {
  constexpr int kMadvCollapse = 25;  // since Linux 6.1; the headers of glibc 2.36 lack its name
  static_cast<void>(madvise(reinterpret_cast<void*>(page), kHugePageBytes, kMadvCollapse));
}

}  // namespace

EnvironmentBatch::EnvironmentBatch(EnvironmentOptions options, std::span<const std::uint64_t> seeds,
                                   int threads, Autoreset autoreset, std::span<const Overrides> overrides)
    : options_(std::move(options)),
      autoreset_(autoreset),
      threads_(std::min(threads, std::max(1, static_cast<int>(seeds.size())))),
      pool_(std::make_unique<common::ThreadPool>(threads_)),
      process_(getpid()),
      bands_(std::make_unique<Band[]>(threads_)),
      worlds_(seeds.size()) {
  options_.threads = 1;
  options_.fixed_channels = true;
  const auto load = [&](std::size_t i, std::uint64_t seed) {
    EnvironmentOptions own = options_;
    own.seed = seed;
    if (!overrides.empty())
      own.overrides.insert(own.overrides.end(), overrides[i].begin(), overrides[i].end());
    worlds_[i].environment = std::make_unique<Environment>(std::move(own), Environment::Start::kLater);
  };
  run_worlds([&](std::size_t i) {
    worlds_[i].seed = worlds_[i].started_seed = seeds[i];
    load(i, seeds[i]);
  });
  throw_if_all_failed();
  // A world whose script fails with its seed waits with the script of another one's for a reset.
  const std::uint64_t good_seed =
      std::ranges::find_if(worlds_, [](const World& world) { return world.error.empty(); })->seed;
  for (std::size_t i = 0; i < worlds_.size(); ++i)
    if (!worlds_[i].environment) try {
        load(i, good_seed);
      } catch (const std::exception&) {
        throw_error(i);  // not the seed's
      }
  const Environment& first = *worlds_.front().environment;
  for (std::size_t i = 1; i < worlds_.size(); ++i) {
    const Environment& own = *worlds_[i].environment;
    const std::string difference = first.channel_difference(own);
    if (!difference.empty())
      throw scene::InputError(
          fmt::format("world {}: {}: with seed {}, {} as in world 0: all worlds must have "
                      "the same surface, channels and info{{}}",
                      i, own.scene().file, own.seed(), difference));
  }
  // All that their steps touch comes to lie together, apart from scripts and scenes.
  run_worlds([&](std::size_t i) {
    if (!worlds_[i].error.empty()) return;
    worlds_[i].environment->start();
    worlds_[i].locate_simulation();
  });
  throw_if_all_failed();
  for (World& world : worlds_) world.start_error = world.error;
  collapse_huge_pages();
  prefetched_bytes_ = prefetched_bytes();
  observation_size_ = first.observation_size();
  object_count_ = first.scene().objects.size();
  for (const auto& field : first.info_fields()) info_size_ += field.size;
  cells_ = first.scene().surface.cell_count();
  action_size_ = first.scene().surface.actuator_channels().size() * cells_;
}

// A world's script lies around its environment, the rest around its simulation, because one thread has
// created them. Pages with few worlds are left alone: they would take memory for little.
void EnvironmentBatch::collapse_huge_pages() const {
  constexpr std::ptrdiff_t kMinWorldsPerPage = 8;
  std::vector<std::uintptr_t> pages;
  for (const World& world : worlds_)
    for (const void* part : {static_cast<const void*>(world.environment.get()),
                             static_cast<const void*>(world.simulation.load())})
      if (part != nullptr)
        pages.push_back(reinterpret_cast<std::uintptr_t>(part) / kHugePageBytes * kHugePageBytes);
  std::ranges::sort(pages);
  for (auto page = pages.begin(); page != pages.end();) {
    const auto next = std::ranges::upper_bound(page, pages.end(), *page);
    if (next - page >= kMinWorldsPerPage) collapse_huge_page(*page);
    page = next;
  }
}

// The distance from a world's simulation to the next one's, between which a step's memory lies, because one
// thread has created both; at most the beginning of a large world. 0 for few worlds, which the cache holds.
std::size_t EnvironmentBatch::prefetched_bytes() const {
  constexpr std::ptrdiff_t kMaxBytes = 48 << 10;
  constexpr std::size_t kMinWorlds = 256;
  if (worlds_.size() < kMinWorlds) return 0;
  std::vector<std::ptrdiff_t> distances;
  for (std::size_t i = 1; i < worlds_.size(); ++i)
    distances.push_back(reinterpret_cast<std::intptr_t>(worlds_[i].simulation.load()) -
                        reinterpret_cast<std::intptr_t>(worlds_[i - 1].simulation.load()));
  const auto median = distances.begin() + distances.size() / 2;
  std::ranges::nth_element(distances, median);
  return std::clamp<std::ptrdiff_t>(*median, 0, kMaxBytes);
}

EnvironmentBatch::~EnvironmentBatch() {
  // The threads of the process that created the pool do not exist in its child and cannot be joined.
  if (process_ != getpid()) pool_.release();
}

template <class Work>
void EnvironmentBatch::run_worlds(const Work& work) {
  if (process_ != getpid()) {
    pool_.release();
    pool_ = std::make_unique<common::ThreadPool>(threads_);
    process_ = getpid();
  }
  const std::size_t count = worlds_.size();
  const auto run_range = [&](std::size_t begin, std::size_t end) noexcept {
    for (std::size_t i = begin; i < end; ++i) {
      try {
        work(i);
      } catch (const std::exception& error) {
        worlds_[i].error = error.what();
      }
    }
  };
  if (threads_ == 1) return run_range(0, count);
  const std::size_t threads = threads_;
  const std::size_t chunks = std::min(count, threads * kChunksPerThread);
  for (std::size_t b = 0; b < threads; ++b) {
    bands_[b].next_chunk.store(chunks * b / threads, std::memory_order_relaxed);
    bands_[b].end_chunk = chunks * (b + 1) / threads;
  }
  pool_->parallel_for(static_cast<std::uint32_t>(threads), [&](std::uint32_t, unsigned thread) noexcept {
    for (std::size_t k = 0; k < threads; ++k) {
      Band& band = bands_[(thread + k) % threads];
      for (std::size_t chunk;
           (chunk = band.next_chunk.fetch_add(1, std::memory_order_relaxed)) < band.end_chunk;)
        run_range(count * chunk / chunks, count * (chunk + 1) / chunks);
    }
  });
}

void EnvironmentBatch::throw_error(std::size_t i) const {
  throw scene::InputError("world " + std::to_string(i) + ": " + worlds_[i].error);
}

void EnvironmentBatch::throw_if_all_failed() const {
  if (std::ranges::all_of(worlds_, [](const World& world) { return !world.error.empty(); })) throw_error(0);
}

void EnvironmentBatch::write_state(std::size_t i, std::int64_t nonfinite_actions, const StateArrays& a) {
  Environment& environment = *worlds_[i].environment;
  if (!a.observations.empty())
    environment.observe(a.observations.subspan(i * observation_size_, observation_size_));
  if (info_size_ > 0 && !a.info.empty()) environment.info(a.info.subspan(i * info_size_, info_size_));
  if (!a.seeds.empty()) a.seeds[i] = environment.seed();
  if (!a.success.empty()) a.success[i] = environment.has_succeeded() ? 1 : 0;
  if (!a.time.empty()) a.time[i] = environment.simulation().partial_snapshot().time_s;
  write_objects(i, a);
  write_targets(i, a);
  if (!a.nonfinite_actions.empty()) a.nonfinite_actions[i] = nonfinite_actions;
}

bool EnvironmentBatch::finish_episode(std::size_t i) {
  World& world = worlds_[i];
  world.environment->finish();
  world.final_metrics = world.environment->metrics();
  end_observed(i);
  return world.environment->has_succeeded();
}

void EnvironmentBatch::reset(std::span<const std::uint64_t> seeds, std::span<const std::uint8_t> mask,
                             const BatchArrays& a) {
  run_worlds([&](std::size_t i) {
    World& world = worlds_[i];
    world.error.clear();
    if (mask[i] == 0) return;
    try {
      start_episode(i, seeds[i], a);
    } catch (const std::exception& error) {
      world.error = error.what();
      fail_to_start(i, error.what(), a.state);
    }
  });
  throw_if_all_failed();
}

void EnvironmentBatch::write_objects(std::size_t i, const StateArrays& a) const {
  if (a.objects.empty()) return;
  const scene::Snapshot& snapshot = worlds_[i].environment->simulation().partial_snapshot();
  const std::size_t size = object_count_ * kObjectStateSize;
  const std::span<float> out = a.objects.subspan(i * size, size);
  if (snapshot.object_count() < object_count_ || snapshot.id[object_count_ - 1] != object_count_ - 1)
    std::ranges::fill(out, std::numeric_limits<float>::quiet_NaN());
  for (std::size_t k = 0; k < snapshot.object_count() && snapshot.id[k] < object_count_; ++k) {
    auto to = out.begin() + snapshot.id[k] * kObjectStateSize;
    to = std::ranges::copy(snapshot.position[k], to).out;
    to = std::ranges::copy(snapshot.orientation[k], to).out;
    to = std::ranges::copy(snapshot.velocity[k], to).out;
    std::ranges::copy(snapshot.angular_velocity[k], to);
  }
}

void EnvironmentBatch::write_targets(std::size_t i, const StateArrays& a) const {
  if (a.targets.empty()) return;
  auto to = a.targets.subspan(i * action_size_, action_size_).begin();
  for (const scene::ChannelData& channel : worlds_[i].environment->simulation().actuators())
    to = std::ranges::copy(channel.values, to).out;
}

void EnvironmentBatch::observe_objects(const StateArrays& a) const {
  for (std::size_t i = 0; i < worlds_.size(); ++i)
    worlds_[i].environment->has_running_episode() ? write_objects(i, a) : write_no_objects(i, a);
}

void EnvironmentBatch::write_no_objects(std::size_t i, const StateArrays& a) const {
  const std::size_t size = object_count_ * kObjectStateSize;
  if (!a.objects.empty())
    std::ranges::fill(a.objects.subspan(i * size, size), std::numeric_limits<float>::quiet_NaN());
}

void EnvironmentBatch::copy_observation(std::size_t i, const StateArrays& from, const StateArrays& to) const {
  copy_world(i, observation_size_, from.observations, to.observations);
}

void EnvironmentBatch::copy_state(std::size_t i, const StateArrays& from, const StateArrays& to) const {
  const auto copy = [i](auto source, auto target, std::size_t size) { copy_world(i, size, source, target); };
  copy_observation(i, from, to);
  copy(from.info, to.info, info_size_);
  copy(from.seeds, to.seeds, 1);
  copy(from.success, to.success, 1);
  copy(from.nonfinite_actions, to.nonfinite_actions, 1);
  copy(from.objects, to.objects, object_count_ * kObjectStateSize);
  copy(from.time, to.time, 1);
  copy(from.targets, to.targets, action_size_);
}

void EnvironmentBatch::end_episodes(std::span<const std::uint8_t> mask, const BatchArrays& a) {
  run_worlds([&](std::size_t i) {
    if (mask[i] == 0) return;
    World& world = worlds_[i];
    world.episode_over = true;
    world.start_error.clear();
    try {
      if (finish_episode(i) && !a.state.success.empty()) a.state.success[i] = 1;
      copy_state(i, a.state, a.final_state);
    } catch (const std::exception& error) {
      world.error = error.what();
      end_failed_episode(i, a);
    }
    if (autoreset_ == Autoreset::kSameStep) restart_in_same_step(i, a);
  });
}

void EnvironmentBatch::restore(int index, std::string_view state, const BatchArrays& a) {
  const std::size_t i = index;
  end_observed(i);
  worlds_[i].environment->restore(state);
  worlds_[i].locate_simulation();
  worlds_[i].seed = worlds_[i].environment->seed();
  worlds_[i].episode_over = false;
  worlds_[i].error.clear();
  worlds_[i].start_error.clear();
  write_state(i, 0, a.state);
}

void EnvironmentBatch::fail(int index) {
  end_observed(index);
  worlds_[index].environment->fail();
}

void EnvironmentBatch::set_status(int index, WorldStatus status) {
  static_cast<WorldStatus&>(worlds_[index]) = std::move(status);
}

void EnvironmentBatch::step(const BatchArrays& a) {
  run_worlds([&](std::size_t i) {
    worlds_[i].error.clear();
    try {
      step_world(i, a);
    } catch (const std::exception& error) {
      worlds_[i].error = error.what();
      end_failed_episode(i, a);
    }
    if (autoreset_ == Autoreset::kSameStep && worlds_[i].episode_over) restart_in_same_step(i, a);
  });
  throw_if_all_failed();
}

void EnvironmentBatch::start_episode(std::size_t i, std::uint64_t seed, const BatchArrays& a) {
  World& world = worlds_[i];
  end_observed(i);
  world.start_error.clear();
  world.environment->reset(world.seed = world.started_seed = seed);
  world.locate_simulation();
  world.episode_over = false;
  write_state(i, 0, a.state);
  if (observer_ != nullptr) observer_->on_start(static_cast<int>(i), *world.environment);
}

void EnvironmentBatch::start_next_episode(std::size_t i, const BatchArrays& a) {
  start_episode(i, next_seed(worlds_[i].started_seed), a);
}

// What the step has written of the ended episode stays, also if the next one cannot start.
void EnvironmentBatch::restart_in_same_step(std::size_t i, const BatchArrays& a) {
  try {
    start_next_episode(i, a);
  } catch (const std::exception& error) {
    copy_observation(i, a.final_state, a.state);
    fail_to_start(i, error.what(), a.state);
  }
}

void EnvironmentBatch::end_observed(std::size_t i) {
  if (observer_ != nullptr) observer_->on_end(static_cast<int>(i), *worlds_[i].environment);
}

void EnvironmentBatch::step_world(std::size_t i, const BatchArrays& a) {
  World& world = worlds_[i];
  Environment& environment = *world.environment;
  if (!world.start_error.empty()) throw scene::InputError(std::exchange(world.start_error, {}));
  StepResult result;
  if (world.episode_over && autoreset_ == Autoreset::kNextStep) {
    start_next_episode(i, a);
  } else {
    std::span<const float> actions;
    if (!options_.controller) {
      actions = a.actions.subspan(i * action_size_, action_size_);
      for (std::size_t c = 0; c * cells_ < action_size_; ++c)
        environment.set_targets(static_cast<int>(c), actions.subspan(c * cells_, cells_));
    }
    result = environment.step(memory_of_next(i));
    if (observer_ != nullptr) observer_->on_step(static_cast<int>(i), environment);
    if (options_.controller) actions = environment.controller_targets();
    world.episode_over = result.terminated || result.truncated;
    const StateArrays& state =
        world.episode_over && autoreset_ == Autoreset::kSameStep ? a.final_state : a.state;
    // Before on_finish, as in Env: it may change what info{} reports.
    write_state(i, count_nonfinite(actions), state);
    if (world.episode_over) {
      const bool succeeded = finish_episode(i);
      if (!state.success.empty()) state.success[i] = succeeded ? 1 : 0;
    }
  }
  if (!a.rewards.empty()) a.rewards[i] = result.reward;
  if (!a.terminated.empty()) a.terminated[i] = result.terminated ? 1 : 0;
  if (!a.truncated.empty()) a.truncated[i] = result.truncated ? 1 : 0;
}

// The first step of the episode fails.
void EnvironmentBatch::fail_to_start(std::size_t i, const std::string& error, const StateArrays& a) {
  worlds_[i].start_error = error;
  worlds_[i].episode_over = false;
  write_failed_state(i, a);
}

// All but the observation, which stays the last one.
void EnvironmentBatch::write_failed_state(std::size_t i, const StateArrays& a) const {
  if (!a.info.empty())
    std::ranges::fill(a.info.subspan(i * info_size_, info_size_), std::numeric_limits<double>::quiet_NaN());
  if (!a.seeds.empty()) a.seeds[i] = worlds_[i].seed;
  if (!a.success.empty()) a.success[i] = 0;
  if (!a.nonfinite_actions.empty()) a.nonfinite_actions[i] = 0;
  write_no_objects(i, a);
}

void EnvironmentBatch::end_failed_episode(std::size_t i, const BatchArrays& a) {
  World& world = worlds_[i];
  world.episode_over = true;
  world.final_metrics.clear();
  write_failed_state(i, a.state);
  write_failed_state(i, a.final_state);
  copy_observation(i, a.state, a.final_state);
  if (!a.rewards.empty()) a.rewards[i] = std::numeric_limits<double>::quiet_NaN();
  if (!a.terminated.empty()) a.terminated[i] = 0;
  if (!a.truncated.empty()) a.truncated[i] = 1;
  end_observed(i);
}

}  // namespace smartsurf::simulation
