#include "smartsurf/run/Pacer.h"

namespace smartsurf::run {
namespace {
using namespace std::chrono_literals;
// A run that is later than this does not catch up; the schedule restarts from now.
constexpr auto kMaxLateness = 250ms;
constexpr auto kMeasureWindow = 500ms;
}  // namespace

Pacer::Clock::time_point Pacer::due_time(double simulated_s) noexcept {
  const auto now = Clock::now();
  if (!factor_) return now;
  if (!anchored_) {
    anchored_ = true;
    anchor_ = now;
    anchor_simulated_s_ = simulated_s;
  }
  const std::chrono::duration<double> wall_offset((simulated_s - anchor_simulated_s_) / *factor_);
  const auto due = anchor_ + std::chrono::duration_cast<Clock::duration>(wall_offset);
  if (now - due > kMaxLateness) {
    anchor_ = now;
    anchor_simulated_s_ = simulated_s;
    return now;
  }
  return due;
}

double Pacer::update_real_time_factor(double simulated_s) noexcept {
  const auto now = Clock::now();
  if (window_start_ == Clock::time_point{}) {
    window_start_ = now;
    window_simulated_s_ = simulated_s;
  } else if (now - window_start_ >= kMeasureWindow) {
    real_time_factor_ =
        (simulated_s - window_simulated_s_) / std::chrono::duration<double>(now - window_start_).count();
    window_start_ = now;
    window_simulated_s_ = simulated_s;
  }
  return real_time_factor_;
}

}  // namespace smartsurf::run
