#include "shm-protocol/hardware/fake/ImperfectPins.h"

#include <algorithm>
#include <cmath>
#include <cstdio>

#include "common/hash/SplitMix64.h"

namespace hardware {

ImperfectPins::ImperfectPins(std::size_t cells, double range, double period_s, std::uint64_t seed)
    : range_(range), period_s_(period_s), random_(seed) {
  for (std::size_t i = 0; i < cells; ++i) {
    Cell c{};
    c.zero = range * uniform(-0.05, 0.05);
    c.slope = uniform(0.92, 1.08);
    c.play = range * uniform(0, 0.04);
    c.speed_up = range * uniform(2, 5);
    c.speed_down = range * uniform(2, 5);
    c.lag_s = period_s * uniform(1, 4);
    c.delay = static_cast<int>(uniform(0, 3));
    c.sensor_zero = range * uniform(-0.05, 0.05);
    c.noise = range * uniform(0.001, 0.003);
    const double fate = uniform(0, 1);
    c.state = fate < 0.02 ? 1 : fate < 0.04 ? 2 : 0;
    c.stuck_at = range * uniform(0.1, 0.9);
    cells_.push_back(c);
  }
  reset();
}

double ImperfectPins::uniform(double from, double to) {
  return from + (to - from) * static_cast<double>(common::next_splitmix64(random_) >> 11) * 0x1p-53;
}

double ImperfectPins::normal() {
  const double radius = std::sqrt(-2 * std::log(1 - uniform(0, 1)));
  return radius * std::cos(2 * std::acos(-1.0) * uniform(0, 1));
}

void ImperfectPins::reset() { motion_.assign(cells_.size(), {}); }

// In many small steps, so that no closed form is shared with what fits it.
void ImperfectPins::advance(std::span<const float> commands) {
  constexpr int kSteps = 64;
  const double dt = period_s_ / kSteps;
  for (std::size_t i = 0; i < cells_.size(); ++i) {
    const Cell& c = cells_[i];
    Motion& m = motion_[i];
    const auto u = static_cast<double>(commands[i]);
    if (!m.driven) std::fill(std::begin(m.past), std::end(m.past), u);
    std::copy_backward(m.past, m.past + 3, m.past + 4);
    m.past[0] = u;
    const double wanted = c.zero + c.slope * m.past[c.delay];
    m.drive = std::clamp(m.driven ? m.drive : wanted, wanted - 0.5 * c.play, wanted + 0.5 * c.play);
    m.driven = true;
    for (int k = 0; k < kSteps; ++k) {
      // The midpoint rule: errors of the order of (dt / lag)².
      const auto speed = [&](double height) {
        return std::clamp((m.drive - height) / c.lag_s, -c.speed_down, c.speed_up);
      };
      m.height += dt * speed(m.height + 0.5 * dt * speed(m.height));
    }
    m.height = std::clamp(m.height, 0.0, range_);
  }
}

double ImperfectPins::read(std::size_t i) {
  const Cell& c = cells_[i];
  const double noise = c.noise * normal();
  if (c.state == 2) return 0;
  return c.sensor_zero + (c.state == 1 ? c.stuck_at : motion_[i].height) + noise;
}

std::string ImperfectPins::truth(std::size_t columns, std::size_t first_row, std::size_t first_column) const {
  std::string all;
  for (std::size_t i = 0; i < cells_.size(); ++i) {
    const Cell& c = cells_[i];
    char line[256];
    std::snprintf(line, sizeof line, "%zu,%zu,%.9g,%.9g,%.9g,%.9g,%.9g,%.9g,%d,%.9g,%.9g,%d\n",
                  first_row + i / columns, first_column + i % columns, c.zero, c.slope, c.play, c.speed_up,
                  c.speed_down, c.lag_s, c.delay, c.sensor_zero, c.noise, c.state);
    all += line;
  }
  return all;
}

}  // namespace hardware
