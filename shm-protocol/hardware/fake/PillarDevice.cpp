#include "shm-protocol/hardware/fake/PillarDevice.h"

#include <algorithm>
#include <cmath>
#include <utility>

namespace hardware {
namespace {

constexpr double kPitch = 1.7, kTravel = 5.5;     // cm
constexpr double kGravity = 981.0, kMass = 0.01;  // cm/s², kg
constexpr double kRolling = 5.0 / 7.0;     // share of a sphere's weight that accelerates it down a slope
constexpr double kRollingFriction = 0.02;  // deceleration per gravity
constexpr double kReach = 2.4;             // cells: the pillars under the ball
constexpr double kFollow = 0.25;           // share of the way to the target in one period
constexpr float kPressureScale = 0.1F, kHeightScale = 0.022F;
constexpr double kPlacement_s = 10.0;

}  // namespace

PillarDevice::PillarDevice(std::uint16_t rows, std::uint16_t columns, std::uint32_t period_us, Write write)
    : EmulatedDevice("pillars", rows, columns, static_cast<float>(kPitch), period_us, std::move(write)),
      period_s_(1e-6 * period_us),
      pillar_(cell_count()),
      pressure_(cell_count()) {
  set_channels({{describe(SSW_SENSOR, SSW_U8, "pressure", "kg*cm/s^2", 25.5F, kPressureScale),
                 pressure_.data(), nullptr}},
               {describe(SSW_ACTUATOR, SSW_U8, "height", "cm", static_cast<float>(kTravel), kHeightScale)});
}

double PillarDevice::distance() const {
  return kPitch * std::hypot(at_.x - 0.5 * (columns_ - 1), at_.y - 0.5 * (rows_ - 1));
}

void PillarDevice::reset() {
  std::ranges::fill(pillar_, 0.0);
  place_ball();
}

// Multiples of the golden ratio spread successive places over the array.
void PillarDevice::place_ball() {
  const double u = std::fmod(0.618034 * ++placed_, 1.0), v = std::fmod(0.754878 * placed_, 1.0);
  at_ = {(0.2 + 0.6 * u) * (columns_ - 1), (0.2 + 0.6 * v) * (rows_ - 1)};
  speed_ = {0, 0};
  periods_since_placed_ = 0;
}

// Returns the slope of the plane through the tops of the pillars near the ball, by least squares.
PillarDevice::Vector PillarDevice::slope() const {
  double sum_x = 0, sum_y = 0, xx = 0, yy = 0;
  for (int row = 0; row < rows_; ++row)
    for (int column = 0; column < columns_; ++column) {
      const double x = column - at_.x, y = row - at_.y;
      if (x * x + y * y > kReach * kReach) continue;
      const double height = pillar_[row * columns_ + column];
      sum_x += x * height;
      sum_y += y * height;
      xx += x * x;
      yy += y * y;
    }
  return {xx > 0 ? sum_x / (xx * kPitch) : 0, yy > 0 ? sum_y / (yy * kPitch) : 0};
}

void PillarDevice::roll() {
  const Vector down = slope();
  const double gravity = kGravity / kPitch;  // cells/s²
  speed_.x -= kRolling * gravity * down.x * period_s_;
  speed_.y -= kRolling * gravity * down.y * period_s_;
  const double speed = std::hypot(speed_.x, speed_.y);
  const double kept = speed > 0 ? std::max(0.0, 1.0 - kRollingFriction * gravity * period_s_ / speed) : 0.0;
  speed_ = {speed_.x * kept, speed_.y * kept};
  auto move = [this](double& at, double& velocity, int size) {
    at += velocity * period_s_;
    const double inside = std::clamp(at, 0.0, size - 1.0);  // a frame surrounds the array
    if (at != inside) velocity = 0;
    at = inside;
  };
  move(at_.x, speed_.x, columns_);
  move(at_.y, speed_.y, rows_);
}

void PillarDevice::load_pillars() {
  std::ranges::fill(pressure_, std::uint8_t{0});
  const int west = std::min(static_cast<int>(at_.x), std::max(columns_ - 2, 0)),
            north = std::min(static_cast<int>(at_.y), std::max(rows_ - 2, 0));
  for (int row = north; row < std::min<int>(north + 2, rows_); ++row)
    for (int column = west; column < std::min<int>(west + 2, columns_); ++column) {
      const double share = (1 - std::abs(at_.x - column)) * (1 - std::abs(at_.y - row));
      const double load = kMass * kGravity * std::max(share, 0.0);
      pressure_[row * columns_ + column] =
          static_cast<std::uint8_t>(std::lround(load / static_cast<double>(kPressureScale)));
    }
}

void PillarDevice::sense(std::uint64_t tick) {
  for (std::size_t cell = 0; cell < pillar_.size(); ++cell)
    pillar_[cell] +=
        kFollow * (static_cast<double>(heights()[cell]) * static_cast<double>(kHeightScale) - pillar_[cell]);
  const auto periods = std::max(1LL, std::llround(kPlacement_s / period_s_));
  if (tick % static_cast<std::uint64_t>(periods) == 0) place_ball();
  roll();
  ++periods_since_placed_;
  load_pillars();
}

}  // namespace hardware
