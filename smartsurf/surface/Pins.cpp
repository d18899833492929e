#include "smartsurf/surface/Pins.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include "smartsurf/surface/Approach.h"

namespace smartsurf::surface {
namespace {

// How long a pin that was pushed onto its lower stop waits before it tries again, s.
constexpr float kRetry = 0.1F;
constexpr float kAtStop = 1e-4F;  // u

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
    planned_.resize(target_.size(), 0.0F);
    wait_ = planned_;
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

void Pins::plan(double dt_s, Field& field) noexcept {
  const auto dt = static_cast<float>(dt_s);
  // What can be pushed must be looked at in every step.
  for (std::size_t r = 0; r < runs_.size(); ++r)
    if (moving_[r] || force_limit_) plan_run(r, dt, field);
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
    for (std::size_t i = begin; i < begin + n; ++i) field.speed[i] = plan_loaded(i, approach, dt_s, field);
    moving = 1;
  }
  moving_[run] = moving != 0;
  run_speed_[run] = largest(n, [speed](std::size_t i) { return std::abs(speed[i]); });
}

// The motor's line, force = max_force·(1 − v/max_speed): all of it at rest, none at its greatest speed. What
// is pushed back goes on from the speed that is left to it. On the lower stop the frame bears the load; a pin
// that cannot leave it under its load waits there for a while.
float Pins::plan_loaded(std::size_t i, const Approach& approach, float dt_s, Field& field) noexcept {
  const float from = std::max(field.speed[i], std::min(planned_[i], 0.0F));
  const bool on_stop = field.height[i] <= lower_stop(i) + kAtStop;
  if (on_stop && planned_[i] > 0.0F && field.speed[i] <= 0.0F) wait_[i] = kRetry;
  planned_[i] = approach(target_[i] - field.height[i], from);
  if (wait_[i] > 0.0F) {
    wait_[i] -= dt_s;
    if (on_stop) planned_[i] = std::min(planned_[i], 0.0F);
  }
  const float force = *force_limit_ * std::clamp(1.0F - from / speed_limit_, 0.0F, 1.0F);
  field.force_limit[i] = on_stop && planned_[i] <= 0.0F ? std::numeric_limits<float>::infinity() : force;
  return planned_[i];
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
    if (force_limit_)
      for (std::size_t i = 0; i < n; ++i) height[i] = std::max(height[i], lower_stop(begin + i));
    measure(r, field);
  }
}

}  // namespace smartsurf::surface
