#include "smartsurf/surface/actuators/Pins.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <numeric>

#include "common/threads/ThreadPool.h"
#include "smartsurf/surface/actuators/PinKernels.h"

namespace smartsurf::surface {
namespace {

// How long a pin that was pushed onto its lower stop waits before it tries to rise again.
constexpr float kRetryDelay_s = 0.1F;
constexpr float kStopTolerance = 1e-4F;  // u

// Approximate cost per pin of set_targets(), plan() and commit().
constexpr double kSetTargetCost_ns = 0.4, kPlanCost_ns = 1.0, kCommitCost_ns = 0.5;

std::size_t run_length(const CellRun& run) { return static_cast<std::size_t>(run.end - run.begin); }
std::size_t run_begin(const CellRun& run) { return static_cast<std::size_t>(run.begin); }

}  // namespace

Pins::Pins(const ActuatorContext& context)
    : runs_(context.runs),
      pool_(context.pool),
      pin_count_(
          std::transform_reduce(runs_.begin(), runs_.end(), std::size_t{0}, std::plus<>(), run_length)),
      max_speed_(static_cast<float>(context.spec.number("max_speed"))),
      max_acceleration_(static_cast<float>(context.spec.number("max_acceleration"))),
      min_height_(static_cast<float>(context.spec.numbers("range")[0])),
      base_(context.field.height),
      target_(context.field.height),
      moving_(runs_.size(), 0),
      run_max_height_(runs_.size(), 0.0F),
      run_max_speed_(runs_.size(), 0.0F) {
  if (context.spec.has("max_force")) {
    force_limit_ = static_cast<float>(context.spec.number("max_force"));
    planned_speed_.resize(target_.size(), 0.0F);
    retry_wait_ = planned_speed_;
  }
}

template <class Work>
void Pins::for_each_run(double cost_ns, const Work& work) const {
  const auto band = [&work](int begin, int end) {
    for (auto r = static_cast<std::size_t>(begin); r < static_cast<std::size_t>(end); ++r) work(r);
  };
  const int runs = static_cast<int>(runs_.size());
  if (pool_ == nullptr) return band(0, runs);
  pool_->parallel_for_rows(runs, cost_ns * static_cast<double>(pin_count_), band);
}

template <class Work>
void Pins::for_each_moving_run(double cost_ns, const Work& work) const {
  const auto moving = static_cast<double>(std::ranges::count(moving_, 1));
  if (moving == 0.0) return;
  for_each_run(cost_ns * moving / static_cast<double>(runs_.size()), [this, &work](std::size_t r) {
    if (moving_[r] != 0) work(r);
  });
}

void Pins::set_targets(int, std::span<const float> targets) noexcept {
  for_each_run(kSetTargetCost_ns, [this, targets](std::size_t r) {
    const std::size_t i = run_begin(runs_[r]);
    if (update_targets(run_length(runs_[r]), &base_[i], &targets[i], &target_[i])) moving_[r] = 1;
  });
}

void Pins::snap_to_targets(Field& field) noexcept {
  for (std::size_t r = 0; r < runs_.size(); ++r) {
    const std::span<const float> targets(&target_[run_begin(runs_[r])], run_length(runs_[r]));
    std::ranges::copy(targets, &field.height[run_begin(runs_[r])]);
    run_max_height_[r] = std::ranges::max(targets);
    moving_[r] = 0;
  }
}

void Pins::plan(double dt_s, Field& field) noexcept {
  const auto dt = static_cast<float>(dt_s);
  // The load may push any pin with a force limit, so all of them are planned in every step.
  if (force_limit_) std::ranges::fill(moving_, std::uint8_t{1});
  const MotionProfile profile(max_speed_, max_acceleration_, dt);
  for_each_moving_run(kPlanCost_ns, [&](std::size_t r) { plan_run(r, profile, dt, field); });
  for (std::size_t r = 0; r < runs_.size(); ++r) {
    field.max_height = std::max(field.max_height, run_max_height_[r]);
    field.max_speed = std::max(field.max_speed, run_max_speed_[r]);
  }
}

void Pins::plan_run(std::size_t run, const MotionProfile& profile, float dt_s, Field& field) noexcept {
  const std::size_t i = run_begin(runs_[run]), n = run_length(runs_[run]);
  if (!force_limit_) {
    const PinMotion motion = plan_speeds(n, &target_[i], &field.height[i], profile, &field.speed[i]);
    moving_[run] = motion.moving;
    run_max_speed_[run] = motion.max_speed;
    return;
  }
  run_max_speed_[run] = 0.0F;
  for (std::size_t k = i; k < i + n; ++k) {
    field.speed[k] = plan_under_load(k, profile, dt_s, field);
    run_max_speed_[run] = std::max(run_max_speed_[run], std::abs(field.speed[k]));
  }
}

// Motor characteristic: force = max_force·(1 − v/max_speed), full force at rest and none at maximum speed. The speed
// is that under the load of the coming step, which only the physics knows; it lowers the planned speed. A pin that the load pushes back continues from its remaining speed. On the lower stop the frame carries the
// load; a pin that cannot leave the stop under its load waits kRetryDelay_s.
float Pins::plan_under_load(std::size_t i, const MotionProfile& profile, float dt_s, Field& field) noexcept {
  const float speed = std::max(field.speed[i], std::min(planned_speed_[i], 0.0F));
  const bool on_stop = field.height[i] <= lower_stop(i) + kStopTolerance;
  if (on_stop && planned_speed_[i] > 0.0F && field.speed[i] <= 0.0F) retry_wait_[i] = kRetryDelay_s;
  planned_speed_[i] = profile(target_[i] - field.height[i], speed);
  if (retry_wait_[i] > 0.0F) {
    retry_wait_[i] -= dt_s;
    if (on_stop) planned_speed_[i] = std::min(planned_speed_[i], 0.0F);
  }
  field.no_load_speed[i] = max_speed_;
  field.force_limit[i] =
      on_stop && planned_speed_[i] <= 0.0F ? std::numeric_limits<float>::infinity() : *force_limit_;
  return planned_speed_[i];
}

void Pins::commit(double dt_s, Field& field) noexcept {
  for_each_moving_run(kCommitCost_ns, [&](std::size_t r) {
    const std::size_t i = run_begin(runs_[r]);
    run_max_height_[r] = advance_pins(run_length(runs_[r]), &target_[i], &field.speed[i],
                                      static_cast<float>(dt_s), &field.height[i]);
    if (!force_limit_) return;
    for (std::size_t k = i; k < i + run_length(runs_[r]); ++k) {
      field.height[k] = std::max(field.height[k], lower_stop(k));
      run_max_height_[r] = std::max(run_max_height_[r], field.height[k]);
    }
  });
}

}  // namespace smartsurf::surface
