// Statistics of a run: durations of the phases of a tick, and the summary written by --stats.
#pragma once

#include <array>
#include <chrono>
#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "smartsurf/scene/NamedValues.h"

namespace smartsurf::run {

// A histogram of durations with buckets 1/32 octave wide: quantiles are accurate to about 2 %. Never
// allocates.
class DurationHistogram {
 public:
  void add(std::chrono::nanoseconds) noexcept;
  std::uint64_t count() const noexcept { return count_; }
  // The q-quantile, 0 ≤ q ≤ 1, in ms; 0 if empty.
  double quantile_ms(double q) const noexcept;
  double total_s() const noexcept { return static_cast<double>(total_ns_) * 1e-9; }

 private:
  static constexpr int kBucketsPerOctave = 32;
  std::array<std::uint32_t, 64 * kBucketsPerOctave> buckets_{};
  std::uint64_t count_ = 0, total_ns_ = 0;
};

enum class Phase { kWait, kActuate, kPhysics, kSense, kPublish, kRecord, kRender };
inline constexpr std::size_t kPhaseCount = 7;

// Sums the time of each phase within a tick and adds the sums to histograms.
class PhaseTimes {
 public:
  void start() noexcept { lap_start_ = Clock::now(); }
  // Adds the time since the last start() or lap() to the phase.
  void lap(Phase phase) noexcept {
    const auto now = Clock::now();
    current_tick_[static_cast<int>(phase)] += now - lap_start_;
    lap_start_ = now;
  }
  void end_tick() noexcept;
  const DurationHistogram& histogram(Phase phase) const noexcept {
    return histograms_[static_cast<int>(phase)];
  }
  double last_ms(Phase phase) const noexcept { return last_ms_[static_cast<int>(phase)]; }

 private:
  using Clock = std::chrono::steady_clock;
  Clock::time_point lap_start_{};
  std::array<Clock::duration, kPhaseCount> current_tick_{};
  std::array<double, kPhaseCount> last_ms_{};
  std::array<DurationHistogram, kPhaseCount> histograms_;
};

struct RunSummary {
  std::string experiment, mode, outcome;
  std::uint64_t seed = 0, ticks = 0, physics_steps = 0;
  double simulated_s = 0.0;
  double wall_s = 0.0;  // without the time for pictures and videos
  std::size_t objects = 0, contacts = 0;
  std::uint64_t state_hash = 0;
  std::optional<bool> success;  // nullopt: the script does not say
  std::optional<double> success_s;
  std::uint64_t sensor_frames_skipped = 0, actuator_frames_repeated = 0;
  std::uint64_t actuator_values_clamped = 0, actuator_values_nan = 0;
  scene::Metrics metrics;                              // from the script's metric()
  std::vector<std::pair<std::string, double>> varied;  // the episode's nuisances
  std::size_t off_surface = 0;                         // objects not over the surface at the end
  std::uint64_t left_table = 0;                        // total departures
  std::uint64_t frames_drawn = 0;                      // in the window

  double real_time_factor() const { return wall_s > 0.0 ? simulated_s / wall_s : 0.0; }
};

// One JSON object, as docs/user-guide.md describes.
std::string to_json(const RunSummary&, const PhaseTimes&);

}  // namespace smartsurf::run
