#include "smartsurf/surface/Pins.h"

#include <algorithm>
#include <cmath>
#include <numeric>

#include "smartsurf/surface/PinKernels.h"
#include "smartsurf/surface/WorkerPool.h"

namespace smartsurf::surface {
namespace {

// A load is felt through this time constant, so that one impact does not stop a pin, s.
constexpr float kLoadLag = 0.02F;
// How long a pin that could not bear its load waits before it tries again, s.
constexpr float kTripped = 0.5F;

// What one pin costs, about: to get its target or weigh its load, to find its speed, to move.
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
    load_.resize(target_.size(), 0.0F);
    wait_ = load_;
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
  if (force_limit_) for_runs(kRead_ns, [&](std::size_t r) { weigh_run(r, dt, field); });
  const Approach approach(speed_limit_, acceleration_limit_, dt);
  for_moving_runs(kSteer_ns, [&](std::size_t r) { plan_run(r, approach, dt, field); });
  for (std::size_t r = 0; r < runs_.size(); ++r) {
    field.max_height = std::max(field.max_height, run_height_[r]);
    field.max_speed = std::max(field.max_speed, run_speed_[r]);
  }
}

void Pins::weigh_run(std::size_t run, float dt_s, const Field& field) noexcept {
  const std::size_t i = first(runs_[run]);
  const float share = 1.0F - std::exp(-dt_s / kLoadLag);
  if (weigh(length(runs_[run]), &field.impulse[i], 1.0F / dt_s, share, *force_limit_, &load_[i]))
    moving_[run] = 1;
}

void Pins::plan_run(std::size_t run, const Approach& approach, float dt_s, Field& field) noexcept {
  const std::size_t i = first(runs_[run]), n = length(runs_[run]);
  Course course;
  if (force_limit_)
    course = steer_loaded(n,
                          {.base = &base_[i],
                           .target = &target_[i],
                           .height = &field.height[i],
                           .load = &load_[i],
                           .wait = &wait_[i],
                           .speed = &field.speed[i]},
                          approach,
                          {.limit = *force_limit_, .dt_s = dt_s, .lowest = lowest_, .pause_s = kTripped});
  else
    course = steer(n, &target_[i], &field.height[i], approach, &field.speed[i]);
  moving_[run] = course.moving;
  run_speed_[run] = course.fastest;
}

void Pins::commit(double dt_s, Field& field) noexcept {
  for_moving_runs(kMove_ns, [&](std::size_t r) {
    const std::size_t i = first(runs_[r]);
    run_height_[r] =
        advance(length(runs_[r]), &target_[i], &field.speed[i], static_cast<float>(dt_s), &field.height[i]);
  });
}

}  // namespace smartsurf::surface
