// A body of unit mass on an axis: the segment that next_segment() leads to, whatever the first one, is where
// speed and impulse obey the law.
#include "smartsurf/world/solver/AxisLaw.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <random>
#include <string>

using smartsurf::world::AxisLaw;

namespace {

constexpr double kInfinity = std::numeric_limits<double>::infinity();

struct RandomLaw {
  double offset, slope, friction, motor_speed, motor, lower, upper;
  explicit RandomLaw(std::mt19937& random) {
    std::uniform_real_distribution<double> any(-1.0, 1.0);
    auto some = [&] { return random() % 2 == 0 ? 0.0 : std::abs(any(random)); };
    offset = any(random), slope = some(), friction = some(), motor = some();
    motor_speed = random() % 4 == 0 ? 0.0 : any(random);
    lower = random() % 2 == 0 ? -kInfinity : any(random);
    upper = random() % 2 == 0 ? kInfinity : std::max(lower, any(random));
  }
  AxisLaw law() const {
    AxisLaw out;
    out.reset(offset, slope);
    if (std::isfinite(upper)) out.add_step(AxisLaw::kUpper, upper, 0.0, -kInfinity);
    if (motor > 0.0) out.add_step(AxisLaw::kMotor, motor_speed, motor, -motor);
    if (std::isfinite(lower)) out.add_step(AxisLaw::kLower, lower, kInfinity, 0.0);
    if (friction > 0.0) out.add_step(AxisLaw::kFriction, 0.0, friction, -friction);
    return out;
  }
  // The speed u after the impulse, from u = start + impulse(u), by bisection: the right side does not grow
  // with u.
  double speed_after(double start) const {
    auto excess = [&](double u) {
      if (u < lower) return -1.0;
      if (u > upper) return 1.0;
      auto opposing = [u](double at, double most) { return u < at ? most : u > at ? -most : 0.0; };
      return u - start - offset + slope * u - opposing(0.0, friction) - opposing(motor_speed, motor);
    };
    double low = -10.0, high = 10.0;
    for (int i = 0; i < 200; ++i) {
      const double middle = 0.5 * (low + high);
      (excess(middle) < 0.0 ? low : high) = middle;
    }
    return high;
  }
};

}  // namespace

TEST(AxisLaw, IsObeyedWhereItsPlacesLead) {
  for (unsigned seed = 0; seed < 5000; ++seed) {
    SCOPED_TRACE("seed " + std::to_string(seed));
    std::mt19937 random(seed);
    const RandomLaw drawn(random);
    const AxisLaw law = drawn.law();
    const double start = std::uniform_real_distribution<double>(-2.0, 2.0)(random);
    int segment = law.segment_of(static_cast<std::uint8_t>(1U << random() % 5), start);
    double speed = 0.0;
    for (int round = 0;; ++round) {
      ASSERT_LT(round, 12);
      if (AxisLaw::is_held(segment))
        speed = law.held_speed(segment);
      else
        speed = (start + law.offset(segment)) / (1.0 + law.slope());
      ASSERT_TRUE(std::isfinite(speed));
      const int next = law.next_segment(segment, speed, speed - start, 1e-12, 1e-12);
      if (next == segment) break;
      segment = next;
    }
    EXPECT_NEAR(speed, drawn.speed_after(start), 1e-9);
  }
}
