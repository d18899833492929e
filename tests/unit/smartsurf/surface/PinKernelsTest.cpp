#include "smartsurf/surface/actuators/PinKernels.h"

#include <gtest/gtest.h>

#include <hwy/highway.h>

#include <algorithm>
#include <bit>
#include <cmath>
#include <functional>
#include <limits>
#include <random>
#include <vector>

using namespace smartsurf::surface;

namespace {

constexpr float kPinStep = 1.0F / 240, kTop = 3.0F;
constexpr std::size_t kMaxPins = 67;  // covers every vector width and remainder

// Pins at rest or moving, on, near and far from their targets; some exceed the speed limit.
struct Pins {
  std::vector<float> base, command, target, height, speed;

  Pins(std::size_t n, unsigned seed) {
    std::mt19937 random(seed);
    std::uniform_real_distribution<float> u(0, 1);
    const auto pick = [&](float a, float b, float c) {
      return u(random) < 0.3F ? a : u(random) < 0.3F ? b : c;
    };
    for (std::size_t i = 0; i < n; ++i) {
      base.push_back(pick(0, -0.0F, u(random)));
      command.push_back(kTop * u(random));
      target.push_back(base[i] + command[i]);
      height.push_back(pick(target[i], target[i] + 2e-3F * (u(random) - 0.5F), kTop * u(random)));
      speed.push_back(pick(0, -0.0F, 16 * (u(random) - 0.5F)));
    }
  }
};

bool same_bits(const std::vector<float>& a, const std::vector<float>& b) {
  return std::ranges::equal(a, b, {}, std::bit_cast<std::uint32_t, float>,
                            std::bit_cast<std::uint32_t, float>);
}

// Runs the test once per SIMD instruction set that this CPU supports.
void for_every_target(const std::function<void()>& test) {
  for (const std::int64_t target : hwy::SupportedAndGeneratedTargets()) {
    hwy::SetSupportedTargetsForTest(target);
    hwy::GetChosenTarget().Update(hwy::SupportedTargets());
    SCOPED_TRACE(hwy::TargetName(target));
    test();
  }
  hwy::SetSupportedTargetsForTest(0);
  hwy::GetChosenTarget().Update(hwy::SupportedTargets());
}

struct Limits {
  float speed, acceleration, lag = 0.0F;
  MotionProfile profile() const { return {speed, acceleration, kPinStep, lag}; }
};
const Limits kLimits[] = {{4.0F, 60.0F}, {6.0F, 1e4F},         {1e9F, 3.0F},
                          {0.5F, 0.01F}, {4.0F, 60.0F, 0.02F}, {1e9F, 1e7F, 0.1F}};

}  // namespace

TEST(PinKernels, PlanSpeedsMatchesScalarLaw) {
  for_every_target([] {
    for (std::size_t n = 1; n <= kMaxPins; ++n)
      for (const Limits& most : kLimits) {
        const MotionProfile law = most.profile();
        Pins p(n, static_cast<unsigned>(n));
        std::vector<float> expected = p.speed;
        PinMotion course;
        for (std::size_t i = 0; i < n; ++i) {
          const float distance = p.target[i] - p.height[i];
          expected[i] = law(distance, p.speed[i]);
          course.moving |= distance != 0.0F || expected[i] != 0.0F;
          course.max_speed = std::max(course.max_speed, std::abs(expected[i]));
        }
        const PinMotion is = plan_speeds(n, p.target.data(), p.height.data(), law, p.speed.data());
        ASSERT_TRUE(same_bits(p.speed, expected)) << n;
        ASSERT_EQ(is.moving, course.moving) << n;
        ASSERT_EQ(is.max_speed, course.max_speed) << n;
      }
  });
}

