#include "smartsurf/surface/actuators/RateLimitedLag.h"

#include <algorithm>
#include <cmath>

namespace smartsurf::surface {

RateLimitedLag::RateLimitedLag(const ActuatorContext& context, float start, double max_rate, double lag_s)
    : runs_(context.runs),
      max_rate_(max_rate),
      lag_s_(lag_s),
      value_(context.field.cells(), start),
      target_(value_),
      arrival_(value_.size(), 0.0F),
      moving_(runs_.size(), 0),
      changed_(runs_.size(), 0) {}

void RateLimitedLag::set_targets(std::span<const float> targets) noexcept {
  for (std::size_t r = 0; r < runs_.size(); ++r) {
    int any_moving = 0;  // compilers vectorise this loop, not that of a bool
    for (int i = runs_[r].begin; i < runs_[r].end; ++i) {
      const float arrival = kArrival * std::max(std::abs(targets[i]), std::abs(value_[i]));
      arrival_[i] = targets[i] != target_[i] ? arrival : arrival_[i];
      target_[i] = targets[i];
      any_moving |= target_[i] != value_[i] ? 1 : 0;
    }
    moving_[r] = any_moving != 0;
  }
}

void RateLimitedLag::snap_to_targets() noexcept {
  value_ = target_;
  std::ranges::fill(moving_, std::uint8_t{0});
}

void RateLimitedLag::step(double dt_s) noexcept {
  const auto lag_fraction = static_cast<float>(lag_s_ > 0.0 ? -std::expm1(-dt_s / lag_s_) : 1.0);
  const auto max_change = static_cast<float>(std::min(max_rate_ * dt_s, kNoRateLimit));
  for (std::size_t r = 0; r < runs_.size(); ++r) {
    changed_[r] = moving_[r];
    if (moving_[r]) step_run(r, lag_fraction, max_change);
  }
}

void RateLimitedLag::step_run(std::size_t run, float lag_fraction, float max_change) noexcept {
  bool any_moving = false;
  for (int i = runs_[run].begin; i < runs_[run].end; ++i) {
    const float change = (target_[i] - value_[i]) * lag_fraction;
    const float next = value_[i] + std::clamp(change, -max_change, max_change);
    const bool is_stopped = next == value_[i] && std::abs(change) < max_change;
    value_[i] = is_stopped || std::abs(target_[i] - next) <= arrival_[i] ? target_[i] : next;
    any_moving |= value_[i] != target_[i];
  }
  moving_[run] = any_moving;
}

}  // namespace smartsurf::surface
