#include "smartsurf/surface/PinField.h"

#include <algorithm>
#include <cassert>
#include <cmath>

namespace smartsurf::surface {

PinField::PinField(const scene::SurfaceSpec& spec)
    : rows_(spec.rows),
      columns_(spec.columns),
      pitch_(spec.pitch),
      half_top_x_(spec.pin.top_x / 2.0),
      half_top_y_(spec.pin.top_y / 2.0),
      low_(static_cast<float>(spec.pin.min_height)),
      high_(static_cast<float>(spec.pin.max_height)),
      speed_limit_(static_cast<float>(spec.pin.max_speed)),
      acceleration_limit_(static_cast<float>(spec.pin.max_acceleration)),
      has_border_(spec.border_height.has_value()),
      height_(static_cast<std::size_t>(spec.cells()), low_),
      speed_(height_.size(), 0.0F),
      target_(height_),
      moving_(static_cast<std::size_t>(spec.rows), 0) {
  if (has_border_)
    for (int r = 0; r < rows_; ++r)
      for (int c = 0; c < columns_; ++c)
        if (spec.is_border(r, c)) {
          const auto i = static_cast<std::size_t>(spec.index(r, c));
          height_[i] = target_[i] = static_cast<float>(*spec.border_height);
        }
  max_height_ = *std::max_element(height_.begin(), height_.end());
}

void PinField::set_targets(std::span<const float> targets) noexcept {
  assert(targets.size() == target_.size());
  const int ring = has_border_ ? 1 : 0;
  for (int r = ring; r < rows_ - ring; ++r) {
    bool moving = moving_[static_cast<std::size_t>(r)] != 0;
    for (int c = ring; c < columns_ - ring; ++c) {
      const auto i = static_cast<std::size_t>(r * columns_ + c);
      const float wanted = targets[i];
      if (std::isnan(wanted)) continue;
      target_[i] = std::clamp(wanted, low_, high_);
      moving |= target_[i] != height_[i];
    }
    moving_[static_cast<std::size_t>(r)] = moving;
  }
}

void PinField::set_target(int row, int column, float height) noexcept {
  const bool border = row == 0 || column == 0 || row == rows_ - 1 || column == columns_ - 1;
  if (std::isnan(height) || (has_border_ && border)) return;
  target_[static_cast<std::size_t>(row * columns_ + column)] = std::clamp(height, low_, high_);
  moving_[static_cast<std::size_t>(row)] = 1;
}

void PinField::plan(double dt_s) noexcept {
  for (int r = 0; r < rows_; ++r)
    if (moving_[static_cast<std::size_t>(r)]) plan_row(r, static_cast<float>(dt_s));
  max_height_ = *std::max_element(height_.begin(), height_.end());
  max_speed_ = 0.0F;
  for (const float v : speed_) max_speed_ = std::max(max_speed_, std::abs(v));
}

// A pin that brakes by s = a·dt every step from k·s + f (f < s) covers ((k+1)·f + s·k·(k+1)/2)·dt before it rests.
// Solved for the distance left, that is the fastest speed from which it still stops exactly on its target.
void PinField::plan_row(int row, float dt_s) noexcept {
  const std::size_t first = static_cast<std::size_t>(row) * static_cast<std::size_t>(columns_);
  const float s = acceleration_limit_ * dt_s;
  const float inverse_dt = 1.0F / dt_s, inverse_s = 1.0F / s;
  // Beyond this the speed limit binds; it keeps k small enough for an int.
  const float steps_left_limit = std::min(speed_limit_ * inverse_s, 1e6F) + 1.0F;
  const float far = (steps_left_limit + 1.0F) * (steps_left_limit + 2.0F);
  float activity = 0.0F;
  for (std::size_t i = first; i < first + static_cast<std::size_t>(columns_); ++i) {
    const float distance = target_[i] - height_[i];
    const float per_step = std::abs(distance) * inverse_dt;  // speed that would arrive in this very step
    const float units = std::min(per_step * inverse_s, far);
    const auto k = static_cast<float>(static_cast<int>(0.5F * (std::sqrt(1.0F + 8.0F * units) - 1.0F)));
    const float stoppable = k * s + (per_step - 0.5F * s * k * (k + 1.0F)) / (k + 1.0F);
    const float wanted = std::copysign(std::min(stoppable, speed_limit_), distance);
    speed_[i] = std::min(std::max(wanted, speed_[i] - s), speed_[i] + s);
    activity = std::max(activity, std::max(per_step, std::abs(speed_[i])));
  }
  moving_[static_cast<std::size_t>(row)] = activity > 0.0F;
}

void PinField::commit(double dt_s) noexcept {
  const auto dt = static_cast<float>(dt_s);
  for (int r = 0; r < rows_; ++r) {
    if (!moving_[static_cast<std::size_t>(r)]) continue;
    const std::size_t first = static_cast<std::size_t>(r) * static_cast<std::size_t>(columns_);
    for (std::size_t i = first; i < first + static_cast<std::size_t>(columns_); ++i) {
      const float next = height_[i] + speed_[i] * dt;
      // Rounding must not leave a pin an ulp beside its target for ever.
      height_[i] = std::abs(target_[i] - next) <= 1e-6F * std::max(1.0F, std::abs(next)) ? target_[i] : next;
    }
  }
}

}  // namespace smartsurf::surface