// A lag bounds the speed at any distance, within a part of the change of speed in a step.
TEST(MotionProfile, LagBoundsTheSpeedAtAnyDistance) {
  std::mt19937 random(1);
  const auto draw = [&](float low, float high) {
    return low * std::pow(high / low, std::uniform_real_distribution<float>(0, 1)(random));
  };
  for (int trial = 0; trial < 300; ++trial) {
    const float acceleration = draw(1, 1000), most = draw(0.1F, 100), lag = draw(1e-3F, 1),
                target = draw(0.01F, 10), dt = trial % 2 == 0 ? 1.0F / 60 : 1.0F / 240;
    SCOPED_TRACE(testing::Message() << "acceleration " << acceleration << " lag " << lag << " target "
                                    << target);
    const MotionProfile profile(most, acceleration, dt, lag);
    const float part = -std::expm1(-dt / lag);
    float position = 0, speed = 0;
    int steps = 0;
    for (; target - position > 1e-4F && steps < 1'000'000; ++steps) {
      const float distance = target - position, next = profile(distance, speed);
      ASSERT_LE(next, std::min(most, distance * part / dt) + 0.25F * acceleration * dt + 1e-5F) << distance;
      ASSERT_LE(std::abs(next - speed), acceleration * dt * 1.0001F + 1e-6F);
      speed = next;
      position = MotionProfile::advance(position, speed, target, dt);
    }
    ASSERT_LT(std::abs(target - position), 1.1e-4F);
    // Accelerating, braking and the lag's tail of 12 time constants.
    const float least = std::max(target / most, 2 * std::sqrt(target / acceleration));
    EXPECT_LT(static_cast<float>(steps) * dt, least + most / acceleration + 20 * lag + 5 * dt);
  }
}

TEST(PinKernels, AdvancePinsMatchesScalarLaw) {
  for_every_target([] {
    for (std::size_t n = 1; n <= kMaxPins; ++n) {
      Pins p(n, static_cast<unsigned>(n));
      const float unit = n % 2 == 0 ? 1.0F : 1e3F;
      for (std::size_t i = 0; i < n; i += 3) p.speed[i] = (p.target[i] - p.height[i]) / kPinStep;
      std::vector<float> expected = p.height;
      for (std::size_t i = 0; i < n; ++i)
        expected[i] = MotionProfile::advance(p.height[i], p.speed[i], p.target[i], kPinStep, unit);
      const float highest = advance_pins(n, p.target.data(), p.speed.data(), kPinStep, unit, p.height.data());
      ASSERT_TRUE(same_bits(p.height, expected)) << n;
      ASSERT_EQ(highest, *std::ranges::max_element(expected)) << n;
    }
  });
}

TEST(PinKernels, ClampCommandsReplacesAndCounts) {
  for_every_target([] {
    for (std::size_t n = 1; n <= kMaxPins; ++n) {
      Pins p(n, static_cast<unsigned>(n));
      const CellRun all[] = {{0, static_cast<int>(n)}};
      std::vector<float> clamped(n, 1.25F), expected(n), safe(n);
      for (std::size_t i = 0; i < n; ++i) safe[i] = 0.5F + 0.125F * static_cast<float>(i % 8);
      p.command[n / 2] = std::numeric_limits<float>::quiet_NaN();
      p.command[n / 3] = std::numeric_limits<float>::infinity();
      std::size_t changed = 0;
      for (std::size_t i = 0; i < n; ++i) {
        expected[i] = std::isnan(p.command[i]) ? safe[i] : std::clamp(p.command[i], 0.5F, 2.0F);
        changed += expected[i] != p.command[i];
      }
      const CommandUpdate replaced =
          clamp_commands(all, all[0], p.command.data(), 0.5F, 2.0F, safe.data(), clamped.data());
      const auto nan = static_cast<std::size_t>(
          std::ranges::count_if(p.command, [](float command) { return std::isnan(command); }));
      ASSERT_GT(changed, 0U) << n;
      ASSERT_EQ(replaced.nan, nan) << n;
      ASSERT_EQ(replaced.clamped, changed - nan) << n;
      ASSERT_TRUE(replaced.changed) << n;
      ASSERT_EQ(clamped, expected) << n;
    }
  });
}

