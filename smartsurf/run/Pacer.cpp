#include "smartsurf/run/Pacer.h"

namespace smartsurf::run {
namespace {
using namespace std::chrono_literals;
// A run this late does not race to catch up: it goes on from where it is.
constexpr auto kForgivenLateness = 250ms;
constexpr auto kMeasureWindow = 500ms;
}  // namespace

Pacer::Clock::time_point Pacer::due(double simulated_s) noexcept {
  const auto now = Clock::now();
  if (!factor_) return now;
  if (!anchored_) {
    anchored_ = true;
    anchor_ = now;
    anchor_simulated_s_ = simulated_s;
  }
  const std::chrono::duration<double> wall((simulated_s - anchor_simulated_s_) / *factor_);
  const auto due = anchor_ + std::chrono::duration_cast<Clock::duration>(wall);
  if (now - due > kForgivenLateness) {
    anchor_ = now;
    anchor_simulated_s_ = simulated_s;
    return now;
  }
  return due;
}

double Pacer::measured(double simulated_s) noexcept {
  const auto now = Clock::now();
  if (window_start_ == Clock::time_point{}) {
    window_start_ = now;
    window_simulated_s_ = simulated_s;
  } else if (now - window_start_ >= kMeasureWindow) {
    measured_ =
        (simulated_s - window_simulated_s_) / std::chrono::duration<double>(now - window_start_).count();
    window_start_ = now;
    window_simulated_s_ = simulated_s;
  }
  return measured_;
}

}  // namespace smartsurf::run
