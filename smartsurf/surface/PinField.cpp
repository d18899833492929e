#include "smartsurf/surface/PinField.h"

#include <algorithm>
#include <cassert>
#include <cmath>

namespace smartsurf::surface {
namespace {

// The largest of n values; eight running maxima, because the compiler may not reorder one.
float largest(const float* values, std::size_t n) noexcept {
  float lane[8];
  std::fill_n(lane, 8, values[0]);
  std::size_t i = 0;
  for (; i + 8 <= n; i += 8)
    for (std::size_t k = 0; k < 8; ++k) lane[k] = lane[k] < values[i + k] ? values[i + k] : lane[k];
  for (; i < n; ++i) lane[0] = std::max(lane[0], values[i]);
  return *std::max_element(lane, lane + 8);
}

Field resting_field(const scene::SurfaceSpec& spec) {
  Field f;
  const auto cells = static_cast<std::size_t>(spec.cells());
  f.rows = spec.rows;
  f.columns = spec.columns;
  f.pitch = static_cast<float>(spec.pitch);
  f.half_top_x = static_cast<float>(spec.pin.top_x / 2.0);
  f.half_top_y = static_cast<float>(spec.pin.top_y / 2.0);
  f.height.assign(cells, static_cast<float>(spec.pin.min_height));
  f.speed.assign(cells, 0.0F);
  f.impulse.assign(cells, 0.0F);
  return f;
}

}  // namespace

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
      field_(resting_field(spec)),
      target_(field_.height),
      moving_(static_cast<std::size_t>(spec.rows), 0),
      row_height_(moving_.size()),
      row_speed_(moving_.size(), 0.0F) {
  if (has_border_)
    for (int r = 0; r < rows_; ++r)
      for (int c = 0; c < columns_; ++c)
        if (spec.is_border(r, c)) {
          const auto i = static_cast<std::size_t>(spec.index(r, c));
          field_.height[i] = target_[i] = static_cast<float>(*spec.border_height);
        }
  for (std::size_t r = 0; r < row_height_.size(); ++r)
    row_height_[r] =
        largest(&field_.height[r * static_cast<std::size_t>(columns_)], static_cast<std::size_t>(columns_));
  field_.max_height = largest(row_height_.data(), row_height_.size());
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
      moving |= target_[i] != field_.height[i];
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
  for (std::size_t r = 0; r < moving_.size(); ++r)
    if (moving_[r]) plan_row(r, static_cast<float>(dt_s));
  field_.max_height = largest(row_height_.data(), row_height_.size());
  field_.max_speed = largest(row_speed_.data(), row_speed_.size());
}

// A pin that brakes by s = a·dt every step from k·s + f (f < s) covers ((k+1)·f + s·k·(k+1)/2)·dt before it
// rests. Solved for the distance left, that is the fastest speed from which it still stops exactly on its
// target.
void PinField::plan_row(std::size_t row, float dt_s) noexcept {
  const auto columns = static_cast<std::size_t>(columns_);
  const float* __restrict target = &target_[row * columns];
  const float* __restrict height = &field_.height[row * columns];
  float* __restrict speed = &field_.speed[row * columns];
  const float s = acceleration_limit_ * dt_s;
  const float inverse_dt = 1.0F / dt_s, inverse_s = 1.0F / s, limit = speed_limit_;
  // Beyond this the speed limit binds; it keeps k small enough for an int.
  const float steps_left_limit = std::min(limit * inverse_s, 1e6F) + 1.0F;
  const float far = (steps_left_limit + 1.0F) * (steps_left_limit + 2.0F);
  int moving = 0;
  for (std::size_t i = 0; i < columns; ++i) {
    const float distance = target[i] - height[i];
    const float per_step = std::abs(distance) * inverse_dt;  // speed that would arrive in this very step
    const float units = per_step * inverse_s < far ? per_step * inverse_s : far;
    const auto k = static_cast<float>(static_cast<int>(0.5F * (std::sqrt(1.0F + 8.0F * units) - 1.0F)));
    const float stoppable = k * s + (per_step - 0.5F * s * k * (k + 1.0F)) / (k + 1.0F);
    const float wanted = std::copysign(stoppable < limit ? stoppable : limit, distance);
    const float low = speed[i] - s, high = speed[i] + s;
    const float raised = wanted > low ? wanted : low;
    speed[i] = raised < high ? raised : high;
    moving |= static_cast<int>(distance != 0.0F) | static_cast<int>(speed[i] != 0.0F);
  }
  moving_[row] = moving != 0;
  float fastest[8] = {};
  std::size_t i = 0;
  for (; i + 8 <= columns; i += 8)
    for (std::size_t k = 0; k < 8; ++k)
      fastest[k] = fastest[k] < std::abs(speed[i + k]) ? std::abs(speed[i + k]) : fastest[k];
  for (; i < columns; ++i) fastest[0] = std::max(fastest[0], std::abs(speed[i]));
  row_speed_[row] = *std::max_element(fastest, fastest + 8);
}

void PinField::commit(double dt_s) noexcept {
  for (std::size_t r = 0; r < moving_.size(); ++r)
    if (moving_[r]) commit_row(r, static_cast<float>(dt_s));
}

void PinField::commit_row(std::size_t row, float dt_s) noexcept {
  const auto columns = static_cast<std::size_t>(columns_);
  const float* __restrict target = &target_[row * columns];
  const float* __restrict speed = &field_.speed[row * columns];
  float* __restrict height = &field_.height[row * columns];
  for (std::size_t i = 0; i < columns; ++i) {
    const float next = height[i] + speed[i] * dt_s;
    // Rounding must not leave a pin an ulp beside its target for ever.
    const float goal = target[i];
    const float magnitude = std::abs(next), size = magnitude > 1.0F ? magnitude : 1.0F;
    height[i] = std::abs(goal - next) <= 1e-6F * size ? goal : next;
  }
  row_height_[row] = largest(height, columns);
}

}  // namespace smartsurf::surface