TEST(PinKernels, ClampCommandsTellsWhetherAnyChanges) {
  for_every_target([] {
    for (std::size_t n = 1; n <= kMaxPins; ++n) {
      std::vector<float> held(n, 1.25F);
      const std::vector<float> safe(n, 0.75F);
      const CellRun all[] = {{0, static_cast<int>(n)}};
      for (std::size_t i = 0; i <= n; ++i) {  // the command of cell i; of none if i = n
        std::vector<float> command = held;
        if (i < n) command[i] = 1.5F;
        const CommandUpdate update =
            clamp_commands(all, all[0], command.data(), 0.5F, 2.0F, safe.data(), held.data());
        ASSERT_EQ(update.changed, i < n) << n << ' ' << i;
        ASSERT_EQ(update.clamped + update.nan, 0U);
        ASSERT_EQ(held, command) << n << ' ' << i;
        if (i < n) held[i] = 1.25F;
      }
    }
  });
}

// Runs of random lengths and gaps, some of whose cells are not commanded.
TEST(PinKernels, RunsOfCells) {
  for_every_target([] {
    std::mt19937 random(7);
    const auto draw = [&](int low, int high) {
      return std::uniform_int_distribution<int>(low, high)(random);
    };
    for (int repetition = 0; repetition < 200; ++repetition) {
      const int n = draw(1, 3000);
      Pins p(static_cast<std::size_t>(n), random());
      const int first = draw(0, n - 1);
      const CellRun within{first, draw(first + 1, n)};
      std::vector<CellRun> runs, hit;
      for (int at = draw(0, 20); at < n;) {
        const CellRun run{at, std::min(n, at + draw(1, 40))};
        runs.push_back(run);
        if (run.end > within.begin && run.begin < within.end) hit.push_back(run);
        at = run.end + draw(1, 20);
      }
      std::vector<float> clamped(p.command.size(), 1.25F), expected = clamped, targets = p.target;
      const std::vector<float> safe(p.command.size(), 0.75F);
      std::size_t replaced = 0;
      bool changed = false;
      for (const CellRun& run : runs)
        for (int i = run.begin; i < run.end; ++i) {
          const auto k = static_cast<std::size_t>(i);
          if (i >= within.begin && i < within.end) {
            expected[k] = std::clamp(p.command[k], 0.5F, 2.0F);
            replaced += expected[k] != p.command[k];
          }
          changed |= targets[k] != p.base[k] + expected[k];
          targets[k] = p.base[k] + expected[k];
        }
      ASSERT_EQ(clamp_commands(hit, within, &p.command[static_cast<std::size_t>(first)], 0.5F, 2.0F,
                               safe.data(), clamped.data())
                    .clamped,
                replaced);
      ASSERT_TRUE(same_bits(clamped, expected));
      ASSERT_EQ(update_targets(runs, p.base.data(), clamped.data(), p.target.data()), changed);
      ASSERT_TRUE(same_bits(p.target, targets));
    }
  });
}

TEST(PinKernels, UpdateTargetsReportsChanges) {
  for_every_target([] {
    for (std::size_t n = 1; n <= kMaxPins; ++n) {
      Pins p(n, static_cast<unsigned>(n));
      const CellRun all[] = {{0, static_cast<int>(n)}};
      ASSERT_FALSE(update_targets(all, p.base.data(), p.command.data(), p.target.data())) << n;
      p.command[n - 1] += 0.5F;
      ASSERT_TRUE(update_targets(all, p.base.data(), p.command.data(), p.target.data())) << n;
      ASSERT_EQ(p.target[n - 1], p.base[n - 1] + p.command[n - 1]) << n;
      ASSERT_FALSE(update_targets(all, p.base.data(), p.command.data(), p.target.data())) << n;
    }
  });
}
