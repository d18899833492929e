#include "smartsurf/surface/Pins.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <numeric>

#include "smartsurf/surface/PinKernels.h"
#include "smartsurf/surface/WorkerPool.h"

namespace smartsurf::surface {
namespace {

// How long a pin that was pushed onto its lower stop waits before it tries again, s.
constexpr float kRetry = 0.1F;
constexpr float kAtStop = 1e-4F;  // u

// What one pin costs, about: to get its target, to find its speed, to move.
constexpr double kRead_ns = 0.4, kSteer_ns = 1.0, kMove_ns = 0.5;

std::size_t length(const Run& run) { return static_cast<std::size_t>(run.end - run.begin); }
std::size_t first(const Run& run) { return static_cast<std::size_t>(run.begin); }

}  // namespace

Pins::Pins(const Place& place)
    : runs_(place.runs),
      pool_(place.pool),
      pins_(std::transform_reduce(runs_.begin(), runs_.end(), std::size_t{0}, std::plus<>(), length)),
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

template <class Work>
void Pins::for_runs(double cost_ns, const Work& work) const {
  const auto band = [&work](int begin, int end) {
    for (auto r = static_cast<std::size_t>(begin); r < static_cast<std::size_t>(end); ++r) work(r);
  };
  const int runs = static_cast<int>(runs_.size());
  if (pool_ == nullptr) return band(0, runs);
  pool_->for_rows(runs, cost_ns * static_cast<double>(pins_), band);
}

template <class Work>
void Pins::for_moving_runs(double cost_ns, const Work& work) const {
  const auto moving = static_cast<double>(std::ranges::count(moving_, 1));
  if (moving == 0.0) return;
  for_runs(cost_ns * moving / static_cast<double>(runs_.size()), [this, &work](std::size_t r) {
    if (moving_[r] != 0) work(r);
  });
}

void Pins::set_targets(int, std::span<const float> targets) noexcept {
  for_runs(kRead_ns, [this, targets](std::size_t r) {
    const std::size_t i = first(runs_[r]);
    if (aim(length(runs_[r]), &base_[i], &targets[i], &target_[i])) moving_[r] = 1;
  });
}

void Pins::settle(Field& field) noexcept {
  for (std::size_t r = 0; r < runs_.size(); ++r) {
    const std::span<const float> targets(&target_[first(runs_[r])], length(runs_[r]));
    std::ranges::copy(targets, &field.height[first(runs_[r])]);
    run_height_[r] = std::ranges::max(targets);
    moving_[r] = 0;
  }
}

void Pins::plan(double dt_s, Field& field) noexcept {
  const auto dt = static_cast<float>(dt_s);
  // What can be pushed must be looked at in every step.
  if (force_limit_) std::ranges::fill(moving_, std::uint8_t{1});
  const Approach approach(speed_limit_, acceleration_limit_, dt);
  for_moving_runs(kSteer_ns, [&](std::size_t r) { plan_run(r, approach, dt, field); });
  for (std::size_t r = 0; r < runs_.size(); ++r) {
    field.max_height = std::max(field.max_height, run_height_[r]);
    field.max_speed = std::max(field.max_speed, run_speed_[r]);
  }
}

void Pins::plan_run(std::size_t run, const Approach& approach, float dt_s, Field& field) noexcept {
  const std::size_t i = first(runs_[run]), n = length(runs_[run]);
  if (!force_limit_) {
    const Course course = steer(n, &target_[i], &field.height[i], approach, &field.speed[i]);
    moving_[run] = course.moving;
    run_speed_[run] = course.fastest;
    return;
  }
  run_speed_[run] = 0.0F;
  for (std::size_t k = i; k < i + n; ++k) {
    field.speed[k] = plan_loaded(k, approach, dt_s, field);
    run_speed_[run] = std::max(run_speed_[run], std::abs(field.speed[k]));
  }
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
  for_moving_runs(kMove_ns, [&](std::size_t r) {
    const std::size_t i = first(runs_[r]);
    run_height_[r] =
        advance(length(runs_[r]), &target_[i], &field.speed[i], static_cast<float>(dt_s), &field.height[i]);
    if (!force_limit_) return;
    for (std::size_t k = i; k < i + length(runs_[r]); ++k) {
      field.height[k] = std::max(field.height[k], lower_stop(k));
      run_height_[r] = std::max(run_height_[r], field.height[k]);
    }
  });
}

}  // namespace smartsurf::surface
