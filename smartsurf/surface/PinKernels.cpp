// Compiled once per instruction set: foreach_target.h includes this file again for each.
#include "smartsurf/surface/PinKernels.h"

#include <algorithm>
#include <limits>

#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "smartsurf/surface/PinKernels.cpp"
#include <hwy/foreach_target.h>  // must come before highway.h
#include <hwy/highway.h>

HWY_BEFORE_NAMESPACE();
namespace smartsurf::surface {
namespace HWY_NAMESPACE {
namespace {

namespace hn = hwy::HWY_NAMESPACE;

constexpr std::size_t kWidest = 16;

// Calls step(d, i, done) for vectors of pins from i on, together [0, n). The last one may reach back over
// pins that are done, which keep what they have; few pins come one by one.
template <class Step>
HWY_INLINE void in_vectors(std::size_t n, Step step) {
  const hn::CappedTag<float, kWidest> wide;
  const std::size_t lanes = hn::Lanes(wide);
  std::size_t i = 0;
  for (; i + lanes <= n; i += lanes) step(wide, i, hn::FirstN(wide, 0));
  if (i < n && n >= lanes) {
    step(wide, n - lanes, hn::FirstN(wide, lanes - (n - i)));
    return;
  }
  const hn::CappedTag<float, 1> single;
  for (; i < n; ++i) step(single, i, hn::FirstN(single, 0));
}

class Greatest {
 public:
  explicit Greatest(float first) { std::fill_n(lane_, kWidest, first); }
  template <class D>
  HWY_INLINE void add(D d, hn::Vec<D> v) {
    hn::Store(hn::Max(hn::Load(d, lane_), v), d, lane_);
  }
  float of_all() const { return *std::max_element(lane_, lane_ + kWidest); }

 private:
  alignas(64) float lane_[kWidest];
};

// Approach, in lanes.
template <class D, class V = hn::Vec<D>>
HWY_INLINE V approach(D d, const Approach::Constants& c, V distance, V speed, V limit) {
  const V one = hn::Set(d, 1.0F), half = hn::Set(d, 0.5F), step = hn::Set(d, c.step);
  const V per_step = hn::Mul(hn::Abs(distance), hn::Set(d, c.inverse_dt));
  const V all_units = hn::Mul(per_step, hn::Set(d, c.inverse_step)), far = hn::Set(d, c.far);
  const V units = hn::IfThenElse(hn::Lt(all_units, far), all_units, far);
  const V root = hn::Sqrt(hn::Add(one, hn::Mul(hn::Set(d, 8.0F), units)));
  const V k = hn::Trunc(hn::Mul(half, hn::Sub(root, one))), next = hn::Add(k, one);
  const V braked = hn::Mul(hn::Mul(hn::Set(d, 0.5F * c.step), k), next);
  const V stoppable = hn::Add(hn::Mul(k, step), hn::Div(hn::Sub(per_step, braked), next));
  const V wanted = hn::CopySign(hn::IfThenElse(hn::Lt(stoppable, limit), stoppable, limit), distance);
  const V low = hn::Sub(speed, step), high = hn::Add(speed, step);
  const V raised = hn::IfThenElse(hn::Gt(wanted, low), wanted, low);
  return hn::IfThenElse(hn::Lt(raised, high), raised, high);
}

void take_commands_of_target(std::size_t n, const float* commands, float low, float high, float* kept) {
  in_vectors(n, [=](auto d, std::size_t i, auto) {
    const auto command = hn::LoadU(d, commands + i), least = hn::Set(d, low), most = hn::Set(d, high);
    const auto raised = hn::IfThenElse(hn::Lt(command, least), least, command);
    const auto within = hn::IfThenElse(hn::Gt(raised, most), most, raised);
    hn::StoreU(hn::IfThenElse(hn::Eq(command, command), within, hn::LoadU(d, kept + i)), d, kept + i);
  });
}

bool aim_of_target(std::size_t n, const float* base, const float* commands, float* target) {
  bool changed = false;
  in_vectors(n, [&](auto d, std::size_t i, auto) {
    const auto goal = hn::Add(hn::LoadU(d, base + i), hn::LoadU(d, commands + i));
    changed |= !hn::AllTrue(d, hn::Eq(goal, hn::LoadU(d, target + i)));
    hn::StoreU(goal, d, target + i);
  });
  return changed;
}

Course steer_of_target(std::size_t n, const float* target, const float* height, const Approach& law,
                       float* speeds) {
  Course course;
  Greatest fastest(0.0F);
  const Approach::Constants& c = law.constants();
  in_vectors(n, [&](auto d, std::size_t i, auto done) {
    const auto distance = hn::Sub(hn::LoadU(d, target + i), hn::LoadU(d, height + i));
    const auto before = hn::LoadU(d, speeds + i);
    const auto speed = hn::IfThenElse(done, before, approach(d, c, distance, before, hn::Set(d, c.limit)));
    hn::StoreU(speed, d, speeds + i);
    const auto rest = hn::And(hn::Eq(distance, hn::Zero(d)), hn::Eq(speed, hn::Zero(d)));
    course.moving |= !hn::AllTrue(d, rest);
    fastest.add(d, hn::Abs(speed));
  });
  course.fastest = fastest.of_all();
  return course;
}

float advance_of_target(std::size_t n, const float* target, const float* speed, float dt_s, float* heights) {
  Greatest highest(-std::numeric_limits<float>::infinity());
  in_vectors(n, [&](auto d, std::size_t i, auto done) {
    const auto goal = hn::LoadU(d, target + i);
    const auto before = hn::LoadU(d, heights + i);
    const auto next = hn::Add(before, hn::Mul(hn::LoadU(d, speed + i), hn::Set(d, dt_s)));
    const auto size = hn::Max(hn::Abs(next), hn::Set(d, 1.0F));
    const auto arrived = hn::Le(hn::Abs(hn::Sub(goal, next)), hn::Mul(hn::Set(d, 1e-6F), size));
    const auto height = hn::IfThenElse(done, before, hn::IfThenElse(arrived, goal, next));
    hn::StoreU(height, d, heights + i);
    highest.add(d, height);
  });
  return highest.of_all();
}

}  // namespace
}  // namespace HWY_NAMESPACE
}  // namespace smartsurf::surface
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace smartsurf::surface {

HWY_EXPORT(take_commands_of_target);
HWY_EXPORT(aim_of_target);
HWY_EXPORT(steer_of_target);
HWY_EXPORT(advance_of_target);

void take_commands(std::size_t n, const float* commands, float low, float high, float* kept) noexcept {
  HWY_DYNAMIC_DISPATCH(take_commands_of_target)(n, commands, low, high, kept);
}

bool aim(std::size_t n, const float* base, const float* commands, float* target) noexcept {
  return HWY_DYNAMIC_DISPATCH(aim_of_target)(n, base, commands, target);
}

Course steer(std::size_t n, const float* target, const float* height, const Approach& law,
             float* speed) noexcept {
  return HWY_DYNAMIC_DISPATCH(steer_of_target)(n, target, height, law, speed);
}

float advance(std::size_t n, const float* target, const float* speed, float dt_s, float* height) noexcept {
  return HWY_DYNAMIC_DISPATCH(advance_of_target)(n, target, speed, dt_s, height);
}

}  // namespace smartsurf::surface
#endif
