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
  double offset, slope, friction, motor_speed, motor, lower, upper, lead, lead_slope;
  explicit RandomLaw(std::mt19937& random) {
    std::uniform_real_distribution<double> any(-1.0, 1.0);
    auto some = [&] { return random() % 2 == 0 ? 0.0 : std::abs(any(random)); };
    offset = any(random), slope = some(), friction = some(), motor = some();
    motor_speed = random() % 4 == 0 ? 0.0 : any(random);
    lower = random() % 2 == 0 ? -kInfinity : any(random);
    upper = random() % 2 == 0 ? kInfinity : std::max(lower, any(random));
    lead = random() % 2 == 0 ? 0.0 : any(random), lead_slope = some();
  }
  AxisLaw law() const {
    AxisLaw out;
    out.reset(offset, slope, lead_slope);
    out.set_lead(lead);
    if (std::isfinite(upper)) out.add_step(AxisLaw::kUpper, upper, 0.0, -kInfinity);
    if (motor > 0.0) out.add_step(AxisLaw::kMotor, motor_speed, motor, -motor);
    if (std::isfinite(lower)) out.add_step(AxisLaw::kLower, lower, kInfinity, 0.0);
    if (friction > 0.0) out.add_step(AxisLaw::kFriction, 0.0, friction, -friction);
    return out;
  }
  // The speed u after the impulse, from u = start + impulse(u), by bisection: the right side does not grow
  // with u. The steps are at speeds of the coordinate, u + lead.
  double speed_after(double start) const {
    auto excess = [&](double u) {
      const double of_coordinate = u + lead;
      if (of_coordinate < lower) return -1.0;
      if (of_coordinate > upper) return 1.0;
      auto opposing = [&](double at, double most) {
        return of_coordinate < at ? most : of_coordinate > at ? -most : 0.0;
      };
      return u - start - offset + slope * u + lead_slope * lead - opposing(0.0, friction) -
             opposing(motor_speed, motor);
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
    const auto causes = static_cast<std::uint8_t>(1U << random() % 5);
    // A single axis begins in the right segment, unless it was held before.
    const int first = law.first_segment(causes, start, 0.0, 1.0);
    int segment = law.segment_of(causes, start);
    const bool was_held = AxisLaw::is_held(segment);
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
    if (!was_held) {
      EXPECT_EQ(first, segment);
    }
  }
}
