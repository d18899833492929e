// Pins that follow target heights within limits of speed and acceleration, and yield to loads they cannot
// lift.
#include <algorithm>
#include <cmath>
#include <cstdint>
#include <limits>
#include <numeric>
#include <optional>

#include "common/threads/ThreadPool.h"
#include "smartsurf/scene/PinTip.h"
#include "smartsurf/surface/actuators/Models.h"
#include "smartsurf/surface/actuators/PinKernels.h"

namespace smartsurf::surface {
namespace {

constexpr float kDampingTime_s = 0.02F;  // damping per stiffness by default

// Short runs are moved together with the cells between them, up to this many: a call for each would take
// longer.
constexpr std::size_t kMaxGroupCells = 64;

// Approximate cost per pin of set_targets(), plan() and commit().
constexpr double kSetTargetCost_ns = 0.4, kPlanCost_ns = 1.0, kCommitCost_ns = 0.5;

std::optional<TipKind> make_tip(const ActuatorContext& context) {
  using Shape = CellTip::Shape;
  const float half_x = context.field.half_top_x, half_y = context.field.half_top_y;
  const scene::PinTip tip =
      scene::pin_tip(context.spec, 2.0 * static_cast<double>(half_x), 2.0 * static_cast<double>(half_y));
  switch (tip.shape) {
    case scene::TipShape::kFlat: {
      if (!context.spec.has("stiffness")) break;
      CellTip top{Shape::kElasticTop};
      top.stiffness = context.number("stiffness");
      top.damping = context.spec.has("damping") ? context.number("damping") : kDampingTime_s * top.stiffness;
      return TipKind{top, std::hypot(half_x, half_y)};
    }
    case scene::TipShape::kHemisphere:
      return TipKind{{Shape::kHemisphere, tip.radius, tip.height}, tip.radius};
    case scene::TipShape::kCone:
      return TipKind{{Shape::kCone, tip.radius, tip.height}, tip.radius};
    case scene::TipShape::kRoundedSquare:
      return TipKind{{Shape::kRoundedSquare, tip.radius}, std::hypot(half_x, half_y)};
  }
  return std::nullopt;
}

class Pins final : public Actuator {
 public:
  explicit Pins(const ActuatorContext& context)
      : runs_(context.runs),
        pool_(context.pool),
        pin_count_(
            std::transform_reduce(runs_.begin(), runs_.end(), std::size_t{0}, std::plus<>(), length_of)),
        max_speed_(context.number("max_speed")),
        max_acceleration_(context.number("max_acceleration")),
        lag_s_(context.number("lag")),
        min_height_(static_cast<float>(context.spec.numbers("range")[0])),
        tip_(make_tip(context)),
        base_(context.field.height),
        target_(context.field.height) {
    if (context.spec.has("max_force")) {
      force_limit_ = context.number("max_force");
      planned_speed_.resize(target_.size(), 0.0F);
      retry_wait_ = planned_speed_;
    }
    group_runs(context);
    moving_.resize(groups_.size(), 0);
    group_max_height_.resize(groups_.size(), 0.0F);
    group_max_speed_.resize(groups_.size(), 0.0F);
  }

  void set_targets(int, std::span<const float> targets) noexcept override {
    for_each_group(kSetTargetCost_ns, [this, targets](std::size_t g) {
      const Group& group = groups_[g];
      const auto runs = std::span(runs_).subspan(group.first_run, group.end_run - group.first_run);
      if (update_targets(runs, base_.data(), targets.data(), target_.data())) moving_[g] = 1;
    });
  }

  void snap_to_targets(Field& field) noexcept override {
    for (std::size_t g = 0; g < groups_.size(); ++g) {
      const CellRun& cells = groups_[g].cells;
      const std::span<const float> targets(&target_[cells.begin], length_of(cells));
      std::ranges::copy(targets, &field.height[cells.begin]);
      group_max_height_[g] = std::ranges::max(targets);
      moving_[g] = 0;
    }
  }

  void plan(double dt_s, Field& field) noexcept override {
    const auto dt = static_cast<float>(dt_s);
    // The load may push any pin with a force limit, so all of them are planned in every step.
    if (force_limit_) std::ranges::fill(moving_, std::uint8_t{1});
    if (dt != profile_dt_s_)
      profile_ = MotionProfile(max_speed_, max_acceleration_, profile_dt_s_ = dt, lag_s_);
    for_each_moving_group(kPlanCost_ns, [&](std::size_t g) { plan_group(g, profile_, dt, field); });
    for (std::size_t g = 0; g < groups_.size(); ++g) {
      field.max_height = std::max(field.max_height, group_max_height_[g]);
      field.max_speed = std::max(field.max_speed, group_max_speed_[g]);
    }
  }

  void commit(double dt_s, Field& field) noexcept override {
    for_each_moving_group(kCommitCost_ns, [&](std::size_t g) {
      const std::size_t i = groups_[g].cells.begin, n = length_of(groups_[g].cells);
      float& max_height = group_max_height_[g];
      max_height = advance_pins(n, &target_[i], &field.speed[i], static_cast<float>(dt_s), field.pitch,
                                &field.height[i]);
      if (!force_limit_) return;
      for (std::size_t k = i; k < i + n; ++k) {
        field.height[k] = std::max(field.height[k], lower_stop(k));
        max_height = std::max(max_height, field.height[k]);
      }
    });
  }

