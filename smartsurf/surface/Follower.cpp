#include "smartsurf/surface/Follower.h"

#include <algorithm>
#include <cmath>

namespace smartsurf::surface {

Follower::Follower(const Place& place, float start, double max_rate, double lag_s)
    : runs_(place.runs),
      max_rate_(max_rate),
      lag_s_(lag_s),
      value_(static_cast<std::size_t>(place.field.cells()), start),
      target_(value_),
      on_the_way_(runs_.size(), 0),
      changed_(runs_.size(), 0) {}

void Follower::set_targets(std::span<const float> targets) noexcept {
  for (std::size_t r = 0; r < runs_.size(); ++r) {
    bool moving = false;
    for (auto i = static_cast<std::size_t>(runs_[r].begin); i < static_cast<std::size_t>(runs_[r].end); ++i) {
      target_[i] = targets[i];
      moving |= target_[i] != value_[i];
    }
    on_the_way_[r] = moving;
  }
}

void Follower::settle() noexcept {
  value_ = target_;
  std::ranges::fill(on_the_way_, std::uint8_t{0});
}

void Follower::step(double dt_s) noexcept {
  const auto share = static_cast<float>(lag_s_ > 0.0 ? -std::expm1(-dt_s / lag_s_) : 1.0);
  const auto most = static_cast<float>(std::min(max_rate_ * dt_s, 1e30));
  for (std::size_t r = 0; r < runs_.size(); ++r) {
    changed_[r] = on_the_way_[r];
    if (on_the_way_[r]) step_run(r, share, most);
  }
}

void Follower::step_run(std::size_t run, float share, float most) noexcept {
  bool moving = false;
  for (auto i = static_cast<std::size_t>(runs_[run].begin); i < static_cast<std::size_t>(runs_[run].end);
       ++i) {
    const float distance = target_[i] - value_[i];
    const float next = value_[i] + std::clamp(distance * share, -most, most);
    // A lag alone would never arrive.
    const float size = std::max(1.0F, std::abs(target_[i]));
    value_[i] = std::abs(target_[i] - next) <= 1e-6F * size ? target_[i] : next;
    moving |= value_[i] != target_[i];
  }
  on_the_way_[run] = moving;
}

}  // namespace smartsurf::surface
