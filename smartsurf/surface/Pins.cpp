#include "smartsurf/surface/Pins.h"

#include <algorithm>
#include <cmath>

#include "smartsurf/surface/Approach.h"

namespace smartsurf::surface {
namespace {

// A load is felt through this time constant, so that one impact does not stop a pin, s.
constexpr float kLoadLag = 0.02F;
// How long a pin that could not bear its load waits before it tries again, s.
constexpr float kTripped = 0.5F;

// The largest of n values of f; eight running maxima, because the compiler may not reorder one.
template <class F>
float largest(std::size_t n, F f) noexcept {
  float lane[8];
  std::fill_n(lane, 8, f(0));
  std::size_t i = 0;
  for (; i + 8 <= n; i += 8)
    for (std::size_t k = 0; k < 8; ++k) lane[k] = lane[k] < f(i + k) ? f(i + k) : lane[k];
  for (; i < n; ++i) lane[0] = std::max(lane[0], f(i));
  return *std::max_element(lane, lane + 8);
}

std::size_t length(const Run& run) { return static_cast<std::size_t>(run.end - run.begin); }

}  // namespace

Pins::Pins(const Place& place)
    : runs_(place.runs),
      speed_limit_(static_cast<float>(place.spec.number("max_speed"))),
      acceleration_limit_(static_cast<float>(place.spec.number("max_acceleration"))),
      lowest_(static_cast<float>(place.spec.numbers("range")[0])),
      base_(place.field.height),
      target_(place.field.height),
      moving_(runs_.size(), 0),
      run_height_(runs_.size(), 0.0F),
      run_speed_(runs_.size(), 0.0F) {
  if (place.spec.has("max_force")) {
    force_limit_ = static_cast<float>(place.spec.number("max_force"));
    load_.resize(target_.size(), 0.0F);
    wait_ = load_;
  }
}

void Pins::set_targets(int, std::span<const float> targets) noexcept {
  for (std::size_t r = 0; r < runs_.size(); ++r) {
    bool changed = false;
    for (auto i = static_cast<std::size_t>(runs_[r].begin); i < static_cast<std::size_t>(runs_[r].end); ++i) {
      const float goal = base_[i] + targets[i];
      changed |= goal != target_[i];
      target_[i] = goal;
    }
    moving_[r] |= static_cast<std::uint8_t>(changed);
  }
}

void Pins::settle(Field& field) noexcept {
  for (std::size_t r = 0; r < runs_.size(); ++r) {
    std::copy(&target_[static_cast<std::size_t>(runs_[r].begin)],
              &target_[static_cast<std::size_t>(runs_[r].begin)] + length(runs_[r]),
              &field.height[static_cast<std::size_t>(runs_[r].begin)]);
    moving_[r] = 0;
    measure(r, field);
  }
}

void Pins::measure(std::size_t run, const Field& field) noexcept {
  const float* height = &field.height[static_cast<std::size_t>(runs_[run].begin)];
  run_height_[run] = largest(length(runs_[run]), [height](std::size_t i) { return height[i]; });
}

void Pins::weigh(float dt_s, const Field& field) noexcept {
  const float share = 1.0F - std::exp(-dt_s / kLoadLag), inverse_dt = 1.0F / dt_s;
  for (std::size_t r = 0; r < runs_.size(); ++r) {
    bool overloaded = false;
    for (auto i = static_cast<std::size_t>(runs_[r].begin); i < static_cast<std::size_t>(runs_[r].end); ++i) {
      load_[i] += (field.impulse[i] * inverse_dt - load_[i]) * share;
      overloaded |= load_[i] > *force_limit_;
    }
    moving_[r] |= static_cast<std::uint8_t>(overloaded);
  }
}

void Pins::plan(double dt_s, Field& field) noexcept {
  const auto dt = static_cast<float>(dt_s);
  if (force_limit_) weigh(dt, field);
  for (std::size_t r = 0; r < runs_.size(); ++r)
    if (moving_[r]) plan_run(r, dt, field);
  for (std::size_t r = 0; r < runs_.size(); ++r) {
    field.max_height = std::max(field.max_height, run_height_[r]);
    field.max_speed = std::max(field.max_speed, run_speed_[r]);
  }
}

void Pins::plan_run(std::size_t run, float dt_s, Field& field) noexcept {
  const auto begin = static_cast<std::size_t>(runs_[run].begin), n = length(runs_[run]);
  const float* __restrict target = &target_[begin];
  const float* __restrict height = &field.height[begin];
  float* __restrict speed = &field.speed[begin];
  const Approach approach(speed_limit_, acceleration_limit_, dt_s);
  int moving = 0;
  if (!force_limit_) {
    for (std::size_t i = 0; i < n; ++i) {
      const float distance = target[i] - height[i];
      speed[i] = approach(distance, speed[i]);
      moving |= static_cast<int>(distance != 0.0F) | static_cast<int>(speed[i] != 0.0F);
    }
  } else {
    for (std::size_t i = 0; i < n; ++i) {
      const float distance = target[i] - height[i];
      speed[i] = loaded_speed(begin + i, distance, approach, dt_s, field);
      moving |= static_cast<int>(distance != 0.0F) | static_cast<int>(speed[i] != 0.0F);
    }
  }
  moving_[run] = moving != 0;
  run_speed_[run] = largest(n, [speed](std::size_t i) { return std::abs(speed[i]); });
}

// The motor's line, v = max_speed·(1 − load/max_force): as fast as it may without a load, standing at the
// greatest one. More trips the drive: the load pushes the pin back, down to the lower stop, and only after a
// while it tries again.
float Pins::loaded_speed(std::size_t cell, float distance, const Approach& approach, float dt_s,
                         const Field& field) noexcept {
  const float speed = field.speed[cell], left = 1.0F - load_[cell] / *force_limit_;
  if (left >= 0.0F && wait_[cell] <= 0.0F)
    return approach(distance, speed, distance > 0.0F ? speed_limit_ * left : speed_limit_);
  wait_[cell] = left < 0.0F ? kTripped : wait_[cell] - dt_s;
  const float to_stop = std::min(0.0F, base_[cell] + lowest_ - field.height[cell]) / dt_s;
  const float back = speed_limit_ * std::clamp(left, -1.0F, 0.0F);
  return std::max(to_stop, std::max(speed - acceleration_limit_ * dt_s, back));
}

void Pins::commit(double dt_s, Field& field) noexcept {
  const auto dt = static_cast<float>(dt_s);
  for (std::size_t r = 0; r < runs_.size(); ++r) {
    if (!moving_[r]) continue;
    const auto begin = static_cast<std::size_t>(runs_[r].begin), n = length(runs_[r]);
    const float* __restrict target = &target_[begin];
    const float* __restrict speed = &field.speed[begin];
    float* __restrict height = &field.height[begin];
    for (std::size_t i = 0; i < n; ++i) height[i] = Approach::arrive(height[i], speed[i], target[i], dt);
    measure(r, field);
  }
}

}  // namespace smartsurf::surface