  bool has_force_limit() const noexcept override { return force_limit_.has_value(); }
  std::optional<TipKind> tip() const noexcept override { return tip_; }

  void archive(common::StateArchive& a) override {
    a(target_, planned_speed_, retry_wait_, moving_, group_max_height_, group_max_speed_);
  }

 private:
  // Pins that move together: those of runs_[first_run] to runs_[end_run - 1], and the fixed cells between
  // them.
  struct Group {
    CellRun cells;
    std::size_t first_run, end_run;
  };
  // Joins short runs. Between the runs of a single model lies a fixed border, whose cells stay at their own
  // height, which is their target. Otherwise cells of other models, or none, lie between the runs, and they
  // stay apart.
  void group_runs(const ActuatorContext& context) {
    const bool joins = context.surface.actuator_of_cell.empty() && !force_limit_;
    const auto may_join = [joins](const CellRun& group, const CellRun& next) {
      return joins && length_of({group.begin, next.end}) <= kMaxGroupCells;
    };
    for (std::size_t r = 0; r < runs_.size(); ++r) {
      if (groups_.empty() || !may_join(groups_.back().cells, runs_[r])) groups_.push_back({runs_[r], r, r});
      groups_.back().cells.end = runs_[r].end;
      groups_.back().end_run = r + 1;
    }
  }

  // Call work(group) for every group, or every moving group, on the pool if that pays. cost_ns: per pin.
  template <class Work>
  void for_each_group(double cost_ns, const Work& work) const {
    const auto band = [&work](int begin, int end) {
      for (int g = begin; g < end; ++g) work(g);
    };
    const int groups = static_cast<int>(groups_.size());
    if (pool_ == nullptr) return band(0, groups);
    pool_->parallel_for_rows(groups, cost_ns * static_cast<double>(pin_count_), band);
  }

  template <class Work>
  void for_each_moving_group(double cost_ns, const Work& work) const {
    const auto moving = static_cast<double>(std::ranges::count(moving_, 1));
    if (moving == 0.0) return;
    for_each_group(cost_ns * moving / static_cast<double>(groups_.size()), [this, &work](std::size_t g) {
      if (moving_[g] != 0) work(g);
    });
  }

  void plan_group(std::size_t group, const MotionProfile& profile, float dt_s, Field& field) noexcept {
    const std::size_t i = groups_[group].cells.begin, n = length_of(groups_[group].cells);
    if (!force_limit_) {
      const PinMotion motion = plan_speeds(n, &target_[i], &field.height[i], profile, &field.speed[i]);
      moving_[group] = motion.moving;
      group_max_speed_[group] = motion.max_speed;
      return;
    }
    group_max_speed_[group] = 0.0F;
    for (std::size_t k = i; k < i + n; ++k) {
      field.speed[k] = plan_under_load(k, profile, dt_s, field);
      group_max_speed_[group] = std::max(group_max_speed_[group], std::abs(field.speed[k]));
    }
  }

  // The motor's characteristic is force = max_force·(1 − v/max_speed): full force at rest, none at maximum
  // speed. The speed v is that under the load of the coming step. Only the physics knows it, and lowers the
  // planned speed to it. A pin that the load pushes back continues from its remaining speed. On the lower
  // stop the frame carries the load; a pin that cannot leave the stop under its load waits kRetryDelay_s.
  float plan_under_load(std::size_t i, const MotionProfile& profile, float dt_s, Field& field) noexcept {
    const float speed = std::max(field.speed[i], std::min(planned_speed_[i], 0.0F));
    const bool on_stop = field.height[i] <= lower_stop(i) + kStopTolerance * field.pitch;
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

  float lower_stop(std::size_t cell) const { return base_[cell] + min_height_; }

  std::vector<CellRun> runs_;
  std::vector<Group> groups_;
  common::ThreadPool* pool_;
  std::size_t pin_count_;
  float max_speed_, max_acceleration_, lag_s_;
  float profile_dt_s_ = 1.0F;  // that profile_ is for
  MotionProfile profile_{max_speed_, max_acceleration_, profile_dt_s_, lag_s_};
  float min_height_;  // lower end of the range, u above the base
  std::optional<float> force_limit_;
  std::optional<TipKind> tip_;
  std::vector<float> base_, target_;  // rows × columns, u; target_ is the z of the top, base included
  // rows × columns; empty without a force limit. Planned speed before loads, u/s; remaining wait on the lower
  // stop, s.
  std::vector<float> planned_speed_, retry_wait_;
  // One per group, so that groups at rest on their targets cost nothing.
  std::vector<std::uint8_t> moving_;
  std::vector<float> group_max_height_, group_max_speed_;  // maximum height and |speed| of the group
};

}  // namespace

std::unique_ptr<Actuator> make_pins(const ActuatorContext& context) {
  return std::make_unique<Pins>(context);
}

}  // namespace smartsurf::surface
