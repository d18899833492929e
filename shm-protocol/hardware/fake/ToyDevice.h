// A device without physics: what it senses depends on the tick alone, so that any frame can be verified.
//
// Channels: proximity_hit (u8), pin_height (u16, thousandths of a unit), target_echo (u8, the active actuator
// frame) and the actuator height (u8, fiftieths of a unit).
#pragma once

#include "shm-protocol/hardware/fake/EmulatedDevice.h"

namespace hardware {

class ToyDevice final : public EmulatedDevice {
 public:
  ToyDevice(std::uint16_t rows, std::uint16_t columns, std::uint32_t period_us, Write);

 private:
  void reset() override;
  void sense(std::uint64_t tick) override;

  std::vector<std::uint8_t> hit_, echo_;
  std::vector<std::uint16_t> pin_;
};

}  // namespace hardware
