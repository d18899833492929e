#include "smartsurf/run/output/Stats.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <nlohmann/json.hpp>

namespace smartsurf::run {

void DurationHistogram::add(std::chrono::nanoseconds duration) noexcept {
  const auto ns = static_cast<std::uint64_t>(std::max<std::int64_t>(1, duration.count()));
  const auto bucket = static_cast<std::size_t>(std::log2(static_cast<double>(ns)) * kBucketsPerOctave);
  ++buckets_[std::min(bucket, buckets_.size() - 1)];
  ++count_;
  total_ns_ += ns;
}

double DurationHistogram::quantile_ms(double q) const noexcept {
  if (count_ == 0) return 0.0;
  const double rank = q * static_cast<double>(count_);
  std::uint64_t cumulative = 0;
  for (std::size_t i = 0; i < buckets_.size(); ++i) {
    cumulative += buckets_[i];
    if (static_cast<double>(cumulative) >= rank && buckets_[i] > 0)
      return std::exp2((static_cast<double>(i) + 0.5) / kBucketsPerOctave) * 1e-6;
  }
  return 0.0;
}

void PhaseTimes::end_tick() noexcept {
  for (std::size_t i = 0; i < kPhaseCount; ++i) {
    // Some phases do not run at every tick; a phase without time is not counted.
    if (current_tick_[i].count() > 0) {
      histograms_[i].add(current_tick_[i]);
      last_ms_[i] = std::chrono::duration<double, std::milli>(current_tick_[i]).count();
    }
    current_tick_[i] = {};
  }
}

std::string to_json(const RunSummary& run, const PhaseTimes& times) {
  using nlohmann::ordered_json;
  static constexpr const char* kNames[kPhaseCount] = {"wait",    "actuate", "physics", "sense",
                                                      "publish", "record",  "render"};
  ordered_json phases;
  for (std::size_t i = 0; i < kPhaseCount; ++i) {
    const DurationHistogram& histogram = times.histogram(static_cast<Phase>(i));
    phases[kNames[i]] = {{"median", histogram.quantile_ms(0.5)},
                         {"p99", histogram.quantile_ms(0.99)},
                         {"total_s", histogram.total_s()}};
  }
  ordered_json metrics = ordered_json::object();
  for (const auto& [name, value] : run.metrics) metrics[name] = value;
  ordered_json json{{"experiment", run.experiment},
                    {"mode", run.mode},
                    {"outcome", run.outcome},
                    {"seed", run.seed},
                    {"ticks", run.ticks},
                    {"physics_steps", run.physics_steps},
                    {"simulated_s", run.simulated_s},
                    {"wall_s", run.wall_s},
                    {"real_time_factor", run.real_time_factor()},
                    {"frames_drawn", run.frames_drawn},
                    {"ms_per_tick", phases},
                    {"objects", run.objects},
                    {"off_surface", run.off_surface},
                    {"left_table", run.left_table},
                    {"contacts", run.contacts},
                    {"state_hash", fmt::format("{:016x}", run.state_hash)},
                    {"success", run.success ? ordered_json(*run.success) : ordered_json(nullptr)},
                    {"success_s", run.success_s ? ordered_json(*run.success_s) : ordered_json(nullptr)},
                    {"sensor_frames_skipped", run.sensor_frames_skipped},
                    {"actuator_frames_repeated", run.actuator_frames_repeated},
                    {"actuator_values_clamped", run.actuator_values_clamped},
                    {"actuator_values_nan", run.actuator_values_nan},
                    {"metrics", metrics}};
  for (const auto& [name, value] : run.varied) json["varied"][name] = value;
  if (const auto purity = metrics.find("purity"); purity != metrics.end()) {  // docs/recordings.md
    json["purity"] = *purity;
    json["sorted_at_s"] = json["success_s"];
  }
  return json.dump(2, ' ', false, ordered_json::error_handler_t::replace) + "\n";
}

}  // namespace smartsurf::run
