// Compiled once per instruction set: foreach_target.h includes this file again for each.
#include "smartsurf/surface/actuators/PinKernels.h"

#include <algorithm>
#include <cstring>
#include <limits>

#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "smartsurf/surface/actuators/PinKernels.cpp"
#include <hwy/foreach_target.h>  // must come before highway.h
#include <hwy/highway.h>

HWY_BEFORE_NAMESPACE();
namespace smartsurf::surface {
namespace HWY_NAMESPACE {
namespace {

namespace hn = hwy::HWY_NAMESPACE;

constexpr std::size_t kMaxLanes = 16;

// Calls work(d) with the widest vectors that n pins fill.
template <class Work>
HWY_INLINE auto with_vectors_for(std::size_t n, Work work) {
  const hn::CappedTag<float, kMaxLanes> wide_tag;
  if (n >= hn::Lanes(wide_tag)) return work(wide_tag);
  const hn::CappedTag<float, 4> narrow_tag;
  if (n >= hn::Lanes(narrow_tag)) return work(narrow_tag);
  return work(hn::CappedTag<float, 1>());
}

// Calls step(i, done) for vectors of pins starting at i that together cover [0, n), n ≥ Lanes(d) or 0. The
// last vector may overlap pins already processed, marked in `done`, which must keep their values.
template <class D, class Step>
HWY_INLINE void for_each_vector(D d, std::size_t n, Step step) {
  const std::size_t lanes = hn::Lanes(d);
  std::size_t i = 0;
  for (; i + lanes <= n; i += lanes) step(i, hn::FirstN(d, 0));
  if (i < n) step(n - lanes, hn::FirstN(d, lanes - (n - i)));
}

// MotionProfile::operator(), vectorised. Must stay bit-identical to it.
template <class D, class V = hn::Vec<D>>
HWY_INLINE V profile_speed(D d, const MotionProfile::Constants& c, V distance, V speed, V max_speed) {
  const V one = hn::Set(d, 1.0F), half = hn::Set(d, 0.5F), step = hn::Set(d, c.speed_step);
  const V arrival_speed = hn::Mul(hn::Abs(distance), hn::Set(d, c.inverse_dt));
  const V room = hn::Sub(arrival_speed, hn::IfThenElseZero(hn::Gt(arrival_speed, hn::Set(d, c.lag_distance)),
                                                           hn::Set(d, c.lag_excess)));
  const V unclamped_units = hn::Mul(room, hn::Set(d, c.inverse_speed_step)),
          max_units = hn::Set(d, c.max_units);
  const V units = hn::IfThenElse(hn::Lt(unclamped_units, max_units), unclamped_units, max_units);
  const V root = hn::Sqrt(hn::Add(one, hn::Mul(hn::Set(d, 8.0F), units)));
  const V k = hn::Trunc(hn::Mul(half, hn::Sub(root, one))), next = hn::Add(k, one);
  const V braking_loss = hn::Mul(hn::Mul(hn::Set(d, 0.5F * c.speed_step), k), next);
  const V stopping_speed = hn::Add(hn::Mul(k, step), hn::Div(hn::Sub(room, braking_loss), next));
  const V lagging_speed = hn::Mul(arrival_speed, hn::Set(d, c.most_part));
  const V most_speed = hn::IfThenElse(hn::Lt(lagging_speed, max_speed), lagging_speed, max_speed);
  const V desired =
      hn::CopySign(hn::IfThenElse(hn::Lt(stopping_speed, most_speed), stopping_speed, most_speed), distance);
  const V low = hn::Sub(speed, step), high = hn::Add(speed, step);
  const V at_least_low = hn::IfThenElse(hn::Gt(desired, low), desired, low);
  return hn::IfThenElse(hn::Lt(at_least_low, high), at_least_low, high);
}

CommandUpdate clamp_commands_for_target(std::span<const CellRun> runs, const CellRun& within, float low,
                                        float high, const float* all_safe, float* all_commands) {
  CommandUpdate update;
  for (const CellRun& run : runs) {
    const CellRun cells = common_cells(run, within);
    const std::size_t n = length_of(cells);
    float* const commands = all_commands + cells.begin;
    const float* const safe = all_safe + cells.begin;
    update += with_vectors_for(n, [=](auto d) HWY_ATTR {
      std::size_t kept = 0, numbers = 0;
      for_each_vector(d, n, [&](std::size_t i, auto done) HWY_ATTR {
        const auto command = hn::LoadU(d, commands + i), minimum = hn::Set(d, low),
                   maximum = hn::Set(d, high);
        const auto at_least_minimum = hn::IfThenElse(hn::Lt(command, minimum), minimum, command);
        const auto in_range = hn::IfThenElse(hn::Gt(at_least_minimum, maximum), maximum, at_least_minimum);
        const auto is_number = hn::Eq(command, command);
        const auto result = hn::IfThenElse(is_number, in_range, hn::LoadU(d, safe + i));
        numbers += hn::CountTrue(d, hn::AndNot(done, is_number));
        kept += hn::CountTrue(d, hn::AndNot(done, hn::Eq(result, command)));
        hn::StoreU(result, d, commands + i);
      });
      return CommandUpdate{.clamped = numbers - kept, .nan = n - numbers, .changed = true};
    });
  }
  return update;
}

bool update_targets_for_target(std::span<const CellRun> runs, const float* base, const float* commands,
                               float* target) {
  bool changed = false;
  for (const CellRun& run : runs) {
    const std::size_t n = length_of(run);
    with_vectors_for(n, [&](auto d) HWY_ATTR {
      for_each_vector(d, n, [&](std::size_t k, auto) HWY_ATTR {
        const std::size_t i = run.begin + k;
        const auto next_target = hn::Add(hn::LoadU(d, base + i), hn::LoadU(d, commands + i));
        changed |= !hn::AllTrue(d, hn::Eq(next_target, hn::LoadU(d, target + i)));
        hn::StoreU(next_target, d, target + i);
      });
      return 0;
    });
  }
  return changed;
}

PinMotion plan_speeds_for_target(std::size_t n, const float* target, const float* height,
                                 const MotionProfile& profile, float* speeds) {
  const MotionProfile::Constants c = profile.constants();
  return with_vectors_for(n, [=](auto d) HWY_ATTR {
    PinMotion motion;
    auto max_speed = hn::Zero(d);
    for_each_vector(d, n, [&](std::size_t i, auto done) HWY_ATTR {
      const auto distance = hn::Sub(hn::LoadU(d, target + i), hn::LoadU(d, height + i));
      const auto before = hn::LoadU(d, speeds + i);
      const auto speed =
          hn::IfThenElse(done, before, profile_speed(d, c, distance, before, hn::Set(d, c.max_speed)));
      hn::StoreU(speed, d, speeds + i);
      const auto rest = hn::And(hn::Eq(distance, hn::Zero(d)), hn::Eq(speed, hn::Zero(d)));
      motion.moving |= !hn::AllTrue(d, rest);
      max_speed = hn::Max(max_speed, hn::Abs(speed));
    });
    motion.max_speed = hn::GetLane(hn::MaxOfLanes(d, max_speed));
    return motion;
  });
}

float advance_pins_for_target(std::size_t n, const float* target, const float* speed, float dt_s, float unit,
                              float* heights) {
  return with_vectors_for(n, [=](auto d) HWY_ATTR {
    auto max_height = hn::Set(d, -std::numeric_limits<float>::infinity());
    for_each_vector(d, n, [&](std::size_t i, auto done) HWY_ATTR {
      const auto goal = hn::LoadU(d, target + i);
      const auto before = hn::LoadU(d, heights + i);
      const auto next = hn::Add(before, hn::Mul(hn::LoadU(d, speed + i), hn::Set(d, dt_s)));
      const auto scale = hn::Max(hn::Abs(next), hn::Set(d, unit));
      const auto arrived = hn::Le(hn::Abs(hn::Sub(goal, next)), hn::Mul(hn::Set(d, 1e-6F), scale));
      const auto height = hn::IfThenElse(done, before, hn::IfThenElse(arrived, goal, next));
      hn::StoreU(height, d, heights + i);
      max_height = hn::Max(max_height, height);
    });
    return hn::GetLane(hn::MaxOfLanes(d, max_height));
  });
}

}  // namespace
}  // namespace HWY_NAMESPACE
}  // namespace smartsurf::surface
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace smartsurf::surface {

HWY_EXPORT(clamp_commands_for_target);
HWY_EXPORT(update_targets_for_target);
HWY_EXPORT(plan_speeds_for_target);
HWY_EXPORT(advance_pins_for_target);

CommandUpdate clamp_commands(std::span<const CellRun> runs, const CellRun& within, const float* commands,
                             float low, float high, const float* safe, float* clamped) noexcept {
  constexpr std::size_t kBlock = 1024;  // about as many cells stay in the L1 cache between the passes
  // Most controllers hold their commands for many steps.
  const auto holds = [&](const CellRun& run) {
    const CellRun cells = common_cells(run, within);
    return std::memcmp(commands + (cells.begin - within.begin), clamped + cells.begin,
                       length_of(cells) * sizeof(float)) == 0;
  };
  CommandUpdate update;
  for (std::size_t first = 0, end = 0; first < runs.size(); first = end) {
    for (std::size_t count = 0; end < runs.size() && count < kBlock; ++end) count += length_of(runs[end]);
    const auto block = runs.subspan(first, end - first);
    if (std::ranges::all_of(block, holds)) continue;
    for (const CellRun& run : block) {
      const CellRun cells = common_cells(run, within);
      std::copy_n(commands + (cells.begin - within.begin), length_of(cells), clamped + cells.begin);
    }
    asm volatile("" ::: "memory");  // keeps the compiler from reading `commands` a second time
    update += HWY_DYNAMIC_DISPATCH(clamp_commands_for_target)(block, within, low, high, safe, clamped);
  }
  return update;
}

bool update_targets(std::span<const CellRun> runs, const float* base, const float* commands,
                    float* target) noexcept {
  return HWY_DYNAMIC_DISPATCH(update_targets_for_target)(runs, base, commands, target);
}

PinMotion plan_speeds(std::size_t n, const float* target, const float* height, const MotionProfile& profile,
                      float* speed) noexcept {
  return HWY_DYNAMIC_DISPATCH(plan_speeds_for_target)(n, target, height, profile, speed);
}

float advance_pins(std::size_t n, const float* target, const float* speed, float dt_s, float unit,
                   float* height) noexcept {
  return HWY_DYNAMIC_DISPATCH(advance_pins_for_target)(n, target, speed, dt_s, unit, height);
}

}  // namespace smartsurf::surface
#endif
