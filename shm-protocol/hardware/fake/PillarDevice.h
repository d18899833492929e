// An array of pillars with touch, on which a ball rolls, like ArrayBot's: 17 mm from pillar to pillar, 55 mm
// of travel.
//
// Channels: pressure (u8, the load of each pillar in tenths of kg·cm/s²) and the actuator height (u8, in cm).
// The ball, of 10 g, is a point that rolls down the plane through the pillars near it, slows down by rolling
// friction, and loads the four around it; pillars follow their targets with a first-order lag. After every
// restart, and every ten seconds, the ball is placed somewhere else.
#pragma once

#include "shm-protocol/hardware/fake/EmulatedDevice.h"

namespace hardware {

class PillarDevice final : public EmulatedDevice {
 public:
  PillarDevice(std::uint16_t rows, std::uint16_t columns, std::uint32_t period_us, Write);

  // The distance of the ball from the middle of the array, cm.
  double distance() const;
  double seconds_since_placed() const { return period_s_ * static_cast<double>(periods_since_placed_); }

 private:
  struct Vector {
    double x, y;
  };
  void reset() override;
  void sense(std::uint64_t tick) override;
  void place_ball();
  Vector slope() const;
  void roll();
  void load_pillars();

  double period_s_;
  std::uint32_t placed_ = 0;  // number of times that the ball was placed
  std::uint64_t periods_since_placed_ = 0;
  Vector at_{0, 0}, speed_{0, 0};  // of the ball: columns and rows, cells/s
  std::vector<double> pillar_;     // heights, cm
  std::vector<std::uint8_t> pressure_;
};

}  // namespace hardware
